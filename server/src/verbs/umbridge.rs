//! What UM-Bridge asks of a registered model: numbers of the result of its problem, for given inputs, and differences of
//! them. Each evaluation is a job like any other, in the same queue and cache, and under the same quotas.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use files::sweep::Parametrised;
use futures_util::future::try_join_all;
use solver::{
    error::{Violation, rounded, shortened},
    problem::Problem,
    solution::Residuals,
};
use strum::IntoStaticStr;
use tokio::sync::Mutex;

use super::{
    envelope::{Envelope, JobRequest},
    models,
    profiles::{self, Points},
    results,
    service::Service,
    submit,
    watch::{self, MAX_WAIT_S, Until},
};
use crate::{
    caller::Caller,
    error::ApiError,
    job::{Job, JobId, Status},
    model::{Description, Model, Output, Scalar, Stress},
    transfer::Received,
    violations::{PROBLEM, quoted},
};

/// Why a model was not evaluated.
#[derive(Debug)]
pub enum ModelError {
    /// An error of the protocol, and what happened in this case.
    Protocol(Kind, String),
    /// Any other.
    Service(ApiError),
}

/// The errors of the protocol, by the names that it gives them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, IntoStaticStr)]
pub enum Kind {
    /// There is no model of that name.
    ModelNotFound,
    /// The request is not one that the model can answer.
    InvalidInput,
    /// The model does not support what is asked.
    UnsupportedFeature,
    /// The model has no output at this input.
    InvalidOutput,
}

impl From<ApiError> for ModelError {
    fn from(error: ApiError) -> Self {
        ModelError::Service(error)
    }
}

/// An input that cannot be one.
pub fn invalid(message: impl Into<String>) -> ModelError {
    ModelError::Protocol(Kind::InvalidInput, message.into())
}

type Answer<T> = Result<T, ModelError>;

/// One vector of inputs, and one of outputs.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    /// The vector of outputs.
    pub out_wrt: i64,
    /// The vector of inputs.
    pub in_wrt: i64,
}

/// A registered model, ready to be evaluated.
struct Ready {
    description: Description,
    name: String,
    parametrised: Parametrised,
    /// Bytes of its problem as JSON.
    bytes: usize,
    /// The residual that its problems are solved to.
    tolerance: f64,
}

/// The names of the caller's models, in order.
pub async fn names(service: &Service, caller: &Caller) -> Result<Vec<String>, ApiError> {
    const AT_ONCE: i64 = 100; // an administrator sees those of all
    let owners = caller.visible_owners();
    let (mut names, mut before) = (BTreeSet::new(), None);
    loop {
        let some = service.store.models(owners, before, AT_ONCE).await?;
        let Some(last) = some.last() else {
            return Ok(names.into_iter().collect());
        };
        before = Some(last.key);
        names.extend(some.into_iter().map(|model| model.name));
    }
}

/// The model of this name.
pub async fn model(service: &Service, caller: &Caller, name: &str) -> Answer<Model> {
    let (owners, own) = (caller.visible_owners(), caller.owner());
    match service
        .store
        .model(owners, own, name)
        .await
        .map_err(ApiError::from)?
    {
        Some(model) => Ok(model),
        None => Err(not_found(service, caller, name).await?),
    }
}

async fn not_found(service: &Service, caller: &Caller, name: &str) -> Result<ModelError, ApiError> {
    const SHOWN: i64 = 20;
    let owners = caller.visible_owners();
    let latest = service.store.models(owners, None, SHOWN).await?;
    let names: Vec<&str> = latest.iter().map(|model| model.name.as_str()).collect();
    let known = match names.is_empty() {
        true => "none is registered: PUT /v1/models/{name} registers one".to_owned(),
        false => format!(
            "the latest are: {} (GET /v1/models lists all)",
            shortened(&names.join(", "), 500)
        ),
    };
    let message = format!("there is no model {:?}; {known}", quoted(name));
    Ok(ModelError::Protocol(Kind::ModelNotFound, message))
}

