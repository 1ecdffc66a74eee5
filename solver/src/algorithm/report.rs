//! From a final state to a [`Solution`]: forces, extents, profiles, fields and warnings.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;

use crate::algorithm::finished::Finished;
use crate::algorithm::large_slip::large_slip;
use crate::algorithm::profile::{DisplacedNode, Forces, Missed, PatchView, Quantity};
use crate::algorithm::small_strain::large_strain;
use crate::algorithm::system::{Patch, System};
use crate::algorithm::unheld;
use crate::elasticity::{Dof, Recovered, StressDifference, recover};
use crate::error::SolveError;
use crate::linear::{Interrupt, Stopped};
use crate::model::{Hold, Model};
use crate::observer::Observer;
use crate::solution::{
    ContactProfile, ContactSummary, Fields, GaussFields, NodeState, Outcome, Phase, Residuals,
    Summary, Warning, WarningCode, at_all_points,
};

/// The largest relative imbalance of forces without a warning: with a larger imbalance, they have lost half of their
/// digits.
const OUT_OF_BALANCE: f64 = 1e-7;

/// The largest relative imbalance without a warning if a material is nearly incompressible: its bulk modulus multiplies
/// the rounding of displacements, and long thin elements do so again. Forces are still known to six digits.
const OUT_OF_BALANCE_INCOMPRESSIBLE: f64 = 1e-6;

/// The smallest forces that count as more than rounding, as a part of modulus × displacement × depth, and as a part of
/// the problem's own force, which a body that is at rest again may have borne.
const FORCE_FLOOR: f64 = 1e-6;

/// The number of calls that the observer may answer with "stop" before the results of a state are given up. A stopped
/// solution has its last state if computing the results is little work, else none.
const PATIENCE: u32 = 6;

/// The contraction q above which sweeps barely converge.
const SLOW_CONTRACTION: f64 = 0.9;

/// The results of a final state.
pub struct Reported {
    /// The summary: scalars, extents and warnings.
    pub summary: Summary,
    /// The results along the contacts.
    pub along: AlongContacts,
    /// The displacements and stresses of the body.
    pub fields: Fields,
    /// The difference between recovered stresses and the stresses of the elements.
    pub difference: StressDifference,
}

/// The results along the contacts.
#[derive(Default)]
pub struct AlongContacts {
    /// By contact boundary: the columns along it, at all points.
    pub profiles: BTreeMap<String, ContactProfile>,
    /// By contact boundary: the columns at the nodes.
    pub node_profiles: BTreeMap<String, ContactProfile>,
    /// By contact boundary: the columns at the points where friction acts.
    pub friction_profiles: BTreeMap<String, ContactProfile>,
    /// The quantities for which an error is stated.
    pub quantities: Vec<Quantity>,
    /// Places of all contacts where a mesh needs nodes: the obstacle reaches into the body between the nodes, or
    /// recedes there.
    pub missed: Vec<Missed>,
    /// By contact node: the displaced obstacle compared with the linear one, for obstacles that are pushed along a
    /// direction.
    pub displaced: Vec<DisplacedNode>,
    summaries: BTreeMap<String, ContactSummary>,
    /// The contact states of the nodes, [`Fields::contact_state`].
    states: Vec<i8>,
}

/// The results of a final state that need no displacements inside the body: the numbers of each contact, and warnings.
pub fn numbers(
    system: &System<'_>,
    finished: &Finished,
    observer: &mut dyn Observer,
) -> Result<(BTreeMap<String, ContactSummary>, Vec<Warning>), SolveError> {
    unheld::held(system, finished)?;
    let mut stop = || observer.stop();
    let state = FinalState::new(system, finished, &mut stop);
    let mut warnings = system.model.warnings.clone();
    let mut contacts = BTreeMap::new();
    state.view(|patch, view| {
        view.warn(&mut warnings);
        contacts.insert(patch.contact.name.clone(), view.summary());
    })?;
    state.warn(&mut warnings);
    Ok((contacts, warnings))
}

