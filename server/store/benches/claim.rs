//! How long the next job of a long queue takes to be found: `cargo bench --bench claim`.
//!
//! Prints the table of `docs/performance.md`: 100,000 jobs of 200 owners wait, and are claimed one after the other, each with its
//! commit; and a transaction that changes one number, for comparison.
#![allow(clippy::unwrap_used)]

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use base::job::{Cache, Limits};
use store::{NewJob, QueueLimits, Store, Submission};

const OWNERS: usize = 200;
const JOBS_OF_EACH: usize = 500;
const CLAIMS: usize = 300;

#[tokio::main(flavor = "multi_thread", worker_threads = 2)]
async fn main() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    for owner in 0..OWNERS {
        submit(&store, &format!("owner {owner}"), JOBS_OF_EACH).await;
    }
    let (mut claims, mut commits) = (vec![], vec![]);
    for n in 0..CLAIMS {
        let start = Instant::now();
        store.claim_next().await.unwrap().0.unwrap();
        claims.push(start.elapsed());
        let start = Instant::now();
        store.set_paused(n % 2 == 0).await.unwrap();
        commits.push(start.elapsed());
    }
    println!(
        "| {} jobs of {OWNERS} owners wait | median, ms | 99 of 100, ms |",
        OWNERS * JOBS_OF_EACH
    );
    println!("|---|---|---|");
    row("a claim with its commit", claims);
    row("a commit of one number", commits);
}

fn row(name: &str, mut times: Vec<Duration>) {
    times.sort_unstable();
    let ms = |part: usize| times[times.len() * part / 100].as_secs_f64() * 1e3;
    println!("| {name} | {:.2} | {:.2} |", ms(50), ms(99));
}

async fn submit(store: &Arc<Store>, owner: &str, count: usize) {
    let jobs = (0..count).map(|n| NewJob {
        id: None,
        name: None,
        labels: Default::default(),
        priority: (n % 3) as i32,
        limits: Limits::default(),
        cache: Cache::Off,
        parent: None,
        sweep: None,
        title: None,
        input_hash: format!("sha256:{owner} {n}"),
        problem: format!("{{\"title\":\"{owner} {n}\"}}"),
        mesh: None,
        memory_bytes: 1 << 20,
        payload: String::new(),
    });
    let submission = Submission {
        owner: owner.into(),
        jobs: jobs.collect(),
        sweep: None,
        key: None,
        limits: QueueLimits {
            queued: 1_000_000,
            queued_of_owner: None,
        },
    };
    store.submit(submission, false).await.unwrap();
}
