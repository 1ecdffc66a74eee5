//! The command `signorini solve FILE`, which runs the same code as a worker of the service.

use std::{
    fmt::Display,
    fs::File,
    io::{BufReader, Read, Seek},
    path::{Path, PathBuf},
    time::Instant,
};

use anyhow::Context;
use base::{digest, mesh::MeshInfo, run::Run};
use clap::Args;
use files::ReadError;
use service::{config::MemoryBudget, error::ApiError};
use sha2::{Digest, Sha256};
use solver::{
    Estimate,
    error::{Reason, SolveError, Violation},
    mesh::Mesh,
    observer::{Observer, Progress},
    problem::Problem,
    solution::Warning,
};

use super::{
    exit::{Ended, Exit, refuse},
    output::{self, Output, Profiles},
    progress::{To, View},
    report,
};

#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  signorini solve examples/rectangular_punch.json\n  signorini solve punch.json -o punch.csv -o punch.svg -o punch.vtu"
)]
pub(super) struct Arguments {
    /// The problem: a JSON file, or an Abaqus or CalculiX deck (.inp)
    file: PathBuf,

    #[arg(short, long, value_name = "OUT", help = output::help())]
    output: Vec<PathBuf>,

    /// The file of the mesh that the problem names by its hash (mesh.stored), as it was uploaded. `signorini solve`
    /// with the mesh file itself prints that hash
    #[arg(long, value_name = "FILE")]
    mesh: Option<PathBuf>,

    #[command(flatten)]
    look: output::Look,

    #[command(flatten)]
    memory: MemoryBudget,

    #[command(flatten)]
    threads: Threads,
}

/// The option for the number of threads that may solve a large problem. The result does not depend on it in any bit.
#[derive(Clone, Copy, Debug, Args)]
pub(super) struct Threads {
    /// Threads for a large problem: 1, or 2 where there are two processors [default: 2]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=2))]
    threads: Option<u8>,
}

impl Threads {
    /// The number of threads that may be used.
    pub(super) fn count(self) -> usize {
        let processors = || std::thread::available_parallelism().map_or(1, usize::from);
        self.threads
            .map_or_else(|| processors().min(2), usize::from)
    }
}

pub(super) fn run(
    Arguments {
        file,
        output,
        mesh,
        look,
        memory,
        threads,
    }: &Arguments,
) -> anyhow::Result<Exit> {
    let start = Instant::now();
    let (problem, _) = problem(file)?;
    let parse_s = start.elapsed().as_secs_f64();
    let profiles = Profiles::of(&problem);
    let outputs = output.iter().map(|path| Output::parse(path, &profiles));
    let outputs = outputs.collect::<Result<Vec<_>, _>>().map_err(refuse)?;
    look.check(&outputs).map_err(refuse)?;
    let stored = stored_mesh(&problem, file, mesh.as_deref())?;
    let (size, stored) = stored.map(|(info, mesh)| (info.size(), mesh)).unzip();
    let estimate = solver::estimate(&problem, size.as_ref());
    let estimate = estimate.map_err(|violation| invalid(file, &[violation]))?;
    check_memory(estimate, memory, file.display())?;
    let solve = |observer: &mut dyn Observer| {
        let external = files::external_mesh(&problem, stored.clone());
        solver::solve_on(&problem, external, observer)
    };
    let mut view = View::new(To::Error);
    let run = Run::new(&problem, parse_s);
    let solved = run.solve(
        solve,
        &mut Shown {
            view: &mut view,
            threads,
        },
    );
    view.end();
    let document = match solved {
        Ok(document) => document,
        Err(SolveError::Invalid(violations)) => return Err(invalid(file, &violations)),
        Err(error) => return Err(error.into()),
    };
    let title = problem.title.as_deref();
    // what cannot be drawn must not cost the other files of a long solution
    let written = outputs
        .iter()
        .map(|output| output.write((&problem, stored.as_ref()), *look, &document));
    let failed: Vec<anyhow::Error> = written.filter_map(Result::err).collect();
    for error in failed.iter().skip(1) {
        eprintln!("signorini: {error:#}");
    }
    if let Some(first) = failed.into_iter().next() {
        return Err(first);
    }
    if outputs.is_empty() {
        output::print(&report::document(title, &document))?;
    } else {
        // what the files are read for must not hide how far they can be trusted
        eprint!("{}", report::trust(&document));
    }
    Ok(if document.summary.solution.converged {
        Exit::Ok
    } else {
        Exit::NotConverged
    })
}

