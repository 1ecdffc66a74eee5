//! Checks of contacts that another elastic body faces in place of an obstacle.

use std::collections::{BTreeMap, BTreeSet};

use super::axis::Axis;
use super::checks::Checks;
use super::contact_model::ContactModel;
use super::pair::{FacingCorner, Pair};
use super::supports::Held;
use crate::contact::mortar::{self, Coupling};
use crate::contact::obstacle::FacingRun;
use crate::contact::{ContactBoundary, HeldDirections, Profile, arc_lengths};
use crate::elasticity::Section;
use crate::error::{AllChecks, Checked, Reason, either};
use crate::mesh::{self, Edge, Mesh};
use crate::problem::{BodyGap, Condition, Contact, NormalOf};
use crate::solution::WarningCode;

/// The ratio of the lengths of facing edges above which the coarser side should not carry the law.
const MUCH_COARSER: f64 = 3.0;

/// The gap, as a part of the largest coordinate, that rounding leaves between bodies that lie on one another: a mean of
/// differences of coordinates, a few roundings each.
const ROUNDED: f64 = 16.0 * f64::EPSILON;

/// A contact boundary, the part of it that an obstacle or another body faces.
pub(super) struct Faced {
    pub(super) boundary: ContactBoundary,
    /// The body's own normals.
    pub(super) outward: Vec<[f64; 2]>,
    pub(super) run: FacingRun,
    /// The edges inside which the other boundary ends, each with the length that it covers.
    pub(super) cut: Vec<(Edge, f64)>,
    /// The other body; none if it is a rigid obstacle.
    pub(super) pair: Option<Pair>,
}

impl Checks {
    /// Checks what a contact faces: the numbers of its obstacle, or what another body needs.
    pub(super) fn obstacle_or_body(&mut self, contact: &Contact, pointer: &str) -> Checked {
        let obstacle = match &contact.obstacle {
            Some(obstacle) => self.obstacle(obstacle, &format!("{pointer}/obstacle")),
            None => Ok(()),
        };
        obstacle.and(self.facing_body_numbers(contact, pointer))
    }

    /// Checks which of `obstacle` and `against` a contact has, and that nothing else contradicts it.
    pub(super) fn facing_body_numbers(&mut self, contact: &Contact, pointer: &str) -> Checked {
        let mut all = AllChecks::default();
        let at = |field: &str| format!("{pointer}/{field}");
        match (&contact.obstacle, &contact.against) {
            (None, None) => all.fail(self.report(
                at("obstacle"),
                Reason::Missing,
                "neither `obstacle` nor `against`",
                "a rigid `obstacle`, or the boundary of another body: \"against\": {\"boundary\": …}",
                "A contact needs something that it can touch.",
            )),
            (Some(_), Some(_)) => all.fail(self.report(
                at("against"),
                Reason::Conflict,
                "`obstacle` and `against`",
                "either a rigid `obstacle` or another body",
                "Give each of the two a contact and a boundary of its own.",
            )),
            _ => {}
        }
        if contact.against.is_none() {
            if contact.gap.is_some() {
                all.fail(self.report(
                    at("gap"),
                    Reason::NotUsed,
                    "`gap` without `against`",
                    "`gap` only against another body",
                    "The distance of a rigid obstacle is its profile less the `indentation`.",
                ));
            }
            if contact.normal == Some(NormalOf::Mean) {
                all.fail(self.report(
                    at("normal"),
                    Reason::NotUsed,
                    "`mean` without `against`",
                    "`body` or `obstacle`",
                    "A mean of two normals is that of two bodies.",
                ));
            }
            return all.finish(());
        }
        let given = [
            ("indentation", contact.indentation != 0.0),
            ("normal_force", contact.normal_force.is_some()),
            ("direction", contact.direction.is_some()),
            (
                "tangential_displacement",
                contact.tangential_displacement != 0.0,
            ),
            ("tangential_force", contact.tangential_force.is_some()),
            ("tilt", contact.tilt.is_some()),
            ("moment", contact.moment.is_some()),
            ("about", contact.about.is_some()),
            ("stiffness", contact.stiffness.is_some()),
        ];
        for (field, _) in given.into_iter().filter(|(_, given)| *given) {
            all.fail(self.report(
                at(field),
                Reason::NotUsed,
                format!("`{field}` against another body"),
                format!("no `{field}`"),
                "An elastic body is moved by its own supports and loads; two bodies that overlap before deformation are given by \"gap\": {\"interference\": …}.",
            ));
        }
        if contact.normal == Some(NormalOf::Obstacle) {
            all.fail(self.report(
                at("normal"),
                Reason::NotUsed,
                "`obstacle` against another body",
                "`mean` or `body`",
                "There is no obstacle.",
            ));
        }
        if contact.condition == Condition::None {
            all.fail(self.report(
                at("condition"),
                Reason::NotUsed,
                "`none` against another body",
                "`unilateral` or `bonded`",
                "Without the condition there is no other body.",
            ));
        }
        if let Some(gap) = &contact.gap {
            all.check(self.body_gap(gap, &at("gap")));
        }
        all.finish(())
    }

