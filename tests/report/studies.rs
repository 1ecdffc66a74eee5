//! Studies that the thesis asks for or leaves open: the elastic slip, its own iteration, its ways of
//! extrapolation, its limit of two elements.

use std::fmt::Write;

use solver::problem::{Algorithm, Problem, Refine, ThesisOptions, ThesisPressure};
use solver::solution::{Outcome, Summary};

use crate::examples::{EXAMPLES, example, solve, with_radius};
use crate::table::digits;

pub(crate) fn section() -> String {
    elastic_slip() + &thesis_iteration() + &two_elements()
}

fn peak(summary: &Summary) -> f64 {
    let contact = summary.contacts.values().next().unwrap();
    contact.peak_tangential_stress.map_or(0.0, |p| p.value)
}

fn elastic_slip() -> String {
    let mut out = String::from(
        "## The elastic slip ε\n\nThe thesis expects no appreciable effect (chapter 5). Refined twice, friction at Gauss points:\n\n| example | ε | Y | T | peak σ_t | slips | iterations |\n|---|---|---|---|---|---|---|\n",
    );
    for (name, _, radii) in EXAMPLES {
        for slip in [1e-2, 1e-3, 1e-4, 1e-5, 1e-6] {
            let mut problem = with_radius(name, radii[1]);
            problem.mesh.refine = Refine::Times(2);
            problem.contacts[0].friction.as_mut().unwrap().elastic_slip = slip;
            let summary = solve(&problem).summary;
            let contact = summary.contacts.values().next().unwrap();
            let width = |list: &[[f64; 2]]| list.iter().map(|[a, b]| b - a).sum::<f64>();
            writeln!(
                out,
                "| {} | {slip:e} | {} | {} | {} | {:.0} % | {} |",
                name.replace('_', " "),
                digits(summary.normal_force),
                digits(summary.tangential_force),
                digits(peak(&summary)),
                100.0 * width(&contact.slip) / width(&contact.contact),
                summary.iterations
            )
            .unwrap();
        }
    }
    out + "\n"
}

fn by_thesis(problem: &Problem, options: ThesisOptions, most: u32) -> Summary {
    let mut problem = problem.clone();
    problem.solver.algorithm = Algorithm::Thesis;
    problem.solver.max_iterations = most;
    problem.solver.thesis = Some(options);
    solve(&problem).summary
}

fn outcome(summary: &Summary) -> String {
    match summary.outcome {
        Outcome::ContactCycling => "cycle".to_owned(),
        Outcome::FalseConvergence => "own test met".to_owned(),
        Outcome::Converged => "converged".to_owned(),
        _ => "not converged".to_owned(),
    }
}

fn thesis_iteration() -> String {
    let mut out = String::from(
        "## The thesis's own iteration\n\n`algorithm: \"thesis\"` at the thesis's parameters, against `auto`. *Residual* is that of the true problem.\nWhere the unsigned iteration meets its own test R_F, it does so in a false state of full slip; with the sign it\ncycles at full steps, and relaxed it creeps to the truth or stops short of it. Ways 1 and 2 are those of 3.2;\nchapter 4 calls their results very similar.\n\n| example | pressure | local points | way | sign | relaxation | ends | iterations | T | residual |\n|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for name in suite::EXAMPLES {
        let problem = example(name);
        let truth = solve(&problem).summary;
        let title = name.replace('_', " ");
        writeln!(
            out,
            "| {title} | `auto` | | | | | converged | {} | {} | {:.0e} |",
            truth.iterations,
            digits(truth.tangential_force),
            truth.residuals.monolithic
        )
        .unwrap();
        let (lumped, extrapolated) = (ThesisPressure::Lumped, ThesisPressure::Extrapolated);
        for (pressure, local_points, friction_force, signed, relaxation) in [
            (lumped, 0, 1, false, 1.0),
            (extrapolated, 0, 1, false, 1.0),
            (extrapolated, 10, 1, false, 1.0),
            (extrapolated, 10, 2, false, 1.0),
            (lumped, 0, 1, true, 1.0),
            (lumped, 0, 1, true, 0.01),
            (lumped, 0, 1, true, 0.003),
        ] {
            let options = ThesisOptions {
                pressure,
                local_points,
                friction_force,
                signed,
                relaxation,
                ..ThesisOptions::default()
            };
            let summary = by_thesis(&problem, options, 20_000);
            writeln!(
                out,
                "| {title} | {} | {local_points} | {friction_force} | {} | {relaxation} | {} | {} | {} | {:.0e} |",
                if pressure == lumped { "lumped" } else { "extrapolated" },
                if signed { "yes" } else { "no" },
                outcome(&summary),
                summary.iterations,
                digits(summary.tangential_force),
                summary.residuals.monolithic
            )
            .unwrap();
        }
    }
    out + "\n"
}

fn two_elements() -> String {
    let mut out = String::from(
        "## The thesis's limit of two elements\n\nExample 2 with extrapolated pressure, unsigned, integrated within the element and its neighbours (20 local\nGauss points, 3.4.2) and without a limit (mesh-free). With the limit goes the line through each element's own\nvalues, without it the parabola through the nodes': the change has both causes, and the first row, whose kernel\nstays within two elements, shows the second alone. Where an iteration cycles, T is that of its last state.\n\n| ρ | T within two elements | ends | T without limit | ends | change of T | change of the peak |\n|---|---|---|---|---|---|---|\n",
    );
    for radius in [0.01, 0.03, 0.05, 0.1] {
        let problem = with_radius("cylinder", radius);
        let run = |local_points: u32| {
            let options = ThesisOptions {
                pressure: ThesisPressure::Extrapolated,
                local_points,
                ..ThesisOptions::default()
            };
            by_thesis(&problem, options, 200)
        };
        let (limited, free) = (run(20), run(0));
        writeln!(
            out,
            "| {radius} | {} | {} | {} | {} | {:+.2} % | {:+.2} % |",
            digits(limited.tangential_force),
            outcome(&limited),
            digits(free.tangential_force),
            outcome(&free),
            100.0 * (limited.tangential_force / free.tangential_force - 1.0),
            100.0 * (peak(&limited) / peak(&free) - 1.0)
        )
        .unwrap();
    }
    out + "\n"
}
