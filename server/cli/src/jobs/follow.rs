//! Follows a job or a sweep to its end, also while the service is restarted.

use std::{ops::ControlFlow, time::Duration};

use anyhow::{Context, bail, ensure};
use base::job::{Job, JobId, Reason, Status};
use eventsource_stream::Eventsource;
use futures_util::StreamExt;
use reqwest::{Method, StatusCode, header};
use serde_json::Value;
use tokio::time::{Instant, sleep, sleep_until, timeout_at};

use super::{
    super::{
        exit::Exit,
        service::{CallError, Service, misunderstood},
    },
    id::Id,
};

/// The longest time for which a service that was reached before is tried again.
const PATIENCE: Duration = Duration::from_secs(300);
/// The pause before the first further attempt; it is doubled before each one after that.
const FIRST_PAUSE: Duration = Duration::from_millis(250);
/// The longest pause before a further attempt.
const LONGEST_PAUSE: Duration = Duration::from_secs(5);
/// The longest time that one request waits for the end of a job (seconds), within the limit of the service: a proxy may
/// cut a connection that is silent for a minute.
const WAIT_S: f64 = 30.0;

/// How much later than the deadline an answer that is due at the deadline may come.
const GRACE: Duration = Duration::from_secs(5);

/// The state of following a service that may be out of reach for a time.
struct Outage {
    /// Whether the service has answered before, or a connection to the service was open.
    known: bool,
    since: Option<Instant>,
    pause: Duration,
    /// The time when waiting for the job ends; `None`: never.
    deadline: Option<Instant>,
}

impl Outage {
    fn until(deadline: Option<Instant>) -> Outage {
        Outage {
            known: false,
            since: None,
            pause: FIRST_PAUSE,
            deadline,
        }
    }

    fn over(&mut self) {
        *self = Outage {
            known: true,
            ..Outage::until(self.deadline)
        };
    }

    /// Pauses before the next attempt, at most until the deadline; returns the error if it is permanent or the service
    /// was never reached.
    async fn bear(&mut self, error: anyhow::Error) -> anyhow::Result<()> {
        let passing = match error.downcast_ref() {
            Some(CallError::Unreachable { connected, .. }) => {
                self.known |= connected;
                self.known
            }
            Some(CallError::Refused(refusal)) => refusal.may_pass(),
            None => false,
        };
        let now = Instant::now();
        let since = *self.since.get_or_insert(now);
        let last = since + PATIENCE;
        if !passing || now > last {
            return Err(error);
        }
        let end = self.deadline.map_or(last, |deadline| deadline.min(last));
        if since == now {
            let left = end.saturating_duration_since(now).as_secs_f64().ceil();
            eprintln!("signorini: {error}; trying again for {left} s");
        }
        sleep_until((now + self.pause).min(end)).await;
        self.pause = (self.pause * 2).min(LONGEST_PAUSE);
        Ok(())
    }
}

/// The result of waiting for a job or a sweep.
pub(super) enum Waited {
    /// The job or sweep has ended; this is its document.
    Ended(Value),
    /// The deadline has passed; this is the last document from the service, if it sent any.
    TimedOut(Option<Value>),
}

/// Waits for the end of a job; returns it. An error if it has not succeeded.
pub(crate) async fn ended(service: &Service, id: JobId) -> anyhow::Result<Job> {
    let document = match wait(service, Id::Job(id), None).await? {
        Waited::Ended(document) => document,
        Waited::TimedOut(last) => last.unwrap_or_default(),
    };
    let job: Job = serde_json::from_value(document).with_context(|| misunderstood("the job"))?;
    let failure = job.failure.as_ref().map(|failure| failure.detail.as_str());
    ensure!(
        job.status == Status::Succeeded,
        "the job failed: {}",
        failure.unwrap_or_default()
    );
    Ok(job)
}

