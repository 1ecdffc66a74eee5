//! The formats of a result: the list of them, and one function to write each kind of data in a format, for the data
//! routes and for `signorini solve -o`.

use std::borrow::Cow;

use base::{
    event::{HistoryRow, TimedIteration},
    run::Document,
    sweep::{MemberRow, ParameterValue},
    text::size,
};
use files::{
    npz::Npz,
    plot::image::Image,
    table::{Column, Table, Values},
};
use serde::Serialize;
use solver::solution::{ContactProfile, Fields, Residuals};
use strum::{IntoStaticStr, VariantArray};

use crate::error::ApiError;

/// A format of data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, IntoStaticStr, VariantArray)]
#[strum(serialize_all = "snake_case")]
pub enum Format {
    /// JSON, as in the API.
    Json,
    /// CSV: a line of names, then a line for each row.
    Csv,
    /// JSON Lines: an object for each row.
    Jsonl,
    /// An Arrow IPC file.
    Arrow,
    /// NumPy's archive of arrays.
    Npz,
    /// VTK's XML unstructured grid.
    Vtu,
    /// A figure as SVG.
    Svg,
    /// A figure as PNG.
    Png,
    /// A figure as PDF.
    Pdf,
    /// Compact arrays of a body or a field, for programs that draw themselves.
    View,
}

impl Format {
    /// The formats of rows, the default first.
    pub const OF_TABLES: &[Format] = &[
        Format::Json,
        Format::Csv,
        Format::Jsonl,
        Format::Arrow,
        Format::Npz,
    ];
    /// The formats of fields, the default first.
    pub const OF_FIELDS: &[Format] = &[Format::Vtu, Format::Npz, Format::Json];

    /// The formats of figures, the default first.
    pub const OF_FIGURES: &[Format] = &[Format::Svg, Format::Png, Format::Pdf];

    /// The kind of image of a figure's format; `None` for formats of data.
    pub fn image(self) -> Option<Image> {
        match self {
            Format::Svg => Some(Image::Svg),
            Format::Png => Some(Image::Png),
            Format::Pdf => Some(Image::Pdf),
            _ => None,
        }
    }

    /// The name of the format: the value of the parameter `format`, and the extension of a file.
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// The media type in `Accept`: the registered type, if there is one.
    pub fn media_type(self) -> &'static str {
        match self {
            Format::Json => "application/json",
            Format::Csv => "text/csv",
            Format::Jsonl => "application/jsonl",
            Format::Arrow => "application/vnd.apache.arrow.file",
            Format::Npz => "application/x-npz",
            Format::Vtu => "application/vnd.vtk.unstructuredgrid+xml",
            Format::Svg => "image/svg+xml",
            Format::Png => "image/png",
            Format::Pdf => "application/pdf",
            Format::View => "application/vnd.signorini.view",
        }
    }

    /// The value of `Content-Type` for data in this format.
    pub fn content_type(self) -> String {
        match self {
            Format::Csv => format!("{}; charset=utf-8", self.media_type()),
            _ => self.media_type().to_owned(),
        }
    }

    /// The extensions of files in these formats, such as `.csv, .jsonl`.
    pub fn endings(formats: &[Format]) -> String {
        let endings: Vec<String> = formats.iter().map(|f| format!(".{}", f.name())).collect();
        endings.join(", ")
    }
}

/// Writes a profile in this format. The error is the reason why it cannot be written.
pub fn profile(profile: &ContactProfile, format: Format) -> Result<Vec<u8>, String> {
    rows(profile, Table::of_profile, format)
}

/// The rows of a history that is that of a result.
pub fn rows_of(history: &[TimedIteration]) -> Vec<HistoryRow> {
    history.iter().cloned().map(Into::into).collect()
}

/// Writes a history in this format. The error is the reason why it cannot be written.
pub fn history(history: &[HistoryRow], format: Format) -> Result<Vec<u8>, String> {
    rows(history, history_table, format)
}

