//! Sends spans of requests and jobs to a collector by OTLP. Nothing waits for the collector: spans that it does not
//! receive in time are dropped and counted.
//!
//! Spans are reported when they have ended, with their times, so that the SDK's layer that follows the code is not
//! needed. The SDK's queue is not used either, since it does not say how many spans it has dropped. The SDK converts
//! and transports the spans.

use std::{
    borrow::Cow,
    sync::{Arc, OnceLock},
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use base::{metrics::METRICS, time::Time, trace::Trace};
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

/// The largest number of spans that wait; each has some 500 bytes.
const MOST_WAITING: usize = 4096;
/// The largest number of spans in one message.
const MOST_TOGETHER: usize = 512;
/// How long the first span of a message waits for further ones.
const LINGER: Duration = Duration::from_millis(200);
/// How long the collector may take to accept a message.
const PATIENCE: Duration = Duration::from_secs(5);
/// How long the service waits for the collector to accept the last spans when it stops.
const FAREWELL: Duration = Duration::from_secs(1);

/// The queue of spans that have ended; empty if no collector is configured.
static WAITING: OnceLock<mpsc::Sender<SpanData>> = OnceLock::new();

/// A piece of work that has ended, with its times and attributes.
#[derive(Debug)]
pub struct Span {
    /// The place of the span in a trace.
    pub trace: Trace,
    /// The kind of work: one of a few names.
    pub name: Cow<'static, str>,
    /// Whether the work is answering a request rather than internal.
    pub answers: bool,
    /// The time when the work began.
    pub begun: Time,
    /// The time when the work ended.
    pub ended: Time,
    /// Further attributes of the span.
    pub attributes: Vec<KeyValue>,
    /// Why the work of the span failed; absent if it succeeded.
    pub error: Option<String>,
}

/// Whether a collector is configured, so that spans are sent.
pub fn are_wanted() -> bool {
    WAITING.get().is_some()
}

impl Span {
    /// Reports the span, unless its trace is not recorded.
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
            span_kind: if self.answers {
                SpanKind::Server
            } else {
                SpanKind::Internal
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

/// Starts sending spans to the collector at this address. The error means that the address cannot be used; whether the
/// collector answers is not known yet.
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
    /// Sends the remaining spans, if the collector receives them soon.
    pub async fn stop(self) {
        self.stopping.cancel();
        if timeout(FAREWELL, self.task).await.is_err() {
            warn!("the collector did not receive the last spans in time");
        }
    }
}

/// Sends spans until `stopping` is canceled, and then the spans that still wait.
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
                warn!("spans are dropped, because the collector does not receive them: {failure}");
            }
            (false, None) => info!("the collector receives spans again"),
            _ => {}
        }
        works = failure.is_none();
    }
}