async fn ready(service: &Service, caller: &Caller, name: &str) -> Answer<Ready> {
    // loaded once there is a permit
    let load = async {
        match models::with_problem(service, caller, name).await {
            Ok(found) => Ok(Some(found)),
            Err(ApiError::NotFound(_)) => Ok(None),
            Err(error) => Err(error),
        }
    };
    let read = |found: Option<(Model, String)>| -> Result<Option<Ready>, ApiError> {
        let Some((
            Model {
                name, description, ..
            },
            text,
        )) = found
        else {
            return Ok(None);
        };
        let problem: Problem = serde_json::from_str(&text).map_err(ApiError::internal)?;
        let pointers = description.inputs.iter().flatten();
        let pointers = pointers.map(|pointer| (String::new(), pointer.as_str()));
        // it was read when the model was registered
        let parametrised = Parametrised::new(&text, pointers).map_err(|found| {
            ApiError::internal(format!(
                "the inputs of the model {name} lead nowhere: {found:?}"
            ))
        })?;
        Ok(Some(Ready {
            description,
            name,
            parametrised,
            bytes: text.len(),
            tolerance: problem.solver.tolerance,
        }))
    };
    match service.work_on(load, read).await?? {
        Some(ready) => Ok(ready),
        None => Err(not_found(service, caller, name).await?),
    }
}

/// The outputs at this input.
pub async fn evaluate(
    service: &Arc<Service>,
    caller: &Caller,
    name: &str,
    input: Vec<Vec<f64>>,
) -> Answer<Vec<Vec<f64>>> {
    let ready = ready(service, caller, name).await?;
    check_input(&ready.description, &input)?;
    let points = vec![input.concat()];
    let mut found = solved(ready, service, caller, points, |outputs| outputs).await?;
    let found = found
        .pop()
        .ok_or_else(|| ApiError::internal("an evaluation has no output"))?;
    Ok(found.kept)
}

/// A derivative at this input, by central differences: the gradient for weights, the one along it for a direction.
pub async fn derivative(
    service: &Arc<Service>,
    caller: &Caller,
    name: &str,
    pair: Pair,
    input: Vec<Vec<f64>>,
    with: With,
) -> Answer<Vec<f64>> {
    let ready = ready(service, caller, name).await?;
    // the model may be another one since the request was checked
    let vectors = check_derivative(&ready.description, pair, &input, &with)?;
    let at = input.concat();
    match with {
        With::Sens(sens) => gradient(service, caller, ready, vectors, at, sens).await,
        With::Vec(vec) => along(service, caller, ready, vectors, at, vec).await,
    }
}

/// Jᵀ s: the derivatives of s · F by the numbers of one vector of inputs, where F is one vector of outputs. From two jobs for
/// each number.
async fn gradient(
    service: &Arc<Service>,
    caller: &Caller,
    ready: Ready,
    Vectors { out, range }: Vectors,
    at: Vec<f64>,
    sens: Vec<f64>,
) -> Answer<Vec<f64>> {
    let steps: Vec<f64> = range
        .clone()
        .map(|k| ready.step() * ready.size(&at, k))
        .collect();
    let moved = |k: usize, by: f64| {
        let mut point = at.clone();
        point[k] += by;
        point
    };
    let pairs = range.clone().zip(&steps);
    let points: Vec<Vec<f64>> = pairs
        .flat_map(|(k, step)| [moved(k, *step), moved(k, -step)])
        .collect();
    // what the steps are once they are added: numbers are rounded
    let widths = range
        .enumerate()
        .map(|(n, k)| points[2 * n][k] - points[2 * n + 1][k]);
    let widths: Vec<f64> = widths.collect();
    let objective = |outputs: Vec<Vec<f64>>| -> f64 {
        let weighted = outputs[out].iter().zip(&sens);
        weighted.map(|(number, s)| s * number).sum()
    };
    let step = ready.step();
    let found = solved(ready, service, caller, points, objective).await?;
    let mut derivatives = vec![];
    for (ends, width) in found.chunks_exact(2).zip(widths) {
        comparable(&ends[0], &ends[1], step)?;
        derivatives.push((ends[0].kept - ends[1].kept) / width);
    }
    finite(derivatives)
}

