//! The operations on the results of a job, as data and as figures.

use base::{catalog::Code, event::TimedIteration};
use service::{
    formats::Format,
    verbs::{
        history::MAX_POINTS,
        jobs::ID,
        plots::{PLOT, SIZE, STRESS, THEME},
        profiles::{BOUNDARY, POINTS, STEP},
        results::JobResult,
    },
};
use solver::solution::{ContactProfile, Fields};

use super::{
    content::{bytes, data, json, nothing},
    headers::result_available,
    operation::{CANCEL, Content, Operation, READ, delete, get},
};
use crate::rest::{
    accept::FormatOf,
    data::PART,
    headers::{header, text},
    plots, results,
};

pub(super) fn operations() -> Vec<Operation> {
    const TABLE: FormatOf = FormatOf(Format::OF_TABLES);
    const FIELDS: FormatOf = FormatOf(Format::OF_FIELDS);
    vec![
        get(READ, "/v1/jobs/{id}/result", (ID,), results::result)
            .rpcs(&["GetResult"])
            .summary("Returns the summary of a job's result, and one for each load step")
            .answers(200, "The summary", json::<JobResult>())
            .with([result_available()])
            .fails(NO_RESULT),
        get(
            READ,
            "/v1/jobs/{id}/history",
            (ID, TABLE, MAX_POINTS, PART),
            results::history,
        )
        .rpcs(&["ListIterations"])
        .summary("Returns the iterations of a job's last attempt, one row each")
        .file_of_result("The rows", data::<Vec<TimedIteration>>(Format::OF_TABLES)),
        get(
            READ,
            "/v1/jobs/{id}/profiles/{boundary}",
            (ID, BOUNDARY, TABLE, STEP, POINTS, PART),
            results::profile,
        )
        .rpcs(&["GetProfile"])
        .summary("Returns columns along a contact boundary, by arc length")
        .file_of_result("The columns", data::<ContactProfile>(Format::OF_TABLES))
        .fails(NO_RESULT),
        get(
            READ,
            "/v1/jobs/{id}/fields",
            (ID, FIELDS, PART),
            results::fields,
        )
        .rpcs(&["StreamResult"])
        .summary("Returns mesh, displacements and stresses")
        .file_of_result("The fields", data::<Fields>(Format::OF_FIELDS))
        .fails(NO_RESULT),
        delete(CANCEL, "/v1/jobs/{id}/fields", (ID,), results::delete_fields)
            .rpcs(&["DeleteFields"])
            .summary("Deletes mesh, displacements and stresses of a job that has ended, which are most of its data; summary, history and profiles remain")
            .answers(204, "Deleted", nothing())
            .fails(&[Code::Deleted, Code::JobActive]),
        get(
            READ,
            "/v1/jobs/{id}/plots/{plot}",
            (ID, PLOT, THEME, SIZE, STRESS, STEP, PART),
            plots::plot,
        )
        .rest_only("GetPlot")
        .summary("Draws a figure: mesh, deformed body, stresses along the contact, convergence")
        .file_of_result("The figure", figures())
        .fails(NO_RESULT),
    ]
}

fn figures() -> Content {
    let media = Format::OF_FIGURES.iter().map(|format| format.media_type());
    media.flat_map(bytes).collect()
}

/// The errors if there is no result.
const NO_RESULT: &[Code] = &[Code::NoResult, Code::ResultNotReady];

impl Operation {
    /// Adds the answers with a file, with a part of it, or with 304 if the client has it.
    pub(super) fn file(self, meaning: &'static str, content: Content) -> Self {
        let tag = || header("ETag", text(), "The file's SHA-256");
        let name = || header("Content-Disposition", text(), "A name for the file");
        let whole_file = header(
            "Content-Digest",
            text(),
            "Its SHA-256 (RFC 9530); absent from a compressed answer",
        );
        let parts = content.iter().flat_map(|(media, _)| bytes(media)).collect();
        let part = header(
            "Content-Range",
            text(),
            "The part, and the size of the file",
        );
        self.answers(200, meaning, content)
            .with([tag(), name()])
            .sometimes_with(whole_file)
            .answers(206, "The requested part", parts)
            .with([tag(), name(), part])
            .answers(304, "The file has not changed", nothing())
            .with([tag()])
            .fails(&[Code::NotAcceptable, Code::RangeNotSatisfiable])
    }

    /// As `file`, of a job: the answers say whether its result is partial or final.
    fn file_of_result(mut self, meaning: &'static str, content: Content) -> Self {
        let others = self.answers.len();
        self = self.file(meaning, content);
        for answer in &mut self.answers[others..] {
            answer.headers.push((result_available(), true));
        }
        self
    }
}
