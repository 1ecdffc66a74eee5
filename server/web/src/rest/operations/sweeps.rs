//! The operations on sweeps: many problems that differ in a few values.

use base::{
    catalog::Code,
    sweep::{Sweep, SweepEvent},
};
use service::{
    formats::Format,
    verbs::{
        page::{PAGE_SIZE, PAGE_TOKEN},
        sweeps::{ID, NUMBER, WAIT},
        watch::AFTER_SEQ,
    },
};

use super::{
    content::{self, data, json, lines, nothing, stream},
    headers::{etag, location, replayed, retry_after},
    jobs::{KEY, SUBMITTING},
    operation::{CANCEL, Operation, READ, SUBMIT, delete, get, post},
};
use crate::rest::{
    accept::FormatOf,
    bodies::SweepSubmission,
    data::PART,
    headers::{Header, IF_NONE_MATCH, PREFER},
    sweeps,
};

pub(super) fn operations() -> Vec<Operation> {
    const TABLE: FormatOf = FormatOf(Format::OF_TABLES);
    vec![
        post(SUBMIT, "/v1/sweeps", (KEY,), sweeps::create)
            .rpcs(&["CreateSweep"])
            .summary("Submits a sweep: one problem with many values, at most 10,000 members, all or none; members on the same body are solved by one job")
            .body(json::<SweepSubmission>())
            .example(content::sweep())
            .answers(202, "The accepted sweep", json::<Sweep>())
            .with([location(), etag(), retry_after()])
            .sometimes_with(replayed())
            .fails(SUBMITTING),
        get(READ, "/v1/sweeps", (PAGE_SIZE, PAGE_TOKEN), sweeps::list)
            .rpcs(&["ListSweeps"])
            .summary("Lists sweeps, newest first")
            .answers(200, "A page of sweeps", json::<sweeps::List>())
            .fails(&[Code::BadPageToken]),
        get(READ, "/v1/sweeps/{id}", (ID, WAIT, IF_NONE_MATCH), sweeps::get)
            .rpcs(&["GetSweep"])
            .summary("Returns a sweep now, or when it has ended: its status, and how many of its members have ended")
            .answers(200, "The sweep", json::<Sweep>())
            .with([etag()])
            .answers(304, "The sweep has not changed", nothing())
            .with([etag()]),
        get(READ, "/v1/sweeps/{id}/results",
            (ID, TABLE, PAGE_SIZE, PAGE_TOKEN, PART),
            sweeps::results,
        )
        .rpcs(&["ListSweepMembers"])
        .summary("Returns the table of a sweep with a row for each member, which fills while the sweep runs: in pages as JSON, as a whole in the other formats")
        .file("The rows", data::<sweeps::Rows>(Format::OF_TABLES))
        .fails(&[Code::BadPageToken]),
        get(READ, "/v1/sweeps/{id}/events",
            (ID, AFTER_SEQ, Header(sweeps::LAST_EVENT_ID)),
            sweeps::events,
        )
        .rpcs(&["WatchSweep"])
        .summary("Streams the rows of a sweep's members as they end, past ones first, until `done`")
        .answers(200, "The events, each with its number; a comment every 15 s", [stream::<SweepEvent>(), lines()].concat())
        .answers(204, "The sweep has ended, and there are no events after that number", nothing())
        .fails(&[Code::NotAcceptable, Code::Draining]),
        post(CANCEL, "/v1/sweeps/{id}/cancel", (ID,), sweeps::cancel)
            .rpcs(&["CancelSweep"])
            .summary("Asks all jobs of a sweep to stop; finished rows are kept")
            .answers(200, "The sweep", json::<Sweep>())
            .with([etag()])
            .fails(&[Code::StorageFull]),
        delete(CANCEL, "/v1/sweeps/{id}", (ID,), sweeps::delete)
            .rpcs(&["DeleteSweep"])
            .summary("Deletes a sweep that has ended, with its jobs and rows")
            .answers(204, "Deleted; its id answers 410 for 7 days", nothing())
            .fails(&[Code::JobActive, Code::StorageFull]),
        post(SUBMIT, "/v1/sweeps/{id}/members/{number}/job",
            (ID, NUMBER, KEY, PREFER),
            sweeps::solve_member,
        )
        .rpcs(&["CreateMemberJob"])
        .summary("Submits a member of a sweep as a job of its own, for its fields, profiles and history")
        .submits(),
    ]
}
