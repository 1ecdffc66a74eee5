//! A problem as a typed message: for our own clients.

mod contact;

use contact::contact_to_pb;
use solver::problem::{
    AdaptiveRefine, Algorithm, Analysis, BoundaryPart, BoundaryValue, ElementRange, Grid,
    InlineMesh, Load, Material, MeshInput, Orthotropic, Problem, Refine, SolverControls, Spacing,
    Step, Support, ThesisOptions, ThesisPressure, Units,
};

use crate::pb;

/// Writes a problem as a message, every default spelled out.
pub fn problem_to_pb(problem: &Problem) -> pb::Problem {
    let Problem {
        title,
        units,
        analysis,
        mesh,
        materials,
        supports,
        loads,
        contacts,
        steps,
        quadrature,
        solver,
    } = problem;
    let kind = match *analysis {
        Analysis::PlaneStrain {} => pb::analysis::Kind::PlaneStrain(pb::PlaneStrain {}),
        Analysis::PlaneStress { thickness } => {
            pb::analysis::Kind::PlaneStress(pb::PlaneStress { thickness })
        }
        Analysis::Axisymmetric {} => pb::analysis::Kind::Axisymmetric(pb::Axisymmetric {}),
    };
    pb::Problem {
        title: title.clone(),
        units: units.as_ref().map(units_to_pb),
        analysis: Some(pb::Analysis { kind: Some(kind) }),
        mesh: Some(mesh_to_pb(mesh)),
        materials: materials.iter().map(material_to_pb).collect(),
        supports: supports.iter().map(support_to_pb).collect(),
        loads: loads.iter().map(load_to_pb).collect(),
        contacts: contacts.iter().map(contact_to_pb).collect(),
        solver: Some(controls_to_pb(solver)),
        steps: steps.iter().map(step_to_pb).collect(),
        quadrature: Some(*quadrature),
    }
}

fn units_to_pb(units: &Units) -> pb::Units {
    pb::Units {
        length: units.length.clone(),
        force: units.force.clone(),
        stress: units.stress.clone(),
    }
}

fn material_to_pb(m: &Material) -> pb::Material {
    let orthotropic = |o: &Orthotropic| pb::Orthotropic {
        e1: o.e1,
        e2: o.e2,
        nu12: o.nu12,
        g12: o.g12,
        angle: o.angle,
        e3: o.e3,
        nu13: o.nu13,
        nu23: o.nu23,
    };
    pb::Material {
        youngs_modulus: m.youngs_modulus,
        poissons_ratio: m.poissons_ratio,
        name: m.name.clone(),
        orthotropic: m.orthotropic.as_ref().map(orthotropic),
        group: m.group.clone(),
    }
}

fn support_to_pb(s: &Support) -> pb::Support {
    pb::Support {
        boundary: s.boundary.clone().unwrap_or_default(),
        nodes: s.nodes.clone(),
        ux: s.ux.map(value_to_pb),
        uy: s.uy.map(value_to_pb),
        un: s.un.map(value_to_pb),
        ut: s.ut.map(value_to_pb),
    }
}

fn load_to_pb(l: &Load) -> pb::Load {
    let vector = |&[x, y]: &[f64; 2]| pb::Vector { x, y };
    let traction = |[x, y]: [BoundaryValue; 2]| pb::Traction {
        x: Some(value_to_pb(x)),
        y: Some(value_to_pb(y)),
    };
    pb::Load {
        boundary: l.boundary.clone(),
        pressure: l.pressure.map(value_to_pb),
        traction: l.traction.map(traction),
        normal: l.normal.map(value_to_pb),
        tangential: l.tangential.map(value_to_pb),
        nodal: l.nodal.as_ref().map(|forces| pb::NodalForces {
            forces: forces.iter().map(vector).collect(),
        }),
        body_force: l.body_force.as_ref().map(vector),
        nodes: l.nodes.clone(),
        force: l.force.as_ref().map(vector),
    }
}

