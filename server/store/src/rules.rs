//! The rules of a job: what each operation does to a job, and what follows from a change of its row: a version, an
//! event, a line in the log. Which status may follow which is in `base::job::Status::may_become`. No I/O.

use base::{
    event::{Payload, Requeue},
    job::{Failure, Job, Reason, ResultAvailable, Status},
    time::Time,
};
use serde::{Deserialize, Serialize};
use solver::solution::{EstimatedQuantity, Verdict, Warning};

use super::{
    error::{Damage, Result, StoreError},
    rows::JobRow,
    submission::NewJob,
};

/// The number of attempts that may end with the death of the process before a job fails.
const MAX_ATTEMPTS: i32 = 3;

/// How a job ends.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Ending {
    /// The terminal status of the job.
    pub status: Status,
    /// The reason, unless the job succeeded.
    pub reason: Option<Reason>,
    /// What went wrong, if the job failed.
    pub failure: Option<Failure>,
    /// Whether the job has a result, partial or final.
    pub result: ResultAvailable,
    /// What the row of the job says about its result.
    #[serde(default)]
    pub overview: Overview,
}

/// What the row of a job says about its result: whether it can be relied on, and why not.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Overview {
    /// The verdict on the result.
    pub verdict: Option<Verdict>,
    /// Forces and peaks with their errors.
    pub quantities: Vec<EstimatedQuantity>,
    /// The worst warnings about the result.
    pub warnings: Vec<Warning>,
}

impl Overview {
    fn of(job: &Job) -> Self {
        Overview {
            verdict: job.verdict,
            quantities: job.quantities.clone(),
            warnings: job.warnings.clone(),
        }
    }

    fn write(self, job: &mut Job) {
        job.verdict = self.verdict;
        job.quantities = self.quantities;
        job.warnings = self.warnings;
    }
}

impl Ending {
    /// The end of a canceled job without a result.
    pub fn canceled() -> Self {
        let reason = Some(Reason::UserCancel);
        Ending {
            status: Status::Canceled,
            reason,
            failure: None,
            result: ResultAvailable::None,
            overview: Overview::default(),
        }
    }

    /// The end of a job that failed because data that it needs are damaged.
    pub(super) fn damaged(damage: &Damage) -> Self {
        Ending::failed(Reason::Internal, damage.to_string())
    }

    /// The end of a job that failed without a result.
    pub fn failed(reason: Reason, detail: impl Into<String>) -> Self {
        let failure = Some(Failure::new(reason, detail));
        Ending {
            status: Status::Failed,
            reason: Some(reason),
            failure,
            result: ResultAvailable::None,
            overview: Overview::default(),
        }
    }

    /// The end of a job that is answered with the result of the job `source`.
    pub(super) fn like(source: &Job) -> Self {
        Ending {
            status: source.status,
            reason: source.reason,
            failure: source.failure.clone(),
            result: source.result_available,
            overview: Overview::of(source),
        }
    }

    /// The end of a job that a client has asked to stop, given the end that its solver reports: a result that was found
    /// before the solver noticed the request is kept as a partial result.
    pub(super) fn after_a_request_to_stop(&self) -> Self {
        match self.status {
            Status::Succeeded => Ending {
                result: self.result.min(ResultAvailable::Partial),
                overview: self.overview.clone(),
                ..Ending::canceled()
            },
            _ => self.clone(),
        }
    }
}

/// What a client's request to cancel a job does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cancel {
    /// The job does not run, and ends at once.
    End,
    /// The job runs, and is asked to stop.
    Ask,
    /// The job runs, and was asked to stop before.
    Asked,
    /// The job has ended.
    TooLate,
}

/// What happens to a job that was running when the service stopped, or whose process died.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Interrupted {
    /// The job ends, since a client has asked it to stop.
    Cancel,
    /// The job waits again.
    Requeue(Requeue),
    /// The job fails, since its process died in its last attempt.
    Fail,
}

/// What a request to cancel this job does.
pub(super) fn canceling(job: &Job) -> Cancel {
    match job.status {
        Status::Queued => Cancel::End,
        Status::Running if job.cancel_requested => Cancel::Asked,
        Status::Running => Cancel::Ask,
        Status::Succeeded | Status::Failed | Status::Canceled => Cancel::TooLate,
    }
}

