//! Claims the next job of the queue for a worker.

use std::{collections::BTreeSet, sync::Arc};

use base::{
    failpoint::{self, Point},
    job::{Cache, Job},
};

use super::{
    change::Change,
    coalescing,
    database::Store,
    end,
    error::{Result, StoreError},
    rules::Ending,
    submission::Claim,
};

impl Store {
    /// Starts an attempt of the next job of the queue, in the order of `turns`. Jobs before it that an existing result
    /// can answer are ended with that result. Also returns the keys of all jobs that have changed.
    pub async fn claim_next(self: &Arc<Self>) -> Result<(Option<Claim>, Vec<i64>)> {
        self.check_result_for_next().await;
        self.write(|writer| {
            let mut change = writer.change()?;
            let claim = claim(&mut change)?;
            Ok((claim, change.commit()?))
        })
        .await
    }
}

/// The next job of the queue that is not damaged. Nothing in a damaged row can be trusted: such jobs wait until the
/// operator removes them, and the others go on.
fn next(change: &mut Change<'_>) -> Result<Option<Job>> {
    let mut damaged = BTreeSet::new();
    while let Some(key) = change.next(&damaged)? {
        let found = change.read(key);
        match change.unless_damaged(found)? {
            Some(job) => return Ok(Some(job)),
            None => damaged.insert(key),
        };
    }
    Ok(None)
}

/// Claims a job within a transaction. If the next job does not fit into the memory budget, it waits, and all later jobs
/// wait with it, even those that would fit: the order is strict, so that no large job is overtaken for ever. Running
/// jobs end within their time limits, and each job fits alone.
pub(super) fn claim(change: &mut Change<'_>) -> Result<Option<Claim>> {
    /// The largest number of jobs that are answered, coalesced or failed before one is claimed: more would take too
    /// long.
    const MOST_ANSWERED: usize = 100;
    for _ in 0..MOST_ANSWERED {
        let Some(waiting) = next(change)? else {
            return Ok(None);
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
        let problem = change.problem(&waiting);
        let needed = match &problem {
            Ok(_) => waiting.memory_bytes,
            // it is not going to be solved
            Err(_) => Some(0),
        };
        // given back if this transaction is rolled back
        let Some(memory) = change.budget().reserve(needed) else {
            return Ok(None);
        };
        let now = change.now();
        let job = change.update(waiting.key, |row| row.start(now))?;
        change.take_turn(&job.owner)?;
        let problem = match problem {
            Ok(problem) => problem,
            // it fails alone, and does not stop the queue
            Err(StoreError::Damaged(damage)) => {
                end::end(change, job.key, &Ending::damaged(&damage))?;
                continue;
            }
            Err(error) => return Err(error),
        };
        if failpoint::fails(Point::Claimed, job.id) {
            return Err(StoreError::Full);
        }
        return Ok(Some(Claim {
            mesh: job.mesh.clone(),
            job,
            problem,
            memory,
        }));
    }
    Ok(None)
}