    /// Checks the distance of two bodies.
    fn body_gap(&mut self, gap: &BodyGap, pointer: &str) -> Checked {
        let mut all = AllChecks::default();
        if gap.interference.is_some() == gap.clearance.is_some() {
            let given = [
                ("interference", gap.interference.is_some()),
                ("clearance", gap.clearance.is_some()),
            ];
            all.fail(self.report(
                pointer,
                Reason::WrongCount,
                either(&given),
                "exactly one of `interference` and `clearance`",
                "Without `gap` the distance is that of the two meshes.",
            ));
        }
        all.check(self.require(
            gap.interference.is_none_or(|overlap| overlap > 0.0),
            format!("{pointer}/interference"),
            gap.interference.unwrap_or_default(),
            "a length > 0",
            "Bodies that are apart have a `clearance`.",
        ));
        all.check(self.require(
            gap.clearance.is_none_or(|apart| apart >= 0.0),
            format!("{pointer}/clearance"),
            gap.clearance.unwrap_or_default(),
            "a length ≥ 0",
            "Bodies that overlap have an `interference`.",
        ));
        all.finish(())
    }

    /// The part of a boundary that the other body of a contact faces.
    #[allow(clippy::too_many_arguments)] // all that it is made from
    pub(super) fn faced(
        &mut self,
        mesh: &Mesh,
        section: &Section,
        axis: &Axis,
        contact: &Contact,
        edges: &[Edge],
        held: &HeldDirections,
        pointer: &str,
    ) -> Checked<Faced> {
        let against = contact
            .against
            .as_ref()
            .map_or("", |against| &against.boundary);
        let place = format!("{pointer}/against/boundary");
        let chain = self.one_chain(mesh, edges, &format!("{pointer}/boundary"), false)?;
        let there = self.boundary(mesh, against, place.clone())?;
        let there = self.one_chain(mesh, there, &place, true)?;
        let own: BTreeSet<u32> = chain.iter().flatten().copied().collect();
        if let Some(node) = there.iter().flatten().find(|node| own.contains(*node)) {
            return Err(self.report(
                place,
                Reason::SharedNode,
                format!("node {node}, also on `{}`", contact.boundary),
                "a boundary without common nodes",
                "Two bodies in contact are separate parts of the mesh: where they meet, each has nodes of its own.",
            ));
        }
        let depth = |x: f64| section.depth(x);
        let other = ContactBoundary::new(mesh, &there, 0.0, held, depth);
        let couple = |chain: &[Edge], start: f64| {
            let mut own = ContactBoundary::new(mesh, chain, start, held, depth);
            let outward = own.normals.clone();
            if contact.used_normal() == NormalOf::Mean {
                mortar::take_mean_normals(&mut own, &other, held);
            }
            let coupling = mortar::couple(&own, &other, depth, &axis.ends(&own.positions));
            (own, outward, coupling)
        };
        let (first, _, whole) = couple(&chain, 0.0);
        let covered = self.covered(mesh, &chain, &whole, contact, pointer)?;
        let start = arc_lengths(mesh, &chain)[2 * covered.start];
        let cut = self.cut_edges(mesh, &chain, &covered, (&first, &other), pointer);
        let chain = &chain[covered];
        let (boundary, outward, coupling) = couple(chain, start);
        if contact.gap.is_none() {
            self.overlap(&boundary, &other, &coupling, contact, pointer)?;
        }
        self.warn_of_coarser(&boundary, &other, &coupling, contact, pointer);
        self.warn_of_given_gap(&boundary, &coupling, contact, pointer);
        let distance = |gap: &f64| match contact.gap {
            // what is bonded stays as it lies
            None if contact.condition == Condition::Bonded => 0.0,
            None => *gap,
            Some(given) => given.clearance.unwrap_or(0.0),
        };
        let size = boundary.positions.iter().flatten();
        let size = size.fold(0.0f64, |most, x| most.max(x.abs()));
        let profile = coupling.gaps.iter().map(|gap| Profile {
            // bodies that lie on one another neither overlap nor gape by what rounding leaves of their coordinates
            distance: match distance(gap) {
                gap if gap.abs() <= ROUNDED * size => 0.0,
                gap => gap,
            },
            slope: 0.0,
        });
        let turned = match contact.used_normal() {
            NormalOf::Mean => vec![0.0; boundary.nodes.len()],
            _ => {
                let mut mean = boundary.clone();
                mortar::take_mean_normals(&mut mean, &other, held);
                let both = boundary.normals.iter().zip(&mean.normals);
                both.map(|([a, b], [x, y])| (a * y - b * x).atan2(a * x + b * y))
                    .collect()
            }
        };
        let by_meshes = contact.gap.is_none() && contact.condition == Condition::Unilateral;
        let corner = |(edge, xi, node): &(usize, f64, usize)| {
            let sides = [node.checked_sub(2), Some(*node)].into_iter().flatten();
            let sides = sides.filter(|start| start + 2 < other.nodes.len());
            let lengths = sides.map(|start| other.s[start + 2] - other.s[start]);
            FacingCorner {
                edge: *edge,
                xi: *xi,
                turn: other.turn(*node),
                sharp: other.corner(*node) != 0.0,
                side: lengths.fold(0.0, f64::max),
            }
        };
        let corners = coupling.corners.iter().filter(|_| by_meshes).map(corner);
        let corners = corners.filter(|corner| corner.turn != 0.0).collect();
        Ok(Faced {
            run: FacingRun {
                chain: chain.to_vec(),
                profile: profile.collect(),
                start,
                coordinate: boundary.s.clone(),
                places: Vec::new(),
            },
            boundary,
            outward,
            cut,
            pair: Some(faced_part(against, &other, &coupling, turned, corners)),
        })
    }