/// Shows a solution in the terminal. It never stops the solver: Ctrl-C ends the process.
struct Shown<'a> {
    view: &'a mut View,
    threads: &'a Threads,
}

impl Observer for Shown<'_> {
    fn event(&mut self, progress: Progress<'_>) {
        let view = &mut *self.view;
        let shown = match progress {
            Progress::Phase(phase) => view.phase(phase),
            Progress::Refinement {
                number,
                elements,
                error,
            } => view.line(&report::mesh(number, elements, error)),
            Progress::Iteration(row) => view.iteration(row),
            Progress::Warning(warning) => view.warning(warning),
            Progress::Tentative(_)
            | Progress::Step(_)
            | Progress::Mesh(_)
            | Progress::OutOfMemory { .. } => Ok(()),
        };
        // who no longer reads what is shown still wants the result
        let _ = shown;
    }

    fn threads(&mut self) -> usize {
        self.threads.count()
    }
}

/// Refuses to solve something that needs more memory than there is; `what` names it in the message.
pub(super) fn check_memory(
    estimate: Estimate,
    memory: &MemoryBudget,
    what: impl Display,
) -> anyhow::Result<()> {
    let budget_bytes = memory.bytes();
    if estimate.memory_bytes <= budget_bytes {
        return Ok(());
    }
    let too_large = ApiError::ProblemTooLarge {
        estimate,
        budget_bytes,
    };
    Err(refuse(format_args!("{what}: {too_large}")))
}

/// Reads the mesh that a problem names by the hash of its file; `None` if it names none.
fn stored_mesh(
    problem: &Problem,
    problem_file: &Path,
    file: Option<&Path>,
) -> anyhow::Result<Option<(MeshInfo, Mesh)>> {
    let refused = |reason: &dyn Display| {
        refuse(format_args!(
            "signorini: {}: {reason}",
            problem_file.display()
        ))
    };
    let (named, file) = match (problem.mesh.stored(), file) {
        (Some(named), Some(file)) => (named, file),
        (None, None) => return Ok(None),
        (Some(_), None) => {
            return Err(refused(
                &"the problem names its mesh by a hash (mesh.stored): give its file with --mesh FILE, or submit the problem to a service \
                 that has the mesh: signorini submit",
            ));
        }
        (None, Some(_)) => {
            return Err(refused(
                &"the problem has a mesh of its own; --mesh is for one that names its mesh by a hash (mesh.stored)",
            ));
        }
    };
    let cannot = || format!("cannot read {}", file.display());
    let mut opened = File::open(file).with_context(cannot)?;
    let (found, bytes) = hashed(&mut opened).with_context(cannot)?;
    if found != named {
        return Err(refused(&format_args!(
            "--mesh {}: this file has the hash {found}, but the problem names {named}",
            file.display()
        )));
    }
    // the bytes that were hashed, whatever has that name by now
    opened.rewind().with_context(cannot)?;
    let (format, mesh, warnings) =
        files::read_mesh(BufReader::new(opened)).map_err(|error| unreadable(file, error))?;
    let info = MeshInfo::new(found, bytes, (format, &mesh, warnings));
    Ok(Some((info, mesh)))
}

/// Reads the rest of a file; returns its hash and its number of bytes.
fn hashed(opened: &mut File) -> std::io::Result<(String, u64)> {
    let mut hash = Sha256::new();
    let (mut piece, mut bytes) = (vec![0; 1 << 16], 0);
    loop {
        match opened.read(&mut piece)? {
            0 => return Ok((digest::sha256_text(hash), bytes)),
            read => {
                hash.update(&piece[..read]);
                bytes += read as u64;
            }
        }
    }
}

