//! What service and worker tell each other, whatever carries it.

use std::fmt::{self, Display, Formatter};

use base::{event::Payload, job::JobId, sweep::MemberRow};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use store::Ending;

use super::super::ending::NoSolution;

/// The name of a worker, which follows from a secret that only the worker knows: so no other can speak for it.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct WorkerId(String);

impl WorkerId {
    /// The name of the worker with this secret.
    pub fn of(secret: &[u8]) -> WorkerId {
        let hash = Sha256::digest(secret);
        let digits = hash.iter().take(8).map(|byte| format!("{byte:02x}"));
        WorkerId(format!("worker_{}", digits.collect::<String>()))
    }

    /// The worker of this name, as it is stored.
    pub(in crate::queue) fn stored(name: String) -> WorkerId {
        WorkerId(name)
    }
}

impl Display for WorkerId {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// What a worker says about itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct About {
    /// A name for people, such as that of its machine.
    pub name: String,
    /// How many jobs it solves at the same time.
    pub slots: u32,
    /// How many processors it may use.
    pub cores: u32,
    /// The memory that all its jobs together may take (bytes).
    pub memory_bytes: u64,
    /// Whether it is a process on this machine: it solves the jobs of this machine's slots.
    pub here: bool,
}

/// A request of a worker for a job.
#[derive(Clone, Debug)]
pub struct Ask {
    /// The number of the request: another one for every job that the worker has received. A repeated request gets the job
    /// that it got before.
    pub number: u64,
    /// The memory that the worker has free (bytes).
    pub free_bytes: u64,
    /// Whether the worker takes a new job; otherwise it asks only whether a request with this number got one.
    pub takes: bool,
    /// The worker.
    pub about: About,
}

/// A job that is leased to a worker.
#[derive(Debug)]
pub struct Granted {
    /// The number of the request.
    pub number: u64,
    /// The job.
    pub job: JobId,
    /// The number of the attempt.
    pub attempt: i32,
    /// The estimated memory of the job (bytes); `None`: unknown, it takes all of the worker's memory.
    pub memory_bytes: Option<u64>,
    /// The hash of the stored mesh that the problem names.
    pub mesh: Option<String>,
    /// The session, which the reports name.
    pub session: u64,
    /// The task, as JSON of [`Task`](super::Task).
    pub task: Vec<u8>,
}

/// What a worker reports of one job.
#[derive(Clone, Debug, Default)]
pub struct JobReport {
    /// The session that the numbers of the report are about: it changes when the service restarts.
    pub session: u64,
    /// How many reports of this session come before these.
    pub first: u64,
    /// What its solver has told, each as JSON of [`Report`].
    pub reports: Vec<Vec<u8>>,
    /// A piece of a result.
    pub piece: Option<Piece>,
    /// The end of the attempt, as JSON of [`End`].
    pub end: Option<Vec<u8>>,
}

/// Something that the solver of a job has told.
#[derive(Debug, Serialize, Deserialize)]
pub enum Report {
    /// The problem has one load level on one grid.
    OneLevel,
    /// An event of the job. The service sets its time, since clocks of machines differ.
    Event(Payload),
    /// The result of a member of a sweep. The service sets its time.
    Member(Box<MemberRow>),
}

/// A piece of a result that is sent.
#[derive(Clone, Debug)]
pub struct Piece {
    /// The number of the result in this attempt, from 1: partial results come before the last one.
    pub upload: u64,
    /// Whether it is a partial result.
    pub partial: bool,
    /// The size of the whole result (bytes).
    pub total: u64,
    /// The SHA-256 of the whole result.
    pub sha256: Vec<u8>,
    /// Where the piece begins (bytes).
    pub offset: u64,
    /// The piece.
    pub bytes: Vec<u8>,
}

/// How an attempt has ended at a worker.
#[derive(Debug, Serialize, Deserialize)]
pub enum End {
    /// With a solution: the result that was sent last.
    Solved {
        /// How the job ends.
        ending: Ending,
        /// Whether the requested verification is missing.
        unverified: bool,
        /// The number of iterations.
        iterations: usize,
    },
    /// Without a solution.
    NoSolution(NoSolution),
    /// The worker is to end: the job is requeued, and the attempt does not count.
    GivenBack,
}

/// The answer to what a worker reports of one job.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct JobAnswer {
    /// The session. If the report was about another one, nothing of it was used: the worker begins again with what is not
    /// stored.
    pub session: u64,
    /// How many events of the attempt were stored when the session began.
    pub events: u64,
    /// How many reports have arrived.
    pub received: u64,
    /// How many of them are stored.
    pub stored: u64,
    /// The number of the result that is arriving.
    pub upload: u64,
    /// How much of it has arrived (bytes).
    pub upload_bytes: u64,
    /// Whether the solver should stop.
    pub stop: bool,
    /// Whether the lease is over: nothing of this attempt is needed any more.
    pub over: bool,
    /// What was wrong with the report; nothing wrong is used.
    pub refused: Option<String>,
}
