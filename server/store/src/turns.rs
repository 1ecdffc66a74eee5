//! Decides whose turn it is.
//!
//! The highest priority goes first. Within a priority owners take turns: the next job is the oldest one of the owner
//! whose last turn was longest ago; owners without a turn come before, in the order of their first jobs. A job of one
//! owner thus waits for one job of another owner who has submitted thousands, and not for all of them. Turns are
//! stored, and go on after a restart.
//!
//! Triggers keep the counts in `queue`, `owner_queue` and `waiting` (`migrations/0019_turns.sql`), whatever changes a
//! job: a claim looks at one job of each owner, and a check of a limit at one row.

use std::{
    collections::{BTreeSet, HashMap},
    sync::{Arc, atomic::Ordering},
};

use base::job::Job;
use rusqlite::Connection;

use super::{change::Change, database::Store, error::Result, sql::Sql};

/// The query for the next job, except jobs whose keys are in a JSON list, and jobs of owners who have as many running
/// jobs as they may.
pub(super) const NEXT: &str = "select owner,
         (select id from job indexed by job_queue
          where status = 'queued' and coalesced_into is null and job.priority = waiting.priority and job.owner = waiting.owner
                and id not in (select value from json_each(?)) order by id limit 1) as first
     from waiting join owner_queue using (owner) where running < ? and first is not null
     order by priority desc, turn limit 1";

/// The query for the number of jobs that wait for a worker, by priority and owner.
const GROUPS: &str = "select priority, owner, waiting.jobs, turn, running
     from waiting join owner_queue using (owner)";

/// The query for the key of the oldest job that waits for a worker.
const OLDEST: &str = "select min((select min(id) from job indexed by job_queue
         where status = 'queued' and coalesced_into is null and job.priority = waiting.priority and job.owner = waiting.owner))
     from waiting";

/// The query that counts the jobs that wait for a worker, for the table `waiting`.
const BY_PRIORITY: &str = "select priority, owner, count(*) as jobs from job indexed by job_queue
     where status = 'queued' and coalesced_into is null group by priority, owner";

/// The query that counts the jobs that wait or run, for the table `owner_queue`. The turn is that of an owner who has
/// had none.
const BY_OWNER: &str =
    "select owner, min(id) - 4611686018427387904 as turn, sum(status = 'queued') as jobs,
         sum(status = 'running') as running
     from job where status in ('queued', 'running') group by owner";

/// The number of an owner's jobs in the queue.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Load {
    /// The number of jobs that wait for a worker, or for the job that they are coalesced into.
    pub queued: u64,
    /// The number of running jobs.
    pub running: u64,
}

impl Store {
    /// Compares the counts of the queue with the jobs, when the store is opened, and corrects them if they differ. If
    /// that fails, they stay as they are, and the error is logged.
    pub(super) async fn count_queue(self: &Arc<Self>) -> Result<()> {
        let right = self.read(|_, connection| are_right(connection)).await;
        if !matches!(right, Ok(true)) {
            let counted = self.write(|writer| {
                let tx = writer.begin_control()?;
                count_again(&tx)?;
                tx.commit()
            });
            if let Err(error) = counted.await {
                tracing::error!(%error, "the jobs that wait cannot be counted: {error}");
            }
        }
        self.read(|store, connection| {
            store.note_waiting(queued(connection)?);
            Ok(())
        })
        .await
    }

    /// The numbers of jobs of every owner who has waiting or running jobs.
    pub async fn loads(self: &Arc<Self>) -> Result<HashMap<String, Load>> {
        self.read(|_, connection| {
            let loads =
                "select owner, jobs, running from owner_queue where jobs > 0 or running > 0";
            let loads = connection.rows(loads, (), |row| {
                let (owner, queued, running) = row.try_into()?;
                Ok((owner, load((queued, running))))
            })?;
            Ok(loads.into_iter().collect())
        })
        .await
    }

    /// The numbers of this owner's waiting and running jobs.
    pub async fn load_of(self: &Arc<Self>, owner: &str) -> Result<Load> {
        let owner = owner.to_owned();
        self.read(move |_, connection| load_of(connection, &owner))
            .await
    }

    /// Sets how many jobs of one owner may run at the same time; must be called once, before any job is claimed.
    pub fn set_most_running_of_owner(&self, most: usize) {
        let _ = self.most_running.set(most); // fails if it is set already, which is kept
    }