fn step_to_pb(step: &Step) -> pb::Step {
    pb::Step {
        name: step.name.clone(),
        indentation: Some(step.indentation),
        tangential_displacement: step.tangential_displacement,
        loads: Some(step.loads),
        supports: Some(step.supports),
        increments: Some(step.increments),
        spacing: match step.spacing {
            Spacing::Uniform => pb::Spacing::Uniform.into(),
            Spacing::ContactWidth => pb::Spacing::ContactWidth.into(),
        },
    }
}

fn controls_to_pb(solver: &SolverControls) -> pb::SolverControls {
    let thesis = |options: &ThesisOptions| pb::ThesisOptions {
        contact_guess: options
            .contact_guess
            .iter()
            .map(|(name, &range)| (name.clone(), range_to_pb(range)))
            .collect(),
        friction_force: Some(options.friction_force),
        pressure: match options.pressure {
            ThesisPressure::Lumped => pb::ThesisPressure::Lumped.into(),
            ThesisPressure::Extrapolated => pb::ThesisPressure::Extrapolated.into(),
        },
        local_points: options.local_points,
        relaxation: Some(options.relaxation),
        signed: options.signed,
    };
    pb::SolverControls {
        algorithm: match solver.algorithm {
            Algorithm::Auto => pb::Algorithm::Auto.into(),
            Algorithm::FixedPoint => pb::Algorithm::FixedPoint.into(),
            Algorithm::Newton => pb::Algorithm::Newton.into(),
            Algorithm::Thesis => pb::Algorithm::Thesis.into(),
        },
        tolerance: Some(solver.tolerance),
        max_iterations: Some(solver.max_iterations),
        check_uniqueness: solver.check_uniqueness,
        check_increments: solver.check_increments,
        thesis: solver.thesis.as_ref().map(thesis),
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
            .map(|nodes| pb::Element {
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
        groups: inline
            .groups
            .iter()
            .map(|(name, elements)| {
                let elements = elements.clone();
                (name.clone(), pb::ElementList { elements })
            })
            .collect(),
        node_sets: inline
            .node_sets
            .iter()
            .map(|(name, nodes)| {
                let nodes = nodes.clone();
                (name.clone(), pb::NodeList { nodes })
            })
            .collect(),
    };
    use pb::mesh::Source;
    let source = mesh.grid.as_ref().map(|g| Source::Grid(grid(g)));
    let source = source.or_else(|| mesh.inline.as_ref().map(|i| Source::Inline(inline(i))));
    let source = source.or_else(|| mesh.gmsh.clone().map(Source::Gmsh));
    let source = source.or_else(|| mesh.abaqus.clone().map(Source::Abaqus));
    let source = source.or_else(|| mesh.stored.clone().map(Source::Stored));
    let part = |part: &BoundaryPart| pb::BoundaryPart {
        side: part.side.clone().unwrap_or_default(),
        x: part.x.map(range_to_pb),
        y: part.y.map(range_to_pb),
        r#box: part.corners.map(|corners| {
            let [from, to] = corners.map(|[x, y]| Some(pb::Point { x, y }));
            pb::Box { from, to }
        }),
        normal: part.normal.map(|[x, y]| pb::Vector { x, y }),
        angle: part.angle,
    };
    let boundaries = mesh
        .boundaries
        .iter()
        .map(|(name, p)| (name.clone(), part(p)))
        .collect();
    let group = |range: &ElementRange| pb::ElementRange {
        x: range.x.map(range_to_pb),
        y: range.y.map(range_to_pb),
    };
    let refinement = match mesh.refine {
        Refine::Times(times) => pb::mesh::Refinement::Refine(times),
        Refine::Adaptive(AdaptiveRefine { tolerance }) => {
            pb::mesh::Refinement::Adaptive(pb::AdaptiveRefine { tolerance })
        }
    };
    pb::Mesh {
        source,
        refinement: Some(refinement),
        boundaries,
        groups: mesh
            .groups
            .iter()
            .map(|(name, range)| (name.clone(), group(range)))
            .collect(),
    }
}

fn range_to_pb([start, end]: [f64; 2]) -> pb::Range {
    pb::Range { start, end }
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