/// The table of a history: the solver's columns, the column of times and, while the job has not ended, that of the events'
/// numbers.
fn history_table(history: &[HistoryRow]) -> Table {
    let mut table = Table::of_history(history.iter().map(|row| &row.timed.row));
    table.columns.push(Column {
        name: "wall_s".into(),
        values: Values::Real(history.iter().map(|row| row.timed.wall_s).collect()),
    });
    if history.iter().any(|row| row.seq.is_some()) {
        let seq = |row: &HistoryRow| row.seq.map_or(f64::NAN, |seq| seq as f64);
        table.columns.push(Column {
            name: "seq".into(),
            values: Values::Real(history.iter().map(seq).collect()),
        });
    }
    table
}

fn rows<T: Serialize + ?Sized>(
    part: &T,
    table: fn(&T) -> Table,
    format: Format,
) -> Result<Vec<u8>, String> {
    match format {
        Format::Json => serde_json::to_vec(part).map_err(|error| error.to_string()),
        _ => write_table(&table(part), format),
    }
}

/// The largest size of a table's texts in NumPy's form (bytes), where each text is as wide as the longest of its
/// column: a reader needs this memory.
pub const MOST_PADDED_BYTES: u64 = 256 << 20;

/// Writes the rows of a sweep in this format; `paths`: the JSON Pointers of the values in which members differ. The
/// table has a column for each number of a row: a nested number's column is named after both fields, as in
/// `residuals_kkt`, a parameter's column after its pointer.
pub fn members(paths: &[String], rows: &[MemberRow], format: Format) -> Result<Vec<u8>, String> {
    match format {
        Format::Json => serde_json::to_vec(rows).map_err(|error| error.to_string()),
        _ => write_table(&members_table(paths, rows), format),
    }
}

/// Writes a table in one of the formats of tables except JSON.
pub fn write_table(table: &Table, format: Format) -> Result<Vec<u8>, String> {
    match format {
        Format::Csv => table.csv().map(String::into_bytes),
        Format::Jsonl => table.jsonl().map(String::into_bytes),
        Format::Arrow => files::arrow::file(table),
        Format::Npz => match table.padded_bytes() {
            bytes if bytes > MOST_PADDED_BYTES => Err(too_wide(bytes)),
            _ => files::npz::file(table),
        },
        Format::Json | Format::Vtu | Format::Svg | Format::Png | Format::Pdf | Format::View => {
            Err(format!("rows are not written as {}", format.name()))
        }
    }
}

/// The message that a table cannot be written as npz, because its padded texts would take this many bytes.
pub fn too_wide(bytes: u64) -> String {
    format!(
        "npz, where each text is as wide as the longest of its column: that would be {}",
        size(bytes)
    )
}

/// Writes the table of an answer in one of the formats of tables except JSON.
pub fn answer_table(table: &Table, format: Format) -> Result<Vec<u8>, ApiError> {
    let padded = table.padded_bytes();
    if format == Format::Npz && padded > MOST_PADDED_BYTES {
        return Err(ApiError::NotAcceptable {
            got: too_wide(padded),
            available: "csv, jsonl, arrow".into(),
        });
    }
    write_table(table, format).map_err(ApiError::internal)
}

