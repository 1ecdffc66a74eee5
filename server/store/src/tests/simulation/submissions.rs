//! Submissions, and what they are to be answered with.

use super::*;

/// What a submission is to be answered with.
#[derive(Debug)]
enum Expected {
    /// These jobs, which were accepted before.
    Replay(Vec<i64>),
    New,
    KeyReuse,
    IdConflict,
    Deleted,
}

impl World {
    /// A new job. Inputs repeat, so that jobs answer others or are coalesced.
    pub(super) fn new_job(&mut self) -> NewJob {
        let input = self.dice.u32(0..5);
        let queue_ttl_s = [60.0, 3600.0, 86_400.0][self.dice.usize(0..3)];
        let known: Vec<JobId> = self.jobs.values().map(|job| job.id).collect();
        NewJob {
            id: Some(uuid::Uuid::from_u128(self.dice.u128(..)).into()),
            labels: if self.once_in(3) {
                [("study".to_owned(), input.to_string())].into()
            } else {
                Default::default()
            },
            priority: [0, 0, 0, -3, 5][self.dice.usize(0..5)],
            limits: Limits {
                queue_ttl_s,
                ..Limits::default()
            },
            cache: [
                Cache::Use,
                Cache::Use,
                Cache::Use,
                Cache::Refresh,
                Cache::Off,
            ][self.dice.usize(0..5)],
            parent: if self.once_in(5) {
                self.one_of(&known)
            } else {
                None
            },
            memory_bytes: self.dice.u64(1..4) << 20,
            ..new(&input.to_string())
        }
    }

    /// Some jobs, mostly new ones under a new key or none.
    fn submission(&mut self) -> Submission {
        let count = if self.once_in(4) {
            self.dice.usize(2..5)
        } else {
            1
        };
        let mut jobs: Vec<NewJob> = (0..count).map(|_| self.new_job()).collect();
        let ids: Vec<JobId> = self.jobs.values().map(|job| job.id).collect();
        if self.once_in(8)
            && let Some(id) = self.one_of(&ids)
        {
            jobs[0].id = Some(id);
            if self.once_in(4) {
                jobs[0].payload = "another payload".into();
            }
        }
        let key = (!self.once_in(3)).then(|| RequestKey {
            key: format!("key {}", self.dice.u32(0..8)),
            payload: ["request", "request", "request", "another"][self.dice.usize(0..4)].into(),
        });
        let max_queued = if self.once_in(8) { 4 } else { 1000 };
        let owner = OWNERS[self.dice.usize(0..OWNERS.len())].into();
        Submission {
            owner,
            jobs,
            sweep: None,
            key,
            limits: QueueLimits {
                queued: max_queued,
                queued_of_owner: None,
            },
        }
    }

    pub(super) async fn submit(&mut self) -> Result<()> {
        if self.once_in(6) {
            return self.submit_together().await;
        }
        let submission = self.submission();
        let claim = !self.paused && self.once_in(3);
        self.submit_this(submission, claim).await
    }

    pub(super) async fn submit_this(&mut self, submission: Submission, claim: bool) -> Result<()> {
        self.note(described(&submission, claim));
        let before = match self.expected(&submission).await? {
            Expected::New if submission.limits.queued > 100 => None,
            _ => Some(self.rows().await),
        };
        let answer = self.store.submit(submission.clone(), claim).await;
        let accepted = self.judge(submission, answer).await?;
        if !accepted {
            let before = before.expect("a new job");
            checks::same(
                &before,
                &self.rows().await,
                "a submission without a new job",
            );
        }
        Ok(())
    }

    /// Several submissions in one commit, each with an answer of its own. They are in the inbox in this order, since
    /// nothing is read before for jobs that no other may answer.
    async fn submit_together(&mut self) -> Result<()> {
        let mut some: Vec<Submission> = (0..3).map(|_| self.submission()).collect();
        for job in some.iter_mut().flat_map(|one| &mut one.jobs) {
            job.cache = Cache::Refresh;
        }
        for one in &some {
            self.note(format!("together: {}", described(one, false)));
        }
        let asking = some.iter().map(|one| self.store.submit(one.clone(), false));
        let answers = futures_util::future::join_all(asking).await;
        let mut full = 0;
        for (submission, answer) in some.into_iter().zip(answers) {
            match self.judge(submission, answer).await {
                Err(StoreError::Full) if self.full => full += 1,
                judged => drop(judged?),
            }
        }
        // if all were refused, nothing may have changed
        if full == 3 {
            Err(StoreError::Full)
        } else {
            Ok(())
        }
    }

