//! `/`: a page for a person who opens the address of the service in a browser: the last jobs with their verdicts and
//! figures, and where to go on. It has no script, and refers to other resources by relative addresses, so that it works
//! behind any path prefix that ends with a slash.

use std::fmt::Write;

use axum::{http::header, response::IntoResponse};
use base::job::Job;
use service::{
    error::ApiError,
    verbs::{lists, page::Paging},
};
use store::Filter;

use super::call::Call;

/// The number of jobs on the page.
const SHOWN: i64 = 12;

const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:70rem;padding:0 1rem;\
color-scheme:light dark}ul{list-style:none;padding:0;display:grid;gap:1.5rem;\
grid-template-columns:repeat(auto-fill,minmax(20rem,1fr))}img{width:100%;background:#fff}small{opacity:.75}";

pub(super) async fn page(call: Call) -> Result<impl IntoResponse, ApiError> {
    let first = Paging {
        size: Some(SHOWN),
        token: None,
    };
    let filter = Filter::default();
    let jobs = lists::list(&call.service, &call.caller, &filter, None, &first).await?;
    let headers = [
        (header::CONTENT_TYPE, "text/html; charset=utf-8"),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::CACHE_CONTROL, "no-cache"),
        (
            header::CONTENT_SECURITY_POLICY,
            "default-src 'none'; style-src 'unsafe-inline'; img-src 'self'; base-uri 'none'; form-action 'none'; \
             frame-ancestors 'none'",
        ),
    ];
    Ok((headers, html(&jobs.items)))
}

fn html(jobs: &[Job]) -> String {
    let mut page = format!(
        "<!doctype html><html lang=en><meta charset=utf-8><meta name=viewport content=\"width=device-width\">\
         <title>Signorini</title><style>{STYLE}</style><h1>Signorini</h1>\
         <p>This service solves frictional contact problems by finite elements. \
         <a href=docs>Try requests</a> &middot; <a href=v1/queue>queue</a> &middot; <a href=v1/info>version and limits</a> \
         &middot; <a href=v1/schema/problem.json>fields of a problem</a> &middot; <a href=openapi.json>OpenAPI</a> \
         &middot; <a href=proto/signorini.proto>gRPC</a></p><h2>The last jobs</h2>"
    );
    if jobs.is_empty() {
        page.push_str(
            "<p>There are none yet. Submit one: <code>signorini submit problem.json --watch</code></p>",
        );
    }
    page.push_str("<ul>");
    for job in jobs {
        let id = job.id;
        let name = escaped(job.name.as_deref().unwrap_or("without a name"));
        let status: &str = job.status.into();
        let verdict = job.verdict.map_or(String::new(), |verdict| {
            format!(", {}", <&str>::from(verdict))
        });
        let _ = write!(
            page,
            "<li><a href=v1/jobs/{id}>{name}</a>: {status}{verdict}<br><small>{} &middot; {}</small>",
            escaped(&job.owner),
            job.created_at
        );
        // of a job without a solution it would need to be asked for
        if job.links.contains_key("plot_profile") && !job.status.is_without_solution() {
            let _ = write!(
                page,
                "<a href=v1/jobs/{id}/plots/profile.svg><img loading=lazy alt=\"stresses along the contact of {name}\" \
                 src=\"v1/jobs/{id}/plots/profile.svg?size=column\"></a>"
            );
        }
        page.push_str("</li>");
    }
    page.push_str("</ul></html>\n");
    page
}

/// The text without characters that HTML gives a meaning.
fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            other => safe.push(other),
        }
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_text_whatever_their_characters() {
        let job = Job {
            name: Some("<script>&\"".to_owned()),
            ..Job::default()
        };
        let page = html(&[job]);
        assert!(
            page.contains(">&lt;script&gt;&amp;&quot;</a>: queued<br>"),
            "{page}"
        );
        assert!(!page.contains("<script"), "{page}");
    }
}
