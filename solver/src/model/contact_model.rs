//! A checked contact, ready to be solved.

use std::sync::Arc;

use super::checks::ALIGNED;
use super::level::Level;
use super::pair::Pair;
use super::tool::Tool;
use crate::contact::ContactBoundary;
use crate::contact::obstacle::Place;
use crate::friction::{Average, FrictionLaw};
use crate::mesh::Edge;
use crate::problem::{Condition, Contact, NormalOf, Obstacle};

/// An obstacle that is pushed along one direction.
#[derive(Clone, Debug)]
pub struct AlongDirection {
    /// The direction, a unit vector.
    pub direction: [f64; 2],
    /// The obstacle that is pushed. [`ContactModel::gap`] is of first order in the indentation; the gap to the
    /// displaced obstacle is not.
    pub obstacle: Arc<Obstacle>,
}

/// A contact boundary, its obstacle and its friction law.
#[derive(Clone, Debug)]
pub struct ContactModel {
    /// The name of the boundary.
    pub name: String,
    /// The JSON Pointer to the contact.
    pub pointer: String,
    /// Γ_C, with the normals that the contact uses.
    pub boundary: ContactBoundary,
    /// The profile of the obstacle at each node, along the contact's normal (length).
    pub profile: Vec<f64>,
    /// The obstacle between the nodes and at the obstacle's corners, in order of s.
    pub places: Vec<Place>,
    /// Whether the obstacle, or another body, lies in space; otherwise it is given by its distance from the body's surface.
    pub in_space: bool,
    /// The slope of the obstacle along the body's t, at the first and at the last node.
    pub end_slopes: [f64; 2],
    /// The edges inside which the obstacle ends, each with the length of it that the obstacle covers; they are not part
    /// of Γ_C.
    pub cut: Vec<(Edge, f64)>,
    /// How far the obstacle is pushed against the body, or another body overlaps it (length).
    pub indentation: f64,
    /// The components of a unit push against the contact's normal and along its tangent t, at each node. Without a
    /// given direction they are 1 and 0 where the contact uses the body's normal, and the cosine and minus the sine of
    /// the obstacle's slope where it uses the obstacle's normal.
    pub push: Vec<[f64; 2]>,
    /// The direction of the indentation, if one is given.
    pub along: Option<AlongDirection>,
    /// The obstacle as a rigid body, if it has a load or a tilt.
    pub tool: Option<Tool>,
    /// The other body, if there is one in place of the obstacle.
    pub pair: Option<Pair>,
    /// The body's own normal at each node.
    pub outward: Vec<[f64; 2]>,
    /// The obstacle's own displacement along the contact's t (length).
    pub tangential_displacement: f64,
    /// Whether sliding of the obstacle changes neither the gap nor the place of contact: a straight obstacle without
    /// ends along a whole straight side of the body.
    pub endless: bool,
    /// Which normal the contact uses.
    pub normal: NormalOf,
    /// The contact condition.
    pub condition: Condition,
    /// Whether the obstacle was measured, with noise of a known standard deviation.
    pub measured: bool,
    /// Whether each end of the contact is the last point of an obstacle that is given by points, which may go on there.
    pub last_points: [bool; 2],
    /// The exponent m if the obstacle's profile is a power |c|^m: the contact's width then grows like δ^(1/m).
    pub power: Option<f64>,
    /// The friction law; absent: frictionless.
    pub friction: Option<FrictionLaw<Average>>,
}

impl ContactModel {
    /// The gap at a node (length) at a load level, without motions of the obstacle that are unknown.
    pub fn gap(&self, node: usize, level: &Level) -> f64 {
        let pushed = match &self.tool {
            None => level.motions[0] * self.indentation * self.push[node][0],
            Some(tool) => tool.moved(node, &tool.motions(level))[0],
        };
        self.profile[node] - pushed
    }

    /// What lies opposite, in words.
    pub(crate) fn opposite(&self) -> &'static str {
        match self.pair {
            None => "the obstacle",
            Some(_) => "the other body",
        }
    }

    /// How far the meshes of two bodies overlap at most (length); none against a rigid obstacle.
    pub fn overlap(&self) -> Option<f64> {
        let least = self.profile.iter().copied().fold(0.0, f64::min);
        self.pair.as_ref().map(|_| -least)
    }

    /// Takes the motions and loads of the obstacle of a contact that has the same free motions.
    pub(super) fn take(&mut self, contact: &Contact) {
        self.indentation = contact.pushed();
        self.tangential_displacement = contact.tangential_displacement;
        if let Some(tool) = &mut self.tool {
            tool.take(contact);
        }
    }

    /// Whether the second of the oblique axes of a node lies along the surface of the body.
    pub fn held_along_surface(&self, node: usize, [_, held]: &[[f64; 2]; 2]) -> bool {
        let [x, y] = self.outward[node];
        (held[0] * x + held[1] * y).abs() <= ALIGNED
    }

    /// How far the indentation moves the obstacle along the surface of the body at a node (length); 0 if no direction
    /// is given.
    pub(super) fn pushed_along_body(&self, node: usize) -> f64 {
        let ([a, b], m, t) = (
            self.push[node],
            self.boundary.normals[node],
            self.boundary.tangent(node),
        );
        let [x, y] = self.outward[node];
        self.indentation * (y * (b * t[0] - a * m[0]) - x * (b * t[1] - a * m[1]))
    }

    /// The displacement d of the obstacle along the contact's t at a node (length), without its unknown motions.
    pub fn drag(&self, node: usize, level: &Level) -> f64 {
        match &self.tool {
            None => {
                let pushed = level.motions[0] * self.indentation;
                level.motions[1] * self.tangential_displacement + pushed * self.push[node][1]
            }
            Some(tool) => tool.moved(node, &tool.motions(level))[1],
        }
    }
}
