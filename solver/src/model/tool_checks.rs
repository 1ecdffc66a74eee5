//! Checks of obstacles that move as rigid bodies: their loads, motions and springs, and what these require of a contact.

use std::collections::BTreeMap;

use super::checks::{ALIGNED, Checks};
use super::contact_model::ContactModel;
use super::level::Level;
use super::supports::Held;
use super::tool::Tool;
use crate::contact::ContactBoundary;
use crate::error::{AllChecks, Checked, Reason, rounded};
use crate::friction::BoundLaw;
use crate::problem::{Analysis, Condition, Contact, Normalization, Step};

/// The fields of the motions of an obstacle, with the fields of the loads along them.
const FIELDS: [[&str; 2]; 3] = [
    ["indentation", "normal_force"],
    ["tangential_displacement", "tangential_force"],
    ["tilt", "moment"],
];

impl Checks {
    /// Checks the loads, motions and springs of an obstacle, each by itself and together.
    pub(super) fn obstacle_loads(
        &mut self,
        analysis: &Analysis,
        contact: &Contact,
        steps: &[Step],
        pointer: &str,
    ) -> Checked {
        let mut all = AllChecks::default();
        let at = |field: &str| format!("{pointer}/{field}");
        let (motions, loads) = (contact.obstacle_motions(), contact.obstacle_loads());
        let stiffness = contact.stiffness.unwrap_or_default();
        let springs = [
            ("normal", stiffness.normal),
            ("tangential", stiffness.tangential),
            ("rotational", stiffness.rotational),
        ];
        for (k, [motion, load]) in FIELDS.into_iter().enumerate() {
            let given = motions[k] != 0.0 || k == 2 && contact.tilt.is_some();
            if given && loads[k].is_some() {
                all.fail(self.report(
                    at(load),
                    Reason::Conflict,
                    format!("`{motion}` and `{load}`"),
                    format!("either `{motion}` or `{load}`"),
                    "Where a load is given, the motion is part of the solution; springs of `stiffness` bear a part of the load.",
                ));
            }
            let (spring, value) = springs[k];
            let place = at(&format!("stiffness/{spring}"));
            all.check(self.require(
                value >= 0.0,
                &place,
                value,
                "a stiffness ≥ 0",
                "A spring pulls the obstacle back to where it was.",
            ));
            if value != 0.0 && loads[k].is_none() {
                all.fail(self.report(
                    place,
                    Reason::NotUsed,
                    format!("a spring without `{load}`"),
                    format!("a spring only with `{load}`"),
                    format!("A given `{motion}` does not depend on springs. A machine that moves the other end of its spring by a distance acts as the load stiffness × distance."),
                ));
            }
        }
        let turns = contact.tilt.is_some() || contact.moment.is_some();
        if turns && contact.about.is_none() {
            all.fail(self.report(
                at("about"),
                Reason::Missing,
                "nothing",
                "the point `[x, y]` about which the obstacle turns",
                "Without it neither a tilt nor a moment has a meaning.",
            ));
        }
        if !contact.is_tool() && contact.about.is_some() {
            all.fail(self.report(
                at("about"),
                Reason::NotUsed,
                "a point without a force, a moment or a tilt of the obstacle",
                "no `about`, or one of `normal_force`, `tangential_force`, `moment` and `tilt` (also 0)",
                "With a force the moment that holds the obstacle is stated about this point; with \"moment\": 0 it turns freely.",
            ));
        }
        if contact.is_tool() {
            all.check(self.tool(analysis, contact, steps, pointer));
        }
        all.finish(())
    }

    /// Checks what an obstacle with a load or a tilt requires of its contact.
    fn tool(
        &mut self,
        analysis: &Analysis,
        contact: &Contact,
        steps: &[Step],
        pointer: &str,
    ) -> Checked {
        let mut all = AllChecks::default();
        let at = |field: &str| format!("{pointer}/{field}");
        if contact.condition == Condition::None {
            all.fail(self.report(
                at("condition"),
                Reason::NotUsed,
                "`none` with a load or a tilt of the obstacle",
                "`unilateral` or `bonded`",
                "Without an obstacle there is nothing to push.",
            ));
        }
        if matches!(analysis, Analysis::Axisymmetric {}) {
            let across = [
                ("tangential_force", contact.tangential_force.is_some()),
                ("tilt", contact.tilt.is_some()),
                ("moment", contact.moment.is_some()),
                ("about", contact.about.is_some()),
            ];
            for (field, _) in across.into_iter().filter(|(_, given)| *given) {
                all.fail(self.report(
                    at(field),
                    Reason::NotUsed,
                    format!("`{field}` in axisymmetry"),
                    "only `normal_force`, along the axis",
                    "A rigid body of revolution can only move along its axis.",
                ));
            }
        }
        if let Some(force) = contact.normal_force
            && contact.condition == Condition::Unilateral
            && contact.stiffness.unwrap_or_default().normal == 0.0
        {
            let hint = "Nothing else holds the obstacle at the body: give the force that presses it there, or a spring by `stiffness`.";
            all.check(self.require(force > 0.0, at("normal_force"), force, "a force > 0", hint));
            for (i, step) in steps.iter().enumerate() {
                let place = format!("/steps/{i}/normal_force");
                let factor = step.normal_force;
                all.check(self.require(factor > 0.0, place, factor, "a factor > 0", hint));
            }
        }
        all.finish(())
    }

