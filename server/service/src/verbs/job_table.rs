//! The operation that returns many jobs, with the numbers of their results, as one table.

use std::{
    borrow::Cow,
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use base::{
    caller::Caller,
    job::Job,
    values::{Integers, Values, Words},
};
use files::table::{self, Table};
use futures_util::future::BoxFuture;
use serde_json::{Value, json};
use solver::solution::{ErrorMethod, EstimatedQuantity, QuantityName};
use store::{Filter, Order};

use super::{
    lists,
    page::{MAX_PAGE_SIZE, PAGE_SIZE, Page, Paging},
    service::Service,
};
use crate::{error::ApiError, parameters::Parameter};

/// The maximum number of rows of an answer; many rows are the point of a table, so it is also the default.
pub const ROWS: Parameter<Integers> = Parameter {
    name: PAGE_SIZE.name,
    meaning: "Maximum number of rows of the answer; default 1000",
    values: Integers(1..=MAX_PAGE_SIZE),
};

/// The name of the header with the token of the next page, for the formats that have no place for it.
pub const NEXT_PAGE_TOKEN: &str = "next-page-token";

/// The columns of the table.
pub const COLUMNS: Parameter<ColumnNames> = Parameter {
    name: "columns",
    meaning: "Columns of the table, separated by commas and in this order: those of a job, label.KEY for the value of a label, normal_force for a number of the result of a job with one contact, normal_force.BOUNDARY for that of the contact of this name, likewise normal_force_error for its ±, and /contacts/0/friction/coefficient for a value of the problem, by its JSON Pointer, empty for a problem of more than 256 KiB and beyond 8 MiB of problems in all; default: id, name, status, reason, verdict, created_at, run_s, contacts, all numbers with their errors, severity (of the most severe warning), warnings, labels. A peak that grows on finer meshes has no number",
    values: ColumnNames,
};

/// Whether the table also has the values in which the problems of its jobs differ.
pub const DIFFERING: Parameter<Words<bool>> = Parameter {
    name: "differing",
    meaning: "Whether the table also has the values in which the problems of its rows differ, each as a column named by its JSON Pointer; at most 50, of problems of at most 256 KiB each and 8 MiB in all; default false",
    values: Words(|| vec![("false", false), ("true", true)]),
};

/// The largest number of columns of a table.
const MOST_COLUMNS: usize = 100;

/// The allowed values of the parameter: the names of columns, each once.
#[derive(Clone, Copy, Debug)]
pub struct ColumnNames;

impl Values for ColumnNames {
    type Value = Columns;

    fn schema(&self) -> serde_json::Value {
        json!({ "type": "string" })
    }

    fn expected(&self) -> String {
        let fields = FIELDS.iter().map(|(name, _)| *name);
        let numbers = NUMBERS.iter().map(|quantity| <&str>::from(*quantity));
        let names: Vec<&str> = fields.chain(numbers).collect();
        format!(
            "at most {MOST_COLUMNS} of these, each once and separated by commas: {}, label.KEY; also the errors of numbers, as normal_force{ERROR}, \
             numbers of the contact of a boundary, as normal_force.BOUNDARY and normal_force{ERROR}.BOUNDARY, and values of the problem by their \
             JSON Pointers, as /contacts/0/indentation",
            names.join(", "),
        )
    }

    fn read(&self, text: &str) -> Option<Columns> {
        let columns: Option<Vec<Column>> = text.split(',').map(column).collect();
        let columns = columns?;
        let mut seen = BTreeSet::new();
        let each_once = columns
            .iter()
            .all(|column| seen.insert(column.name.clone()));
        (each_once && columns.len() <= MOST_COLUMNS).then_some(Columns(columns))
    }

    /// The unknown names, and those that are there twice.
    fn fault<'t>(&self, text: &'t str) -> Cow<'t, str> {
        let mut seen = BTreeSet::new();
        let mut wrong: Vec<&str> = text.split(',').collect();
        wrong.retain(|name| !seen.insert(*name) || column(name).is_none());
        match wrong.join(",") {
            none if none.is_empty() => text.into(),
            wrong => wrong.into(),
        }
    }
}

/// The columns of a table, in their order.
#[derive(Clone, Debug)]
pub struct Columns(Vec<Column>);

#[derive(Clone, Debug)]
struct Column {
    name: String,
    of: Of,
}

