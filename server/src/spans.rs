//! Spans of requests and jobs, sent to a collector by OTLP. Nothing waits for it: what it does not take in time is dropped,
//! and counted.
//!
//! Spans are told when they have ended, with their times, so that the layer of the SDK that follows the code is not needed;
//! nor is its queue, which does not tell how many spans it has dropped. Conversion and transport are those of its authors.

use std::{
    borrow::Cow,
    sync::{Arc, OnceLock},
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use opentelemetry::{
    InstrumentationScope, KeyValue,
    trace::{SpanKind, Status},
};
use opentelemetry_otlp::{ExporterBuildError, SpanExporter as Otlp, WithExportConfig};
use opentelemetry_sdk::{
    Resource,
    trace::{SpanData, SpanEvents, SpanExporter, SpanLinks},
};
use tokio::{sync::mpsc, task::JoinHandle, time::timeout};
use tokio_util::sync::CancellationToken;
use tracing::{info, warn};

use crate::{metrics::METRICS, time::Time, trace::Trace};

/// Spans that wait; one has some 500 bytes.
const MOST_WAITING: usize = 4096;
/// Spans of one message.
const MOST_TOGETHER: usize = 512;
/// How long spans wait for others.
const LINGER: Duration = Duration::from_millis(200);
/// How long the collector may take for a message.
const PATIENCE: Duration = Duration::from_secs(5);
/// How long the service waits for it when it stops.
const FAREWELL: Duration = Duration::from_secs(1);

/// Spans that have ended go here; empty if no collector is named.
static WAITING: OnceLock<mpsc::Sender<SpanData>> = OnceLock::new();

/// Work that has ended.
#[derive(Debug)]
pub struct Span {
    /// Its place in a trace.
    pub trace: Trace,
    /// What was done: one of a few names.
    pub name: Cow<'static, str>,
    /// Whether it answers a request, or is within the service.
    pub answers: bool,
    /// When it began.
    pub begun: Time,
    /// When it ended.
    pub ended: Time,
    /// What else is known of it.
    pub attributes: Vec<KeyValue>,
    /// Why it has failed.
    pub error: Option<String>,
}

/// Whether spans are wanted.
pub fn are_wanted() -> bool {
    WAITING.get().is_some()
}

impl Span {
    /// Tells it, unless its trace is not to be recorded.
    pub fn tell(self) {
        let Some(waiting) = WAITING.get() else { return };
        let Trace { own, parent } = self.trace;
        if !own.is_sampled() {
            return;
        }
        let data = SpanData {
            span_context: own,
            parent_span_id: parent.span_id(),
            parent_span_is_remote: parent.is_remote(),
            span_kind: match self.answers {
                true => SpanKind::Server,
                false => SpanKind::Internal,
            },
            name: self.name,
            start_time: system_time(self.begun),
            end_time: system_time(self.ended),
            attributes: self.attributes,
            dropped_attributes_count: 0,
            events: SpanEvents::default(),
            links: SpanLinks::default(),
            status: match self.error {
                Some(error) => Status::error(error),
                None => Status::Unset,
            },
            instrumentation_scope: InstrumentationScope::builder("signorini").build(),
        };
        if waiting.try_send(data).is_err() {
            METRICS.spans_dropped.inc();
        }
    }
}

fn system_time(time: Time) -> SystemTime {
    UNIX_EPOCH + Duration::from_micros(time.micros().try_into().unwrap_or_default())
}

/// The task that sends spans.
#[derive(Debug)]
pub struct Exporting {
    stopping: CancellationToken,
    task: JoinHandle<()>,
}

/// Sends spans to the collector at this address from now on. An error means that the address cannot be used; whether the
/// collector answers is seen later.
pub fn start(endpoint: &str) -> Result<Exporting, ExporterBuildError> {
    let otlp = Otlp::builder().with_tonic().with_endpoint(endpoint);
    let mut otlp = otlp.with_timeout(PATIENCE).build()?;
    let resource = Resource::builder();
    let resource = match std::env::var_os("OTEL_SERVICE_NAME") {
        Some(name) if !name.is_empty() => resource, // which it reads
        _ => resource.with_service_name("signorini"),
    };
    let version = KeyValue::new("service.version", env!("CARGO_PKG_VERSION"));
    otlp.set_resource(&resource.with_attribute(version).build());
    let (sender, waiting) = mpsc::channel(MOST_WAITING);
    let stopping = CancellationToken::new();
    let task = tokio::spawn(send(waiting, Arc::new(otlp), stopping.clone()));
    // there is one service in a process, but in tests; the first one's collector stays
    let _ = WAITING.set(sender);
    Ok(Exporting { stopping, task })
}

impl Exporting {
    /// Sends what waits, if the collector takes it soon.
    pub async fn stop(self) {
        self.stopping.cancel();
        if timeout(FAREWELL, self.task).await.is_err() {
            warn!("the collector of spans did not take the last ones in time");
        }
    }
}

/// Sends spans until the service stops, and then those that still wait.
async fn send(
    mut waiting: mpsc::Receiver<SpanData>,
    otlp: Arc<impl SpanExporter>,
    stopping: CancellationToken,
) {
    let (mut works, mut batch) = (true, Vec::with_capacity(MOST_TOGETHER));
    loop {
        tokio::select! {
            biased;
            received = waiting.recv_many(&mut batch, MOST_TOGETHER) => if received == 0 { return },
            () = stopping.cancelled() => return,
        }
        tokio::select! {
            () = tokio::time::sleep(LINGER) => {}
            () = stopping.cancelled() => {}
        }
        while batch.len() < MOST_TOGETHER
            && let Ok(span) = waiting.try_recv()
        {
            batch.push(span);
        }
        let count = batch.len() as u64;
        let sent = timeout(PATIENCE, otlp.export(std::mem::take(&mut batch))).await;
        let failure = match sent {
            Ok(Ok(())) => None,
            Ok(Err(error)) => Some(error.to_string()),
            Err(_) => Some(format!("no answer within {} s", PATIENCE.as_secs())),
        };
        match &failure {
            None => METRICS.spans_exported.inc_by(count),
            Some(_) => METRICS.spans_dropped.inc_by(count),
        };
        // told once, and not with each message
        match (works, &failure) {
            (true, Some(failure)) => {
                warn!("the collector of spans does not take them, and they are dropped: {failure}");
            }
            (false, None) => info!("the collector of spans takes them again"),
            _ => {}
        }
        works = failure.is_none();
    }
}
