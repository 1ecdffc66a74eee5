//! What is true of the store whatever was done to it.

use std::sync::OnceLock;

use base::{
    event::Payload,
    job::{Reason, ResultAvailable},
};

use super::*;

/// The tables, but for the count of transactions.
const TABLES: [&str; 9] = [
    "job",
    "job_label",
    "event",
    "attachment",
    "content",
    "content_piece",
    "request_key",
    "deleted_job",
    "setting",
];

/// Fails unless these rows of the store are the same.
pub(super) fn same(before: &[String], after: &[String], what: &str) {
    let missing = |some: &[String], others: &[String]| -> Vec<String> {
        some.iter()
            .filter(|row| !others.contains(row))
            .cloned()
            .collect()
    };
    if before != after {
        let (lost, new) = (missing(before, after), missing(after, before));
        panic!("{what} has changed the store\nbefore: {lost:#?}\nafter: {new:#?}");
    }
}

impl World {
    /// All rows of the store, as text.
    pub(super) async fn rows(&self) -> Vec<String> {
        static QUERIES: OnceLock<[String; TABLES.len()]> = OnceLock::new();
        let rows = self.store.read(|_, connection| {
            let query = |table| {
                let names = "select group_concat(case name when 'body' then 'length(body)' else 'quote(' || name || ')' end,
                                                 ' || '' '' || ') from pragma_table_info(?)";
                let columns: String = connection.value(names, [table]).unwrap();
                format!("select '{table} ' || {columns} from {table} order by 1")
            };
            let mut rows = vec![];
            for query in QUERIES.get_or_init(|| TABLES.map(query)) {
                rows.extend(connection.values::<String>(query, ())?);
            }
            Ok(rows)
        });
        rows.await.unwrap()
    }

    /// All jobs, as they are listed.
    pub(super) async fn listed(&self) -> Vec<Job> {
        let order = Order {
            descending: false,
            ..Order::NEWEST_FIRST
        };
        let all = Filter::default();
        self.store
            .jobs(Owners::All, &all, order, None, 10_000)
            .await
            .unwrap()
    }

    /// The status of a job; none if it is deleted.
    pub(super) async fn status(&self, key: i64) -> Option<Status> {
        let status = format!("select status from job where id = {key}");
        let status: Option<String> = values(&self.store, status).await.pop();
        status.map(|word| word.parse().unwrap())
    }

    /// Checks the jobs, and their new events; `thorough`: all their events. A row without its checksum, or with another,
    /// could not be listed.
    pub(super) async fn check(&mut self, thorough: bool) {
        let jobs = self.listed().await;
        let found: Vec<i64> = jobs.iter().map(|job| job.key).collect();
        let there = self.jobs.iter().filter(|(_, known)| !known.deleted);
        let accepted: Vec<i64> = there.map(|(key, _)| *key).collect();
        assert_eq!(found, accepted, "accepted jobs, in order of arrival");
        let running = jobs.iter().filter(|job| job.status == Status::Running);
        let running: Vec<(i64, i32)> = running.map(|job| (job.key, job.attempt)).collect();
        let ours = self.running.iter().map(|(key, work)| (*key, work.attempt));
        assert_eq!(running, ours.collect::<Vec<_>>(), "attempts that run");
        self.check_queue(&jobs);
        let counted = self
            .store
            .read(|_, connection| turns::are_right(connection));
        assert!(counted.await.unwrap(), "the counts of the queue");
        for job in &jobs {
            check_job(job, &jobs);
            self.check_end(job);
            self.check_events(job, thorough).await;
        }
    }

    /// Positions and counts are those of the jobs.
    fn check_queue(&self, jobs: &[Job]) {
        let mut waiting: Vec<&Job> = jobs.iter().filter(|job| job.waits_for_a_worker()).collect();
        let ahead = |job: &Job| job.queue.as_ref().map(|queue| queue.ahead);
        // each has a position of its own, by priority and then, of each owner, by arrival
        waiting.sort_by_key(|job| ahead(job));
        let arrivals = |a: &Job, b: &Job| a.owner != b.owner || a.key < b.key;
        let in_order = |a: &&Job, b: &&Job| {
            a.priority > b.priority || (a.priority == b.priority && arrivals(a, b))
        };
        assert!(waiting.is_sorted_by(in_order), "the order of the queue");
        for (place, job) in waiting.iter().enumerate() {
            assert_eq!(ahead(job), Some(place as i64), "position of {}", job.key);
        }
        let queued = jobs
            .iter()
            .filter(|job| job.status == Status::Queued)
            .count();
        assert_eq!(self.store.waiting(), queued, "jobs that wait");
    }

    /// A terminal job stays as it was, but for what may be edited.
    fn check_end(&mut self, job: &Job) {
        let known = self.jobs.get_mut(&job.key).unwrap();
        assert_eq!((job.id, &job.owner), (known.id, &known.owner));
        known.attempts = known.attempts.max(job.attempt);
        match &known.ended {
            Some(ended) => {
                let as_it_was = Job {
                    name: ended.name.clone(),
                    priority: ended.priority,
                    version: ended.version,
                    // it may be handed what a deleted one shared with it
                    stored_bytes: ended.stored_bytes,
                    ..job.clone()
                };
                assert_eq!(as_it_was, *ended);
            }
            None if job.status.is_terminal() => known.ended = Some(job.clone()),
            None => {}
        }
    }

    /// Events that were read once are read again, and new ones follow them without a gap.
    async fn check_events(&mut self, job: &Job, thorough: bool) {
        let known = self.jobs.get_mut(&job.key).unwrap();
        let seen = known.events.len() as i64;
        if !thorough
            && known.ended.is_some()
            && matches!(
                known.events.last().map(|e| &e.payload),
                Some(Payload::Done { .. })
            )
        {
            return;
        }
        let after = if thorough { 0 } else { seen };
        let read = self
            .store
            .events_after(job.key, after, 100_000)
            .await
            .unwrap();
        let read: Vec<Event> = read.iter().map(|event| event.read().unwrap()).collect();
        let (old, new) = read.split_at(usize::try_from(seen - after).unwrap().min(read.len()));
        if thorough {
            assert_eq!(
                old, known.events,
                "events of {} that were read before",
                job.key
            );
        }
        known.events.extend_from_slice(new);
        let events = &known.events;
        let numbers = events.iter().map(|event| event.seq);
        assert!(numbers.eq(1..=events.len() as i64), "{events:?}");
        assert!(
            events.is_sorted_by_key(|event| event.t),
            "times of {}: {events:#?}",
            job.key
        );
        assert!(
            events.is_sorted_by_key(|event| event.attempt),
            "{events:#?}"
        );
        let done = |event: &Event| matches!(event.payload, Payload::Done { .. });
        let ends = events.iter().filter(|event| done(event)).count();
        assert_eq!(ends, usize::from(job.status.is_terminal()), "{events:#?}");
        assert!(ends == 0 || events.last().is_some_and(done), "{events:#?}");
        if let Some(Payload::Done { job: last }) = events.last().map(|event| &event.payload) {
            assert_eq!(
                (last.status, last.reason, last.finished_at),
                (job.status, job.reason, job.finished_at)
            );
        }
        let starts = events
            .iter()
            .filter(|event| event.payload == Payload::status(Status::Running));
        assert_eq!(starts.count() as i32, job.attempt, "{events:#?}");
        if job.reason == Some(Reason::WorkerLost) && job.cached_from.is_none() {
            assert_eq!(jobs::losses(events), 2);
        }
        if thorough {
            let (after, limit) = (
                self.dice.i64(0..events.len() as i64 + 2),
                self.dice.i64(1..5),
            );
            let piece = self
                .store
                .events_after(job.key, after, limit)
                .await
                .unwrap();
            let piece = piece.iter().map(|event| event.read().unwrap());
            let known = &self.jobs[&job.key];
            let expected = known
                .events
                .iter()
                .skip(after as usize)
                .take(limit as usize);
            assert!(
                piece.eq(expected.cloned()),
                "{} events after {after}",
                limit
            );
        }
    }

    /// Every job has ended, every result can be read, every key is answered, and nothing else is left.
    pub(super) async fn check_the_end(&mut self) {
        self.check(true).await;
        self.store.discard_unattached().await.unwrap();
        for job in self.listed().await {
            assert!(job.status.is_terminal(), "{job:?}");
            if job.result_available == ResultAvailable::Final {
                let found = self.store.json_of(job.key, "summary").await.unwrap();
                let text = String::from_utf8(found.expect("a result")).unwrap();
                assert!(text.contains(&job.input_hash), "{text}");
            }
        }
        for ((owner, key), (payload, jobs)) in &self.keys {
            let (key, payload) = (key.clone(), payload.clone());
            let found = self.store.replay(owner, &RequestKey { key, payload }).await;
            let left: Vec<i64> = jobs
                .iter()
                .copied()
                .filter(|key| !self.jobs[key].deleted)
                .collect();
            match found {
                Ok(Some(found)) => assert!(found.iter().map(|job| job.key).eq(left)),
                Ok(None) | Err(StoreError::Deleted(_)) => assert!(left.is_empty()),
                Err(error) => panic!("{error}"),
            }
        }
        let counted = "select format('job %d (input %s, created %d): counted %d, kept %d',
                   id, input_hash, created_at, job_size.bytes, job_kept.bytes)
             from job_kept left join job_size using (job_id) join job on id = job_id
             where job_size.bytes is not job_kept.bytes";
        let otherwise: Vec<String> = values(&self.store, counted).await;
        assert_eq!(otherwise, Vec::<String>::new());
        for orphans in [
            "select count(*) from attachment where not exists (select 1 from job where id = key)",
            "select count(*) from attachment join job on id = key where attachment.name <> 'problem' and result_available = 'none'",
            "select count(*) from content where not exists
                 (select 1 from attachment where content = content.id and key = holder)",
            "select count(*) from content_piece where content not in (select id from content)",
            "select count(*) from event where not exists (select 1 from job where id = job_id)",
            "select count(*) from job where checksum is null",
            "select count(*) from job_size where job_id not in (select job_id from job_kept)",
            "select count(*) from owner_size where (jobs, job_bytes) <>
                 (select count(*), coalesce(sum(bytes), 0) from job_size where job_size.owner = owner_size.owner)",
            "select count(*) from pragma_foreign_key_check",
        ] {
            let count: i64 = value(&self.store, orphans).await;
            assert_eq!(count, 0, "{orphans}");
        }
        let whole: String = value(&self.store, "pragma integrity_check").await;
        assert_eq!(whole, "ok");
        assert_eq!(self.store.health().await.unwrap().damaged, 0);
    }
}

/// A job is consistent in itself, and with the one that it waits for.
fn check_job(job: &Job, jobs: &[Job]) {
    let times = [Some(job.created_at), job.started_at, job.finished_at];
    assert!(times.iter().flatten().is_sorted(), "{job:?}");
    assert_eq!(
        job.status.is_terminal(),
        job.finished_at.is_some(),
        "{job:?}"
    );
    let Some(primary) = job.coalesced_into else {
        return;
    };
    assert_eq!(job.status, Status::Queued, "{job:?}");
    let primary = jobs.iter().find(|other| other.key == primary);
    let primary = primary.expect("the job that it is coalesced into");
    assert!(!primary.status.is_terminal(), "{job:?} waits for ever");
    assert_eq!(primary.coalesced_into, None);
    assert_eq!(primary.input_hash, job.input_hash);
    let outranked = primary.status == Status::Queued && primary.priority < job.priority;
    assert!(!outranked, "{job:?} waits for one of lower priority");
}
