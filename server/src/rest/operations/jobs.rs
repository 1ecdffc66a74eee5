//! Jobs: hand in, look, list, wait, watch, edit, cancel, delete.

use super::{
    Operation, Parameter, delete, get, patch, post, put,
    shapes::{
        header, json, labels, like, lines, matching, nothing, number, query, several, stream,
        submission, text, the_problem, time, whole, word,
    },
};
use crate::{
    catalog::Code,
    event::Event,
    job::{Job, Status},
    rest::{
        bodies::{Edits, Retry, Submission, Submissions},
        events, jobs, submit,
    },
    verbs::{
        jobs::{Count, MAX_PAGE_SIZE, Many},
        watch::MAX_WAIT_S,
    },
};

pub(super) fn operations() -> Vec<Operation> {
    vec![
        post("/v1/jobs", submit::create)
            .rpcs(&["CreateJob", "SubmitAndWatch"])
            .says("Hands in a job; the answer is sent after the job is durable on disk")
            .takes(json::<Submission>())
            .for_example(submission())
            .hands_in()
            .tested(&[
                "service::submit::a_submitted_job_is_accepted_with_its_address_and_version",
                "service::submit::who_prefers_to_wait_gets_the_terminal_job",
                "service::submit::everything_wrong_with_a_job_is_said_at_once", "service::keys::a_key_answers_with_the_same_job_as_it_is_now", "service::keys::many_clients_with_the_same_key_at_once_make_one_job", "service::cache::the_same_input_is_answered_from_the_first_result", "service::waiting::a_job_is_handed_in_and_followed_in_one_request"]),
        put("/v1/jobs/{id}", submit::put)
            .rpcs(&["CreateJob"])
            .named("PutJob")
            .says("Hands in a job under a name that the client made; the same once more changes nothing")
            .takes(json::<Submission>())
            .for_example(submission())
            .answers(200, "The job of that name, handed in before with the same content", json::<Job>())
            .headed([location(), etag()])
            .maybe(replayed())
            .hands_in()
            .fails(&[Code::IdConflict])
            .tested(&["service::keys::a_job_may_have_a_name_of_the_clients_own"]),
        post("/v1/jobs/batch", submit::create_batch)
            .rpcs(&["BatchCreateJobs"])
            .says("Hands in up to 1000 jobs, all or none of them")
            .with([key()])
            .takes(json::<Submissions>())
            .answers(202, "The accepted jobs, in their order", json::<submit::Batch>())
            .headed([retry_after()])
            .maybe(replayed())
            .fails(SUBMITTING)
            .tested(&["service::keys::a_batch_is_accepted_whole_or_not_at_all"]),
        get("/v1/jobs", jobs::list)
            .rpcs(&["ListJobs"])
            .says("Lists jobs, newest first")
            .with(filters())
            .with(pages())
            .with([query(
                "order_by",
                word(&["created_at", "created_at desc", "created_at asc", "finished_at", "finished_at desc", "finished_at asc"]),
                "Which time leads, and which way; by finished_at only jobs that have ended",
            )])
            .answers(200, "A page of jobs", json::<jobs::List>())
            .fails(&[Code::BadPageToken])
            .tested(&[
                "service::list::pages_hold_every_job_once_newest_first",
                "service::list::jobs_are_found_by_status_and_know_their_place", "service::filters::every_filter_finds_its_jobs_alone_and_with_others", "service::filters::lists_go_by_the_time_that_is_asked_for_in_both_directions"]),
        get("/v1/jobs/count", jobs::count)
            .rpcs(&["CountJobs"])
            .says("Counts jobs")
            .with(filters())
            .with([query("group_by", word(&["status", "owner"]), "Counts each of these on its own, too")])
            .answers(200, "How many", json::<Count>())
            .tested(&["service::filters::every_filter_finds_its_jobs_alone_and_with_others"]),
        get("/v1/jobs/{id}", jobs::get)
            .rpcs(&["GetJob", "WaitJob"])
            .says("Tells of a job as it is now, or when it has changed or ended")
            .with([
                query("wait", number(0.0, MAX_WAIT_S), "Seconds to wait until the version differs from If-None-Match, else from now"),
                query("until", word(&["terminal"]), "Wait until the job has ended"),
                header("If-None-Match", text(), "The ETag that is known: 304 while it holds"),
            ])
            .answers(200, "The job", json::<Job>())
            .headed([etag()])
            .answers(304, "The version is the known one", nothing())
            .headed([etag()])
            .tested(&["service::waiting::a_client_that_has_the_job_already_is_told_so", "service::waiting::a_long_poll_returns_with_the_next_version_or_at_its_limit"]),
        get("/v1/jobs/{id}/problem", jobs::problem)
            .rpcs(&["GetJobProblem"])
            .says("The exact input of a job, with its defaults filled in")
            .answers(200, "The problem", the_problem())
            .tested(&["service::same_errors::what_both_protocols_answer_about_the_service_is_the_same"]),
        get("/v1/jobs/{id}/events", events::watch)
            .rpcs(&["WatchJob"])
            .says("Tells what happened to a job, then what happens, until `done`")
            .with([
                query("after_seq", whole(0..=i64::MAX), "Number of the last event that was seen"),
                header("Last-Event-ID", whole(0..=i64::MAX), "The same; it wins"),
            ])
            .answers(200, "The events, each with its number; a comment every 15 s", [stream::<Event>(), lines()].concat())
            .answers(204, "Nothing lies after that event of a job that has ended", nothing())
            .fails(&[Code::NotAcceptable])
            .tested(&[
                "service::watch::the_story_of_a_job_is_told_in_order_and_can_be_told_again",
                "service::watch::a_client_that_reconnects_after_each_event_gets_every_event_exactly_once", "service::waiting::events_come_as_lines_to_who_prefers_lines"]),
        patch("/v1/jobs/{id}", jobs::update)
            .rpcs(&["UpdateJob"])
            .says("Changes name, labels, priority of a job, or whether it is kept for ever")
            .with([header("If-Match", text(), "The ETag of the job that the change is meant for")])
            .takes(json::<Edits>())
            .answers(200, "The changed job", json::<Job>())
            .headed([etag()])
            .fails(&[Code::InvalidProblem, Code::StaleVersion, Code::StorageFull])
            .tested(&["service::control::name_labels_priority_and_pin_are_changed_if_the_version_is_the_one_that_was_seen"]),
        post("/v1/jobs/{id}/cancel", jobs::cancel)
            .rpcs(&["CancelJob"])
            .says("Asks a job to stop; it is terminal within half a second")
            .answers(200, "What that did, and the job", json::<jobs::Canceled>())
            .headed([etag()])
            .fails(&[Code::StorageFull])
            .tested(&[
                "service::cancel::a_queued_job_is_canceled_at_once_and_never_runs",
                "service::cancel::a_running_large_job_is_canceled_within_half_a_second_in_any_phase",
                "service::cancel::a_finished_job_is_not_touched",
            ]),
        post("/v1/jobs/{id}/retry", submit::retry)
            .rpcs(&["RetryJob"])
            .says("Hands in the problem of a job that has ended once more, to be solved anew as a job whose parent it is; a body changes what the new one may take")
            .may_take(json::<Retry>())
            .hands_in()
            .fails(&[Code::JobActive])
            .tested(&["service::control::a_job_that_has_ended_is_tried_again_as_a_new_one", "service::control::a_job_that_ran_out_of_time_is_given_more", "service::control::a_job_that_waits_or_runs_is_neither_retried_nor_deleted"]),
        delete("/v1/jobs/{id}", jobs::delete)
            .rpcs(&["DeleteJob"])
            .says("Deletes a job that has ended, with its events and its result")
            .answers(204, "It is gone; for 7 days its name answers 410", nothing())
            .fails(&[Code::JobActive, Code::StorageFull])
            .tested(&["service::control::a_deleted_job_is_gone_with_all_that_belonged_to_it", "service::control::a_job_that_waits_or_runs_is_neither_retried_nor_deleted"]),
        post("/v1/jobs/cancel", jobs::cancel_many)
            .rpcs(&["CancelJobs"])
            .says("Asks all jobs of a filter to stop")
            .with(filters())
            .answers(200, "How many there were, and how many of them changed", json::<Many>())
            .fails(&[Code::MissingFilter, Code::StorageFull])
            .tested(&["service::control::many_jobs_are_canceled_and_deleted_by_a_filter_and_not_without_one"]),
        delete("/v1/jobs", jobs::delete_many)
            .rpcs(&["DeleteJobs"])
            .says("Deletes all jobs of a filter that have ended, pinned ones too")
            .with(filters())
            .answers(200, "How many there were, and how many of them are gone", json::<Many>())
            .fails(&[Code::MissingFilter, Code::StorageFull])
            .tested(&["service::control::many_jobs_are_canceled_and_deleted_by_a_filter_and_not_without_one"]),
    ]
}

