//! Prints jobs and sweeps.

use std::{borrow::Cow, collections::BTreeSet};

use anyhow::Context;
use base::{
    job::{Job, Status},
    time::Time,
};
use clap::{Args, ValueEnum};
use files::table::{Column, Table, Values};
use serde_json::Value;
use solver::solution::Severity;

use super::super::{output, report, service::misunderstood, table::table};

/// Options for printing answers.
#[derive(Debug, Args)]
#[command(next_help_heading = "Output")]
pub(super) struct Shown {
    /// How to print: json is the service's answer, jsonl has a line and csv a row for each
    #[arg(short, long, value_enum, default_value_t = Format::Table)]
    format: Format,

    /// Print only ids, one on each line
    #[arg(short, long, conflicts_with = "format")]
    quiet: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    Table,
    Json,
    Jsonl,
    Csv,
}

/// Documents to be printed.
pub(super) enum Found {
    /// A single document that was requested by its id.
    One(Value),
    /// A list, even if it has one entry.
    Many(Vec<Value>),
}

impl Found {
    /// The documents for the ids of a command, a single one if it has one id.
    pub(super) fn of(mut documents: Vec<Value>) -> Found {
        match documents.len() {
            1 => Found::One(documents.remove(0)),
            _ => Found::Many(documents),
        }
    }

    fn documents(&self) -> &[Value] {
        match self {
            Found::One(document) => std::slice::from_ref(document),
            Found::Many(documents) => documents,
        }
    }
}

impl Shown {
    pub(super) fn is_table(&self) -> bool {
        self.format == Format::Table && !self.quiet
    }

    /// Prints jobs or sweeps, with a row for each in a table.
    pub(super) fn print(&self, found: &Found) -> anyhow::Result<()> {
        let documents = found.documents();
        let text = match (self.format, found) {
            _ if self.quiet => documents.iter().map(|one| text(one, "id") + "\n").collect(),
            (Format::Json, Found::One(document)) => format!("{document:#}\n"),
            (Format::Json, Found::Many(all)) => format!("{:#}\n", Value::from(all.clone())),
            (Format::Jsonl, _) => documents.iter().map(|one| format!("{one}\n")).collect(),
            (Format::Csv, _) => csv(documents)?,
            (Format::Table, _) => within(width(), lines(documents)?),
        };
        Ok(output::print(&text)?)
    }

    /// Prints jobs or sweeps; in place of a table, everything that is known about each.
    pub(super) fn print_whole(&self, found: &Found) -> anyhow::Result<()> {
        if !self.is_table() {
            return self.print(found);
        }
        let mut cards = vec![];
        for document in found.documents() {
            cards.push(if is_sweep(document) {
                sweep_card(document)
            } else {
                card(&job(document)?)
            });
        }
        Ok(output::print(&cards.join("\n"))?)
    }
}

/// Reads a job from the service's document.
pub(super) fn job(document: &Value) -> anyhow::Result<Job> {
    let job = serde_json::from_value(document.clone());
    job.with_context(|| misunderstood("the job"))
}

fn is_sweep(document: &Value) -> bool {
    document["members"].is_object()
}

