//! The commands `signorini cancel`, `retry`, `edit` and `rm`, which change jobs.

use std::collections::BTreeMap;

use base::job::JobId;
use clap::{Args, Subcommand};
use reqwest::Method;
use serde_json::{Value, json};

use super::{
    super::{
        exit::Exit,
        output,
        service::{Connection, new_key},
    },
    id::Id,
    listing::{Found, Shown},
    submit::label,
};

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Ask jobs to stop
    Cancel(Cancel),
    /// Submit the problem of a job again, to be solved once more
    Retry(Retry),
    /// Change the name, labels or priority of jobs, or keep them permanently
    Edit(Edit),
    /// Delete jobs and sweeps that have ended
    Rm(Remove),
}

pub(super) async fn run(command: Command) -> anyhow::Result<Exit> {
    match command {
        Command::Cancel(arguments) => cancel(arguments).await,
        Command::Retry(arguments) => retry(arguments).await,
        Command::Edit(arguments) => edit(arguments).await,
        Command::Rm(arguments) => remove(arguments).await,
    }
}

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  signorini cancel job_…\n  signorini cancel $(signorini ls --label study=radius --status queued -n 0 -q)"
)]
pub(crate) struct Cancel {
    /// Jobs or sweeps
    #[arg(required = true)]
    ids: Vec<Id>,

    #[command(flatten)]
    shown: Shown,

    #[command(flatten)]
    service: Connection,
}

/// Asks each job to stop. A job that has ended already is no error, and is printed as it is.
async fn cancel(arguments: Cancel) -> anyhow::Result<Exit> {
    let service = arguments.service.open()?;
    let mut documents = vec![];
    for id in arguments.ids {
        let path = format!("{}/cancel", id.path());
        let mut answer = service.call(Method::POST, &path).await?;
        documents.push(match id {
            Id::Job(_) => answer["job"].take(),
            Id::Sweep(_) => answer,
        });
    }
    arguments.shown.print(&Found::of(documents))?;
    Ok(Exit::Ok)
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  signorini wait $(signorini retry job_… -q)")]
pub(crate) struct Retry {
    /// Jobs that have ended
    #[arg(required = true, value_parser = job)]
    ids: Vec<JobId>,

    /// The largest number of seconds that a new job may run [default: the limit of the job that is retried]
    #[arg(long, value_name = "SECONDS")]
    timeout: Option<f64>,

    #[command(flatten)]
    shown: Shown,

    #[command(flatten)]
    service: Connection,
}

fn job(text: &str) -> Result<JobId, String> {
    JobId::parse(text)
        .ok_or_else(|| "expected the id of a job, as `signorini ls` prints them: job_…".into())
}

/// Submits the problem of each job again, and prints the new jobs.
async fn retry(arguments: Retry) -> anyhow::Result<Exit> {
    let service = arguments.service.open()?;
    let mut documents: Vec<Value> = vec![];
    for id in arguments.ids {
        let limits = arguments
            .timeout
            .map(|seconds| json!({"limits": {"timeout_s": seconds}}).to_string());
        documents.push(
            service
                .submit(&format!("/v1/jobs/{id}/retry"), limits, &new_key())
                .await?,
        );
    }
    arguments.shown.print(&Found::of(documents))?;
    Ok(Exit::Ok)
}

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  signorini edit job_… --pin\n  signorini edit $(signorini ls --label study=radius -n 0 -q) --label study=radius --label figure=3"
)]
pub(crate) struct Edit {
    /// Jobs
    #[arg(required = true, value_parser = job)]
    ids: Vec<JobId>,

    #[command(flatten)]
    changes: Changes,

    #[command(flatten)]
    shown: Shown,

    #[command(flatten)]
    service: Connection,
}

#[derive(Debug, Args)]
#[group(required = true, multiple = true)]
struct Changes {
    /// A name for people
    #[arg(long)]
    name: Option<String>,

    /// A label for programs, as KEY=VALUE; can be repeated, and replaces all labels that the job has
    #[arg(long = "label", value_name = "KEY=VALUE", value_parser = label)]
    labels: Option<Vec<(String, String)>>,

    /// Jobs of higher priority run first: -10 to 10; above 0 for administrators
    #[arg(long, allow_hyphen_values = true, value_name = "N")]
    priority: Option<i32>,

    /// Keep the jobs permanently, whatever their age
    #[arg(long)]
    pin: bool,

    /// Let the jobs be deleted when they are old enough
    #[arg(long, conflicts_with = "pin")]
    unpin: bool,
}

/// Changes each job, and prints it.
async fn edit(arguments: Edit) -> anyhow::Result<Exit> {
    let Changes {
        name,
        labels,
        priority,
        pin,
        unpin,
    } = arguments.changes;
    let labels = labels.map(|labels| labels.into_iter().collect::<BTreeMap<_, _>>());
    let mut changes = serde_json::Map::new();
    let given = [
        ("name", name.map(|name| json!(name))),
        ("labels", labels.map(|labels| json!(labels))),
        ("priority", priority.map(|priority| json!(priority))),
        ("pinned", (pin || unpin).then(|| json!(pin))),
    ];
    for (field, value) in given {
        changes.extend(value.map(|value| (field.to_owned(), value)));
    }
    let service = arguments.service.open()?;
    let mut documents: Vec<Value> = vec![];
    for id in arguments.ids {
        let request = service.request(Method::PATCH, &format!("/v1/jobs/{id}"));
        let answer = service.send_surely(request.json(&changes)).await?;
        documents.push(service.document(answer).await?);
    }
    arguments.shown.print(&Found::of(documents))?;
    Ok(Exit::Ok)
}

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  signorini rm job_…\n  signorini rm --fields $(signorini ls --label study=radius -n 0 -q)"
)]
pub(crate) struct Remove {
    /// Jobs or sweeps that have ended
    #[arg(required = true)]
    ids: Vec<Id>,

    /// Delete only the meshes, displacements and stresses of jobs, which are most of their data
    #[arg(long)]
    fields: bool,

    #[command(flatten)]
    service: Connection,
}

/// Deletes each job or sweep, and prints their ids.
async fn remove(arguments: Remove) -> anyhow::Result<Exit> {
    let service = arguments.service.open()?;
    if arguments.fields && arguments.ids.iter().any(|id| matches!(id, Id::Sweep(_))) {
        eprintln!("signorini: --fields is for jobs: a sweep has no fields");
        return Ok(Exit::Invalid);
    }
    for id in arguments.ids {
        let part = if arguments.fields { "/fields" } else { "" };
        service
            .call(Method::DELETE, &format!("{}{part}", id.path()))
            .await?;
        output::print(&format!("{id}\n"))?;
    }
    Ok(Exit::Ok)
}
