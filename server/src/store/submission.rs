//! What is handed in, and what comes of it; and where it waits for the next commit.

use std::collections::BTreeMap;

use tokio::sync::{mpsc, oneshot};

use super::error::Result;
use crate::job::{Cache, Job, JobId, Limits};

/// A job that is about to be accepted.
#[derive(Clone, Debug)]
pub struct NewJob {
    /// Its name, if the client made it.
    pub id: Option<JobId>,
    /// A name for people.
    pub name: Option<String>,
    /// Labels for programs.
    pub labels: BTreeMap<String, String>,
    /// −10 … 10.
    pub priority: i32,
    /// What it may take.
    pub limits: Limits,
    /// Whether earlier results may answer it.
    pub cache: Cache,
    /// The job that it tries again.
    pub parent: Option<JobId>,
    /// The problem's title, exactly.
    pub title: Option<String>,
    /// Fingerprint of the problem.
    pub input_hash: String,
    /// The problem as JSON, without its title.
    pub problem: String,
    /// The stored mesh that it names.
    pub mesh: Option<String>,
    /// Fingerprint of all that the client handed in.
    pub payload: String,
}

/// A key that makes a request repeatable.
#[derive(Clone, Debug)]
pub struct RequestKey {
    /// The client's own.
    pub key: String,
    /// Fingerprint of the whole request.
    pub payload: String,
}

/// Jobs that are accepted together or not at all.
#[derive(Clone, Debug)]
pub struct Submission {
    /// Whose jobs, and whose key.
    pub owner: String,
    /// One or more.
    pub jobs: Vec<NewJob>,
    /// The client's key.
    pub key: Option<RequestKey>,
    /// Most jobs that may wait.
    pub max_queued: u32,
}

/// What became of a submission.
#[derive(Debug)]
pub struct Accepted {
    /// Its jobs, in order.
    pub jobs: Vec<Job>,
    /// They were there already: the key, or the job's name, was used before.
    pub replayed: bool,
    /// The next job of the queue, if that was asked for and there is one.
    pub claim: Option<Claim>,
    /// Jobs that have changed with it, those among them that a result was there for when their turn came.
    pub changed: Vec<i64>,
}

/// A job that a worker has just taken.
#[derive(Debug)]
pub struct Claim {
    /// The job, running.
    pub job: Job,
    /// Its problem as JSON, without the title.
    pub problem: String,
    /// The stored mesh that it names.
    pub mesh: Option<String>,
}

/// Submissions that share a commit at most.
pub(super) const TOGETHER: usize = 64;

pub(super) type Asking = (Submission, bool, oneshot::Sender<Result<Accepted>>);

/// Where submissions wait for the next commit.
#[derive(Debug)]
pub(super) struct Door(pub(super) mpsc::Sender<Asking>);

impl Door {
    /// A door, and what comes through it.
    pub(super) fn new() -> (Door, mpsc::Receiver<Asking>) {
        let (sender, receiver) = mpsc::channel(4 * TOGETHER);
        (Door(sender), receiver)
    }
}
