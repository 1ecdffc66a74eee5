//! Handing in jobs: one, one with a name of the client's, many at once.

use std::sync::Arc;

use futures_util::{StreamExt, TryStreamExt};
use solver::error::Violation;

use super::{
    Service,
    admission::{admit, checked_key, hand_in, prepare, replayed},
    envelope::Draft,
    service::detached,
};
use crate::{
    digest,
    error::ApiError,
    job::{Job, JobId},
    store::{Accepted, RequestKey},
    violations::{Violations, prefixed},
};

/// Most jobs that are handed in together.
pub const MOST_JOBS: usize = 1000;
/// What became of it.
#[derive(Debug)]
pub struct Handed<T> {
    /// The job or jobs.
    pub accepted: T,
    /// They were there already, by the key or by the name.
    pub replayed: bool,
}

/// Accepts a job. It is durable when this returns. Violations of envelope and problem come together. With
/// a key, or a name of its own, the same request gives the same job, however often it is made.
pub async fn create(
    service: &Arc<Service>,
    draft: Draft,
    id: Option<JobId>,
    key: Option<String>,
) -> Result<Handed<Job>, ApiError> {
    service.accepting()?;
    let key = key.map(checked_key).transpose()?;
    let service = service.clone();
    detached(async move {
        let prepared = prepare(&service, draft, id).await?;
        let payload = prepared.payload.clone();
        let key = key.map(|key| RequestKey { key, payload });
        if let Some(old) = replayed(&service, key.as_ref()).await? {
            return only(old, true);
        }
        // before it is looked at in depth: what was accepted once need not be acceptable now
        if let Some(id) = prepared.id
            && !prepared.payload.is_empty()
            && let Some(old) = service
                .store
                .replay_named(&service.owner(), id, &prepared.payload)
                .await?
        {
            return only(vec![old], true);
        }
        let new = admit(&service, prepared).await?;
        let Accepted { jobs, replayed, .. } = hand_in(&service, vec![new], key).await?;
        only(jobs, replayed)
    })
    .await
}

/// Accepts all of these jobs or none. Violations of all come together, with pointers `/jobs/{n}/…`.
pub async fn create_batch(
    service: &Arc<Service>,
    drafts: Vec<Draft>,
    key: Option<String>,
) -> Result<Handed<Vec<Job>>, ApiError> {
    service.accepting()?;
    let key = key.map(checked_key).transpose()?;
    if drafts.is_empty() || drafts.len() > MOST_JOBS {
        return Err(ApiError::InvalidProblem(vec![Violation {
            pointer: "/jobs".into(),
            reason: "out_of_range".into(),
            got: format!("{} jobs", drafts.len()),
            expected: "1 … 1000 jobs".into(),
            hint: match drafts.is_empty() {
                true => "Send {\"jobs\": [{\"problem\": {…}}, …]}.".into(),
                false => "Hand them in in several batches.".into(),
            },
        }]));
    }
    let service = service.clone();
    detached(async move {
        let prepared = each(drafts, |draft| prepare(&service, draft, None)).await?;
        let key = match key {
            None => None,
            Some(key) => {
                let payloads: Vec<&str> = prepared.iter().map(|job| job.payload.as_str()).collect();
                let payload = digest::of_json(&("batch", payloads)).map_err(ApiError::internal)?;
                Some(RequestKey { key, payload })
            }
        };
        if let Some(accepted) = replayed(&service, key.as_ref()).await? {
            let replayed = true;
            return Ok(Handed { accepted, replayed });
        }
        let jobs = each(prepared, |prepared| admit(&service, prepared)).await?;
        let Accepted { jobs, replayed, .. } = hand_in(&service, jobs, key).await?;
        Ok(Handed {
            accepted: jobs,
            replayed,
        })
    })
    .await
}

/// The one job of a submission of one.
pub(super) fn only(jobs: Vec<Job>, replayed: bool) -> Result<Handed<Job>, ApiError> {
    let accepted = jobs.into_iter().next();
    let accepted =
        accepted.ok_or_else(|| ApiError::internal("a job was accepted, but not given"))?;
    Ok(Handed { accepted, replayed })
}

/// Does the same with each of many, a few at a time, in order; of those that are invalid all are told.
async fn each<A, B, F: Future<Output = Result<B, ApiError>>>(
    many: Vec<A>,
    work: impl Fn(A) -> F,
) -> Result<Vec<B>, ApiError> {
    const AT_ONCE: usize = 4;
    let mut done = vec![];
    let mut violations = Violations::default();
    let numbered = many.into_iter().enumerate();
    let mut results = futures_util::stream::iter(numbered)
        .map(|(n, one)| {
            let working = work(one);
            async move { Ok::<_, ApiError>((n, working.await)) }
        })
        .buffered(AT_ONCE);
    while let Some((n, result)) = results.try_next().await? {
        match result {
            Ok(one) => done.push(one),
            Err(ApiError::InvalidProblem(found)) => {
                violations.extend(prefixed(&format!("/jobs/{n}"), found));
            }
            Err(other) => return Err(other),
        }
    }
    if violations.is_empty() {
        Ok(done)
    } else {
        Err(ApiError::InvalidProblem(violations.into_vec()))
    }
}
