//! Random problems: each is solved or refused in words, and what is solved keeps its promises.

use std::collections::BTreeMap;

use serde_json::json;
use solver::solution::{Outcome, WarningCode};

use crate::catalogue;
use crate::record::keep_table;
use crate::support::{numbers, quiet};

/// Problems that are solved; `SIGNORINI_RANDOM` asks for others: `from..to`.
const NUMBERS: std::ops::Range<u64> = 0..500;

#[test]
fn random_problems_converge() {
    let mut ends: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    let mut warned: BTreeMap<&str, u32> = BTreeMap::new();
    let numbers = numbers("SIGNORINI_RANDOM", NUMBERS);
    let total = numbers.clone().count();
    for number in numbers {
        let case = catalogue::case(number);
        let end = match solver::solve(&case.problem, &mut quiet) {
            Err(error) => {
                let line = format!("{number}: {}: {error}", case.words);
                ends.entry("refused").or_default().push(line);
                continue;
            }
            Ok(solution) => solution.summary,
        };
        for warning in &end.warnings {
            // there is a node at every corner of these obstacles, and none hides between nodes
            let hidden = warning.code == WarningCode::ObstacleBetweenNodes;
            assert!(!hidden, "{number}: {}: {}", case.words, warning.message);
            *warned.entry(warning.code.as_str()).or_default() += 1;
        }
        if end.outcome != Outcome::Converged {
            let r = end.residuals;
            let line = format!(
                "{number}: {}: {:?} kkt {:.1e} friction {:.1e} monolithic {:.1e} after {}",
                case.words, end.outcome, r.kkt, r.friction, r.monolithic, end.iterations
            );
            ends.entry("not converged").or_default().push(line);
        }
    }
    println!("{total} problems; warnings {warned:?}");
    for (end, lines) in &ends {
        println!("{end}: {}\n  {}", lines.len(), lines.join("\n  "));
    }
    let lines = |end: &str| ends.get(end).cloned().unwrap_or_default();
    let table = json!({"problems": total, "warnings": warned,
        "refused": lines("refused"), "not_converged": lines("not converged")});
    keep_table("random", &table);
    let missed: usize = ends.values().map(Vec::len).sum();
    assert!(200 * missed <= total, "{missed} of {total}");
}
