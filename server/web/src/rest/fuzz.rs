//! Tests with hostile queries, headers and bodies: they are read or refused with an error, and nothing else happens.
//! See `suite::fuzzing`, also for longer runs.
#![allow(clippy::unwrap_used)]

use axum::http::{HeaderMap, HeaderName, HeaderValue};
use service::{error::ApiError, formats::Format, verbs::lists::ORDER_BY};
use suite::{EXAMPLES, fuzzing::Target, shipped_example};

use super::{
    accept::FormatOf,
    bodies,
    data::{self, PART},
    filters::FILTERS,
    headers::{IF_MATCH, IF_NONE_MATCH, PREFER},
    input::{Input, RawInput},
};

/// The kind of an answer.
fn kind<T>(answer: Result<T, ApiError>, read: impl FnOnce(T) -> String) -> String {
    match answer {
        Ok(value) => format!("read {}", read(value)),
        Err(ApiError::InvalidProblem(found)) => {
            assert!(found.len() <= 100 && !found.is_empty());
            let first = &found[0];
            format!("{} {}", first.reason, first.pointer.matches('/').count())
        }
        Err(error) => {
            let text = error.to_string();
            assert!(!text.is_empty());
            let words = text.split([':', '"', '`']).next().unwrap();
            let words: String = words
                .chars()
                .filter(|c| !c.is_ascii_digit())
                .take(12)
                .collect();
            format!("{:?} {words}", error.code())
        }
    }
}

#[test]
fn changed_filters_are_read_or_refused() {
    let seeds = [
        "status=queued&status=running,failed&name=a",
        "label.team=contact&label.run=7&order_by=created_at%20desc",
        "created_after=2026-01-31T12:00:00Z&created_before=2026-02-01T00:00:00%2B01:00",
        "finished_after=2026-01-31T12:00:00.123456Z&owner=local&input_hash=sha256:00",
    ];
    let words = [
        "&",
        "=",
        "%",
        "%00",
        "%ff",
        "label.",
        "status=",
        ",",
        "created_after=",
        "-0001",
        "+99:99",
        "9999-12-31T23:59:60Z",
        "order_by=",
        "finished_at",
        " asc",
    ];
    let target = Target {
        name: "filters",
        seeds: seeds.map(|seed| seed.as_bytes().to_vec()).into(),
        words: &words,
        cases: 20_000,
    };
    let figures = target.attack(|input| {
        let (query, headers) = (String::from_utf8_lossy(input), HeaderMap::new());
        let raw = RawInput::new(vec![], Some(&query), &headers);
        let known = [FILTERS.descriptions(), ORDER_BY.descriptions()].concat();
        let read = raw.check(&known).and_then(|()| FILTERS.extract(&raw));
        let read = read.and_then(|filter| Ok((filter, ORDER_BY.extract(&raw)?)));
        kind(read, |(filter, order)| {
            let parts = [
                filter.owner.is_some(),
                filter.name.is_some(),
                order.is_some(),
            ];
            format!(
                "{} {} {parts:?}",
                filter.statuses.len().min(4),
                filter.labels.len().min(4)
            )
        })
    });
    assert!(figures.answers > 10, "{figures:?}");
}

#[test]
fn changed_headers_are_read_or_ignored() {
    let seeds = [
        "range: bytes=0-99\nif-range: \"7\"",
        "range: bytes=-5",
        "accept: application/json;q=0.5, text/csv, */*;q=0.1",
        "prefer: respond-async, wait=10",
        "if-none-match: W/\"7\", \"8\"\nif-match: *",
    ];
    let words = [
        "bytes=",
        "-",
        ",",
        ";q=",
        "q=nan",
        "*/*",
        "W/",
        "\"",
        "wait=",
        "range: ",
        "accept: ",
        "prefer: ",
        "if-match: ",
        "if-none-match: ",
        "if-range: ",
        "application/",
    ];
    let target = Target {
        name: "headers",
        seeds: seeds.map(|seed| seed.as_bytes().to_vec()).into(),
        words: &words,
        cases: 20_000,
    };
    let figures = target.attack(|input| {
        let mut headers = HeaderMap::new();
        for line in input.split(|byte| *byte == b'\n').take(100) {
            let Some(colon) = line.iter().position(|byte| *byte == b':') else {
                continue;
            };
            let name = HeaderName::from_bytes(&line[..colon]);
            let value = HeaderValue::from_bytes(line[colon + 1..].trim_ascii());
            if let (Ok(name), Ok(value)) = (name, value) {
                headers.append(name, value);
            }
        }
        let raw = RawInput::new(vec![], None, &headers);
        let format = FormatOf(Format::OF_TABLES).extract(&raw);
        let part = PART.extract(&raw).unwrap();
        let whole = data::whole(&part, Format::Json, "a".into(), b"0123456789".to_vec());
        let tags = |condition: &super::headers::Condition| {
            let tags = condition.extract(&raw).unwrap()?;
            Some((
                tags.contain("\"7\""),
                tags.version().is_some(),
                tags.versions().map(|v| v.len().min(3)),
            ))
        };
        let wait = PREFER.extract(&raw).unwrap();
        assert!(wait.is_none_or(|wait| wait <= 60));
        format!(
            "{} {} {:?} {:?} {}",
            kind(format, |format| format.name().to_owned()),
            kind(whole, |whole| whole.status().to_string()),
            tags(&IF_MATCH),
            tags(&IF_NONE_MATCH),
            wait.is_some(),
        )
    });
    assert!(figures.answers > 20, "{figures:?}");
}

#[test]
fn changed_bodies_are_read_or_refused() {
    let text = shipped_example(EXAMPLES[0]);
    let seeds = [
        format!(
            "{{\"problem\": {text}, \"name\": \"a\", \"labels\": {{\"a\": \"b\"}}, \"priority\": 1}}"
        ),
        format!(
            "{{\"jobs\": [{{\"problem\": {text}, \"limits\": {{\"timeout_s\": 1}}, \"cache\": \"off\"}}]}}"
        ),
        "{\"name\": null, \"labels\": null, \"pinned\": true}".to_owned(),
        "{\"limits\": {\"timeout_s\": 1, \"queue_ttl_s\": 1e9}, \"priority\": -10}".to_owned(),
    ];
    let words = [
        "{",
        "}",
        "[",
        "[[[[[[[[[[[[[[[[",
        "null",
        "\"jobs\":",
        "\"problem\":",
        "\"labels\":",
        "\"limits\":",
        "\"cache\":\"refresh\"",
        "\"priority\":",
        "\"pinned\":",
        "\"\\ud800\"",
        "\"name\":\"\\u0000\"",
        ",",
    ];
    let target = Target {
        name: "bodies",
        seeds: seeds.map(String::into_bytes).into(),
        words: &words,
        cases: 10_000,
    };
    let figures = target.attack(|input| {
        let text = String::from_utf8_lossy(input);
        let found = |read: Result<_, _>| read.map_err(ApiError::InvalidProblem);
        [
            kind(
                bodies::submission(&text).and_then(|job| found(job.problem)),
                |_| String::new(),
            ),
            kind(bodies::batch(&text), |jobs| jobs.len().min(3).to_string()),
            kind(bodies::bare_problem(&text).and_then(found), |_| {
                String::new()
            }),
            kind(bodies::edit(&text), |edit| format!("{:?}", edit.pinned)),
            kind(bodies::retry(&text), |changes| {
                changes.timeout_s.is_some().to_string()
            }),
        ]
        .join("; ")
    });
    assert!(figures.answers > 20, "{figures:?}");
}
