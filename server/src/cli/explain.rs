//! `signorini explain CODE`: what the code of an error or of a warning means, and what to do about it.

use clap::Args;
use serde_json::Value;
use solver::solution::WarningCode;
use strum::VariantArray;

use super::{exit::Exit, output};
use crate::catalog::{Code, Kind};

/// Letters of the longest code.
const WIDTH: usize = 28;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// A code: the `code` or `type` of an error, the `reason` of a job, or the `code` of a warning; without it, all are
    /// listed
    code: Option<String>,
}

pub(super) fn run(Arguments { code }: &Arguments) -> anyhow::Result<Exit> {
    let Some(code) = code else {
        let line = |code: &Code| {
            let Kind { code, title, .. } = code.kind();
            format!("{code:<WIDTH$} {title}\n")
        };
        let errors: String = Code::VARIANTS.iter().map(line).collect();
        let line = |(code, meaning): (String, String)| format!("{code:<WIDTH$} {meaning}\n");
        let warnings: String = warnings().map(line).collect();
        output::print(&format!(
            "{errors}\nCodes of warnings: the result is there, but read the warning first.\n\n{warnings}"
        ))?;
        return Ok(Exit::Ok);
    };
    // a job's reason is the code with underscores; the type of an error is the address of its page
    let word = code.rsplit('/').next().unwrap_or_default();
    let Ok(found) = word.replace('_', "-").parse::<Code>() else {
        let name = word.replace('-', "_");
        let Some((name, meaning)) = warnings().find(|(code, _)| *code == name) else {
            eprintln!(
                "signorini: there is no code {code:?}; `signorini explain` lists all of them"
            );
            return Ok(Exit::Invalid);
        };
        output::print(&format!(
            "{meaning} ({name}, a warning)\n\nThe result is there, and is to be read with this in mind. The `message` of the \
             warning, in `summary.warnings`, says where and how much, and what to do.\n"
        ))?;
        return Ok(Exit::Ok);
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

/// The codes of warnings and their meanings, from the schema of results.
fn warnings() -> impl Iterator<Item = (String, String)> {
    let schema = schemars::schema_for!(WarningCode).to_value();
    let variants = match schema.get("oneOf") {
        Some(Value::Array(variants)) => variants.clone(),
        _ => Vec::new(),
    };
    variants.into_iter().filter_map(|variant| {
        let text = |key: &str| variant[key].as_str().map(str::to_owned);
        let meaning = text("description")?.replace('\n', " ");
        Some((text("const")?, meaning.trim_end_matches('.').to_owned()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_warning_has_a_meaning() {
        let known: Vec<String> = warnings().map(|(code, _)| code).collect();
        let all = WarningCode::VARIANTS.iter().map(|code| code.as_str());
        assert_eq!(known, all.collect::<Vec<_>>());
        let errors = Code::VARIANTS.iter().map(|code| code.kind().code.len());
        let longest = known.iter().map(String::len).chain(errors).max();
        assert_eq!(longest, Some(WIDTH));
    }
}
