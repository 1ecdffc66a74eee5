//! Describes the headers of answers.

use serde_json::json;
use service::parameters::Description;

use crate::rest::headers::{header, text};

/// The header with the path of a new resource.
pub(super) fn location() -> Description {
    header("Location", text(), "The path of the resource")
}

/// The header with the version of a job or sweep.
pub(super) fn etag() -> Description {
    header(
        "ETag",
        text(),
        "The version, as a weak entity tag: progress alone does not change it",
    )
}

/// The header that says whether a result is partial or final.
pub(super) fn result_available() -> Description {
    let words = json!({ "type": "string", "enum": ["none", "partial", "final"] });
    header(
        "Result-Available",
        words,
        "As in the job: partial if the job has not ended or has not converged; none while it has only iterations",
    )
}

/// The header with the token of the next part of a table.
pub(super) fn next_page_token() -> Description {
    header(
        "Next-Page-Token",
        text(),
        "The page_token of the next part; absent from the last one",
    )
}

/// The header that says how long to wait before polling.
pub(super) fn retry_after() -> Description {
    let seconds = json!({ "type": "integer", "minimum": 0, "maximum": u32::MAX });
    header("Retry-After", seconds, "Seconds after which to poll")
}

/// The header that marks the answer to a repeated request.
pub(super) fn replayed() -> Description {
    let yes = json!({ "type": "string", "enum": ["true"] });
    header(
        "Idempotency-Replayed",
        yes,
        "The key or id was used before, so nothing new was submitted",
    )
}

/// The header that confirms that the client's preference to wait was applied.
pub(super) fn preference_applied() -> Description {
    header(
        "Preference-Applied",
        text(),
        "The preference that was applied: wait, in seconds",
    )
}
