//! The commands of the program, one file each.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | commands of the service | `serve`, `worker`, `slurm`, `token`, `backup`, `restore`, `doctor`, `health`, `config` |
//! | settings of `serve` and their sources | `settings` |
//! | commands without a service | `solve`, `sweep`, `convert`, `demo`, `examples`, `explain` |
//! | tokens for services | `login`, `kept_tokens` |
//! | commands for a running service | `jobs` |
//! | calls of the service and its refusals | `service`, `client` |
//! | certificates that client commands trust | `pinned` |
//! | exit codes | `exit` |
//! | completions and manual pages | `pages` |
//! | `-o`: formats by file names, written atomically | `output` |
//! | printing progress, results, tables | `progress`, `report`, `table` |
//! | the log | `log`, `log_line` |
//! | messages to systemd | `notify` |

mod backup;
mod client;
mod config;
mod convert;
mod demo;
mod doctor;
mod examples;
mod exit;
mod explain;
mod health;
mod jobs;
mod kept_tokens;
mod log;
mod log_line;
mod login;
mod notify;
mod output;
mod pages;
mod pinned;
mod progress;
mod report;
mod restore;
mod serve;
mod service;
mod settings;
mod slurm;
mod solve;
mod sweep;
mod table;
mod token;
mod worker;

use std::{env, ffi::OsString, process::ExitCode};

use ::service::error::ApiError;
use app::WORKER;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use tokio::runtime::Builder;
use tracing::level_filters::LevelFilter;
use web::rest;

use self::exit::{Ended, Exit};

/// Solves frictional contact problems, one at a time or as jobs of a service
#[derive(Debug, Parser)]
#[command(name = "signorini", version, arg_required_else_help = true, after_help = Exit::list())]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Start the service: REST and gRPC on one port. Exit code: 0 stopped, 3 cannot listen, 4 the folder cannot be
    /// used, 5 another server uses it, 6 the store belongs to another program or version, 7 stored data is missing or
    /// damaged, 2 an invalid option, 1 anything else
    Serve(Box<settings::Arguments>),
    /// Show the settings of the service, and where they come from. Exit code: 0 printed, 2 an invalid setting
    Config(config::Arguments),
    /// Check a store that no server is using, and save everything that is intact. Exit code: 0 all is intact, 4 the
    /// folder cannot be used, 5 a server uses it, 6 the store belongs to another program or version, 7 something is
    /// missing or damaged, 2 an invalid option, 1 anything else
    Doctor(doctor::Arguments),
    /// Write a backup of the store to a new folder, also while a server uses it. Exit code: 0 done, 4 a folder cannot
    /// be used, 6 the store belongs to another program or a later version, 7 something is missing or damaged (if the
    /// store can be read, the backup is made anyway), 2 an invalid option, 1 anything else
    Backup(backup::Arguments),
    /// Copy a backup to a folder as a store for `serve`. Exit code: 0 done, 4 a folder cannot be used, 5 a server uses
    /// it, 6 the backup is of a later version, 7 the backup is damaged, 2 an invalid option, 1 anything else
    Restore(restore::Arguments),
    /// Ask a running service whether it is ready, and print its answer. Exit code: 0 ready, 2 an invalid option, 1 not
    /// ready, or no answer within five seconds
    Health(health::Arguments),
    /// Create, list, revoke and rotate the tokens that identify clients. Exit code: 0 done, 4 the folder cannot be
    /// used, 5 a server uses it (give its address with --url), 2 an invalid option, 1 anything else; with --url the
    /// codes of client commands
    Token(token::Arguments),
    /// Keep the token for a service in a file that only you can read; client commands and the client for Python use it.
    /// Exit code: 0 kept, 5 no connection, 7 not a valid token, 1 anything else
    Login(login::Arguments),
    /// Forget the token for a service. Exit code: 0 done, 6 there is none, 1 anything else
    Logout(login::Arguments),
    /// Solve one problem without a service. Exit code: 0 converged, 9 not converged (the result is written), 2 invalid
    /// or too large, 1 anything else, such as a file that cannot be read, or contacts that do not hold the body
    Solve(solve::Arguments),
    /// Solve a sweep without a service: one problem with many values. Exit code: 0 all members converged, 9 some did not
    /// (the table is written), 2 invalid or too large, 1 anything else
    Sweep(sweep::Arguments),
    #[command(flatten)]
    Jobs(jobs::Command),
    /// Print the JSON Schema of a problem: every field with its meaning and default
    Schema,
    /// Print the problem of a deck as JSON: to change it, or to submit it with any client. Exit code: 0 printed, 2 not a
    /// problem, 1 anything else
    Convert(convert::Arguments),
    /// Write the problems, decks and meshes of the documentation to a folder. Exit code: 0 written, 1 they cannot be
    /// written
    Examples(examples::Arguments),
    /// Explain an error code and what to do about it
    Explain(explain::Arguments),
    /// Print the OpenAPI 3.0 description of the REST API
    Openapi {
        /// Print the reference in Markdown instead, with the rpcs: docs/api.md
        #[arg(long)]
        reference: bool,
    },
    /// Print the script that completes commands and options in a shell
    Completions(pages::Completions),
    /// Print or write the manual pages of the commands
    Man(pages::Man),
    /// Solve jobs of a service that runs elsewhere, until a signal or until there was no job for long. Exit code: 0 ended, 2
    /// an invalid option, 1 the service does not accept this worker, or anything else
    #[command(name = WORKER)]
    Worker(worker::Arguments),
    /// Workers as jobs of Slurm: submit, list and cancel them. Exit code: 0 done, 2 an invalid option, 1 Slurm does not do it, or
    /// does not answer within ten seconds
    Slurm(slurm::Arguments),
    /// Start a temporary service, let it solve the five examples over REST and gRPC, and show their verdicts and a figure
    Demo,
}

