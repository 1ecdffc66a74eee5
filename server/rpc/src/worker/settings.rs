//! The settings of a worker.

use std::time::Duration;

/// The settings of a worker.
#[derive(Clone, Debug)]
pub struct Settings {
    /// A name for people, such as that of the machine.
    pub name: String,
    /// How many jobs it solves at the same time.
    pub slots: u16,
    /// How many processors it may use.
    pub cores: u32,
    /// The memory that all its jobs together may take (bytes).
    pub memory_bytes: u64,
    /// How long it may be without a job before it ends.
    pub idle_exit: Option<Duration>,
    /// The secret by which the service that has started it as its process knows it: then its memory is that of its job, and it
    /// ends with its connection. `None`: it is a worker elsewhere.
    pub process: Option<Vec<u8>>,
    /// How long its jobs may go on when it is to end; then they are given back.
    pub grace: Duration,
}