/// The quantities with stated errors (forces, peaks and extents) in a final state, computed without the displacements
/// inside the body. Empty if the observer stops.
pub fn quantities(
    system: &System<'_>,
    finished: &Finished,
    observer: &mut dyn Observer,
) -> Vec<Quantity> {
    let mut stop = || observer.stop();
    let state = FinalState::new(system, finished, &mut stop);
    let mut found = Vec::new();
    match state.view(|_, view| found.extend(view.quantities())) {
        Ok(()) => found,
        Err(Stopped) => Vec::new(),
    }
}

/// One observer that is shared by many functions which read a state. These functions are not interrupted; after a stop
/// their results are discarded.
struct Questions<'a> {
    interrupt: RefCell<Interrupt<'a>>,
    stopped: Cell<bool>,
}

impl<'a> Questions<'a> {
    fn new(stop: &'a mut dyn FnMut() -> bool) -> Self {
        Questions {
            interrupt: RefCell::new(Interrupt::new(stop)),
            stopped: Cell::new(false),
        }
    }

    /// Like [`Interrupt::worked`]; after the first stop, every call returns a stop.
    fn worked(&self, work: f64) -> Result<(), Stopped> {
        if self.stopped.get() || self.interrupt.borrow_mut().worked(work).is_err() {
            self.stopped.set(true);
            return Err(Stopped);
        }
        Ok(())
    }
}

/// A final state with its nodal forces.
struct FinalState<'a> {
    system: &'a System<'a>,
    finished: &'a Finished,
    forces: Forces,
    questions: Questions<'a>,
}

impl<'a> FinalState<'a> {
    fn new(
        system: &'a System<'a>,
        finished: &'a Finished,
        stop: &'a mut dyn FnMut() -> bool,
    ) -> Self {
        FinalState {
            system,
            finished,
            forces: Forces::new(system, finished),
            questions: Questions::new(stop),
        }
    }

    /// Calls a function for each contact, unless the observer stops.
    fn view(&self, mut read: impl FnMut(&Patch<'_>, &PatchView<'_>)) -> Result<(), Stopped> {
        /// The work for each node and friction point of all contacts, without averages, in multiplications.
        const WORK: usize = 100;
        let system = self.system;
        let work = (WORK * (system.nodes.len() + system.points.len())) as f64;
        let go_on = &|work: f64| self.questions.worked(work).is_ok();
        for (p, patch) in system.patches.iter().enumerate() {
            self.questions.worked(work)?;
            let view = PatchView::new(system, p, self.finished, &self.forces, go_on);
            read(patch, &view);
        }
        self.questions.worked(0.0)
    }

    /// Warns of how the iterations ended and of a body that slides too far; returns whether it does.
    fn warn(&self, warnings: &mut Vec<Warning>) -> bool {
        let (system, finished) = (self.system, self.finished);
        warn_of_iteration(finished, warnings);
        warn_of_rounding(system.model, finished, warnings);
        // how far a body that slides away has come means nothing
        if finished.slide.is_some() {
            return false;
        }
        let large = large_slip(system, &finished.state.v, &self.forces.reactions);
        let slides = large.is_some();
        warnings.extend(large);
        slides
    }
}

impl AlongContacts {
    fn new(state: &FinalState<'_>, warnings: &mut Vec<Warning>) -> Result<Self, Stopped> {
        let mut along = AlongContacts {
            states: vec![-1; state.system.model.mesh.nodes.len()],
            ..AlongContacts::default()
        };
        state.view(|patch, view| along.add(patch, view, warnings))?;
        Ok(along)
    }

