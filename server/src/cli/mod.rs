//! The commands, one file each.

mod demo;
mod doctor;
pub mod examples;
mod exit;
mod explain;
mod output;
mod report;
mod serve;
mod solve;

use std::{io::IsTerminal, process::ExitCode};

use clap::{Parser, Subcommand};
use tracing::level_filters::LevelFilter;
use tracing_subscriber::{filter::Targets, prelude::*};

use self::exit::Exit;
use crate::{config::Config, rest};

/// Solves frictional contact problems, one at a time or as jobs of a service
#[derive(Debug, Parser)]
#[command(name = "signorini", version, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Start the service: REST and gRPC on one port. Exit code: 0 stopped, 3 cannot listen, 4 the folder cannot be used,
    /// 5 another server uses it, 6 its tables are of another program or version, 7 stored data is missing or damaged
    Serve(Config),
    /// Check a store that no server is using, and save what is intact. Exit code: 0 all is intact, 7 something is damaged
    Doctor(doctor::Arguments),
    /// Solve one problem without a service. Exit code: 0 converged, 9 not converged, 2 invalid input
    Solve(solve::Arguments),
    /// Print the JSON Schema of a problem: every field with its meaning and default
    Schema,
    /// Explain an error code and what to do about it
    Explain(explain::Arguments),
    /// Print the OpenAPI 3.1 description of the REST API
    Openapi {
        /// Print the reference in Markdown instead, with the rpcs: docs/api.md
        #[arg(long)]
        reference: bool,
    },
    /// Start a temporary service, submit the five examples over REST and gRPC, and watch them converge
    Demo,
}

/// Parses the command line and runs the command.
pub fn main() -> ExitCode {
    let Cli { command } = Cli::parse();
    let exit = match command {
        Command::Serve(config) => {
            log(LevelFilter::INFO);
            with_runtime(serve::run(config))
        }
        Command::Doctor(arguments) => {
            log(LevelFilter::WARN);
            with_runtime(doctor::run(arguments))
        }
        Command::Solve(arguments) => {
            log(LevelFilter::WARN);
            solve::run(&arguments)
        }
        Command::Schema => solve::schema(),
        Command::Explain(arguments) => explain::run(&arguments),
        Command::Openapi { reference } => {
            let text = match reference {
                true => rest::reference(),
                false => format!("{:#}\n", rest::openapi()),
            };
            output::print(&text).map(|()| Exit::Ok).map_err(Into::into)
        }
        Command::Demo => {
            log(LevelFilter::WARN);
            with_runtime(demo::run())
        }
    };
    let exit = exit.unwrap_or_else(|error| {
        eprintln!("signorini: {error:#}");
        Exit::of(&error)
    });
    ExitCode::from(exit as u8)
}

fn with_runtime(command: impl Future<Output = anyhow::Result<Exit>>) -> anyhow::Result<Exit> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()?;
    let exit = runtime.block_on(command);
    // Dropping it would wait for solvers, which cannot be interrupted. The store is closed already, so
    // the process may exit while they still run.
    runtime.shutdown_background();
    exit
}

/// One line per event on standard error, filtered by SIGNORINI_LOG, e.g. `info,service=debug`.
fn log(default: LevelFilter) {
    let asked = std::env::var("SIGNORINI_LOG").unwrap_or_default();
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(std::io::stderr)
        // a log that cannot be written must not end the process
        .log_internal_errors(false)
        .with_ansi(std::io::stderr().is_terminal());
    tracing_subscriber::registry()
        .with(lines)
        .with(filter(&asked, default))
        .init();
}

/// What is logged. An invalid filter is reported and ignored.
fn filter(asked: &str, default: LevelFilter) -> Targets {
    let default = Targets::new().with_default(default);
    if asked.trim().is_empty() {
        return default;
    }
    asked.parse().unwrap_or_else(|error| {
        eprintln!("signorini: SIGNORINI_LOG={asked} is ignored: {error}");
        default
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tracing::Level;

    #[test]
    fn a_log_filter_is_a_level_and_targets_or_the_default() {
        let debug = |asked| {
            let filter = filter(asked, LevelFilter::WARN);
            ["service::queue", "hyper"].map(|target| filter.would_enable(target, &Level::DEBUG))
        };
        assert_eq!(debug("info,service=debug"), [true, false]);
        assert_eq!(debug("debug"), [true, true]);
        for asked in ["", " ", "service=loud"] {
            assert_eq!(debug(asked), [false, false], "{asked}");
            let warnings = filter(asked, LevelFilter::WARN).would_enable("hyper", &Level::WARN);
            assert!(warnings, "{asked}");
        }
    }
}
