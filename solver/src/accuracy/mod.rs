//! How far the numbers of a solution can be trusted: the errors that the mesh causes in forces, peaks and extents.
//!
//! The errors of the body's stresses, estimated by recovery, are weighted by their influence on each quantity J,
//!
//!   J(u) − J(u_h) ≈ ∫ (σ* − σ_h) : C⁻¹ (σ_z* − σ_z,h)
//!
//! with σ* recovered from σ_h, and σ_z the stresses of the dual solution of J, which has the contact displacements z of
//! [`influences`]. The errors due to what happens between the nodes and points of the contact are added (`Parts`). Each
//! part has a factor, so that the sum is a bound: the factors are calibrated on random problems by
//! `tests/verification/calibration.rs`, which also says how often the bound holds.

mod assessment;
mod halved;
mod increments;
mod measurement;
mod signs;
mod singular;
mod verdict;

pub use assessment::{Assessment, Finding, FindingCode, assessment};
pub use halved::{OnOtherMesh, unverified, verified};
pub use increments::Increments;
pub use measurement::{add_measurement, without_measurement};
pub use signs::note_unknown_signs;
pub use verdict::limit_by;

use crate::algorithm::{
    DisplacedNode, Estimable, Finished, Quantity, Reported, System, influences,
};
use crate::contact::{AXIS_SHARE, edge_nodes};
use crate::elasticity::Dof;
use crate::element::edge3;
use crate::linear::{Interrupt, Stopped};
use crate::observer::Observer;
use crate::origins::{Added, Origins};
use crate::problem::Condition;
use crate::solution::{Accuracy, ErrorMethod, EstimatedQuantity, Outcome, QuantityName};
use singular::Surroundings;
use verdict::{Doubt, conclude, length, relative, scale};

/// The parts of the error of a quantity, in its unit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Parts {
    /// The sum of the weighted errors of all elements.
    signed: f64,
    /// The sum of the sizes of the weighted errors of all elements: some errors of opposite sign cancel by chance only.
    absolute: f64,
    /// The sum of the sizes of the weighted errors of elements away from the contact. Near the contact, where the dual
    /// solution of a peak has a singular point, errors mostly cancel; errors from far away do not.
    away: f64,
    /// The part of the weighted errors of elements that exceeds those of the elements around. Elements stand out at a
    /// singular point, where recovery sees only a part of the error.
    standing_out: f64,
    /// The change of the quantity if the pressure, quadratic between nodes, is moved to the nodes.
    consistency: f64,
    /// The error due to the gap between the nodes within the edges at the ends of contact, where only some nodes touch.
    gap: f64,
    /// The value of the quantity times the square of the distance between the nodes at the ends of contact, in lengths
    /// of the contact: the change of the quantity, nearly stationary there, if an end of contact moves by a node.
    ends: f64,
    /// The same in a body of revolution, times the factor [`OF_REVOLUTION`]; of a peak of the pressure and of the normal force.
    ends_of_revolution: f64,
    /// The error due to the distance between nodes, [`Quantity::spacing`].
    spacing: f64,
    /// The error because the law is evaluated at its points only, [`Quantity::between`].
    between: f64,
    /// What the mesh does not resolve, [`Quantity::unresolved`].
    unresolved: f64,
    /// The error due to the end of an obstacle inside an edge, which is left out, [`Quantity::truncation`].
    truncation: f64,
    /// The pressure of a shape of the obstacle that the nodes miss, [`Quantity::unseen`].
    unseen: f64,
    /// The least error that a sharp end leaves, [`Quantity::sharp_end`].
    sharp_end: f64,
    /// The change of the quantity by the mean, over an edge, of shapes of the obstacle that the nodes miss.
    unseen_mean: f64,
    /// The size of the quantity itself, for rounding and errors that no other part contains.
    value: f64,
}

