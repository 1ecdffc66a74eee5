//! Slurm, by its commands: submits pilots, which are jobs of Slurm that run `signorini worker`, lists and cancels them.
//!
//! The commands wait for a controller that is down: each has a time limit. What `squeue` lists is all that is known: finished
//! jobs vanish from it, so that an id which is not listed is neither running nor failed.

use std::{path::PathBuf, process::Stdio, time::Duration};

use anyhow::{Context, bail};
use sha2::{Digest, Sha256};
use tokio::{io::AsyncWriteExt, process::Command, time::timeout};

/// How long a command of Slurm may take.
const PATIENCE: Duration = Duration::from_secs(10);
/// How long before the end of its time a pilot is told to end (s); it takes no more jobs then.
const WARNING_S: u32 = 60;
/// How long its jobs may go on after that, or after SIGTERM (s); then they are given back. Slurm kills a job that is canceled 30 s
/// later, unless the cluster has another `KillWait`.
const GRACE_S: u32 = 15;

/// How pilots run.
#[derive(Clone, Debug)]
pub struct Pilots {
    /// The address of the service, as the nodes reach it.
    pub server: String,
    /// The token of the workers; it reaches them in their environment.
    pub token: Option<String>,
    /// The program on the nodes.
    pub program: PathBuf,
    /// PEM file, on the nodes, of the authority of the service's certificate.
    pub ca: Option<PathBuf>,
    /// Jobs that a pilot solves at the same time, each on one processor; `None`: a pilot takes a whole node.
    pub slots: Option<u16>,
    /// The time of a pilot.
    pub time: Duration,
    /// How long a pilot may be without a job before it ends.
    pub idle_exit: Duration,
    /// Further options of `sbatch`.
    pub options: Vec<String>,
}

/// A pilot that Slurm knows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pilot {
    /// Its id in Slurm.
    pub id: String,
    /// Its state in Slurm, such as PENDING.
    pub state: String,
    /// Why it waits, or where it runs.
    pub place: String,
    /// How long it has run.
    pub time: String,
}

impl Pilot {
    /// Whether it runs, or will.
    pub fn counts(&self) -> bool {
        matches!(
            &*self.state,
            "PENDING" | "RUNNING" | "CONFIGURING" | "REQUEUED"
        )
    }
}

impl Pilots {
    /// Submits as many pilots, as one array; returns its id.
    pub async fn submit(&self, count: u16) -> anyhow::Result<String> {
        let minutes = self.time.as_secs().div_ceil(60).max(1);
        let mut sbatch = Command::new("sbatch");
        sbatch
            .args([
                "--parsable",
                "--nodes=1",
                "--ntasks=1",
                "--output=/dev/null",
            ])
            .arg(format!("--job-name={}", name(&self.server)))
            .arg(format!("--array=1-{count}"))
            .arg(format!("--time={minutes}"))
            .arg(format!("--signal=B:USR1@{WARNING_S}"))
            // what else the environment holds is nobody's business there
            .arg("--export=PATH,HOME,SIGNORINI_TOKEN");
        match self.slots {
            Some(slots) => sbatch.arg(format!("--cpus-per-task={slots}")),
            None => sbatch.arg("--exclusive"),
        };
        sbatch.args(&self.options);
        match &self.token {
            Some(token) => sbatch.env("SIGNORINI_TOKEN", token),
            None => sbatch.env_remove("SIGNORINI_TOKEN"),
        };
        let answer = answer(sbatch, &self.script()).await?;
        // with several clusters, the name of the cluster follows
        Ok(answer
            .trim()
            .split(';')
            .next()
            .unwrap_or_default()
            .to_owned())
    }

