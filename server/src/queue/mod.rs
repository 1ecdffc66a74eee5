//! The queue: which task may do what, and what wakes it.
//!
//! `workers` slots each hold one job at a time. The dispatcher claims the next job of the store whenever a
//! slot is free; a submit that finds one free has that done in its own transaction, and hands the claim to
//! the slot. Each claim is solved on a blocking thread. Beside each running solver a recorder task commits
//! its events in batches and then announces that there are some; watchers read them from the store. No event
//! travels through a channel to a watcher, so none is seen twice, missed, or taken back by a crash.
//!
//! Who may end a job? Any of worker, canceler, clock and drain may try; the store lets one of them, by
//! checking in one transaction that the start is still current. The others are too late.

// From the ground up; each uses only those above it.
mod backoff;
mod running;
mod watchers;

mod state;

mod recorder;
mod worker;

mod cancel;
mod dispatch;

#[cfg(test)]
mod tests;

pub use self::{
    state::{Queue, State},
    watchers::Subscription,
};
