//! The command `signorini table`.

use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use serde_json::value::RawValue;
use service::{
    formats::{self, Format},
    verbs::job_table::{COLUMNS, Columns, leaves_of},
};

use super::{
    super::{
        exit::{Exit, refuse},
        output,
        service::Connection,
        sweep::format_of,
    },
    listing,
    ls::Selected,
};

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  signorini table --label study=radius -n 0 > study.csv\n  \
    signorini table --name punch --columns id,label.radius,normal_force,normal_force_error,verdict\n  \
    signorini table --status succeeded -n 0 -o study.arrow"
)]
pub(crate) struct Arguments {
    #[command(flatten)]
    selected: Selected,

    /// The columns, separated by commas: those of a job, label.KEY, and the numbers of its result, as normal_force of a
    /// job with one contact, normal_force.BOUNDARY, normal_force_error (the ±), and values of its problem, as
    /// /contacts/0/friction/coefficient [default: the most important ones]
    #[arg(long, value_name = "COLUMNS", value_parser = columns)]
    columns: Option<Columns>,

    /// Have also the numbers of jobs that failed or were canceled: those of the state at which they stopped, which is
    /// not a solution
    #[arg(long)]
    partial: bool,

    /// Have also the values in which the problems of the jobs differ, each as a column named by its JSON Pointer
    #[arg(long)]
    differing: bool,

    /// Write the table to this file, in the format of its extension: .csv, .jsonl, .arrow, .npz or .json; - writes JSON
    /// to standard output. Without a file the table is printed as CSV
    #[arg(short, long, value_name = "OUT")]
    output: Option<PathBuf>,

    #[command(flatten)]
    service: Connection,
}

fn columns(text: &str) -> Result<Columns, String> {
    COLUMNS.read(text).map_err(|error| error.to_string())
}

pub(super) async fn run(arguments: Arguments) -> anyhow::Result<Exit> {
    let format = arguments.output.as_deref().map(format_of).transpose();
    let format = format.map_err(refuse)?.unwrap_or(Format::Csv);
    let service = arguments.service.open()?;
    // of the rows of jobs, so that the columns are those of this program, and one file has all pages
    let (jobs, more) = arguments.selected.fetch(&service, "jobs").await?;
    if more {
        eprintln!(
            "signorini: the table has the {} newest jobs only; -n 0 is all",
            jobs.len()
        );
    }
    let jobs = jobs.iter().map(listing::job);
    let jobs = jobs.collect::<anyhow::Result<Vec<_>>>()?;
    let mut columns = arguments.columns.unwrap_or_default();
    let mut problems = vec![];
    if arguments.differing || columns.has_parameters() {
        for job in &jobs {
            let path = format!("/v1/jobs/{}/problem", job.id);
            let problem: Box<RawValue> = service.get(&path).await?;
            problems.push(leaves_of(problem.get()));
        }
    }
    if arguments.differing {
        columns = columns.with_differing(&problems);
    }
    let table = columns.of(&jobs, arguments.partial, &problems);
    let bytes = match format {
        Format::Json => {
            let lines = table.jsonl().map_err(anyhow::Error::msg)?;
            let rows: Vec<&str> = lines.lines().collect();
            format!("[{}]\n", rows.join(",\n")).into_bytes()
        }
        format => formats::write_table(&table, format).map_err(anyhow::Error::msg)?,
    };
    match arguments.output.filter(|path| path.as_os_str() != "-") {
        Some(path) => output::replace(&path, |out| Ok(out.write_all(&bytes)?))
            .with_context(|| format!("cannot write {}", path.display()))?,
        None => output::print(&String::from_utf8_lossy(&bytes))?,
    }
    Ok(Exit::Ok)
}
