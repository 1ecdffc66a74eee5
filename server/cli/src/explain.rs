//! The command `signorini explain CODE`: the meaning of the code of an error or of a warning, and what to do about it.

use base::catalog::{Code, Kind, WarningKind, warning};
use clap::Args;
use solver::solution::WarningCode;
use strum::VariantArray;

use super::{exit::Exit, output};

/// The number of letters of the longest code.
const WIDTH: usize = 28;

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  signorini explain not_converged\n  signorini explain queue-full"
)]
pub(super) struct Arguments {
    /// A code: the `code` or `type` of an error, the `reason` of a job, or the `code` of a warning; without a code, all
    /// codes are listed
    code: Option<String>,
}

pub(super) fn run(Arguments { code }: &Arguments) -> anyhow::Result<Exit> {
    let Some(code) = code else {
        let line = |code: &Code| {
            let Kind { code, title, .. } = code.kind();
            format!("{code:<WIDTH$} {title}\n")
        };
        let errors: String = Code::VARIANTS.iter().map(line).collect();
        let line = |code: &WarningCode| {
            let WarningKind {
                code,
                title,
                severity,
                ..
            } = warning(*code);
            let severity: &str = severity.into();
            format!("{code:<WIDTH$} {severity:<8} {title}\n")
        };
        let warnings: String = WarningCode::VARIANTS.iter().map(line).collect();
        output::print(&format!(
            "{errors}\nCodes of warnings, with their severity. serious: the result is not that of the intended problem; warning: some \
             numbers are not, or may not be; note: a property of the problem.\n\n{warnings}"
        ))?;
        return Ok(Exit::Ok);
    };
    // a job's reason is the code with underscores; the type of an error is the address of its page
    let word = code.rsplit('/').next().unwrap_or_default();
    let Ok(found) = word.replace('_', "-").parse::<Code>() else {
        let Ok(found) = word.replace('-', "_").parse::<WarningCode>() else {
            eprintln!(
                "signorini: there is no code {code:?}; `signorini explain` lists all of them"
            );
            return Ok(Exit::Invalid);
        };
        let WarningKind {
            code,
            severity,
            title,
            why,
            advice,
            picture,
        } = warning(found);
        let severity: &str = severity.into();
        let picture = picture.map_or(String::new(), |drawn| format!("{drawn}\n\n"));
        output::print(&format!(
            "{title} ({code}; severity: {severity})\n\n{picture}Why it matters. {why}\n\nWhat to do. {advice}\n"
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_warning_has_a_meaning() {
        let all = WarningCode::VARIANTS.iter().map(|code| warning(*code));
        let short = |text: &str| text.len() < 10;
        let without: Vec<_> = all
            .filter(|kind| short(&kind.title) || short(kind.why) || short(kind.advice))
            .collect();
        assert!(without.is_empty(), "{without:?}");
        let known = WarningCode::VARIANTS.iter().map(|code| code.as_str().len());
        let errors = Code::VARIANTS.iter().map(|code| code.kind().code.len());
        let longest = known.chain(errors).max();
        assert_eq!(longest, Some(WIDTH));
    }
}