impl Parts {
    /// The parts that need no dual solution, of a quantity among those of its contact. `of_revolution`: whether the body is one.
    fn of(quantity: &Quantity, all: &[Quantity], of_revolution: bool) -> Parts {
        use QuantityName::{Indentation, NormalForce, PeakNormalStress};
        let ends = quantity.value.abs() * end_spacing(quantity, all).powi(2);
        let ring =
            of_revolution && matches!(quantity.name, NormalForce | PeakNormalStress | Indentation);
        // a motion that is given is exact
        let given = quantity.name.is_motion() && quantity.gradient.is_none();
        if given {
            return Parts::default();
        }
        Parts {
            ends,
            ends_of_revolution: if ring { OF_REVOLUTION * ends } else { 0.0 },
            spacing: quantity.spacing,
            between: quantity.between,
            unresolved: quantity.unresolved,
            truncation: quantity.truncation,
            unseen: quantity.unseen,
            sharp_end: quantity.sharp_end,
            value: quantity.value.abs(),
            ..Parts::default()
        }
    }

    /// The bound of the error: the sum of the parts, each with its factor.
    fn bound(&self, name: QuantityName) -> f64 {
        let [
            signed,
            absolute,
            away,
            consistency,
            gap,
            ends,
            spacing,
            between,
            value,
        ] = factors(name);
        let sum = signed * self.signed.abs()
            + absolute * self.absolute
            + away * self.away
            + STANDING_OUT * self.standing_out
            + consistency * self.consistency
            + gap * self.gap.abs()
            + ends * self.ends
            + self.ends_of_revolution
            + spacing * self.spacing
            + between * self.between
            + self.unresolved
            + truncation_factor(name) * self.truncation
            + value * self.value;
        let sum = sum.max(self.sharp_end);
        // the shape of the obstacle between the nodes is in the other parts as far as the nodes see it; its mean, which moves
        // the whole body, is in none, but changes the peak of the pressure less than the shape does
        match name {
            QuantityName::PeakNormalStress => sum.max(self.unseen + self.unseen_mean),
            _ => sum.max(self.unseen) + self.unseen_mean,
        }
    }
}

/// The factor of [`Parts::ends`] for peaks of the pressure and normal forces of bodies of revolution, where a ring at the end of
/// contact has a larger part of the force than an end in a plane: spheres of many depths then lie within
/// (`tests/verification/hertz_sphere.rs`).
const OF_REVOLUTION: f64 = 0.25;

/// The factor of [`Parts::standing_out`]: large enough for a clamped corner of an orthotropic body
/// (`tests/verification/far_away.rs`).
const STANDING_OUT: f64 = 4.0;

/// A factor on the error of the normal force of a bonded contact, whose ends are corners with tension and pressure without a limit:
/// coarse blocks under flats, wedges and parabolas show up to 1.9 (`tests/verification/bonded_wedges.rs`).
const BONDED: f64 = 2.0;

/// The calibrated factors of [`Parts`], in the order of its fields; parts without a factor here have functions or
/// constants of their own. Parts that did not improve the bound have the factor 0.
fn factors(name: QuantityName) -> [f64; 9] {
    use QuantityName::*;
    #[rustfmt::skip] // a table
    let factors = match name {
        NormalForce              => [0.95, 2.1,  0.0, 0.0,  0.45, 0.0,  0.0,   0.0,   1e-4],
        TangentialForce          => [3.7,  0.95, 0.0, 0.55, 0.0,  0.1,  0.53,  0.07,  1e-4],
        FrictionForce            => [1.85, 2.1,  0.0, 0.17, 0.2,  0.14, 0.68,  0.21,  1e-4],
        PeakNormalStress         => [1.6,  0.0,  0.5, 0.0,  0.0,  0.0,  1.9,   0.02,  1e-4],
        PeakTangentialStress     => [0.0,  1.65, 0.0, 1.1,  0.0,  0.0,  0.76,  0.185, 1e-4],
        // the contact ends somewhere between the outermost node in contact and the next one
        ContactStart | ContactEnd => [0.0, 0.0,  0.0, 0.0,  0.0,  0.0,  1.0,   0.0,   0.0],
        StickEnd                 => [0.0,  2.05, 0.0, 0.0,  0.0,  0.0,  0.42,  0.0,   0.0],
        // as of the normal force, on which they depend
        Indentation | TangentialDisplacement | Tilt
                                 => [0.95, 2.1,  0.0, 0.0,  0.45, 0.0,  0.0,   0.0,   1e-4],
    };
    factors
}

