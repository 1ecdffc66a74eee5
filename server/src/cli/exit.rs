//! The exit codes of the process.

/// How a command ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Exit {
    /// Success.
    Ok = 0,
    /// Something failed.
    Failed = 1,
    /// The input is invalid.
    Invalid = 2,
    /// The solution did not converge.
    NotConverged = 9,
}