    fn add(&mut self, patch: &Patch<'_>, view: &PatchView<'_>, warnings: &mut Vec<Warning>) {
        view.warn(warnings);
        self.quantities.extend(view.quantities());
        self.missed.extend_from_slice(view.missed());
        self.displaced
            .extend_from_slice(&view.displaced_gaps().nodes);
        let profile = view.profile();
        for (&node, state) in patch.contact.boundary.nodes.iter().zip(&profile.state) {
            let seen: &mut i8 = &mut self.states[node as usize];
            *seen = (*seen).max(match state {
                NodeState::Open => 0,
                NodeState::Stick => 1,
                NodeState::Slip => 2,
            });
        }
        let (name, friction) = (&patch.contact.name, view.friction_profile(&profile));
        let peaks = view.peak_profile(&profile);
        let at_all = at_all_points(&profile, &friction, &peaks);
        if let Some((facing, columns)) = view.facing_profile(&profile) {
            // of a boundary that carries the law of another contact, the profile is its own; of one that two contacts face, the
            // first is kept
            let carries = view.carries_law(facing);
            let all = [
                &mut self.profiles,
                &mut self.node_profiles,
                &mut self.friction_profiles,
            ];
            for profiles in all
                .into_iter()
                .filter(|_| !carries && !columns.s.is_empty())
            {
                let known = profiles.entry(facing.to_owned());
                known.or_insert_with(|| columns.clone());
            }
        }
        self.profiles.insert(name.clone(), at_all);
        self.node_profiles.insert(name.clone(), profile);
        self.friction_profiles.insert(name.clone(), friction);
        self.summaries.insert(name.clone(), view.summary());
    }
}

/// The results of a final state: forces, extents, profiles, fields and warnings. [`SolveError::Stopped`] if the
/// observer stops, and still does at several more calls.
pub fn report(
    system: &System<'_>,
    finished: &Finished,
    observer: &mut dyn Observer,
) -> Result<Reported, SolveError> {
    let mut refusals = 0;
    let mut stop = || {
        refusals += u32::from(observer.stop());
        refusals > PATIENCE
    };
    if system.semidefinite && finished.outcome != Outcome::Canceled {
        held(system, finished)?;
    }
    unheld::held(system, finished)?;
    let state = FinalState::new(system, finished, &mut stop);
    let (inside, difference) = Inside::new(&state)?;
    let mut warnings = system.model.warnings.clone();
    let mut along = AlongContacts::new(&state, &mut warnings)?;
    let slides = state.warn(&mut warnings);
    if finished.slide.is_none() {
        warnings.extend(large_strain(
            system,
            &finished.state.active,
            &inside.recovered,
            &inside.displacements,
            slides,
        ));
    }
    let summary = inside.summary(&state, std::mem::take(&mut along.summaries), warnings);
    if !inside.is_finite(&summary) {
        return Err(SolveError::NonFinite {
            phase: Phase::Recover,
        });
    }
    let fields = inside.fields(system.model, std::mem::take(&mut along.states));
    Ok(Reported {
        summary,
        along,
        fields,
        difference,
    })
}

/// Checks that the contacts of the final state, with their friction, prevent all motions that the supports do not
/// prevent.
fn held(system: &System<'_>, finished: &Finished) -> Result<(), SolveError> {
    let mut hindered = Vec::new();
    for patch in &system.patches {
        for (i, node) in system.range(patch).enumerate() {
            let state = &system.nodes[node];
            if finished.state.active[node] {
                hindered.push(Hold::along_normal(patch.contact, i));
            }
            if state.held_tangent.is_some() {
                hindered.push(Hold::along_tangent(patch.contact, i));
            }
        }
    }
    let points = system.points.iter().zip(&finished.bound);
    for (point, _) in points.filter(|(_, tau)| **tau > 0.0) {
        let patch = &system.patches[point.patch];
        let moved = point.nodes.into_iter().zip(point.shape);
        for (node, _) in moved.filter(|(_, shape)| *shape != 0.0) {
            hindered.push(Hold::along_tangent(patch.contact, node - patch.first));
        }
    }
    match system.model.free_motion(&hindered) {
        None => Ok(()),
        Some((motion, node)) => Err(SolveError::Unheld { motion, node }),
    }
}