    /// The edges beside those that are covered of which the other body faces a part, with its length; they are left out, and told of
    /// where the bodies are near.
    fn cut_edges(
        &mut self,
        mesh: &Mesh,
        chain: &[Edge],
        covered: &std::ops::Range<usize>,
        (own, other): (&ContactBoundary, &ContactBoundary),
        pointer: &str,
    ) -> Vec<(Edge, f64)> {
        /// The distance, in lengths of the edge, above which contact will not come that far.
        const NEAR: f64 = 0.1;
        let beside = [covered.start.checked_sub(1), Some(covered.end)];
        let mut cut = Vec::new();
        for edge in beside
            .into_iter()
            .flatten()
            .filter(|edge| *edge < chain.len())
        {
            let [start, end, _] = own.edge_arc(edge);
            let length = end - start;
            let Some((part, gap)) = mortar::partly_faced(own, other, edge) else {
                continue;
            };
            // the last edges of the other body go on for a little
            let ends = [0, other.edge_count() - 1].map(|last| other.edge_arc(last));
            let longest = ends
                .iter()
                .fold(0.0f64, |most, [start, end, _]| most.max(end - start));
            let beyond = mortar::BEYOND * longest + length / mortar::SAMPLES as f64;
            if gap > NEAR * length || part * length <= beyond {
                continue;
            }
            let [[x0, y0], [x1, y1]] =
                [chain[edge][0], chain[edge][1]].map(|node| mesh.nodes[node as usize]);
            self.warn(
                WarningCode::ObstacleCutsEdge,
                &format!("{pointer}/against"),
                format!("The other body ends opposite the edge from ({x0}, {y0}) to ({x1}, {y1}), which is left out of the contact. Put a node there, or let the two boundaries change places."),
            );
            cut.push((chain[edge], part * length));
        }
        cut
    }

    /// Checks that the bodies do not lie inside one another: boundaries that look away from one another through a body would be
    /// pressed by its thickness.
    fn overlap(
        &mut self,
        own: &ContactBoundary,
        other: &ContactBoundary,
        coupling: &Coupling,
        contact: &Contact,
        pointer: &str,
    ) -> Checked {
        /// The largest overlap, in lengths of the shorter boundary.
        const MOST: f64 = 0.5;
        let least = coupling.gaps.iter().copied().fold(f64::INFINITY, f64::min);
        let most = MOST * own.length().min(other.length());
        if -least <= most {
            return Ok(());
        }
        let against = contact
            .against
            .as_ref()
            .map_or("", |against| &against.boundary);
        Err(self.report(
            format!("{pointer}/against/boundary"),
            Reason::Impossible,
            format!("bodies that overlap by {:.3e} between `{}` and `{against}`", -least, contact.boundary),
            format!("an overlap of at most {most:.3e}, half the length of the shorter boundary"),
            "The two boundaries must be the sides by which two bodies touch, and not two sides of one; an overlap is also given by \"gap\": {\"interference\": …}.",
        ))
    }