/// What a column has of a job.
#[derive(Clone, Debug)]
enum Of {
    Field(Field),
    Label(String),
    /// A value of the problem, by its JSON Pointer.
    Parameter(String),
    Number {
        quantity: QuantityName,
        /// The name of the contact; `None`: the only one of the job.
        contact: Option<String>,
        /// Whether the column has the error of the number, not the number.
        error: bool,
    },
}

/// A field of a job in a column.
#[derive(Clone, Copy, Debug)]
enum Field {
    Text(fn(&Job) -> Cow<'static, str>),
    Real(fn(&Job) -> Option<f64>),
    Whole(fn(&Job) -> u32),
}

/// The columns from the fields of a job, in the order in which they are listed.
#[rustfmt::skip] // a column in a row
const FIELDS: &[(&str, Field)] = &[
    ("id",               Field::Text(|job| job.id.to_string().into())),
    ("name",             Field::Text(|job| job.name.clone().unwrap_or_default().into())),
    ("status",           Field::Text(|job| <&str>::from(job.status).into())),
    ("reason",           Field::Text(|job| job.reason.map_or("", <&str>::from).into())),
    ("detail",           Field::Text(|job| job.failure.as_ref().map_or(Cow::Borrowed(""), |failure| failure.detail.clone().into()))),
    ("owner",            Field::Text(|job| job.owner.clone().into())),
    ("priority",         Field::Real(|job| Some(job.priority.into()))),
    ("attempt",          Field::Whole(|job| job.attempt.unsigned_abs())),
    ("created_at",       Field::Text(|job| job.created_at.to_string().into())),
    ("started_at",       Field::Text(|job| job.started_at.map_or(Cow::Borrowed(""), |time| time.to_string().into()))),
    ("finished_at",      Field::Text(|job| job.finished_at.map_or(Cow::Borrowed(""), |time| time.to_string().into()))),
    ("queue_wait_s",     Field::Real(|job| job.queue_wait_s)),
    ("run_s",            Field::Real(|job| job.run_s)),
    ("iterations",       Field::Whole(|job| job.progress.as_ref().map_or(0, |made| made.iteration))),
    ("result_available", Field::Text(|job| <&str>::from(job.result_available).into())),
    ("verdict",          Field::Text(|job| job.verdict.map_or("", <&str>::from).into())),
    ("contacts",         Field::Text(|job| contacts(job).join(", ").into())),
    ("without_limit",    Field::Whole(without_limit)),
    ("severity",         Field::Text(|job| severity(job).into())),
    ("warnings",         Field::Text(|job| warnings(job).into())),
    ("input_hash",       Field::Text(|job| job.input_hash.clone().into())),
    ("cached_from",      Field::Text(|job| job.cached_from.map_or(Cow::Borrowed(""), |id| id.to_string().into()))),
    ("parent",           Field::Text(|job| job.parent.map_or(Cow::Borrowed(""), |id| id.to_string().into()))),
    ("sweep",            Field::Text(|job| job.sweep.map_or(Cow::Borrowed(""), |id| id.to_string().into()))),
    ("pinned",           Field::Text(|job| if job.pinned { "true" } else { "false" }.into())),
    ("stored_bytes",     Field::Real(|job| job.stored_bytes.map(|bytes| bytes as f64))),
    ("labels",           Field::Text(|job| labels(job).into())),
];

/// The numbers of a result that a job has with their errors.
const NUMBERS: &[QuantityName] = &[
    QuantityName::NormalForce,
    QuantityName::TangentialForce,
    QuantityName::FrictionForce,
    QuantityName::PeakNormalStress,
    QuantityName::PeakTangentialStress,
    QuantityName::Indentation,
    QuantityName::TangentialDisplacement,
    QuantityName::Tilt,
];

/// How many numbers of a result have no limit: they grow on finer meshes, and mean nothing.
fn without_limit(job: &Job) -> u32 {
    let without = job
        .quantities
        .iter()
        .filter(|quantity| quantity.method == ErrorMethod::NoLimit);
    without.count() as u32
}

/// What the name of a number's column has behind it if the column has the errors.
const ERROR: &str = "_error";

impl Default for Columns {
    fn default() -> Columns {
        let before = [
            "id",
            "name",
            "status",
            "reason",
            "verdict",
            "created_at",
            "run_s",
            "contacts",
        ];
        // motions only where they are asked for: few obstacles have loads
        let numbers = NUMBERS
            .iter()
            .filter(|quantity| !quantity.is_motion())
            .flat_map(|quantity| {
                let name = <&str>::from(*quantity);
                [name.to_owned(), format!("{name}{ERROR}")]
            });
        let all = before.map(str::to_owned).into_iter().chain(numbers);
        let all = all.chain(["severity", "warnings", "labels"].map(str::to_owned));
        Columns(all.filter_map(|name| column(&name)).collect())
    }
}

/// The column of this name; `None` if there is none.
fn column(name: &str) -> Option<Column> {
    let field = FIELDS.iter().find(|(known, _)| *known == name);
    let of = match (field, name.strip_prefix("label.")) {
        (Some((_, field)), _) => Of::Field(*field),
        (None, Some(key)) => Of::Label(key.to_owned()),
        (None, None) if name.starts_with('/') => Of::Parameter(name.to_owned()),
        (None, None) => {
            let (number, contact) = match name.split_once('.') {
                // the error of a number comes before the contact
                Some((_, contact)) if contact.ends_with(ERROR) => return None,
                Some((number, contact)) => (number, Some(contact.to_owned())),
                None => (name, None),
            };
            let (number, error) = match number.strip_suffix(ERROR) {
                Some(number) => (number, true),
                None => (number, false),
            };
            let mut all = NUMBERS.iter().copied();
            let quantity = all.find(|quantity| <&str>::from(*quantity) == number)?;
            Of::Number {
                quantity,
                contact,
                error,
            }
        }
    };
    let name = name.to_owned();
    Some(Column { name, of })
}

/// The contacts of whose result a job has numbers, in its order.
fn contacts(job: &Job) -> Vec<&str> {
    let mut names: Vec<&str> = vec![];
    for number in &job.quantities {
        if !names.contains(&number.contact.as_str()) {
            names.push(&number.contact);
        }
    }
    names
}

/// The severity of the most severe warning; empty if there is none.
fn severity(job: &Job) -> &'static str {
    let all = job.warnings.iter().map(|warning| warning.code.severity());
    all.min().map_or("", <&str>::from)
}

