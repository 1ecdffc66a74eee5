//! The command `signorini restore`.

use std::path::PathBuf;

use clap::Args;

use super::{backup::summed_up, exit::Exit, output, settings::Folder};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// The folder that `signorini backup` has written. It is not changed
    backup: PathBuf,

    #[command(flatten)]
    folder: Folder,

    /// Replace the store in the folder; the old one is kept in a folder `replaced-…` within it. Otherwise the folder
    /// must be empty or missing
    #[arg(long)]
    replace: bool,
}

pub(super) async fn run(arguments: Arguments) -> anyhow::Result<Exit> {
    let Arguments {
        backup,
        folder,
        replace,
    } = arguments;
    let data = folder.path();
    let restored = store::restore(&backup, data, replace).await?;
    let mut text = String::new();
    if let Some(replaced) = &restored.replaced {
        text += &format!("the previous store is in {}\n", replaced.display());
    }
    text += &format!("{}: {}\n", data.display(), summed_up(&restored.manifest));
    output::print(&text)?;
    eprintln!(
        "Unfinished jobs are solved when the service starts. Tokens are those of the backup: one that was revoked since then is \
         valid again"
    );
    Ok(Exit::Ok)
}
