//! The command `signorini doctor`.

use std::path::PathBuf;

use base::text::size;
use clap::Args;
use store::{Report, StoreError};

use super::{exit::Exit, output, settings::Folder};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    folder: Folder,

    /// Copy every intact job, with its problem, events and result, and every intact mesh to a store in this new folder
    #[arg(long, value_name = "NEW_FOLDER")]
    salvage: Option<PathBuf>,

    /// Accept the store as it is, although something that was in it is missing: after a restore from a backup, or for a
    /// fresh start in this folder
    #[arg(long, conflicts_with = "salvage")]
    accept: bool,

    /// Rebuild the database without unused space, which temporarily needs as much space again. From then on the space
    /// of deleted data is returned to the file system
    #[arg(long, conflicts_with_all = ["salvage", "accept"])]
    compact: bool,
}

/// Runs the command: prints a line for each finding, and a summary as the last one.
pub(super) async fn run(arguments: Arguments) -> anyhow::Result<Exit> {
    let Arguments {
        folder,
        salvage,
        accept,
        compact,
    } = arguments;
    let data = folder.path();
    if compact {
        let (before, after) = store::compact_folder(data).await?;
        let text = format!(
            "{} had {}, and has {}\n",
            data.display(),
            size(before),
            size(after)
        );
        output::print(&text)?;
        return Ok(Exit::Ok);
    }
    if accept {
        let known = store::accept(data).map_err(|error| {
            StoreError::Folder(format!("cannot change {}: {error}", data.display()))
        })?;
        let text = if known {
            "the next start accepts the content of the folder\n"
        } else {
            "nothing was recorded about this folder: the next start accepts its content\n"
        };
        output::print(text)?;
        return Ok(Exit::Ok);
    }
    let report = store::inspect(data, salvage.as_deref()).await?;
    let mut text = String::new();
    for finding in &report.findings {
        text += finding;
        text.push('\n');
    }
    text += &summed_up(&report);
    if let Some(new) = &salvage {
        text += &match report.intact {
            0 => format!("; the new store in {} has none", new.display()),
            _ => format!("; they were copied to {}", new.display()),
        };
        if report.intact < report.jobs {
            text += &format!(
                "; keep {}, which has the data that were not copied",
                data.display()
            );
        }
    }
    text.push('\n');
    output::print(&text)?;
    if report.findings.is_empty() {
        return Ok(Exit::Ok);
    }
    match (&salvage, report.intact) {
        (None, 1..) => eprintln!(
            "To save everything that is intact in a new store: signorini doctor --data {} --salvage NEW_FOLDER",
            data.display()
        ),
        (_, 0) if report.jobs > 0 => eprintln!(
            "No job is fully intact. The service may still start on {} and serve the readable parts, for example a result \
             without its events.",
            data.display()
        ),
        _ => {}
    }
    Ok(Exit::Damaged)
}

/// The summary line of the command: how many jobs are intact.
fn summed_up(report: &Report) -> String {
    let Report { intact, jobs, .. } = report;
    match (report.incomplete, jobs) {
        (true, 0) => "no job can be read: restore the store from a backup".into(),
        (true, _) => format!("{intact} jobs are intact, of at least {jobs}"),
        (false, _) if intact == jobs && !report.findings.is_empty() => {
            format!("{intact} of {jobs} jobs are intact, but the store around them is not")
        }
        (false, _) => format!("{intact} of {jobs} jobs are intact"),
    }
}
