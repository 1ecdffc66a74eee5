//! A submission, its result, and the inbox in which it waits for the next commit.

use std::collections::BTreeMap;

use base::{
    job::{Cache, Job, JobId, Limits, SweepId},
    memory::Reservation,
};
use tokio::sync::{mpsc, oneshot};

use super::error::Result;

/// A job that is about to be accepted.
#[derive(Clone, Debug)]
pub struct NewJob {
    /// The public id, if the client has chosen it.
    pub id: Option<JobId>,
    /// A name for people.
    pub name: Option<String>,
    /// Labels for programs.
    pub labels: BTreeMap<String, String>,
    /// −10 … 10.
    pub priority: i32,
    /// The time limits of the job.
    pub limits: Limits,
    /// Whether earlier results may answer it.
    pub cache: Cache,
    /// The job that it retries.
    pub parent: Option<JobId>,
    /// The sweep whose members it solves.
    pub sweep: Option<SweepId>,
    /// The problem's title.
    pub title: Option<String>,
    /// Fingerprint of the problem.
    pub input_hash: String,
    /// The problem as JSON, without its title.
    pub problem: String,
    /// The stored mesh that it names.
    pub mesh: Option<String>,
    /// Memory that it is estimated to need (bytes).
    pub memory_bytes: u64,
    /// Fingerprint of everything that the client submitted.
    pub payload: String,
}

/// A sweep that is about to be accepted with its jobs.
#[derive(Clone, Debug)]
pub struct NewSweep {
    /// The public id of the sweep.
    pub id: SweepId,
    /// A name for people.
    pub name: Option<String>,
    /// Labels for programs.
    pub labels: BTreeMap<String, String>,
    /// JSON Pointers: what members differ in.
    pub paths: Vec<String>,
    /// What its members are, as JSON.
    pub definition: String,
    /// The members of each job, in the order of the jobs.
    pub groups: Vec<Vec<usize>>,
}

/// A key that makes a request repeatable.
#[derive(Clone, Debug)]
pub struct RequestKey {
    /// The client's text.
    pub key: String,
    /// Fingerprint of the whole request.
    pub payload: String,
}

/// Jobs that are accepted together or not at all.
#[derive(Clone, Debug)]
pub struct Submission {
    /// The owner of the jobs and of the key.
    pub owner: String,
    /// One or more.
    pub jobs: Vec<NewJob>,
    /// The sweep that the jobs solve, each a group of its members.
    pub sweep: Option<NewSweep>,
    /// The client's key.
    pub key: Option<RequestKey>,
    /// How many jobs may wait.
    pub limits: QueueLimits,
}

/// How many jobs may wait.
#[derive(Clone, Copy, Debug)]
pub struct QueueLimits {
    /// In all.
    pub queued: u32,
    /// Of the owner who submits them; `None`: as many as in all.
    pub queued_of_owner: Option<u32>,
}

/// The result of a submission.
#[derive(Debug)]
pub struct Accepted {
    /// The jobs, in the order in which they were submitted.
    pub jobs: Vec<Job>,
    /// Whether the jobs existed already: the key, or the id chosen by the client, was used before.
    pub replayed: bool,
    /// The next job of the queue, if a claim was requested and there is one.
    pub claim: Option<Claim>,
    /// Jobs whose status has changed since they were inserted: those of these that were started or answered at once, and others
    /// that were answered while the next job was claimed.
    pub changed: Vec<i64>,
}

/// A job that was claimed for a worker.
#[derive(Debug)]
pub struct Claim {
    /// The job, running.
    pub job: Job,
    /// The problem of the job as JSON, without its title.
    pub problem: String,
    /// The stored mesh that it names.
    pub mesh: Option<String>,
    /// The memory that is reserved for it until its solver has returned.
    pub memory: Reservation,
}

/// Most submissions that share a commit.
pub(super) const MOST_PER_COMMIT: usize = 64;

/// A submission that waits for the next commit.
#[derive(Debug)]
pub(super) struct Pending {
    pub(super) submission: Submission,
    /// Whether the next job of the queue is to be claimed with it.
    pub(super) claim: bool,
    /// Whether the results that may answer its jobs were checked before.
    pub(super) checked: bool,
    /// The channel for the answer.
    pub(super) reply: oneshot::Sender<Result<Answer>>,
}

/// What becomes of a submission.
#[derive(Debug)]
pub(super) enum Answer {
    /// The jobs are accepted, and on the disk.
    Accepted(Box<Accepted>),
    /// An earlier result may answer one of its jobs, and has to be checked first, which would occupy the single writer.
    ToCheck(Submission),
}

/// The inbox in which submissions wait for the next commit.
#[derive(Debug)]
pub(super) struct Inbox(pub(super) mpsc::Sender<Pending>);

impl Inbox {
    /// An inbox, and the receiver of its submissions.
    pub(super) fn new() -> (Inbox, mpsc::Receiver<Pending>) {
        let (sender, receiver) = mpsc::channel(4 * MOST_PER_COMMIT);
        (Inbox(sender), receiver)
    }
}
