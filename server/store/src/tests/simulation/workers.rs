//! What workers do.

use std::cmp::Ordering;

use super::*;
use base::{
    event::Payload,
    job::{Progress, Reason, ResultAvailable},
};
use strum::VariantArray;

/// More than one transaction writes.
const LARGE: usize = PIECES_PER_COMMIT * PIECE_BYTES + 100_000;

impl World {
    /// A worker takes the next job.
    pub(super) async fn claim(&mut self) -> Result<()> {
        if self.paused {
            return Ok(());
        }
        if self.once_in(3) {
            return self.claim_elsewhere().await;
        }
        self.note("claim".into());
        match self.store.claim_next().await?.0 {
            Some(claim) => self.started(claim, None).await,
            None => {
                let waits = self.listed().await.iter().any(Job::waits_for_a_worker);
                assert!(!waits || self.store.budget().is_short(), "none was claimed");
            }
        }
        Ok(())
    }

    /// A worker elsewhere takes the next job that it has room for, beside a slot here.
    async fn claim_elsewhere(&mut self) -> Result<()> {
        let whole = self.dice.u64(0..BUDGET);
        let lessee = Lessee {
            worker: format!("worker_{}", self.dice.u32(0..3)),
            name: "node".into(),
        };
        let room = Room { whole, free: whole };
        self.note(format!("{} claims, with room for {whole}", lessee.worker));
        let places = vec![Place::Away(lessee.clone(), room), Place::Here];
        let both = self.dice.bool();
        let places = places.into_iter().take(if both { 2 } else { 1 }).collect();
        let claims = self.store.claim_for(places).await?.claims;
        assert!(claims.len() <= 2);
        for (place, claim) in claims {
            // of two that were claimed together, the first may be for either place
            let elsewhere = (place == 0).then(|| lessee.clone());
            let passed = (both || elsewhere.is_some()).then_some(whole);
            self.started(claim, elsewhere.map(|lessee| (lessee, passed.unwrap_or(0))))
                .await;
        }
        Ok(())
    }

    /// A job was claimed, here or by a worker elsewhere with this much memory, and no other job that waits and has room there
    /// is before it.
    pub(super) async fn started(&mut self, claim: Claim, elsewhere: Option<(Lessee, u64)>) {
        let job = &claim.job;
        self.note(format!("    {} starts, attempt {}", job.key, job.attempt));
        let jobs = self.listed().await;
        let waiting = jobs.iter().filter(|job| job.waits_for_a_worker());
        // an owner who had no turn yet comes before those who had, in the order of the first of their jobs that waited
        let turn = |owner: &str| {
            let mut theirs = self.jobs.iter().filter(|(_, known)| known.owner == owner);
            let first = theirs.find(|(_, known)| known.waited).map(|(key, _)| *key);
            (self.turns.get(owner).copied(), first)
        };
        let is_before = |other: &Job| match job.priority.cmp(&other.priority) {
            Ordering::Equal if job.owner == other.owner => job.key < other.key,
            Ordering::Equal => turn(&job.owner) < turn(&other.owner),
            order => order == Ordering::Greater,
        };
        let fits = |other: &&Job| match &elsewhere {
            Some((_, whole)) => other.memory_bytes.is_none_or(|needed| needed <= *whole),
            None => true,
        };
        for other in waiting.filter(fits) {
            assert!(is_before(other), "{} has overtaken {}", job.key, other.key);
        }
        self.turn += 1;
        self.turns.insert(job.owner.clone(), self.turn);
        assert_eq!((job.status, job.coalesced_into), (Status::Running, None));
        let work = Work {
            attempt: job.attempt,
            canceled: false,
            elsewhere: elsewhere.map(|(lessee, _)| lessee),
            parts: None,
            _memory: claim.memory,
        };
        let old = self.running.insert(job.key, work);
        assert!(old.is_none(), "{} runs twice at once", job.key);
        if let Some(known) = self.jobs.get_mut(&job.key) {
            assert_eq!(job.attempt, known.attempts + 1);
            known.attempts = job.attempt;
        }
    }

    /// One of the jobs that run.
    pub(super) fn any_running(&mut self) -> Option<(i64, i32)> {
        let running: Vec<(i64, i32)> = self
            .running
            .iter()
            .map(|(key, work)| (*key, work.attempt))
            .collect();
        self.one_of(&running)
    }

    /// Some events of a solver.
    fn events(&mut self) -> Vec<(Time, Payload)> {
        let count = self.dice.u32(0..4);
        (1..=count)
            .map(|k| (Time::now(), Payload::Iteration(fake::timed(k))))
            .collect()
    }

    fn progress(&mut self) -> Progress {
        Progress {
            iteration: self.dice.u32(0..100),
            ..Progress::default()
        }
    }

    pub(super) async fn report(&mut self) -> Result<()> {
        let Some((key, attempt)) = self.any_running() else {
            return Ok(());
        };
        let events = self.events();
        self.note(format!("{key} reports {} events", events.len()));
        let progress = self.progress();
        let stored = self.store.append_events(key, attempt, events, &progress);
        assert!(stored.await?, "{key} does not run");
        Ok(())
    }

    /// A result of this job, which says what it belongs to.
    fn parts_of(&mut self, key: i64) -> Arc<Parts> {
        let input = &self.jobs[&key].new.input_hash;
        let mut parts = vec![
            parts::Part::new(
                "summary".into(),
                format!("{{\"input\":\"{input}\"}}").as_bytes(),
            ),
            parts::Part::new("history".into(), b"[]"),
        ];
        if self.once_in(40) {
            parts.push(parts::Part::plain(vec![b' '; LARGE]));
        }
        Arc::new(Parts::new(parts))
    }

