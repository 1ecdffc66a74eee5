//! The commands, one file each.

mod demo;
pub mod examples;
mod explain;
mod output;
mod report;
mod serve;
mod solve;

use std::{io::IsTerminal, process::ExitCode};

use clap::{Parser, Subcommand};
use tracing::level_filters::LevelFilter;
use tracing_subscriber::EnvFilter;

use crate::{config::Config, rest};

/// What the process tells its caller. The names are the API's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// All is well.
    Ok = 0,
    /// Something failed.
    Failed = 1,
    /// The input is wrong.
    Invalid = 2,
    /// There is a solution, but it did not converge.
    NotConverged = 9,
}

/// Frictional contact problems, solved on their own or as jobs of a service
#[derive(Debug, Parser)]
#[command(name = "signorini", version, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Start the service: REST and gRPC on one port
    Serve(Config),
    /// Solve one problem here, without a service. Exit code: 0 converged, 9 not converged, 2 invalid
    Solve(solve::Arguments),
    /// Print the JSON Schema of a problem: every name, what it means and its default
    Schema,
    /// Say what an error code means, and what to do
    Explain(explain::Arguments),
    /// Print the description of the API over REST (OpenAPI 3.1)
    Openapi {
        /// As a page for people, with the rpcs and the tests: docs/api.md
        #[arg(long)]
        reference: bool,
    },
    /// Start a service for the occasion, submit five examples over REST and gRPC, watch them converge
    Demo,
}

/// Everything that the binary does.
pub fn main() -> ExitCode {
    let Cli { command } = Cli::parse();
    let exit = match command {
        Command::Serve(config) => {
            log(LevelFilter::INFO);
            with_runtime(serve::run(config))
        }
        Command::Solve(arguments) => {
            log(LevelFilter::WARN);
            solve::run(&arguments)
        }
        Command::Schema => solve::schema(),
        Command::Explain(arguments) => explain::run(&arguments),
        Command::Openapi { reference } => {
            if reference {
                print!("{}", rest::reference());
            } else {
                println!("{:#}", rest::openapi());
            }
            Ok(Exit::Ok)
        }
        Command::Demo => {
            log(LevelFilter::WARN);
            with_runtime(demo::run())
        }
    };
    let exit = exit.unwrap_or_else(|error| {
        eprintln!("signorini: {error:#}");
        Exit::Failed
    });
    ExitCode::from(exit as u8)
}

fn with_runtime(command: impl Future<Output = anyhow::Result<Exit>>) -> anyhow::Result<Exit> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()?;
    let exit = runtime.block_on(command);
    // Not dropped, which would wait for solvers that nobody can interrupt. All that is durable has
    // been closed; the process ends over their heads.
    runtime.shutdown_background();
    exit
}

/// One line per event on standard error, filtered by SIGNORINI_LOG, e.g. `info,service=debug`.
fn log(default: LevelFilter) {
    let filter = EnvFilter::builder()
        .with_default_directive(default.into())
        .with_env_var("SIGNORINI_LOG");
    tracing_subscriber::fmt()
        .with_env_filter(filter.from_env_lossy())
        .with_writer(std::io::stderr)
        // a log that cannot be written shall not end what it tells of
        .log_internal_errors(false)
        .with_ansi(std::io::stderr().is_terminal())
        .init();
}