/// The factor of [`Parts::truncation`]: twice what flat punches show. If a punch is made longer by some part, its force
/// grows by 0.25 to 0.3 of that part (`tests/verification/obstacle_points.rs`). Friction with a prescribed bound grows
/// by the whole part.
fn truncation_factor(name: QuantityName) -> f64 {
    use QuantityName::*;
    match name {
        NormalForce => 0.5,
        TangentialForce
        | FrictionForce
        | PeakNormalStress
        | PeakTangentialStress
        | ContactStart
        | ContactEnd
        | Indentation
        | TangentialDisplacement
        | Tilt => 1.0,
        StickEnd => 1.5,
    }
}

/// The largest relative difference between the size of the tangential force and the friction force with which friction
/// counts as acting in one direction.
const ONE_WAY: f64 = 1e-9;

/// A final state with its results.
#[derive(Clone, Copy)]
pub struct Solved<'a> {
    /// The problem, condensed to Γ_C.
    pub system: &'a System<'a>,
    /// The final state.
    pub finished: &'a Finished,
    /// The results of the final state.
    pub reported: &'a Reported,
}

/// Computes the errors of all quantities and the verdict. `increments`: the quantities of the same solution in more
/// increments, if the solution depends on the load path.
pub fn assess(
    solved: Solved<'_>,
    increments: Option<&Increments>,
    origins: Option<&mut Origins>,
    observer: &mut dyn Observer,
) -> Accuracy {
    let Solved {
        system, reported, ..
    } = solved;
    let quantities = &reported.along.quantities;
    let bounds = match reported.summary.outcome {
        Outcome::Converged => bounds(solved, origins, observer),
        _ => None,
    };
    let mut found = Vec::with_capacity(quantities.len());
    for (i, quantity) in quantities.iter().enumerate() {
        let error = bounds.as_ref().map(|bounds| bounds[i].mesh);
        let (error, method) = match (quantity.estimable, error, quantity.name) {
            (Estimable::NoLimit, ..) => (None, ErrorMethod::NoLimit),
            (Estimable::TooMany, ..) => (None, ErrorMethod::TooMany),
            (Estimable::Unseen, ..) => (None, ErrorMethod::Unknown),
            (
                Estimable::Yes,
                Some(error),
                QuantityName::ContactStart | QuantityName::ContactEnd,
            ) => (Some(error), ErrorMethod::NodeSpacing),
            (Estimable::Yes, Some(error), _) if error.is_finite() => {
                (Some(error), ErrorMethod::WeightedRecovery)
            }
            _ => (None, ErrorMethod::Unknown),
        };
        let scale = scale_of(quantity, quantities);
        // without a counterpart in more increments nothing is known of it
        let open = increments.map(|more| more.left_open(quantity, quantities).unwrap_or(scale));
        let linear = bounds.as_ref().map_or(0.0, |bounds| bounds[i].displaced);
        let error = error.map(|error| error + open.unwrap_or(0.0) + linear);
        found.push(EstimatedQuantity {
            quantity: quantity.name,
            contact: system.patches[quantity.patch].contact.name.clone(),
            value: quantity.value,
            finer: None,
            difference: None,
            order: None,
            error,
            increments: error.and(open),
            direction: error.and((linear > 0.0).then_some(linear)),
            measurement: None,
            relative: error.and_then(|error| relative(error, scale)),
            method,
        });
    }
    let unseen = |quantity: &Quantity| quantity.estimable == Estimable::Unseen;
    let doubt = |quantity: &Quantity| unseen(quantity).then_some(Doubt::Unseen);
    let doubts: Vec<_> = quantities.iter().map(doubt).collect();
    conclude(reported.summary.outcome, found, &doubts, &[])
}

/// The reference size of a quantity, by which its error is divided.
fn scale_of(quantity: &Quantity, all: &[Quantity]) -> f64 {
    let own = |name: QuantityName| {
        let same = all
            .iter()
            .filter(|q| q.patch == quantity.patch && q.name == name);
        same.map(|q| q.value).collect()
    };
    scale(quantity.name, quantity.value, own, quantity.images)
}

/// Bounds of the error of a quantity, in its unit, by cause.
#[derive(Clone, Copy)]
struct Bounds {
    /// The error due to the mesh.
    mesh: f64,
    /// The error because gaps are computed as linear in an indentation along a direction.
    displaced: f64,
}

