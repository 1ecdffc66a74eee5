//! The command `signorini get`.

use clap::Args;

use super::{
    super::{exit::Exit, service::Connection},
    id::Id,
    listing::{Found, Shown},
};

#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  signorini get job_…\n  signorini get job_… sweep_… -f json")]
pub(crate) struct Arguments {
    /// Jobs or sweeps
    #[arg(required = true)]
    ids: Vec<Id>,

    #[command(flatten)]
    shown: Shown,

    #[command(flatten)]
    service: Connection,
}

/// Runs the command: prints everything that is known about each job or sweep.
pub(super) async fn run(arguments: Arguments) -> anyhow::Result<Exit> {
    let service = arguments.service.open()?;
    let mut documents = vec![];
    for id in arguments.ids {
        documents.push(service.get(&id.path()).await?);
    }
    arguments.shown.print_whole(&Found::of(documents))?;
    Ok(Exit::Ok)
}
