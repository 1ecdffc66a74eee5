//! The configuration: one struct, whose doc comments are the help text, in the order of the help.

use std::{
    net::{SocketAddr, ToSocketAddrs},
    path::PathBuf,
};

use clap::{Args, ValueEnum};
use schemars::JsonSchema;
use serde::Serialize;
use strum::Display;

/// Settings of the service. A flag takes precedence over its environment variable.
#[derive(Clone, Debug, Args)]
pub struct Config {
    /// Address and port of both REST and gRPC; port 0 chooses a free one
    #[arg(
        long,
        env = "SIGNORINI_LISTEN",
        default_value = "127.0.0.1:8080",
        value_name = "ADDRESS",
        value_parser = address
    )]
    pub listen: SocketAddr,

    /// Folder of the store: jobs, results, meshes
    #[arg(
        long,
        env = "SIGNORINI_DATA",
        default_value = "./signorini-data",
        value_name = "FOLDER"
    )]
    pub data: PathBuf,

    /// Jobs solved at the same time, each on one core
    #[arg(long, env = "SIGNORINI_WORKERS", default_value_t = 2, value_name = "N",
          value_parser = clap::value_parser!(u16).range(1..=256))]
    pub workers: u16,

    /// Where jobs are solved: on threads of the service, or in processes, one for each worker and kept from job to job.
    /// What kills a process, such as a stack overflow, then costs only the job that it is solving
    #[arg(long, env = "SIGNORINI_ISOLATION", value_enum, default_value_t = Isolation::Thread)]
    pub isolation: Isolation,

    /// Maximum number of jobs in the queue; further ones are refused
    #[arg(
        long,
        env = "SIGNORINI_MAX_QUEUED",
        default_value_t = 100_000,
        value_name = "N"
    )]
    pub max_queued: u32,

    #[command(flatten)]
    #[allow(missing_docs)] // a doc comment here would become the help of the command
    pub memory: MemoryBudget,

    /// Memory for condensed bodies that are kept for later jobs on the same body, a part of the memory that running jobs
    /// share: bodies that no job uses give way to any job. 0 keeps none, and so does isolation `process` [default: a quarter
    /// of that memory]
    #[arg(long, env = "SIGNORINI_BODY_CACHE_BYTES", value_name = "BYTES")]
    pub body_cache_bytes: Option<u64>,

    /// Maximum size of a request body over REST
    #[arg(long, env = "SIGNORINI_MAX_BODY_BYTES", default_value_t = 16 << 20, value_name = "BYTES")]
    pub max_body_bytes: usize,

    /// Maximum size of an uploaded mesh file
    #[arg(long, env = "SIGNORINI_MAX_MESH_BYTES", default_value_t = 512 << 20, value_name = "BYTES")]
    pub max_mesh_bytes: usize,

    /// Maximum number of connections; fewer if the limit of open files is lower
    #[arg(long, env = "SIGNORINI_MAX_CONNECTIONS", default_value_t = 8192, value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..))]
    pub max_connections: u32,

    /// Maximum size of all request bodies in memory at the same time
    #[arg(long, env = "SIGNORINI_MAX_RECEIVED_BYTES", default_value_t = 64 << 20, value_name = "BYTES")]
    pub max_received_bytes: usize,

    /// Maximum size of all answers in memory at the same time
    #[arg(long, env = "SIGNORINI_MAX_SENT_BYTES", default_value_t = 128 << 20, value_name = "BYTES")]
    pub max_sent_bytes: usize,

    /// Time that open requests get to finish after SIGTERM; running jobs are requeued at once
    #[arg(
        long,
        env = "SIGNORINI_GRACE_S",
        default_value_t = 10,
        value_name = "SECONDS"
    )]
    pub grace_s: u64,
}

impl Config {
    /// Bytes of bodies that are kept. Worker processes keep none: each would hold bodies that the others cannot use.
    pub fn body_cache_bytes(&self) -> u64 {
        match self.isolation {
            Isolation::Thread => {
                let budget = self.memory.bytes();
                let bytes = self.body_cache_bytes.unwrap_or(budget / 4);
                bytes.min(budget)
            }
            Isolation::Process => 0,
        }
    }
}

/// An address and a port, by number or by name; of several addresses, the first.
fn address(text: &str) -> Result<SocketAddr, String> {
    const EXPECTED: &str =
        "expected an address and a port, such as 127.0.0.1:8080 or localhost:8080";
    let found = text
        .to_socket_addrs()
        .map_err(|error| format!("{EXPECTED} ({error})"))?;
    found.into_iter().next().ok_or_else(|| EXPECTED.into())
}

/// Where jobs are solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Display, Serialize, JsonSchema)]
#[strum(serialize_all = "lowercase")]
#[serde(rename_all = "lowercase")]
pub enum Isolation {
    /// On threads of the service
    Thread,
    /// In processes of their own
    Process,
}

/// The memory that running jobs share.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct MemoryBudget {
    /// Memory that running jobs share: a job is refused if it is estimated to need more, waits until its estimate fits
    /// beside those of the running jobs, and is ended if it uses more than its estimate and a margin (128 MiB divided by
    /// the number of workers) [default: half of the machine's memory]
    #[arg(long, env = "SIGNORINI_MEMORY_BUDGET_BYTES", value_name = "BYTES",
          value_parser = clap::value_parser!(u64).range(1 << 20..))]
    memory_budget_bytes: Option<u64>,
}

impl MemoryBudget {
    /// The budget in bytes.
    pub fn bytes(self) -> u64 {
        self.memory_budget_bytes
            .unwrap_or_else(|| machine_memory() / 2)
    }
}

/// Memory of this machine, or of the container that the process runs in.
fn machine_memory() -> u64 {
    // If the memory is unknown, problems are not refused for it; 8 GiB is a common small machine.
    const UNKNOWN: u64 = 8 << 30;
    let total = std::fs::read_to_string("/proc/meminfo")
        .ok()
        .and_then(|text| {
            let line = text.lines().find(|line| line.starts_with("MemTotal:"))?;
            Some(line.split_whitespace().nth(1)?.parse::<u64>().ok()? * 1024)
        });
    let container = std::fs::read_to_string("/sys/fs/cgroup/memory.max")
        .ok()
        .and_then(|text| text.trim().parse().ok());
    total.unwrap_or(UNKNOWN).min(container.unwrap_or(u64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_a_number_or_a_name_with_a_port() {
        assert_eq!(address("127.0.0.1:80"), Ok(([127, 0, 0, 1], 80).into()));
        assert!(address("localhost:80").is_ok_and(|found| found.ip().is_loopback()));
        for wrong in ["localhost", "127.0.0.1", "127.0.0.1:99999", ""] {
            let told = address(wrong);
            assert!(
                told.is_err_and(|text| text.contains("127.0.0.1:8080")),
                "{wrong}"
            );
        }
    }
}
