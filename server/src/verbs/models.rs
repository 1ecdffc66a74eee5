//! Registering parametrised problems, which clients of UM-Bridge evaluate (`umbridge`).

use std::sync::Arc;

use files::sweep::Parametrised;
use serde_json::json;
use solver::{
    error::{Findings, Reason, Violation},
    problem::Problem,
};
use strum::VariantArray;

use super::{
    admission::{admit, prepare},
    envelope::{Envelope, JobRequest},
    page::{Page, Paging},
    service::{Service, detached},
};
use crate::{
    caller::Caller,
    error::{ApiError, Quota, QuotaOf},
    model::{
        Description, MAX_NAME, MAX_TITLE, MOST_DESCRIPTION_BYTES, MOST_INPUTS, MOST_MODELS,
        MOST_OUTPUTS, MOST_PROBLEM_BYTES, MOST_VECTORS, Model, Output, Quantity, Scalar,
        WholeModel, boundaries, in_vectors,
    },
    parameters::{Integers, Values, Variable},
    store::Cursor,
    violations::{PROBLEM, quoted},
};

/// A model in a path.
pub const NAME: Variable<Names> = Variable {
    name: "name",
    kind: "model",
    meaning: "Name of the model",
    values: Names,
};

/// The names that a model may have: they stand in addresses and in the names of jobs.
#[derive(Clone, Copy, Debug)]
pub struct Names;

impl Values for Names {
    type Value = String;

    fn schema(&self) -> serde_json::Value {
        let more = MAX_NAME - 1;
        json!({ "type": "string", "pattern": format!("^[A-Za-z0-9][A-Za-z0-9_.-]{{0,{more}}}$") })
    }

    fn expected(&self) -> String {
        format!("1 … {MAX_NAME} letters, digits, _ . and -, the first a letter or digit")
    }

    fn read(&self, text: &str) -> Option<String> {
        let allowed = |byte: u8| byte.is_ascii_alphanumeric() || b"_.-".contains(&byte);
        let named = (1..=MAX_NAME).contains(&text.len())
            && text.starts_with(|first: char| first.is_ascii_alphanumeric())
            && text.bytes().all(allowed);
        named.then(|| text.to_owned())
    }
}

/// How many points of a profile an output may have.
pub const POINTS: Integers = Integers(2..=MOST_OUTPUTS as i64);

/// A request that registers a model.
#[derive(Debug)]
pub struct ModelRequest {
    /// For people.
    pub title: Option<String>,
    /// The problem that the inputs are put into.
    pub problem: Problem,
    /// JSON Pointers into it.
    pub inputs: Vec<Vec<String>>,
    /// Numbers of its result.
    pub outputs: Vec<Output>,
}

/// Registers a model, or replaces the caller's own of that name; whether it is new. All that is wrong with the problem, the
/// inputs and the outputs is reported together.
pub async fn put(
    service: &Arc<Service>,
    caller: &Caller,
    name: String,
    request: ModelRequest,
) -> Result<(Model, bool), ApiError> {
    service.accepting()?;
    service.may_keep_more(caller.owner()).await?;
    let (service, caller) = (service.clone(), caller.clone());
    detached(async move {
        let mut found = Findings::default();
        let job = JobRequest {
            envelope: Envelope::default(),
            problem: Ok(request.problem.clone()),
        };
        match admit(&service, &caller, prepare(&service, job, None).await?).await {
            Ok(_) => {}
            Err(ApiError::InvalidProblem(violations)) => {
                found.extend(violations.into_iter().map(of_problem));
            }
            Err(other) => return Err(other),
        }
        let checked = service.work(move || checked(request, found));
        let (description, problem) = checked.await??;
        let owner = caller.owner();
        let put =
            service
                .store
                .put_model((owner, name.as_str()), &description, &problem, MOST_MODELS);
        put.await?.ok_or_else(|| {
            ApiError::QuotaExceeded(Quota {
                owner: owner.to_owned(),
                of: QuotaOf::Models,
                limit: MOST_MODELS.into(),
                used: MOST_MODELS.into(),
                asked: 1,
            })
        })
    })
    .await
}

