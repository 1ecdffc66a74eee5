//! Counters and measurements for `/metrics`, of the process as a whole.
//!
//! Every label has few values: names of routes, rpcs, statuses, reasons and phases. Ids, paths and names of owners,
//! which clients choose, are never labels.

mod process;

use std::{
    borrow::Cow,
    collections::HashMap,
    fmt::{self, Write},
    sync::{LazyLock, atomic::AtomicU64},
    time::Duration,
};

use prometheus_client::{
    encoding::text::{encode_eof, encode_registry},
    metrics::{
        counter::{ConstCounter, Counter},
        family::Family,
        gauge::{ConstGauge, Gauge},
        histogram::Histogram,
        info::Info,
    },
    registry::Registry,
};

/// Names of labels and their values.
type Labels<const N: usize> = [(&'static str, Cow<'static, str>); N];
type Seconds = Counter<f64, AtomicU64>;

/// The histogram bounds for durations of requests and commits.
const SHORT_S: [f64; 8] = [0.001, 0.005, 0.025, 0.1, 0.5, 2.5, 10.0, 60.0];
/// The histogram bounds for durations of jobs.
const LONG_S: [f64; 10] = [
    0.01, 0.1, 1.0, 10.0, 60.0, 300.0, 1800.0, 7200.0, 28800.0, 86400.0,
];

fn short() -> Histogram {
    Histogram::new(SHORT_S)
}

/// The metrics of this process.
pub static METRICS: LazyLock<Metrics> = LazyLock::new(Metrics::new);

/// All counters and gauges that are updated where events happen.
#[derive(Debug)]
pub struct Metrics {
    registry: Registry,
    http_requests: Family<Labels<3>, Counter>,
    http_durations: Family<Labels<2>, Histogram, fn() -> Histogram>,
    grpc_requests: Family<Labels<2>, Counter>,
    grpc_durations: Family<Labels<1>, Histogram, fn() -> Histogram>,
    /// The number of requests that are being answered.
    pub in_progress: Gauge,
    /// The number of bytes of responses.
    pub sent_bytes: Counter,
    /// The number of open connections.
    pub connections: Gauge,
    /// The number of accepted connections.
    pub accepted_connections: Counter,
    /// The number of connections that were closed at once or could only be used for the probes.
    pub refused_connections: Counter,
    /// The number of requests and calls without a valid token.
    pub unauthenticated_requests: Counter,
    jobs_accepted: Family<Labels<1>, Counter>,
    jobs_ended: Family<Labels<2>, Counter>,
    job_wait: Histogram,
    job_run: Histogram,
    phases: Family<Labels<1>, Seconds>,
    commits: Histogram,
    /// The number of spans that a collector has received.
    pub spans_exported: Counter,
    /// The number of spans that were dropped, because the collector did not receive them, or not in time.
    pub spans_dropped: Counter,
    /// The number of lines of the log that were not read in time.
    pub log_lines_lost: Counter,
}