    /// The direction in which the obstacle of a contact is pushed, a unit vector: the given one or, for an obstacle that moves
    /// as a rigid body, the one against the normal of a straight boundary.
    pub(super) fn direction_of_push(
        &mut self,
        contact: &Contact,
        boundary: &ContactBoundary,
        outward: &[[f64; 2]],
        pointer: &str,
    ) -> Checked<[f64; 2]> {
        if let Some([x, y]) = contact.direction {
            let direction = [x, y].map(|a| a / x.hypot(y));
            let away = |n: &[f64; 2]| direction[0] * n[0] + direction[1] * n[1] > -ALIGNED;
            let pressed = contact.condition == Condition::Unilateral
                && contact.normal_force.is_some()
                && contact.stiffness.unwrap_or_default().normal == 0.0;
            if pressed && outward.iter().all(away) {
                return Err(self.report(
                    format!("{pointer}/direction"),
                    Reason::Impossible,
                    format!("[{x}, {y}], which points away from the body or along it"),
                    "a direction into the body somewhere on the contact",
                    "`normal_force` pushes the obstacle along `direction`.",
                ));
            }
            return Ok(direction);
        }
        let first = outward[0];
        let off = |(n, error): (&[f64; 2], &f64)| {
            let angle = (first[0] * n[1] - first[1] * n[0]).abs();
            angle > ALIGNED + error + boundary.normal_errors[0]
        };
        if contact.is_tool() && outward.iter().zip(&boundary.normal_errors).any(off) {
            return Err(self.report(
                format!("{pointer}/direction"),
                Reason::Missing,
                "no direction, and a contact boundary that is not straight",
                "the direction `[x, y]` that `normal_force` pushes the obstacle along",
                "An obstacle with a load or a tilt moves as a rigid body, which against the normals of a curved boundary it cannot.",
            ));
        }
        Ok(first.map(|x| -x + 0.0))
    }

    /// Checks that no support holds a contact node along a motion of the obstacle that is unknown: the displacement relative to
    /// the obstacle would then be neither free nor given.
    pub(super) fn nodes_held_along_tool(
        &mut self,
        contact: &ContactModel,
        fixed: &BTreeMap<u32, Held>,
    ) -> Checked {
        let Some(tool) = &contact.tool else {
            return Ok(());
        };
        let boundary = &contact.boundary;
        for (i, node) in boundary.nodes.iter().enumerate() {
            let Some(held) = fixed.get(node) else {
                continue;
            };
            let axes = [boundary.normals[i], boundary.tangent(i)];
            for k in tool.free() {
                let row = tool.row(i, k);
                let size = row[0].hypot(row[1]);
                let error = ALIGNED + boundary.normal_errors[i];
                let along = |a: usize| {
                    // a node that is held along the surface is on a line of symmetry, whose other side would move the other way
                    let across = a == 1 && k > 0;
                    held.along(axes[a]).is_some() && (across || row[a].abs() > error * size)
                };
                // oblique supports, too, hold the node along a part of the motion
                let oblique = axes.iter().all(|axis| held.along(*axis).is_none());
                if !(along(0) || along(1) || oblique && size > 0.0) {
                    continue;
                }
                let [x, y] = boundary.positions[i];
                let [motion, load] = FIELDS[k];
                return Err(self.report(
                    format!("{}/{load}", contact.pointer),
                    Reason::Conflict,
                    format!("node {node} of the contact at ({x}, {y}), which a support holds along the `{motion}` that `{load}` causes"),
                    format!("a contact whose nodes no support holds along the `{motion}`"),
                    "On a line of symmetry an obstacle can only move along this line: model the whole body for a tangential force or a moment. Else end the contact one edge before the support with `from` or `to`.",
                ));
            }
        }
        Ok(())
    }

    /// Checks that friction can bear the tangential force of an obstacle, where its normal force is given, too, and all of the
    /// contact has one normal.
    pub(super) fn tangential_force_borne(
        &mut self,
        contact: &ContactModel,
        steps: &[Step],
    ) -> Checked {
        let Some(tool) = &contact.tool else {
            return Ok(());
        };
        let ([Some(normal), Some(tangential), _], [_, spring, _]) = (tool.loads, tool.stiffness)
        else {
            return Ok(());
        };
        if !presses_straight(contact, tool) || spring > 0.0 {
            return Ok(());
        }
        for (i, level) in Level::ends_of(steps).into_iter().enumerate() {
            let [normal, tangential] = [normal * level.forces[0], tangential * level.forces[1]];
            let most = most_friction(contact, normal);
            if tangential.abs() > most * (1.0 + ALIGNED) {
                return Err(self.report(
                    format!("{}/tangential_force", contact.pointer),
                    Reason::Impossible,
                    format!("a tangential force of {tangential} with a normal force of {normal}{}", at_end(steps, i)),
                    format!("at most {most}, which friction can bear"),
                    "Beyond it the obstacle slides away and there is no equilibrium. Give a `tangential_displacement` for sliding, a smaller force, or a spring by `stiffness`.",
                ));
            }
        }
        Ok(())
    }

