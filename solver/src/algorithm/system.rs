//! The problem as seen from Γ_C: contact nodes, friction points, and the forces between them.

use crate::body::ElasticBody;
use crate::elasticity::Dof;
use crate::friction::{Chain, FrictionLaw, Row};
use crate::linear::Dense;
use crate::model::{ContactModel, Model};

/// A radius below this part of the contact's length is the axis: a mesh generator may miss 0 by
/// rounding, and the weight of such a node is nothing but rounding.
const AXIS: f64 = 1e-12;

/// Everything the iterations need, all contacts in a row.
pub struct System<'a> {
    /// Ŝ.
    pub stiffness: &'a Dense,
    /// f̂.
    pub load: &'a [f64],
    /// Contact nodes.
    pub nodes: Vec<ContactNode>,
    /// Points where friction acts; none in a frictionless contact.
    pub points: Vec<Point>,
    /// One for each contact.
    pub patches: Vec<Patch<'a>>,
    /// From a sum of nodal forces to a total: 2π in axisymmetry, else 1.
    pub circumference: f64,
}

/// One contact node.
#[derive(Clone, Copy, Debug)]
pub struct ContactNode {
    /// u_n.
    pub normal: Dof,
    /// u_t.
    pub tangent: Dof,
    /// u_n ≤ gap.
    pub gap: f64,
    /// ∫ h_i.
    pub weight: f64,
    /// A node on the axis has no weight: its state is that of this node, and its pressure is
    /// extrapolated from this one and the next.
    pub follows: Option<[usize; 2]>,
}

/// One friction point.
#[derive(Clone, Debug)]
pub struct Point {
    /// The patch it belongs to.
    pub patch: usize,
    /// Its three nodes.
    pub nodes: [usize; 3],
    /// Their shape functions.
    pub shape: [f64; 3],
    /// w_g.
    pub weight: f64,
    /// Its row of W, on all nodes.
    pub row: Row,
}

/// One contact of the model in the system.
pub struct Patch<'a> {
    /// The contact.
    pub contact: &'a ContactModel,
    /// Number of its first node.
    pub first: usize,
    /// Its friction law; none: frictionless.
    pub law: Option<FrictionLaw>,
}

/// A state of the system.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// Contact unknowns.
    pub v: Vec<f64>,
    /// Nodes in contact.
    pub active: Vec<bool>,
}

impl<'a> System<'a> {
    /// Collects the contacts of a model on its condensed body.
    pub fn new(model: &'a Model, body: &'a ElasticBody) -> Self {
        let (mut nodes, mut points, mut patches) = (Vec::new(), Vec::new(), Vec::new());
        for contact in &model.contacts {
            let (first, boundary) = (nodes.len(), &contact.boundary);
            let count = boundary.nodes.len();
            let on_axis = |i: usize| {
                model.section.axisymmetric()
                    && boundary.positions[i][0] <= AXIS * boundary.s[count - 1]
            };
            for i in 0..count {
                let [normal, tangent] = body.contact_dofs[first + i];
                let towards = |step: [usize; 2]| Some(step.map(|s| first + s));
                let follows = match i {
                    0 if on_axis(0) => towards([1, 2]),
                    _ if i == count - 1 && on_axis(i) => towards([i - 1, i - 2]),
                    _ => None,
                };
                let (gap, weight) = (contact.gap[i], boundary.weights[i]);
                nodes.push(ContactNode {
                    normal,
                    tangent,
                    gap,
                    weight,
                    follows,
                });
            }
            let symmetric = |i: usize| {
                on_axis(i) || matches!(nodes[first + i].tangent, Dof::Fixed(value) if value == 0.0)
            };
            let chain = Chain {
                s: boundary.s.clone(),
                mirror_start: symmetric(0),
                mirror_end: symmetric(count - 1),
            };
            // a coefficient of zero is no friction: nothing to average, nothing to iterate
            let friction = contact.friction.filter(|f| f.coefficient > 0.0);
            let law = friction.map(|f| FrictionLaw::new(&f, chain));
            if let Some(law) = &law {
                for point in &boundary.friction_points {
                    let mut row = law.averaging.row(point.s);
                    row.first += first;
                    points.push(Point {
                        patch: patches.len(),
                        nodes: point.nodes.map(|i| first + i),
                        shape: point.shape,
                        weight: point.weight,
                        row,
                    });
                }
            }
            patches.push(Patch {
                contact,
                first,
                law,
            });
        }
        System {
            stiffness: &body.stiffness,
            load: &body.load,
            nodes,
            points,
            patches,
            circumference: model.section.circumference(),
        }
    }

    /// The state to start from: nothing moves, nothing touches.
    pub fn rest(&self) -> State {
        State {
            v: vec![0.0; self.load.len()],
            active: vec![false; self.nodes.len()],
        }
    }