fn warnings(job: &Job) -> String {
    let codes = job.warnings.iter().map(|warning| warning.code.as_str());
    codes.collect::<Vec<_>>().join(" ")
}

fn labels(job: &Job) -> String {
    if job.labels.is_empty() {
        return String::new();
    }
    json!(job.labels).to_string()
}

impl Columns {
    /// The table of these jobs, a row for each. Of a job without a solution the table has no numbers unless they are
    /// wanted (`partial`): they are those of the state at which it stopped.
    ///
    /// `problems`: the values of each job's problem by their pointers, if there is a column that needs them.
    pub fn of(&self, jobs: &[Job], partial: bool, problems: &[Leaves]) -> Table {
        let columns = self.0.iter().map(|Column { name, of }| table::Column {
            name: name.clone().into(),
            values: match of {
                Of::Field(Field::Text(text)) => {
                    table::Values::Text(jobs.iter().map(text).collect())
                }
                Of::Field(Field::Real(real)) => reals(jobs, real),
                Of::Field(Field::Whole(whole)) => {
                    table::Values::Whole(jobs.iter().map(whole).collect())
                }
                Of::Label(key) => {
                    let value = |job: &Job| job.labels.get(key).cloned().unwrap_or_default().into();
                    table::Values::Text(jobs.iter().map(value).collect())
                }
                Of::Parameter(pointer) => parameter(problems, pointer, jobs.len()),
                Of::Number {
                    quantity,
                    contact,
                    error,
                } => reals(jobs, |job| {
                    let shown = partial || !job.status.is_without_solution();
                    let found = shown.then(|| number(job, *quantity, contact.as_deref()))??;
                    // a peak that grows on finer meshes is that of the mesh
                    let means_nothing = found.method == ErrorMethod::NoLimit;
                    if means_nothing {
                        None
                    } else if *error {
                        found.error
                    } else {
                        Some(found.value)
                    }
                }),
            },
        });
        Table {
            columns: columns.collect(),
        }
    }

    /// Whether a column has values of the problem.
    pub fn has_parameters(&self) -> bool {
        let mut all = self.0.iter();
        all.any(|column| matches!(column.of, Of::Parameter(_)))
    }

    /// These columns, and further ones for the values in which the problems differ.
    pub fn with_differing(mut self, problems: &[Leaves]) -> Columns {
        let known: BTreeSet<String> = self.names().map(str::to_owned).collect();
        let new = differing(problems).into_iter();
        let new = new.filter(|name| !known.contains(name));
        self.0.extend(new.filter_map(|name| column(&name)));
        self
    }

    /// The names of the columns.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(|column| column.name.as_str())
    }
}