/// What may stand in the way of a job.
const SUBMITTING: &[Code] = &[
    Code::InvalidProblem,
    Code::ProblemTooLarge,
    Code::IdempotencyKeyReuse,
    Code::Deleted, // a key or name of a job that was
    Code::QueueFull,
    Code::Draining,
    Code::StorageFull,
];

impl Operation {
    /// Answers with the job that was handed in: when it is done, at once, or with its events.
    fn hands_in(self) -> Self {
        let applied = header("Preference-Applied", text(), "The wait that was kept");
        let accepted = [json::<Job>(), stream::<Event>(), lines()].concat();
        self.with([key(), prefer()])
            .answers(201, "The terminal job: it was done in time", json::<Job>())
            .headed([location(), etag(), applied])
            .maybe(replayed())
            .answers(
                202,
                "The accepted job; with Accept: text/event-stream or application/jsonl its events, as from /events",
                accepted,
            )
            .headed([location()])
            .maybe(etag())
            .maybe(retry_after())
            .maybe(replayed())
            .fails(SUBMITTING)
    }
}

/// How lists come in pages.
pub(super) fn pages() -> [Parameter; 2] {
    [
        query(
            "page_size",
            whole(1..=MAX_PAGE_SIZE),
            "Most on a page; absent: 50",
        ),
        query(
            "page_token",
            text(),
            "The next_page_token of the page before",
        ),
    ]
}

