//! From a final state to a [`Solution`]: forces, extents, profiles, fields, and what the user
//! should know before trusting them.

use std::collections::BTreeMap;

use crate::algorithm::fixed_point::Finished;
use crate::algorithm::profile::PatchView;
use crate::algorithm::system::System;
use crate::body::ElasticBody;
use crate::elasticity::{Dof, Recovered, recover};
use crate::error::SolveError;
use crate::model::Model;
use crate::solution::{ContactSummary, Fields, Outcome, Residuals, Solution, Summary, Warning};

/// Forces that balance no better than this have lost half of their digits: no result to trust.
const OUT_OF_BALANCE: f64 = 1e-7;

/// Forces are told from rounding when they are above this part of modulus × displacement × depth.
const FORCE_FLOOR: f64 = 1e-6;

/// Displacement beyond this part of the body's size is not small.
const LARGE_DISPLACEMENT: f64 = 0.1;

/// q beyond which the sweeps barely contract.
const SLOW_CONTRACTION: f64 = 0.9;

/// Everything a user gets to see of a final state.
pub fn report(
    model: &Model,
    body: &ElasticBody,
    system: &System<'_>,
    finished: Finished,
) -> Result<Solution, SolveError> {
    let v = &finished.state.v;
    let reactions = system.reactions(&finished.state);
    let pressures = system.pressures(&reactions);
    let contact_force = contact_force(system, v, &finished.bound, &reactions);
    let displacements = body.displacements(&contact_force);
    let recovered = recover(&model.mesh, &model.section, &displacements);
    let circumference = system.circumference;

    let mut warnings = model.warnings.clone();
    let (mut contacts, mut profiles) = (BTreeMap::new(), BTreeMap::new());
    for (p, patch) in system.patches.iter().enumerate() {
        let view = PatchView {
            system,
            patch,
            p,
            v,
            active: &finished.state.active,
            reactions: &reactions,
            pressures: &pressures,
            bound: &finished.bound,
        };
        let summary = view.summary();
        view.warn(&mut warnings);
        profiles.insert(patch.contact.name.clone(), view.profile());
        contacts.insert(patch.contact.name.clone(), summary);
    }
    warn_of_iteration(&finished, &mut warnings);
    warn_of_displacement(model, &displacements, &mut warnings);

    let total =
        |f: fn(&ContactSummary) -> f64| contacts.values().map(f).fold(0.0, |sum, x| sum + x);
    let (friction_energy, friction_work) = friction_energy(system, v, &finished.bound);
    let work_of_loads: f64 = body
        .nodal_loads
        .iter()
        .zip(&displacements)
        .map(|(f, u)| f[0] * u[0] + f[1] * u[1])
        .sum();
    let equilibrium = equilibrium(model, body, &recovered, &displacements, &contact_force);
    let outcome = match finished.outcome {
        Outcome::Converged if equilibrium > OUT_OF_BALANCE => Outcome::FalseConvergence,
        outcome => outcome,
    };
    if equilibrium > OUT_OF_BALANCE {
        warnings.push(Warning {
            code: "out_of_balance".to_owned(),
            pointer: String::new(),
            message: format!("The forces on the body do not balance: {equilibrium:.1e} of their sum is left over. The stiffness is all but singular: check supports, hinges and badly shaped elements."),
        });
    }
    let summary = Summary {
        outcome,
        converged: outcome == Outcome::Converged,
        normal_force: total(|c| c.normal_force),
        tangential_force: total(|c| c.tangential_force),
        friction_force: total(|c| c.friction_force),
        contacts,
        iterations: finished.history.len() as u32,
        stage: finished.stage,
        contraction: finished.contraction,
        residuals: Residuals {
            equilibrium,
            ..finished.residuals
        },
        energy: circumference * (recovered.strain_energy - work_of_loads + friction_energy),
        friction_work: circumference * friction_work,
        warnings,
        dofs: body.map.unknowns as u64,
        contact_dofs: body.load.len() as u64,
    };
    let fields = fields(model, &displacements, &recovered);
    let finite = [
        summary.normal_force,
        summary.tangential_force,
        summary.energy,
        equilibrium,
    ]
    .iter()
    .all(|x| x.is_finite())
        && displacements.iter().flatten().all(|u| u.is_finite())
        && recovered.stress.iter().flatten().all(|s| s.is_finite());
    if !finite {
        return Err(SolveError::NonFinite { phase: "recovery" });
    }
    Ok(Solution {
        summary,
        history: finished.history,
        profiles,
        fields,
    })
}

/// Force on every contact unknown: the obstacle's reaction −R along n and friction along t.
fn contact_force(system: &System<'_>, v: &[f64], bound: &[f64], reactions: &[f64]) -> Vec<f64> {
    let mut friction = vec![0.0; v.len()];
    system.add_friction_force(v, bound, &mut friction);
    let mut force: Vec<f64> = friction.iter().map(|f| -f).collect();
    for (node, reaction) in system.nodes.iter().zip(reactions) {
        if let Dof::Free(dof) = node.normal {
            force[dof] -= reaction;
        }
    }
    force
}