/// The force on every contact unknown: along n the obstacle's reaction −R; along t friction, and the reaction of bonded
/// nodes.
fn contact_force(system: &System<'_>, finished: &Finished, forces: &Forces) -> Vec<f64> {
    let mut friction = vec![0.0; finished.state.v.len()];
    system.add_traction_force(&finished.tractions, &mut friction);
    let mut force: Vec<f64> = friction.iter().map(|f| -f).collect();
    for (i, node) in system.nodes.iter().enumerate() {
        if let Dof::Free(dof) = node.normal {
            force[dof] -= forces.reactions[i];
        }
        if let Dof::Free(dof) = node.tangent {
            force[dof] += forces.tangential_reactions[i];
        }
    }
    force
}

/// The largest imbalance of an obstacle under loads: what its load, its spring and the body leave of a force or moment, as a part of
/// the forces on it, times the length of the contact for a moment.
fn imbalance_of_obstacles(
    state: &FinalState<'_>,
    contacts: &BTreeMap<String, ContactSummary>,
) -> f64 {
    let system = state.system;
    let Some(opposite) = &system.opposite else {
        return 0.0;
    };
    let q = system.free_motions(&state.finished.state.v);
    let mut most = 0.0f64;
    for (free, q) in opposite.motions.iter().zip(q) {
        let contact = system.patches[free.patch].contact;
        let (Some(tool), Some(found)) = (&contact.tool, contacts.get(&contact.name)) else {
            continue;
        };
        let force = found.force.unwrap_or_default();
        let [normal, tangential] = tool.components(force);
        let on_body = [normal, tangential, found.moment.unwrap_or_default()][free.motion];
        let load = opposite.load(system.model, &system.level, free);
        let spring = opposite.spring(system.model, free) * q;
        let left = system.circumference * (load - spring) - on_body;
        let arm = if free.motion == 2 {
            contact.boundary.length()
        } else {
            1.0
        };
        // of a load that a spring bears alone rounding is left, too
        let given = system.circumference * load.abs().max(spring.abs());
        let size = (arm * force[0].hypot(force[1]))
            .max(on_body.abs())
            .max(given);
        let floor = FORCE_FLOOR * arm * system.circumference * system.reference_force;
        if left != 0.0 {
            most = most.max(left.abs() / size.max(floor));
        }
    }
    most
}

/// The energy of friction, ∫τψ of thesis (1.21), without 2π.
fn friction_energy(system: &System<'_>, finished: &Finished) -> f64 {
    let points = system.points.iter().zip(&finished.bound);
    let energy = points.map(|(point, tau)| {
        let slip = system.slip(&finished.state.v, point);
        point.weight * tau * system.law(point).psi(slip)
    });
    energy.sum()
}

/// The displacements and stresses inside the body.
struct Inside {
    displacements: Vec<[f64; 2]>,
    recovered: Recovered,
    /// The error of every element, without 2π (energy norm).
    errors: Vec<f64>,
}

impl Inside {
    fn new(state: &FinalState<'_>) -> Result<(Self, StressDifference), SolveError> {
        let (system, v) = (state.system, &state.finished.state.v);
        let (model, body) = (system.model, system.body);
        let moved = system.displaced(v);
        let displacements = body.displacements_on(system.threads, &moved, &system.level);
        let elements = body.elements(model);
        let inner = model.inner(&system.level);
        let interrupt = &mut *state.questions.interrupt.borrow_mut();
        let threads = system.threads;
        let recovered = recover(elements, &displacements, &inner, threads, interrupt)?;
        let (difference, errors) = StressDifference::new(elements, &recovered, threads, interrupt)?;
        let inside = Inside {
            displacements,
            recovered,
            errors,
        };
        Ok((inside, difference))
    }