/// A factor on the error due to an indentation along a direction: wrong gaps also make the contact grow or shrink,
/// which changes quantities by more than the first order (`tests/verification/directions.rs`).
const SECOND_ORDER: f64 = 2.0;

/// The error due to an indentation along a direction where its parts cancel, as a part of the sum of their sizes.
const UNSURE: f64 = 0.05;

/// The work for one element, for each quantity, in multiplications.
const WORK_OF_AN_ELEMENT: usize = 100;
/// The work for one place between nodes, for each quantity, in multiplications.
const WORK_OF_A_PLACE: usize = 30;

/// The bounds of the errors of all quantities. None if the linearised problem has no unique solution, or the observer
/// stops.
fn bounds(
    solved: Solved<'_>,
    mut origins: Option<&mut Origins>,
    observer: &mut dyn Observer,
) -> Option<Vec<Bounds>> {
    let Solved {
        system,
        finished,
        reported,
    } = solved;
    let quantities = &reported.along.quantities;
    let influencing: Vec<&Quantity> = quantities.iter().filter(|q| q.gradient.is_some()).collect();
    let gradients: Vec<_> = influencing
        .iter()
        .filter_map(|q| q.gradient.as_ref())
        .collect();
    let influences = influences(system, &finished.state, &gradients, observer)?;
    let motions = gradients.iter().map(|gradient| gradient.motion);
    let influences: Vec<_> = influences.into_iter().zip(motions).collect();
    let errors = weighted_errors(solved, &influences, observer)?;
    let mut duals = influences.iter().zip(errors);
    let smoothing = smoothing_of_reactions(system, finished);
    let reactions = system.reactions(&finished.state);
    let surroundings = Surroundings::new(system.model);
    let away = surroundings.away_from(touching(system, finished));
    let mut stop = || observer.stop();
    let interrupt = &mut Interrupt::new(&mut stop);
    let work = WORK_OF_AN_ELEMENT * away.len() + WORK_OF_A_PLACE * 3 * system.nodes.len();
    let mut bounds = Vec::with_capacity(quantities.len());
    for quantity in quantities {
        let mut parts = Parts::of(quantity, quantities, system.model.section.axisymmetric());
        let mut displaced = quantity.displaced;
        let mut added = Added::default();
        if let Some(gradient) = &quantity.gradient {
            let ((z, _), errors) = duals.next()?;
            interrupt.worked((z.len().pow(2) + work) as f64).ok()?;
            let mut force = system.stiffness.times(z);
            // a motion of an obstacle depends on the gaps themselves, too
            if gradient.motion.is_some() {
                let own = force.iter_mut().zip(&gradient.displacement);
                own.for_each(|(force, own)| *force -= own);
            }
            let moved = gradient.reaction.iter().zip(&smoothing);
            parts.signed = quantity.factor * errors.iter().sum::<f64>();
            parts.absolute = quantity.factor.abs() * errors.iter().map(|e| e.abs()).sum::<f64>();
            let out = surroundings.standing_out(errors.as_slice());
            let weight = quantity.factor.abs();
            for (k, e) in errors.iter().enumerate().filter(|(k, _)| away[*k]) {
                parts.away += weight * e.abs();
                parts.standing_out += weight * e.abs() * out[k];
            }
            parts.consistency = (quantity.factor * moved.map(|(a, b)| a * b).sum::<f64>()).abs();
            parts.gap = quantity.factor * gap_between_nodes(system, finished, &force);
            if !quantity.unseen_at.is_empty() {
                parts.unseen_mean = (quantity.factor * unseen_gap(system, finished, &force)).abs();
            }
            let dual = (&z[..], &force[..]);
            let active = &finished.state.active;
            let [sum, size] =
                by_displaced(system, active, &reported.along.displaced, &reactions, dual);
            displaced += quantity.factor.abs() * (SECOND_ORDER * sum.abs() + UNSURE * size);
            if origins.is_some() {
                added = by_weight(quantity, system, (&errors, &away, &out), &smoothing);
            }
        }
        let bonded = system.patches[quantity.patch].contact.condition == Condition::Bonded;
        let bound = match quantity.name {
            QuantityName::NormalForce if bonded => BONDED * parts.bound(quantity.name),
            name => parts.bound(name),
        };
        let stated = matches!(quantity.estimable, Estimable::Yes | Estimable::Unseen);
        if let Some(origins) = origins.as_deref_mut().filter(|_| stated) {
            by_spacing(quantity, quantities, &parts, &mut added);
            origins.add(
                quantity.patch,
                bound / scale_of(quantity, quantities),
                &added,
            );
        }
        bounds.push(Bounds {
            mesh: bound,
            displaced,
        });
    }
    let one_way = |(quantity, bound): (&Quantity, Bounds)| match quantity.name {
        // all friction acts the same way: its sum and its size are one quantity
        QuantityName::TangentialForce => quantities
            .iter()
            .zip(&bounds)
            .find(|(other, _)| {
                other.patch == quantity.patch
                    && other.name == QuantityName::FrictionForce
                    && quantity.value.abs() >= (1.0 - ONE_WAY) * other.value
            })
            .map_or(bound.mesh, |(_, other)| bound.mesh.min(other.mesh)),
        _ => bound.mesh,
    };
    let one_way = |(quantity, bound): (&Quantity, Bounds)| Bounds {
        mesh: one_way((quantity, bound)),
        ..bound
    };
    let of_quantities = quantities.iter().zip(bounds.iter().copied());
    Some(of_quantities.map(one_way).collect())
}

