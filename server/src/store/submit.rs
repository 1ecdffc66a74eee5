//! Accepting jobs: one commit for many clients.
//!
//! A commit costs a flush of the disk, whatever it holds. Submissions that arrive while one is under
//! way therefore wait together and share the next: each in a part of its own, so that one that is
//! refused undoes nothing of the others.

use std::sync::{Arc, Weak};

use tokio::sync::{mpsc, oneshot};

use super::{
    change::{Change, Mark},
    claim,
    database::Store,
    error::{Result, StoreError},
    events, keys, labels,
    line::Move,
    meshes,
    rows::read,
    submission::{Accepted, Asking, NewJob, Submission, TOGETHER},
    twins,
};
use crate::{
    event::Payload,
    job::{Cache, Status},
    time::Time,
};

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
    if let Some(old) = keys::known(change, &owner, &jobs, key.as_ref()).await? {
        return Ok(Accepted {
            jobs: old,
            replayed: true,
            claim: None,
            changed: vec![],
        });
    }
    let mut inserted = vec![];
    for new in &jobs {
        inserted.push(insert(change, &owner, new, max_queued).await?);
    }
    if let Some(key) = &key {
        keys::remember(change, &owner, key, &inserted).await?;
    }
    let claim = match claim {
        true => claim::claim(change).await?,
        false => None,
    };
    let mut accepted = vec![];
    for key in inserted {
        accepted.push(read(change.sql(), key).await?);
    }
    Ok(Accepted {
        jobs: accepted,
        replayed: false,
        claim,
        changed: change.changed_since(mark),
    })
}

/// Commits submissions until the store is dropped.
pub(super) async fn commit_submissions(store: Weak<Store>, mut door: mpsc::Receiver<Asking>) {
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
    .bind(<&str>::from(new.cache))
    .bind(twin_of)
    .bind(new.limits.timeout_s)
    .bind(new.limits.queue_ttl_s)
    .bind(expires_at.micros())
    .bind(owner)
    .fetch_one(change.sql())
    .await?;
    labels::write(change, key, now, &new.labels).await?;
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