    /// The summary of a state. A warning is added if the forces do not balance.
    fn summary(
        &self,
        state: &FinalState<'_>,
        contacts: BTreeMap<String, ContactSummary>,
        mut warnings: Vec<Warning>,
    ) -> Summary {
        let (system, finished) = (state.system, state.finished);
        let (circumference, recovered) = (system.circumference, &self.recovered);
        let equilibrium = self
            .equilibrium(state)
            .max(imbalance_of_obstacles(state, &contacts));
        let (most, other_causes) = if system.model.section.has_split() {
            (
                OUT_OF_BALANCE_INCOMPRESSIBLE,
                ", and Poisson's ratios closer to 0.5 than 0.49999",
            )
        } else {
            (OUT_OF_BALANCE, "")
        };
        let outcome = match finished.outcome {
            Outcome::Converged if equilibrium > most => Outcome::FalseConvergence,
            outcome => outcome,
        };
        // the state of a cycle is no equilibrium, whatever the stiffness
        let cycling = finished.outcome == Outcome::ContactCycling;
        if equilibrium > most && finished.slide.is_none() && !cycling {
            warnings.push(Warning {
                code: WarningCode::OutOfBalance,
                pointer: String::new(),
                message: format!(
                    "The forces on the body do not balance: {equilibrium:.1e} of their sum remains. The stiffness is nearly singular: check supports, hinges and badly shaped elements{other_causes}."
                ),
            });
        }
        let total =
            |f: fn(&ContactSummary) -> f64| contacts.values().map(f).fold(0.0, |sum, x| sum + x);
        let springs = system.model.springs.energy(&self.displacements);
        let of_tools = system.energy_of_obstacles(&finished.state.v);
        let energy = recovered.strain_energy + springs - self.work_of_loads(system)
            + friction_energy(system, finished)
            + of_tools;
        Summary {
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
            energy: circumference * energy,
            friction_work: circumference * system.work(&finished.state.v, &finished.bound),
            accuracy: None,
            strain_energy: Some(circumference * recovered.strain_energy),
            increments: 1,
            cut_backs: 0,
            uniqueness: None,
            doubled_increments: None,
            refinements: Vec::new(),
            warnings,
            dofs: system.body.map.unknowns as u64,
            contact_dofs: system.load.len() as u64,
        }
    }

    /// Whether all results are finite numbers.
    fn is_finite(&self, summary: &Summary) -> bool {
        let numbers = [
            summary.normal_force,
            summary.tangential_force,
            summary.energy,
            summary.residuals.equilibrium,
        ];
        let displacements = self.displacements.iter().flatten();
        let stresses = self.recovered.stress.iter().flatten();
        let mut all = numbers.iter().chain(displacements).chain(stresses);
        all.all(|x| x.is_finite())
    }

    /// The work of the loads, without 2π.
    fn work_of_loads(&self, system: &System<'_>) -> f64 {
        let forces = system.body.nodal_loads.iter().zip(&self.displacements);
        let work: f64 = forces.map(|(f, u)| f[0] * u[0] + f[1] * u[1]).sum();
        work * system.level.loads + self.recovered.work_on_bubbles
    }

