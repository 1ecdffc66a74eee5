//! The rows of docs/verification.md and the robustness grid.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

use serde_json::Value;

/// What the rows are about; a row without a title is none.
const TITLES: [&str; 28] = [
    "Published values beside the rows",
    "Patch test",
    "Rigid modes",
    "Thick cylinder",
    "Cook's membrane",
    "Manufactured solutions",
    "Pressure on a disc",
    "Contact patch test",
    "Flat punch, plane",
    "Hertz, cylinder",
    "Hertz, sphere",
    "Flat punch, axisymmetric",
    "Annular punches",
    "Even profiles",
    "NAFEMS CGS-4, block on an incline",
    "Bonded flat punch",
    "Sliding flat punch",
    "Cattaneo and Mindlin",
    "Stick radius of the flat punch",
    "Total and incremental law",
    "Thin strip on a frictional base",
    "Moments of the averaging operator",
    "Averaged pressure of a flat punch",
    "Limits of the nonlocal radius",
    "Invariances",
    "Balance and variational inequality",
    "Obstacles under loads",
    "Two elastic bodies",
];

/// The number of the last row.
const LAST: u64 = TITLES.len() as u64 - 1;

/// Of more lines than this the worst are shown.
const MOST_SHOWN: usize = 16;

/// All rows as one table each. Panics when one is missing.
pub(crate) fn rows(records: &Path) -> String {
    let text = std::fs::read_to_string(records.join("lines.jsonl")).unwrap();
    let mut rows: BTreeMap<u64, Vec<Value>> = BTreeMap::new();
    for line in text.lines() {
        let line: Value = serde_json::from_str(line).unwrap();
        rows.entry(line["row"].as_u64().unwrap())
            .or_default()
            .push(line);
    }
    let missing: Vec<u64> = (1..=LAST).filter(|row| !rows.contains_key(row)).collect();
    assert!(missing.is_empty(), "rows without a line: {missing:?}");
    let mut out = String::new();
    // the rows first, what has no row after them
    for row in (1..=LAST).chain([0]) {
        let title = TITLES[row as usize];
        match row {
            0 => writeln!(out, "## {title}\n").unwrap(),
            _ => writeln!(out, "## {row}. {title}\n").unwrap(),
        }
        let lines = &mut rows.get_mut(&row).unwrap();
        let count = lines.len();
        if count > MOST_SHOWN {
            // orders of convergence are always shown
            let rank = |line: &Value| (line["order"].is_number(), used(line));
            lines.sort_by(|a, b| {
                let ((first, a), (second, b)) = (rank(a), rank(b));
                second.cmp(&first).then(b.total_cmp(&a))
            });
            lines.truncate(MOST_SHOWN);
            writeln!(
                out,
                "{MOST_SHOWN} of {count} lines: those with orders of convergence, and those that come nearest to what is allowed.\n"
            )
            .unwrap();
        }
        // tests run side by side: their lines come in any order
        lines.sort_by_key(|line| line["what"].to_string() + &line["mesh"].to_string());
        out += &table(lines);
    }
    out
}

/// Error in parts of what is allowed.
fn used(line: &Value) -> f64 {
    let (error, allowed) = (
        line["error"].as_f64().unwrap(),
        line["allowed"].as_f64().unwrap(),
    );
    if allowed > 0.0 {
        error / allowed
    } else {
        error
    }
}

fn table(lines: &[Value]) -> String {
    let mut out = String::from(
        "| quantity | expected | computed | error | allowed | order | mesh |\n|---|---|---|---|---|---|---|\n",
    );
    for line in lines {
        let number = |name: &str| line[name].as_f64().unwrap();
        let order = line["order"]
            .as_f64()
            .map_or(String::new(), |o| format!("{o:.2}"));
        let computed = match number("expected") {
            // rounding differs from machine to machine
            0.0 if number("computed").abs() < 1e-12 => "< 1e-12".to_owned(),
            _ => digits(number("computed")),
        };
        writeln!(
            out,
            "| {} | {} | {computed} | {} | {} | {order} | {} |",
            line["what"].as_str().unwrap().replace('|', "\\|"),
            digits(number("expected")),
            small(number("error")),
            small(number("allowed")),
            line["mesh"].as_str().unwrap(),
        )
        .unwrap();
    }
    out + "\n"
}

