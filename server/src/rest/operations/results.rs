//! What a job has found, as data and as figures.

use solver::solution::{ContactProfile, Fields, Iteration};

use super::{
    Operation, Parameter, get,
    shapes::{
        bytes, data, format_of, header, json, like, nothing, one_of, query, text, whole, word,
    },
};
use crate::{
    catalog::Code,
    formats::Format,
    rest::{plots, results},
    verbs::results::JobResult,
};

pub(super) fn operations() -> Vec<Operation> {
    vec![
        get("/v1/jobs/{id}/result", results::result)
            .rpcs(&["GetResult"])
            .says("Sums up what a job has found, whole and by load step")
            .answers(200, "The summary", json::<JobResult>())
            .fails(NOTHING)
            .tested(&[
                "service::results::a_result_has_its_summary_profiles_and_fields",
                "service::results::a_result_is_not_there_before_the_end_nor_after_an_end_without_one",
                "service::results::finished_load_steps_of_a_running_job_are_served",
            ]),
        get("/v1/jobs/{id}/history", results::history)
            .rpcs(&["ListIterations"])
            .says("The iterations of a job's last attempt, a row each")
            .with([
                format_of(Format::OF_TABLES),
                query("max_points", whole(2..=i64::from(u32::MAX)), "At most so many rows; the first and the last are kept"),
            ])
            .file("The rows", data::<Vec<Iteration>>(Format::OF_TABLES))
            .tested(&["service::results::a_history_has_the_rows_that_were_told_and_no_more_than_asked_for", "service::files::tables_have_tags_and_ranges_too"]),
        get("/v1/jobs/{id}/profiles/{boundary}", results::profile)
            .rpcs(&["GetProfile"])
            .says("Columns along a contact boundary, by arc length")
            .with([
                format_of(Format::OF_TABLES),
                query("step", text(), "A load step, by its name or its number from 0; absent: the last"),
                query("points", one_of([word(&["nodes", "friction"]), whole(2..=100_000)]), "Where: at the nodes, where friction acts, or at so many evenly spaced places; absent: nodes"),
            ])
            .file("The columns", data::<ContactProfile>(Format::OF_TABLES))
            .fails(NOTHING)
            .tested(&[
                "service::results::every_format_has_its_type_its_name_and_its_first_bytes",
                "service::results::what_is_not_there_is_said_with_what_is",
                "service::results::a_profile_is_given_at_nodes_at_friction_points_or_at_any_number_of_places",
                "service::files::tables_have_tags_and_ranges_too"]),
        get("/v1/jobs/{id}/fields", results::fields)
            .rpcs(&["StreamResult"])
            .says("Mesh, displacements and stresses")
            .with([format_of(Format::OF_FIELDS)])
            .file("The fields", data::<Fields>(Format::OF_FIELDS))
            .fails(NOTHING)
            .tested(&["service::results::every_format_has_its_type_its_name_and_its_first_bytes", "service::files::fields_are_fetched_in_ranges_that_make_up_the_whole"]),
        get("/v1/jobs/{id}/plots/{plot}", plots::plot)
            .rest_only("GetPlot")
            .says("A figure: mesh, deformed body, stresses along the contact, convergence")
            .with([
                query("theme", word(&["light", "dark"]), "Its colours"),
                query("stress", word(&["von_mises", "xx", "yy", "zz", "xy"]), "What colours deformed.svg, and only that"),
            ])
            .answers(200, "The figure", bytes("image/svg+xml"))
            .fails(NOTHING)
            .tested(&[
                "service::plots::every_plot_of_a_result_is_an_svg_in_both_themes",
                "service::plots::a_plot_or_a_theme_that_is_not_known_is_refused_with_what_is",
            ]),
    ]
}

/// Why there is nothing to show.
const NOTHING: &[Code] = &[Code::NoResult, Code::ResultNotReady];

impl Operation {
    /// Answers with a file: whole, a range of it, or the word that it is known.
    fn file(self, meaning: &'static str, content: super::Content) -> Self {
        let tag = || header("ETag", text(), "The file's SHA-256");
        let name = || header("Content-Disposition", text(), "A name for the file");
        let whole_file = header("Content-Digest", text(), "Its SHA-256 (RFC 9530)");
        let parts = content.iter().flat_map(|(media, _)| bytes(media)).collect();
        let part = header("Content-Range", text(), "Which part, and of how much");
        self.with(range())
            .answers(200, meaning, content)
            .headed([tag(), name(), whole_file])
            .answers(206, "The part that was asked for", parts)
            .headed([tag(), name(), part])
            .answers(304, "The file is the known one", nothing())
            .headed([tag()])
            .fails(&[Code::NotAcceptable, Code::RangeNotSatisfiable])
    }
}

fn range() -> [Parameter; 3] {
    [
        header("If-None-Match", text(), "The ETag of a file that is known"),
        header(
            "Range",
            like("^bytes=([0-9]{1,6}-[0-9]{0,6}|-[0-9]{1,6})$"),
            "bytes=FIRST-LAST: a part of the file",
        ),
        header(
            "If-Range",
            text(),
            "The ETag of the file that the part belongs to; of another one everything is sent",
        ),
    ]
}