impl Metrics {
    #[rustfmt::skip]
    fn new() -> Metrics {
        let metrics = Metrics {
            registry: Registry::default(),
            http_requests: Family::default(),
            http_durations: Family::new_with_constructor(short),
            grpc_requests: Family::default(),
            grpc_durations: Family::new_with_constructor(short),
            in_progress: Gauge::default(),
            sent_bytes: Counter::default(),
            connections: Gauge::default(),
            accepted_connections: Counter::default(),
            refused_connections: Counter::default(),
            unauthenticated_requests: Counter::default(),
            jobs_accepted: Family::default(),
            jobs_ended: Family::default(),
            job_wait: Histogram::new(LONG_S),
            job_run: Histogram::new(LONG_S),
            phases: Family::default(),
            commits: short(),
            spans_exported: Counter::default(),
            spans_dropped: Counter::default(),
            log_lines_lost: Counter::default(),
        };
        let mut all = Registry::default();
        let build = [("version", env!("CARGO_PKG_VERSION"))];
        all.register("signorini_build", "Version of the running program", Info::new(build));
        all.register("signorini_http_requests", "Answered requests over REST", metrics.http_requests.clone());
        all.register("signorini_http_request_duration_seconds", "Time from the head of a request to the end of its answer, in seconds", metrics.http_durations.clone());
        all.register("signorini_grpc_requests", "Answered calls over gRPC", metrics.grpc_requests.clone());
        all.register("signorini_grpc_request_duration_seconds", "Time from the head of a call to the end of its answer, in seconds", metrics.grpc_durations.clone());
        all.register("signorini_requests_in_progress", "Requests being answered, over REST and gRPC", metrics.in_progress.clone());
        all.register("signorini_sent_bytes", "Bytes of the bodies of answers", metrics.sent_bytes.clone());
        all.register("signorini_connections", "Open connections", metrics.connections.clone());
        all.register("signorini_connections_accepted", "Accepted connections", metrics.accepted_connections.clone());
        all.register("signorini_connections_refused", "Connections closed or limited to probes because all connections were busy", metrics.refused_connections.clone());
        all.register("signorini_requests_unauthenticated", "Requests refused because they had no valid token, over REST and gRPC", metrics.unauthenticated_requests.clone());
        all.register("signorini_jobs_accepted", "Accepted jobs, by the source of their result", metrics.jobs_accepted.clone());
        all.register("signorini_jobs_ended", "Ended jobs, by status and reason", metrics.jobs_ended.clone());
        all.register("signorini_job_wait_seconds", "Time from acceptance of a job to the start of its last attempt, in seconds", metrics.job_wait.clone());
        all.register("signorini_job_run_seconds", "Time from the start of the last attempt of a job to its end, in seconds", metrics.job_run.clone());
        all.register("signorini_solver_phase_seconds", "Time that solvers spent in each phase, in seconds", metrics.phases.clone());
        all.register("signorini_store_commit_duration_seconds", "Time of a commit of the store until it is on the disk, in seconds", metrics.commits.clone());
        all.register("signorini_spans_exported", "Spans that the collector has received", metrics.spans_exported.clone());
        all.register("signorini_spans_dropped", "Spans dropped because the collector did not receive them in time", metrics.spans_dropped.clone());
        all.register("signorini_log_lines_lost", "Lines of the log lost because they were not read in time", metrics.log_lines_lost.clone());
        Metrics { registry: all, ..metrics }
    }

    /// Records the response to a REST request. `route` is a template and `method` one of a few, so that labels have few
    /// values.
    pub fn answered(&self, method: &'static str, route: &str, status: u16, took: Duration) {
        let class = match status {
            100..=199 => "1xx",
            200..=299 => "2xx",
            300..=399 => "3xx",
            400..=499 => "4xx",
            500..=599 => "5xx",
            _ => "none",
        };
        let (method, route) = (Cow::from(method), Cow::from(route.to_owned()));
        let duration = [("method", method.clone()), ("route", route.clone())];
        let labels = [
            ("method", method),
            ("route", route),
            ("status", class.into()),
        ];
        self.http_requests.get_or_create(&labels).inc();
        let durations = self.http_durations.get_or_create(&duration);
        durations.observe(took.as_secs_f64());
    }

    /// Records the response to a gRPC call. `rpc` is one of the contract.
    pub fn answered_call(&self, rpc: &'static str, code: &'static str, took: Duration) {
        let labels = [("rpc", rpc.into()), ("code", code.into())];
        self.grpc_requests.get_or_create(&labels).inc();
        let durations = self.grpc_durations.get_or_create(&[("rpc", rpc.into())]);
        durations.observe(took.as_secs_f64());
    }

    /// Records an accepted job. `result_from` tells whether its result comes from the solver, an earlier result, or a
    /// queued or running job with the same input.
    pub fn job_accepted(&self, result_from: &'static str) {
        let labels = [("result_from", result_from.into())];
        self.jobs_accepted.get_or_create(&labels).inc();
    }

    /// Records that a job has ended, with the times for which it waited and ran, if it ran.
    pub fn job_ended(
        &self,
        status: &'static str,
        reason: Option<&'static str>,
        times_s: Option<(f64, f64)>,
    ) {
        let reason = reason.unwrap_or_default().into();
        let labels = [("status", status.into()), ("reason", reason)];
        self.jobs_ended.get_or_create(&labels).inc();
        if let Some((wait_s, run_s)) = times_s {
            self.job_wait.observe(wait_s);
            self.job_run.observe(run_s);
        }
    }

    /// Records that a solver was in a phase for this time.
    pub fn phase(&self, phase: &'static str, seconds: f64) {
        let labels = [("phase", phase.into())];
        self.phases.get_or_create(&labels).inc_by(seconds.max(0.0));
    }

    /// Records a commit of the store.
    pub fn committed(&self, took: Duration) {
        self.commits.observe(took.as_secs_f64());
    }

    /// All metrics with the present figures, in the text format of OpenMetrics. This reads files of /proc, and may
    /// block.
    pub fn text(&self, now: Snapshot) -> Result<String, fmt::Error> {
        let mut text = String::new();
        encode_registry(&mut text, &self.registry)?;
        let mut of_now = now.0;
        process::register(&mut of_now);
        encode_registry(&mut text, &of_now)?;
        encode_eof(&mut text)?;
        Ok(text)
    }
}