    /// The imbalance |Σ forces| / Σ|forces| of loads, contact, friction and the supports' reactions, which are computed
    /// from the stresses in the body. In axisymmetry only the axial sum is a balance. Forces below [`FORCE_FLOOR`] are
    /// rounding of larger forces.
    fn equilibrium(&self, state: &FinalState<'_>) -> f64 {
        let system = state.system;
        let (model, body, loads) = (system.model, system.body, system.level.loads);
        let contact_force = contact_force(system, state.finished, &state.forces);
        let contact_force = match &system.opposite {
            None => contact_force,
            Some(opposite) => opposite.with_reactions(&contact_force),
        };
        let contact_force = body.nodal_forces(&contact_force);
        let by_motion = system.force_by_motion(&state.finished.state.v);
        let floor = FORCE_FLOOR * system.reference_force.max(by_motion);
        let first = usize::from(model.section.axisymmetric());
        let (mut sum, mut size) = ([0.0; 2], 0.0);
        let interior = body.map.unknowns - contact_force.len();
        let mut of_springs = vec![
            [0.0; 2];
            if model.springs.is_empty() {
                0
            } else {
                body.map.dofs.len()
            }
        ];
        for (node, [x, y]) in model.springs.forces(&self.displacements) {
            let sum = &mut of_springs[node as usize];
            *sum = [sum[0] + x, sum[1] + y];
        }
        for (node, dofs) in body.map.dofs.iter().enumerate() {
            let load = body
                .map
                .to_axes(node, body.nodal_loads[node].map(|f| loads * f));
            let pull = of_springs
                .get(node)
                .map_or([0.0; 2], |pull| body.map.to_axes(node, *pull));
            let internal = body.map.to_axes(node, self.recovered.internal_force[node]);
            let external: [f64; 2] = std::array::from_fn(|a| match dofs[a] {
                Dof::Free(i) if i >= interior => load[a] + pull[a] + contact_force[i - interior],
                Dof::Free(_) => load[a] + pull[a],
                Dof::Fixed(_) => internal[a], // the reaction of the support, load and springs included
            });
            let [fx, fy] = match body.map.axes[node] {
                None => external,
                Some(axes) => {
                    let [n, t] = axes.along;
                    [
                        n[0] * external[0] + t[0] * external[1],
                        n[1] * external[0] + t[1] * external[1],
                    ]
                }
            };
            for (a, f) in [fx, fy].into_iter().enumerate().skip(first) {
                sum[a] += f;
                size += f.abs();
            }
        }
        // a body in rigid motion has only rounding errors as forces: they must not count as an imbalance
        let moved = self
            .displacements
            .iter()
            .flatten()
            .fold(0.0f64, |most, u| most.max(u.abs()));
        let depth = model
            .mesh
            .nodes
            .iter()
            .map(|x| model.section.depth(x[0]))
            .fold(0.0, f64::max);
        let of_rigid_motion = FORCE_FLOOR * model.section.modulus() * moved * depth;
        let sum = sum[0].hypot(sum[1]);
        if sum == 0.0 {
            0.0
        } else {
            sum / size.max(floor).max(of_rigid_motion)
        }
    }

    fn fields(self, model: &Model, contact_state: Vec<i8>) -> Fields {
        let mesh = &model.mesh;
        let circumference = model.section.circumference().sqrt();
        let stresses = &self.recovered.stress;
        let stress = |component: usize| stresses.iter().map(|s| s[component]).collect();
        let [x, y] = self.recovered.points;
        let [stress_xx, stress_yy, stress_xy, stress_zz] = self.recovered.point_stress;
        Fields {
            x: mesh.nodes.iter().map(|x| x[0]).collect(),
            y: mesh.nodes.iter().map(|x| x[1]).collect(),
            ux: self.displacements.iter().map(|u| u[0]).collect(),
            uy: self.displacements.iter().map(|u| u[1]).collect(),
            stress_xx: stress(0),
            stress_yy: stress(1),
            stress_xy: stress(2),
            stress_zz: stress(3),
            contact_state,
            elements: mesh.elements.clone(),
            element_error: self.errors.iter().map(|e| circumference * e).collect(),
            gauss: GaussFields {
                order: model.quadrature,
                x,
                y,
                stress_xx,
                stress_yy,
                stress_xy,
                stress_zz,
            },
        }
    }
}

