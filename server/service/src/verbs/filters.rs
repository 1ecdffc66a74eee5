//! The filters of jobs, for lists, counts and bulk operations: the filters of `store::FILTERS`, and the filter by
//! label.

use base::values::Text;
use serde_json::json;
use store::{FILTERS, Field, Filter};

use crate::{
    error::ApiError,
    parameters::{Description, Location, Parameter},
    violations,
};

/// The filter by label; each key has its parameter `label.{key}`.
pub const LABEL: Parameter<Text> = Parameter {
    name: "label.{key}",
    meaning: "label.KEY=VALUE: only jobs with this label; label.KEY!=VALUE: only jobs without it; several may be given",
    values: Text,
};

/// The descriptions of all filters.
pub fn describe() -> Vec<Description> {
    let described = FILTERS.iter().map(|field| {
        let schema = (field.schema)();
        Description {
            location: Location::Query,
            kind: "",
            name: field.name,
            schema: if field.several {
                json!({ "type": "array", "items": schema })
            } else {
                schema
            },
            meaning: field.meaning,
            repeatable: field.several,
        }
    });
    described.chain([labels()]).collect()
}

/// Adds the value `text` of the filter by `field`.
pub fn set(filter: &mut Filter, field: &Field, text: &str) -> Result<(), ApiError> {
    if (field.set)(filter, text) {
        Ok(())
    } else {
        Err(ApiError::BadParameter {
            name: field.name,
            got: violations::quoted(text),
            expected: (field.expected)(),
        })
    }
}

/// The description of the filter by label for OpenAPI: an object whose members are separate parameters (style form,
/// exploded: the default). The members have no type: in a query all values are text.
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
    let labels = filter.labels.len() + filter.excluded_labels.len();
    if labels > Filter::MOST_LABELS {
        return Err(ApiError::BadParameter {
            name: "labels",
            got: format!("{labels} labels"),
            expected: format!("at most {} labels", Filter::MOST_LABELS),
        });
    }
    if filter.ids.len() > Filter::MOST_IDS {
        return Err(ApiError::BadParameter {
            name: "id",
            got: format!("{} ids", filter.ids.len()),
            expected: format!("at most {} ids", Filter::MOST_IDS),
        });
    }
    Ok(filter)
}

/// Checks that a filter is not empty, so that a bulk operation is not applied to all jobs by accident.
pub(super) fn required(filter: Filter) -> Result<Filter, ApiError> {
    if filter.is_empty() {
        Err(ApiError::MissingFilter(
            describe()
                .iter()
                .map(|filter| filter.name)
                .collect::<Vec<_>>()
                .join(", "),
        ))
    } else {
        Ok(filter)
    }
}