/// Prints what a mesh contains, and how a problem refers to it.
fn only_a_mesh(file: &Path) -> anyhow::Result<Ended> {
    let cannot = || format!("cannot read {}", file.display());
    let mut opened = File::open(file).with_context(cannot)?;
    let (hash, _) = hashed(&mut opened).with_context(cannot)?;
    opened.rewind().with_context(cannot)?;
    let (_, mesh, _) =
        files::read_mesh(BufReader::new(opened)).map_err(|error| unreadable(file, error))?;
    let names = |what: &str, names: Vec<&String>| match names.len() {
        0 => format!("no {what}"),
        count => {
            let first: Vec<String> = names
                .iter()
                .take(20)
                .map(|name| format!("`{name:.60}`"))
                .collect();
            let more = if count > 20 { ", …" } else { "" };
            format!("{what} {}{more}", first.join(", "))
        }
    };
    let name = file.display();
    eprintln!(
        "{name} is a mesh, not a problem: {} nodes, {} elements, {}, {}, {}.",
        mesh.nodes.len(),
        mesh.elements.len(),
        names("boundaries", mesh.boundaries.keys().collect()),
        names("groups", mesh.groups.keys().collect()),
        names("node sets", mesh.node_sets.keys().collect()),
    );
    eprintln!(
        "  Write a problem as JSON with \"mesh\": {{\"stored\": \"{hash}\"}}, materials, supports and contacts, and solve it with \
         `signorini solve problem.json --mesh {name}`."
    );
    Ok(Ended(Exit::Invalid))
}

/// Reads the problem in a file; returns it with warnings about what it does not take over from a deck.
pub(super) fn problem(file: &Path) -> anyhow::Result<(Problem, Vec<Warning>)> {
    match read(file) {
        Ok(Some(found)) => Ok(found),
        Ok(None) => Err(only_a_mesh(file)?.into()),
        Err(error) => {
            let of_sweep = |violation: &Violation| {
                violation.reason == Reason::UnknownName
                    && ["/base", "/axes", "/points"].contains(&violation.pointer.as_str())
            };
            let is_sweep = matches!(&error, ReadError::Invalid(all) if all.iter().any(of_sweep));
            let ended = unreadable(file, error);
            if is_sweep {
                eprintln!("This seems to be a sweep: solve it with `signorini sweep`.");
            }
            Err(ended)
        }
    }
}

/// Reads a problem from a file, depending on the file's extension; `None` for a mesh, or a deck without a step. Of a
/// JSON file with a mesh, only the mesh is held in memory, not its text.
fn read(file: &Path) -> Result<Option<(Problem, Vec<Warning>)>, ReadError> {
    let mut opened = File::open(file).map_err(ReadError::Io)?;
    let is = |wanted: &str| {
        let ending = file.extension();
        ending.is_some_and(|ending| ending.eq_ignore_ascii_case(wanted))
    };
    if is("msh") {
        return Ok(None);
    }
    if !is("inp") {
        return files::read(opened).map(|problem| Some((problem, Vec::new())));
    }
    let mut bytes = Vec::new();
    let read = opened.read_to_end(&mut bytes);
    read.map_err(ReadError::Io)?;
    let text = files::text(bytes);
    if !files::abaqus::has_step(&text) {
        return Ok(None);
    }
    let (problem, warnings) =
        files::abaqus::problem_with_warnings(&text).map_err(ReadError::Invalid)?;
    if problem.contacts.is_empty() {
        eprintln!(
            "{}: a deck without contact, solved as an elastic problem. Contact with a rigid surface is a *CONTACT PAIR, or `contacts` \
             in a problem as JSON with this deck as its mesh.",
            file.display()
        );
    }
    Ok(Some((problem, warnings)))
}

/// Runs the command `signorini schema`.
pub(super) fn schema() -> anyhow::Result<Exit> {
    output::print(&format!("{:#}\n", files::schema()))?;
    Ok(Exit::Ok)
}

/// Prints the violations in a file that could be read; otherwise the error says that it cannot be read.
fn unreadable(file: &Path, error: ReadError) -> anyhow::Error {
    match error {
        ReadError::Invalid(violations) => invalid(file, &violations),
        ReadError::Io(error) => {
            anyhow::Error::new(error).context(format!("cannot read {}", file.display()))
        }
    }
}

/// Prints the violations in a file, and ends the command.
pub(super) fn invalid(file: &Path, violations: &[Violation]) -> anyhow::Error {
    let many = if violations.len() == 1 {
        "violation"
    } else {
        "violations"
    };
    eprintln!("{}: {} {many}", file.display(), violations.len());
    for violation in violations {
        match violation.line() {
            Some(_) => eprintln!("{}", violation.in_file(file.display())),
            None => eprintln!("  {violation}"),
        }
    }
    Ended(Exit::Invalid).into()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::fmt::Write;

    use solver::problem::MeshSource;

    use base::digest;

    /// A large inline mesh is read and hashed in the memory of its columns, which grow by doubling, and of a few pieces
    /// of the text.
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