/// Seven digits at most.
pub(crate) fn digits(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !(1e-3..1e6).contains(&value.abs()) {
        return format!("{value:.4e}");
    }
    let before = value.abs().log10().floor() as i32 + 1;
    let text = format!("{value:.*}", (7 - before).clamp(1, 10) as usize);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn small(value: f64) -> String {
    match value {
        0.0 => "0".to_owned(),
        v if v.abs() < 1e-12 => "< 1e-12".to_owned(),
        v => format!("{v:.1e}"),
    }
}

/// Errors by Poisson's ratio, up to nearly incompressible bodies.
pub(crate) fn nearly_incompressible(records: &Path) -> String {
    let text = std::fs::read_to_string(records.join("nearly_incompressible.jsonl")).unwrap();
    let mut tables: Vec<Value> = text
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    // tests run side by side
    tables.sort_by_key(|table| table["title"].to_string());
    let mut out = String::from(
        "## Nearly incompressible bodies\n\nAbove ν = .48 elements have a bubble and a pressure of their own (formulation 3.1). What follows is asserted in\nrows 3, 5 and 9.\n\n",
    );
    let cells = |row: &Value| -> Vec<String> {
        let cell = |cell: &Value| match cell {
            Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        row.as_array().unwrap().iter().map(cell).collect()
    };
    for table in &tables {
        let columns = cells(&table["columns"]);
        writeln!(
            out,
            "{}:\n\n| {} |\n|{}",
            table["title"].as_str().unwrap(),
            columns.join(" | "),
            "---|".repeat(columns.len())
        )
        .unwrap();
        for row in table["rows"].as_array().unwrap() {
            writeln!(out, "| {} |", cells(row).join(" | ")).unwrap();
        }
        out.push('\n');
    }
    out
}

/// Rows needed by `auto` on the sheet that is dragged along its wall.
pub(crate) fn dragged_sheet(records: &Path) -> String {
    let text = std::fs::read_to_string(records.join("dragged_sheet.jsonl")).unwrap();
    let cases: Value = serde_json::from_str(text.lines().next().unwrap()).unwrap();
    let coefficients = ["0.3", "0.6", "0.8", "1.0", "2.0", "4.0", "10.0"];
    let mut out = format!(
        "The sheet of the example on a finer grid, its wall dragged by d along t: iterations for each μ, all\nconverged; a case without contact is marked –.\n\n| d | pull | {} |\n|---|---|{}\n",
        coefficients.join(" | "),
        "---|".repeat(coefficients.len())
    );
    for row in cases.as_array().unwrap().chunks(coefficients.len()) {
        let cell = |case: &Value| match case["normal_force"].as_f64().unwrap() {
            0.0 => "–".to_owned(),
            _ => case["iterations"].to_string(),
        };
        let cells: Vec<String> = row.iter().map(cell).collect();
        writeln!(
            out,
            "| {} | {} | {} |",
            row[0]["drag"],
            row[0]["pull"],
            cells.join(" | ")
        )
        .unwrap();
    }
    out + "\n"
}

/// Overlaps, each against the same problem given in another way.
pub(crate) fn overlaps(records: &Path) -> String {
    let text = std::fs::read_to_string(records.join("overlaps.jsonl")).unwrap();
    let kept: Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
    let mut out = String::from(
        "## Overlaps\n\nRandom bodies (discs, ellipses, blobs, blocks, holes and fillets; sides curved and straight, of quadrilaterals and triangles;\nturned and shifted at random) that overlap a line or a polyline from the start, each solved also as another problem with the\nsame answer (`tests/verification/overlaps.rs`): the body moved onto an obstacle that it just touches, the obstacle pushed into\nit with distances by the formula of the circle or polygon, or the circle as a profile. *Largest*: difference of the forces in\nparts of the normal force. *Open*: nothing touches in both.\n\n| obstacle, and the other problem | pairs | largest | open | refused in both |\n|---|---|---|---|---|\n",
    );
    for (words, row) in kept["rows"].as_object().unwrap() {
        writeln!(
            out,
            "| {words} | {} | {:.0e} | {} | {} |",
            row["pairs"],
            row["largest"].as_f64().unwrap(),
            row["open"],
            row["refused"],
        )
        .unwrap();
    }
    out + "\n"
}

/// Adaptive refinement: whether a tolerance holds, and what it costs.
pub(crate) fn adaptive(records: &Path) -> String {
    let last = |name: &str| -> Value {
        let text = std::fs::read_to_string(records.join(name)).unwrap();
        serde_json::from_str(text.lines().last().unwrap()).unwrap()
    };
    let held = last("tolerance.jsonl");
    let percent = |part: &Value| 100.0 * part.as_f64().unwrap();
    let mut out = format!(
        "## Adaptive refinement\n\n`refine: {{\"tolerance\": {}}}` on problems of the catalogue (`tests/verification/tolerance.rs`): every quantity was computed\nagain on the last mesh with every element divided into four. *Within*: it changed by less than the tolerance. *Worst*,\n*median*: the changes in parts of the tolerance. *Ended before*: refinement said that it could not reach the tolerance,\nor did not converge.\n\n| begun with | problems | quantities | within | worst | median | ended before |\n|---|---|---|---|---|---|---|\n",
        held["tolerance"],
    );
    for row in held["meshes"].as_array().unwrap() {
        writeln!(
            out,
            "| {} | {} | {} | {:.1} % | {:.2} | {:.2} | {} |",
            row["mesh"].as_str().unwrap(),
            row["problems"],
            row["quantities"],
            percent(&row["within"]),
            row["worst"].as_f64().unwrap(),
            row["median"].as_f64().unwrap(),
            row["unfinished"],
        )
        .unwrap();
    }
    out += "\nUnknowns of meshes for an error below 1 % of Y, T and max |σ_t| (the difference from adaptive refinement to 0.2 %),\nbegun with the meshes of the examples (`adaptive.rs`):\n\n| example | meshes | unknowns of the last | of all | error | uniform refinement: unknowns | error |\n|---|---|---|---|---|---|---|\n";
    for line in last("adaptive.jsonl").as_array().unwrap() {
        writeln!(
            out,
            "| {} | {} | {} | {} | {:.2} % | {} | {:.2} % |",
            line["example"].as_str().unwrap().replace('_', " "),
            line["meshes"],
            line["unknowns"],
            line["all"],
            percent(&line["error"]),
            line["uniform"],
            percent(&line["uniform_error"]),
        )
        .unwrap();
    }
    out + "\n"
}

/// Rows needed by `auto` on the robustness grid.
pub(crate) fn robustness(records: &Path) -> String {
    let text = std::fs::read_to_string(records.join("robustness.jsonl")).unwrap();
    let grid: Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
    let mut out = format!(
        "## Robustness\n\nExamples 1 to 4, ε = 1e-2 … 1e-8, μ = .1, .3, 1, 4, ρ = 0, 1 and 10 times the value of the examples,\nthesis mesh and two refinements, friction at Gauss points and at nodes: {} cases, all of which `auto`\nsolves. On the refined meshes ∫|σ_t| for ε < 1e-5 differs by more than 1 % from its value at 1e-5 in\n{} cases, all at Gauss points and all with the warning `oscillating_stick`; {} cases have the warning\nbesides. Iterations (frictionless solution and sweeps):\n\n| example | ε | cases | least | median | most |\n|---|---|---|---|---|---|\n",
        grid["cases"], grid["oscillating"], grid["warned_besides"]
    );
    let mut lines: Vec<&Value> = grid["iterations"].as_array().unwrap().iter().collect();
    let slip = |line: &Value| {
        line["elastic_slip"]
            .as_str()
            .unwrap()
            .parse::<f64>()
            .unwrap()
    };
    lines.sort_by(|a, b| {
        let name = |v: &Value| v["example"].to_string();
        name(a).cmp(&name(b)).then(slip(b).total_cmp(&slip(a)))
    });
    for line in lines {
        let text = |name: &str| line[name].as_str().unwrap().to_owned();
        writeln!(
            out,
            "| {} | {} | {} | {} | {} | {} |",
            text("example").replace('_', " "),
            text("elastic_slip"),
            line["cases"],
            line["least"],
            line["median"],
            line["most"]
        )
        .unwrap();
    }
    out + "\n"
}
