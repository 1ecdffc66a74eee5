//! `signorini explain CODE`: what an error code means and what to do about it.

use clap::Args;
use strum::VariantArray;

use super::{exit::Exit, output};
use crate::catalog::{Code, Kind};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// A code: the `code` or `type` of an error, or the `reason` of a job; without it, all codes are listed
    code: Option<String>,
}

pub(super) fn run(Arguments { code }: &Arguments) -> anyhow::Result<Exit> {
    let Some(code) = code else {
        let line = |code: &Code| {
            let Kind { code, title, .. } = code.kind();
            format!("{code:<24} {title}\n")
        };
        output::print(&Code::VARIANTS.iter().map(line).collect::<String>())?;
        return Ok(Exit::Ok);
    };
    // a job's reason is the code with underscores; the type of an error is the address of its page
    let word = code.rsplit('/').next().unwrap_or_default();
    let Ok(found) = word.replace('_', "-").parse::<Code>() else {
        eprintln!(
            "signorini: there is no error code {code:?}; `signorini explain` lists all of them"
        );
        return Ok(Exit::Invalid);
    };
    let kind = found.kind();
    let facts: String = kind
        .facts()
        .iter()
        .map(|fact| format!("{fact}\n"))
        .collect();
    let Kind {
        title,
        code,
        explanation,
        ..
    } = kind;
    output::print(&format!("{title} ({code})\n{facts}\n{explanation}\n"))?;
    Ok(Exit::Ok)
}
