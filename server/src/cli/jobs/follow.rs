//! Following a job or a sweep to its end, also while the service is restarted.

use std::{ops::ControlFlow, time::Duration};

use anyhow::{Context, bail};
use eventsource_stream::Eventsource;
use futures_util::StreamExt;
use reqwest::{Method, StatusCode, header};
use serde_json::Value;
use tokio::time::{Instant, sleep, sleep_until, timeout_at};

use super::{
    super::{
        exit::Exit,
        service::{CallError, Service},
    },
    id::Id,
};
use crate::job::{Job, Reason, Status};

/// A service that was there is looked for again so long, with pauses that grow.
const PATIENCE: Duration = Duration::from_secs(300);
const FIRST_PAUSE: Duration = Duration::from_millis(250);
const LONGEST_PAUSE: Duration = Duration::from_secs(5);
/// Seconds that one request waits at most, of those that the service allows: a proxy may cut off what is silent for a minute.
const WAIT_S: f64 = 30.0;

/// Since when the service was not reached.
struct Outage {
    /// It has answered before, or a connection to it was open.
    known: bool,
    since: Option<Instant>,
    pause: Duration,
}

impl Outage {
    fn new() -> Outage {
        Outage {
            known: false,
            since: None,
            pause: FIRST_PAUSE,
        }
    }

    fn over(&mut self) {
        *self = Outage {
            known: true,
            ..Outage::new()
        };
    }

    /// Waits before the next attempt, or gives up: with an error that will not pass, or a service that never was there.
    async fn bear(&mut self, error: anyhow::Error) -> anyhow::Result<()> {
        let passing = match error.downcast_ref() {
            Some(CallError::Unreachable { connected, .. }) => {
                self.known |= connected;
                self.known
            }
            Some(CallError::Refused(refusal)) => refusal.may_pass(),
            None => false,
        };
        if passing && self.since.is_none() {
            let minutes = PATIENCE.as_secs() / 60;
            eprintln!("signorini: {error}; trying again for {minutes} minutes");
        }
        let since = *self.since.get_or_insert_with(Instant::now);
        if !passing || since.elapsed() > PATIENCE {
            return Err(error);
        }
        sleep(self.pause).await;
        self.pause = (self.pause * 2).min(LONGEST_PAUSE);
        Ok(())
    }
}

/// Waits until it has ended; `None`: the deadline has passed.
pub(super) async fn wait(
    service: &Service,
    id: Id,
    deadline: Option<Instant>,
) -> anyhow::Result<Option<Value>> {
    let mut outage = Outage::new();
    loop {
        let asked = Instant::now();
        let left = deadline.map(|end| end.saturating_duration_since(asked).as_secs_f64());
        let wait = left.map_or(WAIT_S, |left| left.min(WAIT_S));
        let until = match id {
            Id::Job(_) => "&until=terminal",
            Id::Sweep(_) => "",
        };
        let path = format!("{}?wait={wait:.3}{until}", id.path());
        let answer = service.send(service.request(Method::GET, &path)).await;
        let document: anyhow::Result<Value> = match answer {
            Ok(answer) => service.document(answer).await,
            Err(error) => Err(error),
        };
        match (document, deadline) {
            (Ok(document), _) if has_ended(&document) => return Ok(Some(document)),
            (Ok(_), _) => {
                outage.over();
                // a service that stops answers at once, and would be asked again without a pause
                let pause = asked + FIRST_PAUSE;
                sleep_until(deadline.map_or(pause, |end| end.min(pause))).await;
            }
            (Err(error), None) => outage.bear(error).await?,
            (Err(error), Some(end)) => {
                // the pause ends with the time that there is
                if let Ok(borne) = timeout_at(end, outage.bear(error)).await {
                    borne?;
                }
            }
        }
        if deadline.is_some_and(|end| Instant::now() >= end) {
            return Ok(None);
        }
    }
}

/// Whether a job or a sweep has ended.
fn has_ended(document: &Value) -> bool {
    let status = document["status"].as_str();
    status
        .and_then(|word| word.parse().ok())
        .is_some_and(Status::is_terminal)
}

/// Hears all events, each once, until there is no further one.
pub(super) async fn events(
    service: &Service,
    id: Id,
    mut heard: impl FnMut(Value) -> anyhow::Result<ControlFlow<()>>,
) -> anyhow::Result<()> {
    let (mut outage, mut last) = (Outage::new(), 0);
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
                "what {path} answers is no stream of events: is the address that of a signorini service?"
            );
        }
        outage.over();
        let mut events = answer.bytes_stream().eventsource();
        // a stream that breaks off is taken up again behind the last event that arrived
        while let Some(Ok(event)) = events.next().await {
            let event: Value = serde_json::from_str(&event.data)
                .context("the event is not that of this version of signorini")?;
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

/// How a command ends that was to see a job to its end.
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

/// The same of a document that is a job or a sweep.
pub(super) fn exit_of_document(id: Id, document: &Value) -> anyhow::Result<Exit> {
    if let Id::Job(_) = id {
        return Ok(exit_of(&super::listing::job(document)?));
    }
    Ok(exit_of_sweep(document))
}

/// The same of a sweep.
pub(super) fn exit_of_sweep(document: &Value) -> Exit {
    let failed = document["members"]["failed"].as_u64().unwrap_or_default();
    let status = document["status"].as_str();
    match status.and_then(|word| word.parse().ok()) {
        Some(Status::Canceled) => Exit::Canceled,
        Some(Status::Failed) => Exit::Failed,
        _ if failed > 0 => Exit::NotConverged,
        _ => Exit::Ok,
    }
}

/// Ends the process at Ctrl-C, as the signal itself would, and says that what was followed goes on.
pub(super) async fn detached<T>(
    id: Id,
    work: impl Future<Output = anyhow::Result<T>>,
) -> anyhow::Result<T> {
    tokio::select! {
        done = work => done,
        _ = tokio::signal::ctrl_c() => {
            eprintln!("\n{id} goes on; `signorini watch {id}` follows it again, `signorini cancel {id}` ends it");
            std::process::exit(130)
        }
    }
}
