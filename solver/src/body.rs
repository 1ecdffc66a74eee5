//! The body as felt from Γ_C: one factorisation, then a small dense system.
//!
//! Ŝ v = f̂ + (forces on Γ_C), with v the displacements of the contact nodes along n and t. Every
//! contact and friction iteration runs on it; [`ElasticBody::displacements`] leads back to the
//! whole field by one back-substitution. How the factor is kept is nobody else's business.

use std::ops::ControlFlow;

use crate::elasticity::{self, Dof, DofMap};
use crate::error::SolveError;
use crate::linear::{Dense, Factor, FactorError, Graph, Ordering, SparseSymmetric};
use crate::model::Model;
use crate::solution::{Observer, Phase, Progress};

/// Assembled, supported, condensed onto the contact boundaries.
pub struct ElasticBody {
    /// Ŝ, on the contact unknowns in the order of `contact_dofs`.
    pub stiffness: Dense,
    /// f̂.
    pub load: Vec<f64>,
    /// Normal and tangential displacement of every contact node, all contacts in a row; free ones
    /// count from 0 in Ŝ.
    pub contact_dofs: Vec<[Dof; 2]>,
    /// External forces at every node along x and y, without those of contact.
    pub nodal_loads: Vec<[f64; 2]>,
    /// Which displacements are unknown.
    pub map: DofMap,
    matrix: SparseSymmetric,
    right_hand_side: Vec<f64>,
    factor: Factor,
}

impl ElasticBody {
    /// Assembles, factors and condenses, telling the observer each phase.
    pub fn new(model: &Model, observe: &mut Observer<'_>) -> Result<Self, SolveError> {
        let mut phase = |phase| match observe(Progress::Phase(phase)) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(SolveError::Stopped),
        };
        phase(Phase::Assemble)?;
        let (map, interior) = number(model);
        let graph = Graph::from_cliques(
            model.mesh.nodes.len(),
            model.mesh.elements.iter().map(|e| &e[..]),
        );
        let (matrix, mut right_hand_side) =
            elasticity::assemble_stiffness(&model.mesh, &model.section, &map, &graph);
        let nodal_loads = elasticity::assemble_loads(&model.mesh, &model.section, &model.pressures);
        add_forces(&map, &nodal_loads, &mut right_hand_side);
        if !matrix.is_finite() || right_hand_side.iter().any(|f| !f.is_finite()) {
            return Err(SolveError::NonFinite { phase: "assembly" });
        }

        phase(Phase::Order)?;
        let contact_unknowns = map.unknowns - interior;
        let order = elimination_order(model, &map, interior)?;
        let ordering = Ordering::new(&matrix, &order, contact_unknowns)?;

        phase(Phase::Factor)?;
        let factor = Factor::new(&matrix, ordering)?;

        phase(Phase::Condense)?;
        let stiffness = factor.trailing_schur_complement();
        // f̂ = Ŝ u_c with u_c from the whole system under its loads alone
        let load = if right_hand_side.iter().all(|f| *f == 0.0) {
            vec![0.0; contact_unknowns]
        } else {
            let mut u = right_hand_side.clone();
            factor.solve(&mut u);
            stiffness.times(&u[interior..])
        };
        if !(0..stiffness.size()).all(|j| stiffness.column(j).iter().all(|v| v.is_finite())) {
            return Err(SolveError::NonFinite {
                phase: "condensation",
            });
        }
        let to_contact = |dof| match dof {
            Dof::Free(i) => Dof::Free(i - interior),
            fixed => fixed,
        };
        let contact_dofs = contact_nodes(model)
            .map(|node| map.dofs[node as usize].map(to_contact))
            .collect();
        Ok(ElasticBody {
            stiffness,
            load,
            contact_dofs,
            nodal_loads,
            map,
            matrix,
            right_hand_side,
            factor,
        })
    }

    /// Displacements along x and y of every node under the loads and the given forces on the
    /// contact unknowns.
    pub fn displacements(&self, contact_force: &[f64]) -> Vec<[f64; 2]> {
        let mut rhs = self.right_hand_side.clone();
        let interior = rhs.len() - contact_force.len();
        rhs[interior..]
            .iter_mut()
            .zip(contact_force)
            .for_each(|(r, f)| *r += f);
        let mut u = rhs.clone();
        self.factor.solve(&mut u);
        // one step of iterative refinement: the residual is known to far more digits than u
        let mut correction: Vec<f64> = self
            .matrix
            .times(&u)
            .iter()
            .zip(&rhs)
            .map(|(a, b)| b - a)
            .collect();
        self.factor.solve(&mut correction);
        u.iter_mut().zip(&correction).for_each(|(u, c)| *u += c);
        self.map.displacements(&u)
    }
}

