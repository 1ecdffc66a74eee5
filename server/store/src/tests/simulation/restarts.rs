//! What happens to the store: it is stopped, it crashes, the disk is full, the clock is set.

use std::fs;

use base::event::Payload;

use super::*;

const RESERVE: &str = "signorini.reserve";
const PROGRESS: &str = "signorini.progress";

/// Copies the files of a store, as a crash would leave them; the reserve is moved, since its content means nothing.
pub(super) fn copy(from: &Path, to: &Path) {
    fs::create_dir(to).unwrap();
    for file in ["signorini.db", "signorini.db-wal", PROGRESS] {
        let _ = fs::copy(from.join(file), to.join(file));
    }
}

/// What a store has written at some moment.
struct Written {
    database: Vec<u8>,
    log: Vec<u8>,
    progress: Vec<u8>,
}

impl Written {
    fn in_folder(folder: &Path) -> Written {
        let read = |name| fs::read(folder.join(name)).unwrap_or_default();
        Written {
            database: read("signorini.db"),
            log: read("signorini.db-wal"),
            progress: read(PROGRESS),
        }
    }

    /// Leaves a part of what was written since to the log. If the log was begun anew meanwhile nothing is left.
    fn cut(self, folder: &Path, part: f64) {
        let now = Written::in_folder(folder);
        let goes_on = now.database == self.database && now.log.starts_with(&self.log);
        let log = if goes_on {
            let more = (now.log.len() - self.log.len()) as f64 * part;
            &now.log[..self.log.len() + more as usize]
        } else {
            &self.log
        };
        fs::write(folder.join("signorini.db"), &self.database).unwrap();
        fs::write(folder.join("signorini.db-wal"), log).unwrap();
        fs::write(folder.join(PROGRESS), &self.progress).unwrap();
    }
}

/// Keeps the record of the progress as it is at a start: after a power cut it may be no newer.
pub(super) fn keep_progress(folder: &Path, home: &Path) {
    fs::copy(folder.join(PROGRESS), home.join(PROGRESS)).unwrap();
}

impl World {
    fn folder(&self, start: usize) -> PathBuf {
        self.home.path().join(start.to_string())
    }

    /// Between two starts the clock of the machine is sometimes set, by up to three days.
    fn set_clock(&mut self) {
        if self.once_in(2) {
            self.clock += self.dice.i64(-259_200_000_000..259_200_000_000);
            Time::from_micros(self.clock).simulate();
            self.note("the clock was set".into());
        }
    }

    /// The service stops and is started again.
    pub(super) async fn stop_and_start(&mut self) -> Result<()> {
        self.note("stop and start".into());
        // jobs of workers elsewhere go on
        let here = self
            .running
            .iter()
            .filter(|(_, work)| work.elsewhere.is_none());
        let running: Vec<(i64, i32, bool)> = here
            .map(|(key, work)| (*key, work.attempt, work.canceled))
            .collect();
        for (key, attempt, canceled) in running {
            let status = match self.store.requeue_drained(key, attempt).await {
                Err(StoreError::Full) => continue, // the next start finds it running
                other => other?,
            };
            let expected = if canceled {
                Status::Canceled
            } else {
                Status::Queued
            };
            assert_eq!(status, Some(expected));
            self.running.remove(&key);
            self.over.push((key, attempt));
        }
        self.store.close().await;
        let folder = self.folder(self.starts - 1);
        self.start(&folder).await;
        Ok(())
    }