/// A violation of the job that solves the problem of a model, which has the limits that all have by default.
pub(super) fn of_problem(violation: Violation) -> Violation {
    match violation.pointer.starts_with("/limits") {
        true => Violation {
            pointer: PROBLEM.into(),
            hint: "Evaluations have this limit: take a coarser mesh, less refinement or fewer increments.".into(),
            ..violation
        },
        false => violation,
    }
}

/// What is stored of a model, and its problem as JSON, if nothing is wrong with them.
fn checked(request: ModelRequest, mut found: Findings) -> Result<(Description, String), ApiError> {
    let ModelRequest {
        title,
        problem,
        inputs,
        outputs,
    } = request;
    let text = serde_json::to_string(&problem).map_err(ApiError::internal)?;
    if text.len() > MOST_PROBLEM_BYTES {
        found.add(Violation::new(
            PROBLEM,
            Reason::TooLarge,
            format!("{} bytes as JSON, with its defaults", text.len()),
            format!("at most {MOST_PROBLEM_BYTES} bytes: it is read for each evaluation"),
            "Upload the mesh once (POST /v1/meshes), and name it as `stored`.",
        ));
    }
    if let Some(length) = title.as_ref().map(|title| title.chars().count())
        && length > MAX_TITLE
    {
        found.add(Violation::new(
            "/title",
            Reason::TooLong,
            format!("{length} characters"),
            format!("at most {MAX_TITLE} characters"),
            "Shorten it.",
        ));
    }
    let sizes: Vec<usize> = inputs.iter().map(Vec::len).collect();
    let input_violation = counted("/inputs", &sizes, MOST_INPUTS, "JSON Pointers");
    // in a text or of a number that are refused anyway, none is looked for
    let looked_for = input_violation.is_empty() && text.len() <= MOST_PROBLEM_BYTES;
    found.extend(input_violation);
    let mut base_input = vec![];
    if looked_for {
        let placed = inputs.iter().enumerate().flat_map(|(vector, pointers)| {
            let pointers = pointers.iter().enumerate();
            pointers.map(move |(k, pointer)| (format!("/inputs/{vector}/{k}"), pointer.as_str()))
        });
        match Parametrised::new(&text, placed) {
            Ok(parametrised) => base_input = in_vectors(parametrised.own(), &sizes),
            Err(more) => found.extend(more),
        }
    }
    let sizes: Vec<usize> = outputs.iter().map(Output::size).collect();
    found.extend(counted("/outputs", &sizes, MOST_OUTPUTS, "numbers"));
    let boundaries = boundaries(&problem);
    for (k, output) in outputs.iter().enumerate().take(MOST_VECTORS) {
        check_output(&format!("/outputs/{k}"), output, &boundaries, &mut found);
    }
    let description = Description {
        title,
        inputs,
        outputs,
        base_input,
    };
    let bytes = serde_json::to_string(&description).map_err(ApiError::internal)?;
    if bytes.len() > MOST_DESCRIPTION_BYTES {
        found.add(Violation::new(
            "/outputs",
            Reason::TooLarge,
            format!("{} bytes as JSON, together with the inputs", bytes.len()),
            format!("at most {MOST_DESCRIPTION_BYTES} bytes"),
            "Name fewer numbers, or register several models.",
        ));
    }
    found
        .into_result((description, text))
        .map_err(ApiError::InvalidProblem)
}

/// What is wrong with the numbers of vectors and of what is in them.
fn counted(at: &str, sizes: &[usize], most: usize, what: &str) -> Vec<Violation> {
    let mut found = vec![];
    let (vectors, all) = (
        sizes.len(),
        sizes
            .iter()
            .fold(0, |sum: usize, size| sum.saturating_add(*size)),
    );
    if vectors == 0 || vectors > MOST_VECTORS {
        found.push(Violation::new(
            at,
            if vectors == 0 {
                Reason::TooFew
            } else {
                Reason::TooMany
            },
            format!("{vectors} vectors"),
            format!("1 … {MOST_VECTORS} vectors"),
            "Each item of the list is a vector.",
        ));
    } else if all > most {
        found.push(Violation::new(
            at,
            Reason::TooMany,
            format!("{all} {what}"),
            format!("at most {most} in all vectors together"),
            "Leave some out, or register several models.",
        ));
    }
    let empty = sizes.iter().take(MOST_VECTORS).enumerate();
    for (k, _) in empty.filter(|(_, size)| **size == 0) {
        found.push(Violation::new(
            format!("{at}/{k}"),
            Reason::TooFew,
            "an empty vector",
            format!("at least one of its {what}"),
            "Leave the vector out, or write what belongs in it.",
        ));
    }
    found
}

