//! `signorini solve FILE`: the same code as a worker's, without a service.

use std::{
    fs::File,
    io::{BufWriter, Write},
    ops::ControlFlow,
    path::{Path, PathBuf},
    time::Instant,
};

use anyhow::Context;
use clap::Args;
use solver::{
    error::{SolveError, Violation},
    solution::Progress,
};

use super::{Exit, report};
use crate::run::{self, Document};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// The problem, a JSON file
    file: PathBuf,

    /// Write the whole result there as JSON; - is standard output. Without it a summary is printed
    #[arg(short, long, value_name = "OUT")]
    output: Option<PathBuf>,
}

pub(super) fn run(Arguments { file, output }: &Arguments) -> anyhow::Result<Exit> {
    let start = Instant::now();
    let text =
        std::fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
    let problem = match solver::parse(&text) {
        Ok(problem) => problem,
        Err(violations) => return Ok(invalid(file, &violations)),
    };
    let parse_s = start.elapsed().as_secs_f64();
    let solved = run::run(&problem, parse_s, solver::solve, &mut |progress| {
        match progress {
            Progress::Phase(_) => {}
            Progress::Iteration(row) => eprintln!("{}", report::iteration(row)),
            Progress::Warning(warning) => {
                eprintln!("warning: {}: {}", warning.pointer, warning.message)
            }
        }
        ControlFlow::Continue(())
    });
    let document = match solved {
        Ok(document) => document,
        Err(SolveError::Invalid(violations)) => return Ok(invalid(file, &violations)),
        Err(error) => return Err(error.into()),
    };
    match output {
        Some(path) => {
            write(path, &document).with_context(|| format!("cannot write {}", path.display()))?
        }
        None => print(&report::document(problem.title.as_deref(), &document))?,
    }
    Ok(if document.summary.solution.converged {
        Exit::Ok
    } else {
        Exit::NotConverged
    })
}

fn invalid(file: &Path, violations: &[Violation]) -> Exit {
    let many = if violations.len() == 1 {
        "violation"
    } else {
        "violations"
    };
    eprintln!("{}: {} {many}", file.display(), violations.len());
    for violation in violations {
        eprintln!("  {violation}");
    }
    Exit::Invalid
}

fn write(path: &Path, document: &Document) -> anyhow::Result<()> {
    let mut out: Box<dyn Write> = match path.to_str() {
        Some("-") => Box::new(std::io::stdout().lock()),
        _ => Box::new(File::create(path)?),
    };
    let mut out = BufWriter::new(&mut out);
    serde_json::to_writer(&mut out, document)?;
    writeln!(out)?;
    out.flush()?;
    Ok(())
}

fn print(text: &str) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes())?;
    out.flush()
}