    /// What a pilot runs.
    fn script(&self) -> String {
        let program = quoted(&self.program.to_string_lossy());
        let (server, idle) = (quoted(&self.server), self.idle_exit.as_secs_f64());
        let slots = self.slots.map(|slots| format!(" --slots {slots}"));
        let ca = self.ca.as_ref().map(|file| quoted(&file.to_string_lossy()));
        let ca = ca.map(|file| format!(" --ca {file}"));
        format!(
            "#!/bin/sh\n\
             # the memory that Slurm gives, if it limits it: a tenth is for the program itself\n\
             memory=${{SLURM_MEM_PER_NODE:+--memory-budget-bytes $((SLURM_MEM_PER_NODE * 943718))}}\n\
             exec {program} worker --server {server} --idle-exit {idle}s --grace {GRACE_S}s \
             --name \"${{SLURMD_NODENAME:-node}}:${{SLURM_JOB_ID:-0}}\"{}{} $memory\n",
            slots.unwrap_or_default(),
            ca.unwrap_or_default(),
        )
    }
}

/// The pilots of the service at this address that Slurm knows.
pub async fn pilots(server: &str) -> anyhow::Result<Vec<Pilot>> {
    let mut squeue = Command::new("squeue");
    squeue
        .args(["--noheader", "--array", "--format=%i|%T|%R|%M"])
        .arg(format!("--name={}", name(server)));
    let text = answer(squeue, "").await?;
    let pilot = |line: &str| {
        let mut parts = line.split('|').map(str::to_owned);
        Some(Pilot {
            id: parts.next()?,
            state: parts.next()?,
            place: parts.next()?,
            time: parts.next()?,
        })
    };
    Ok(text.lines().filter_map(pilot).collect())
}

/// Cancels the pilots of the service at this address: they give their jobs back.
pub async fn cancel(server: &str) -> anyhow::Result<()> {
    let mut scancel = Command::new("scancel");
    scancel.arg(format!("--name={}", name(server)));
    answer(scancel, "").await.map(|_| ())
}

/// The name in Slurm of the pilots of the service at this address, by which they are found.
fn name(server: &str) -> String {
    let hash = Sha256::digest(server.trim_end_matches('/'));
    let digits: String = hash
        .iter()
        .take(4)
        .map(|byte| format!("{byte:02x}"))
        .collect();
    format!("signorini-{digits}")
}

/// A text as one word of the shell.
fn quoted(text: &str) -> String {
    format!("'{}'", text.replace('\'', r"'\''"))
}

/// What a command prints that reads this input; an error if it fails or takes too long.
async fn answer(mut command: Command, input: &str) -> anyhow::Result<String> {
    let program = command
        .as_std()
        .get_program()
        .to_string_lossy()
        .into_owned();
    let missing = || format!("{program} cannot be run: is this a machine of a Slurm cluster?");
    let running = async {
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .kill_on_drop(true)
            .spawn()
            .with_context(missing)?;
        if let Some(mut stdin) = child.stdin.take() {
            // one that ends without reading says why below
            let _ = stdin.write_all(input.as_bytes()).await;
        }
        let output = child.wait_with_output().await.with_context(missing)?;
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr);
            bail!("{program}: {}", said.trim().replace('\n', "; "));
        }
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    };
    match timeout(PATIENCE, running).await {
        Ok(answer) => answer,
        Err(_) => bail!(
            "{program} has not answered in {} s: the controller of Slurm may be down",
            PATIENCE.as_secs()
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_script_has_its_texts_as_single_words() {
        let pilots = Pilots {
            server: "https://it's here".into(),
            token: Some("sgn_secret".into()),
            program: "/opt/a b/signorini".into(),
            ca: Some("/etc/$ca.pem".into()),
            slots: Some(4),
            time: Duration::from_secs(600),
            idle_exit: Duration::from_secs(60),
            options: vec![],
        };
        let script = pilots.script();
        assert!(
            script.contains(r"exec '/opt/a b/signorini' worker --server 'https://it'\''s here' --idle-exit 60s --grace 15s")
                && script.contains("--slots 4 --ca '/etc/$ca.pem'"),
            "{script}"
        );
        assert!(!script.contains("sgn_"), "the token is no part of it");
    }

    #[test]
    fn the_name_of_pilots_is_that_of_their_service() {
        assert_eq!(name("http://a:1"), name("http://a:1/"));
        assert_ne!(name("http://a:1"), name("http://a:2"));
    }
}
