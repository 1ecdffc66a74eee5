//! Accepting jobs: keys, names, and one commit for many clients.
//!
//! A commit costs a flush of the disk, whatever it holds. Submissions that arrive while one is under
//! way therefore wait together and share the next: each in a part of its own, so that one that is
//! refused undoes nothing of the others.

use std::{collections::BTreeMap, sync::Arc};

use tokio::sync::{mpsc, oneshot};

use super::{
    Result, Store, StoreError,
    change::{Change, Mark},
    delete::{deleted_id, owner_of_deleted},
    events,
    jobs::{self, Claim},
    line::Move,
    meshes,
    rows::{find, read},
    twins,
};
use crate::{
    caller::Owners,
    event::Payload,
    job::{Cache, Job, JobId, Limits, Status},
    time::Time,
};

/// Submissions that share a commit at most.
const TOGETHER: usize = 64;

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

type Asking = (Submission, bool, oneshot::Sender<Result<Accepted>>);

/// Where submissions wait for the next commit.
#[derive(Debug)]
pub(super) struct Door(mpsc::Sender<Asking>);

impl Door {
    /// A door, and what comes through it.
    pub(super) fn new() -> (Door, mpsc::Receiver<Asking>) {
        let (sender, receiver) = mpsc::channel(4 * TOGETHER);
        (Door(sender), receiver)
    }
}

impl Store {
    /// Accepts jobs. They are on the disk when this returns. With `claim` somebody is free to run a job, and the
    /// next one of the queue is claimed with the same commit.
    pub async fn submit(&self, submission: Submission, claim: bool) -> Result<Accepted> {
        let (reply, answer) = oneshot::channel();
        let gone = || StoreError::Folder("the store is closed".into());
        let sent = self.door.0.send((submission, claim, reply)).await;
        sent.map_err(|_| gone())?;
        answer.await.map_err(|_| gone())?
    }

    /// The jobs of a key that this owner has used before.
    pub async fn replay(&self, owner: &str, key: &RequestKey) -> Result<Option<Vec<Job>>> {
        let mut connection = self.reader.acquire().await?;
        let Some(keys) = keyed(&mut connection, owner, key).await? else {
            return Ok(None);
        };
        let Some(mut jobs) = remaining(&mut connection, keys).await? else {
            return Ok(None);
        };
        self.place(&mut connection, &mut jobs).await?;
        Ok(Some(jobs))
    }

    /// The job of an id that the client made, if this owner handed it in with that payload.
    pub async fn replay_named(&self, owner: &str, id: JobId, payload: &str) -> Result<Option<Job>> {
        let same: Option<i64> =
            sqlx::query_scalar("select id from job where uuid = ? and payload = ?")
                .bind(id.0.to_string())
                .bind(payload)
                .fetch_optional(&self.reader)
                .await?;
        match same {
            Some(_) => self.job(Owners::Only(owner), id).await,
            None => Ok(None),
        }
    }

    async fn commit_together(&self, asking: Vec<Asking>) {
        let (mut submissions, mut replies) = (vec![], vec![]);
        for (submission, claim, reply) in asking {
            submissions.push((submission, claim));
            replies.push(reply);
        }
        let mut answers = vec![];
        let committed = async {
            let mut change = self.change().await?;
            for (submission, claim) in submissions {
                let mark = change.mark().await?;
                match accept(&mut change, mark, submission, claim).await {
                    Ok(accepted) => {
                        change.keep().await?;
                        answers.push(Ok(accepted));
                    }
                    Err(cause) => match change.undo(mark).await {
                        Ok(()) => answers.push(Err(cause)),
                        // a full disk made the database undo all of it by itself, and is what to tell
                        Err(_) => return Err(cause),
                    },
                }
            }
            change.commit().await
        }
        .await;
        match committed {
            Ok(_) => {
                for (reply, accepted) in replies.into_iter().zip(answers) {
                    let _ = reply.send(accepted); // who asked may have gone
                }
            }
            Err(cause) => {
                for reply in replies {
                    let _ = reply.send(Err(cause.again()));
                }
            }
        }
    }
}