/// The scalar values of a problem, by their JSON Pointers; a list of more than three numbers or points is one value.
pub type Leaves = BTreeMap<String, Value>;

/// The largest problem whose values a table has (bytes): one with a mesh in it is larger, and is left empty.
const MOST_PROBLEM_BYTES: usize = 256 << 10;
/// The most text of problems that a table reads (bytes): as values it takes many times as much memory. Further problems are
/// left empty.
const MOST_READ_BYTES: usize = 8 << 20;
/// The largest number of values of one problem that are compared.
const MOST_LEAVES: usize = 2000;
/// The largest number of columns that are added for values that differ.
const MOST_DIFFERING: usize = 50;

/// The longest list whose items are values of their own, as those of a point are; those of a grid are not.
const MOST_ITEMS: usize = 3;
/// The longest text of a value in a table (characters).
const MOST_TEXT: usize = 60;

/// The scalar values of a problem as JSON.
pub fn leaves_of(problem: &str) -> Leaves {
    let mut found = Leaves::new();
    if let Ok(value) = serde_json::from_str(problem) {
        leaves(&value, &mut String::new(), &mut found);
    }
    found
}

/// Collects the scalar values in a JSON value.
fn leaves(value: &Value, pointer: &mut String, found: &mut Leaves) {
    let length = pointer.len();
    let mut inside = |token: &str, value: &Value| {
        *pointer += &format!("/{}", token.replace('~', "~0").replace('/', "~1"));
        leaves(value, pointer, found);
        pointer.truncate(length);
    };
    match value {
        Value::Object(members) => members.iter().for_each(|(name, value)| inside(name, value)),
        Value::Array(items) if items.len() <= MOST_ITEMS || items.iter().any(Value::is_object) => {
            items
                .iter()
                .enumerate()
                .for_each(|(n, value)| inside(&n.to_string(), value))
        }
        scalar if found.len() < MOST_LEAVES => {
            found.insert(pointer.clone(), scalar.clone());
        }
        _ => {}
    }
}

/// The column of a value of the problems: numbers if all are numbers, otherwise texts.
fn parameter(problems: &[Leaves], pointer: &str, jobs: usize) -> table::Values {
    let values = (0..jobs).map(|n| problems.get(n).and_then(|leaves| value_at(leaves, pointer)));
    let is_number = |value: &Option<&Value>| value.is_none_or(Value::is_number);
    if values.clone().all(|value| is_number(&value)) {
        let number = |value: Option<&Value>| value.and_then(Value::as_f64).unwrap_or(f64::NAN);
        return table::Values::Real(values.map(number).collect());
    }
    let text = |value: Option<&Value>| match value {
        None => Cow::Borrowed(""),
        Some(Value::String(text)) => text.chars().take(MOST_TEXT).collect::<String>().into(),
        Some(Value::Array(items)) => shortened(items).into(),
        Some(other) => other.to_string().into(),
    };
    table::Values::Text(values.map(text).collect())
}

/// The value at a pointer: also one of the numbers of a long list.
fn value_at<'a>(leaves: &'a Leaves, pointer: &str) -> Option<&'a Value> {
    leaves.get(pointer).or_else(|| {
        let (list, place) = pointer.rsplit_once('/')?;
        leaves.get(list)?.get(place.parse::<usize>().ok()?)
    })
}

/// A list as JSON; of a long one the beginning, and how many items it has.
fn shortened(items: &[Value]) -> String {
    let whole = Value::from(items).to_string();
    let Some((end, _)) = whole.char_indices().nth(MOST_TEXT) else {
        return whole;
    };
    let end = whole[..end].rfind(',').unwrap_or(end);
    format!("{}, … ({} in all)", &whole[..end], items.len())
}

/// The pointers of values that are not the same in all problems, in order.
fn differing(problems: &[Leaves]) -> Vec<String> {
    let known: BTreeSet<&String> = problems.iter().flat_map(BTreeMap::keys).collect();
    let with_values: Vec<&Leaves> = problems
        .iter()
        .filter(|leaves| !leaves.is_empty())
        .collect();
    let differs = |pointer: &&&String| {
        let mut values = with_values.iter().map(|leaves| leaves.get(**pointer));
        let first = values.next();
        values.any(|value| Some(value) != first)
    };
    known
        .iter()
        .filter(differs)
        .take(MOST_DIFFERING)
        .map(|pointer| (*pointer).clone())
        .collect()
}

