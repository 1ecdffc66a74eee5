//! Headers of answers.

use serde_json::json;
use service::parameters::Description;

use crate::rest::headers::{header, text};

/// The path of a new resource.
pub(super) fn location() -> Description {
    header("Location", text(), "The path of the resource")
}

/// The version of a job or sweep.
pub(super) fn etag() -> Description {
    header(
        "ETag",
        text(),
        "The version, as a weak entity tag: progress alone does not change it",
    )
}

/// Whether a result is partial or final.
pub(super) fn result_available() -> Description {
    let words = json!({ "type": "string", "enum": ["none", "partial", "final"] });
    header(
        "Result-Available",
        words,
        "As in the job: partial if it has not ended or has not converged; none while there are only iterations",
    )
}

/// How long to wait before polling.
pub(super) fn retry_after() -> Description {
    let seconds = json!({ "type": "integer", "minimum": 0, "maximum": u32::MAX });
    header("Retry-After", seconds, "Seconds after which to poll")
}

/// Marks the answer to a repeated request.
pub(super) fn replayed() -> Description {
    let yes = json!({ "type": "string", "enum": ["true"] });
    header(
        "Idempotency-Replayed",
        yes,
        "The key or id was used before, so nothing new was submitted",
    )
}

/// Confirms that the client's preference to wait was applied.
pub(super) fn preference_applied() -> Description {
    header(
        "Preference-Applied",
        text(),
        "The preference that was applied: wait, in seconds",
    )
}
