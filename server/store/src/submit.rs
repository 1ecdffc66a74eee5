//! Accepts jobs: one commit for many clients.
//!
//! A commit costs a flush of the disk, whatever it contains. Submissions that arrive during a commit therefore wait
//! together and share the next one, each with a savepoint of its own if there are several, so that a refused submission
//! does not affect the others.

use std::{
    panic::AssertUnwindSafe,
    sync::{Arc, Weak},
};

use base::{
    failpoint::{self, Point},
    job::{Cache, Job},
};
use futures_util::FutureExt;
use tokio::sync::{mpsc, oneshot};

use super::{
    change::Change,
    claim, coalescing,
    connections::closed,
    content::{self, Holder, NewContent, name},
    database::{Store, Writer},
    error::{Result, StoreError},
    keys, labels, meshes,
    rows::JobRow,
    submission::{
        Accepted, Answer, MOST_PER_COMMIT, NewJob, Pending, Place, QueueLimits, Submission,
    },
    sweeps,
};

impl Store {
    /// Accepts jobs, which are on the disk when this returns. With `claim` (a worker is free) the next job of the queue
    /// is claimed in the same commit, if it fits into the memory budget.
    pub async fn submit(self: &Arc<Self>, submission: Submission, claim: bool) -> Result<Accepted> {
        if claim {
            self.check_result_for_next().await;
        }
        match self.send(submission, claim, false).await? {
            Answer::Accepted(accepted) => Ok(*accepted),
            Answer::ToCheck(submission) => {
                let jobs = submission.jobs.iter();
                for job in jobs.filter(|job| job.cache == Cache::Use) {
                    self.check_earlier_result(&job.input_hash).await;
                }
                match self.send(*submission, claim, true).await? {
                    Answer::Accepted(accepted) => Ok(*accepted),
                    Answer::ToCheck(_) => Err(StoreError::Unexpected("checked twice".into())),
                }
            }
        }
    }

    /// Sends a submission to the inbox of the next commit, and waits for its outcome.
    async fn send(&self, submission: Submission, claim: bool, checked: bool) -> Result<Answer> {
        let (reply, answer) = oneshot::channel();
        let pending = Pending {
            submission,
            claim,
            checked,
            reply,
        };
        let sent = self.inbox.0.send(pending).await;
        sent.map_err(|_| closed())?;
        answer.await.map_err(|_| closed())?
    }

    /// Accepts submissions in one commit, and sends each its outcome.
    async fn commit_together(self: &Arc<Self>, pending: Vec<Pending>) {
        let (mut submissions, mut replies) = (vec![], vec![]);
        for one in pending {
            submissions.push((one.submission, one.claim, one.checked));
            replies.push(one.reply);
        }
        let committed = self.write(|writer| accept_together(writer, submissions));
        match committed.await {
            Ok(answers) => {
                for (reply, answer) in replies.into_iter().zip(answers) {
                    if let Ok(Answer::Accepted(accepted)) = &answer {
                        let jobs = accepted.jobs.iter();
                        jobs.for_each(|job| failpoint::pass(Point::Answered, job.id));
                    }
                    let _ = reply.send(answer); // the client may have disconnected
                }
            }
            Err(cause) => match <[_; 1]>::try_from(replies) {
                Ok([reply]) => _ = reply.send(Err(cause)),
                Err(replies) => {
                    for reply in replies {
                        let _ = reply.send(Err(cause.for_another()));
                    }
                }
            },
        }
    }
}

/// Accepts submissions in one transaction; returns the outcome of each.
fn accept_together(
    writer: &Writer<'_>,
    submissions: Vec<(Submission, bool, bool)>,
) -> Result<Vec<Result<Answer>>> {
    let mut change = writer.change()?;
    let mut answers = vec![];
    // SQLite copies each page that is changed after a savepoint: a submission alone does without
    let alone = submissions.len() == 1;
    for (submission, claim, checked) in submissions {
        if !checked && coalescing::has_result_to_check(writer, &submission.jobs) {
            answers.push(Ok(Answer::ToCheck(Box::new(submission))));
            continue;
        }
        let savepoint = if alone {
            None
        } else {
            Some(change.savepoint()?)
        };
        match (accept(&mut change, submission, claim), savepoint) {
            (Ok(accepted), savepoint) => {
                if savepoint.is_some() {
                    change.release()?;
                }
                answers.push(Ok(Answer::Accepted(Box::new(accepted))));
            }
            (Err(cause), None) => return Err(cause),
            (Err(cause), Some(savepoint)) => match change.roll_back_to(savepoint) {
                Ok(()) => answers.push(writer.store.damages.noting(Err(cause))),
                // a full disk has made the database roll back everything: report that as the cause
                Err(_) => return Err(cause),
            },
        }
    }
    change.commit()?;
    let accepted = answers
        .iter_mut()
        .flatten()
        .filter_map(|answer| match answer {
            Answer::Accepted(accepted) => Some(accepted),
            Answer::ToCheck(_) => None,
        });
    let mut jobs: Vec<&mut Job> = accepted.flat_map(|answer| &mut answer.jobs).collect();
    writer.store.try_to_complete(writer.connection(), &mut jobs);
    Ok(answers)
}

