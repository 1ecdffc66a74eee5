//! The commands `signorini completions` and `signorini man`.

use std::{io::Write, path::PathBuf};

use anyhow::Context;
use clap::Args;
use clap_complete::Shell;

use super::{exit::Exit, output};

#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  signorini completions bash > ~/.local/share/bash-completion/completions/signorini"
)]
pub(super) struct Completions {
    /// The shell
    shell: Shell,
}

/// Runs `completions`: prints the script that completes commands and options.
pub(super) fn completions(
    arguments: &Completions,
    mut command: clap::Command,
) -> anyhow::Result<Exit> {
    let mut script = vec![];
    let name = command.get_name().to_owned();
    clap_complete::generate(arguments.shell, &mut command, name, &mut script);
    output::print(&String::from_utf8_lossy(&script))?;
    Ok(Exit::Ok)
}

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  signorini man ~/.local/share/man/man1 && man signorini-submit")]
pub(super) struct Man {
    /// Folder in which to write a page for each command; without it the page of the whole program is printed
    folder: Option<PathBuf>,
}

pub(super) fn man(arguments: &Man, command: clap::Command) -> anyhow::Result<Exit> {
    let Some(folder) = &arguments.folder else {
        let mut page = vec![];
        clap_mangen::Man::new(command).render(&mut page)?;
        output::print(&String::from_utf8_lossy(&page))?;
        return Ok(Exit::Ok);
    };
    let name = command.get_name().to_owned();
    write(command, &name, folder)?;
    Ok(Exit::Ok)
}

/// Writes the manual pages of a command and of its subcommands.
fn write(command: clap::Command, name: &str, folder: &PathBuf) -> anyhow::Result<()> {
    for subcommand in command.get_subcommands().filter(|one| !one.is_hide_set()) {
        write(
            subcommand.clone(),
            &format!("{name}-{}", subcommand.get_name()),
            folder,
        )?;
    }
    let page = clap_mangen::Man::new(command.name(name.to_owned()));
    let path = folder.join(format!("{name}.1"));
    output::replace(&path, |out: &mut dyn Write| {
        let mut text = vec![];
        page.render(&mut text)?;
        Ok(out.write_all(&text)?)
    })
    .with_context(|| {
        format!(
            "cannot write {}; check that {} is a folder",
            path.display(),
            folder.display()
        )
    })
}
