//! The queue: its tasks, and what wakes each of them.
//!
//! `workers` slots each hold one job at a time, and so do the slots of workers elsewhere (`leases`), which ask for jobs. The
//! dispatcher claims the next jobs of the store whenever slots are free; a submission that finds a free slot claims a job in its own transaction, and starts this job in the slot. Each
//! claim is solved on a blocking thread, or in a worker process, which speaks as a worker elsewhere does (`process`). For each running solver
//! a recorder task commits its events in batches and then announces that there are new ones; watchers read them from
//! the store, together. No event travels through a channel to a watcher, so none is repeated, missed, or undone by a
//! crash.
//!
//! The solver tells an observer each phase and iteration, and asks it repeatedly, also within long factorisations. The
//! observer of a job (`solving`) keeps it within its share of memory, and passes its events to a supervisor: the worker
//! of the job, or, at a worker process and elsewhere, what is to be told to the service. The worker answers *stop* when the job was
//! canceled or has reached its time limit. The solver asks whether there is memory before it makes large matrices; if
//! there is none for a matrix that it needs, the job ends; on a later mesh of adaptive refinement the solver returns
//! the result of the mesh before. After each load step but the last the supervisor receives the results so far, which
//! are served while the job runs and kept if it does not finish.
//!
//! A write to the store that fails is repeated until it succeeds, unless the job's own record is damaged.
//!
//! A panic costs one job at most: a panic of a worker's task ends its job, tasks of the queue are restarted, and a job
//! without a worker is requeued (`base::failpoint` lists the places where this is tested).
//!
//! A job may be ended by its worker, by a cancel, by a time limit, or requeued when the service stops. Several of these
//! may happen at the same time: the store accepts the first, since it checks in the same transaction that the attempt
//! is still the current one.
//!
//! # Where to look
//!
//! | subject | where |
//! |---|---|
//! | starting jobs when a slot is free; periodic tasks | `dispatch` |
//! | one job: its worker, its solution on a blocking thread or in a process, its end | `worker`, `in_process`, `solving`, `ending` |
//! | worker processes on this machine | `process` |
//! | what a solver tells and asks, here or in a process | `supervisor` |
//! | jobs at workers elsewhere: offers, leases, reports | `leases`, `elsewhere` |
//! | events committed in batches | `recorder`, `batch` |
//! | stopping solvers | `cancel`, `running` |
//! | watchers: woken, and served from one reading of the store | `watchers`, `feed` |
//! | metrics and spans of an attempt | `phases` |
//! | failed writes, repeated | `backoff` |
//! | the load of the last hour | `load` |
//! | data that the tasks share; whether a second thread is free | `state` |
//! | a failure at every stage of a job | `tests/failpoints.rs` |

// In order of use: no file uses one below it.
mod backoff;
mod batch;
mod feed;
mod load;
mod running;
mod watchers;

mod phases;
mod supervisor;

mod ending;
mod solving;

mod leases;
mod process;

mod state;

mod elsewhere;
mod recorder;

mod in_process;
mod worker;

mod cancel;
mod dispatch;

#[cfg(test)]
mod tests;

pub use self::{
    elsewhere::TooManyWorkers,
    feed::News,
    leases::{
        About, Ask, End, Granted, JobAnswer, JobReport, Pace, Packed, Piece, Report, Task,
        WorkerId, WorkerState, solve_leased,
    },
    load::LoadPoint,
    process::{Processes, SECRET_BYTES, limit_memory},
    state::{Queue, Solver, State},
    supervisor::Supervisor,
    watchers::Subscription,
};
