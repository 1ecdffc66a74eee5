//! Solves a problem for several coefficients of friction on one factored body, and prints the forces:
//!
//!     cargo run --release --example friction -- tests/data/thesis/rectangular_punch.json

use std::{env, error::Error, fs, process::ExitCode};

use solver::{
    family::{Family, Start},
    problem::Refine,
};

fn main() -> ExitCode {
    match study() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn study() -> Result<(), Box<dyn Error>> {
    let path = env::args().nth(1).ok_or("usage: friction PROBLEM.json")?;
    let text = fs::read_to_string(path)?;
    let mut problem = files::parse(&text).map_err(|violations| {
        let lines: Vec<String> = violations.iter().map(ToString::to_string).collect();
        lines.join("\n")
    })?;
    // adaptive refinement gives each problem a mesh of its own
    if let Refine::Adaptive(_) = problem.mesh.refine {
        problem.mesh.refine = Refine::Times(0);
    }
    let external = files::external_mesh(&problem, None);
    let mut family = Family::new(&problem, external, &mut ())?;
    println!("coefficient  normal force  tangential force  stick width");
    for coefficient in [0.1, 0.2, 0.3, 0.4] {
        for friction in problem
            .contacts
            .iter_mut()
            .flat_map(|contact| &mut contact.friction)
        {
            friction.coefficient = Some(coefficient);
        }
        let (member, _) = family.member(&problem, Start::Anew, &mut ())?;
        println!(
            "{coefficient:11} {:13.4} {:17.4} {:12.4}",
            member.normal_force, member.tangential_force, member.stick_width
        );
    }
    Ok(())
}
