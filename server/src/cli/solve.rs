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
    io::plot::{self, Parts, Plot, Theme},
    problem::Problem,
    solution::Progress,
};

use super::{Exit, report};
use crate::{
    config::MemoryBudget,
    error::ApiError,
    run::{self, Document},
};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// The problem, a JSON file
    file: PathBuf,

    /// Write the result there: .json the whole of it, .svg a figure: the stress profile, or what is
    /// named before the ending (.mesh.svg, .deformed.svg, .convergence.svg); - is JSON on standard
    /// output. Without it a summary is printed
    #[arg(short, long, value_name = "OUT")]
    output: Option<PathBuf>,

    /// Colours of a figure: light or dark
    #[arg(long, default_value = "light")]
    theme: Theme,

    #[command(flatten)]
    memory: MemoryBudget,
}

pub(super) fn run(
    Arguments {
        file,
        output,
        theme,
        memory,
    }: &Arguments,
) -> anyhow::Result<Exit> {
    let format = match output.as_deref().map(Format::of) {
        Some(None) => {
            eprintln!(
                "-o takes a file that ends in .json or .svg, or - for JSON on standard output"
            );
            return Ok(Exit::Invalid);
        }
        format => format.flatten(),
    };
    let start = Instant::now();
    let text =
        std::fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
    let problem = match solver::parse(&text) {
        Ok(problem) => problem,
        Err(violations) => return Ok(invalid(file, &violations)),
    };
    let parse_s = start.elapsed().as_secs_f64();
    let (estimate, budget_bytes) = (solver::estimate(&problem), memory.bytes());
    if estimate.memory_bytes > budget_bytes {
        let too_large = ApiError::ProblemTooLarge {
            estimate,
            budget_bytes,
        };
        eprintln!("{}: {too_large}", file.display());
        return Ok(Exit::Invalid);
    }
    let solved = run::run(&problem, parse_s, solver::solve, &mut |progress| {
        match progress {
            Progress::Phase(phase) => eprintln!("{} …", run::phase_name(phase)),
            Progress::Iteration(row) => eprintln!("{}", report::iteration(row)),
            Progress::Warning(warning) => {
                eprintln!("warning: {}: {}", warning.pointer, warning.message)
            }
            Progress::Pulse => {} // Ctrl-C ends the process anyway
        }
        ControlFlow::Continue(())
    });
    let document = match solved {
        Ok(document) => document,
        Err(SolveError::Invalid(violations)) => return Ok(invalid(file, &violations)),
        Err(error) => return Err(error.into()),
    };
    let title = problem.title.as_deref();
    match (output, format) {
        (Some(path), Some(format)) => write(path, format, *theme, &problem, &document)
            .with_context(|| format!("cannot write {}", path.display()))?,
        _ => print(&report::document(title, &document))?,
    }
    Ok(if document.summary.solution.converged {
        Exit::Ok
    } else {
        Exit::NotConverged
    })
}

/// `signorini schema`.
pub(super) fn schema() -> anyhow::Result<Exit> {
    print(&format!("{:#}\n", solver::schema()))?;
    Ok(Exit::Ok)
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

/// What `-o` asks for.
#[derive(Clone, Copy, Debug)]
enum Format {
    Json,
    Svg(Plot),
}

impl Format {
    fn of(path: &Path) -> Option<Format> {
        if path.as_os_str() == "-" {
            return Some(Format::Json);
        }
        match path.extension()?.to_str()? {
            "json" => Some(Format::Json),
            "svg" => {
                let named = Path::new(path.file_stem()?).extension();
                let plot = named.and_then(|name| name.to_str()?.parse().ok());
                Some(Format::Svg(plot.unwrap_or(Plot::Profile)))
            }
            _ => None,
        }
    }
}

fn write(
    path: &Path,
    format: Format,
    theme: Theme,
    problem: &Problem,
    document: &Document,
) -> anyhow::Result<()> {
    let parts = Parts {
        history: &document.history,
        profiles: &document.profiles,
        fields: &document.fields,
    };
    let figure = match format {
        Format::Json => None,
        Format::Svg(plot) => {
            let drawn = plot::draw(plot, theme, problem, &parts);
            Some(drawn.map_err(anyhow::Error::msg)?)
        }
    };
    let mut out: Box<dyn Write> = match path.to_str() {
        Some("-") => Box::new(std::io::stdout().lock()),
        _ => Box::new(File::create(path)?),
    };
    let mut out = BufWriter::new(&mut out);
    match figure {
        Some(svg) => out.write_all(svg.as_bytes())?,
        None => serde_json::to_writer(&mut out, document)?,
    }
    writeln!(out)?;
    out.flush()?;
    Ok(())
}

fn print(text: &str) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes())?;
    out.flush()
}
