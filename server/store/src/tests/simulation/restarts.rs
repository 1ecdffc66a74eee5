//! What happens to the store: it is stopped, it crashes, the disk is full, the clock is set.

use std::fs;

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
        let running: Vec<(i64, i32, bool)> = self
            .running
            .iter()
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
        let interrupted = self.store.requeue_interrupted().await.unwrap();
        assert_eq!(interrupted, self.running.len());
        let over = std::mem::take(&mut self.running).into_iter();
        self.over
            .extend(over.map(|(key, work)| (key, work.attempt)));
        self.check(true).await;
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