/// `filters::FILTERS`; a test holds the two together.
pub(super) fn filters() -> [Parameter; 9] {
    let status = word(&Status::ALL.map(Status::as_str));
    [
        query("status", several(status), "Only jobs that stand so"),
        query("owner", text(), "Only jobs of this owner"),
        labels(),
        query("name", text(), "Only jobs of this name"),
        query("input_hash", text(), "Only jobs with this input"),
        query(
            "created_after",
            time(),
            "Only jobs accepted at this time or later",
        ),
        query("created_before", time(), "Only jobs accepted earlier"),
        query(
            "finished_after",
            time(),
            "Only jobs that ended at this time or later",
        ),
        query("finished_before", time(), "Only jobs that ended earlier"),
    ]
}

fn key() -> Parameter {
    header(
        "Idempotency-Key",
        matching("^[!-~]([ -~]{0,253}[!-~])?$"),
        "The client's name for this request: sent once more, it is answered with the job that it made",
    )
}

fn prefer() -> Parameter {
    header(
        "Prefer",
        like("^wait=([0-9]|[1-5][0-9]|60)$"),
        "wait=0…60: answer with the terminal job if it is done within so many seconds",
    )
}

fn location() -> Parameter {
    header("Location", text(), "Where the job is")
}

fn etag() -> Parameter {
    header("ETag", text(), "The job's version, as a strong entity tag")
}

fn retry_after() -> Parameter {
    header(
        "Retry-After",
        whole(0..=i64::from(u32::MAX)),
        "Seconds after which to look again",
    )
}

fn replayed() -> Parameter {
    header(
        "Idempotency-Replayed",
        word(&["true"]),
        "The key or name was known: nothing was handed in",
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rest::filters::FILTERS;

    #[test]
    fn the_filters_that_are_described_are_those_that_are_read() {
        assert_eq!(filters().map(|filter| filter.name), FILTERS);
    }
}
