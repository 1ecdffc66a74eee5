//! `signorini solve FILE`: runs the same code as a worker of the service.

use std::{
    fs::File,
    io::Read,
    ops::ControlFlow,
    path::{Path, PathBuf},
    time::Instant,
};

use anyhow::Context;
use clap::Args;
use files::{ReadError, plot::Theme};
use solver::{
    error::{Reason, SolveError, Violation},
    problem::Problem,
    solution::Observer,
};

use super::{
    exit::Exit,
    output::{self, Output},
    progress::{To, View},
    report,
};
use crate::{
    config::MemoryBudget,
    error::ApiError,
    run::{self, Update},
};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// The problem: a JSON file, or an Abaqus or CalculiX deck (.inp)
    file: PathBuf,

    #[arg(short, long, value_name = "OUT", help = output::help())]
    output: Vec<PathBuf>,

    /// Colours of a figure: light or dark
    #[arg(long, default_value = "light")]
    theme: Theme,

    #[command(flatten)]
    memory: MemoryBudget,

    #[command(flatten)]
    threads: Threads,
}

/// How many processors a large problem may use. The result is the same, bit for bit.
#[derive(Clone, Copy, Debug, Args)]
pub(super) struct Threads {
    /// Threads for a large problem: 1, or 2 where there are two processors [default: 2]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=2))]
    threads: Option<u8>,
}

impl Threads {
    /// Whether a second one may be used.
    pub(super) fn second(self) -> ControlFlow<()> {
        let processors = || std::thread::available_parallelism().map_or(1, usize::from);
        match self.threads.map_or_else(processors, usize::from) {
            1 => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        }
    }
}

pub(super) fn run(
    Arguments {
        file,
        output,
        theme,
        memory,
        threads,
    }: &Arguments,
) -> anyhow::Result<Exit> {
    let start = Instant::now();
    let problem = match read(file) {
        Ok(problem) => problem,
        Err(ReadError::Invalid(violations)) => {
            let exit = invalid(file, &violations);
            let of_sweep = |violation: &Violation| {
                violation.reason == Reason::UnknownName
                    && ["/base", "/axes", "/points"].contains(&violation.pointer.as_str())
            };
            if violations.iter().any(of_sweep) {
                eprintln!("This seems to be a sweep: solve it by `signorini sweep`.");
            }
            return Ok(exit);
        }
        Err(ReadError::Io(error)) => {
            return Err(error).with_context(|| format!("cannot read {}", file.display()));
        }
    };
    let parse_s = start.elapsed().as_secs_f64();
    let contacts = problem.contacts.iter();
    let contacts: Vec<&str> = contacts.map(|contact| contact.boundary.as_str()).collect();
    let asked = output.iter().map(|path| Output::parse(path, &contacts));
    let outputs = match asked.collect::<Result<Vec<_>, _>>() {
        Ok(outputs) => outputs,
        Err(problem) => {
            eprintln!("{problem}");
            return Ok(Exit::Invalid);
        }
    };
    let budget_bytes = memory.bytes();
    let estimate = match solver::estimate(&problem, None) {
        Ok(estimate) => estimate,
        Err(violation) => return Ok(invalid(file, &[violation])),
    };
    if estimate.memory_bytes > budget_bytes {
        let too_large = ApiError::ProblemTooLarge {
            estimate,
            budget_bytes,
        };
        eprintln!("{}: {too_large}", file.display());
        return Ok(Exit::Invalid);
    }
    let solve = |observe: &mut Observer<'_>| {
        solver::solve_on(&problem, files::external_mesh(&problem, None), observe)
    };
    let mut view = View::new(To::Error);
    let solved = run::run(&problem, parse_s, solve, &mut |update| {
        let told = match update {
            Update::SecondThread => return threads.second(),
            Update::Phase(phase) => view.phase(phase),
            Update::Mesh {
                number,
                elements,
                error,
            } => view.line(&report::mesh(number, elements, error)),
            Update::Iteration(timed) => view.iteration(&timed.row),
            Update::Warning(warning) => view.warning(warning),
            // Ctrl-C ends the process
            Update::Step(_)
            | Update::Pulse
            | Update::Needs { .. }
            | Update::Room { .. }
            | Update::OutOfMemory { .. } => Ok(()),
        };
        // who no longer reads what is told still wants the result
        let _ = told;
        ControlFlow::Continue(())
    });
    view.end();
    let document = match solved {
        Ok(document) => document,
        Err(SolveError::Invalid(violations)) => return Ok(invalid(file, &violations)),
        Err(error) => return Err(error.into()),
    };
    let title = problem.title.as_deref();
    for output in &outputs {
        output.write(&problem, *theme, &document)?;
    }
    if outputs.is_empty() {
        output::print(&report::document(title, &document))?;
    }
    Ok(if document.summary.solution.converged {
        Exit::Ok
    } else {
        Exit::NotConverged
    })
}