/// What happens to a running job that is interrupted for this reason; `stop`: whether a client has asked it to stop.
pub(super) fn interrupted(job: &Job, why: Requeue, stop: bool) -> Interrupted {
    match why {
        _ if stop => Interrupted::Cancel,
        Requeue::WorkerLost if job.attempt >= job.max_attempts => Interrupted::Fail,
        _ => Interrupted::Requeue(why),
    }
}

impl JobRow {
    /// The row of a job that is accepted now; `key` is the job's number.
    pub(super) fn accepted(key: i64, owner: &str, new: &NewJob, now: Time) -> JobRow {
        let job = Job {
            key,
            id: new.id.unwrap_or_default(),
            status: Status::Queued,
            version: 1,
            name: new.name.clone(),
            labels: new.labels.clone(),
            owner: owner.to_owned(),
            priority: new.priority,
            max_attempts: MAX_ATTEMPTS,
            input_hash: new.input_hash.clone(),
            cache: new.cache,
            parent: new.parent,
            sweep: new.sweep,
            created_at: now,
            limits: new.limits,
            mesh: new.mesh.clone(),
            memory_bytes: Some(new.memory_bytes.min(i64::MAX as u64)),
            ..Job::default()
        };
        let mut row = JobRow {
            job,
            title: new.title.clone(),
            payload: Some(new.payload.clone()),
            ..JobRow::default()
        };
        row.waits_from(now);
        row.derive();
        row
    }

    /// Starts an attempt.
    pub(super) fn start(&mut self, now: Time) -> Result<()> {
        self.becomes(Status::Running)?;
        let job = &mut self.job;
        job.coalesced_into = None;
        job.attempt += 1;
        job.started_at = Some(now.max(job.created_at));
        job.progress = None;
        job.result_available = ResultAvailable::None;
        Overview::default().write(job);
        Ok(())
    }

    /// Starts a job that ends at once with the result of the job `source`, which has the same input.
    pub(super) fn start_with_answer(&mut self, source: &Job, now: Time) -> Result<()> {
        self.start(now)?;
        self.job.cached_from = Some(source.id);
        Ok(())
    }

    /// Ends the job.
    pub(super) fn end(&mut self, ending: &Ending, now: Time) -> Result<()> {
        self.becomes(ending.status)?;
        let job = &mut self.job;
        job.reason = ending.reason;
        job.failure = ending.failure.clone();
        ending.overview.clone().write(job);
        // the results of finished load steps are kept, whatever the status
        job.result_available = ending.result.max(job.result_available);
        // lists rely on the fact that no job ends before it was accepted, even if the clock was set back
        job.finished_at = Some(now.max(job.started_at.unwrap_or(job.created_at)));
        job.coalesced_into = None;
        self.solver_version = Some(env!("CARGO_PKG_VERSION").to_owned());
        Ok(())
    }

    /// Lets the job wait again.
    pub(super) fn requeue(&mut self, why: Requeue, now: Time) -> Result<()> {
        self.becomes(Status::Queued)?;
        // The attempt keeps its number, by which events are distinguished; if it does not count, one more is allowed.
        self.job.max_attempts += i32::from(why == Requeue::Drain);
        self.waits_from(now);
        Ok(())
    }

    /// Records that a client has asked the running job to stop.
    pub(super) fn ask_to_stop(&mut self) {
        self.job.cancel_requested = true;
    }

    /// Begins the time for which the job may wait at `now`.
    pub(super) fn waits_from(&mut self, now: Time) {
        self.expires_at = Some(now.after_s(self.job.limits.queue_ttl_s));
    }

    /// Lets a coalesced job wait for a worker by itself.
    pub(super) fn waits_by_itself(&mut self) {
        self.job.coalesced_into = None;
    }

    fn becomes(&mut self, next: Status) -> Result<()> {
        let job = &mut self.job;
        if !job.status.may_become(next) {
            return Err(StoreError::Unexpected(format!(
                "{} cannot go from {:?} to {next:?}",
                job.id, job.status
            )));
        }
        job.status = next;
        Ok(())
    }
}