/// J v: the derivative of one vector of outputs along v in one vector of inputs. From two jobs.
async fn along(
    service: &Arc<Service>,
    caller: &Caller,
    ready: Ready,
    Vectors { out, range }: Vectors,
    at: Vec<f64>,
    vec: Vec<f64>,
) -> Answer<Vec<f64>> {
    // no number moves by more than the step that a gradient takes for it, and one by as much
    let parts = range
        .clone()
        .zip(&vec)
        .map(|(k, v)| (v / ready.size(&at, k)).abs());
    let largest = parts.fold(0.0, f64::max);
    let t = match largest {
        0.0 => 1.0, // both ends are the point itself
        f64::INFINITY => {
            return Err(invalid(
                "vec is too large: its numbers are scaled to a step",
            ));
        }
        largest => ready.step() / largest,
    };
    if !t.is_finite() {
        return Err(invalid(
            "vec is too small: its numbers are scaled to a step",
        ));
    }
    let moved = |by: f64| {
        let mut point = at.clone();
        for (k, v) in range.clone().zip(&vec) {
            point[k] += by * v;
        }
        point
    };
    let points = vec![moved(t), moved(-t)];
    let step = ready.step();
    let one = |mut outputs: Vec<Vec<f64>>| outputs.swap_remove(out);
    let found = solved(ready, service, caller, points, one).await?;
    comparable(&found[0], &found[1], step)?;
    let ends = found[0].kept.iter().zip(&found[1].kept);
    finite(
        ends.map(|(plus, minus)| (plus - minus) / (2.0 * t))
            .collect(),
    )
}

/// No model has second derivatives: a difference of differences would be mostly rounding.
pub async fn apply_hessian(service: &Service, caller: &Caller, name: &str) -> Answer<Vec<f64>> {
    model(service, caller, name).await?;
    Err(unsupported(
        "ApplyHessian is",
        "second derivatives are not computed",
    ))
}

/// An error if no derivatives of a model are supported.
pub fn supports_derivatives(model: &Model) -> Answer<()> {
    match model.description.has_differences() {
        true => Ok(()),
        false => Err(unsupported(
            "Gradient and ApplyJacobian are",
            "the problem of the model has 0 at an input, so that no size is known from which to take the step of a difference; \
             register it with a number of usual size there",
        )),
    }
}

fn unsupported(what: &str, why: &str) -> ModelError {
    let message = format!("{what} not supported: {why}");
    ModelError::Protocol(Kind::UnsupportedFeature, message)
}

fn no_output(message: String) -> ModelError {
    ModelError::Protocol(Kind::InvalidOutput, message)
}

fn wrong_length(what: &str, got: usize, expected: usize, of: &str) -> ModelError {
    invalid(format!(
        "{what} has {got} numbers; expected {expected}, as {of} has"
    ))
}

/// A derivative, unless a number is beyond double precision.
fn finite(numbers: Vec<f64>) -> Answer<Vec<f64>> {
    match numbers.iter().all(|number| number.is_finite()) {
        true => Ok(numbers),
        false => Err(invalid(
            "the derivative is beyond double precision: scale sens or vec down",
        )),
    }
}

/// Where in all numbers a pair of vectors is.
#[derive(Debug)]
pub struct Vectors {
    out: usize,
    /// The numbers of the vector of inputs among all inputs.
    range: std::ops::Range<usize>,
}

/// What came of one job.
struct Evaluation<T> {
    job: JobId,
    /// The outputs, or what is kept of them.
    kept: T,
    /// Of the body, and on the contact boundaries.
    unknowns: [u64; 2],
    residuals: Residuals,
}

