//! Figures of a job's problem and result.

use std::{collections::BTreeMap, sync::Arc};

use serde::de::DeserializeOwned;
use solver::{
    io::plot::{self, Parts, Plot, Style},
    problem::Problem,
    solution::{ContactProfile, Fields, Iteration},
};

use super::{Service, meshes, results};
use crate::{error::ApiError, job::JobId};

/// One figure as SVG, drawn from what the store keeps. Only the parts that it needs are read.
pub async fn plot(
    service: &Arc<Service>,
    id: JobId,
    plot: Plot,
    style: Style,
) -> Result<String, ApiError> {
    let job = results::finished(service, id).await?;
    let store = &service.store;
    let (title, problem) = store.problem(job.key).await?;
    let mut columns: Vec<(String, Vec<u8>)> = vec![];
    if matches!(plot, Plot::Profile | Plot::Deformed) {
        for boundary in store.profiled_boundaries(job.key).await? {
            if let Some(bytes) = store.profile(job.key, &boundary, None).await? {
                columns.push((boundary, bytes));
            }
        }
    }
    let history = match plot {
        Plot::Convergence => store.part(job.key, "history").await?,
        _ => None,
    };
    let fields = match plot {
        Plot::Mesh | Plot::Deformed => store.part(job.key, "fields").await?,
        _ => None,
    };
    if plot == Plot::Deformed && fields.is_none() {
        // A canceled job keeps its history and profiles, but no fields.
        return Err(ApiError::NoResult(job.status.as_str()));
    }
    let problem: Problem = Problem {
        title,
        ..read(problem.as_bytes())?
    };
    let stored = match &problem.mesh.stored {
        Some(hash) if plot == Plot::Mesh => Some(meshes::load(service, hash).await?.1),
        _ => None,
    };
    let draw = move || {
        let mut profiles: BTreeMap<String, ContactProfile> = BTreeMap::new();
        for (boundary, bytes) in columns {
            profiles.insert(boundary, read(&bytes)?);
        }
        let history: Vec<Iteration> = history.map_or(Ok(vec![]), |bytes| read(&bytes))?;
        let fields = fields.map_or(Ok(Fields::default()), |bytes| read(&bytes))?;
        let parts = Parts {
            history: &history,
            profiles: &profiles,
            fields: &fields,
            stored: stored.as_ref(),
        };
        plot::draw(plot, style, &problem, &parts).map_err(|reason| {
            ApiError::NotFound(format!("{id} has no plot {}: {reason}", plot.as_str()))
        })
    };
    service.work(draw).await?
}

fn read<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, ApiError> {
    serde_json::from_slice(bytes).map_err(ApiError::internal)
}
