//! The operation that returns a profile: columns of values along a contact boundary.

use base::{
    caller::Caller,
    job::JobId,
    values::{Integers, Text, Values},
};
use futures_util::future::BoxFuture;
use serde::Deserialize;
use serde_json::{json, value::RawValue};
use solver::solution::{ContactProfile, sample};
use store::{ProfilePoints, Snapshot};

use super::{
    results::{Found, StepResult, is_step_wanted, read, room_for, with_result},
    service::Service,
};
use crate::{
    error::ApiError,
    parameters::{Parameter, Variable},
    violations,
};

/// The points at which a profile has its values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Points {
    /// At nodes, at friction points and at the places of the peaks.
    #[default]
    All,
    /// At the nodes of the boundary.
    Nodes,
    /// At the points where friction acts; forces and peaks are computed from the values there.
    Friction,
    /// At this number of points, equally spaced in arc length, including the ends.
    Spaced(usize),
}

/// The name of a contact boundary in a path.
pub const BOUNDARY: Variable<Text> = Variable {
    name: "boundary",
    kind: "boundary",
    meaning: "Name of a contact boundary",
    values: Text,
};

/// The load step of a profile.
pub const STEP: Parameter<Text> = Parameter {
    name: "step",
    meaning: "Load step, by its name or its number from 0; default: the last",
    values: Text,
};

/// The points at which values are requested.
pub const POINTS: Parameter<Places> = Parameter {
    name: "points",
    meaning: "Points of the profile: all at which the solution is known (the nodes, the points where friction acts, and the places of the peaks, with the values of the summary), the nodes, the points where friction acts, or a number of evenly spaced points; default all",
    values: Places {
        spaced: Integers(2..=100_000),
    },
};

/// The allowed values of the parameter: all choices of points.
#[derive(Clone, Debug)]
pub struct Places {
    /// The possible numbers of evenly spaced points.
    pub spaced: Integers,
}

impl Values for Places {
    type Value = Points;

    fn schema(&self) -> serde_json::Value {
        let words = json!({ "type": "string", "enum": ["all", "nodes", "friction"] });
        json!({ "anyOf": [words, self.spaced.schema()] })
    }

    fn expected(&self) -> String {
        format!("all, nodes, friction, or {}", self.spaced.expected())
    }

    fn read(&self, text: &str) -> Option<Points> {
        match text {
            "all" => Some(Points::All),
            "nodes" => Some(Points::Nodes),
            "friction" => Some(Points::Friction),
            count => {
                let count = self.spaced.read(count)?;
                Some(Points::Spaced(usize::try_from(count).ok()?))
            }
        }
    }
}

/// Returns the profile of one contact boundary: at the end of the solution, or at the end of a load step, given by its
/// name or its number from 0. `partial`: whether that of a job without a solution will do.
pub fn profile<'a>(
    service: &'a Service,
    caller: &'a Caller,
    id: JobId,
    boundary: &'a str,
    step: Option<&'a str>,
    points: Points,
    partial: bool,
) -> BoxFuture<'a, Result<Found<ContactProfile>, ApiError>> {
    Box::pin(async move {
        let _room = match step {
            Some(_) => room_for(service, caller, id, &["steps"]).await?,
            None => None,
        };
        let mut found = with_result(service, caller, id).await?;
        let available = found.job.result_available;
        let step = match step {
            None => None,
            Some(wanted) => find_step(&mut found, wanted, id).await?,
        };
        is_step_wanted(&found.job, step.as_ref().map(|step| &step.1), partial)?;
        let step = step.map(|step| step.0);
        let here = match points {
            Points::All => ProfilePoints::All,
            Points::Friction => ProfilePoints::Friction,
            Points::Nodes | Points::Spaced(_) => ProfilePoints::Nodes,
        };
        let profile = match here {
            ProfilePoints::All => at_all_points(&mut found, boundary, step).await?,
            here => found.profile(boundary, here, step).await?,
        };
        let friction = match points {
            Points::Spaced(_) => {
                found
                    .profile(boundary, ProfilePoints::Friction, step)
                    .await?
            }
            _ => None,
        };
        let Some(bytes) = profile else {
            let known = found.profiled_boundaries().await?;
            if known.iter().any(|name| name == boundary) {
                return Err(ApiError::NotFound(format!(
                    "{id} was solved by an earlier version, which did not store profiles at friction points; try points=nodes"
                )));
            }
            return Err(ApiError::NotFound(format!(
                "{id} has no contact boundary {:?}; it has: {}",
                violations::quoted(boundary),
                known.join(", ")
            )));
        };
        drop(found);
        let Points::Spaced(count) = points else {
            let content = read(&bytes)?;
            return Ok(Found::new(available, content));
        };
        let sampling = service.work(move || {
            let nodes = read(&bytes)?;
            let friction = friction.map_or(Ok(ContactProfile::default()), |bytes| read(&bytes))?;
            Ok(sample(&nodes, &friction, count))
        });
        let content = sampling.await?;
        content.map(|content| Found::new(available, content))
    })
}

/// The stored profile of a contact boundary at all points; in results of older versions, at the nodes.
pub(super) async fn at_all_points(
    found: &mut Snapshot,
    boundary: &str,
    step: Option<usize>,
) -> Result<Option<Vec<u8>>, ApiError> {
    let all = found.profile(boundary, ProfilePoints::All, step).await?;
    match all {
        None => Ok(found.profile(boundary, ProfilePoints::Nodes, step).await?),
        all => Ok(all),
    }
}

/// Finds a finished load step by its name or its number from 0, and returns it with this number. `None`: the only step
/// of a problem without load steps.
pub(super) async fn find_step(
    found: &mut Snapshot,
    wanted: &str,
    id: JobId,
) -> Result<Option<(usize, StepResult)>, ApiError> {
    let bytes = found.part("steps").await?;
    let bytes = bytes.as_deref().unwrap_or(b"[]");
    // the summaries of a thousand steps are large, and one of them is wanted
    let steps: Vec<Named> = read(bytes)?;
    if steps.is_empty() && wanted == "0" {
        return Ok(None);
    }
    let number = step_number(&steps, wanted, id)?;
    let all: Vec<&RawValue> = serde_json::from_slice(bytes).map_err(ApiError::internal)?;
    let step = all.get(number).map_or("", |step| step.get());
    Ok(Some((number, read(step.as_bytes())?)))
}

/// A load step of which only the name is read.
#[derive(Deserialize)]
struct Named {
    name: String,
}

fn step_number(steps: &[Named], wanted: &str, id: JobId) -> Result<usize, ApiError> {
    let named = steps.iter().position(|step| step.name == wanted);
    let numbered = wanted.parse().ok().filter(|n| *n < steps.len());
    named.or(numbered).ok_or_else(|| {
        if steps.is_empty() {
            return ApiError::NotFound(format!("{id} has no load steps; remove `step`"));
        }
        let names: Vec<_> = steps
            .iter()
            .take(20)
            .map(|step| step.name.as_str())
            .collect();
        ApiError::NotFound(format!(
            "{id} has no load step {:?}; it has {} (by name, or by number from 0): {}",
            violations::quoted(wanted),
            steps.len(),
            names.join(", ")
        ))
    })
}