async fn accept(
    change: &mut Change<'_>,
    mark: Mark,
    submission: Submission,
    claim: bool,
) -> Result<Accepted> {
    let Submission {
        owner,
        jobs,
        key,
        max_queued,
    } = submission;
    if let Some(old) = known(change, &owner, &jobs, key.as_ref()).await? {
        return Ok(Accepted {
            jobs: old,
            replayed: true,
            claim: None,
            changed: vec![],
        });
    }
    let mut keys = vec![];
    for new in &jobs {
        keys.push(insert(change, &owner, new, max_queued).await?);
    }
    if let (Some(key), Some(first)) = (&key, keys.first()) {
        sqlx::query(
            "insert or replace into request_key (owner, key, payload, first_job, jobs, created_at) values (?, ?, ?, ?, ?, ?)",
        )
        .bind(&owner)
        .bind(&key.key)
        .bind(&key.payload)
        .bind(first)
        .bind(keys.len() as i64)
        .bind(Time::now().micros())
        .execute(change.sql())
        .await?;
    }
    let claim = match claim {
        true => jobs::claim(change).await?,
        false => None,
    };
    let mut accepted = vec![];
    for key in keys {
        accepted.push(read(change.sql(), key).await?);
    }
    Ok(Accepted {
        jobs: accepted,
        replayed: false,
        claim,
        changed: change.changed_since(mark),
    })
}

/// The jobs that a key or a client's own id stands for already.
async fn known(
    change: &mut Change<'_>,
    owner: &str,
    jobs: &[NewJob],
    key: Option<&RequestKey>,
) -> Result<Option<Vec<Job>>> {
    if let Some(key) = key
        && let Some(keys) = keyed(change.sql(), owner, key).await?
        && let Some(old) = remaining(change.sql(), keys).await?
    {
        return Ok(Some(old));
    }
    let mut old = vec![];
    for new in jobs {
        let Some(id) = new.id else { continue };
        let found: Option<(i64, String, Option<String>)> =
            sqlx::query_as("select id, owner, payload from job where uuid = ?")
                .bind(id.0.to_string())
                .fetch_optional(change.sql())
                .await?;
        match found {
            Some((key, theirs, Some(payload)))
                if theirs == owner && payload == new.payload && jobs.len() == 1 =>
            {
                old.push(read(change.sql(), key).await?);
            }
            Some(_) => return Err(StoreError::IdConflict(id)),
            None => match owner_of_deleted(change.sql(), id).await? {
                Some(theirs) if theirs == owner => return Err(StoreError::Deleted(id)),
                // another owner's id: whether that job is still there is not told
                Some(_) => return Err(StoreError::IdConflict(id)),
                None => {}
            },
        }
    }
    Ok((!old.is_empty()).then_some(old))
}

/// Commits submissions until the store is dropped.
pub(super) async fn commit_submissions(
    store: std::sync::Weak<Store>,
    mut door: mpsc::Receiver<Asking>,
) {
    while let Some(first) = door.recv().await {
        let Some(store) = store.upgrade() else { return };
        let mut waiting = vec![first];
        while waiting.len() < TOGETHER
            && let Ok(next) = door.try_recv()
        {
            waiting.push(next);
        }
        // In a task of its own: a panic there must not close the door for all who come later.
        let store: Arc<Store> = store;
        let done = tokio::spawn(async move { store.commit_together(waiting).await }).await;
        if let Err(panic) = done {
            tracing::error!(%panic, "submissions were lost to a panic: {panic}");
        }
    }
}

/// The keys of the jobs that a request key stands for.
async fn keyed(
    connection: &mut sqlx::SqliteConnection,
    owner: &str,
    key: &RequestKey,
) -> Result<Option<std::ops::Range<i64>>> {
    let found: Option<(String, i64, i64)> = sqlx::query_as(
        "select payload, first_job, jobs from request_key where owner = ? and key = ?",
    )
    .bind(owner)
    .bind(&key.key)
    .fetch_optional(connection)
    .await?;
    match found {
        None => Ok(None),
        Some((payload, first, jobs)) if payload == key.payload => Ok(Some(first..first + jobs)),
        Some(_) => Err(StoreError::KeyReuse),
    }
}

