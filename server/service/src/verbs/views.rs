//! Operations that return what a program needs to draw a body by itself: of a job, of a problem before it is one, of a stored
//! mesh. Views are compact arrays (`files::plot::view`); also the operation that tells a problem in words.

use std::{collections::BTreeMap, sync::Arc};

use base::{
    caller::Caller,
    digest,
    job::{Job, JobId, ResultAvailable},
    mesh::MeshInfo,
    values::Words,
};
use files::plot::{
    ViewField,
    view::{self, NoView},
};
use futures_util::future::BoxFuture;
use sha2::{Digest, Sha256};
use solver::{
    error::Violation,
    mesh::Mesh,
    problem::Problem,
    solution::{ContactProfile, Fields},
};

use super::{
    fields, jobs, meshes, problems, profiles,
    results::{Found, read, with_result},
    service::Service,
};
use crate::{
    error::ApiError,
    parameters::Variable,
    violations::{PROBLEM, prefixed},
};

/// A field of a view in a path.
pub const FIELD: Variable<Words<ViewField>> = Variable {
    name: "field",
    kind: "field",
    meaning: "The field: displacement, von_mises, a stress, a principal stress, the contact state at each corner, or the error of each element",
    values: Words::all(),
};

/// Returns the body of a job with what is around it: of its result, or of its problem while it has none. `partial`: whether that
/// of a job without a solution will do.
pub fn of_job<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    id: JobId,
    partial: bool,
) -> BoxFuture<'a, Result<Found<Vec<u8>>, ApiError>> {
    Box::pin(async move {
        let job = jobs::get(service, caller, id).await?;
        let shows_result = job.result_available != ResultAvailable::None
            && (partial || !job.status.is_without_solution());
        // before there is a permit to work: who has that must not wait for memory
        let fields = if shows_result {
            fields::load(service, job.key).await?
        } else {
            None
        };
        let load = async {
            let stored = service.store.problem(job.key).await?;
            let (title, body) = stored.ok_or(ApiError::Deleted(id))?;
            let problem = Problem {
                title,
                ..read(body.as_bytes())?
            };
            // the names of boundaries are those of the problem's own mesh
            let mesh = match problem.mesh.stored() {
                Some(hash) => Some(service.store.mesh_body(hash).await?.ok_or_else(|| {
                    ApiError::NotFound(format!(
                        "the body of {id} cannot be drawn: the stored mesh {hash} was deleted"
                    ))
                })?),
                None => None,
            };
            let columns = match &fields {
                Some(_) => columns(service, caller, id).await?,
                None => vec![],
            };
            Ok((problem, mesh, columns))
        };
        let shown = fields.clone();
        let draw = move |(problem, mesh, columns): Drawn| {
            let mesh =
                mesh.map(|bytes| base::mesh::read_stored(&bytes).map_err(ApiError::internal));
            let mesh: Option<Mesh> = mesh.transpose()?;
            let mut profiles: BTreeMap<String, ContactProfile> = BTreeMap::new();
            for (boundary, bytes) in columns {
                profiles.insert(boundary, read(&bytes)?);
            }
            let fields: Option<&Fields> = shown.as_ref().map(|loaded| &loaded.fields);
            view::geometry(&problem, mesh.as_ref(), fields, &profiles)
                .map_err(|reason| ApiError::NotFound(format!("{id} has no view: {reason}")))
        };
        let content = service.work_on(load, draw).await??;
        Ok(Found::new(job.result_available, content))
    })
}

/// What the view of a job is drawn from, in its stored form: the problem, its stored mesh, its profiles.
type Drawn = (Problem, Option<Vec<u8>>, Vec<(String, Vec<u8>)>);

/// The profiles of a job at all points, in their stored form.
async fn columns(
    service: &Service,
    caller: &Caller,
    id: JobId,
) -> Result<Vec<(String, Vec<u8>)>, ApiError> {
    let mut found = with_result(service, caller, id).await?;
    let mut columns = vec![];
    for boundary in found.profiled_boundaries().await? {
        let bytes = profiles::at_all_points(&mut found, &boundary, None).await?;
        columns.extend(bytes.map(|bytes| (boundary, bytes)));
    }
    Ok(columns)
}

/// Returns one field of the result of a job, at the corners of the elements of its view.
pub fn field_of_job<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    id: JobId,
    field: ViewField,
    partial: bool,
) -> BoxFuture<'a, Result<Found<Vec<u8>>, ApiError>> {
    fields::written_fields(service, caller, id, partial, move |loaded| {
        view::field(&loaded.fields, field)
    })
}

/// Returns a stored mesh.
pub fn of_mesh<'a>(
    service: &'a Service,
    caller: &'a Caller,
    hash: &'a str,
) -> BoxFuture<'a, Result<Vec<u8>, ApiError>> {
    Box::pin(async move {
        meshes::get(service, caller, hash).await?; // not found, in place of invalid
        let (_, mesh): (MeshInfo, Mesh) = meshes::load(service, caller, hash).await?;
        let drawn = service.work(move || view::mesh_geometry(&mesh));
        drawn.await?.map_err(ApiError::internal)
    })
}

/// Returns the body of a problem with what is around it; an error with the violations of an invalid problem. Nothing is stored.
pub fn of_problem<'a>(
    service: &'a Service,
    caller: &'a Caller,
    problem: Result<Problem, Vec<Violation>>,
) -> BoxFuture<'a, Result<Vec<u8>, ApiError>> {
    Box::pin(async move {
        let problem = problem.map_err(ApiError::InvalidProblem)?;
        let stored = problems::stored(service, caller, &problem).await?;
        let budget_bytes = service.largest_job_bytes();
        let draw = move || {
            let stored = problems::first_mesh_within(&problem, stored, budget_bytes)?;
            view::geometry(&problem, stored.as_ref(), None, &BTreeMap::new()).map_err(|reason| {
                match reason {
                    NoView::Invalid(violations) => {
                        ApiError::InvalidProblem(prefixed(PROBLEM, violations))
                    }
                    NoView::Misfit(reason) => ApiError::internal(reason),
                }
            })
        };
        service.work(draw).await?
    })
}

/// Tells the problem of a job in words.
pub fn description<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    id: JobId,
) -> BoxFuture<'a, Result<String, ApiError>> {
    Box::pin(async move {
        let problem = jobs::problem(service, caller, id).await?;
        Ok(files::plot::description(&problem))
    })
}

/// The tag of what is drawn of a job that has ended: it changes only if its fields are deleted, so that a client that has it need not be sent it, and
/// it need not be drawn again. `what`: the figure or field with all its parameters. `None` for a job that may still change.
pub fn tag_of(job: &Job, what: &str) -> Option<String> {
    job.status.is_terminal().then(|| {
        let text = format!(
            "{} {} {} {:?} {what}",
            env!("CARGO_PKG_VERSION"),
            job.id,
            job.version,
            // less once the fields are deleted, which makes no new version
            job.stored_bytes
        );
        digest::hex(&Sha256::digest(text))
    })
}