/// ∫τψ and ∫τφ (u_t − d), without 2π.
fn friction_energy(system: &System<'_>, v: &[f64], bound: &[f64]) -> (f64, f64) {
    system
        .points
        .iter()
        .zip(bound)
        .fold((0.0, 0.0), |(energy, work), (point, tau)| {
            let (law, slip) = (system.law(point), system.slip(v, point));
            let weight = point.weight * tau;
            (
                energy + weight * law.psi(slip),
                work + weight * law.phi(slip) * slip,
            )
        })
}

/// |Σ forces| / Σ|forces| over loads, contact, friction and the supports' reactions, the last
/// taken from the stresses in the body. In axisymmetry only the axial sum is a balance.
fn equilibrium(
    model: &Model,
    body: &ElasticBody,
    recovered: &Recovered,
    displacements: &[[f64; 2]],
    contact_force: &[f64],
) -> f64 {
    let first = usize::from(model.section.axisymmetric());
    let (mut sum, mut size) = ([0.0; 2], 0.0);
    let interior = body.map.unknowns - contact_force.len();
    for (node, dofs) in body.map.dofs.iter().enumerate() {
        let load = body.map.to_axes(node, body.nodal_loads[node]);
        let internal = body.map.to_axes(node, recovered.internal_force[node]);
        let external: [f64; 2] = std::array::from_fn(|a| match dofs[a] {
            Dof::Free(i) if i >= interior => load[a] + contact_force[i - interior],
            Dof::Free(_) => load[a],
            Dof::Fixed(_) => internal[a], // what the support must give, load included
        });
        let [fx, fy] = match body.map.axes[node] {
            None => external,
            Some([n, t]) => [
                n[0] * external[0] + t[0] * external[1],
                n[1] * external[0] + t[1] * external[1],
            ],
        };
        for (a, f) in [fx, fy].into_iter().enumerate().skip(first) {
            sum[a] += f;
            size += f.abs();
        }
    }
    // a body that only moves has no forces but rounding: that must not look like imbalance
    let moved = displacements
        .iter()
        .flatten()
        .fold(0.0f64, |most, u| most.max(u.abs()));
    let depth = model
        .mesh
        .nodes
        .iter()
        .map(|x| model.section.depth(x[0]))
        .fold(0.0, f64::max);
    let floor = FORCE_FLOOR * model.section.moduli[0][0] * moved * depth;
    let sum = sum[0].hypot(sum[1]);
    if sum == 0.0 {
        0.0
    } else {
        sum / f64::max(size, floor)
    }
}

fn fields(model: &Model, displacements: &[[f64; 2]], recovered: &Recovered) -> Fields {
    let mesh = &model.mesh;
    let stress = |component: usize| recovered.stress.iter().map(|s| s[component]).collect();
    Fields {
        x: mesh.nodes.iter().map(|x| x[0]).collect(),
        y: mesh.nodes.iter().map(|x| x[1]).collect(),
        ux: displacements.iter().map(|u| u[0]).collect(),
        uy: displacements.iter().map(|u| u[1]).collect(),
        stress_xx: stress(0),
        stress_yy: stress(1),
        stress_xy: stress(2),
        stress_zz: stress(3),
        elements: mesh.elements.clone(),
    }
}

/// Linear elasticity takes displacements for small beside the body.
fn warn_of_displacement(model: &Model, displacements: &[[f64; 2]], warnings: &mut Vec<Warning>) {
    let size = model.mesh.extent(0).hypot(model.mesh.extent(1));
    let largest = displacements
        .iter()
        .map(|[x, y]| x.hypot(*y))
        .fold(0.0, f64::max);
    if largest > LARGE_DISPLACEMENT * size {
        warnings.push(Warning {
            code: "large_displacement".to_owned(),
            pointer: String::new(),
            message: format!(
                "The largest displacement, {largest:.4}, is {:.0} % of the body's size: linear elasticity no longer describes it.",
                100.0 * largest / size
            ),
        });
    }
}

fn warn_of_iteration(finished: &Finished, warnings: &mut Vec<Warning>) {
    let mut warn = |code: &str, message: String| {
        warnings.push(Warning {
            code: code.to_owned(),
            pointer: "/solver".to_owned(),
            message,
        });
    };
    if let Some(q) = finished.contraction.filter(|q| *q > SLOW_CONTRACTION) {
        warn(
            "slow_contraction",
            format!(
                "The friction bound contracts by only q = {q:.3} per sweep: friction and pressure feed each other, and the state may not be the only one."
            ),
        );
    }
    if finished.outcome == Outcome::NotConverged {
        let r = finished.residuals;
        warn(
            "not_converged",
            format!(
                "After {} iterations the residuals are kkt {:.1e}, friction {:.1e}, monolithic {:.1e}. Raise max_iterations if they still fall in the history; else raise elastic_slip or tolerance, or refine the mesh.",
                finished.history.len(),
                r.kkt,
                r.friction,
                r.monolithic
            ),
        );
    }
    if let Some(cycle) = &finished.cycle {
        warn(
            "contact_cycling",
            format!(
                "The contact set repeats every {} sweeps; contact nodes {:?} keep changing state. Refine the mesh there, or raise elastic_slip.",
                cycle.period, cycle.nodes
            ),
        );
    }
}
