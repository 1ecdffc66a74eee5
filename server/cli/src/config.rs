//! The command `signorini config show`.

use std::{ffi::OsStr, fmt::Write};

use anyhow::bail;
use clap::{Arg, ArgMatches, Args, Subcommand, parser::ValueSource};

use super::{
    exit::Exit,
    output,
    settings::{self, Kind, Lines},
};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Print the settings that `serve` would have with the same options, as a file that `serve` can read
    Show {
        /// Add to each setting where its value comes from: a flag, an environment variable, a line of the file, or the
        /// default
        #[arg(long)]
        origin: bool,
        #[command(flatten)]
        arguments: Box<settings::Arguments>,
    },
}

pub(super) fn run(
    Arguments { command }: Arguments,
    matches: &ArgMatches,
    lines: &Lines,
) -> anyhow::Result<Exit> {
    let Command::Show { origin, arguments } = command;
    arguments.settings.tls.files()?;
    let mut text = String::new();
    for arg in settings::settings() {
        let id = arg.get_id().as_str();
        let (line, origin_of) = match matches.value_source(id) {
            Some(source) => (value(&arg, matches)?, origin_of(&arg, source, lines)),
            None => (unset(&arg), String::new()),
        };
        if origin && !origin_of.is_empty() {
            writeln!(text, "{line}  # {origin_of}")?
        } else {
            writeln!(text, "{line}")?
        }
    }
    output::print(&text)?;
    Ok(Exit::Ok)
}

/// Writes a setting as `key = value`.
fn value(arg: &Arg, matches: &ArgMatches) -> anyhow::Result<String> {
    let (key, id) = (settings::key(arg), arg.get_id().as_str());
    let mut texts = vec![];
    for raw in matches.get_raw(id).into_iter().flatten() {
        let Some(text) = raw.to_str() else {
            bail!("{key} is {raw:?}, which is not UTF-8 and cannot be in a file of settings");
        };
        texts.push(text);
    }
    let value = match Kind::of(arg) {
        Kind::Flag => matches.get_flag(id).to_string(),
        Kind::Integer | Kind::Number => texts.concat(),
        Kind::Text => quoted(texts.concat()),
        Kind::List => {
            let quoted: Vec<String> = texts.into_iter().map(quoted).collect();
            format!("[{}]", quoted.join(", "))
        }
    };
    Ok(format!("{key} = {value}"))
}

/// Writes a text as a TOML string, which differs from a JSON string in one character.
fn quoted(text: impl AsRef<str>) -> String {
    serde_json::Value::from(text.as_ref())
        .to_string()
        .replace('\u{7f}', "\\u007f")
}

/// The comment that stands for a setting without a value, with the remark on its default from its help.
fn unset(arg: &Arg) -> String {
    let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
    let default = help.rsplit_once("[default: ");
    let default = default.map_or("none", |(_, rest)| rest.trim_end_matches(']'));
    format!("# {} is not set: {default}", settings::key(arg))
}

fn origin_of(arg: &Arg, source: ValueSource, lines: &Lines) -> String {
    match source {
        ValueSource::CommandLine => format!("--{}", arg.get_long().unwrap_or_default()),
        ValueSource::EnvVariable => {
            let name = arg.get_env().unwrap_or(OsStr::new(""));
            name.to_string_lossy().into_owned()
        }
        _ => {
            let line = lines.get(&settings::key(arg));
            let line = line.map(|line| line.replace(char::is_control, " "));
            line.unwrap_or_else(|| "default".into())
        }
    }
}
