//! Workers whose solver only waits, for measurements of the service: `tests/bench/workers.py` runs it.
//!
//! Every job takes between half and one and a half of the same time here, whatever its problem, and has the iterations and the result of a small problem. The
//! problems must have meshes of their own (adaptive refinement): others are solved on bodies that the worker keeps.
#![allow(clippy::unwrap_used)]

use std::{
    sync::atomic::{AtomicU64, Ordering::Relaxed},
    thread::sleep,
    time::Duration,
};

use clap::Parser;
use rpc::worker::{self, Settings};
use solver::{
    error::SolveError, mesh::External, observer::Observer, problem::Problem, solution::Solution,
};
use tokio_util::sync::CancellationToken;
use tonic::transport::Endpoint;

#[derive(Parser)]
struct Arguments {
    /// Address of the service
    #[arg(long)]
    server: String,
    /// How many workers there are, each with a connection of its own
    #[arg(long)]
    workers: u16,
    /// Jobs that each solves at the same time
    #[arg(long, default_value_t = 1)]
    slots: u16,
    /// How long a job takes on average (s)
    #[arg(long)]
    seconds: f64,
}

static MICROSECONDS: AtomicU64 = AtomicU64::new(0);

fn wait(
    _problem: &Problem,
    external: Option<External>,
    observer: &mut dyn Observer,
) -> Result<Solution, SolveError> {
    let shares = 0.5..1.5;
    let share = shares.start + fastrand::f64() * (shares.end - shares.start);
    sleep(Duration::from_micros(MICROSECONDS.load(Relaxed)).mul_f64(share));
    fake::solve(&fake::problem(), external, observer)
}

fn main() {
    let arguments = Arguments::parse();
    // one for each job that waits
    let threads = usize::from(arguments.workers) * usize::from(arguments.slots) + 16;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .max_blocking_threads(threads)
        .thread_stack_size(512 << 10)
        .build()
        .unwrap();
    runtime.block_on(run(arguments));
}

async fn run(arguments: Arguments) {
    MICROSECONDS.store((1e6 * arguments.seconds) as u64, Relaxed);
    let mut running = vec![];
    for number in 0..arguments.workers {
        let channel = Endpoint::from_shared(arguments.server.clone())
            .unwrap()
            .connect_lazy();
        let settings = Settings {
            name: format!("played {number}"),
            slots: arguments.slots,
            cores: arguments.slots.into(),
            memory_bytes: 1 << 50,
            idle_exit: None,
            process: None,
            grace: Duration::ZERO,
        };
        let stop = CancellationToken::new();
        running.push(tokio::spawn(worker::run(
            channel, None, settings, wait, stop,
        )));
    }
    for worker in running {
        worker.await.unwrap().unwrap();
    }
}
