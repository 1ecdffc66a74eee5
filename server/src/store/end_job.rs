//! The end of one job, with all that belongs to it.

use super::{change::Change, error::Result, results, rows::partial_key, rules::Ending, sizes};
use crate::{event::Payload, job::ResultAvailable};

/// Ends a job, with its one `done` event. Jobs coalesced into it stay as they are.
pub(super) async fn end_job(change: &mut Change<'_>, key: i64, ending: &Ending) -> Result<()> {
    let now = change.now();
    let mut ended = change.update(key, |row| row.end(ending, now)).await?;
    let tx = change.sql().await?;
    match (ending.result, ended.result_available) {
        // it never ran, so that no pieces were written; thousands of such jobs may be canceled at once
        (ResultAvailable::None, ResultAvailable::None) if ended.attempt == 0 => {}
        (ResultAvailable::None, ResultAvailable::None) => {
            // removes pieces that were written for a result that is not kept
            results::remove(tx, key).await?;
            results::remove(tx, partial_key(key)).await?;
        }
        (ResultAvailable::None, _) => results::keep_partial(tx, key).await?,
        _ => results::remove(tx, partial_key(key)).await?,
    }
    sizes::count(tx, key).await?;
    if ended.result_key != ended.key {
        sizes::take_over(tx, key).await?;
    }
    sizes::add_sizes(tx, std::slice::from_mut(&mut ended)).await?;
    let at = ended.finished_at.unwrap_or(now);
    let job = Box::new(ended);
    change.append(key, &[(at, Payload::Done { job })]).await
}
