//! How far stated errors hold, and how random problems end.

use std::fmt::Write;
use std::path::Path;

use serde_json::Value;

/// The stated errors against the true ones, and how all random problems end.
pub(crate) fn section(records: &Path) -> String {
    let mut out = String::from(
        "## Stated errors\n\nEach problem of the catalogue of random ones (`tests/verification/catalogue.rs`: obstacles, laws, bodies, loads, supports,\nmeshes) and each once refined; the true error is the difference from the mesh refined three times\n(`tests/verification/calibration.rs`). *Within*: true errors below the stated ones. *Overestimated*: stated / true, in\nthe median. Ends of stick or contact that only one of the meshes has are left out, as are true errors below 1e-5.\n\n",
    );
    for (file, what) in [
        ("calibration", "Poisson's ratio from 0 to 0.45"),
        (
            "calibration_nearly_incompressible",
            "Poisson's ratio 0.4999",
        ),
        (
            "calibration_varied",
            "Other meshes (without a structure, of Gmsh's, half as fine) and orthotropic materials",
        ),
        (
            "calibration_unseen",
            "Problems that no factor was fitted to (`tests/verification/unseen.rs`: tapered, leaning, round and stepped bodies, uneven grids, orthotropic and layered materials, steps in few increments, the true errors by 24 times as many; numbers 2000 to 2449, while which parts the errors of peaks have was decided with 1000 to 1449 at hand)",
        ),
        (
            "calibration_verified",
            "With `\"accuracy\": \"verify\"` (Poisson's ratio from 0 to 0.45; true errors from three more refinements)",
        ),
    ] {
        out += &calibration(&last(records, file), what);
    }
    out + &random(&last(records, "random"))
}

fn last(records: &Path, file: &str) -> Value {
    let text = std::fs::read_to_string(records.join(format!("{file}.jsonl"))).unwrap();
    serde_json::from_str(text.lines().last().unwrap()).unwrap()
}

fn percent(part: &Value) -> String {
    format!("{:.1} %", 100.0 * part.as_f64().unwrap())
}

fn calibration(table: &Value, what: &str) -> String {
    let mut out = format!(
        "{what}: {} problems, {} quantities, {} within, overestimated {:.2} times. {} results were called `good`, and in {} of\nthem a number that has a limit was further off than that says.\n\n| quantity | cases | within | overestimated | median error | unknown |\n|---|---|---|---|---|---|\n",
        table["problems"],
        table["cases"],
        percent(&table["within"]),
        table["overestimated"].as_f64().unwrap(),
        table["good"],
        table["good_but_wrong"],
    );
    for row in table["quantities"].as_array().unwrap() {
        writeln!(
            out,
            "| {} | {} | {} | {:.1} | {:.2} % | {} |",
            row["quantity"].as_str().unwrap().replace('_', " "),
            row["cases"],
            percent(&row["within"]),
            row["overestimated"].as_f64().unwrap(),
            100.0 * row["error"].as_f64().unwrap(),
            row["unknown"]
        )
        .unwrap();
    }
    out + "\n"
}

fn random(table: &Value) -> String {
    let names = |what: &str| -> Vec<String> {
        let lines = table[what].as_array().unwrap().iter();
        lines.map(|l| l.as_str().unwrap().to_owned()).collect()
    };
    let (refused, unsolved) = (names("refused"), names("not_converged"));
    let mut out = format!(
        "## Random problems\n\n{} problems of the same catalogue (`tests/verification/random.rs`): {} were refused, {} did not converge.\n\n",
        table["problems"],
        refused.len(),
        unsolved.len()
    );
    for line in refused.iter().chain(&unsolved) {
        writeln!(out, "- {line}").unwrap();
    }
    out += "| warning | problems |\n|---|---|\n";
    for (code, count) in table["warnings"].as_object().unwrap() {
        writeln!(out, "| `{code}` | {count} |").unwrap();
    }
    out + "\n"
}
