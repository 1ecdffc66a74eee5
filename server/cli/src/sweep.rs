//! The command `signorini sweep FILE`: solves all members of a sweep, by the same code as a worker of the service.

use std::{
    borrow::Cow,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use anyhow::Context;
use base::{job::Status, run::members::Members, sweep::MemberRow};
use clap::Args;
use files::{
    body::{Body, Embedded},
    sweep::{Axis, Mode, Points, Sweep, Variation, groups},
};
use schemars::JsonSchema;
use serde::{Deserialize, de::IgnoredAny};
use serde_json::{Value, value::RawValue};
use service::{
    config::MemoryBudget,
    error::ApiError,
    formats::{self, Format},
};
use solver::{
    error::{Reason, Violation},
    observer::{Observer, Progress},
};

use super::{
    exit::{Exit, refuse},
    output,
    solve::{Threads, check_memory, invalid},
};

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  signorini sweep examples/sweeps/stick_width.json -o study.csv\n\nThe sweep is solved on this machine, without a service; `signorini submit` accepts the same file."
)]
pub(super) struct Arguments {
    /// The sweep: a JSON file as for POST /v1/sweeps; `base` may also be the path of a problem, relative to that file's
    /// folder
    file: PathBuf,

    /// Write the table to this file, in the format of its extension: .json, .csv, .jsonl, .arrow or .npz; - writes JSON
    /// to standard output. Without a file the table is printed as CSV
    #[arg(short, long, value_name = "OUT")]
    output: Option<PathBuf>,

    #[command(flatten)]
    memory: MemoryBudget,

    #[command(flatten)]
    threads: Threads,
}

/// The fields of a file with a sweep; fields that only the service uses are ignored.
#[derive(Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Definition {
    #[serde(rename = "base")]
    _base: Embedded,
    #[serde(default)]
    axes: Option<Vec<Axis>>,
    #[serde(default)]
    mode: Option<Mode>,
    #[serde(default)]
    #[schemars(with = "Option<Points>")]
    points: Option<Vec<Box<RawValue>>>,
    #[serde(default, rename = "name")]
    #[schemars(with = "Value")]
    _name: IgnoredAny,
    #[serde(default, rename = "labels")]
    #[schemars(with = "Value")]
    _labels: IgnoredAny,
    #[serde(default, rename = "priority")]
    #[schemars(with = "Value")]
    _priority: IgnoredAny,
    #[serde(default, rename = "limits")]
    #[schemars(with = "Value")]
    _limits: IgnoredAny,
}

/// The time between two reports of progress.
const PAUSE: Duration = Duration::from_millis(500);

pub(super) fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let Arguments {
        file,
        output,
        memory,
        threads,
    } = arguments;
    let text =
        std::fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
    let text = text.strip_prefix(files::BYTE_ORDER_MARK).unwrap_or(&text);
    let format = output.as_deref().map(format_of).transpose();
    let format = format.map_err(refuse)?;
    let sweep = read(file, text)?;
    let groups = groups(&sweep).map_err(|violations| invalid(file, &violations))?;
    let Sweep { base, plan } = &sweep;
    for group in &groups {
        // what else is wrong with a member is told in its row
        if let Some(first) = group.first()
            && let Ok(problem) = plan.whole_problem(*first, &base.mesh)
            && let Ok(estimate) = solver::estimate(&problem, None)
        {
            let member = format_args!("{}: member {first}", file.display());
            check_memory(estimate, memory, member)?;
        }
    }
    let count = plan.count();
    let (mut rows, mut told) = (Vec::with_capacity(count), Instant::now());
    for group in &groups {
        let external = |problem: &_| files::external_mesh(problem, None);
        let mut members = Members::new(plan, group, &base.mesh, &external, &solver::prepare, None);
        for number in group {
            rows.push(members.row(*number, &mut Unseen(*threads))?);
            if told.elapsed() >= PAUSE || rows.len() == count {
                eprintln!("{} of {count} members", rows.len());
                told = Instant::now();
            }
        }
    }
    rows.sort_unstable_by_key(|row: &MemberRow| row.number);
    for row in &mut rows {
        row.with_values(plan);
    }
    let written =
        |format| formats::members(plan.paths(), &rows, format).map_err(anyhow::Error::msg);
    match (output, format) {
        (Some(path), Some(format)) if path.as_os_str() != "-" => {
            let bytes = written(format)?;
            output::replace(path, |out| Ok(out.write_all(&bytes)?))
                .with_context(|| format!("cannot write {}", path.display()))?;
        }
        (_, format) => {
            let bytes = written(format.unwrap_or(Format::Csv))?;
            output::print(&String::from_utf8_lossy(&bytes))?;
        }
    }
    let worst = rows.iter().filter(|row| row.verdict.is_some());
    if let Some(row) = worst.max_by_key(|row| row.verdict)
        && let Some(verdict) = row.verdict
    {
        // of the first and the last member on each body, and of those with meshes of their own
        eprintln!("member {}: {}", row.number, verdict.in_words());
    }
    let failed = rows.iter().filter(|row| row.status != Status::Succeeded);
    let failed: Vec<&MemberRow> = failed.collect();
    for row in failed.iter().take(10) {
        let reason = row.reason.map_or("", <&str>::from);
        let first = row.violations.first().map(|v| format!(": {v}"));
        eprintln!(
            "member {}: {reason}{}",
            row.number,
            first.unwrap_or_default()
        );
    }
    Ok(match failed.len() {
        0 => Exit::Ok,
        count => {
            eprintln!("{count} of {} members failed", rows.len());
            Exit::NotConverged
        }
    })
}