/// Whether the version counts a change: of the status, a request to stop, or an edit; not of the progress.
pub(super) fn is_new_version(old: &Job, new: &Job) -> bool {
    let counted = |job: &Job| (job.status, job.cancel_requested, job.priority, job.pinned);
    counted(old) != counted(new) || old.name != new.name || old.labels != new.labels
}

/// The event of a change of status; `None` if the status did not change, or if the job has ended: `end_job` makes the
/// event of the end, which also tells what the job keeps in the store.
pub(super) fn event(old: Option<&Job>, new: &Job, now: Time) -> Option<(Time, Payload)> {
    if old.is_some_and(|old| old.status == new.status) {
        return None;
    }
    match (new.status, old) {
        (Status::Queued, None) => Some((new.created_at, Payload::status(Status::Queued))),
        (Status::Queued, Some(old)) => {
            let drained = new.max_attempts > old.max_attempts;
            let why = if drained {
                Requeue::Drain
            } else {
                Requeue::WorkerLost
            };
            Some((now, Payload::requeued(why)))
        }
        (Status::Running, _) => Some((
            new.started_at.unwrap_or(now),
            Payload::status(Status::Running),
        )),
        (Status::Succeeded | Status::Failed | Status::Canceled, _) => None,
    }
}

/// The end of a job, as it is logged and counted.
#[derive(Debug, PartialEq)]
pub(super) struct Ended {
    pub(super) owner: String,
    /// The times for which the job waited and ran (s), if it ran.
    pub(super) times_s: Option<(f64, f64)>,
    pub(super) status: Status,
    pub(super) reason: Option<Reason>,
    /// What went wrong; empty if nothing did.
    pub(super) detail: String,
}