    /// Compares an answer with what is known; returns whether there are new jobs.
    async fn judge(&mut self, submission: Submission, answer: Result<Accepted>) -> Result<bool> {
        let expected = self.expected(&submission).await?;
        match (expected, answer) {
            (_, Err(StoreError::Full)) => return Err(StoreError::Full),
            (Expected::Replay(keys), Ok(accepted)) => {
                assert!(accepted.replayed);
                let found: Vec<i64> = accepted.jobs.iter().map(|job| job.key).collect();
                assert_eq!(found, keys, "one key, one job");
            }
            (Expected::New, Ok(accepted)) => {
                assert!(!accepted.replayed);
                self.accepted(submission, accepted).await;
                return Ok(true);
            }
            (Expected::New, Err(StoreError::QueueFull)) if submission.limits.queued < 100 => {
                let waiting = self.store.waiting() + submission.jobs.len();
                assert!(waiting > submission.limits.queued as usize);
            }
            (Expected::KeyReuse, Err(StoreError::KeyReuse))
            | (Expected::IdConflict, Err(StoreError::IdConflict(_)))
            | (Expected::Deleted, Err(StoreError::Deleted(_))) => {}
            (expected, answer) => panic!("{expected:?} is expected, not {answer:?}"),
        }
        Ok(false)
    }

    /// What a submission is to be answered with, by the answers so far.
    async fn expected(&self, submission: &Submission) -> Result<Expected> {
        let Submission {
            owner, jobs, key, ..
        } = submission;
        let earlier = key
            .as_ref()
            .and_then(|key| Some((key, self.keys.get(&(owner.clone(), key.key.clone()))?)));
        if let Some((key, (payload, earlier))) = earlier {
            if *payload != key.payload {
                return Ok(Expected::KeyReuse);
            }
            let left: Vec<i64> = earlier
                .iter()
                .copied()
                .filter(|key| self.is_there(*key))
                .collect();
            if !left.is_empty() {
                return Ok(Expected::Replay(left));
            }
            for key in earlier {
                if self.is_remembered(*key).await? {
                    return Ok(Expected::Deleted);
                }
            }
        }
        for new in jobs {
            let same_id = |known: &(&i64, &Known)| Some(known.1.id) == new.id;
            // a forgotten id may have been used again
            let Some((key, known)) = self.jobs.iter().rfind(same_id) else {
                continue;
            };
            let theirs = known.owner != *owner;
            if self.is_there(*key) {
                let same = !theirs && known.new.payload == new.payload && jobs.len() == 1;
                return Ok(if same {
                    Expected::Replay(vec![*key])
                } else {
                    Expected::IdConflict
                });
            }
            if self.is_remembered(*key).await? {
                return Ok(if theirs {
                    Expected::IdConflict
                } else {
                    Expected::Deleted
                });
            }
        }
        Ok(Expected::New)
    }

    fn is_there(&self, key: i64) -> bool {
        self.jobs.get(&key).is_some_and(|job| !job.deleted)
    }

    /// Whether the id of a deleted job is still answered with *deleted*.
    async fn is_remembered(&self, key: i64) -> Result<bool> {
        self.store
            .was_deleted(Owners::All, self.jobs[&key].id)
            .await
    }

    async fn accepted(&mut self, submission: Submission, accepted: Accepted) {
        let Submission {
            owner, jobs, key, ..
        } = submission;
        assert_eq!(jobs.len(), accepted.jobs.len());
        let keys: Vec<i64> = accepted.jobs.iter().map(|job| job.key).collect();
        if let Some(key) = key {
            let used = (key.payload, keys);
            self.keys.insert((owner.clone(), key.key), used);
        }
        for (new, job) in jobs.into_iter().zip(accepted.jobs) {
            assert_eq!((Some(job.id), &job.owner), (new.id, &owner));
            let known = Known {
                id: job.id,
                owner: owner.clone(),
                new,
                events: vec![],
                ended: None,
                waited: !job.status.is_terminal(),
                deleted: false,
                attempts: 0,
            };
            let old = self.jobs.insert(job.key, known);
            assert!(old.is_none(), "a number is given once");
        }
        if let Some(claim) = accepted.claim {
            self.started(claim, None).await;
        }
    }
}

fn described(submission: &Submission, claim: bool) -> String {
    let jobs = submission.jobs.iter().map(|job| {
        let (input, id) = (&job.input_hash, job.id.unwrap().0);
        format!("{input} {:?} priority {} {id}", job.cache, job.priority)
    });
    let jobs: Vec<String> = jobs.collect();
    let key = submission.key.as_ref();
    let key = key.map(|key| format!("{} for {}", key.key, key.payload));
    let (owner, most) = (&submission.owner, submission.limits.queued);
    format!("submit {jobs:?} of {owner}, {key:?}, at most {most}, claim {claim}")
}