/// An error if a model does not take this input.
pub fn check_input(description: &Description, input: &[Vec<f64>]) -> Answer<()> {
    let sizes = description.input_sizes();
    if input.len() != sizes.len() {
        let (got, expected) = (input.len(), sizes.len());
        return Err(invalid(format!(
            "input has {got} vectors; the model takes {expected}"
        )));
    }
    for (k, (vector, size)) in input.iter().zip(sizes).enumerate() {
        if vector.len() != size {
            return Err(wrong_length(
                &format!("input {k}"),
                vector.len(),
                size,
                "the model",
            ));
        }
    }
    Ok(())
}

/// What a derivative is taken with.
#[derive(Debug)]
pub enum With {
    /// Weights of outputs.
    Sens(Vec<f64>),
    /// A direction of inputs.
    Vec(Vec<f64>),
}

/// Checks a request for a derivative of a model that has some.
pub fn check_derivative(
    description: &Description,
    pair: Pair,
    input: &[Vec<f64>],
    with: &With,
) -> Answer<Vectors> {
    check_input(description, input)?;
    let index = |name: &str, got: i64, count: usize| match usize::try_from(got) {
        Ok(index) if index < count => Ok(index),
        _ => Err(invalid(format!(
            "{name} is {got}; expected 0 … {}",
            count.saturating_sub(1)
        ))),
    };
    let (inputs, outputs) = (description.input_sizes(), description.output_sizes());
    let out = index("outWrt", pair.out_wrt, outputs.len())?;
    let of = index("inWrt", pair.in_wrt, inputs.len())?;
    let (name, got, expected, whose) = match with {
        With::Sens(sens) => ("sens", sens.len(), outputs[out], format!("output {out}")),
        With::Vec(vec) => ("vec", vec.len(), inputs[of], format!("input {of}")),
    };
    if got != expected {
        return Err(wrong_length(name, got, expected, &whose));
    }
    let start: usize = inputs[..of].iter().sum();
    Ok(Vectors {
        out,
        range: start..start + inputs[of],
    })
}

/// An error unless the difference of two solutions is one of the problem, and not of their meshes or of what rounding leaves: a
/// residual r puts the derivative off by some r/step of its size, and may do so by as much as the step is.
fn comparable<T>(one: &Evaluation<T>, other: &Evaluation<T>, step: f64) -> Answer<()> {
    if one.unknowns != other.unknowns {
        let (a, b) = (one.unknowns, other.unknowns);
        let why = format!(
            "{} and {}, the ends of a step, have {} and {} unknowns ({} and {} on contacts), so that their difference is not a \
             derivative: the problem is refined until its result is accurate, or an input changes the mesh or the contact \
             boundary; register it with a number for `mesh.refine`, and take no derivative by such an input",
            one.job, other.job, a[0], b[0], a[1], b[1]
        );
        return Err(unsupported("A derivative at this input is", &why));
    }
    for end in [one, other] {
        let Residuals {
            kkt,
            friction,
            monolithic,
            ..
        } = end.residuals;
        let residual = kkt.max(friction).max(monolithic);
        if residual > step * step {
            let why = format!(
                "{} has a residual of {residual:.1e}, where rounding ended its iterations: a difference with a step of {step:.1e} \
                 would be off by {:.1e} of its size; register the problem with a tolerance of {residual:.0e} or more, which \
                 makes the step larger",
                end.job,
                residual / step
            );
            return Err(unsupported("A derivative at this input is", &why));
        }
    }
    Ok(())
}

impl Ready {
    /// The step of a central difference, relative to the size of a number: the cube root of the precision of the function,
    /// which here is the tolerance of the solver and not that of the machine. A step h has an error of h² from the curvature,
    /// and of tolerance/h from what the solver leaves; at this step both are alike, some 2e-7 for a tolerance of 1e-10.
    fn step(&self) -> f64 {
        self.tolerance.cbrt()
    }

