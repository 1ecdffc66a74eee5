//! `refine: {"tolerance": …}` on random problems of the catalogue, on grids, on grids whose crossings are moved, and on
//! meshes of Gmsh's: every quantity changes by less than the tolerance on a mesh twice as fine.

use serde_json::{Value, json};
use solver::mesh;
use solver::problem::{AdaptiveRefine, Problem, Refine};
use solver::solution::{Warning, WarningCode};

use crate::catalogue;
use crate::pairs::{distance, pairs};
use crate::record::keep_table;
use crate::support::{numbers, quiet};

/// Problems that are solved with all tests. With SIGNORINI_TOLERANCE=0..90, for an hour, the table is published.
const NUMBERS: std::ops::Range<u64> = 0..6;

const TOLERANCE: f64 = 0.01;

/// Changes of the quantities of problems on meshes of one kind, in parts of the tolerance, and of what.
#[derive(Default)]
struct Tally {
    problems: usize,
    /// Refinement ended before the tolerance, or did not converge.
    unfinished: Vec<(u64, String)>,
    changes: Vec<(f64, String)>,
}

impl Tally {
    fn add(&mut self, number: u64, mut problem: Problem) {
        problem.mesh.refine = Refine::Adaptive(AdaptiveRefine {
            tolerance: TOLERANCE,
        });
        let external = files::external_mesh(&problem, None);
        let (solution, last) = solver::solve_with_mesh(&problem, external, &mut quiet).unwrap();
        let own = solution.summary;
        self.problems += 1;
        let met = own.refinements.last().and_then(|row| row.error);
        if !own.converged || met.is_none_or(|error| error > TOLERANCE) {
            let told = |w: &&Warning| w.code == WarningCode::RefinementUnfinished;
            let told = own.warnings.iter().find(told).map(|w| w.message.clone());
            let told = told.unwrap_or_else(|| "not converged".to_owned());
            self.unfinished.push((number, told));
            return;
        }
        let finer = solver::prepare_on_mesh(&problem, mesh::refine(&last), &mut quiet).unwrap();
        let finer = finer.solve(&mut quiet).unwrap().summary;
        assert!(finer.converged, "{number} on the finer mesh");
        for (coarse, fine) in pairs(&own, &finer) {
            let (Some(error), Some(relative)) = (coarse.error, coarse.relative) else {
                continue;
            };
            if error > 0.0 {
                let off = distance(coarse, fine) * relative / error;
                let name = coarse.quantity;
                self.changes.push((
                    off / TOLERANCE,
                    format!("{number}: {name:?}, stated {relative:.1e}, off {off:.1e}"),
                ));
            }
        }
    }

    fn within(&self) -> f64 {
        let held = self.changes.iter().filter(|(part, _)| *part <= 1.0);
        held.count() as f64 / self.changes.len() as f64
    }

    fn row(&mut self, mesh: &str) -> Value {
        self.changes.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (part, line) in self.changes.iter().take(10) {
            println!("{mesh}: {part:.2} {line}");
        }
        println!("{mesh}: {:#?}", self.unfinished);
        json!({
            "mesh": mesh, "problems": self.problems, "unfinished": self.unfinished.len(),
            "quantities": self.changes.len(), "within": self.within(), "worst": self.changes[0].0,
            "median": self.changes[self.changes.len() / 2].0,
        })
    }
}

#[test]
fn a_tolerance_holds_against_a_mesh_twice_as_fine() {
    let mut kinds = [
        ("grids", Tally::default()),
        ("grids with moved crossings", Tally::default()),
        ("meshes of Gmsh", Tally::default()),
    ];
    for number in numbers("SIGNORINI_TOLERANCE", NUMBERS) {
        match number % 3 {
            0 => kinds[0].1.add(number, catalogue::case(number).problem),
            1 => kinds[1].1.add(number, catalogue::unstructured(number)),
            _ => kinds[2].1.add(number, catalogue::gmsh(number)),
        }
    }
    let kinds = kinds.iter_mut().filter(|(_, tally)| tally.problems > 0);
    let mut kinds: Vec<_> = kinds.collect();
    let rows: Vec<Value> = kinds
        .iter_mut()
        .map(|(mesh, tally)| tally.row(mesh))
        .collect();
    let table = json!({"tolerance": TOLERANCE, "meshes": rows});
    keep_table("tolerance", &table);
    for (mesh, tally) in &kinds {
        let ended = tally.unfinished.len();
        assert!(
            tally.within() >= 0.95 && 20 * ended <= tally.problems,
            "{mesh}: {table:#}"
        );
    }
}
