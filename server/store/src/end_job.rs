//! Ends one job, with all that belongs to it.

use base::{event::Payload, job::ResultAvailable};

use super::{change::Change, error::Result, results, rules::Ending, sizes};

/// Ends a job, and appends its only `done` event. Jobs coalesced into it stay as they are.
pub(super) fn end_job(change: &mut Change<'_>, key: i64, ending: &Ending) -> Result<()> {
    let now = change.now();
    let mut ended = change.update(key, |row| row.end(ending, now))?;
    let tx = change.sql()?;
    // one that never ran has none; thousands of such jobs may be canceled at once
    if ended.result_available == ResultAvailable::None && ended.attempt > 0 {
        results::remove(tx, key)?;
    }
    sizes::count(tx, key)?;
    sizes::add_sizes(tx, &mut [&mut ended])?;
    if ended.result_available == ResultAvailable::Final && ended.cached_from.is_none() {
        // its own result is the newest of its input now, and was not read yet
        change.forget_checked(&ended.input_hash);
    }
    let at = ended.finished_at.unwrap_or(now);
    let job = Box::new(ended);
    change.append(key, &[(at, Payload::Done { job })])
}