/// Reads a problem by the ending of its file: of a JSON file with a mesh only the mesh is held, not its text.
fn read(file: &Path) -> Result<Problem, ReadError> {
    let mut opened = File::open(file).map_err(ReadError::Io)?;
    let deck = file
        .extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("inp"));
    if !deck {
        return files::read(opened);
    }
    let mut text = String::new();
    let read = opened.read_to_string(&mut text);
    read.map_err(ReadError::Io)?;
    files::abaqus::problem(&text).map_err(ReadError::Invalid)
}

/// `signorini schema`.
pub(super) fn schema() -> anyhow::Result<Exit> {
    output::print(&format!("{:#}\n", files::schema()))?;
    Ok(Exit::Ok)
}

pub(super) fn invalid(file: &Path, violations: &[Violation]) -> Exit {
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::fmt::Write;

    use solver::problem::MeshSource;

    use crate::{digest, fake};

    /// Of a large inline mesh only the columns are held, which grow by doubling, and a few pieces of the text; nothing
    /// for its fingerprint.
    #[test]
    fn a_large_inline_mesh_is_read_and_hashed_in_the_memory_of_its_columns() {
        const PIECES: i64 = 512 << 10;
        let (nodes, elements) = (90_000, 30_000);
        let mut text = serde_json::to_string(&fake::problem()).unwrap();
        let grid = text.find("{\"grid\"").unwrap();
        let end = grid + text[grid..].find("]}").unwrap() + 2;
        let mut mesh = "{\"inline\": {\"nodes\": [".to_owned();
        for node in 0..nodes {
            let comma = if node > 0 { ",\n" } else { "" };
            let (x, y) = (0.1 * f64::from(node), -1e-3 * f64::from(node));
            write!(mesh, "{comma}[{x}, {y}]").unwrap();
        }
        mesh += "], \"elements\": [";
        for element in 0..elements {
            let comma = if element > 0 { "," } else { "" };
            let nodes: [u32; 8] = std::array::from_fn(|k| 3 * element + k as u32 % 3);
            write!(mesh, "{comma}{nodes:?}").unwrap();
        }
        mesh += "], \"boundaries\": {}}";
        text.replace_range(grid..end, &mesh);
        assert!(text.len() > 3 << 20);

        let columns = i64::from(nodes) * 16 + i64::from(elements) * 36;
        let before = allocator::held();
        allocator::forget_highest();
        let problem = files::read(text.as_bytes()).unwrap();
        let (held, highest) = (allocator::held() - before, allocator::highest() - before);
        assert!(held <= columns + PIECES, "{held} of {columns}");
        assert!(highest <= 2 * columns + PIECES, "{highest} of {columns}");
        assert!(matches!(&problem.mesh.source, MeshSource::Inline(mesh)
            if mesh.nodes.len() == nodes as usize && mesh.elements.len() == elements as usize));

        allocator::forget_highest();
        digest::input_hash(&problem).unwrap();
        let highest = allocator::highest() - before - held;
        assert!(highest <= PIECES, "{highest}");
    }
}