/// The end of a job, if this change is its end.
pub(super) fn ended(old: &Job, new: &Job) -> Option<Ended> {
    if old.status.is_terminal() || !new.status.is_terminal() {
        return None;
    }
    let times = new.queue_wait_s.zip(new.run_s);
    let failure = new.failure.as_ref();
    Some(Ended {
        owner: new.owner.clone(),
        times_s: times.filter(|_| old.status == Status::Running),
        status: new.status,
        reason: new.reason,
        detail: failure.map_or_else(String::new, |failure| failure.detail.clone()),
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use strum::VariantArray;

    use super::*;
    use base::job::{Cache, JobId, Limits};

    const ACCEPTED: Time = Time::from_micros(1_000_000);
    const NOW: Time = Time::from_micros(5_000_000);
    const LATER: Time = Time::from_micros(9_000_000);

    /// A job that has just been accepted.
    fn queued() -> JobRow {
        let new = NewJob {
            id: Some(JobId::new()),
            name: None,
            labels: Default::default(),
            priority: 0,
            limits: Limits::default(),
            cache: Cache::Use,
            parent: None,
            sweep: None,
            title: Some("a title".into()),
            input_hash: "sha256:1".into(),
            problem: "{}".into(),
            mesh: None,
            memory_bytes: 0,
            payload: "payload".into(),
        };
        JobRow::accepted(7, "ada", &new, ACCEPTED)
    }

    fn running() -> JobRow {
        let mut row = queued();
        row.start(NOW).unwrap();
        row.derive();
        row
    }

    fn ending(status: Status) -> Ending {
        match status {
            Status::Failed => Ending::failed(Reason::NonFinite, "so"),
            Status::Succeeded => Ending {
                status,
                reason: None,
                failure: None,
                result: ResultAvailable::Final,
                overview: Overview::default(),
            },
            _ => Ending::canceled(),
        }
    }

    /// One job of each status.
    fn of_each_status() -> Vec<JobRow> {
        let mut all = vec![queued(), running()];
        for status in [Status::Succeeded, Status::Failed, Status::Canceled] {
            let mut row = running();
            row.end(&ending(status), LATER).unwrap();
            row.derive();
            all.push(row);
        }
        let found: Vec<Status> = all.iter().map(|row| row.job.status).collect();
        assert_eq!(found, Status::VARIANTS);
        all
    }

    type Verb = fn(&mut JobRow) -> Result<()>;

    /// What each verb makes of a job of each status; none: it is refused, and the job stays as it is.
    #[test]
    fn each_verb_leads_from_each_status_to_one_or_is_refused() {
        use Status::{Canceled, Failed, Queued, Running, Succeeded};
        let verbs: [(&str, Verb, [Option<Status>; 5]); 7] = [
            (
                "start",
                |row| row.start(LATER),
                [Some(Running), None, None, None, None],
            ),
            (
                "answer",
                |row| row.start_with_answer(&queued().job, LATER),
                [Some(Running), None, None, None, None],
            ),
            (
                "succeed",
                |row| row.end(&ending(Succeeded), LATER),
                [None, Some(Succeeded), None, None, None],
            ),
            (
                "fail",
                |row| row.end(&ending(Failed), LATER),
                [Some(Failed), Some(Failed), None, None, None],
            ),
            (
                "cancel",
                |row| row.end(&ending(Canceled), LATER),
                [Some(Canceled), Some(Canceled), None, None, None],
            ),
            (
                "drain",
                |row| row.requeue(Requeue::Drain, LATER),
                [None, Some(Queued), None, None, None],
            ),
            (
                "lose",
                |row| row.requeue(Requeue::WorkerLost, LATER),
                [None, Some(Queued), None, None, None],
            ),
        ];
        for (name, verb, expected) in verbs {
            for (row, expected) in of_each_status().into_iter().zip(expected) {
                let mut new = row.clone();
                let done = verb(&mut new);
                match expected {
                    Some(status) => {
                        done.unwrap();
                        assert_eq!(new.job.status, status, "{name}");
                        assert!(is_new_version(&row.job, &new.job), "{name}");
                    }
                    None => {
                        assert!(done.is_err(), "{name} {:?}", row.job.status);
                        assert_eq!(new, row, "{name}");
                    }
                }
            }
        }
    }

    #[test]
    fn canceling_depends_on_the_status_and_on_whether_it_was_asked_for_before() {
        let found: Vec<Cancel> = of_each_status()
            .iter()
            .map(|row| canceling(&row.job))
            .collect();
        let late = Cancel::TooLate;
        assert_eq!(found, [Cancel::End, Cancel::Ask, late, late, late]);
        let mut asked = running();
        asked.ask_to_stop();
        assert_eq!(canceling(&asked.job), Cancel::Asked);
        assert!(is_new_version(&running().job, &asked.job));
    }

    #[test]
    fn an_interrupted_job_is_requeued_until_its_attempts_are_used_up_unless_it_was_to_stop() {
        let (drain, lost) = (Requeue::Drain, Requeue::WorkerLost);
        let mut row = running();
        assert_eq!(
            interrupted(&row.job, lost, false),
            Interrupted::Requeue(lost)
        );
        row.job.attempt = row.job.max_attempts;
        assert_eq!(interrupted(&row.job, lost, false), Interrupted::Fail);
        assert_eq!(
            interrupted(&row.job, drain, false),
            Interrupted::Requeue(drain)
        );
        for why in [drain, lost] {
            assert_eq!(interrupted(&row.job, why, true), Interrupted::Cancel);
        }
    }

    #[test]
    fn an_attempt_begins_with_nothing_of_the_one_before() {
        let mut row = running();
        row.job.result_available = ResultAvailable::Partial;
        row.job.progress = Some(Default::default());
        row.requeue(Requeue::WorkerLost, LATER).unwrap();
        assert_eq!((row.job.attempt, row.job.max_attempts), (1, 3));
        assert_eq!(
            row.expires_at,
            Some(LATER.after_s(row.job.limits.queue_ttl_s))
        );
        row.start(LATER).unwrap();
        assert_eq!((row.job.attempt, row.job.started_at), (2, Some(LATER)));
        assert_eq!(row.job.progress, None);
        assert_eq!(row.job.result_available, ResultAvailable::None);
        // one that the service gave back does not count
        row.requeue(Requeue::Drain, LATER).unwrap();
        assert_eq!((row.job.attempt, row.job.max_attempts), (2, 4));
    }

    #[test]
    fn an_end_keeps_a_partial_result_and_is_not_before_the_start() {
        let mut row = running();
        row.job.result_available = ResultAvailable::Partial;
        row.end(&ending(Status::Failed), ACCEPTED).unwrap();
        row.derive();
        assert_eq!(row.job.result_available, ResultAvailable::Partial);
        assert_eq!((row.job.finished_at, row.job.run_s), (Some(NOW), Some(0.0)));
        let found = ending(Status::Succeeded).after_a_request_to_stop();
        assert_eq!(
            (found.status, found.result),
            (Status::Canceled, ResultAvailable::Partial)
        );
        let failed = ending(Status::Failed).after_a_request_to_stop();
        assert_eq!(failed.status, Status::Failed);
    }

    #[test]
    fn an_answered_job_ends_like_the_other() {
        let mut source = running();
        source.end(&ending(Status::Succeeded), NOW).unwrap();
        source.derive();
        let mut row = queued();
        row.job.coalesced_into = Some(source.job.key);
        row.start_with_answer(&source.job, NOW).unwrap();
        row.end(&Ending::like(&source.job), NOW).unwrap();
        row.derive();
        assert_eq!(row.job.cached_from, Some(source.job.id));
        assert_eq!(
            (row.job.status, row.job.coalesced_into),
            (Status::Succeeded, None)
        );
    }

    #[test]
    fn the_version_counts_what_clients_are_told_of_and_not_progress() {
        let old = queued();
        let edits: [fn(&mut Job); 4] = [
            |job| job.name = Some("n".into()),
            |job| job.labels = [("a".to_owned(), "b".to_owned())].into(),
            |job| job.priority += 1,
            |job| job.pinned = true,
        ];
        for edit in edits {
            let mut new = old.job.clone();
            edit(&mut new);
            assert!(is_new_version(&old.job, &new));
        }
        let others: [fn(&mut Job); 4] = [
            |job| job.progress = Some(Default::default()),
            |job| job.coalesced_into = Some(3),
            |job| job.result_available = ResultAvailable::Partial,
            |job| job.max_attempts += 1,
        ];
        for other in others {
            let mut new = old.job.clone();
            other(&mut new);
            assert!(!is_new_version(&old.job, &new));
        }
    }

    #[test]
    fn each_change_of_status_but_the_end_has_its_event() {
        let (queued, running) = (queued(), running());
        let of =
            |old: Option<&JobRow>, new: &JobRow| event(old.map(|row| &row.job), &new.job, LATER);
        let status = Payload::status;
        assert_eq!(of(None, &queued), Some((ACCEPTED, status(Status::Queued))));
        assert_eq!(
            of(Some(&queued), &running),
            Some((NOW, status(Status::Running)))
        );
        for why in [Requeue::Drain, Requeue::WorkerLost] {
            let mut again = running.clone();
            again.requeue(why, LATER).unwrap();
            let expected = (LATER, Payload::requeued(why));
            assert_eq!(of(Some(&running), &again), Some(expected));
        }
        for row in of_each_status() {
            assert_eq!(of(Some(&row), &row), None);
            if row.job.status.is_terminal() {
                assert_eq!(of(Some(&running), &row), None);
            }
        }
    }

    #[test]
    fn the_end_is_told_with_the_times_of_a_job_that_ran() {
        let (queued, running) = (queued(), running());
        for row in of_each_status() {
            let told = ended(&running.job, &row.job);
            assert_eq!(told.is_some(), row.job.status.is_terminal());
            assert_eq!(ended(&row.job, &row.job), None);
            let Some(told) = told else { continue };
            assert_eq!(
                (told.status, told.times_s),
                (row.job.status, Some((4.0, 4.0)))
            );
        }
        let mut expired = queued.clone();
        expired
            .end(&Ending::failed(Reason::QueueExpired, "so"), NOW)
            .unwrap();
        expired.derive();
        let told = ended(&queued.job, &expired.job).unwrap();
        assert_eq!((told.times_s, told.detail.as_str()), (None, "so"));
    }
}