fn reals(jobs: &[Job], value: impl Fn(&Job) -> Option<f64>) -> table::Values {
    let values = jobs.iter().map(|job| value(job).unwrap_or(f64::NAN));
    table::Values::Real(values.collect())
}

/// A number of the result of a job: of the contact of this name, or of the only one.
fn number<'a>(
    job: &'a Job,
    quantity: QuantityName,
    contact: Option<&str>,
) -> Option<&'a EstimatedQuantity> {
    let contact = match (contact, contacts(job).as_slice()) {
        (Some(name), _) => name,
        (None, [only]) => only,
        (None, _) => return None,
    };
    let mut all = job.quantities.iter();
    all.find(|number| number.quantity == quantity && number.contact == contact)
}

/// A request for the table of jobs.
#[derive(Debug, Default)]
pub struct Request {
    /// Which jobs the table has.
    pub filter: Filter,
    /// Their order; absent: newest first.
    pub order: Option<Order>,
    /// The part of the table that is requested.
    pub paging: Paging,
    /// The columns; absent: the default ones.
    pub columns: Option<Columns>,
    /// Whether the numbers of jobs without a solution will do.
    pub partial: bool,
    /// Whether the values in which the problems differ are added as columns.
    pub differing: bool,
}

/// Returns the rows of the jobs that match the filter. A damaged job is an error, as in lists: a row is never left out
/// without a word.
pub fn table<'a>(
    service: &'a Arc<Service>,
    caller: &'a Caller,
    request: Request,
) -> BoxFuture<'a, Result<(Table, Option<String>), ApiError>> {
    Box::pin(async move {
        let Request {
            filter,
            order,
            mut paging,
            columns,
            partial,
            differing: adds_differing,
        } = request;
        paging.size.get_or_insert(MAX_PAGE_SIZE);
        let Page { items, next } = lists::list(service, caller, &filter, order, &paging).await?;
        let mut columns = columns.unwrap_or_default();
        let mut problems: Vec<Leaves> = vec![];
        let mut read_bytes = 0;
        if adds_differing || columns.has_parameters() {
            for job in &items {
                let problem = service.store.small_problem(job.key, MOST_PROBLEM_BYTES);
                let problem = problem.await?;
                let problem = problem.filter(|text| {
                    read_bytes += text.len();
                    read_bytes <= MOST_READ_BYTES
                });
                let read = move || problem.map_or(Leaves::new(), |text| leaves_of(&text));
                problems.push(service.work(read).await?);
            }
        }
        let make = move || {
            if adds_differing {
                columns = columns.with_differing(&problems);
            }
            columns.of(&items, partial, &problems)
        };
        Ok((service.work(make).await?, next))
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use base::job::Status;

    use super::*;

    fn number(contact: &str, value: f64, error: Option<f64>) -> EstimatedQuantity {
        EstimatedQuantity {
            quantity: QuantityName::NormalForce,
            contact: contact.into(),
            value,
            finer: None,
            difference: None,
            order: None,
            error,
            increments: None,
            direction: None,
            measurement: None,
            relative: None,
            method: ErrorMethod::Unknown,
        }
    }

    fn job(status: Status, numbers: &[EstimatedQuantity]) -> Job {
        Job {
            status,
            name: Some("=1+1".into()),
            labels: [("study".to_owned(), "a, b".to_owned())].into(),
            quantities: numbers.to_vec(),
            ..Job::default()
        }
    }

    fn csv(columns: &str, jobs: &[Job], partial: bool) -> String {
        let columns = COLUMNS.read(columns).unwrap();
        columns.of(jobs, partial, &[]).csv().unwrap()
    }

    #[test]
    fn each_column_is_known_by_its_name_and_listed_when_another_was_given() {
        for name in Columns::default().names() {
            assert!(column(name).is_some(), "{name}");
        }
        let all =
            "id,label.study,label.,normal_force,normal_force_error.top,peak_normal_stress.a.b";
        assert_eq!(
            COLUMNS
                .read(all)
                .unwrap()
                .names()
                .collect::<Vec<_>>()
                .join(","),
            all
        );
        for wrong in [
            "",
            "id,",
            "id,id",
            "ID",
            "contact_start",
            "normal_force_error_error",
            "normal_force.top_error",
            "links",
        ] {
            let refused = COLUMNS.read(wrong).unwrap_err().to_string();
            for known in [
                "id, name, status",
                "label.KEY",
                "peak_tangential_stress",
                ".BOUNDARY",
            ] {
                assert!(refused.contains(known), "{refused}");
            }
        }
        let refused = COLUMNS.read("id,normal_forse,label.a,nmae,id").unwrap_err();
        let refused = refused.to_string();
        assert!(refused.contains("normal_forse,nmae,id"), "{refused}");
        assert!(!refused.contains("label.a"), "{refused}");
        let many: Vec<String> = (0..=MOST_COLUMNS).map(|n| format!("label.{n}")).collect();
        assert!(COLUMNS.read(&many.join(",")).is_err());
    }

    #[test]
    fn a_number_is_that_of_the_only_contact_or_of_the_named_one() {
        let jobs = [
            job(Status::Succeeded, &[number("top", 2.5, Some(0.5))]),
            job(
                Status::Succeeded,
                &[number("top", 3.0, None), number("hub", 4.0, None)],
            ),
            job(Status::Running, &[]),
        ];
        let shown = csv(
            "contacts,normal_force,normal_force_error,normal_force.hub",
            &jobs,
            false,
        );
        assert_eq!(
            shown,
            "contacts,normal_force,normal_force_error,normal_force.hub\r\ntop,2.5,0.5,\r\n\"top, hub\",,,4.0\r\n,,,\r\n"
        );
    }

    #[test]
    fn a_peak_without_a_limit_is_no_number_of_a_row() {
        let peak = EstimatedQuantity {
            quantity: QuantityName::PeakNormalStress,
            method: ErrorMethod::NoLimit,
            ..number("top", -3043.0, None)
        };
        let jobs = [job(
            Status::Succeeded,
            &[number("top", 2.5, Some(0.5)), peak],
        )];
        assert_eq!(
            csv("normal_force,peak_normal_stress", &jobs, false),
            "normal_force,peak_normal_stress\r\n2.5,\r\n"
        );
    }

    #[test]
    fn numbers_of_a_job_without_a_solution_have_to_be_asked_for() {
        let jobs = [job(Status::Failed, &[number("top", 2.5, None)])];
        assert_eq!(
            csv("status,normal_force", &jobs, false),
            "status,normal_force\r\nfailed,\r\n"
        );
        assert_eq!(
            csv("status,normal_force", &jobs, true),
            "status,normal_force\r\nfailed,2.5\r\n"
        );
    }

    #[test]
    fn values_of_problems_are_columns_and_those_that_differ_are_found() {
        let read = |value: Value| {
            let mut found = Leaves::new();
            leaves(&value, &mut String::new(), &mut found);
            found
        };
        let problems = [
            read(json!({ "a": 1, "b": [2, { "c/d": "x" }], "e": true })),
            read(json!({ "a": 1, "b": [3, { "c/d": "y" }] })),
            Leaves::new(), // too large to be read
        ];
        assert_eq!(differing(&problems), ["/b/0", "/b/1/c~1d", "/e"]);
        let jobs = [
            job(Status::Succeeded, &[]),
            job(Status::Succeeded, &[]),
            job(Status::Queued, &[]),
        ];
        let grid = |last: i32| read(json!({ "x": [0, 1, 2, last] }));
        let grids = [grid(3), grid(4)];
        assert_eq!(differing(&grids), ["/x"]);
        let columns = COLUMNS.read("/x,/x/3").unwrap();
        assert_eq!(
            columns.of(&jobs[..2], false, &grids).csv().unwrap(),
            "/x,/x/3\r\n\"[0,1,2,3]\",3.0\r\n\"[0,1,2,4]\",4.0\r\n"
        );
        let long: Vec<Value> = (0..1000).map(Value::from).collect();
        let short = shortened(&long);
        assert!(short.starts_with("[0,1,2,") && short.ends_with(", … (1000 in all)"));
        assert!(short.chars().count() < MOST_TEXT + 20);
        let columns = COLUMNS.read("/b/0,/b/1/c~1d,/a,/z").unwrap();
        assert_eq!(
            columns.of(&jobs, false, &problems).csv().unwrap(),
            "/b/0,/b/1/c~1d,/a,/z\r\n2.0,x,1.0,\r\n3.0,y,1.0,\r\n,,,\r\n"
        );
    }

    #[test]
    fn a_spreadsheet_runs_nothing_that_a_name_or_label_has() {
        let jobs = [job(Status::Queued, &[])];
        let shown = csv("name,label.study,labels", &jobs, false);
        assert_eq!(
            shown,
            "name,label.study,labels\r\n'=1+1,\"a, b\",\"{\"\"study\"\":\"\"a, b\"\"}\"\r\n"
        );
    }
}