/// ∫ (σ* − σ_h) : C⁻¹ (σ_z* − σ_z,h) over each element, by dual solution and element. None if the observer stops.
/// `influences`: the dual solutions, each with the number of the unknown motion of an obstacle whose influence it is.
fn weighted_errors(
    solved: Solved<'_>,
    influences: &[(Vec<f64>, Option<usize>)],
    observer: &mut dyn Observer,
) -> Option<Vec<Vec<f64>>> {
    /// The number of dual solutions that are treated together: eight numbers fill a cache line, but many problems have
    /// few.
    const MANY: usize = 8;
    const FEW: usize = 4;
    let threads = solved.system.body.threads(observer);
    let mut stop = || observer.stop();
    let interrupt = &mut Interrupt::new(&mut stop);
    let mut errors = Vec::with_capacity(influences.len());
    for some in influences.chunks(MANY) {
        let of_some = match some.len() {
            ..=FEW => weighted_errors_of::<FEW>(solved, some, threads, interrupt),
            _ => weighted_errors_of::<MANY>(solved, some, threads, interrupt),
        };
        errors.extend(of_some.ok()?);
    }
    Some(errors)
}

/// Like [`weighted_errors`], for at most `DUALS` dual solutions.
fn weighted_errors_of<const DUALS: usize>(
    solved: Solved<'_>,
    influences: &[(Vec<f64>, Option<usize>)],
    threads: usize,
    interrupt: &mut Interrupt<'_>,
) -> Result<Vec<Vec<f64>>, Stopped> {
    interrupt.ask()?;
    let of_body = |(z, motion): &(Vec<f64>, Option<usize>)| solved.system.dual_of_body(z, *motion);
    let influences: Vec<Vec<f64>> = influences.iter().map(of_body).collect();
    let body = solved.system.body;
    let duals = body.displacements_without_loads::<DUALS>(&influences, threads);
    let elements = body.elements(solved.system.model);
    let difference = &solved.reported.difference;
    let products = difference.products(elements, &duals, threads, interrupt)?;
    Ok(products.into_iter().take(influences.len()).collect())
}

/// The error of a quantity with a gradient by element and edge: weighted errors of elements, and on edges the effect of
/// moving the pressure to the nodes.
fn by_weight(
    quantity: &Quantity,
    system: &System<'_>,
    (errors, away, out): (&[f64], &[bool], &[f64]),
    smoothing: &[f64],
) -> Added {
    let [signed, absolute, of_away, consistency, ..] = factors(quantity.name);
    let weight = quantity.factor.abs();
    let factor = |k: usize| {
        if away[k] {
            signed + absolute + of_away + STANDING_OUT * out[k]
        } else {
            signed + absolute
        }
    };
    let elements = errors.iter().enumerate();
    let elements = elements.map(|(k, e)| factor(k) * weight * e.abs());
    let mut added = Added {
        elements: elements.collect(),
        edges: Vec::new(),
    };
    let patch = &system.patches[quantity.patch];
    let reaction = quantity.gradient.as_ref().map(|g| &g.reaction);
    for edge in 0..patch.contact.boundary.edge_count() {
        let at = |i: usize| {
            let node = patch.first + i;
            reaction.map_or(0.0, |reaction| (reaction[node] * smoothing[node]).abs())
        };
        let moved: f64 = edge_nodes(edge).map(at).iter().sum();
        added.edges.push((edge, consistency * weight * moved));
    }
    added
}