    /// The one chain of edges that a boundary is.
    pub(super) fn one_chain(
        &mut self,
        mesh: &Mesh,
        edges: &[Edge],
        place: &str,
        may_be_closed: bool,
    ) -> Checked<Vec<Edge>> {
        let runs = mesh::runs(edges);
        let [run] = &runs[..] else {
            let hint = format!(
                "Name each piece under /mesh/boundaries and give it a contact of its own.{}",
                self.hint_to_merge(mesh)
            );
            return Err(self.report(
                place,
                Reason::NotAChain,
                format!("{} pieces", runs.len()),
                "one chain of edges",
                hint,
            ));
        };
        if mesh::is_closed(run) && !may_be_closed {
            return Err(self.report(
                place,
                Reason::NotAChain,
                "a closed loop",
                "a chain of edges with two ends",
                "Name a part of the loop under /mesh/boundaries.",
            ));
        }
        Ok(run.to_vec())
    }

    /// The edges of a chain that the other body covers as a whole, which must be one piece.
    fn covered(
        &mut self,
        mesh: &Mesh,
        chain: &[Edge],
        coupling: &Coupling,
        contact: &Contact,
        pointer: &str,
    ) -> Checked<std::ops::Range<usize>> {
        let covered = &coupling.covered;
        let starts = (0..covered.len()).filter(|&e| covered[e] && (e == 0 || !covered[e - 1]));
        let starts: Vec<usize> = starts.collect();
        let [start] = starts[..] else {
            let against = contact
                .against
                .as_ref()
                .map_or("", |against| &against.boundary);
            let [first, last] = [chain[0][0], chain[chain.len() - 1][1]];
            let [[x0, y0], [x1, y1]] = [first, last].map(|node| mesh.nodes[node as usize]);
            let (reason, got) = match starts.len() {
                0 => (
                    Reason::CoversNothing,
                    "all of no edge of the boundary".to_owned(),
                ),
                pieces => (
                    Reason::NotAChain,
                    format!("all edges of {pieces} separate pieces of the boundary"),
                ),
            };
            return Err(self.report(
                format!("{pointer}/against/boundary"),
                reason,
                format!("`{against}` faces {got}"),
                "a boundary that faces all of at least one edge, in one piece",
                format!("The boundary goes from ({x0}, {y0}) to ({x1}, {y1}). The bodies must lie opposite one another, each with its outside towards the other; or let the two boundaries change places, so that the finer one carries the law."),
            ));
        };
        let end = (start..covered.len())
            .find(|e| !covered[*e])
            .unwrap_or(covered.len());
        Ok(start..end)
    }

    /// Warns of a given distance, the same everywhere, of meshes that do not fit one another.
    fn warn_of_given_gap(
        &mut self,
        own: &ContactBoundary,
        coupling: &Coupling,
        contact: &Contact,
        pointer: &str,
    ) {
        /// The largest difference of distances, in lengths of the contact: coarse polygons of a circle differ by less.
        const MOST: f64 = 0.05;
        let gaps = coupling.gaps.iter().copied();
        let [least, most] = [
            gaps.clone().fold(f64::INFINITY, f64::min),
            gaps.fold(f64::NEG_INFINITY, f64::max),
        ];
        if contact.gap.is_none() || most - least <= MOST * own.length() {
            return;
        }
        self.warn(
            WarningCode::GapDiffers,
            &format!("{pointer}/gap"),
            format!(
                "The distance of the bodies is given as the same everywhere, but that of their meshes goes from {least:.3e} to {most:.3e}: they touch as if they fitted one another. Leave `gap` out if they lie as they are drawn."
            ),
        );
    }

