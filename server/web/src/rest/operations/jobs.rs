//! The operations on jobs: submit, get, list, wait, watch, edit, cancel, delete.

use base::{catalog::Code, event::Event, job::Job};
use service::verbs::{
    bulk::BulkResult,
    jobs::ID,
    key::{IDEMPOTENCY_KEY, Keys},
    lists::{Count, GROUP_BY, ORDER_BY},
    page::{PAGE_SIZE, PAGE_TOKEN},
    watch::{AFTER_SEQ, UNTIL, WAIT},
};

use super::{
    content::{json, lines, merge_patch, nothing, stream, submission, the_problem},
    headers::{etag, location, preference_applied, replayed, retry_after},
    operation::{CANCEL, Operation, READ, SUBMIT, delete, get, patch, post, put},
};
use crate::rest::{
    bodies::{Edits, MergePatch, Retry, Submission, Submissions},
    events::{self, LAST_EVENT_ID},
    filters::FILTERS,
    headers::{Header, IF_MATCH, IF_NONE_MATCH, PREFER},
    jobs, submit,
};

/// The header that makes a request safe to repeat.
pub(super) const KEY: Header<Keys> = Header(IDEMPOTENCY_KEY);

pub(super) fn operations() -> Vec<Operation> {
    vec![
        post(SUBMIT, "/v1/jobs", (KEY, PREFER), submit::create)
            .rpcs(&["CreateJob", "SubmitAndWatch"])
            .summary("Submits a job; when the answer is sent, the job is stored on disk")
            .body(json::<Submission>())
            .example(submission())
            .submits(),
        put(SUBMIT, "/v1/jobs/{id}", (ID, KEY, PREFER), submit::put)
            .rpcs(&["CreateJob"])
            .named("PutJob")
            .summary("Submits a job under an id chosen by the client; repeating the request changes nothing")
            .body(json::<Submission>())
            .example(submission())
            .answers(200, "The job with this id, submitted before with the same content", json::<Job>())
            .with([location(), etag()])
            .sometimes_with(replayed())
            .submits()
            .fails(&[Code::IdConflict]),
        post(SUBMIT, "/v1/jobs/batch", (KEY,), submit::create_batch)
            .rpcs(&["BatchCreateJobs"])
            .summary("Submits up to 1000 jobs, all or none of them")
            .body(json::<Submissions>())
            .answers(202, "The accepted jobs, in their order", json::<submit::Batch>())
            .with([retry_after()])
            .sometimes_with(replayed())
            .fails(SUBMITTING),
        get(READ, "/v1/jobs", (FILTERS, PAGE_SIZE, PAGE_TOKEN, ORDER_BY), jobs::list)
            .rpcs(&["ListJobs"])
            .summary("Lists jobs, newest first")
            .answers(200, "A page of jobs. It may be short or empty before the list ends, since only so many jobs are checked for each page: the list ends where there is no next_page_token", json::<jobs::List>())
            .fails(&[Code::BadPageToken]),
        get(READ, "/v1/jobs/count", (FILTERS, GROUP_BY), jobs::count)
            .rpcs(&["CountJobs"])
            .summary("Counts jobs")
            .answers(200, "The number of jobs", json::<Count>()),
        get(READ, "/v1/jobs/{id}", (ID, WAIT, UNTIL, IF_NONE_MATCH), jobs::get)
            .rpcs(&["GetJob", "WaitJob"])
            .summary("Returns a job now, or after it has changed or ended")
            .answers(200, "The job", json::<Job>())
            .with([etag()])
            .answers(304, "The job has not changed", nothing())
            .with([etag()]),
        get(READ, "/v1/jobs/{id}/problem", (ID,), jobs::problem)
            .rpcs(&["GetJobProblem"])
            .summary("Returns the exact input of a job, with its defaults filled in")
            .answers(200, "The problem", the_problem()),
        get(READ, "/v1/jobs/{id}/events", (ID, AFTER_SEQ, Header(LAST_EVENT_ID)), events::events)
            .rpcs(&["WatchJob"])
            .summary("Streams the events of a job, past ones first, then live ones, until `done`")
            .answers(200, "The events, each with its number; a comment every 15 s", [stream::<Event>(), lines()].concat())
            .answers(204, "The job has ended, and there are no events after that number", nothing())
            .fails(&[Code::NotAcceptable, Code::Draining]),
        patch(SUBMIT, "/v1/jobs/{id}", (ID, IF_MATCH), jobs::update)
            .rpcs(&["UpdateJob"])
            .summary("Changes the name, labels or priority of a job, or whether it is kept permanently")
            .body([json::<Edits>(), merge_patch::<MergePatch>()].concat())
            .answers(200, "The changed job", json::<Job>())
            .with([etag()])
            .fails(&[Code::InvalidProblem, Code::StaleVersion, Code::StorageFull]),
        post(CANCEL, "/v1/jobs/{id}/cancel", (ID,), jobs::cancel)
            .rpcs(&["CancelJob"])
            .summary("Asks a job to stop, which ends within half a second")
            .answers(200, "The effect, and the job", json::<jobs::Canceled>())
            .with([etag()])
            .fails(&[Code::StorageFull]),
        post(SUBMIT, "/v1/jobs/{id}/retry", (ID, KEY, PREFER), submit::retry)
            .rpcs(&["RetryJob"])
            .summary("Submits the problem of an ended job again as a new job, with the old one as its parent, and without the cache; a body changes its limits and priority")
            .optional_body(json::<Retry>())
            .submits()
            .fails(&[Code::JobActive]),
        delete(CANCEL, "/v1/jobs/{id}", (ID,), jobs::delete)
            .rpcs(&["DeleteJob"])
            .summary("Deletes a job that has ended, with its events and its result")
            .answers(204, "Deleted; its id answers 410 for 7 days (kept for the last 100,000 deleted jobs)", nothing())
            .fails(&[Code::JobActive, Code::StorageFull]),
        post(CANCEL, "/v1/jobs/cancel", (FILTERS,), jobs::cancel_many)
            .rpcs(&["CancelJobs"])
            .summary("Asks all jobs that match the filters to stop")
            .answers(200, "How many jobs matched, and how many of them changed", json::<BulkResult>())
            .fails(&[Code::MissingFilter, Code::StorageFull]),
        delete(CANCEL, "/v1/jobs", (FILTERS,), jobs::delete_many)
            .rpcs(&["DeleteJobs"])
            .summary("Deletes all jobs that match the filters and have ended, pinned ones too")
            .answers(200, "How many jobs matched, and how many of them were deleted", json::<BulkResult>())
            .fails(&[Code::MissingFilter, Code::StorageFull]),
    ]
}

/// The reasons for which a submission may be refused.
pub(super) const SUBMITTING: &[Code] = &[
    Code::InvalidProblem,
    Code::ProblemTooLarge,
    Code::IdempotencyKeyReuse,
    Code::Deleted, // the key or id of a deleted job
    Code::QuotaExceeded,
    Code::Forbidden, // a priority above 0
    Code::QueueFull,
    Code::Draining,
    Code::StorageFull,
];

impl Operation {
    /// Adds the answers with the submitted job: when it has ended, at once, or with its events.
    pub(super) fn submits(self) -> Self {
        let accepted = [json::<Job>(), stream::<Event>(), lines()].concat();
        self.answers(201, "The job, which has ended within the wait", json::<Job>())
            .with([location(), etag(), preference_applied()])
            .sometimes_with(replayed())
            .answers(
                202,
                "The accepted job; with Accept: text/event-stream or application/jsonl its events, as from /events",
                accepted,
            )
            .with([location()])
            .sometimes_with(etag())
            .sometimes_with(retry_after())
            .sometimes_with(replayed())
            .fails(SUBMITTING)
    }
}
