//! The trace of a request by W3C Trace Context: the trace of its `traceparent` header, or a new one.

use std::collections::HashMap;

use axum::http::HeaderMap;
use opentelemetry::{
    Context,
    propagation::TextMapPropagator,
    trace::{SpanContext, SpanId, TraceContextExt, TraceFlags, TraceId, TraceState},
};
use opentelemetry_sdk::{
    propagation::TraceContextPropagator,
    trace::{IdGenerator, RandomIdGenerator},
};

/// The name of the header with the trace context.
const HEADER: &str = "traceparent";
/// The largest length of the header that is read (bytes).
const LONGEST: usize = 128;

/// A piece of work in a trace, and the work that it is part of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Trace {
    /// The ids of this work, and whether it is recorded.
    pub own: SpanContext,
    /// The ids of the work that this work is part of.
    pub parent: SpanContext,
}

impl Trace {
    /// A new trace.
    pub fn new() -> Trace {
        let trace = RandomIdGenerator::default().new_trace_id();
        Trace::within(SpanContext::NONE, trace, TraceFlags::SAMPLED)
    }

    /// The trace of a request. `tracestate` is ignored: it is for services that call others, and this service calls
    /// none.
    pub fn of_request(headers: &HeaderMap) -> Trace {
        let mut sent = headers.get_all(HEADER).iter();
        let (first, more) = (sent.next(), sent.next().is_some());
        let text = first.and_then(|value| value.to_str().ok());
        match text.filter(|text| !more && text.len() <= LONGEST) {
            Some(text) => {
                let carrier = HashMap::from([(HEADER.to_owned(), text.to_owned())]);
                let found =
                    TraceContextPropagator::new().extract_with_context(&Context::new(), &carrier);
                let parent = found.span().span_context().clone();
                if parent.is_valid() {
                    Trace::part_of(&parent)
                } else {
                    Trace::new()
                }
            }
            None => Trace::new(),
        }
    }

    /// The trace context of a new part of this piece of work.
    pub fn part(&self) -> Trace {
        Trace::part_of(&self.own)
    }

    /// The id of the trace.
    pub fn id(&self) -> TraceId {
        self.own.trace_id()
    }

    fn part_of(parent: &SpanContext) -> Trace {
        Trace::within(parent.clone(), parent.trace_id(), parent.trace_flags())
    }

    fn within(parent: SpanContext, trace: TraceId, flags: TraceFlags) -> Trace {
        let span: SpanId = RandomIdGenerator::default().new_span_id();
        let own = SpanContext::new(trace, span, flags, false, TraceState::NONE);
        Trace { own, parent }
    }
}

impl Default for Trace {
    fn default() -> Self {
        Trace::new()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn sent(values: &[&str]) -> Trace {
        let mut headers = HeaderMap::new();
        for value in values {
            headers.append(HEADER, value.parse().unwrap());
        }
        Trace::of_request(&headers)
    }

    #[test]
    fn a_request_belongs_to_the_trace_of_its_traceparent() {
        let text = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01";
        let trace = sent(&[text]);
        assert_eq!(trace.id().to_string(), "4bf92f3577b34da6a3ce929d0e0e4736");
        assert_eq!(trace.parent.span_id().to_string(), "00f067aa0ba902b7");
        assert!(trace.parent.is_remote() && trace.own.is_sampled());
        assert!(!sent(&[&text.replace("-01", "-00")]).own.is_sampled());
        let part = trace.part();
        assert_eq!(
            (part.id(), part.parent.span_id()),
            (trace.id(), trace.own.span_id())
        );
    }

    #[test]
    fn an_invalid_traceparent_begins_a_new_trace() {
        let text = "00-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01";
        for wrong in [
            &[][..],
            &[text, text],
            &[""],
            &["00-00000000000000000000000000000000-00f067aa0ba902b7-01"],
            &["00-4bf92f3577b34da6a3ce929d0e0e4736-0000000000000000-01"],
            &["ff-4bf92f3577b34da6a3ce929d0e0e4736-00f067aa0ba902b7-01"],
            &[&"a-".repeat(30000)],
        ] {
            let trace = sent(wrong);
            assert!(
                trace.own.is_valid() && !trace.parent.is_valid(),
                "{wrong:?}"
            );
            assert_ne!(trace.id().to_string(), "4bf92f3577b34da6a3ce929d0e0e4736");
        }
        assert_ne!(sent(&[]).id(), sent(&[]).id());
    }
}