/// Makes a table of the rows of a sweep; `paths`: the JSON Pointers of the values in which members differ.
#[rustfmt::skip] // a column in a row
pub fn members_table(paths: &[String], rows: &[MemberRow]) -> Table {
    let column = |name: &'static str, values| Column { name: name.into(), values };
    let real = |name, value: fn(&MemberRow) -> Option<f64>| {
        column(name, Values::Real(rows.iter().map(|row| value(row).unwrap_or(f64::NAN)).collect()))
    };
    let whole = |name, value: fn(&MemberRow) -> u32| column(name, Values::Whole(rows.iter().map(value).collect()));
    let text = |name, value: fn(&MemberRow) -> Cow<'static, str>| column(name, Values::Text(rows.iter().map(value).collect()));
    let residual = |name, value: fn(&Residuals) -> f64| {
        let values = rows.iter().map(|row| row.residuals.as_ref().map_or(f64::NAN, value));
        column(name, Values::Real(values.collect()))
    };
    let mut columns = vec![whole("number", |row| row.number)];
    columns.extend(paths.iter().map(|path| parameter(path, rows)));
    columns.extend([
        text("status",                  |row| <&str>::from(row.status).into()),
        text("reason",                  |row| row.reason.map_or("", <&str>::from).into()),
        text("verdict",                 |row| row.verdict.map_or("", <&str>::from).into()),
        real("normal_force",            |row| row.normal_force),
        real("tangential_force",        |row| row.tangential_force),
        real("friction_force",          |row| row.friction_force),
        real("contact_width",           |row| row.contact_width),
        real("contact_width_error",     |row| row.contact_width_error),
        real("stick_width",             |row| row.stick_width),
        real("slip_width",              |row| row.slip_width),
        real("peak_normal_stress",      |row| row.peak_normal_stress),
        real("peak_tangential_stress",  |row| row.peak_tangential_stress),
        real("obstacle_indentation",             |row| row.obstacle_indentation),
        real("obstacle_tangential_displacement", |row| row.obstacle_tangential_displacement),
        real("obstacle_tilt",                    |row| row.obstacle_tilt),
        whole("iterations",             |row| row.iterations),
        residual("residuals_kkt",         |residuals| residuals.kkt),
        residual("residuals_friction",    |residuals| residuals.friction),
        residual("residuals_monolithic",  |residuals| residuals.monolithic),
        residual("residuals_equilibrium", |residuals| residuals.equilibrium),
        text("warnings", |row| {
            let codes: Vec<&str> = row.warnings.iter().map(|code| code.as_str()).collect();
            codes.join(" ").into()
        }),
        text("detail", |row| {
            let violations = row.violations.iter().map(ToString::to_string);
            let all: Vec<String> = row.detail.iter().cloned().chain(violations).collect();
            all.join("; ").into()
        }),
    ]);
    Table { columns }
}

/// The column of the parameter at this JSON Pointer: numbers, or texts if one of its values is not a number.
fn parameter(path: &str, rows: &[MemberRow]) -> Column {
    let values = rows.iter().map(|row| row.parameters.get(path));
    let number = |value: &ParameterValue| value.json().parse::<f64>().ok();
    let numbers = values
        .clone()
        .flatten()
        .all(|value| is_number(value.json()));
    let values = if numbers {
        Values::Real(
            values
                .map(|value| value.and_then(number).unwrap_or(f64::NAN))
                .collect(),
        )
    } else {
        let text = |value: &ParameterValue| {
            let json = value.json();
            let string = serde_json::from_str(json)
                .ok()
                .filter(|_| json.starts_with('"'));
            string.unwrap_or_else(|| json.to_owned())
        };
        let texts = values.map(|value| value.map_or_else(String::new, text).into());
        Values::Text(texts.collect())
    };
    Column {
        name: path.to_owned().into(),
        values,
    }
}

fn is_number(json: &str) -> bool {
    json.starts_with(|c: char| c == '-' || c.is_ascii_digit())
}

/// Writes fields in this format. The error is the reason why they cannot be written.
pub fn fields(fields: &Fields, format: Format) -> Result<Vec<u8>, String> {
    match format {
        Format::Json => serde_json::to_vec(fields).map_err(|error| error.to_string()),
        Format::Npz => files::fields::npz(fields),
        Format::Vtu => files::vtu::file(fields),
        Format::Csv
        | Format::Jsonl
        | Format::Arrow
        | Format::Svg
        | Format::Png
        | Format::Pdf
        | Format::View => Err(format!("fields are not written as {}", format.name())),
    }
}

