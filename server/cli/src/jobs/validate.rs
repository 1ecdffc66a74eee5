//! The command `signorini validate`.

use std::path::PathBuf;

use anyhow::Context;
use base::text::size;
use clap::Args;
use reqwest::{Method, header};
use serde_json::Value;
use solver::{error::Violation, solution::WarningCode};

use super::{
    super::{
        exit::Exit,
        output, report,
        service::{Connection, misunderstood},
    },
    file::{Kind, Submitted},
    listing::seconds,
};

#[derive(Debug, Args)]
#[command(after_help = "Example:\n  signorini validate examples/rectangular_punch.json")]
pub(crate) struct Arguments {
    /// The problem: a JSON file, a deck of Abaqus or CalculiX (.inp), or - for standard input
    file: PathBuf,

    /// Print the answer of the service as JSON
    #[arg(long)]
    json: bool,

    #[command(flatten)]
    service: Connection,
}

/// Runs the command: prints the estimated cost, or all violations with their lines. Nothing is stored.
pub(super) async fn run(arguments: Arguments) -> anyhow::Result<Exit> {
    let service = arguments.service.open()?;
    let submitted = Submitted::read(&arguments.file)?;
    let problem = submitted.fields.get("problem");
    let (Kind::Job, Some(problem)) = (submitted.kind, problem) else {
        eprintln!(
            "signorini: {} is a sweep, which is checked when it is submitted",
            arguments.file.display()
        );
        return Ok(Exit::Invalid);
    };
    let request = service
        .request(Method::POST, "/v1/problems/validate")
        .header(header::CONTENT_TYPE, "application/json")
        .body(format!("{{\"problem\":{}}}", problem.get()));
    let answer = service.send_surely(request).await;
    let answer = answer.map_err(|error| submitted.refused(error))?;
    let document: Value = service.document(answer).await?;
    if arguments.json {
        output::print(&format!("{document:#}\n"))?;
    }
    let violations: Vec<Violation> = serde_json::from_value(document["violations"].clone())
        .with_context(|| misunderstood("the answer"))?;
    if !violations.is_empty() {
        submitted.tell(&violations);
        return Ok(Exit::Invalid);
    }
    if !arguments.json {
        // each number of the first mesh and of the largest one, or of the only one
        let (most, first) = (&document["estimate"], &document["first_mesh"]);
        let shown = |number: &dyn Fn(&Value) -> String| match first {
            Value::Null => number(most),
            first => format!(
                "{} on the first mesh, at most {}",
                number(first),
                number(most)
            ),
        };
        let warnings = document["warnings"].as_array().into_iter().flatten();
        let warnings = warnings.map(|warning| {
            let text = |key: &str| warning[key].as_str().unwrap_or_default();
            let pointer = submitted.in_file(text("pointer"));
            let code: Option<WarningCode> = text("code").parse().ok();
            let severity: &str = code.map_or("warning", |code| code.severity().into());
            (severity, format!("{pointer}: {}", text("message")))
        });
        let described = document["description"].as_str().unwrap_or_default();
        if !described.is_empty() {
            output::print(&format!("{described}\n"))?;
        }
        let lines = [
            ("valid", "yes".to_owned()),
            ("unknowns", shown(&|of| of["dofs"].to_string())),
            (
                "memory",
                shown(&|of| size(of["memory_bytes"].as_u64().unwrap_or_default())),
            ),
            (
                "time",
                shown(&|of| seconds(of["run_s"].as_f64().unwrap_or_default())),
            ),
        ];
        output::print(&report::lines(lines.into_iter().chain(warnings)))?;
    }
    Ok(Exit::Ok)
}
