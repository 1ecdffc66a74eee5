//! The commands `signorini cancel`, `retry` and `rm`, which change jobs.

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
};

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Ask jobs to stop
    Cancel(Cancel),
    /// Submit the problem of a job again, to be solved once more
    Retry(Retry),
    /// Delete jobs and sweeps that have ended
    Rm(Remove),
}

pub(super) async fn run(command: Command) -> anyhow::Result<Exit> {
    match command {
        Command::Cancel(arguments) => cancel(arguments).await,
        Command::Retry(arguments) => retry(arguments).await,
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