/// Metrics in the older text format of Prometheus (0.0.4), made from their OpenMetrics text. The names of families differ
/// in one point: the older format has the suffix `_total` in the name of a counter's family, and `_info` in that of an info.
pub fn in_older_format(openmetrics: &str) -> String {
    let mut text = String::with_capacity(openmetrics.len());
    // the type of a family follows its description, which has to have the same name
    let kinds = openmetrics
        .lines()
        .filter_map(|line| line.strip_prefix("# TYPE "))
        .filter_map(|line| line.split_once(' '));
    let kinds: HashMap<&str, &str> = kinds.collect();
    for line in openmetrics.lines() {
        let Some(comment) = line.strip_prefix("# ") else {
            text.push_str(line);
            text.push('\n');
            continue;
        };
        let mut words = comment.splitn(3, ' ');
        let (Some(keyword @ ("HELP" | "TYPE")), Some(name), Some(rest)) =
            (words.next(), words.next(), words.next())
        else {
            continue; // a unit, or the end
        };
        let suffix = match kinds.get(name) {
            Some(&"counter") => "_total",
            Some(&"info") => "_info",
            _ => "",
        };
        let rest = if rest == "info" { "gauge" } else { rest };
        let _ = writeln!(text, "# {keyword} {name}{suffix} {rest}");
    }
    text
}

/// Metrics that other parts of the service measure at the moment of a request for them.
#[derive(Debug, Default)]
pub struct Snapshot(Registry);

impl Snapshot {
    /// Adds a figure that goes up and down.
    pub fn gauge(&mut self, name: &str, help: &str, value: f64) {
        self.0.register(name, help, ConstGauge::new(value));
    }

    /// Adds a figure for each value of a label.
    pub fn gauges<const N: usize>(
        &mut self,
        name: &str,
        help: &str,
        label: &'static str,
        values: [(&'static str, f64); N],
    ) {
        let family = Family::<Labels<1>, Gauge<f64, AtomicU64>>::default();
        for (value, figure) in values {
            family.get_or_create(&[(label, value.into())]).set(figure);
        }
        self.0.register(name, help, family);
    }

    /// Adds a figure that only goes up; `_total` is added to its name.
    pub fn counter(&mut self, name: &str, help: &str, value: u64) {
        self.0.register(name, help, ConstCounter::new(value));
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_text_has_each_name_once_and_ends() {
        let metrics = Metrics::new();
        metrics.answered("GET", "/v1/jobs/{id}", 200, Duration::from_millis(2));
        metrics.answered_call("GetJob", "OK", Duration::from_millis(2));
        metrics.job_ended("failed", Some("timed_out"), Some((1.0, 2.0)));
        metrics.job_ended("canceled", None, None);
        metrics.phase("factor", 1.5);
        let mut now = Snapshot::default();
        now.gauges(
            "signorini_jobs",
            "Jobs",
            "status",
            [("queued", 1.0), ("running", 2.0)],
        );
        now.counter("signorini_hits", "Hits", 3);
        let text = metrics.text(now).unwrap();
        for line in [
            "signorini_http_requests_total{method=\"GET\",route=\"/v1/jobs/{id}\",status=\"2xx\"} 1\n",
            "signorini_jobs_ended_total{status=\"failed\",reason=\"timed_out\"} 1\n",
            "signorini_job_run_seconds_count 1\n",
            "signorini_solver_phase_seconds_total{phase=\"factor\"} 1.5\n",
            "signorini_jobs{status=\"running\"} 2.0\n",
            "signorini_hits_total 3\n",
        ] {
            assert!(text.contains(line), "{line}{text}");
        }
        assert!(text.ends_with("# EOF\n"));
        let older = in_older_format(&text);
        for line in [
            "# TYPE signorini_hits_total counter\n",
            "# HELP signorini_hits_total Hits.\n",
            "signorini_hits_total 3\n",
            "# TYPE signorini_jobs gauge\n",
            "# TYPE signorini_job_run_seconds histogram\n",
            "# TYPE signorini_build_info gauge\n",
        ] {
            assert!(older.contains(line), "{line}{older}");
        }
        assert!(!older.contains("# EOF") && !older.contains("# UNIT"));
        let mut names: Vec<&str> = text
            .lines()
            .filter(|line| line.starts_with("# TYPE"))
            .collect();
        let all = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), all);
    }
}
