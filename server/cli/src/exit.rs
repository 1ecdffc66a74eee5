//! The exit codes of the process.

use std::fmt::Display;

use app::{CannotListen, OpenToAll};
use service::{config::HalfOfTls, error::ApiError};
use store::StoreError;
use strum::VariantArray;
use web::listener::BadCertificate;

use super::service::CallError;

/// How a command ends. If a signal ends it, a shell sees 128 plus the number of the signal, such as 130 for Ctrl-C
/// during `solve`; a panic gives 101.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, VariantArray)]
pub(super) enum Exit {
    /// Success.
    Ok,
    /// Something failed.
    Failed,
    /// The input is invalid.
    Invalid,
    /// The service cannot listen at its address.
    Listen,
    /// A job was canceled.
    Canceled,
    /// The folder of the store cannot be used.
    Folder,
    /// The jobs to wait for have not ended in time.
    TimedOut,
    /// Another process uses the store.
    Locked,
    /// The service cannot be reached.
    Unreachable,
    /// The store belongs to another program, or to a later version of this one.
    Schema,
    /// There is no such job or sweep.
    NotFound,
    /// Something that was stored is missing or damaged.
    Damaged,
    /// The service requires another token.
    Denied,
    /// The owner's quota is used up, or the queue is full.
    Quota,
    /// The solution did not converge.
    NotConverged,
}

impl Exit {
    /// The number that the process exits with. Some numbers have two meanings: one for commands that open a store,
    /// and another for commands that call a running service.
    pub(super) fn code(self) -> u8 {
        match self {
            Exit::Ok => 0,
            Exit::Failed => 1,
            Exit::Invalid => 2,
            Exit::Listen | Exit::Canceled => 3,
            Exit::Folder | Exit::TimedOut => 4,
            Exit::Locked | Exit::Unreachable => 5,
            Exit::Schema | Exit::NotFound => 6,
            Exit::Damaged | Exit::Denied => 7,
            Exit::Quota => 8,
            Exit::NotConverged => 9,
        }
    }

    /// The meaning of this end of a command, for `--help` and `docs/cli.md`.
    fn meaning(self) -> &'static str {
        match self {
            Exit::Ok => {
                "success: solve and sweep converged; the jobs of watch and wait succeeded; serve was stopped by SIGTERM or SIGINT"
            }
            Exit::Failed => {
                "anything else: a file cannot be read or written, contacts do not hold the body in the end, memory runs out, or a job failed (but see 9)"
            }
            Exit::Invalid => {
                "invalid or too large input: the problem, an option, a certificate, a token, or the code to be explained"
            }
            Exit::Listen => "serve: cannot listen at the address",
            Exit::Canceled => "client commands: the job was canceled",
            Exit::Folder => "serve, doctor, backup, restore, token: the folder cannot be used",
            Exit::TimedOut => "client commands: the job has not ended in the time to wait",
            Exit::Unreachable => "client commands: the service cannot be reached",
            Exit::NotFound => {
                "client commands: there is no such job, sweep, load step, result or token"
            }
            Exit::Denied => "client commands: no valid token, or a token without the needed scope",
            Exit::Quota => "client commands: the owner's quota is used up, or the queue is full",
            Exit::Locked => "serve, doctor, restore, token: another server uses the folder",
            Exit::Schema => {
                "serve, doctor, backup, restore, token: the store belongs to another program or version"
            }
            Exit::Damaged => {
                "serve, doctor, backup, restore, token: stored data is missing or damaged"
            }
            Exit::NotConverged => {
                "not converged, or some members of a sweep failed; the result is available anyway"
            }
        }
    }

    /// Lists all exit codes, one on each line.
    pub(super) fn list() -> String {
        let line = |exit: &Exit| format!("\n  {}  {}", exit.code(), exit.meaning());
        let lines: String = Exit::VARIANTS.iter().map(line).collect();
        format!("Exit codes:{lines}")
    }

    /// The end of a command that failed with this error.
    pub(super) fn of(error: &anyhow::Error) -> Exit {
        if let Some(Ended(exit)) = error.downcast_ref() {
            return *exit;
        }
        match error.downcast_ref() {
            Some(StoreError::Folder(_)) => Exit::Folder,
            Some(StoreError::Locked(_)) => Exit::Locked,
            Some(StoreError::Schema(_)) => Exit::Schema,
            Some(StoreError::Lost(_) | StoreError::Damaged(_) | StoreError::Broken(_)) => {
                Exit::Damaged
            }
            _ if error.is::<CallError>() => of_call(error),
            _ if error.is::<CannotListen>() => Exit::Listen,
            _ if error.is::<OpenToAll>() || is_invalid(error) => Exit::Invalid,
            _ if error.is::<HalfOfTls>() || error.is::<BadCertificate>() => Exit::Invalid,
            _ => Exit::Failed,
        }
    }
}

/// The error of a command whose message has been printed already.
#[derive(Debug, thiserror::Error)]
#[error("the exit code is {}", .0.code())]
pub(super) struct Ended(pub(super) Exit);

/// Prints what is wrong with the input, and ends the command.
pub(super) fn refuse(message: impl Display) -> anyhow::Error {
    eprintln!("{message}");
    Ended(Exit::Invalid).into()
}

/// The end of a command whose call to a running service failed.
fn of_call(error: &anyhow::Error) -> Exit {
    let Some(CallError::Refused(refusal)) = error.downcast_ref() else {
        return Exit::Unreachable;
    };
    match (refusal.status, refusal.code.as_str()) {
        (400 | 413 | 415 | 422, _) => Exit::Invalid,
        (401 | 403, _) => Exit::Denied,
        (404 | 410, _) => Exit::NotFound,
        (429, _) | (_, "queue-full") => Exit::Quota,
        _ => Exit::Failed,
    }
}

fn is_invalid(error: &anyhow::Error) -> bool {
    matches!(error.downcast_ref(), Some(ApiError::InvalidProblem(_)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_page_of_commands_has_every_exit_code_with_its_meaning() {
        let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/cli.md");
        let page = std::fs::read_to_string(page).unwrap();
        for exit in Exit::VARIANTS {
            let line = format!("| {} | {} |", exit.code(), exit.meaning());
            assert!(page.contains(&line), "docs/cli.md lacks the line\n{line}");
        }
    }
}