/// Accepts one submission within the transaction.
fn accept(change: &mut Change<'_>, submission: Submission, claim: bool) -> Result<Accepted> {
    let changes = change.changes();
    let Submission {
        owner,
        jobs,
        sweep,
        key,
        limits,
    } = submission;
    if let Some(old) = keys::already_submitted(change, &owner, &jobs, key.as_ref())? {
        return Ok(Accepted {
            jobs: old,
            replayed: true,
            claim: None,
            changed: vec![],
        });
    }
    let mut inserted = vec![];
    let sweep_key = match &sweep {
        Some(new) => Some((
            sweeps::insert(change, &owner, new)?,
            NewContent::new(new.definition.as_bytes()),
        )),
        None => None,
    };
    let mut groups = sweep.iter().flat_map(|sweep| &sweep.groups);
    for new in &jobs {
        let key = insert(change, &owner, new, limits)?;
        if let (Some((sweep, definition)), Some(members)) = (&sweep_key, groups.next()) {
            let tx = change.sql()?;
            sweeps::insert_members(tx, *sweep, key, members)?;
            let is_first = inserted.is_empty();
            sweeps::attach_definition(tx, key, definition, is_first)?;
        }
        inserted.push(key);
    }
    if let Some(key) = &key {
        keys::remember(change, &owner, key, &inserted)?;
    }
    let places: &[Place] = if claim { &[Place::Here] } else { &[] };
    let claim = claim::claim(change, places)?.pop().map(|(_, claim)| claim);
    let mut accepted = vec![];
    for key in inserted {
        accepted.push(change.read(key)?);
    }
    if accepted
        .iter()
        .any(|job| failpoint::fails(Point::Accepted, job.id))
    {
        return Err(StoreError::Full);
    }
    Ok(Accepted {
        jobs: accepted,
        replayed: false,
        claim,
        changed: change.changed_since(changes),
    })
}

/// Commits submissions until the store is dropped.
pub(super) async fn commit_submissions(store: Weak<Store>, mut inbox: mpsc::Receiver<Pending>) {
    while let Some(first) = inbox.recv().await {
        let Some(store) = store.upgrade() else { return };
        let mut pending = vec![first];
        while pending.len() < MOST_PER_COMMIT
            && let Ok(next) = inbox.try_recv()
        {
            pending.push(next);
        }
        // a panic there must not close the inbox for all later submissions
        let committed = AssertUnwindSafe(store.commit_together(pending)).catch_unwind();
        if committed.await.is_err() {
            tracing::error!("submissions were lost to a panic");
        }
    }
}

/// Inserts a job: waiting for a worker, answered at once by an earlier result, or coalesced into another.
pub(super) fn insert(
    change: &mut Change<'_>,
    owner: &str,
    new: &NewJob,
    limits: QueueLimits,
) -> Result<i64> {
    let answer = match new.cache {
        Cache::Use => coalescing::earlier_result(change, &new.input_hash)?,
        Cache::Refresh | Cache::Off => None,
    };
    let coalesced_into = match (&answer, new.cache) {
        (None, Cache::Use) => coalescing::primary_for(change, owner, new)?,
        _ => None,
    };
    if answer.is_none() && change.waiting()? >= limits.queued as usize {
        return Err(StoreError::QueueFull);
    }
    if answer.is_none()
        && let Some(most) = limits.queued_of_owner
        && change.waiting_of(owner)? >= u64::from(most)
    {
        return Err(StoreError::OwnerQueueFull);
    }
    if answer.is_none() {
        meshes::require(change.sql()?, new.mesh.as_deref())?;
    }
    let now = change.now();
    let key = change.insert(|key| {
        let mut row = JobRow::accepted(key, owner, new, now);
        row.job.coalesced_into = coalesced_into;
        row
    })?;
    let problem = NewContent::new(new.problem.as_bytes());
    let tx = change.sql_beside_jobs();
    content::attach(tx, Holder::Job(key), name::PROBLEM, &problem)?;
    let job = change.read(key)?;
    labels::write(change, &job)?;
    if let Some(source) = answer {
        coalescing::answer(change, key, &source)?;
    }
    Ok(key)
}