/// Contact nodes of all contacts in a row.
fn contact_nodes(model: &Model) -> impl Iterator<Item = u32> {
    model
        .contacts
        .iter()
        .flat_map(|contact| contact.boundary.nodes.iter().copied())
}

/// Numbers the unknowns, contact nodes last and turned to (n, t); also the number of the others.
fn number(model: &Model) -> (DofMap, usize) {
    let count = model.mesh.nodes.len();
    let mut axes = vec![None; count];
    for contact in &model.contacts {
        for (i, &node) in contact.boundary.nodes.iter().enumerate() {
            axes[node as usize] = Some([contact.boundary.normals[i], contact.boundary.tangent(i)]);
        }
    }
    let mut map = DofMap {
        dofs: vec![[Dof::Fixed(0.0); 2]; count],
        axes,
        unknowns: 0,
    };
    let interior_nodes = (0..count as u32)
        .filter(|&n| map.axes[n as usize].is_none())
        .collect::<Vec<_>>();
    let assign = |map: &mut DofMap, node: u32| {
        let fixed = fixed_along_axes(model, map, node);
        for a in 0..2 {
            map.dofs[node as usize][a] = fixed[a].map_or_else(
                || {
                    map.unknowns += 1;
                    Dof::Free(map.unknowns - 1)
                },
                Dof::Fixed,
            );
        }
    };
    interior_nodes
        .into_iter()
        .for_each(|node| assign(&mut map, node));
    let interior = map.unknowns;
    contact_nodes(model).for_each(|node| assign(&mut map, node));
    (map, interior)
}

/// Prescribed displacements of a node along its own axes. Model::new has seen to it that a single
/// one acts along an axis of the node.
fn fixed_along_axes(model: &Model, map: &DofMap, node: u32) -> [Option<f64>; 2] {
    let fixed = model.fixed.get(&node).copied().unwrap_or_default();
    let Some(rows) = map.axes[node as usize] else {
        return fixed;
    };
    match fixed {
        [Some(_), Some(_)] => map
            .to_axes(node as usize, fixed.map(Option::unwrap_or_default))
            .map(Some),
        _ => rows.map(|row| {
            let along = if row[0].abs() > row[1].abs() { 0 } else { 1 };
            fixed[along].map(|value| row[along] * value)
        }),
    }
}

/// Minimum degree on the nodes away from contact, a node's unknowns together; then the contact
/// unknowns in their own order.
fn elimination_order(
    model: &Model,
    map: &DofMap,
    interior: usize,
) -> Result<Vec<usize>, FactorError> {
    let free = |node: &u32| {
        map.dofs[*node as usize]
            .iter()
            .any(|dof| matches!(dof, Dof::Free(i) if *i < interior))
    };
    let mut number = vec![u32::MAX; model.mesh.nodes.len()];
    let mut nodes = Vec::new();
    for node in (0..number.len() as u32).filter(free) {
        number[node as usize] = nodes.len() as u32;
        nodes.push(node);
    }
    let cliques: Vec<Vec<u32>> = model
        .mesh
        .elements
        .iter()
        .map(|element| {
            element
                .iter()
                .map(|&n| number[n as usize])
                .filter(|&n| n != u32::MAX)
                .collect()
        })
        .collect();
    let graph = Graph::from_cliques(nodes.len(), cliques.iter().map(|c| &c[..]));
    let mut order = Vec::with_capacity(map.unknowns);
    for vertex in Ordering::minimum_degree(&graph)? {
        for dof in map.dofs[nodes[vertex] as usize] {
            if let Dof::Free(i) = dof {
                order.push(i);
            }
        }
    }
    order.extend(interior..map.unknowns);
    Ok(order)
}

/// Adds nodal forces along x and y to the right-hand side.
fn add_forces(map: &DofMap, forces: &[[f64; 2]], right_hand_side: &mut [f64]) {
    for (node, force) in forces.iter().enumerate() {
        for (dof, f) in map.dofs[node].iter().zip(map.to_axes(node, *force)) {
            if let Dof::Free(i) = dof {
                right_hand_side[*i] += f;
            }
        }
    }
}

impl From<FactorError> for SolveError {
    fn from(error: FactorError) -> Self {
        match error {
            FactorError::NotPositiveDefinite { pivot } => SolveError::SingularSystem { pivot },
            FactorError::TooLarge => SolveError::ResourceExhausted,
        }
    }
}
