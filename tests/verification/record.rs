//! Lines of docs/verification.md: what is asserted is also kept, where `SIGNORINI_VERIFICATION`
//! names a folder. `tests/run` sets it, and the generator of the table reads what lies there.

use std::io::Write;

use serde_json::{Value, json};

/// One line of the table.
pub(crate) struct Line<'a> {
    /// Row of docs/verification.md, 1 … 27; 0: another published value.
    pub(crate) row: u32,
    /// The quantity and its case, in words.
    pub(crate) what: &'a str,
    /// Mesh and block, in words.
    pub(crate) mesh: &'a str,
    /// 0 for what should vanish: then errors are absolute.
    pub(crate) expected: f64,
    pub(crate) computed: f64,
    /// Largest error, relative to `expected`.
    pub(crate) allowed: f64,
    /// Observed order of convergence, where the mesh was refined.
    pub(crate) order: Option<f64>,
}

impl Line<'_> {
    fn error(&self) -> f64 {
        let difference = (self.computed - self.expected).abs();
        if self.expected == 0.0 {
            difference
        } else {
            difference / self.expected.abs()
        }
    }

    /// Keeps the line and asserts that the error is allowed.
    #[track_caller]
    pub(crate) fn hold(self) {
        let error = self.error();
        self.keep(error);
        assert!(
            error <= self.allowed,
            "row {}, {}: got {}, expected {}: off by {error:.2e}, allowed {:.0e} ({})",
            self.row,
            self.what,
            self.computed,
            self.expected,
            self.allowed,
            self.mesh
        );
    }

    fn keep(&self, error: f64) {
        let line = json!({
            "row": self.row, "what": self.what, "mesh": self.mesh, "expected": self.expected,
            "computed": self.computed, "error": error, "allowed": self.allowed, "order": self.order,
        });
        append("lines.jsonl", &line);
    }
}

/// Keeps a table of another kind.
pub(crate) fn keep_table(name: &str, table: &Value) {
    append(&format!("{name}.jsonl"), table);
}

fn append(file: &str, line: &Value) {
    let Some(folder) = std::env::var_os("SIGNORINI_VERIFICATION") else {
        return;
    };
    std::fs::create_dir_all(&folder).unwrap();
    let path = std::path::Path::new(&folder).join(file);
    let mut file = std::fs::OpenOptions::new()
        .create(true)
        .append(true)
        .open(path)
        .unwrap();
    // one write per line: tests run side by side
    file.write_all(format!("{line}\n").as_bytes()).unwrap();
}

/// A quantity that must have its expected value to a relative tolerance (an absolute one where 0 is
/// expected).
#[track_caller]
pub(crate) fn held(row: u32, what: &str, mesh: &str, computed: f64, expected: f64, allowed: f64) {
    Line {
        row,
        what,
        mesh,
        expected,
        computed,
        allowed,
        order: None,
    }
    .hold();
}
