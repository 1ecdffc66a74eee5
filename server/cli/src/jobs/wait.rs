//! The command `signorini wait`.

use std::time::Duration;

use clap::Args;
use tokio::time::Instant;

use super::{
    super::{
        exit::Exit,
        service::{Connection, Service},
    },
    follow::{self, Waited},
    id::Id,
    listing::{Found, Shown},
};

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  signorini wait $(cat ids.txt) --timeout 600 && echo all succeeded"
)]
pub(crate) struct Arguments {
    /// Jobs or sweeps
    #[arg(required = true)]
    ids: Vec<Id>,

    /// The largest number of seconds to wait for all jobs and sweeps together [default: until they end]
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    timeout: Option<Duration>,

    #[command(flatten)]
    shown: Shown,

    #[command(flatten)]
    service: Connection,
}

fn positive(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().filter(|seconds: &f64| *seconds >= 0.0);
    let time = seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    time.ok_or_else(|| "expected a number of seconds".into())
}

pub(super) async fn run(arguments: Arguments) -> anyhow::Result<Exit> {
    let service = arguments.service.open()?;
    let deadline = arguments.timeout.map(|time| Instant::now() + time);
    all(&service, &arguments.ids, deadline, &arguments.shown).await
}

/// Waits until all jobs and sweeps have ended, or until the deadline, and prints their documents; returns the worst of
/// their exit codes.
pub(super) async fn all(
    service: &Service,
    ids: &[Id],
    deadline: Option<Instant>,
    shown: &Shown,
) -> anyhow::Result<Exit> {
    let (mut documents, mut exit) = (vec![], Exit::Ok);
    for id in ids {
        match follow::detached(*id, follow::wait(service, *id, deadline)).await? {
            Waited::Ended(document) => {
                exit = exit.max(follow::exit_of_document(*id, &document)?);
                documents.push(document);
            }
            Waited::TimedOut(last) => {
                exit = exit.max(Exit::TimedOut);
                if last.is_none() {
                    eprintln!("signorini: {id}: the service did not answer in time");
                }
                documents.extend(last);
            }
        }
    }
    shown.print(&Found::of(documents))?;
    Ok(exit)
}
