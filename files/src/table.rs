//! Tables: columns with names, of a profile or a history. They are written here as CSV and JSON Lines, and by `arrow`
//! and `npz` in binary formats; all formats have the same columns.

use std::{borrow::Cow, fmt::Write};

use solver::solution::{ContactProfile, Iteration, ObstacleMotion};

/// Columns of equal length, in the order in which they are written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// The columns; their names are unique.
    pub columns: Vec<Column>,
}

/// A column of a table: one quantity.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// The quantity's name in the API. A column from a nested field has both names, as in `contact_active`.
    pub name: Cow<'static, str>,
    /// The values, one for each row.
    pub values: Values,
}

/// The entries of a column.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Real numbers; NaN is a missing value, since results contain no other NaN.
    Real(Vec<f64>),
    /// Whole numbers and counts.
    Whole(Vec<u32>),
    /// Words of the API, or other texts.
    Text(Vec<Cow<'static, str>>),
}

impl Values {
    /// The number of entries of the column.
    pub fn len(&self) -> usize {
        match self {
            Values::Real(values) => values.len(),
            Values::Whole(values) => values.len(),
            Values::Text(values) => values.len(),
        }
    }

    /// Whether the column has no entries.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl Table {
    /// A table with one row for each node of Γ_C, in order of arc length.
    #[rustfmt::skip]
    pub fn of_profile(profile: &ContactProfile) -> Table {
        // every field is named, so that a new column does not compile until it is added here
        let ContactProfile {
            s, x, y, gap, normal_displacement, tangential_displacement, normal_stress, tangential_stress,
            nonlocal_pressure, friction_bound, friction_ratio, state,
        } = profile;
        let real = |name, values: &[f64]| column(name, Values::Real(values.to_vec()));
        Table { columns: vec![
            real("s",                       s),
            real("x",                       x),
            real("y",                       y),
            real("gap",                     gap),
            real("normal_displacement",     normal_displacement),
            real("tangential_displacement", tangential_displacement),
            real("normal_stress",           normal_stress),
            real("tangential_stress",       tangential_stress),
            real("nonlocal_pressure",       nonlocal_pressure),
            real("friction_bound",          friction_bound),
            real("friction_ratio",          friction_ratio),
            column("state", Values::Text(state.iter().map(|state| state.as_str().into()).collect())),
        ] }
    }

    /// A table with one row for each iteration. A column from a nested field of the JSON has both names. Where loads move an
    /// obstacle there are columns of its motion.
    #[rustfmt::skip]
    pub fn of_history<'a>(rows: impl IntoIterator<Item = &'a Iteration, IntoIter: Clone>) -> Table {
        let rows = rows.into_iter();
        let real = |name, value: fn(&Iteration) -> f64| column(name, Values::Real(rows.clone().map(value).collect()));
        let whole = |name, value: fn(&Iteration) -> u32| column(name, Values::Whole(rows.clone().map(value).collect()));
        let mut columns = vec![
            whole("k",                 |row| row.k),
            column("stage", Values::Text(rows.clone().map(|row| row.stage.as_str().into()).collect())),
            whole("step",              |row| row.step),
            whole("increment",         |row| row.increment),
            real("residual",           |row| row.residual),
            real("friction_residual",  |row| row.friction_residual),
            real("r_f",                |row| row.r_f.unwrap_or(f64::NAN)),
            real("tolerance",          |row| row.tolerance),
            whole("contact_active",    |row| row.contact.active),
            whole("contact_entered",   |row| row.contact.entered),
            whole("contact_left",      |row| row.contact.left),
            whole("friction_slip",     |row| row.friction.slip),
            whole("friction_stick",    |row| row.friction.stick),
            real("force_normal",       |row| row.force.normal),
            real("force_tangential",   |row| row.force.tangential),
            real("contraction",        |row| row.contraction.unwrap_or(f64::NAN)),
            whole("inner",             |row| row.inner),
        ];
        if rows.clone().any(|row| row.motion.is_some()) {
            let motion = |name, value: fn(&ObstacleMotion) -> f64| {
                let of = |row: &Iteration| row.motion.as_ref().map_or(f64::NAN, value);
                column(name, Values::Real(rows.clone().map(of).collect()))
            };
            columns.extend([
                motion("motion_indentation",             |m| m.indentation),
                motion("motion_tangential_displacement", |m| m.tangential_displacement),
                motion("motion_tilt",                    |m| m.tilt),
            ]);
        }
        Table { columns }
    }

    /// Returns the number of rows.
    ///
    /// # Errors
    ///
    /// The reason in words, if columns have different numbers of entries.
    pub fn rows(&self) -> Result<usize, String> {
        let rows = self.columns.first().map_or(0, |first| first.values.len());
        match self.columns.iter().find(|c| c.values.len() != rows) {
            None => Ok(rows),
            Some(odd) => Err(format!(
                "the column {} has {} entries, where others have {rows}",
                odd.name,
                odd.values.len()
            )),
        }
    }

    /// The number of bytes of all texts if each text is as wide as the longest of its column, as in NumPy.
    pub fn padded_bytes(&self) -> u64 {
        let of_column = |column: &Column| match &column.values {
            Values::Text(values) => {
                let width = values.iter().map(|text| text.chars().count()).max();
                4 * width.unwrap_or(0) as u64 * values.len() as u64
            }
            Values::Real(_) | Values::Whole(_) => 0,
        };
        self.columns.iter().map(of_column).sum()
    }

    /// Writes the table as CSV (RFC 4180): a line of names, then a line for each row. A number is written as the
    /// shortest text that reads back as the same number; a missing number is empty.
    ///
    /// # Errors
    ///
    /// The errors of [`Table::rows`].
    pub fn csv(&self) -> Result<String, String> {
        let mut text = self.header();
        for row in 0..self.rows()? {
            for (place, column) in self.columns.iter().enumerate() {
                if place > 0 {
                    text.push(',');
                }
                match &column.values {
                    Values::Real(values) => real(&mut text, values[row], ""),
                    Values::Whole(values) => push(&mut text, values[row]),
                    Values::Text(values) => text.push_str(&cell(&values[row])),
                }
            }
            text.push_str("\r\n");
        }
        Ok(text)
    }

    fn header(&self) -> String {
        let names: Vec<Cow<'_, str>> = self
            .columns
            .iter()
            .map(|column| cell(&column.name))
            .collect();
        format!("{}\r\n", names.join(","))
    }

    /// Writes the table as JSON Lines: an object for each row. A missing number is null.
    ///
    /// # Errors
    ///
    /// The errors of [`Table::rows`].
    pub fn jsonl(&self) -> Result<String, String> {
        let mut text = String::new();
        let names: Vec<String> = self.columns.iter().map(|c| quoted(&c.name)).collect();
        for row in 0..self.rows()? {
            for (place, column) in self.columns.iter().enumerate() {
                text.push(if place > 0 { ',' } else { '{' });
                push(&mut text, format_args!("{}:", names[place]));
                match &column.values {
                    Values::Real(values) => real(&mut text, values[row], "null"),
                    Values::Whole(values) => push(&mut text, values[row]),
                    Values::Text(values) => text.push_str(&quoted(&values[row])),
                }
            }
            text.push_str("}\n");
        }
        Ok(text)
    }
}

