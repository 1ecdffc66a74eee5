//! The command `signorini convert FILE`: the problem of a deck as JSON, to change it, or to submit it with any client.

use std::path::PathBuf;

use clap::Args;

use super::{exit::Exit, output, solve};

#[derive(Debug, Args)]
#[command(
    after_help = "Example, a deck on a finer mesh:\n  signorini convert roller.inp > roller.json     # then, in its mesh: \"refine\": {\"tolerance\": 0.005}\n  signorini solve roller.json"
)]
pub(super) struct Arguments {
    /// The deck of Abaqus or CalculiX (.inp)
    file: PathBuf,
}

pub(super) fn run(Arguments { file }: &Arguments) -> anyhow::Result<Exit> {
    let (problem, warnings) = solve::problem(file)?;
    for warning in warnings {
        eprintln!("{}: {}", file.display(), warning.message);
    }
    output::print(&(serde_json::to_string_pretty(&problem)? + "\n"))?;
    Ok(Exit::Ok)
}