/// Waits until the job or sweep has ended, or until the deadline.
pub(super) async fn wait(
    service: &Service,
    id: Id,
    deadline: Option<Instant>,
) -> anyhow::Result<Waited> {
    let (mut outage, mut last) = (Outage::until(deadline), None);
    loop {
        let asked = Instant::now();
        let left = deadline.map(|end| end.saturating_duration_since(asked).as_secs_f64());
        let wait = left.map_or(WAIT_S, |left| left.min(WAIT_S));
        let until = match id {
            Id::Job(_) => "&until=terminal",
            Id::Sweep(_) => "",
        };
        let path = format!("{}?wait={wait:.3}{until}", id.path());
        let answer = async {
            let answer = service.send(service.request(Method::GET, &path)).await?;
            service.document::<Value>(answer).await
        };
        let answer = match deadline {
            None => answer.await,
            Some(end) => match timeout_at(end + GRACE, answer).await {
                Ok(answer) => answer,
                Err(_) => return Ok(Waited::TimedOut(last)),
            },
        };
        match answer {
            Ok(document) => {
                let Some(status) = status_of(&document) else {
                    bail!(
                        "the answer to {path} has no status: check that this is the address of a signorini service"
                    );
                };
                if status.is_terminal() {
                    return Ok(Waited::Ended(document));
                }
                outage.over();
                last = Some(document);
                // a service that stops answers at once, and would be asked again without a pause
                let pause = asked + FIRST_PAUSE;
                sleep_until(deadline.map_or(pause, |end| end.min(pause))).await;
            }
            Err(error) => outage.bear(error).await?,
        }
        if deadline.is_some_and(|end| Instant::now() >= end) {
            return Ok(Waited::TimedOut(last));
        }
    }
}

/// The status in the document of a job or a sweep.
fn status_of(document: &Value) -> Option<Status> {
    document["status"].as_str()?.parse().ok()
}

/// Passes each event of a job or sweep to `heard` once, until there are no more or `heard` breaks.
pub(super) async fn events(
    service: &Service,
    id: Id,
    mut heard: impl FnMut(Value) -> anyhow::Result<ControlFlow<()>>,
) -> anyhow::Result<()> {
    let (mut outage, mut last) = (Outage::until(None), 0);
    loop {
        let path = format!("{}/events?after_seq={last}", id.path());
        let request = service.request(Method::GET, &path);
        let request = request.header(header::ACCEPT, "text/event-stream");
        let answer = match service.send(request).await {
            Ok(answer) if answer.status() == StatusCode::NO_CONTENT => return Ok(()),
            Ok(answer) => answer,
            Err(error) => {
                outage.bear(error).await?;
                continue;
            }
        };
        let kind = answer.headers().get(header::CONTENT_TYPE);
        if !kind.is_some_and(|kind| kind.as_bytes().starts_with(b"text/event-stream")) {
            bail!(
                "the answer to {path} is no stream of events: check that this is the address of a signorini service"
            );
        }
        outage.over();
        let mut events = answer.bytes_stream().eventsource();
        // a stream that breaks off is taken up again behind the last event that arrived
        while let Some(Ok(event)) = events.next().await {
            let event: Value =
                serde_json::from_str(&event.data).with_context(|| misunderstood("the event"))?;
            let Some(seq) = event["seq"].as_i64() else {
                bail!("an event has no number: {event}");
            };
            if seq <= last {
                continue;
            }
            last = seq;
            if heard(event)?.is_break() {
                return Ok(());
            }
        }
        sleep(FIRST_PAUSE).await;
    }
}

/// The exit code of a command that waited for the end of a job.
pub(super) fn exit_of(job: &Job) -> Exit {
    match (job.status, job.reason) {
        (Status::Canceled, _) => Exit::Canceled,
        (
            Status::Failed,
            Some(Reason::NotConverged | Reason::ContactCycling | Reason::FalseConvergence),
        ) => Exit::NotConverged,
        (Status::Failed, _) => Exit::Failed,
        (Status::Succeeded | Status::Queued | Status::Running, _) => Exit::Ok,
    }
}

/// The exit code of a command that waited for the end of the job or sweep in this document.
pub(super) fn exit_of_document(id: Id, document: &Value) -> anyhow::Result<Exit> {
    if let Id::Job(_) = id {
        return Ok(exit_of(&super::listing::job(document)?));
    }
    Ok(exit_of_sweep(document))
}

/// The exit code of a command that waited for the end of a sweep.
pub(super) fn exit_of_sweep(document: &Value) -> Exit {
    let failed = document["members"]["failed"].as_u64().unwrap_or_default();
    match status_of(document) {
        Some(Status::Canceled) => Exit::Canceled,
        Some(Status::Failed) => Exit::Failed,
        _ if failed > 0 => Exit::NotConverged,
        _ => Exit::Ok,
    }
}

/// Runs `work`, and ends the process at Ctrl-C as the signal itself would, after printing that the job or sweep
/// continues.
pub(super) async fn detached<T>(
    id: Id,
    work: impl Future<Output = anyhow::Result<T>>,
) -> anyhow::Result<T> {
    tokio::select! {
        done = work => done,
        _ = tokio::signal::ctrl_c() => {
            eprintln!("\n{id} continues; `signorini watch {id}` follows it again, `signorini cancel {id}` ends it");
            std::process::exit(130)
        }
    }
}