/// Adds the parts of the error that the distances between nodes and between friction points cause, by edge.
fn by_spacing(quantity: &Quantity, all: &[Quantity], parts: &Parts, added: &mut Added) {
    let [_, _, _, _, gap, ends, spacing, between, _] = factors(quantity.name);
    let at_ends: Vec<(usize, f64)> = all
        .iter()
        .filter(|q| is_end(q, quantity.patch))
        .flat_map(|q| q.spacing_at.iter().map(|(edge, _)| (*edge, q.spacing)))
        .collect();
    let of_ends = gap * parts.gap.abs() + ends * parts.ends + parts.ends_of_revolution;
    added.spread(of_ends, &at_ends);
    added.spread(spacing * parts.spacing, &quantity.spacing_at);
    added.spread(
        between * parts.between + parts.unresolved,
        &quantity.between_at,
    );
    added.spread(parts.unseen + parts.unseen_mean, &quantity.unseen_at);
    // as far as it exceeds the other parts
    let without = Parts {
        sharp_end: 0.0,
        ..*parts
    };
    let more = parts.bound(quantity.name) - without.bound(quantity.name);
    added.spread(more, &quantity.sharp_end_at);
}

/// The nodes of the mesh that are in contact.
fn touching(system: &System<'_>, finished: &Finished) -> impl Iterator<Item = u32> {
    let active = &finished.state.active;
    let patches = system.patches.iter();
    patches.flat_map(move |patch| {
        let nodes = patch.contact.boundary.nodes.iter();
        let nodes = nodes.zip(&active[patch.first..]);
        nodes.filter(|(_, active)| **active).map(|(node, _)| *node)
    })
}

/// Whether a quantity is the start or end of an interval of contact, in the contact `patch`.
fn is_end(quantity: &Quantity, patch: usize) -> bool {
    use QuantityName::{ContactEnd, ContactStart};
    matches!(quantity.name, ContactStart | ContactEnd) && quantity.patch == patch
}

/// The largest distance between nodes at the ends of contact, divided by the length of the contact.
fn end_spacing(quantity: &Quantity, all: &[Quantity]) -> f64 {
    let ends = all.iter().filter(|q| is_end(q, quantity.patch));
    let ends: Vec<&Quantity> = ends.collect();
    let values = |name: QuantityName| {
        let ends = ends.iter().filter(move |q| q.name == name);
        ends.map(|q| q.value)
    };
    let length = quantity.images
        * length(
            values(QuantityName::ContactStart),
            values(QuantityName::ContactEnd),
        );
    let spacing = ends.iter().fold(0.0f64, |most, q| most.max(q.spacing));
    // a contact of one node is not resolved at all
    if length > 0.0 {
        (spacing / length).min(1.0)
    } else {
        1.0
    }
}

/// The change of every nodal reaction R_i if the pressure p between the nodes is moved to the nodes: ∫ h_i p − R_i.
fn smoothing_of_reactions(system: &System<'_>, finished: &Finished) -> Vec<f64> {
    let reactions = system.reactions(&finished.state);
    let pressures = system.pressures(&reactions);
    let mut change = vec![0.0; reactions.len()];
    for patch in &system.patches {
        let places = &patch.contact.boundary.friction_points;
        for (k, place) in places.iter().enumerate() {
            let nodes = edge_nodes(k / 3).map(|i| patch.first + i);
            let pressure: f64 = (0..3).map(|i| place.shape[i] * pressures[nodes[i]]).sum();
            for (node, shape) in nodes.into_iter().zip(place.shape) {
                let force = place.weight * shape * pressure;
                change[node] += force;
                if let Some(end) = system.nodes[node].beside_axis {
                    change[end] += AXIS_SHARE * force;
                }
            }
        }
    }
    change.iter_mut().zip(&reactions).for_each(|(c, r)| *c -= r);
    change
}

