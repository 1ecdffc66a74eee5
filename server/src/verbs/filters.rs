//! The filters of jobs for lists, counts and bulk operations, the same for both protocols.

use serde_json::json;

use crate::{
    error::ApiError,
    job::{Status, SweepId},
    parameters::{Description, Parameter, Text, Times, Values, Words},
    store::Filter,
};

/// The filter by status; several may be given.
pub const STATUS: Parameter<Words<Status>> = Parameter {
    name: "status",
    meaning: "Only jobs with this status; several may be given",
    values: Words::all(),
};

/// The filter by owner.
pub const OWNER: Parameter<Text> = Parameter {
    name: "owner",
    meaning: "Only jobs of this owner",
    values: Text,
};

/// The filter by label: `label.{key}` is a name for each key.
pub const LABEL: Parameter<Text> = Parameter {
    name: "label.{key}",
    meaning: "label.KEY=VALUE: only jobs with this label; several may be given",
    values: Text,
};

/// The filter by name.
pub const NAME: Parameter<Text> = Parameter {
    name: "name",
    meaning: "Only jobs with this name",
    values: Text,
};

/// The filter by the fingerprint of the problem.
pub const INPUT_HASH: Parameter<Text> = Parameter {
    name: "input_hash",
    meaning: "Only jobs with this input",
    values: Text,
};

/// The filter by sweep.
pub const SWEEP: Parameter<SweepIds> = Parameter {
    name: "sweep",
    meaning: "Only jobs of this sweep",
    values: SweepIds,
};

/// The ids of sweeps, as values.
#[derive(Clone, Copy, Debug)]
pub struct SweepIds;

impl Values for SweepIds {
    type Value = SweepId;

    fn schema(&self) -> serde_json::Value {
        json!({ "$ref": "#/components/schemas/SweepId" })
    }

    fn expected(&self) -> String {
        "sweep_ and a UUID in lower case".into()
    }

    fn read(&self, text: &str) -> Option<SweepId> {
        SweepId::parse(text)
    }
}

/// The filter by the earliest time of acceptance.
pub const CREATED_AFTER: Parameter<Times> = Parameter {
    name: "created_after",
    meaning: "Only jobs accepted at this time or later",
    values: Times,
};

/// The filter by the latest time of acceptance.
pub const CREATED_BEFORE: Parameter<Times> = Parameter {
    name: "created_before",
    meaning: "Only jobs accepted earlier",
    values: Times,
};

/// The filter by the earliest time of the end.
pub const FINISHED_AFTER: Parameter<Times> = Parameter {
    name: "finished_after",
    meaning: "Only jobs that ended at this time or later",
    values: Times,
};

/// The filter by the latest time of the end.
pub const FINISHED_BEFORE: Parameter<Times> = Parameter {
    name: "finished_before",
    meaning: "Only jobs that ended earlier",
    values: Times,
};

/// The descriptions of all filters.
pub fn describe() -> [Description; 10] {
    [
        STATUS.describe_several(),
        OWNER.describe(),
        labels(),
        NAME.describe(),
        INPUT_HASH.describe(),
        SWEEP.describe(),
        CREATED_AFTER.describe(),
        CREATED_BEFORE.describe(),
        FINISHED_AFTER.describe(),
        FINISHED_BEFORE.describe(),
    ]
}

/// The description of labels for OpenAPI: members of an object, each of which is a parameter (style form, exploded: the
/// default). Their values have no type: in a query all are text.
fn labels() -> Description {
    let keys = json!({ "^label\\.": {} });
    Description {
        schema: json!({ "type": "object", "patternProperties": keys, "additionalProperties": false }),
        ..LABEL.describe_several()
    }
}

/// Checks a filter against its limits; removes duplicate statuses and labels.
pub fn checked(filter: Filter) -> Result<Filter, ApiError> {
    let filter = filter.tidied();
    if filter.labels.len() > Filter::MOST_LABELS {
        return Err(ApiError::BadParameter {
            name: "labels",
            got: format!("{} labels", filter.labels.len()),
            expected: format!("at most {} labels", Filter::MOST_LABELS),
        });
    }
    Ok(filter)
}

/// Checks that a filter is not empty, so that a bulk operation is not applied to all jobs by accident.
pub(super) fn required(filter: Filter) -> Result<Filter, ApiError> {
    match filter.is_empty() {
        true => Err(ApiError::MissingFilter(
            describe().map(|filter| filter.name).join(", "),
        )),
        false => Ok(filter),
    }
}