    /// Checks that pressure can bear the moment of an obstacle whose normal force is given, too: the force must act between the
    /// ends of the contact. With friction on a curved contact that does not follow before solving.
    pub(super) fn moment_borne(&mut self, contact: &ContactModel, steps: &[Step]) -> Checked {
        let Some(tool) = &contact.tool else {
            return Ok(());
        };
        let [Some(normal), tangential, Some(moment)] = tool.loads else {
            return Ok(());
        };
        let straight = presses_straight(contact, tool);
        let [normal_spring, tangential_spring, rotational_spring] = tool.stiffness;
        let nodes = 0..contact.boundary.nodes.len();
        let unknown = contact.condition != Condition::Unilateral
            || normal_spring > 0.0
            || rotational_spring > 0.0
            || contact.friction.is_some() && !straight
            || nodes.clone().any(|i| tool.row(i, 0)[0] <= ALIGNED);
        if unknown || !tool.has_point {
            return Ok(());
        }
        // the distance of the normal force from `about` along t, of a pressure at each node
        let arms = nodes.map(|i| -tool.row(i, 2)[0] / tool.row(i, 0)[0]);
        let (start, end) = arms.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), arm| {
            (a.min(arm), b.max(arm))
        });
        let edge = ALIGNED * (end - start);
        let ([_, along], [_, height]) = (tool.row(0, 1), tool.row(0, 2));
        for (i, level) in Level::ends_of(steps).into_iter().enumerate() {
            let [normal, moment] = [normal * level.forces[0], moment * level.forces[2]];
            // friction changes it where `about` does not lie in the plane of a straight contact
            let friction = match tangential {
                _ if contact.friction.is_none() || height.abs() <= edge => [0.0; 2],
                Some(force) if tangential_spring == 0.0 => [force * level.forces[1] * along; 2],
                _ => [-1.0, 1.0].map(|sign| sign * most_friction(contact, normal)),
            };
            let [a, b] = friction.map(|friction| (height * friction - moment) / normal);
            let nearest = match (a.max(b), a.min(b)) {
                (before, _) if before <= start + edge => before,
                (_, after) if after >= end - edge => after,
                _ => continue,
            };
            let rubbed = match (tangential, friction) {
                (Some(_), [force, _]) if force != 0.0 => {
                    format!(" and a tangential force of {}", rounded(force * along))
                }
                _ => String::new(),
            };
            return Err(self.report(
                format!("{}/moment", contact.pointer),
                Reason::Impossible,
                format!(
                    "a moment of {moment} with a normal force of {normal}{rubbed}{}: the force acts at the distance {} from `about` along t",
                    at_end(steps, i),
                    rounded(nearest)
                ),
                format!("a distance between {} and {}, the ends of the contact", rounded(start), rounded(end)),
                "Beyond an end the obstacle tips over and there is no equilibrium. Give a `tilt` in place of the moment, a smaller moment, or a spring by `stiffness`.",
            ));
        }
        Ok(())
    }
}

/// The load step of a level, in words; empty without steps.
fn at_end(steps: &[Step], step: usize) -> String {
    match steps {
        [] => String::new(),
        _ => format!(" at the end of step {step}"),
    }
}

/// The largest tangential force that friction on a contact with one normal bears at a normal force; infinite if it is not limited.
fn most_friction(contact: &ContactModel, normal: f64) -> f64 {
    let length: f64 = contact.boundary.weights.iter().sum();
    match contact.friction.as_ref().map(|law| &law.bound) {
        None => 0.0,
        // the literal average of the thesis has no such limit
        Some(BoundLaw::Pressure { average, .. })
            if average.normalization == Normalization::PeakOne =>
        {
            f64::INFINITY
        }
        Some(BoundLaw::Pressure {
            coefficient,
            cohesion,
            shear_cap,
            ..
        }) => (shear_cap * length).min(cohesion * length + coefficient * normal),
        Some(BoundLaw::Prescribed(_)) => f64::INFINITY,
    }
}

/// Whether an obstacle presses a contact that has one normal, against which it is pushed.
fn presses_straight(contact: &ContactModel, tool: &Tool) -> bool {
    let mut nodes = 0..contact.boundary.nodes.len();
    contact.condition == Condition::Unilateral
        && nodes.all(|i| (tool.row(i, 0)[0] - 1.0).abs() <= ALIGNED)
}