    pub(super) async fn write_partial(&mut self) -> Result<()> {
        let Some((key, attempt)) = self.any_running() else {
            return Ok(());
        };
        self.note(format!("{key} writes a partial result"));
        let parts = self.parts_of(key);
        assert!(self.store.write_partial(key, attempt, &parts).await?);
        Ok(())
    }

    /// A worker ends its job in some way, or only begins to.
    pub(super) async fn finish(&mut self) -> Result<()> {
        let Some((key, attempt)) = self.any_running() else {
            return Ok(());
        };
        let of_a_state = self.dice.bool();
        let ending = match self.dice.u32(0..10) {
            0..6 => return self.succeed(key).await,
            6 => Ending::canceled(),
            _ => {
                let fails =
                    |reason: &Reason| !matches!(reason, Reason::UserCancel | Reason::WorkerLost);
                let reasons: Vec<Reason> = Reason::VARIANTS.iter().copied().filter(fails).collect();
                Ending::failed(self.one_of(&reasons).unwrap(), "so")
            }
        };
        if !of_a_state {
            return self.end(key, attempt, ending, None).await;
        }
        let ending = Ending {
            result: ResultAvailable::Partial,
            ..ending
        };
        let parts = self.parts_of(key);
        self.end(key, attempt, ending, Some(parts)).await
    }

    /// A worker writes its result, and mostly ends its job with it.
    pub(super) async fn succeed(&mut self, key: i64) -> Result<()> {
        let parts = match self.running.get_mut(&key).unwrap().parts.take() {
            Some(parts) => parts,
            None => self.parts_of(key),
        };
        let work = &self.running[&key];
        let (attempt, large) = (work.attempt, parts.bytes() > PIECE_BYTES);
        if large {
            self.note(format!("{key} begins to write a large result"));
            let written = self.store.write_before_end(key, attempt, &parts).await;
            assert!(written.unwrap_or(true));
            if self.full || self.once_in(3) {
                self.running.get_mut(&key).unwrap().parts = Some(parts);
                return Ok(());
            }
        }
        let ending = Ending {
            status: Status::Succeeded,
            reason: None,
            failure: None,
            result: ResultAvailable::Final,
            overview: Default::default(),
        };
        self.end(key, attempt, ending, Some(parts)).await
    }

    async fn end(
        &mut self,
        key: i64,
        attempt: i32,
        ending: Ending,
        parts: Option<Arc<Parts>>,
    ) -> Result<()> {
        self.note(format!(
            "{key} ends: {:?} {:?}, result {:?}",
            ending.status, ending.reason, ending.result
        ));
        let last = FinalBatch {
            events: self.events(),
            progress: self.progress(),
        };
        if let Some(parts) = &parts
            && parts.bytes() > PIECE_BYTES
            && ending.status != Status::Succeeded
        {
            // pieces that were written are no harm if the end is refused
            self.free_the_disk().await;
            assert!(self.store.write_before_end(key, attempt, parts).await?);
        }
        let finished = self
            .store
            .finish(key, attempt, &ending, last, parts.as_ref());
        let changed = finished.await?.expect("it runs");
        assert!(changed.contains(&key));
        let work = self.running.remove(&key).unwrap();
        self.over.push((key, attempt));
        let expected = if work.canceled && ending.status == Status::Succeeded {
            Status::Canceled
        } else {
            ending.status
        };
        assert_eq!(self.status(key).await, Some(expected));
        Ok(())
    }

    /// The process of a worker dies.
    pub(super) async fn lose_worker(&mut self) -> Result<()> {
        let Some((key, attempt)) = self.any_running() else {
            return Ok(());
        };
        if self.running[&key].elsewhere.is_some() && self.once_in(2) {
            return self.give_back(key, attempt).await;
        }
        self.note(format!("the process of {key} dies"));
        let changed = self.store.requeue_lost(key, attempt, "killed").await?;
        assert!(changed.contains(&key));
        let work = self.running.remove(&key).unwrap();
        self.over.push((key, attempt));
        let status = self.status(key).await;
        if work.canceled {
            assert_eq!(status, Some(Status::Canceled))
        } else {
            assert!(matches!(status, Some(Status::Queued | Status::Failed)))
        }
        Ok(())
    }

    /// A worker elsewhere that is to end gives its job back, which does not count.
    async fn give_back(&mut self, key: i64, attempt: i32) -> Result<()> {
        self.note(format!("{key} is given back"));
        let status = self.store.requeue_drained(key, attempt).await?;
        let work = self.running.remove(&key).unwrap();
        self.over.push((key, attempt));
        let expected = if work.canceled {
            Status::Canceled
        } else {
            Status::Queued
        };
        assert_eq!(status, Some(expected));
        Ok(())
    }

    /// A worker whose attempt is over goes on: nothing of that is stored.
    pub(super) async fn report_too_late(&mut self) -> Result<()> {
        let over = self.over.clone();
        let Some((key, attempt)) = self.one_of(&over) else {
            return Ok(());
        };
        self.note(format!(
            "attempt {attempt} at {key} goes on, though it is over"
        ));
        let before = self.rows().await;
        let (store, events, progress) = (self.store.clone(), self.events(), self.progress());
        let (parts, last) = (self.parts_of(key), FinalBatch::default());
        assert!(!store.append_events(key, attempt, events, &progress).await?);
        assert!(!store.write_partial(key, attempt, &parts).await?);
        let canceled = Ending::canceled();
        let ended = store.finish(key, attempt, &canceled, last, Some(&parts));
        assert!(ended.await?.is_none());
        assert!(store.requeue_drained(key, attempt).await?.is_none());
        assert!(store.requeue_lost(key, attempt, "killed").await?.is_empty());
        checks::same(
            &before,
            &self.rows().await,
            "a worker whose attempt is over",
        );
        Ok(())
    }
}