/// What is wrong with a vector of outputs.
fn check_output(at: &str, output: &Output, boundaries: &[&str], found: &mut Findings) {
    let unknown_boundary = |at: String, name: &str| {
        let hint = files::meant(name, boundaries.iter().copied());
        Violation::new(
            at,
            Reason::UnknownBoundary,
            format!("{:?}", quoted(name)),
            format!(
                "a contact boundary of the problem: {}",
                boundaries.join(", ")
            ),
            hint.unwrap_or_else(|| "Only boundaries with a contact have a profile.".into()),
        )
    };
    match output {
        Output::Scalars { scalars } => {
            for (k, path) in scalars.iter().enumerate() {
                let at = format!("{at}/scalars/{k}");
                match Scalar::parse(path) {
                    None => found.add(Violation::new(
                        at,
                        Reason::UnknownName,
                        format!("{:?}", quoted(path)),
                        Scalar::expected(),
                        "These are the numbers of `summary` in GET /v1/jobs/{id}/result.",
                    )),
                    Some(scalar) => found.extend(
                        scalar
                            .boundary()
                            .filter(|name| !boundaries.contains(name))
                            .map(|name| unknown_boundary(at, name)),
                    ),
                }
            }
        }
        Output::Profile {
            profile, points, ..
        } => {
            if !boundaries.contains(&profile.as_str()) {
                found.add(unknown_boundary(format!("{at}/profile"), profile));
            }
            if !POINTS.0.contains(&i64::from(*points)) {
                found.add(Violation::new(
                    format!("{at}/points"),
                    Reason::OutOfRange,
                    points,
                    POINTS.expected(),
                    "They are evenly spaced in arc length, and both ends are among them.",
                ));
            }
        }
    }
}

/// The words for the columns of a profile.
pub fn quantities() -> String {
    let words: Vec<&str> = Quantity::VARIANTS.iter().map(|one| (*one).into()).collect();
    words.join(", ")
}

/// A model with its problem.
pub async fn get(service: &Service, caller: &Caller, name: &str) -> Result<WholeModel, ApiError> {
    let load = async { with_problem(service, caller, name).await };
    let read = |(model, problem): (Model, String)| {
        let problem = serde_json::from_str(&problem).map_err(ApiError::internal)?;
        Ok(WholeModel { model, problem })
    };
    service.work_on(load, read).await?
}

/// A model, with its problem as JSON.
pub(super) async fn with_problem(
    service: &Service,
    caller: &Caller,
    name: &str,
) -> Result<(Model, String), ApiError> {
    let (owners, own) = (caller.visible_owners(), caller.owner());
    let found = service.store.model_with_problem(owners, own, name);
    found.await?.ok_or_else(|| unknown(name))
}

/// The name of the only list of models, for its page tokens.
const LIST: &str = "models";

/// Lists models, newest first.
pub async fn list(
    service: &Service,
    caller: &Caller,
    paging: &Paging,
) -> Result<Page<Model>, ApiError> {
    let before = paging.cursor(LIST)?.map(|cursor| cursor.key);
    let owners = caller.visible_owners();
    let models = service.store.models(owners, before, paging.limit()).await?;
    let at = |model: &Model| Cursor {
        micros: model.created_at.micros(),
        key: model.key,
    };
    Ok(paging.page(LIST, models, at))
}

/// Removes a model; jobs that it has made stay.
pub async fn delete(service: &Arc<Service>, caller: &Caller, name: &str) -> Result<(), ApiError> {
    let (service, caller, name) = (service.clone(), caller.clone(), name.to_owned());
    detached(async move {
        let (owners, own) = (caller.visible_owners(), caller.owner());
        let found = service.store.model(owners, own, &name).await?;
        let model = found.ok_or_else(|| unknown(&name))?;
        match service.store.delete_model(model.key).await? {
            true => Ok(()),
            false => Err(unknown(&name)),
        }
    })
    .await
}

fn unknown(name: &str) -> ApiError {
    ApiError::NotFound(format!("there is no model {:?}", quoted(name)))
}