/// The value of a field as text, without quotation marks; empty if it is absent.
fn text(document: &Value, key: &str) -> String {
    match &document[key] {
        Value::Null => String::new(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

/// The width of the terminal; `None` if the output is no terminal.
fn width() -> Option<usize> {
    let (_, columns) = console::Term::stdout().size_checked()?;
    Some(columns.into())
}

/// The lines of a table, cut where a terminal of this width would wrap them.
fn within(width: Option<usize>, table: String) -> String {
    let Some(width) = width else { return table };
    let lines = table.lines();
    let cut = |line| console::truncate_str(line, width, "…").into_owned() + "\n";
    lines.map(cut).collect()
}

fn lines(documents: &[Value]) -> anyhow::Result<String> {
    // the most important first: a narrow terminal shows no more
    let headings = [
        "ID",
        "STATUS",
        "VERDICT",
        "NAME",
        "TIME",
        "SUBMITTED (UTC)",
        "OWNER",
        "NOTES",
    ];
    let mut rows = vec![];
    for document in documents {
        let (time, notes) = if is_sweep(document) {
            (String::new(), members(document))
        } else {
            let job = job(document)?;
            (job.run_s.map_or(String::new(), seconds), notes(&job))
        };
        let submitted = text(document, "created_at");
        rows.push([
            text(document, "id"),
            text(document, "status"),
            text(document, "verdict"),
            shortened(&text(document, "name"), 32),
            time,
            // to the second
            submitted.get(..19).unwrap_or_default().replace('T', " "),
            text(document, "owner"),
            notes,
        ]);
    }
    Ok(table(headings, &rows))
}

/// The most important remarks about a job, for its row in a table.
fn notes(job: &Job) -> String {
    let mut notes = vec![];
    match (&job.queue, &job.progress) {
        (Some(queue), _) if job.status == Status::Queued => {
            let why = <&str>::from(queue.reason).replace('_', " ");
            notes.push(format!("{} before it, {why}", queue.ahead));
        }
        (_, Some(progress)) if job.status == Status::Running => {
            notes.push(format!(
                "{}, iteration {}",
                progress.stage, progress.iteration
            ));
        }
        _ => {}
    }
    notes.extend(
        job.reason
            .map(|reason| <&str>::from(reason).replace('_', " ")),
    );
    if job.cached_from.is_some() {
        notes.push("from an earlier result".into());
    }
    let warnings = job.warnings.iter().map(|warning| warning.code);
    let grave = warnings.filter(|code| code.severity() < Severity::Note);
    notes.extend(grave.map(|code| code.as_str().to_owned()));
    // both ends of a contact may have the same
    let mut told = BTreeSet::new();
    notes.retain(|note| told.insert(note.clone()));
    notes.join("; ")
}

/// The number of members of a sweep that have ended, in words.
fn members(sweep: &Value) -> String {
    let count = |key: &str| sweep["members"][key].as_u64().unwrap_or_default();
    let ended = count("succeeded") + count("failed") + count("canceled");
    match count("failed") {
        0 => format!("{ended} of {} members", count("total")),
        failed => format!("{ended} of {} members, {failed} failed", count("total")),
    }
}

/// Writes a duration for people.
pub(super) fn seconds(seconds: f64) -> String {
    match seconds {
        s if s < 10.0 => format!("{s:.3} s"),
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

fn shortened(text: &str, most: usize) -> String {
    if text.chars().count() > most {
        text.chars().take(most - 1).chain(['…']).collect()
    } else {
        text.to_owned()
    }
}

/// All facts about a job, one on each line.
fn card(job: &Job) -> String {
    let time = |time: &Option<Time>| time.map(|time| time.to_string());
    let mut lines = vec![("job", Some(job.id.to_string()))];
    lines.push(("status", Some(<&str>::from(job.status).to_owned())));
    lines.push(("name", job.name.clone()));
    let labels = job
        .labels
        .iter()
        .map(|(key, value)| format!("{key}={value}"));
    let labels: Vec<String> = labels.collect();
    lines.push(("labels", (!labels.is_empty()).then(|| labels.join(", "))));
    lines.push(("owner", Some(job.owner.clone())));
    lines.push((
        "priority",
        (job.priority != 0).then(|| job.priority.to_string()),
    ));
    lines.push(("submitted", Some(job.created_at.to_string())));
    lines.push(("started", time(&job.started_at)));
    lines.push(("ended", time(&job.finished_at)));
    lines.push(("waited", job.queue_wait_s.map(seconds)));
    lines.push(("ran", job.run_s.map(seconds)));
    let queue = job.queue.as_ref().map(|queue| {
        let why = <&str>::from(queue.reason).replace('_', " ");
        format!("place {}, {why}", queue.position)
    });
    lines.push(("queue", queue));
    let progress = job.progress.as_ref().filter(|_| !job.status.is_terminal());
    let progress = progress.map(|progress| {
        let residual = progress.residual.map_or(String::new(), |residual| {
            format!(", residual {residual:.1e}")
        });
        format!(
            "{}, iteration {}{residual}",
            progress.stage, progress.iteration
        )
    });
    lines.push(("progress", progress));
    lines.push((
        "attempts",
        (job.attempt > 1).then(|| job.attempt.to_string()),
    ));
    lines.push(("result of", job.cached_from.map(|id| id.to_string())));
    lines.push(("retries", job.parent.map(|id| id.to_string())));
    lines.push(("sweep", job.sweep.map(|id| id.to_string())));
    lines.push(("kept for ever", job.pinned.then(|| "yes".into())));
    lines.push((
        "result",
        Some(<&str>::from(job.result_available).to_owned()),
    ));
    lines.push(("verdict", report::headline(job)));
    for warning in &job.warnings {
        lines.push((
            warning.code.severity().into(),
            Some(format!("{}: {}", warning.pointer, warning.message)),
        ));
    }
    if let Some(failure) = &job.failure {
        lines.push((
            "failure",
            Some(format!(
                "{} ({}): {}",
                failure.title, failure.code, failure.detail
            )),
        ));
    }
    report::lines(
        lines
            .into_iter()
            .filter_map(|(name, value)| Some((name, value?))),
    )
}

fn sweep_card(sweep: &Value) -> String {
    let some = |key: &'static str, name: &'static str| {
        let value = text(sweep, key);
        (!value.is_empty()).then_some((name, value))
    };
    let counts = sweep["members"].as_object().into_iter().flatten();
    let counts: Vec<String> = counts
        .filter(|(_, count)| count.as_u64() != Some(0))
        .map(|(name, count)| format!("{count} {name}"))
        .collect();
    let paths = sweep["paths"].as_array().into_iter().flatten();
    let paths: Vec<&str> = paths.filter_map(Value::as_str).collect();
    let lines = [
        some("id", "sweep"),
        some("status", "status"),
        some("name", "name"),
        some("owner", "owner"),
        some("created_at", "submitted"),
        some("finished_at", "ended"),
        Some(("members", counts.join(", "))),
        some("jobs", "jobs"),
        Some(("differ in", paths.join(", "))),
    ];
    report::lines(lines.into_iter().flatten())
}

/// Writes jobs or sweeps as CSV: the columns are their simple values, but no lists.
fn csv(documents: &[Value]) -> anyhow::Result<String> {
    const TEXTS: [&str; 14] = [
        "id",
        "status",
        "reason",
        "name",
        "owner",
        "priority",
        "attempt",
        "created_at",
        "started_at",
        "finished_at",
        "queue_wait_s",
        "run_s",
        "result_available",
        "input_hash",
    ];
    let column = |name: &'static str, cell: &dyn Fn(&Value) -> String| Column {
        name: name.into(),
        values: Values::Text(documents.iter().map(|one| Cow::Owned(cell(one))).collect()),
    };
    let mut columns: Vec<Column> = TEXTS
        .iter()
        .map(|name| column(name, &|one| text(one, name)))
        .collect();
    columns.push(column("warnings", &|one| {
        let all = one["warnings"].as_array().into_iter().flatten();
        let codes: Vec<&str> = all.filter_map(|warning| warning["code"].as_str()).collect();
        codes.join(" ")
    }));
    columns.push(column("verdict", &|one| text(one, "verdict")));
    columns.extend(quantities(documents));
    columns.push(column("labels", &|one| match one["labels"].as_object() {
        Some(labels) if !labels.is_empty() => one["labels"].to_string(),
        _ => String::new(),
    }));
    Table { columns }.csv().map_err(anyhow::Error::msg)
}

/// Columns of the forces and peaks of results with their errors. Where jobs have several contacts, a column has the name
/// of its contact too: `normal_force.hub`.
fn quantities(documents: &[Value]) -> Vec<Column> {
    // numbers of a state that is no solution would be taken for results
    fn of(one: &Value) -> impl Iterator<Item = &Value> {
        let status = one["status"].as_str().and_then(|name| name.parse().ok());
        let solved = status.is_none_or(|status: Status| !status.is_without_solution());
        let all = one["quantities"].as_array().filter(|_| solved);
        all.into_iter().flatten()
    }
    fn name(q: &Value) -> [&str; 2] {
        ["contact", "quantity"].map(|key| q[key].as_str().unwrap_or_default())
    }
    let mut names: Vec<[&str; 2]> = documents.iter().flat_map(of).map(name).collect();
    let mut seen = BTreeSet::new();
    names.retain(|name| seen.insert(*name));
    let contacts: BTreeSet<&str> = names.iter().map(|[contact, _]| *contact).collect();
    let mut columns = vec![];
    for wanted in names {
        let [contact, quantity] = wanted;
        let of_contact = match contacts.len() {
            1 => String::new(),
            _ => format!(".{contact}"),
        };
        for (key, suffix) in [("value", ""), ("error", "_error")] {
            let cell = |one| {
                let found = of(one).find(|q| name(q) == wanted);
                Cow::Owned(found.map_or(String::new(), |q| text(q, key)))
            };
            columns.push(Column {
                name: format!("{quantity}{suffix}{of_contact}").into(),
                values: Values::Text(documents.iter().map(cell).collect()),
            });
        }
    }
    columns
}
