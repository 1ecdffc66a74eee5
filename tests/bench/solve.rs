//! How long a solution takes, and where the time goes: `cargo bench --bench solve`.
//!
//! Prints the tables of `docs/performance.md`. CPU seconds of this thread, so that a busy machine
//! does not spoil them. A harness of our own: the phases are known to the observer only, and no
//! benchmark library would see them.
#![allow(clippy::unwrap_used)]

use std::time::Duration;

use rustix::time::{ClockId, clock_gettime};
use solver::observer::Progress;
use solver::problem::{Problem, Refine};
use solver::solution::{Phase, Solution};

fn main() {
    println!("One example of 56 elements, from JSON text to solution ({RUNS} runs):\n");
    let text = example();
    let mut times: Vec<f64> = (0..RUNS)
        .map(|_| timed(|| solve(&text, 0, &mut Vec::new())).1)
        .collect();
    times.sort_by(f64::total_cmp);
    println!("| | CPU ms |\n|---|---|");
    println!(
        "| least | {:.2} |\n| median | {:.2} |\n| 99 of 100 | {:.2} |\n",
        1e3 * times[0],
        1e3 * times[RUNS / 2],
        1e3 * times[RUNS * 99 / 100]
    );

    println!("Example 1 refined, CPU ms by phase (best of three; peak: resident set so far):\n");
    println!(
        "| refine | dofs | contact dofs | mesh | assemble | order | factor | condense | iterate | recover | sum | iterate/factor | peak MiB |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    for refine in [0, 2, 4, 5] {
        let best = (0..3)
            .map(|_| phases(&text, refine))
            .min_by(|a, b| total(&a.1).total_cmp(&total(&b.1)))
            .unwrap();
        let (solution, phases) = best;
        let of = |phase: Phase| phases.iter().find(|p| p.0 == phase).unwrap().1;
        let columns = [
            Phase::Mesh,
            Phase::Assemble,
            Phase::Order,
            Phase::Factor,
            Phase::Condense,
            Phase::Iterate,
            Phase::Recover,
        ];
        let cells: Vec<String> = columns
            .iter()
            .map(|p| format!("{:.2}", 1e3 * of(*p)))
            .collect();
        println!(
            "| {refine} | {} | {} | {} | {:.2} | {:.3} | {} |",
            solution.summary.dofs,
            solution.summary.contact_dofs,
            cells.join(" | "),
            1e3 * total(&phases),
            of(Phase::Iterate) / of(Phase::Factor),
            peak_mib(),
        );
    }

    println!(
        "\nNearly incompressible (ν = .4999) against ν = .3, CPU ms (best of five, in turns):\n"
    );
    println!(
        "| refine | assemble, ν = .3 | ν = .4999 | assemble … condense, ν = .3 | ν = .4999 | ratio | sum, ν = .3 | ν = .4999 | ratio |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let soft = text.replace("\"poissons_ratio\": 0.3", "\"poissons_ratio\": 0.4999");
    assert_ne!(soft, text);
    for refine in [2, 4, 5] {
        let mut best = [[f64::INFINITY; 3]; 2];
        for _ in 0..5 {
            for (best, text) in best.iter_mut().zip([&text, &soft]) {
                let phases = phases(text, refine).1;
                let of = |phase: Phase| phases.iter().find(|p| p.0 == phase).unwrap().1;
                let assembled = of(Phase::Assemble);
                let solved = assembled + of(Phase::Order) + of(Phase::Factor) + of(Phase::Condense);
                let times = [assembled, solved, total(&phases)];
                (0..3).for_each(|k| best[k] = best[k].min(times[k]));
            }
        }
        let [a, b] = best.map(|times| times.map(|s| 1e3 * s));
        println!(
            "| {refine} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} |",
            a[0],
            b[0],
            a[1],
            b[1],
            b[1] / a[1],
            a[2],
            b[2],
            b[2] / a[2],
        );
    }
}

const RUNS: usize = 300;

fn example() -> String {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/data/thesis/rectangular_punch.json"
    );
    std::fs::read_to_string(path).unwrap()
}

/// CPU seconds of this thread.
fn now() -> f64 {
    Duration::try_from(clock_gettime(ClockId::ThreadCPUTime))
        .unwrap()
        .as_secs_f64()
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = now();
    let result = work();
    (result, now() - start)
}

fn solve(text: &str, refine: u32, phases: &mut Vec<(Phase, f64)>) -> Solution {
    let mut problem: Problem = serde_json::from_str(text).unwrap();
    problem.mesh.refine = Refine::Times(refine);
    let solution = solver::solve(&problem, &mut |progress: Progress<'_>| {
        if let Progress::Phase(phase) = progress {
            phases.push((phase, now()));
        }
    });
    phases.push((Phase::Recover, now()));
    let solution = solution.unwrap();
    assert!(solution.summary.converged);
    solution
}

/// Seconds of each phase.
fn phases(text: &str, refine: u32) -> (Solution, Vec<(Phase, f64)>) {
    let mut starts = Vec::new();
    let solution = solve(text, refine, &mut starts);
    let lengths = starts
        .windows(2)
        .map(|pair| (pair[0].0, pair[1].1 - pair[0].1))
        .collect();
    (solution, lengths)
}

fn total(phases: &[(Phase, f64)]) -> f64 {
    phases.iter().map(|p| p.1).sum()
}

fn peak_mib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmHWM"));
    line.and_then(|l| l.split_whitespace().nth(1))
        .and_then(|kib| kib.parse::<u64>().ok())
        .unwrap_or(0)
        / 1024
}