    /// u_n of a node.
    pub fn normal_displacement(&self, v: &[f64], node: usize) -> f64 {
        value(self.nodes[node].normal, v)
    }

    /// u_t of a node.
    pub fn tangential_displacement(&self, v: &[f64], node: usize) -> f64 {
        value(self.nodes[node].tangent, v)
    }

    /// u_t − d at a friction point.
    pub fn slip(&self, v: &[f64], point: &Point) -> f64 {
        let u_t: f64 = (0..3)
            .map(|i| point.shape[i] * self.tangential_displacement(v, point.nodes[i]))
            .sum();
        u_t - self.patches[point.patch].contact.tangential_displacement
    }

    /// The law at a friction point.
    pub fn law(&self, point: &Point) -> &FrictionLaw {
        match &self.patches[point.patch].law {
            Some(law) => law,
            None => unreachable!("a contact without a law has no friction points"),
        }
    }

    /// Ŝ v − f̂: the force that the body asks for on its contact unknowns.
    pub fn elastic_force(&self, v: &[f64]) -> Vec<f64> {
        self.stiffness
            .times(v)
            .iter()
            .zip(self.load)
            .map(|(a, b)| a - b)
            .collect()
    }

    /// Adds the force Σ w τ φ(u_t − d) h of friction, on the left-hand side, thesis (2.29).
    pub fn add_friction_force(&self, v: &[f64], bound: &[f64], force: &mut [f64]) {
        for (point, tau) in self.points.iter().zip(bound) {
            let traction = point.weight * tau * self.law(point).phi(self.slip(v, point));
            for i in 0..3 {
                if let Dof::Free(dof) = self.nodes[point.nodes[i]].tangent {
                    force[dof] += traction * point.shape[i];
                }
            }
        }
    }

    /// Nodal reactions R = f̂_n − (Ŝ v)_n of the obstacle on active nodes; exactly 0 on the others.
    pub fn reactions(&self, state: &State) -> Vec<f64> {
        let force = self.elastic_force(&state.v);
        let reaction = |(node, active): (&ContactNode, &bool)| match node.normal {
            Dof::Free(dof) if *active => -force[dof],
            _ => 0.0,
        };
        self.nodes.iter().zip(&state.active).map(reaction).collect()
    }

    /// Nodal pressures p = R / ∫h; on the axis the parabola through the next two nodes.
    pub fn pressures(&self, reactions: &[f64]) -> Vec<f64> {
        let direct = |i: usize| reactions[i] / self.nodes[i].weight;
        let pressure = |i: usize| match self.nodes[i].follows {
            // zero slope at the axis: p₀ = (4 p₁ − p₂)/3
            Some([next, after]) => (4.0 * direct(next) - direct(after)) / 3.0,
            None => direct(i),
        };
        (0..self.nodes.len()).map(pressure).collect()
    }

    /// τ = μ max(S_ρ(p), 0) at every friction point, thesis (1.3): also where the body is open but
    /// within ρ of contact.
    pub fn friction_bound(&self, pressures: &[f64]) -> Vec<f64> {
        self.points
            .iter()
            .map(|point| self.law(point).bound(point.row.apply(pressures)))
            .collect()
    }

    /// The largest force or complementarity defect for a given friction bound, divided by the
    /// largest nodal reaction (by the largest load where nothing touches).
    pub fn kkt_residual(&self, state: &State, bound: &[f64]) -> f64 {
        let mut force = self.elastic_force(&state.v);
        self.add_friction_force(&state.v, bound, &mut force);
        let reactions = self.reactions(state);
        let mut defect: f64 = 0.0;
        for (i, node) in self.nodes.iter().enumerate() {
            if let Dof::Free(dof) = node.tangent {
                defect = defect.max(force[dof].abs());
            }
            let Dof::Free(dof) = node.normal else {
                continue;
            };
            let opening = node.gap - state.v[dof];
            let stiffness = self.stiffness.at(dof, dof);
            defect = defect.max(match (state.active[i], node.follows) {
                (true, None) => (stiffness * opening).abs().max(-reactions[i]),
                (true, Some(_)) => (stiffness * opening).abs(),
                (false, None) => force[dof].abs().max(-stiffness * opening),
                (false, Some(_)) => force[dof].abs(),
            });
        }
        let largest = |values: &[f64]| values.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        let scale = match largest(&reactions) {
            0.0 => largest(self.load).max(defect),
            reaction => reaction,
        };
        if defect == 0.0 { 0.0 } else { defect / scale }
    }
}

fn value(dof: Dof, v: &[f64]) -> f64 {
    match dof {
        Dof::Free(i) => v[i],
        Dof::Fixed(value) => value,
    }
}
