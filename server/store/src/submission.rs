//! A submission, its result, and the inbox in which it waits for the next commit.

use std::collections::BTreeMap;

use base::{
    job::{Cache, Job, JobId, Limits, SweepId},
    memory::Reservation,
};
use tokio::sync::{mpsc, oneshot};

use super::error::Result;

/// A job that is submitted, and not accepted yet.
#[derive(Clone, Debug)]
pub struct NewJob {
    /// The public id, if the client has chosen it.
    pub id: Option<JobId>,
    /// A name for people.
    pub name: Option<String>,
    /// Labels for programs.
    pub labels: BTreeMap<String, String>,
    /// The priority, −10 … 10.
    pub priority: i32,
    /// The time limits of the job.
    pub limits: Limits,
    /// Whether earlier results may answer the job.
    pub cache: Cache,
    /// The job that this one retries.
    pub parent: Option<JobId>,
    /// The sweep whose members the job solves.
    pub sweep: Option<SweepId>,
    /// The problem's title.
    pub title: Option<String>,
    /// The fingerprint of the problem.
    pub input_hash: String,
    /// The problem as JSON, without its title.
    pub problem: String,
    /// The hash of the stored mesh that the problem names.
    pub mesh: Option<String>,
    /// The memory that the job is estimated to need (bytes).
    pub memory_bytes: u64,
    /// The fingerprint of everything that the client submitted.
    pub payload: String,
}

/// A sweep that is submitted with its jobs, and not accepted yet.
#[derive(Clone, Debug)]
pub struct NewSweep {
    /// The public id of the sweep.
    pub id: SweepId,
    /// A name for people.
    pub name: Option<String>,
    /// Labels for programs.
    pub labels: BTreeMap<String, String>,
    /// The values in which members differ: JSON Pointers.
    pub paths: Vec<String>,
    /// The definition of the sweep's members, as JSON.
    pub definition: String,
    /// The members of each job, in the order of the jobs.
    pub groups: Vec<Vec<usize>>,
}

/// A key that makes a request repeatable.
#[derive(Clone, Debug)]
pub struct RequestKey {
    /// The text that the client has chosen.
    pub key: String,
    /// The fingerprint of the whole request.
    pub payload: String,
}

/// Jobs that are accepted together or not at all.
#[derive(Clone, Debug)]
pub struct Submission {
    /// The owner of the jobs and of the key.
    pub owner: String,
    /// The jobs, at least one.
    pub jobs: Vec<NewJob>,
    /// The sweep that the jobs solve; each job solves a group of its members.
    pub sweep: Option<NewSweep>,
    /// The request key, if the client has chosen one.
    pub key: Option<RequestKey>,
    /// The limits on the number of waiting jobs.
    pub limits: QueueLimits,
}

/// The limits on the number of waiting jobs.
#[derive(Clone, Copy, Debug)]
pub struct QueueLimits {
    /// The largest number of waiting jobs of all owners.
    pub queued: u32,
    /// The largest number of waiting jobs of the owner who submits; `None`: no limit apart from that of all owners.
    pub queued_of_owner: Option<u32>,
}

/// The result of a submission.
#[derive(Debug)]
pub struct Accepted {
    /// The jobs, in the order in which they were submitted.
    pub jobs: Vec<Job>,
    /// Whether the jobs existed already: the request key, or the id chosen by the client, was used before.
    pub replayed: bool,
    /// The next job of the queue, if a claim was requested and there is one.
    pub claim: Option<Claim>,
    /// The keys of the jobs whose status has changed since they were inserted: new jobs that were started or answered
    /// at once, and earlier jobs that were answered while the next job was claimed.
    pub changed: Vec<i64>,
}

/// A job that was claimed for a worker.
#[derive(Debug)]
pub struct Claim {
    /// The job, running.
    pub job: Job,
    /// The problem of the job as JSON, without its title.
    pub problem: String,
    /// The hash of the stored mesh that the problem names.
    pub mesh: Option<String>,
    /// The memory that is reserved for the job until its solver has returned; `None` at a worker elsewhere, which reserves it
    /// itself.
    pub memory: Option<Reservation>,
}

/// A place where one job can be solved.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// A slot of this service, within its memory budget.
    Here,
    /// A slot of a worker elsewhere, which says how much memory it has.
    Away(Lessee, Room),
}

/// A worker elsewhere.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lessee {
    /// The name that follows from its secret.
    pub worker: String,
    /// Its name for people.
    pub name: String,
}

/// The memory of a worker elsewhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    /// The memory that all its jobs together may take (bytes).
    pub whole: u64,
    /// The part that is free now (bytes).
    pub free: u64,
}

/// The largest number of submissions that share a commit.
pub(super) const MOST_PER_COMMIT: usize = 64;

/// A submission that waits for the next commit.
#[derive(Debug)]
pub(super) struct Pending {
    pub(super) submission: Submission,
    /// Whether the next job of the queue is to be claimed in the commit of the submission.
    pub(super) claim: bool,
    /// Whether the results that may answer the submission's jobs were checked before.
    pub(super) checked: bool,
    /// The channel to which the outcome of the submission is sent.
    pub(super) reply: oneshot::Sender<Result<Answer>>,
}

/// The outcome of a submission.
#[derive(Debug)]
pub(super) enum Answer {
    /// The jobs are accepted, and on the disk.
    Accepted(Box<Accepted>),
    /// The submission, not accepted: an earlier result may answer one of its jobs, and must be checked first, outside
    /// the transaction, since the check would occupy the single writer.
    ToCheck(Box<Submission>),
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
