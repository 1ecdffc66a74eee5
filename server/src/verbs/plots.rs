//! Figures of a job's problem and result.

use std::{collections::BTreeMap, sync::Arc};

use files::plot::{self, Parts, Plot, Stress, Style, Theme};
use solver::{
    mesh::Mesh,
    problem::Problem,
    solution::{ContactProfile, Fields, Iteration, Summary},
};

use super::{
    fields,
    history::StoredHistory,
    jobs, profiles,
    results::{self, Found, read},
    service::Service,
};
use crate::{
    caller::Caller,
    error::ApiError,
    job::{Job, JobId},
    parameters::{Parameter, Variable, Words},
};

/// A figure in a path.
pub const PLOT: Variable<Words<Plot>> = Variable {
    name: "plot",
    kind: "plot",
    meaning: "Which figure",
    values: Words(|| {
        vec![
            ("mesh.svg", Plot::Mesh),
            ("deformed.svg", Plot::Deformed),
            ("profile.svg", Plot::Profile),
            ("convergence.svg", Plot::Convergence),
        ]
    }),
};

/// The colour theme of a figure.
pub const THEME: Parameter<Words<Theme>> = Parameter {
    name: "theme",
    meaning: "Colour theme; default light",
    values: Words(|| vec![("light", Theme::Light), ("dark", Theme::Dark)]),
};

/// The stress shown on a deformed body.
pub const STRESS: Parameter<Words<Stress>> = Parameter {
    name: "stress",
    meaning: "Stress shown in deformed.svg (no other plot); default von_mises",
    values: Words(|| {
        vec![
            ("von_mises", Stress::VonMises),
            ("xx", Stress::Xx),
            ("yy", Stress::Yy),
            ("zz", Stress::Zz),
            ("xy", Stress::Xy),
        ]
    }),
};

/// One figure as SVG, drawn from the stored data. Only the parts that it needs are read.
pub async fn plot(
    service: &Arc<Service>,
    caller: &Caller,
    id: JobId,
    plot: Plot,
    style: Style,
) -> Result<Found<String>, ApiError> {
    // loaded once there is a permit, so that waiting requests use no memory
    let load = async {
        let mut found = match plot {
            // these show the problem or the iterations, and so can be drawn while the job waits or runs
            Plot::Mesh | Plot::Convergence => jobs::snapshot(service, caller, id).await?,
            Plot::Profile | Plot::Deformed => results::with_result(service, caller, id).await?,
        };
        let mut columns: Vec<(String, Vec<u8>)> = vec![];
        let mut summary = None;
        if matches!(plot, Plot::Profile | Plot::Deformed) {
            for boundary in found.profiled_boundaries().await? {
                let bytes = profiles::at_all_points(&mut found, &boundary, None).await?;
                columns.extend(bytes.map(|bytes| (boundary, bytes)));
            }
            summary = found.part("summary").await?;
        }
        let history = match plot {
            Plot::Convergence => Some(StoredHistory::load(service, &mut found).await?),
            _ => None,
        };
        let job = found.job.clone();
        drop(found);
        if plot == Plot::Deformed {
            fields::are_kept(service, &job).await?;
        }
        let fields = match plot {
            Plot::Mesh | Plot::Deformed => service.store.fields(job.result_key).await?,
            _ => None,
        };
        let fields = fields.map(|(_, fields)| fields);
        if plot == Plot::Deformed && fields.is_none() {
            return Err(results::no_result(&job));
        }
        let store = &service.store;
        let stored = store.problem(job.key).await?;
        let (title, problem) = stored.ok_or(ApiError::Deleted(id))?;
        let problem: Problem = Problem {
            title,
            ..read(problem.as_bytes())?
        };
        let stored = match problem.mesh.stored() {
            Some(hash) if plot == Plot::Mesh => {
                let gone = || {
                    ApiError::NotFound(format!(
                        "the mesh of {id} cannot be drawn: the stored mesh {hash} was deleted; \
                         the plot `deformed` also shows the elements"
                    ))
                };
                Some(store.mesh_body(hash).await?.ok_or_else(gone)?)
            }
            _ => None,
        };
        Ok((job, problem, columns, summary, history, fields, stored))
    };
    let draw = move |(job, problem, columns, summary, history, fields, stored): Loaded| {
        let summary: Option<Summary> = summary.map(|bytes| read(&bytes)).transpose()?;
        let mut profiles: BTreeMap<String, ContactProfile> = BTreeMap::new();
        for (boundary, bytes) in columns {
            profiles.insert(boundary, read(&bytes)?);
        }
        let history = history.map_or(Ok(vec![]), StoredHistory::read)?;
        let history: Vec<Iteration> = history.into_iter().map(|timed| timed.row).collect();
        if plot == Plot::Convergence && history.is_empty() {
            return Err(results::no_result(&job));
        }
        let fields = fields.unwrap_or_default();
        let stored: Option<Mesh> = stored
            .map(|bytes| postcard::from_bytes(&bytes).map_err(ApiError::internal))
            .transpose()?;
        let parts = Parts {
            history: &history,
            accuracy: summary.as_ref().and_then(|s| s.accuracy.as_ref()),
            profiles: &profiles,
            fields: &fields,
            stored: stored.as_ref(),
        };
        let drawn = plot::draw(plot, style, &problem, &parts).map_err(|reason| {
            ApiError::NotFound(format!("{id} has no plot {}: {reason}", plot.as_str()))
        });
        Ok(Found {
            available: job.result_available,
            content: drawn?,
        })
    };
    service.work_on(load, draw).await?
}

/// Job, problem, profiles, summary, history, fields and stored mesh, most in their stored form; the parts that a figure does
/// not need are absent.
type Loaded = (
    Job,
    Problem,
    Vec<(String, Vec<u8>)>,
    Option<Vec<u8>>,
    Option<StoredHistory>,
    Option<Fields>,
    Option<Vec<u8>>,
);
