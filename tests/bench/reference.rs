//! What `bench/solver.py` compares a solution with.
//!
//!     reference dense SIZE        CPU seconds of one dense Cholesky factorisation of so many unknowns
//!     reference factor PROBLEM    unknowns, and entries of the solver's factor; then the unknowns of each element

use std::process::ExitCode;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{cholesky_in_place, cholesky_in_place_scratch};
use faer::{Mat, Par};
use rustix::time::{ClockId, clock_gettime};
use solver::elasticity::Dof;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let done = match words[..] {
        ["dense", size] => size.parse().map(dense).map_err(|error| error.to_string()),
        ["factor", file] => factor(file),
        _ => Err("reference dense SIZE, or reference factor PROBLEM".into()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// Seconds of processor time of this process.
fn cpu_s() -> f64 {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// The memory is written before, so that its pages are not counted.
fn dense(size: usize) {
    let mut matrix = Mat::from_fn(size, size, |i, j| match i == j {
        true => size as f64,
        false => ((i * 7 + j * 7) % 11) as f64 / 11.0,
    });
    let request = cholesky_in_place_scratch::<f64>(size, Par::Seq, Default::default());
    let mut memory = MemBuffer::new(request);
    let began = cpu_s();
    let factored = cholesky_in_place(
        matrix.as_mut(),
        Default::default(),
        Par::Seq,
        MemStack::new(&mut memory),
        Default::default(),
    );
    let took = cpu_s() - began;
    assert!(factored.is_ok(), "the matrix is positive definite");
    println!("{took:.6}");
}

fn factor(file: &str) -> Result<(), String> {
    let text = std::fs::read_to_string(file).map_err(|error| error.to_string())?;
    let problem = files::parse(&text).map_err(|violations| format!("{violations:?}"))?;
    let external = files::external_mesh(&problem, None);
    let prepared =
        solver::prepare(&problem, external, &mut ()).map_err(|error| error.to_string())?;
    let (model, body) = (&prepared.model, &prepared.body);
    println!("{} {}", body.map.unknowns, body.factor_entries());
    let mut lines = String::new();
    for element in &model.mesh.elements {
        for dof in element
            .iter()
            .flat_map(|&node| body.map.dofs[node as usize])
        {
            if let Dof::Free(unknown) = dof {
                lines.push_str(&format!("{unknown} "));
            }
        }
        lines.push('\n');
    }
    print!("{lines}");
    Ok(())
}
