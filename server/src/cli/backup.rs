//! `signorini backup`.

use std::path::PathBuf;

use clap::Args;

use super::{exit::Exit, output, settings::Folder};
use crate::{
    error::{number_of, size},
    store::{self, Manifest},
};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    folder: Folder,

    /// Do not read every job, result and mesh in the backup as the service would. Its digest is written all the same
    #[arg(long)]
    unchecked: bool,

    /// The folder to write, which must not exist. It appears when the backup is complete; until then it has the ending
    /// .partial
    target: PathBuf,
}

/// Prints a line for each damage, and a summary as the last one.
pub(super) async fn run(arguments: Arguments) -> anyhow::Result<Exit> {
    let Arguments {
        folder,
        unchecked,
        target,
    } = arguments;
    let backup = store::back_up(folder.path(), &target, !unchecked).await?;
    let mut text = String::new();
    for finding in &backup.findings {
        text += finding;
        text.push('\n');
    }
    text += &format!("{}: {}\n", target.display(), summed_up(&backup.manifest));
    output::print(&text)?;
    if backup.findings.is_empty() {
        return Ok(Exit::Ok);
    }
    eprintln!(
        "The backup is made, but the store itself is damaged: keep earlier backups, and see `signorini doctor --help`"
    );
    Ok(Exit::Damaged)
}

/// What a backup contains, in a line.
pub(super) fn summed_up(manifest: &Manifest) -> String {
    let Manifest {
        created_at,
        jobs,
        unfinished,
        meshes,
        bytes,
        digest,
        ..
    } = manifest;
    let count = |number: &i64, what| number_of(usize::try_from(*number).unwrap_or_default(), what);
    let meshes = match meshes {
        1 => "1 mesh".into(),
        other => format!("{other} meshes"),
    };
    format!(
        "{} ({unfinished} unfinished) and {meshes} of {created_at}, {}, {digest}",
        count(jobs, "job"),
        size(*bytes)
    )
}