fn column(name: &'static str, values: Values) -> Column {
    let name = name.into();
    Column { name, values }
}

/// A text as a cell of CSV, in quotes if it has separators, quotes or line ends. A text that a spreadsheet would take
/// for a formula and run gets an apostrophe before it; numbers stay numbers.
fn cell(text: &str) -> Cow<'_, str> {
    let mut text = Cow::Borrowed(text);
    if text.starts_with(FORMULAS) && !text.parse::<f64>().is_ok_and(f64::is_finite) {
        text = Cow::Owned(format!("'{text}"));
    }
    if text.contains([',', ';', '"', '\t', '\r', '\n']) {
        Cow::Owned(format!("\"{}\"", text.replace('"', "\"\"")))
    } else {
        text
    }
}

/// The first characters of cells that spreadsheets take for formulas, some programs also after a tab or a new line,
/// including the wide characters of East Asian keyboards.
const FORMULAS: [char; 10] = ['=', '+', '-', '@', '\t', '\r', '\n', '＝', '＋', '－'];

/// A text as JSON.
fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

fn real(text: &mut String, value: f64, missing: &str) {
    if value.is_finite() {
        push(text, format_args!("{value:?}"));
    } else {
        text.push_str(missing);
    }
}

fn push(text: &mut String, value: impl std::fmt::Display) {
    let _ = write!(text, "{value}"); // a String takes everything
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use solver::solution::{ContactCount, ForcePair, FrictionCount, NodeState, Stage};

    pub(crate) fn profile() -> ContactProfile {
        let column = |value: f64| vec![value, -0.0, 5e-324];
        ContactProfile {
            s: vec![0.0, 0.1, 0.1 + 0.2],
            x: column(1.0),
            y: column(2.0),
            gap: column(-0.1),
            normal_displacement: column(-0.1),
            tangential_displacement: column(1e-7),
            normal_stress: column(-20.0),
            tangential_stress: column(1.0 / 3.0),
            nonlocal_pressure: column(1e300),
            friction_bound: column(5.7),
            friction_ratio: column(1.0),
            state: vec![NodeState::Stick, NodeState::Slip, NodeState::Open],
        }
    }

    pub(crate) fn history() -> Vec<Iteration> {
        let row = |k| Iteration {
            k,
            stage: if k == 1 {
                Stage::Frictionless
            } else {
                Stage::Outer
            },
            step: 0,
            increment: 4,
            residual: 1e-3,
            friction_residual: 0.5,
            r_f: (k > 1).then_some(0.25),
            tolerance: 1e-10,
            contact: ContactCount {
                active: 5,
                entered: 1,
                left: 0,
            },
            friction: FrictionCount { slip: 2, stick: 3 },
            force: ForcePair {
                normal: 50.0,
                tangential: -14.0,
            },
            motion: None,
            contraction: None,
            inner: 2,
        };
        vec![row(1), row(2)]
    }

    #[test]
    fn a_profile_has_a_line_of_names_and_a_line_per_node() {
        let text = Table::of_profile(&profile()).csv().unwrap();
        let lines: Vec<&str> = text.split("\r\n").collect();
        assert_eq!(lines.len(), 5);
        assert!(lines[0].starts_with("s,x,y,gap,") && lines[0].ends_with(",state"));
        assert_eq!(
            lines[1],
            "0.0,1.0,2.0,-0.1,-0.1,1e-7,-20.0,0.3333333333333333,1e300,5.7,1.0,stick"
        );
        let first = |line: &str| line.split(',').next().unwrap().parse::<f64>().unwrap();
        assert_eq!(first(lines[3]), 0.1 + 0.2);
        assert_eq!(lines[4], "");
    }

    #[test]
    fn a_formula_is_written_as_a_text_for_spreadsheets() {
        let cells = |text: &str| {
            let values = Values::Text(vec![text.to_owned().into()]);
            let name = text.to_owned().into();
            let columns = vec![Column { name, values }];
            let csv = Table { columns }.csv().unwrap();
            let lines: Vec<&str> = csv.split_terminator("\r\n").collect();
            assert_eq!(lines[0], lines[1], "its name is written likewise");
            lines[1].to_owned()
        };
        for (text, cell) in [
            ("=1+1", "'=1+1"),
            ("@SUM(A1)", "'@SUM(A1)"),
            ("+cmd", "'+cmd"),
            ("-2+3", "'-2+3"),
            ("-inf", "'-inf"),
            ("\t=1", "\"'\t=1\""),
            ("＝1", "'＝1"),
            ("=HYPERLINK(\"a\",1)", "\"'=HYPERLINK(\"\"a\"\",1)\""),
            ("-1.5e-3", "-1.5e-3"),
            ("+1", "+1"),
            ("a=1", "a=1"),
            ("1;=2", "\"1;=2\""),
            ("", ""),
        ] {
            assert_eq!(cells(text), cell, "{text}");
        }
    }

    #[test]
    fn the_names_of_a_table_are_those_of_the_json_and_unique() {
        let flat = |value: serde_json::Value| {
            let mut names = Vec::new();
            for (name, value) in value.as_object().unwrap() {
                match value.as_object() {
                    None => names.push(name.clone()),
                    Some(inner) => names.extend(inner.keys().map(|k| format!("{name}_{k}"))),
                }
            }
            names.sort();
            names
        };
        let names = |table: Table| {
            let mut names: Vec<String> = table
                .columns
                .iter()
                .map(|c| c.name.clone().into_owned())
                .collect();
            names.sort();
            names
        };
        let rows = history();
        assert_eq!(
            names(Table::of_history(&rows)),
            flat(serde_json::to_value(&rows[0]).unwrap())
        );
        let profile = profile();
        assert_eq!(
            names(Table::of_profile(&profile)),
            flat(serde_json::to_value(&profile).unwrap())
        );
    }

    #[test]
    fn a_missing_number_is_empty_in_csv_and_null_in_json() {
        let table = Table::of_history(&history());
        let csv = table.csv().unwrap();
        let first: Vec<&str> = csv.lines().nth(1).unwrap().split(',').collect();
        assert_eq!((first[0], first[1], first[6]), ("1", "frictionless", ""));
        let jsonl = table.jsonl().unwrap();
        let rows: Vec<serde_json::Value> = jsonl
            .lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .collect();
        assert_eq!(rows.len(), 2);
        assert!(rows[0]["r_f"].is_null() && rows[1]["r_f"] == 0.25);
        assert_eq!(rows[1]["force_tangential"], -14.0);
        assert_eq!(rows[0]["stage"], "frictionless");
    }

    #[test]
    fn a_history_under_loads_has_the_motion_of_the_obstacle() {
        let mut rows = history();
        let motion = ObstacleMotion {
            indentation: 0.5,
            tangential_displacement: -0.25,
            tilt: 0.125,
        };
        rows[1].motion = Some(motion);
        let csv = Table::of_history(&rows).csv().unwrap();
        let lines: Vec<&str> = csv.split("\r\n").collect();
        let names = "motion_indentation,motion_tangential_displacement,motion_tilt";
        assert!(lines[0].ends_with(names), "{}", lines[0]);
        assert!(lines[1].ends_with(",,,") && lines[2].ends_with(",0.5,-0.25,0.125"));
    }

    #[test]
    fn columns_of_unequal_length_are_an_error() {
        let mut odd = profile();
        odd.gap.pop();
        let error = Table::of_profile(&odd).csv().unwrap_err();
        assert!(error.contains("gap has 2"), "{error}");
        let empty = Table::of_history(&[]);
        assert_eq!(empty.csv().unwrap().lines().count(), 1);
        assert_eq!(empty.jsonl().unwrap(), "");
    }
}