/// Parses the command line and runs the command.
pub fn main() -> ExitCode {
    let line: Vec<OsString> = env::args_os().collect();
    let (command, lines) = match settings::with_file(Cli::command(), &line) {
        Ok(found) => found,
        Err(wrong) => {
            wrong
                .iter()
                .for_each(|wrong| eprintln!("signorini: {wrong}"));
            return ExitCode::from(Exit::Invalid.code());
        }
    };
    let matches = command.get_matches_from(line);
    let Cli { command } = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let exit = match command {
        Command::Serve(arguments) => {
            let config = arguments.settings;
            let written = log::start_as(&config.telemetry);
            with_runtime(serve::run(&config, written.lost()))
        }
        Command::Config(arguments) => {
            let all = Cli::command();
            let (_, given) = settings::innermost(&all, &matches);
            config::run(arguments, given, &lines)
        }
        Command::Doctor(arguments) => with_warnings(doctor::run(arguments)),
        Command::Backup(arguments) => with_warnings(backup::run(arguments)),
        Command::Restore(arguments) => with_warnings(restore::run(arguments)),
        Command::Health(arguments) => with_warnings(health::run(arguments)),
        Command::Token(arguments) => {
            let _lines = log::start(LevelFilter::WARN);
            let all = Cli::command();
            let (_, given) = settings::innermost(&all, &matches);
            with_runtime(token::run(arguments, token::names_folder(given)))
        }
        Command::Login(arguments) => with_warnings(login::login(arguments)),
        Command::Logout(arguments) => login::logout(arguments),
        Command::Solve(arguments) => {
            let _lines = log::start(LevelFilter::WARN);
            solve::run(&arguments)
        }
        Command::Sweep(arguments) => {
            let _lines = log::start(LevelFilter::WARN);
            sweep::run(&arguments)
        }
        Command::Jobs(command) => with_warnings(jobs::run(command)),
        Command::Completions(arguments) => pages::completions(&arguments, Cli::command()),
        Command::Man(arguments) => pages::man(&arguments, Cli::command()),
        Command::Schema => solve::schema(),
        Command::Convert(arguments) => convert::run(&arguments),
        Command::Examples(arguments) => examples::run(&arguments),
        Command::Explain(arguments) => explain::run(&arguments),
        Command::Openapi { reference } => {
            let text = if reference {
                rest::reference()
            } else {
                format!("{:#}\n", rest::openapi())
            };
            output::print(&text).map(|()| Exit::Ok).map_err(Into::into)
        }
        Command::Worker(arguments) => {
            let _lines = log::start_of_worker(arguments.log_level());
            // a thread beside the solvers; more would only wake each other
            on(Builder::new_current_thread(), worker::run(arguments))
        }
        Command::Slurm(arguments) => with_warnings(slurm::run(arguments)),
        Command::Demo => with_warnings(demo::run()),
    };
    let exit = exit.unwrap_or_else(|error| {
        match error.downcast_ref() {
            Some(ApiError::InvalidProblem(violations)) => {
                violations
                    .iter()
                    .for_each(|violation| eprintln!("signorini: {violation}"));
            }
            None if error.is::<Ended>() => {}
            _ => eprintln!("signorini: {error:#}"),
        }
        Exit::of(&error)
    });
    ExitCode::from(exit.code())
}

/// Runs a command whose log has warnings and errors.
fn with_warnings(command: impl Future<Output = anyhow::Result<Exit>>) -> anyhow::Result<Exit> {
    let _lines = log::start(LevelFilter::WARN);
    with_runtime(command)
}

fn with_runtime(command: impl Future<Output = anyhow::Result<Exit>>) -> anyhow::Result<Exit> {
    on(Builder::new_multi_thread(), command)
}

fn on(
    mut runtime: Builder,
    command: impl Future<Output = anyhow::Result<Exit>>,
) -> anyhow::Result<Exit> {
    let runtime = runtime.enable_all().build()?;
    let exit = runtime.block_on(command);
    // Dropping it would wait for solvers, which cannot be interrupted. The store is closed already, so
    // the process may exit while they still run.
    runtime.shutdown_background();
    exit
}
