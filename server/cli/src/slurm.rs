//! The commands `signorini slurm`: workers as jobs of Slurm.

use std::{env, path::PathBuf, time::Duration};

use anyhow::Context;
use app::slurm::{self, Pilots};
use clap::{Args, Subcommand};

use super::{exit::Exit, output, service::token_in, table::table, token::duration};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

/// The address by which pilots are found again.
#[derive(Debug, Args)]
struct Server {
    /// Address of the service, as the nodes reach it, such as https://lab.example:8080
    #[arg(long, env = "SIGNORINI_URL", value_name = "URL")]
    server: String,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Submit pilots: jobs of Slurm, each of which is a worker on one node
    Up(Box<Up>),
    /// List the pilots that Slurm knows
    Status(Server),
    /// Cancel the pilots: they give their jobs back to the service
    Down(Server),
}

#[derive(Debug, Args)]
struct Up {
    #[command(flatten)]
    server: Server,

    /// Number of pilots
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1000))]
    nodes: u16,

    /// Time of a pilot, such as 30m or 4h. A minute before its end it gives back the jobs that it cannot finish
    #[arg(long, value_name = "TIME", default_value = "1h", value_parser = duration)]
    time: Duration,

    /// Jobs that a pilot solves at the same time, each on one processor [default: a pilot takes a whole node]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    slots: Option<u16>,

    /// A pilot ends when it was without a job for this time
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = duration)]
    idle_exit: Duration,

    /// File of a token with the scope `work`, on this machine [default: the token in SIGNORINI_TOKEN, or the one that `login`
    /// has kept]
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,

    /// PEM file, on the nodes, of the authority that issued the service's certificate
    #[arg(long, value_name = "FILE")]
    ca: Option<PathBuf>,

    /// The program on the nodes [default: where it is on this machine]
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,

    /// Further options of `sbatch`, such as `--partition=short`
    #[arg(last = true, value_name = "OPTION")]
    options: Vec<String>,
}

pub(super) async fn run(arguments: Arguments) -> anyhow::Result<Exit> {
    match arguments.command {
        Command::Up(up) => {
            let count = up.nodes;
            let pilots = pilots(*up)?;
            let id = pilots.submit(count).await?;
            let them = base::text::number_of(count.into(), "pilot");
            output::print(&format!("{them} submitted to Slurm as {id}\n"))?;
        }
        Command::Status(Server { server }) => {
            let found = slurm::pilots(&server).await?;
            let rows: Vec<_> = found
                .into_iter()
                .map(|pilot| [pilot.id, pilot.state, pilot.time, pilot.place])
                .collect();
            output::print(&table(["PILOT", "STATE", "RAN", "NODE OR REASON"], &rows))?;
        }
        Command::Down(Server { server }) => slurm::cancel(&server).await?,
    }
    Ok(Exit::Ok)
}

fn pilots(up: Up) -> anyhow::Result<Pilots> {
    let server = up.server.server;
    let token = token_in(up.token_file.as_deref(), &server)?;
    Ok(Pilots {
        token,
        program: match up.program {
            Some(program) => program,
            None => {
                env::current_exe().context("this program cannot be found; --program names it")?
            }
        },
        ca: up.ca,
        slots: up.slots,
        time: up.time,
        idle_exit: up.idle_exit,
        options: up.options,
        server,
    })
}