    /// How many jobs of one owner may run at the same time.
    pub(super) fn most_running_of_owner(&self) -> i64 {
        let most = self.most_running.get();
        most.map_or(i64::MAX, |most| i64::try_from(*most).unwrap_or(i64::MAX))
    }

    /// How many jobs wait for a worker, or for the job that they are coalesced into.
    pub fn waiting(&self) -> usize {
        self.waiting.load(Ordering::Relaxed)
    }

    /// Records how many jobs wait, after a commit.
    pub(super) fn note_waiting(&self, waiting: usize) {
        self.waiting.store(waiting, Ordering::Relaxed);
    }

    /// The age of the oldest job that waits for a worker (seconds).
    pub async fn oldest_wait_s(self: &Arc<Self>) -> Result<Option<f64>> {
        self.read(|store, connection| {
            let created = format!("select created_at from job where id = ({OLDEST})");
            let created: Option<i64> = connection.optional_value(&created, ())?;
            Ok(created.map(|at| (store.now().micros() - at).max(0) as f64 / 1e6))
        })
        .await
    }
}

impl Change<'_> {
    /// The key of the next job of the queue, except those that are passed over.
    pub(super) fn next(&mut self, passed: &BTreeSet<i64>) -> Result<Option<i64>> {
        let most_running = self.store().most_running_of_owner();
        next(self.sql()?, passed, most_running)
    }

    /// Records that an owner has a turn.
    pub(super) fn take_turn(&mut self, owner: &str) -> Result<()> {
        let tx = self.sql()?;
        let turn: i64 = tx.value("update queue set turns = turns + 1 returning turns", ())?;
        tx.run(
            "update owner_queue set turn = ? where owner = ?",
            (turn, owner),
        )?;
        Ok(())
    }

    /// How many jobs wait.
    pub(super) fn waiting(&mut self) -> Result<usize> {
        queued(self.sql()?)
    }

    /// How many jobs of this owner wait.
    pub(super) fn waiting_of(&mut self, owner: &str) -> Result<u64> {
        Ok(load_of(self.sql()?, owner)?.queued)
    }
}

/// The key of the next job of the queue, except those that are passed over.
pub(super) fn next(
    connection: &Connection,
    passed: &BTreeSet<i64>,
    most_running: i64,
) -> Result<Option<i64>> {
    let passed = serde_json::to_string(passed)?;
    connection.row(NEXT, (passed, most_running), |row| Ok(row.get("first")?))
}

fn queued(connection: &Connection) -> Result<usize> {
    let queued: i64 = connection.value("select jobs from queue", ())?;
    Ok(usize::try_from(queued).unwrap_or(0))
}

fn load_of(connection: &Connection, owner: &str) -> Result<Load> {
    let in_queue = "select jobs, running from owner_queue where owner = ?";
    let found = connection.row(in_queue, [owner], |row| Ok(row.try_into()?))?;
    Ok(found.map(load).unwrap_or_default())
}

fn load((queued, running): (i64, i64)) -> Load {
    let count = |count: i64| u64::try_from(count).unwrap_or(0);
    Load {
        queued: count(queued),
        running: count(running),
    }
}

/// Whether the stored counts match the jobs.
pub(super) fn are_right(connection: &Connection) -> Result<bool> {
    let differ = |kept: &str, counted: &str| -> Result<bool> {
        connection.value(
            &format!(
                "select exists (select * from ({kept}) except select * from ({counted}))
                     or exists (select * from ({counted}) except select * from ({kept}))"
            ),
            (),
        )
    };
    let waiting = differ("select * from waiting", BY_PRIORITY)?;
    let owners = differ(
        "select owner, jobs, running from owner_queue where jobs <> 0 or running <> 0",
        &format!("select owner, jobs, running from ({BY_OWNER})"),
    )?;
    let jobs = differ(
        "select jobs from queue",
        "select count(*) from job where status = 'queued'",
    )?;
    Ok(!waiting && !owners && !jobs)
}

/// Counts the jobs, and stores the counts.
fn count_again(tx: &Connection) -> Result<()> {
    for statement in [
        "delete from waiting",
        &format!("insert into waiting (priority, owner, jobs) {BY_PRIORITY}"),
        "update owner_queue set jobs = 0, running = 0",
        &format!(
            "insert into owner_queue (owner, turn, jobs, running) select * from ({BY_OWNER}) where true
             on conflict do update set jobs = excluded.jobs, running = excluded.running"
        ),
        "update queue set jobs = (select count(*) from job where status = 'queued')",
    ] {
        tx.run(statement, ())?;
    }
    Ok(())
}