/// Writes fields, history and profiles into one archive: `fields/points`, `history/k`, `profiles/top/normal_stress`,
/// and for each load step `steps/0/profiles/top/normal_stress`.
pub fn everything_as_npz(document: &Document) -> Result<Vec<u8>, String> {
    let mut npz = Npz::new();
    files::fields::add(&mut npz, "fields/", &document.fields)?;
    npz.table("history/", &history_table(&rows_of(&document.history)))?;
    for (boundary, profile) in &document.profiles {
        npz.table(
            &format!("profiles/{boundary}/"),
            &Table::of_profile(profile),
        )?;
    }
    for (number, step) in document.steps.iter().enumerate() {
        for (boundary, profile) in &step.profiles {
            let prefix = format!("steps/{number}/profiles/{boundary}/");
            npz.table(&prefix, &Table::of_profile(profile))?;
        }
    }
    npz.finish()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use serde_json::{Value, json};

    use super::*;

    fn value(value: Value) -> ParameterValue {
        serde_json::from_value(value).unwrap()
    }

    #[test]
    fn rows_are_written_in_every_format_of_tables_and_in_no_other() {
        let solution = fake::solution();
        for format in Format::VARIANTS {
            let expected = Format::OF_TABLES.contains(format);
            let name = format.name();
            let top = profile(&solution.profiles["top"], *format);
            assert_eq!(top.is_ok(), expected, "{name}");
            let rows = [fake::timed(1), fake::timed(2)];
            assert_eq!(history(&rows_of(&rows), *format).is_ok(), expected);
        }
        let top = &solution.profiles["top"];
        let csv = String::from_utf8(profile(top, Format::Csv).unwrap()).unwrap();
        let cells: Vec<&str> = csv.lines().nth(1).unwrap().split(',').collect();
        let number = |column: usize| cells[column].parse::<f64>().unwrap();
        assert_eq!((number(3), number(6)), (top.gap[0], top.normal_stress[0]));
        assert_eq!((cells.len(), cells[11]), (12, top.state[0].as_str()));
    }

    #[test]
    fn a_row_of_history_ends_with_its_time() {
        let rows = [fake::timed(1), fake::timed(2)];
        let jsonl = String::from_utf8(history(&rows_of(&rows), Format::Jsonl).unwrap()).unwrap();
        assert!(jsonl.lines().next().unwrap().ends_with(r#""wall_s":0.5}"#));
        let json: serde_json::Value =
            serde_json::from_slice(&history(&rows_of(&rows), Format::Json).unwrap()).unwrap();
        assert_eq!(
            (&json[1]["k"], &json[1]["wall_s"]),
            (&2.into(), &1.0.into())
        );
    }

    #[test]
    fn rows_of_a_sweep_have_a_column_for_each_parameter_whatever_its_type() {
        let (number, other) = ("/contacts/0/indentation", "/contacts/0/obstacle");
        let mut rows = vec![MemberRow::default(), MemberRow::default()];
        rows[0].parameters.insert(number.into(), value(json!(0.5)));
        rows[0]
            .parameters
            .insert(other.into(), value(json!({"kind": "flat", "to": 1})));
        rows[1].number = 1;
        rows[1].normal_force = Some(7.5);
        rows[1].detail = Some("after 3 iterations, and \"so on\"".to_owned());
        let paths = [number.to_owned(), other.to_owned()];
        let written = |format| members(&paths, &rows, format).unwrap();
        let csv = String::from_utf8(written(Format::Csv)).unwrap();
        let lines: Vec<&str> = csv.lines().collect();
        assert!(lines[0].starts_with(
            "number,/contacts/0/indentation,/contacts/0/obstacle,status,reason,verdict,normal_force"
        ));
        assert!(
            lines[1].starts_with(r#"0,0.5,"{""kind"":""flat"",""to"":1}",queued,,,,"#),
            "{csv}"
        );
        assert!(lines[2].starts_with("1,,,queued,,,7.5,"), "{csv}");
        assert!(
            lines[2].ends_with(r#","after 3 iterations, and ""so on""""#),
            "{csv}"
        );
        let jsonl = String::from_utf8(written(Format::Jsonl)).unwrap();
        let row: Value = serde_json::from_str(jsonl.lines().next().unwrap()).unwrap();
        assert_eq!(
            (&row[number], &row["normal_force"]),
            (&0.5.into(), &Value::Null)
        );
        assert!(!written(Format::Arrow).is_empty() && !written(Format::Npz).is_empty());
        assert_eq!(
            serde_json::from_slice::<Value>(&written(Format::Json)).unwrap()[1]["number"],
            1
        );
        assert!(members(&paths, &rows, Format::Vtu).is_err());
    }

    #[test]
    fn names_and_media_types_are_unique() {
        for (n, one) in Format::VARIANTS.iter().enumerate() {
            for other in &Format::VARIANTS[n + 1..] {
                assert_ne!(one.name(), other.name());
                assert_ne!(one.media_type(), other.media_type());
            }
        }
    }
}
