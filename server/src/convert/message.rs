//! A problem as a typed message: for our own clients.

use solver::problem::{
    Algorithm, Along, Analysis, BoundaryPart, BoundaryValue, Contact, Friction, Grid, History,
    InlineMesh, Kernel, Load, Material, MeshInput, Normalization, Obstacle, Problem, Support,
    Transition,
};

use crate::pb;

/// Writes a problem as a message, every default spelled out.
pub fn problem_to_pb(problem: &Problem) -> pb::Problem {
    let Problem {
        title,
        analysis,
        mesh,
        materials,
        supports,
        loads,
        contacts,
        solver,
    } = problem;
    let kind = match *analysis {
        Analysis::PlaneStrain {} => pb::analysis::Kind::PlaneStrain(pb::PlaneStrain {}),
        Analysis::PlaneStress { thickness } => {
            pb::analysis::Kind::PlaneStress(pb::PlaneStress { thickness })
        }
        Analysis::Axisymmetric {} => pb::analysis::Kind::Axisymmetric(pb::Axisymmetric {}),
    };
    let material = |m: &Material| pb::Material {
        youngs_modulus: m.youngs_modulus,
        poissons_ratio: m.poissons_ratio,
        name: m.name.clone(),
    };
    let support = |s: &Support| pb::Support {
        boundary: s.boundary.clone(),
        ux: s.ux.map(value_to_pb),
        uy: s.uy.map(value_to_pb),
    };
    let load = |l: &Load| pb::Load {
        boundary: l.boundary.clone(),
        pressure: Some(value_to_pb(l.pressure)),
    };
    pb::Problem {
        title: title.clone(),
        analysis: Some(pb::Analysis { kind: Some(kind) }),
        mesh: Some(mesh_to_pb(mesh)),
        materials: materials.iter().map(material).collect(),
        supports: supports.iter().map(support).collect(),
        loads: loads.iter().map(load).collect(),
        contacts: contacts.iter().map(contact_to_pb).collect(),
        solver: Some(pb::SolverControls {
            algorithm: match solver.algorithm {
                Algorithm::Auto => pb::Algorithm::Auto.into(),
            },
            tolerance: Some(solver.tolerance),
            max_iterations: Some(solver.max_iterations),
        }),
    }
}

fn mesh_to_pb(mesh: &MeshInput) -> pb::Mesh {
    let points = |points: &Vec<[f64; 2]>| points.iter().map(|&[x, y]| pb::Point { x, y }).collect();
    let grid = |grid: &Grid| pb::Grid {
        x: grid.x.clone(),
        y: grid.y.clone(),
        top: grid.top.as_ref().map(points).unwrap_or_default(),
        bottom: grid.bottom.as_ref().map(points).unwrap_or_default(),
    };
    let inline = |inline: &InlineMesh| pb::InlineMesh {
        nodes: points(&inline.nodes),
        elements: inline
            .elements
            .iter()
            .map(|nodes| pb::Quad8 {
                nodes: nodes.to_vec(),
            })
            .collect(),
        boundaries: inline
            .boundaries
            .iter()
            .map(|(name, edges)| {
                let edges = edges
                    .iter()
                    .map(|nodes| pb::Edge3 {
                        nodes: nodes.to_vec(),
                    })
                    .collect();
                (name.clone(), pb::EdgeList { edges })
            })
            .collect(),
    };
    let source = match (&mesh.grid, &mesh.inline) {
        (Some(g), _) => Some(pb::mesh::Source::Grid(grid(g))),
        (None, Some(i)) => Some(pb::mesh::Source::Inline(inline(i))),
        (None, None) => None,
    };
    let range = |range: [f64; 2]| pb::Range {
        start: range[0],
        end: range[1],
    };
    let part = |part: &BoundaryPart| pb::BoundaryPart {
        side: part.side.clone(),
        x: part.x.map(range),
        y: part.y.map(range),
    };
    let boundaries = mesh
        .boundaries
        .iter()
        .map(|(name, p)| (name.clone(), part(p)))
        .collect();
    pb::Mesh {
        source,
        refine: mesh.refine,
        boundaries,
    }
}

fn value_to_pb(value: BoundaryValue) -> pb::BoundaryValue {
    match value {
        BoundaryValue::Constant(start) => pb::BoundaryValue { start, end: None },
        BoundaryValue::Linear([start, end]) => pb::BoundaryValue {
            start,
            end: Some(end),
        },
    }
}

fn contact_to_pb(contact: &Contact) -> pb::Contact {
    use pb::obstacle::Kind;
    let (kind, from, to, along) = match contact.obstacle {
        Obstacle::Flat { from, to, along } => (Kind::Flat(pb::Flat {}), from, to, along),
        Obstacle::Circle {
            radius,
            center,
            from,
            to,
            along,
        } => (Kind::Circle(pb::Circle { radius, center }), from, to, along),
        Obstacle::Parabola {
            radius,
            center,
            from,
            to,
            along,
        } => (
            Kind::Parabola(pb::Parabola { radius, center }),
            from,
            to,
            along,
        ),
    };
    let along = match along {
        Along::X => pb::Along::X,
        Along::ArcLength => pb::Along::ArcLength,
    };
    pb::Contact {
        boundary: contact.boundary.clone(),
        obstacle: Some(pb::Obstacle {
            kind: Some(kind),
            from,
            to,
            along: along.into(),
        }),
        indentation: contact.indentation,
        tangential_displacement: contact.tangential_displacement,
        friction: contact.friction.as_ref().map(friction_to_pb),
    }
}

fn friction_to_pb(friction: &Friction) -> pb::Friction {
    pb::Friction {
        coefficient: friction.coefficient,
        nonlocal_radius: friction.nonlocal_radius,
        elastic_slip: friction.elastic_slip,
        kernel: match friction.kernel {
            Kernel::Bump => pb::Kernel::Bump.into(),
            Kernel::Parabola => pb::Kernel::Parabola.into(),
        },
        normalization: match friction.normalization {
            Normalization::UnitIntegral => pb::Normalization::UnitIntegral.into(),
            Normalization::PeakOne => pb::Normalization::PeakOne.into(),
        },
        transition: match friction.transition {
            Transition::Linear => pb::Transition::Linear.into(),
            Transition::Tanh => pb::Transition::Tanh.into(),
        },
        history: match friction.history {
            History::Total => pb::History::Total.into(),
        },
    }
}