/// The queue at one moment, from which the positions of several jobs are computed.
pub(super) struct Line<'a> {
    connection: &'a Connection,
    groups: Vec<Group>,
}

/// The waiting jobs of one priority and owner.
struct Group {
    priority: i32,
    owner: String,
    jobs: i64,
    running: i64,
    /// The number of the owner's last turn.
    turn: i64,
    /// The key of the last job of the group whose place was counted, and the number of jobs of the group before it.
    counted: Option<(i64, i64)>,
}

impl Line<'_> {
    /// Reads the present queue.
    pub(super) fn read(connection: &Connection) -> Result<Line<'_>> {
        let groups = connection.rows(GROUPS, (), |row| {
            Ok(Group {
                priority: row.get("priority")?,
                owner: row.get("owner")?,
                jobs: row.get("jobs")?,
                running: row.get("running")?,
                turn: row.get("turn")?,
                counted: None,
            })
        })?;
        Ok(Line { connection, groups })
    }

    /// The number of running jobs of this owner; 0 if the owner has no waiting jobs.
    pub(super) fn running_of(&self, owner: &str) -> i64 {
        let group = self.groups.iter().find(|group| group.owner == owner);
        group.map_or(0, |group| group.running)
    }

    /// The number of jobs ahead of this one; `None` if it does not wait for a worker. Owners who have as many running
    /// jobs as they may are counted as if they had fewer.
    pub(super) fn ahead(&mut self, job: &Job) -> Result<Option<i64>> {
        let own = |group: &Group| group.priority == job.priority && group.owner == job.owner;
        let Some(place) = self.groups.iter().position(own) else {
            return Ok(None);
        };
        let turn = self.groups[place].turn;
        let Some(here) = self.before(job, place)? else {
            return Ok(None);
        };
        // before its own turn with number `here`, each of the others has had as many, or one more
        let others = self.groups.iter().map(|other| match other.priority {
            priority if priority > job.priority => other.jobs,
            priority if priority == job.priority && other.owner != job.owner => {
                other.jobs.min(here + i64::from(other.turn < turn))
            }
            _ => 0,
        });
        Ok(Some(here + others.sum::<i64>()))
    }

    /// The number of waiting jobs of the group at `place`, which is that of `job`, before `job`; `None` if the job does
    /// not wait. It is counted from the last job that was asked for: for a page of jobs, each row is counted once.
    fn before(&mut self, job: &Job, place: usize) -> Result<Option<i64>> {
        /// The number of jobs at the end of the queue that are tried first: a new job is usually among them.
        const NEAR: i64 = 100;
        /// Counts the jobs of a group from one key to another, at most as many as asked for; with the least and the
        /// greatest of their keys.
        const COUNT: &str = "select count(*), min(id), max(id) from (select id from job indexed by job_queue
             where status = 'queued' and coalesced_into is null and priority = ? and owner = ? and id between ? and ?
             order by id limit ?)";
        let Some(group) = self.groups.get_mut(place) else {
            return Ok(None);
        };
        let (connection, key) = (self.connection, job.key);
        let count = |from: i64, to: i64, most: i64| -> Result<(i64, Option<i64>, Option<i64>)> {
            let asked = (job.priority, &job.owner, from, to, most);
            let found = connection.row(COUNT, asked, |row| Ok(row.try_into()?))?;
            Ok(found.unwrap_or_default())
        };
        let (before, waits) = match group.counted {
            Some((last, before)) if last < key => {
                let (more, _, greatest) = count(last + 1, key, i64::MAX)?;
                (before + more, greatest == Some(key))
            }
            Some((last, before)) => {
                let (less, least, _) = count(key, last - 1, i64::MAX)?;
                (before - less, least == Some(key) || last == key)
            }
            None => {
                let (behind, least, _) = count(key, i64::MAX, NEAR)?;
                let before = if behind < NEAR {
                    group.jobs - behind
                } else {
                    count(0, key - 1, i64::MAX)?.0
                };
                (before, least == Some(key))
            }
        };
        if !waits {
            return Ok(None);
        }
        group.counted = Some((key, before));
        Ok(Some(before))
    }
}
