//! Claims the next jobs of the queue for places where they can be solved.

use std::{collections::BTreeSet, sync::Arc};

use base::{
    failpoint::{self, Point},
    job::{Cache, Job},
    memory::{Budget, Reservation},
};

use super::{
    change::Change,
    coalescing,
    database::Store,
    end,
    error::{Result, StoreError},
    leases,
    rules::Ending,
    submission::{Claim, Place, Room},
};

/// Jobs that were claimed in one commit.
#[derive(Debug, Default)]
pub struct Claims {
    /// The jobs, each with the index of its place.
    pub claims: Vec<(usize, Claim)>,
    /// The keys of all jobs that have changed.
    pub changed: Vec<i64>,
}

impl Store {
    /// Starts an attempt of the next job of the queue in a slot of this service. Also returns the keys of all jobs that have
    /// changed.
    pub async fn claim_next(self: &Arc<Self>) -> Result<(Option<Claim>, Vec<i64>)> {
        let Claims {
            mut claims,
            changed,
        } = self.claim_for(vec![Place::Here]).await?;
        Ok((claims.pop().map(|(_, claim)| claim), changed))
    }

    /// Starts attempts of the next jobs of the queue, in the order of `turns`, at most one at each of these places. Jobs before
    /// them that an existing result can answer are ended with that result.
    pub async fn claim_for(self: &Arc<Self>, places: Vec<Place>) -> Result<Claims> {
        self.check_result_for_next().await;
        self.write(move |writer| {
            let mut change = writer.change()?;
            let claims = claim(&mut change, &places)?;
            let changed = change.commit()?;
            Ok(Claims { claims, changed })
        })
        .await
    }
}

/// The next job of the queue that is neither passed over nor damaged. Nothing in a damaged row can be trusted: such jobs wait
/// until the operator removes them, and the others go on.
fn next(change: &mut Change<'_>, passed: &mut BTreeSet<i64>) -> Result<Option<Job>> {
    while let Some(key) = change.next(passed)? {
        let found = change.read(key);
        match change.unless_damaged(found)? {
            Some(job) => return Ok(Some(job)),
            None => passed.insert(key),
        };
    }
    Ok(None)
}

/// Claims jobs within a transaction, at most one for each place, with the indices of their places.
///
/// A job that has no room at any of the places is passed over, but the places that could have room for it later, when their
/// other jobs have ended, then take no other: no large job is overtaken for ever. Running jobs end within their time limits,
/// and each job fits alone.
pub(super) fn claim(change: &mut Change<'_>, places: &[Place]) -> Result<Vec<(usize, Claim)>> {
    /// The largest number of jobs that are answered, coalesced, failed or passed over in one transaction: more would take
    /// too long.
    const MOST_OTHERS: usize = 100;
    let mut free: Vec<usize> = (0..places.len()).collect();
    let (mut passed, mut claims) = (BTreeSet::new(), vec![]);
    for _ in 0..MOST_OTHERS + places.len() {
        if free.is_empty() {
            break;
        }
        let Some(waiting) = next(change, &mut passed)? else {
            break;
        };
        // there may be a result by now
        if waiting.cache == Cache::Use
            && let Some(source) = coalescing::earlier_result(change, &waiting.input_hash)?
        {
            coalescing::answer(change, waiting.key, &source)?;
            coalescing::end_coalesced(change, waiting.key)?;
            continue;
        }
        if waiting.cache == Cache::Use && coalescing::coalesce_into_running(change, &waiting)? {
            continue;
        }
        let problem = match change.problem(&waiting) {
            Ok(problem) => problem,
            // it fails alone, and does not stop the queue
            Err(StoreError::Damaged(damage)) => {
                start(change, &waiting)?;
                end::end(change, waiting.key, &Ending::damaged(&damage))?;
                continue;
            }
            Err(error) => return Err(error),
        };
        // given back if this transaction is rolled back
        let budget = change.budget();
        let Some((place, memory)) = room(budget, places, &mut free, waiting.memory_bytes) else {
            passed.insert(waiting.key);
            continue;
        };
        let job = start(change, &waiting)?;
        if failpoint::fails(Point::Claimed, job.id) {
            return Err(StoreError::Full);
        }
        if let Some(Place::Away(lessee, _)) = places.get(place) {
            leases::note(change, &job, lessee)?;
        }
        let claim = Claim {
            mesh: job.mesh.clone(),
            job,
            problem,
            memory,
        };
        claims.push((place, claim));
    }
    Ok(claims)
}

/// Starts an attempt of a job, which is a turn of its owner.
fn start(change: &mut Change<'_>, waiting: &Job) -> Result<Job> {
    let now = change.now();
    let job = change.update(waiting.key, |row| row.start(now))?;
    change.take_turn(&job.owner)?;
    Ok(job)
}

/// Takes the first of the free places that has room for a job of this estimated memory (bytes; `None`: unknown), with the
/// memory that is reserved there if it is here. If none has, those that could have room later are no longer free.
fn room(
    budget: &Arc<Budget>,
    places: &[Place],
    free: &mut Vec<usize>,
    needed: Option<u64>,
) -> Option<(usize, Option<Reservation>)> {
    let has_room = |place: &usize| match &places[*place] {
        // a job of unknown need runs alone
        Place::Away(_, Room { whole, free }) => needed.unwrap_or(*whole) <= *free,
        Place::Here => false,
    };
    if let Some(nth) = free.iter().position(has_room) {
        return Some((free.remove(nth), None));
    }
    // a job that was accepted for a larger worker waits for that; one that was accepted for a larger budget runs alone
    let elsewhere =
        needed.is_some_and(|needed| needed > budget.bytes() && needed <= budget.elsewhere());
    let is_here = |place: &usize| places[*place] == Place::Here && !elsewhere;
    if let Some(nth) = free.iter().position(is_here)
        && let Some(memory) = budget.reserve(needed)
    {
        return Some((free.remove(nth), Some(memory)));
    }
    let could_later = |place: &usize| match &places[*place] {
        Place::Away(_, Room { whole, .. }) => needed.is_none_or(|needed| needed <= *whole),
        Place::Here => is_here(place),
    };
    free.retain(|place| !could_later(place));
    None
}
