//! What clients do with jobs that were accepted.

use base::{event::Payload, job::Reason};

use super::*;

impl World {
    /// Any job, deleted ones among them.
    fn any_job(&mut self) -> Option<i64> {
        let keys: Vec<i64> = self.jobs.keys().copied().collect();
        self.one_of(&keys)
    }

    pub(super) async fn cancel(&mut self) -> Result<()> {
        let key = if self.dice.bool() {
            self.any_running().map(|(key, _)| key)
        } else {
            self.any_job()
        };
        let Some(key) = key else {
            return Ok(());
        };
        self.note(format!("cancel {key}"));
        let status = self.status(key).await;
        let outcome = self.store.request_cancel(key).await;
        if let (Err(StoreError::Full), Some(work)) = (&outcome, self.running.get_mut(&key)) {
            work.canceled = true; // it is kept in memory
        }
        match (status, outcome?) {
            (Some(Status::Queued), CancelOutcome::Canceled(changed)) => {
                assert!(changed.contains(&key));
                assert_eq!(self.status(key).await, Some(Status::Canceled));
            }
            (Some(Status::Running), CancelOutcome::Requested { attempt }) => {
                let work = self.running.get_mut(&key).unwrap();
                assert_eq!(attempt, work.attempt);
                work.canceled = true;
            }
            (_, CancelOutcome::AlreadyTerminal) => {
                assert!(status.is_none_or(Status::is_terminal));
            }
            (status, outcome) => panic!("{status:?}: {outcome:?}"),
        }
        Ok(())
    }

    /// Cancels some of the jobs that wait, and finds some that do not.
    pub(super) async fn cancel_waiting(&mut self) -> Result<()> {
        let all: Vec<i64> = self.jobs.keys().copied().collect();
        let some: Vec<i64> = all.into_iter().filter(|_| self.dice.bool()).collect();
        self.note(format!("cancel those of {some:?} that wait"));
        let mut rest = &some[..];
        while !rest.is_empty() {
            let batch = match self.store.cancel_queued(rest).await {
                // what was done before stays
                Err(StoreError::Full) if rest.len() < some.len() => return Ok(()),
                other => other?,
            };
            assert!(
                batch
                    .running
                    .iter()
                    .all(|key| self.running.contains_key(key))
            );
            rest = &rest[batch.seen..];
        }
        for key in some {
            assert_ne!(self.status(key).await, Some(Status::Queued), "{key}");
        }
        Ok(())
    }

    pub(super) async fn edit(&mut self) -> Result<()> {
        let Some(key) = self.any_job() else {
            return Ok(());
        };
        let priority = self.dice.bool().then(|| self.dice.i32(-10..=10));
        self.note(format!("edit {key}: priority {priority:?}"));
        let edit = Edit {
            name: Some(Some(self.dice.u32(0..100).to_string())),
            priority,
            ..Edit::default()
        };
        let id = self.jobs[&key].id;
        let edited = self
            .store
            .edit(Owners::All, id, move |_| Ok::<_, ()>(edit.clone()))
            .await?;
        assert_eq!(edited.is_some(), self.is_there_with_id(id));
        if let Some(edited) = edited {
            let edited = edited.unwrap();
            assert!(priority.is_none_or(|priority| priority == edited.priority));
        }
        Ok(())
    }

    /// Whether there is a job with this id: one that was forgotten may have been used again.
    fn is_there_with_id(&self, id: JobId) -> bool {
        self.jobs.values().any(|job| job.id == id && !job.deleted)
    }

    pub(super) async fn delete(&mut self) -> Result<()> {
        self.check(false).await; // as they are before they are deleted
        let all: Vec<i64> = self.jobs.keys().copied().collect();
        if self.once_in(3) {
            let some: Vec<i64> = all.into_iter().filter(|_| self.once_in(3)).collect();
            self.note(format!("delete those of {some:?} that have ended"));
            let mut rest = &some[..];
            while !rest.is_empty() {
                let batch = match self.store.delete_ended(Owners::All, rest).await {
                    Err(StoreError::Full) if rest.len() < some.len() => break,
                    other => other?,
                };
                rest = &rest[batch.seen..];
            }
            let dealt_with = some.len() - rest.len();
            for key in &some[..dealt_with] {
                self.forget_if_gone(*key).await;
            }
            return Ok(());
        }
        let Some(key) = self.one_of(&all) else {
            return Ok(());
        };
        self.note(format!("delete {key}"));
        let status = self.status(key).await;
        let deletion = self.store.delete(Owners::All, key).await?;
        let expected = match status {
            None => Deletion::Unknown,
            Some(status) if status.is_terminal() => Deletion::Deleted,
            Some(_) => Deletion::Active,
        };
        assert_eq!(deletion, expected, "{key}");
        self.forget_if_gone(key).await;
        Ok(())
    }

    /// A job that had ended is deleted.
    async fn forget_if_gone(&mut self, key: i64) {
        if self.status(key).await.is_none() {
            let known = self.jobs.get_mut(&key).unwrap();
            assert!(
                known.deleted || known.ended.is_some(),
                "{key} had not ended"
            );
            known.deleted = true;
        }
    }

    /// Ends jobs that have waited too long, and forgets those deleted long ago.
    pub(super) async fn expire(&mut self) -> Result<()> {
        self.note("end what has waited too long".into());
        let mut expired = vec![];
        loop {
            match self.store.expire_queued(Time::now()).await {
                Ok(some) if some.is_empty() => break,
                Ok(some) => expired.extend(some),
                Err(StoreError::Full) if !expired.is_empty() => return Ok(()),
                Err(error) => return Err(error),
            }
        }
        for job in self.listed().await {
            let reason = job.reason;
            if expired.contains(&job.key) && reason == Some(Reason::QueueExpired) {
                let waited = job.created_at.seconds_until(job.finished_at.unwrap());
                assert!(waited >= job.limits.queue_ttl_s, "{job:?}");
            }
        }
        match self.store.forget_deleted(Time::now()).await {
            Err(StoreError::Full) if !expired.is_empty() => Ok(()),
            other => other,
        }
    }

    pub(super) async fn pause_or_resume(&mut self) -> Result<()> {
        let paused = self.dice.bool();
        self.note(format!("paused: {paused}"));
        self.store.set_paused(paused).await?;
        self.paused = paused;
        Ok(())
    }
}

/// How often a job was requeued because its worker was lost.
pub(super) fn losses(events: &[Event]) -> usize {
    let lost = |event: &&Event| match &event.payload {
        Payload::Status { reason, .. } => reason.as_deref() == Some("worker_lost"),
        _ => false,
    };
    events.iter().filter(lost).count()
}