    /// Warns where the side that carries the law is much the coarser one.
    fn warn_of_coarser(
        &mut self,
        own: &ContactBoundary,
        other: &ContactBoundary,
        coupling: &Coupling,
        contact: &Contact,
        pointer: &str,
    ) {
        let length = |boundary: &ContactBoundary, edge: usize| {
            let [start, end, _] = boundary.edge_arc(edge);
            end - start
        };
        let ratio = |edge: usize| {
            let row = &coupling.rows[2 * edge + 1];
            let most = row.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
            let there = (most.0 / 2).min(other.edge_count() - 1);
            Some(length(own, edge) / length(other, there))
        };
        let ratios = (0..own.edge_count()).filter_map(ratio);
        let most = ratios.fold(0.0, f64::max);
        if most > MUCH_COARSER {
            self.warn(
                WarningCode::CoarserSideCarriesLaw,
                &format!("{pointer}/against/boundary"),
                format!(
                    "Edges of `{}`, which carries the law, are up to {most:.1} times as long as those that face them: pressures follow the coarser side. Let the two boundaries change places, or refine `{}`.",
                    contact.boundary, contact.boundary
                ),
            );
        }
    }

    /// Checks the supports at the nodes of a contact with another body, and that its nodes and those opposite belong to no other
    /// contact in another role.
    pub(super) fn nodes_of_pair(
        &mut self,
        mesh: &Mesh,
        model: &ContactModel,
        others: &[ContactModel],
        fixed: &BTreeMap<u32, Held>,
    ) -> Checked {
        // nodes that carry the law of one and face the other
        fn facing(contact: &ContactModel) -> impl Iterator<Item = &u32> {
            contact.pair.iter().flat_map(|pair| &pair.nodes)
        }
        let own: BTreeSet<u32> = model.boundary.nodes.iter().copied().collect();
        let faced: BTreeSet<u32> = facing(model).copied().collect();
        for other in others {
            let mut both = facing(other).filter(|node| own.contains(node));
            let carried = other.boundary.nodes.iter();
            let mut carried = carried.filter(|node| faced.contains(node));
            if let Some(node) = both.next().or_else(|| carried.next()) {
                let [x, y] = mesh.nodes[*node as usize];
                return Err(self.report(
                    format!("{}/boundary", model.pointer),
                    Reason::SharedNode,
                    format!("node {node} at ({x}, {y}), which carries the law of one of the contacts `{}` and `{}`, and faces the other", model.name, other.name),
                    "nodes that carry a law in at most one contact, and face none at the same time",
                    "End one of the contacts one edge earlier, or let boundary and `against` change places in one of them.",
                ));
            }
        }
        let Some(pair) = &model.pair else {
            return Ok(());
        };
        let boundary = &model.boundary;
        for (i, node) in boundary.nodes.iter().enumerate() {
            let Some(held) = fixed.get(node) else {
                continue;
            };
            let (n, t, [x, y]) = (
                boundary.normals[i],
                boundary.tangent(i),
                boundary.positions[i],
            );
            // a line of symmetry holds both bodies
            let mirrored = |k: usize| {
                let there = fixed.get(&pair.nodes[k]);
                there.is_some_and(|there| there.along(t) == Some(0.0))
            };
            let symmetric = held.along(t) == Some(0.0)
                && held.along(n).is_none()
                && pair.rows[i].iter().any(|(k, _)| mirrored(*k));
            if !symmetric {
                return Err(self.report(
                    format!("{}/boundary", model.pointer),
                    Reason::ObliqueSupport,
                    format!("node {node} at ({x}, {y}), which a support holds and which faces `{}`", pair.boundary),
                    "a support at a node of this boundary only on a line of symmetry, which holds both bodies along the tangent",
                    "End the contact one edge before the support with `from` or `to`, or let boundary and `against` change places.",
                ));
            }
        }
        Ok(())
    }
}

/// The part of the other boundary that a contact follows: a boundary may face many contacts.
fn faced_part(
    boundary: &str,
    other: &ContactBoundary,
    coupling: &Coupling,
    turned: Vec<f64>,
    corners: Vec<FacingCorner>,
) -> Pair {
    let nodes = || coupling.rows.iter().flatten().map(|(k, _)| *k);
    let first = nodes().min().unwrap_or(0) & !1;
    let last = nodes().max().unwrap_or(0).next_multiple_of(2);
    let part = first..last + 1;
    let counted = |row: &Vec<(usize, f64)>| {
        let parts = row.iter().map(|(k, weight)| (k - first, *weight));
        parts.collect::<Vec<_>>()
    };
    Pair {
        boundary: boundary.to_owned(),
        nodes: other.nodes[part.clone()].to_vec(),
        s: other.s[part.clone()].to_vec(),
        positions: other.positions[part.clone()].to_vec(),
        normals: other.normals[part.clone()].to_vec(),
        weights: other.weights[part].to_vec(),
        rows: coupling.rows.iter().map(counted).collect(),
        turned,
        corners,
    }
}