    /// The size of an input: at least that of the number that the problem itself has, so that steps at and around 0 are sound.
    fn size(&self, at: &[f64], k: usize) -> f64 {
        at[k].abs().max(self.parametrised.own()[k].abs())
    }
}

/// What is kept of the outputs at each of these points, from jobs that are submitted together. Each is read as soon as it has
/// ended, since it may be deleted before the last one has, but one at a time: outputs may be large. The first one without
/// outputs ends the wait.
async fn solved<T>(
    ready: Ready,
    service: &Arc<Service>,
    caller: &Caller,
    points: Vec<Vec<f64>>,
    keep: impl Fn(Vec<Vec<f64>>) -> T,
) -> Answer<Vec<Evaluation<T>>> {
    let (jobs, outputs) = submitted(ready, service, caller, points).await?;
    let (outputs, keep, reading) = (&outputs, &keep, &Mutex::new(()));
    let evaluations = jobs.into_iter().map(|id| async move {
        let job = ended(service, caller, id).await?;
        let _turn = reading.lock().await;
        evaluation(service, caller, outputs, &job, keep).await
    });
    try_join_all(evaluations).await
}

/// Submits a job for each of these points, all or none; what to read of their results. Of the rest nothing is kept: to wait
/// for them may take long.
async fn submitted(
    ready: Ready,
    service: &Arc<Service>,
    caller: &Caller,
    points: Vec<Vec<f64>>,
) -> Answer<(Vec<JobId>, Vec<Output>)> {
    let Ready {
        description: Description {
            inputs, outputs, ..
        },
        name,
        parametrised,
        bytes,
        tolerance: _,
    } = ready;
    // what is made of a small request counts as if a client had sent it
    let received = Received::new(&service.received);
    received.count(bytes.saturating_mul(points.len()))?;
    let made = service.work(move || {
        let problems = points.iter().map(|point| parametrised.problem(point));
        let problems: Vec<_> = problems.collect();
        (problems, points)
    });
    let (problems, points) = made.await?;
    // as any job; its name and label tell the model
    let envelope = Envelope {
        name: Some(format!("model {name}")),
        labels: BTreeMap::from([("model".to_owned(), name)]),
        ..Envelope::default()
    };
    let mut requests = vec![];
    for (problem, point) in problems.into_iter().zip(&points) {
        let problem = problem.map_err(|violations| refused(&inputs, point, &violations, ""))?;
        requests.push(JobRequest {
            envelope: envelope.clone(),
            problem: Ok(problem),
        });
    }
    let submitted = submit::create_batch(service, caller, requests, None).await;
    let submitted = submitted.map_err(|error| match error {
        ApiError::InvalidProblem(violations) => {
            // /jobs/{n}/problem/…
            let first = violations
                .first()
                .map_or("", |violation| violation.pointer.as_str());
            let number = first.split('/').nth(2).unwrap_or_default();
            let point = number.parse().ok().and_then(|n: usize| points.get(n));
            let point = point.map_or(&[][..], Vec::as_slice);
            // those of the first job that is invalid; others have other inputs
            let prefix = format!("/jobs/{number}");
            let of_this_job = violations.into_iter().filter_map(|violation| {
                let inside = violation.pointer.strip_prefix(&prefix)?.to_owned();
                (inside.is_empty() || inside.starts_with('/')).then(|| {
                    models::of_problem(Violation {
                        pointer: inside,
                        ..violation
                    })
                })
            });
            let of_this_job: Vec<Violation> = of_this_job.collect();
            refused(&inputs, point, &of_this_job, PROBLEM)
        }
        other => other.into(),
    })?;
    let jobs = submitted.accepted.iter().map(|job| job.id);
    Ok((jobs.collect(), outputs))
}