/// Observes the solution of members, whose iterations are not shown.
struct Unseen(Threads);

impl Observer for Unseen {
    fn event(&mut self, _: Progress<'_>) {}

    fn threads(&mut self) -> usize {
        self.0.count()
    }
}

/// The format of a table according to the name of its file; the error says why there is none.
pub(super) fn format_of(path: &Path) -> Result<Format, String> {
    if path.as_os_str() == "-" {
        return Ok(Format::Json);
    }
    let error = |problem: String| format!("-o {}: {problem}", path.display());
    let ending = path.extension().map(|ending| ending.to_ascii_lowercase());
    let named = |format: &&Format| {
        ending
            .as_deref()
            .is_some_and(|ending| ending == format.name())
    };
    let format = Format::OF_TABLES.iter().find(named).copied();
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    match (format, folder) {
        (Some(_), Some(folder)) if !folder.is_dir() => {
            Err(error(format!("there is no folder {}", folder.display())))
        }
        (Some(format), _) => Ok(format),
        (None, _) => Err(error(format!(
            "the file must have one of the extensions {}, or be - for JSON on standard output",
            Format::endings(Format::OF_TABLES)
        ))),
    }
}

/// Reads the base of the sweep in `file` from the file that `base` names; `None` if `base` is a problem itself.
pub(super) fn base_from_file(file: &Path, base: &str) -> anyhow::Result<Option<Box<RawValue>>> {
    if !base.starts_with('"') {
        return Ok(None);
    }
    let unread = |found: String| ApiError::InvalidProblem(malformed("/base", found));
    let named: Cow<'_, str> =
        serde_json::from_str(base).map_err(|_| unread("a text that cannot be read".into()))?;
    let path = file.parent().unwrap_or(Path::new("")).join(&*named);
    let text = std::fs::read_to_string(&path)
        .with_context(|| format!("cannot read the base {}", path.display()))?;
    let text = text.strip_prefix(files::BYTE_ORDER_MARK).unwrap_or(&text);
    let base = RawValue::from_string(text.to_owned()).map_err(|error| unread(error.to_string()))?;
    Ok(Some(base))
}

fn malformed(pointer: &str, found: String) -> Vec<Violation> {
    vec![Violation::new(
        pointer,
        Reason::Malformed,
        found,
        "an object of base, axes or points, and mode",
        "Check the text there; examples are in examples/sweeps.",
    )]
}

/// Reads a sweep from the text of its file.
fn read(file: &Path, text: &str) -> anyhow::Result<Sweep> {
    static BODY: Body<Definition> = Body::new();
    let refused = |violations: Vec<Violation>| invalid(file, &violations);
    let content = BODY.read(text);
    let mut content = content.map_err(|error| refused(malformed("", error)))?;
    let from_file = match content.problems.first() {
        Some((_, base)) => base_from_file(file, base),
        None => Ok(None),
    };
    let from_file = from_file.map_err(|error| match error.downcast() {
        Ok(ApiError::InvalidProblem(violations)) => refused(violations),
        Ok(other) => other.into(),
        Err(other) => other,
    })?;
    let variation = content.fields.take().map(|fields| Variation {
        axes: fields.axes,
        mode: fields.mode,
        points: fields.points,
    });
    let mut content = content.with(variation);
    if let (Some(base), Some((_, text))) = (&from_file, content.problems.first_mut()) {
        *text = base.get();
    }
    files::sweep::of_body(content).map_err(refused)
}
