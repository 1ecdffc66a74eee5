//! The exit codes of the process.

use strum::VariantArray;

use crate::{
    app::{CannotListen, OpenToAll},
    config::HalfOfTls,
    error::ApiError,
    listener::BadCertificate,
    store::StoreError,
};

/// How a command ends. A signal ends it as the system does, for a shell 128 and its number: Ctrl-C during `solve` 130;
/// a panic with 101.
#[derive(Clone, Copy, Debug, PartialEq, Eq, VariantArray)]
pub(super) enum Exit {
    /// Success.
    Ok = 0,
    /// Something failed.
    Failed = 1,
    /// The input is invalid.
    Invalid = 2,
    /// The service cannot listen at its address.
    Listen = 3,
    /// The folder of the store cannot be used.
    Folder = 4,
    /// Another process uses the store.
    Locked = 5,
    /// The store is of another program, or of a later version of this one.
    Schema = 6,
    /// Something that was stored is missing or damaged.
    Damaged = 7,
    /// The solution did not converge.
    NotConverged = 9,
}

impl Exit {
    /// What it means, for `--help` and the README.
    fn meaning(self) -> &'static str {
        match self {
            Exit::Ok => {
                "success; of solve and sweep: converged; of serve: stopped by SIGTERM or SIGINT"
            }
            Exit::Failed => {
                "anything else: a file that cannot be read or written, a body that its contacts do not hold in the end, no memory"
            }
            Exit::Invalid => {
                "invalid or too large: the problem, an option, a certificate, a token, or the code to be explained"
            }
            Exit::Listen => "serve: cannot listen at the address",
            Exit::Folder => "serve, doctor, backup, restore, token: the folder cannot be used",
            Exit::Locked => "serve, doctor, restore, token: another server uses the folder",
            Exit::Schema => {
                "serve, doctor, backup, restore, token: the tables are of another program or version"
            }
            Exit::Damaged => {
                "serve, doctor, backup, restore, token: stored data is missing or damaged"
            }
            Exit::NotConverged => {
                "solve: not converged; sweep: some members failed; the result is written all the same"
            }
        }
    }

    /// All exit codes, a line each.
    pub(super) fn list() -> String {
        let line = |exit: &Exit| format!("\n  {}  {}", *exit as u8, exit.meaning());
        let lines: String = Exit::VARIANTS.iter().map(line).collect();
        format!("Exit codes:{lines}")
    }

    /// Of a command that ended with this error.
    pub(super) fn of(error: &anyhow::Error) -> Exit {
        match error.downcast_ref() {
            Some(StoreError::Folder(_)) => Exit::Folder,
            Some(StoreError::Locked(_)) => Exit::Locked,
            Some(StoreError::Schema(_)) => Exit::Schema,
            Some(StoreError::Lost(_) | StoreError::Damaged(_) | StoreError::Broken(_)) => {
                Exit::Damaged
            }
            _ if error.is::<CannotListen>() => Exit::Listen,
            _ if error.is::<OpenToAll>() || is_invalid(error) => Exit::Invalid,
            _ if error.is::<HalfOfTls>() || error.is::<BadCertificate>() => Exit::Invalid,
            _ => Exit::Failed,
        }
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
    fn the_readme_has_every_exit_code_with_its_meaning() {
        let readme = concat!(env!("CARGO_MANIFEST_DIR"), "/../README.md");
        let readme = std::fs::read_to_string(readme).unwrap();
        for exit in Exit::VARIANTS {
            let line = format!("| {} | {} |", *exit as u8, exit.meaning());
            assert!(readme.contains(&line), "README.md lacks the line\n{line}");
        }
    }
}
