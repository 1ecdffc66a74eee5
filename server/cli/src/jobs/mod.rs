//! The commands for the jobs and sweeps of a running service.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | commands | `submit`, `watch`, `wait`, `get`, `ls`, `table`, `result`, `plot`, `change` (cancel, retry, rm), `validate` |
//! | files of problems, decks and sweeps, and the lines of their violations | `file` |
//! | following a job through restarts of the service | `follow` |
//! | how jobs are printed | `listing` |
//! | curves in the terminal | `chart` |

mod change;
mod chart;
mod file;
pub(super) mod follow;
mod get;
mod id;
mod listing;
mod ls;
pub(super) mod plot;
mod result;
mod submit;
mod table;
mod validate;
mod wait;
mod watch;

use clap::Subcommand;

use super::exit::Exit;

#[derive(Debug, Subcommand)]
pub(super) enum Command {
    /// Submit problems and sweeps to a running service. Exit code: 0 accepted, 2 invalid, 5 no connection, 7 no valid
    /// token, 8 quota used up or queue full
    Submit(Box<submit::Arguments>),
    /// Print a job's iterations while it runs, until it ends. Exit code: 0 succeeded, 1 failed, 3 canceled, 9 not
    /// converged
    Watch(watch::Arguments),
    /// Wait until jobs end. Exit code: the worst of 0 succeeded, 1 failed, 3 canceled, 4 not ended in time, 9 not
    /// converged
    Wait(wait::Arguments),
    /// Print everything that is known about jobs
    Get(get::Arguments),
    /// List jobs, newest first
    Ls(Box<ls::Arguments>),
    /// Print or save jobs and the numbers of their results, with their errors, as one table
    Table(Box<table::Arguments>),
    /// Print or save the result of a job, or the table of a sweep
    Result(Box<result::Arguments>),
    /// Draw stresses and convergence in the terminal, or save and open figures
    Plot(plot::Arguments),
    #[command(flatten)]
    Change(change::Command),
    /// Check a problem without submitting it: all violations with their lines, or its cost. Exit code: 0 valid, 2 invalid
    Validate(validate::Arguments),
}

pub(super) async fn run(command: Command) -> anyhow::Result<Exit> {
    match command {
        Command::Submit(arguments) => submit::run(*arguments).await,
        Command::Watch(arguments) => watch::run(arguments).await,
        Command::Wait(arguments) => wait::run(arguments).await,
        Command::Get(arguments) => get::run(arguments).await,
        Command::Ls(arguments) => ls::run(*arguments).await,
        Command::Table(arguments) => table::run(*arguments).await,
        Command::Result(arguments) => result::run(*arguments).await,
        Command::Plot(arguments) => plot::run(arguments).await,
        Command::Change(command) => change::run(command).await,
        Command::Validate(arguments) => validate::run(arguments).await,
    }
}
