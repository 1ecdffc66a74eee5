//! The command `signorini backup`.

use std::path::PathBuf;

use base::text::{number_of, size};
use clap::Args;
use store::Manifest;

use super::{exit::Exit, output, settings::Folder};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    folder: Folder,

    /// Skip reading every job, result and mesh of the backup as the service would. The digest of the backup is written
    /// anyway
    #[arg(long)]
    unchecked: bool,

    /// The folder to write, which must not exist. It appears when the backup is complete; until then its name ends in
    /// .partial
    target: PathBuf,
}

/// Runs the command: prints a line for each damage, and a summary as the last one.
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
        "The backup is complete, but the store itself is damaged: keep earlier backups, and see `signorini doctor --help`"
    );
    Ok(Exit::Damaged)
}

/// Describes the content of a backup in one line.
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