fn warn_of_iteration(finished: &Finished, warnings: &mut Vec<Warning>) {
    let mut warn = |code: WarningCode, message: String| {
        warnings.push(Warning {
            code,
            pointer: "/solver".to_owned(),
            message,
        });
    };
    if let Some(slide) = &finished.slide {
        warn(WarningCode::SlidesAway, slide.message());
        return;
    }
    if let Some(q) = finished.contraction.filter(|q| *q > SLOW_CONTRACTION) {
        warn(
            WarningCode::SlowContraction,
            format!(
                "The friction bound contracts by only q = {q:.3} per sweep: friction and pressure amplify each other, and the solution may not be unique."
            ),
        );
    }
    let by_rounding = finished
        .rounding
        .is_some_and(|rounding| !rounding.negligible());
    if finished.outcome == Outcome::NotConverged && !by_rounding {
        let r = finished.residuals;
        warn(
            WarningCode::NotConverged,
            format!(
                "After {} iterations the residuals are kkt {:.1e}, friction {:.1e}, monolithic {:.1e}. Raise max_iterations if they still decrease in the history; else raise elastic_slip or tolerance, or refine the mesh.",
                finished.history.len(),
                r.kkt,
                r.friction,
                r.monolithic
            ),
        );
    }
    if finished.own_tractions && finished.outcome == Outcome::FalseConvergence {
        warn(
            WarningCode::FalseConvergence,
            format!(
                "The thesis's iteration meets its own criterion, R_F, but does not solve the problem: the true residual is {:.1e}. Choose \"algorithm\": \"auto\".",
                finished.residuals.monolithic
            ),
        );
    }
    if let Some(cycle) = &finished.cycle {
        warn(
            WarningCode::ContactCycling,
            format!(
                "Contact and slip repeat every {} iterations; contact nodes {:?} keep changing state. Refine the mesh there, or raise elastic_slip.",
                cycle.period, cycle.nodes
            ),
        );
    }
}

/// A number to two digits, rounded up, so that a number above a limit is also shown as above it.
fn rounded_up(value: f64) -> String {
    let nearest = format!("{value:.1e}");
    match nearest.parse::<f64>() {
        Ok(shown) if shown < value => format!("{:.1e}", 1.05 * value),
        _ => nearest,
    }
}

/// Warns if rounding keeps residuals above the tolerance, and says what would lower them.
fn warn_of_rounding(model: &Model, finished: &Finished, warnings: &mut Vec<Warning>) {
    let Some(rounding) = finished.rounding else {
        return;
    };
    let (floor, tolerance) = (rounding.floor, model.controls.tolerance);
    let slip = rounding.slip.and_then(|slip| {
        let contact = &model.contacts[slip.patch];
        Some((slip.displacement, contact, contact.friction.as_ref()?))
    });
    let mut message = format!(
        "A residual of {} remains, above the tolerance of {tolerance:.1e}. It is due to rounding, which may leave up to {floor:.1e} here: ",
        rounded_up(rounding.residual)
    );
    let pointer = match slip {
        Some((displacement, contact, friction)) => {
            let slip = friction.elastic_slip;
            message += &format!(
                "slip is the difference of displacements of {displacement:.1e}, {:.1e} times the `elastic_slip` of {slip:.1e}.",
                displacement / slip
            );
            if !rounding.negligible() {
                message += " Rounding may decide what sticks and what slips, so this does not count as converged.";
            }
            message += &format!(
                " Raise elastic_slip to {:.1e} for this tolerance (less may be enough), or move the obstacle less far.",
                slip * floor / tolerance
            );
            format!("{}/friction/elastic_slip", contact.pointer)
        }
        None => {
            message += "the displacements are large compared with those that strain the body. Prescribe supports and obstacles relative to one another, or raise the tolerance.";
            "/solver/tolerance".to_owned()
        }
    };
    warnings.push(Warning {
        code: WarningCode::RoundingLimitsResidual,
        pointer,
        message,
    });
}

#[cfg(test)]
mod tests {
    use super::rounded_up;

    #[test]
    fn a_number_above_a_limit_is_shown_above_it() {
        for (value, shown) in [
            (1.002e-10, "1.1e-10"),
            (1e-10, "1.0e-10"),
            (9.94e-10, "1.0e-9"),
            (2.96e-7, "3.0e-7"),
        ] {
            assert_eq!(rounded_up(value), shown);
        }
    }
}
