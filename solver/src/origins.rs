//! The elements where the errors of quantities come from, which adaptive refinement divides.

use std::collections::BTreeSet;

use crate::model::Model;

/// A quantity whose error is more than this many times the tolerance counts as if its error were this many times it.
const MOST_EXCESS: f64 = 100.0;

/// The contribution of every element to the errors above a tolerance.
pub struct Origins {
    /// The largest relative error that needs no refinement.
    tolerance: f64,
    /// The contribution of each element. The contributions to the error of one quantity add up to its relative error
    /// divided by the tolerance. All are 0 if no error is above the tolerance, or none is known.
    pub elements: Vec<f64>,
    /// Elements where errors are unknown until there are more nodes.
    pub unresolved: BTreeSet<usize>,
    /// The element at every edge of each contact.
    at_edge: Vec<Vec<u32>>,
}

/// The contribution of each element, and of each edge of a contact, to the error of a quantity, in one unit.
#[derive(Default)]
pub struct Added {
    /// The contribution by element; empty if the contributions are known by edge only.
    pub elements: Vec<f64>,
    /// The contribution by edge of the contact.
    pub edges: Vec<(usize, f64)>,
}

impl Added {
    /// Adds the contributions of several edges, `total` together, in proportion to their `parts`.
    pub fn spread(&mut self, total: f64, parts: &[(usize, f64)]) {
        let sum: f64 = parts.iter().map(|(_, part)| part).sum();
        if sum > 0.0 {
            let shares = parts.iter().map(|(edge, part)| (*edge, total * part / sum));
            self.edges.extend(shares);
        }
    }
}

impl Origins {
    /// Starts with no contribution, for the elements of a model.
    pub fn new(model: &Model, tolerance: f64) -> Self {
        let mut with_side = vec![0; model.mesh.nodes.len()];
        for (element, e) in model.mesh.elements.iter().zip(0..) {
            for [_, _, mid] in element.sides() {
                with_side[mid as usize] = e;
            }
        }
        // a chain has a midside at every odd place
        let at_edge = model.contacts.iter().map(|contact| {
            let midsides = contact.boundary.nodes.iter().skip(1).step_by(2);
            midsides.map(|mid| with_side[*mid as usize]).collect()
        });
        Origins {
            tolerance,
            elements: vec![0.0; model.mesh.elements.len()],
            unresolved: BTreeSet::new(),
            at_edge: at_edge.collect(),
        }
    }

    /// Removes all contributions.
    pub fn forget(&mut self) {
        self.elements.fill(0.0);
        self.unresolved.clear();
    }

    /// Adds a place of a contact where the obstacle between the nodes is not resolved: errors are unknown until there
    /// are nodes at the place.
    pub fn add_place(&mut self, model: &Model, patch: usize, s: f64) {
        let boundary = &model.contacts[patch].boundary;
        let covers = |edge: &usize| boundary.edge_arc(*edge)[1] >= s;
        let last = boundary.edge_count() - 1;
        let edge = (0..last).find(covers).unwrap_or(last);
        self.unresolved.insert(self.at_edge[patch][edge] as usize);
    }

    /// Adds the contributions `added` to the error of a quantity of a contact. `relative`: the relative error of the
    /// quantity.
    pub fn add(&mut self, patch: usize, relative: f64, added: &Added) {
        let edges = added.edges.iter().map(|(_, part)| part);
        let total: f64 = added.elements.iter().chain(edges).sum();
        if relative <= self.tolerance || !(total > 0.0 && total.is_finite()) {
            return;
        }
        let excess = (relative / self.tolerance).min(MOST_EXCESS);
        for (sum, part) in self.elements.iter_mut().zip(&added.elements) {
            *sum += excess * part / total;
        }
        for (edge, part) in &added.edges {
            self.elements[self.at_edge[patch][*edge] as usize] += excess * part / total;
        }
    }
}