/// The problem at a point is invalid.
fn refused(
    inputs: &[Vec<String>],
    point: &[f64],
    violations: &[Violation],
    prefix: &str,
) -> ModelError {
    const SHOWN: usize = 3;
    let told = violations.iter().take(SHOWN).map(|violation| {
        let pointer = violation.pointer.strip_prefix(prefix);
        let violation = Violation {
            pointer: pointer.unwrap_or(&violation.pointer).to_owned(),
            ..violation.clone()
        };
        shortened(&violation.to_string(), 300)
    });
    let told: Vec<String> = told.collect();
    let inputs = inputs.iter().flatten().zip(point);
    let inputs =
        inputs.map(|(pointer, number)| format!("{} = {:?}", quoted(pointer), rounded(*number)));
    let inputs: Vec<String> = inputs.collect();
    let inputs = shortened(&inputs.join(", "), 600);
    invalid(format!(
        "the problem with {inputs} is invalid: {}",
        told.join(" | ")
    ))
}

/// The job when it has ended, however long that takes; a client that does not wait leaves it as it is.
async fn ended(service: &Service, caller: &Caller, id: JobId) -> Result<Job, ApiError> {
    loop {
        let wait = watch::wait(service, caller, id, Until::Terminal, MAX_WAIT_S);
        match wait.await? {
            (job, true) => return Ok(job),
            (_, false) => service.accepting()?,
        }
    }
}

/// What came of a job that has ended. Without a converged solution it is an error.
async fn evaluation<T>(
    service: &Service,
    caller: &Caller,
    outputs: &[Output],
    job: &Job,
    keep: impl Fn(Vec<Vec<f64>>) -> T,
) -> Answer<Evaluation<T>> {
    let id = job.id;
    if job.status != Status::Succeeded {
        let why = match (&job.failure, job.reason) {
            (Some(failure), _) => format!("{}: {}", failure.code, failure.detail),
            (None, Some(reason)) => <&str>::from(reason).to_owned(),
            (None, None) => "without a reason".to_owned(),
        };
        return Err(no_output(format!("{id} {}: {why}", job.status)));
    }
    let summary = results::result(service, caller, id)
        .await?
        .content
        .summary
        .solution;
    if !summary.converged {
        return Err(no_output(format!("{id} did not converge")));
    }
    let mut found = vec![];
    for output in outputs {
        found.push(match output {
            Output::Scalars { scalars } => {
                let numbers = scalars.iter().map(|path| {
                    let scalar = Scalar::parse(path);
                    let number = scalar.as_ref().and_then(|scalar| scalar.of(&summary));
                    number.ok_or_else(|| absent(id, path, scalar))
                });
                numbers.collect::<Answer<Vec<f64>>>()?
            }
            Output::Profile {
                profile,
                quantity,
                points,
            } => {
                let expected = *points as usize;
                let spaced = Points::Spaced(expected);
                let read = profiles::profile(service, caller, id, profile, None, spaced);
                let column = quantity.of(&read.await?.content).to_vec();
                if column.len() != expected {
                    let (got, quantity) = (column.len(), <&str>::from(*quantity));
                    return Err(no_output(format!(
                        "{id} has {got} values of {quantity} on {profile}, not {expected}"
                    )));
                }
                column
            }
        });
    }
    match found.iter().flatten().all(|number| number.is_finite()) {
        true => Ok(Evaluation {
            job: id,
            kept: keep(found),
            unknowns: [summary.dofs, summary.contact_dofs],
            residuals: summary.residuals,
        }),
        false => Err(no_output(format!("{id} has a number that is not finite"))),
    }
}

fn absent(id: JobId, path: &str, scalar: Option<Scalar>) -> ModelError {
    let why = match scalar {
        Some(Scalar::OfPeak(_, Stress::PeakTangentialStress, _)) => {
            "without friction there is none"
        }
        _ => "without contact there is none",
    };
    no_output(format!(
        "{id} succeeded, but has no {}: {why}",
        quoted(path)
    ))
}