    /// The process dies, or the machine: then the record of the progress may be an older one.
    pub(super) async fn crash(&mut self) -> Result<()> {
        let key = format!("key of start {}", self.starts);
        let unanswered = !self.full && self.dice.bool();
        let halfway = unanswered && self.dice.bool();
        let mut submission = Submission {
            limits: QueueLimits {
                queued: 1000,
                queued_of_owner: None,
            },
            sweep: None,
            key: Some(RequestKey {
                key,
                payload: "request".into(),
            }),
            owner: OWNERS[0].into(),
            jobs: vec![self.new_job()],
        };
        let (old, new) = (self.folder(self.starts - 1), self.folder(self.starts));
        let before = Written::in_folder(&old);
        if halfway {
            self.note("submit, but the crash comes first".into());
            self.store.submit(submission.clone(), false).await.unwrap();
        } else if unanswered {
            self.submit_this(submission.clone(), false).await?;
        }
        let power = self.once_in(3);
        self.note(format!("crash; of the machine: {power}"));
        copy(&old, &new);
        if halfway {
            before.cut(&new, self.dice.f64());
        }
        if power {
            let earlier = self.home.path().join(PROGRESS);
            fs::copy(earlier, new.join(PROGRESS)).unwrap();
        }
        self.store.close().await;
        let _ = fs::rename(old.join(RESERVE), new.join(RESERVE));
        fs::remove_dir_all(old).unwrap();
        self.starts += 1;
        self.start(&new).await;
        if unanswered {
            // a client that was not answered repeats its request, in its own words
            submission.jobs[0].name = Some("again".into());
            self.submit_this(submission, false).await?;
        }
        Ok(())
    }

    async fn start(&mut self, folder: &Path) {
        self.set_clock();
        self.full = false;
        self.store = Store::open_unwatched(folder).await.unwrap();
        keep_progress(folder, self.home.path());
        self.store.set_budget(Budget::new(BUDGET, 2, 0));
        assert_eq!(self.store.is_paused(), self.paused);
        let asked: Vec<i64> = self
            .listed()
            .await
            .iter()
            .filter(|job| job.cancel_requested)
            .map(|job| job.key)
            .collect();
        let interrupted = self.store.requeue_interrupted().await.unwrap();
        let (mut go_on, over): (BTreeMap<i64, Work>, BTreeMap<i64, Work>) =
            std::mem::take(&mut self.running)
                .into_iter()
                .partition(|(key, work)| work.elsewhere.is_some() && !asked.contains(key));
        assert_eq!(interrupted, over.len());
        self.over
            .extend(over.into_iter().map(|(key, work)| (key, work.attempt)));
        // a cancel that a full disk has kept from being stored was only in memory
        go_on.values_mut().for_each(|work| work.canceled = false);
        self.running = go_on;
        self.check_leases().await;
        self.check(true).await;
    }

    /// The jobs that go on elsewhere are those that the store says, each at its worker and with its events.
    async fn check_leases(&self) {
        let mut leased = self.store.leased().await.unwrap();
        leased.sort_by_key(|leased| leased.job.key);
        assert!(
            leased
                .iter()
                .map(|leased| &leased.job.key)
                .eq(self.running.keys()),
            "leases"
        );
        for Leased {
            job,
            lessee,
            events,
        } in leased
        {
            let work = &self.running[&job.key];
            assert_eq!(
                (job.attempt, Some(&lessee)),
                (work.attempt, work.elsewhere.as_ref())
            );
            let told = self.store.events_after(job.key, 0, 100_000).await.unwrap();
            let told = told.iter().map(|event| event.read().unwrap());
            let of_solver = told.filter(|event| {
                event.attempt == job.attempt && matches!(event.payload, Payload::Iteration(_))
            });
            assert_eq!(events, of_solver.count() as u64, "events of {}", job.key);
        }
    }

    pub(super) async fn fill_the_disk(&mut self) -> Result<()> {
        self.full = true;
        let (more, gone) = (self.dice.i64(0..40), self.once_in(3));
        self.note(format!(
            "the disk has {more} pages left; without the reserve: {gone}"
        ));
        self.store.bound(more).await;
        if gone {
            self.store.reserve.release();
        }
        Ok(())
    }

    pub(super) async fn free_the_disk(&mut self) {
        self.note("the disk has space".into());
        self.store.bound(1_000_000).await;
        self.store.full_commits.store(0, Ordering::Relaxed);
        assert!(self.store.reserve.retake());
        self.full = false;
    }
}