/// The jobs of a key that are still there. A key whose jobs were all deleted says so as long as that is
/// remembered; then it stands for nothing any more.
async fn remaining(
    connection: &mut sqlx::SqliteConnection,
    keys: std::ops::Range<i64>,
) -> Result<Option<Vec<Job>>> {
    let (mut jobs, mut deleted) = (vec![], None);
    for key in keys {
        match find(connection, key).await? {
            Some(job) => jobs.push(job),
            None => deleted = deleted_id(connection, key).await?.or(deleted),
        }
    }
    match (jobs.is_empty(), deleted) {
        (false, _) => Ok(Some(jobs)),
        (true, Some(id)) => Err(StoreError::Deleted(id)),
        (true, None) => Ok(None),
    }
}

/// Inserts a job: waiting, or answered at once by an earlier result, or joined to a twin.
async fn insert(
    change: &mut Change<'_>,
    owner: &str,
    new: &NewJob,
    max_queued: u32,
) -> Result<i64> {
    let answer = match new.cache {
        Cache::Use => twins::earlier(change, &new.input_hash).await?,
        Cache::Refresh | Cache::Off => None,
    };
    let twin_of = match (&answer, new.cache) {
        (Some(source), _) => Some(source.key), // for a moment
        (None, Cache::Use) => twins::under_way(change, new).await?,
        (None, _) => None,
    };
    let waits = twin_of.is_none();
    if answer.is_none() && change.waiting() >= max_queued as usize {
        return Err(StoreError::QueueFull);
    }
    if answer.is_none() {
        meshes::require(change.sql(), new.mesh.as_deref()).await?;
    }
    sqlx::query(
        "insert into problem (input_hash, body, mesh) values (?, ?, ?) on conflict do nothing",
    )
    .bind(&new.input_hash)
    .bind(&new.problem)
    .bind(&new.mesh)
    .execute(change.sql())
    .await?;
    let now = Time::now();
    let expires_at = now.after_s(new.limits.queue_ttl_s);
    let key: i64 = sqlx::query_scalar(
        "insert into job (uuid, status, name, title, labels, priority, input_hash, created_at, payload, parent,
                          cache, twin_of, timeout_s, queue_ttl_s, expires_at, owner)
         values (?, 'queued', ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?) returning id",
    )
    .bind(new.id.unwrap_or_default().0.to_string())
    .bind(&new.name)
    .bind(&new.title)
    .bind(serde_json::to_string(&new.labels)?)
    .bind(new.priority)
    .bind(&new.input_hash)
    .bind(now.micros())
    .bind(&new.payload)
    .bind(new.parent.map(|id| id.0.to_string()))
    .bind(new.cache.as_str())
    .bind(twin_of)
    .bind(new.limits.timeout_s)
    .bind(new.limits.queue_ttl_s)
    .bind(expires_at.micros())
    .bind(owner)
    .fetch_one(change.sql())
    .await?;
    write_labels(change, key, now, &new.labels).await?;
    let queued = [(now, Payload::status(Status::Queued))];
    events::append(change.sql(), key, 0, &queued).await?;
    let priority = new.priority;
    change.moves(match waits {
        true => Move::Enter { priority, key },
        false => Move::Join,
    });
    if let Some(source) = answer {
        let job = read(change.sql(), key).await?;
        twins::answer(change, &job, &source).await?;
    }
    Ok(key)
}

/// Labels as rows to search.
pub(super) async fn write_labels(
    change: &mut Change<'_>,
    key: i64,
    created_at: Time,
    labels: &BTreeMap<String, String>,
) -> Result<()> {
    for (name, value) in labels {
        sqlx::query("insert into job_label (key, value, created_at, job_id) values (?, ?, ?, ?)")
            .bind(name)
            .bind(value)
            .bind(created_at.micros())
            .bind(key)
            .execute(change.sql())
            .await?;
    }
    Ok(())
}