/// The pressure p_z of a dual solution at the contact nodes. `force`: Ŝ z.
fn dual_pressures(system: &System<'_>, finished: &Finished, force: &[f64]) -> Vec<f64> {
    let reaction = |node: usize| match system.nodes[node].normal {
        Dof::Free(dof) if finished.state.active[node] => force[dof],
        _ => 0.0,
    };
    let reactions: Vec<f64> = (0..system.nodes.len()).map(reaction).collect();
    system.pressures(&reactions)
}

/// The change of a quantity by displaced obstacles: by other gaps at the nodes in contact, and by reactions that are
/// turned. The second value is the sum of the sizes of these parts. `z`, `force`: the dual solution z, and Ŝ z.
fn by_displaced(
    system: &System<'_>,
    active: &[bool],
    displaced: &[DisplacedNode],
    reactions: &[f64],
    (z, force): (&[f64], &[f64]),
) -> [f64; 2] {
    let mut found = [0.0; 2];
    for (i, node) in system.nodes.iter().enumerate().filter(|(i, _)| active[*i]) {
        let by_gap = match node.normal {
            Dof::Free(dof) => -force[dof] * displaced[i].gap,
            Dof::Fixed(_) => 0.0,
        };
        let by_turn = match node.tangent {
            Dof::Free(dof) => z[dof] * reactions[i] * displaced[i].turn,
            Dof::Fixed(_) => 0.0,
        };
        found[0] += by_gap + by_turn;
        found[1] += by_gap.abs() + by_turn.abs();
    }
    found
}

/// ∫ p_z (gap − parabola through the gaps at the nodes) over edges whose nodes are all in contact, by the trapezoidal
/// rule between the places at which the obstacle is given. p_z: the pressure of the dual solution z. `force`: Ŝ z.
fn unseen_gap(system: &System<'_>, finished: &Finished, force: &[f64]) -> f64 {
    let pressures = dual_pressures(system, finished, force);
    let mut sum = 0.0;
    for patch in &system.patches {
        let contact = patch.contact;
        let friction_points = &contact.boundary.friction_points;
        for places in contact.places.chunk_by(|a, b| a.edge == b.edge) {
            let edge = places[0].edge;
            let nodes = edge_nodes(edge).map(|i| patch.first + i);
            if !nodes.iter().all(|n| finished.state.active[*n]) {
                continue;
            }
            let weights = friction_points[3 * edge..3 * edge + 3].iter();
            let half: f64 = 0.5 * weights.map(|point| point.weight).sum::<f64>();
            let at_nodes = [-1.0, 0.0, 1.0].map(|xi| (xi, 0.0));
            let mut values: Vec<(f64, f64)> = at_nodes.to_vec();
            values.extend(places.iter().map(|place| {
                let pressure = nodes.map(|n| pressures[n]);
                let pressure = edge3::interpolate(&edge3::shape(place.xi), &pressure);
                (place.xi, -place.nearer * pressure)
            }));
            values.sort_by(|a, b| a.0.total_cmp(&b.0));
            let trapezoid =
                |pair: &[(f64, f64)]| 0.5 * (pair[1].0 - pair[0].0) * (pair[0].1 + pair[1].1);
            sum += half * values.windows(2).map(trapezoid).sum::<f64>();
        }
    }
    sum
}

/// ∫ p_z (gap − u_n) over edges with a node in contact. p_z: the pressure of the dual solution z. `force`: Ŝ z.
fn gap_between_nodes(system: &System<'_>, finished: &Finished, force: &[f64]) -> f64 {
    let state = &finished.state;
    let pressures = dual_pressures(system, finished, force);
    let opening = |node: usize| system.opening(&state.v, node);
    let mut sum = 0.0;
    for patch in &system.patches {
        let places = &patch.contact.boundary.friction_points;
        for (k, place) in places.iter().enumerate() {
            let nodes = edge_nodes(k / 3).map(|i| patch.first + i);
            if !nodes.iter().any(|n| state.active[*n]) {
                continue;
            }
            let pressure: f64 = (0..3).map(|i| place.shape[i] * pressures[nodes[i]]).sum();
            let gap: f64 = (0..3).map(|i| place.shape[i] * opening(nodes[i])).sum();
            sum += place.weight * pressure * gap;
        }
    }
    sum
}
