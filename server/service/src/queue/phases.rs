//! Reports an attempt that has ended: metrics of how long its solver was in each phase, and its spans.

use base::{job::Job, metrics::METRICS, time::Time, trace::Trace};
use opentelemetry::KeyValue;
use solver::solution::Phase;
use store::Ending;

use crate::spans::{self, Span};

/// The largest number of phases that become spans; problems of many load steps have thousands.
const MOST: usize = 200;

/// The phases of one attempt, in order.
#[derive(Debug, Default)]
pub(super) struct Phases {
    current: Option<(Phase, Time)>,
    done: Vec<(Phase, Time, Time)>,
}

impl Phases {
    /// Records that `phase` begins, and that the previous phase ends.
    pub(super) fn enter(&mut self, phase: Phase, now: Time) {
        self.end(now);
        self.current = Some((phase, now));
    }

    /// Records that the solver has ended.
    pub(super) fn end(&mut self, now: Time) {
        let Some((phase, begun)) = self.current.take() else {
            return;
        };
        let seconds = (now.micros() - begun.micros()) as f64 / 1e6;
        METRICS.phase(phase.as_str(), seconds);
        if self.done.len() < MOST {
            self.done.push((phase, begun, now));
        }
    }

    /// Sends the spans of an attempt: the job, inside it the time in the queue and the run, and inside the run the
    /// phases. `origin` is the request that submitted the job, if this process answered it.
    pub(super) fn tell_spans(&self, job: &Job, origin: Option<&Trace>, ending: Option<&Ending>) {
        if !spans::are_wanted() {
            return;
        }
        let whole = origin.map_or_else(Trace::new, Trace::part);
        let begun = job.started_at.unwrap_or(job.created_at);
        let ended = Time::now();
        let span = |trace: Trace, name: &'static str, begun, ended| Span {
            trace,
            name: name.into(),
            answers: false,
            begun,
            ended,
            attributes: vec![KeyValue::new("job.id", job.id.to_string())],
            error: None,
        };
        span(whole.part(), "queued", job.created_at, begun).tell();
        let run = whole.part();
        for (phase, begun, ended) in &self.done {
            span(run.part(), phase.as_str(), *begun, *ended).tell();
        }
        span(run, "run", begun, ended).tell();
        let mut all = span(whole, "job", job.created_at, ended);
        let status = ending.map_or("requeued", |ending| ending.status.into());
        all.attributes.extend([
            KeyValue::new("job.status", status),
            KeyValue::new("job.attempt", i64::from(job.attempt)),
            KeyValue::new("enduser.id", job.owner.clone()),
        ]);
        if let Some(reason) = ending.and_then(|ending| ending.reason) {
            let reason: &'static str = reason.into();
            all.attributes.push(KeyValue::new("job.reason", reason));
            all.error = (status == "failed").then(|| reason.to_owned());
        }
        all.tell();
    }
}
