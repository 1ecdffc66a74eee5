//! A deck as a whole problem: a part that is not supported is a violation with its line.

use std::{
    collections::{BTreeSet, HashMap},
    mem,
};

use super::deck::{Deck, Elastic, ElementType, MOST_CONSTANTS, Section, Theory};
use super::read::read;
use crate::source::ReadError;
use solver::error::Violation;
use solver::problem::{
    Analysis, BoundaryValue, Elasticity, Load, Material, MeshInput, MeshSource, Orthotropic,
    Problem, SolverControls, Support,
};

/// The problem that a deck states: one linear static step, without contact. The text itself becomes
/// the problem's mesh.
pub fn problem(text: &str) -> Result<Problem, Vec<Violation>> {
    let mut deck = read(text.as_bytes()).map_err(ReadError::into_violations)?;
    let analysis = analysis(&mut deck);
    let quadrature = quadrature(&mut deck);
    let materials = materials(&mut deck);
    if deck.steps != 1 {
        let got = format!("{} steps", deck.steps);
        deck.doubt(
            0,
            got,
            "one *STEP",
            "Give the load steps in a problem of Signorini.",
        );
    }
    let supports = supports(&deck);
    let loads = loads(&mut deck, &analysis);
    let (title, doubts) = (deck.title.take(), std::mem::take(&mut deck.doubts));
    let (_, mut faults) = deck.into_raw();
    faults.extend(doubts.into_violations());
    faults.into_result(Problem {
        title,
        analysis,
        mesh: MeshInput::new(MeshSource::Abaqus(text.to_owned())),
        materials,
        supports,
        loads,
        contacts: Vec::new(),
        steps: Vec::new(),
        quadrature,
        units: Default::default(),
        solver: SolverControls::default(),
    })
}

fn analysis(deck: &mut Deck) -> Analysis {
    let theory = deck
        .types
        .first()
        .map_or(Theory::PlaneStrain, |kind| kind.theory);
    if deck.types.iter().any(|kind| kind.theory != theory) {
        deck.doubt(
            0,
            "elements of different theories",
            "one of CPE, CPS, CAX throughout",
            "Use one theory for all elements.",
        );
    }
    let first = deck.sections.first().and_then(|section| section.thickness);
    let thicknesses: Vec<(u64, Option<f64>)> = deck
        .sections
        .iter()
        .map(|s| (s.line, s.thickness))
        .collect();
    for (line, thickness) in thicknesses {
        let wanted = match theory {
            Theory::PlaneStress => first.unwrap_or(1.0),
            _ => 1.0,
        };
        if theory != Theory::Axisymmetric && thickness.unwrap_or(1.0) != wanted {
            deck.doubt(
                line,
                format!("a thickness of {}", thickness.unwrap_or(1.0)),
                &format!("{wanted}"),
                "Plane strain is per unit of thickness, and a sheet has one thickness.",
            );
        }
    }
    match theory {
        Theory::PlaneStrain => Analysis::PlaneStrain {},
        Theory::PlaneStress => Analysis::PlaneStress {
            thickness: first.unwrap_or(1.0),
        },
        Theory::Axisymmetric => Analysis::Axisymmetric {},
    }
}

/// The rule of the quadrilaterals; where there are none that of the triangles, which Abaqus and CalculiX
/// integrate with three points. In a mixed mesh triangles get the larger rule, which is at least as accurate but
/// not the same.
fn quadrature(deck: &mut Deck) -> u32 {
    if deck.types.iter().all(ElementType::is_triangle) {
        return 2;
    }
    deck.types.retain(|kind| !kind.is_triangle());
    let reduced = deck.types.iter().filter(|kind| kind.reduced).count();
    if reduced != 0 && reduced != deck.types.len() {
        deck.doubt(
            0,
            "elements of full and of reduced integration",
            "one kind of integration",
            "Remove the R from the element types.",
        );
    }
    if reduced > 0 { 2 } else { 3 }
}

fn materials(deck: &mut Deck) -> Vec<Material> {
    let mut materials = Vec::new();
    let (sections, known) = (
        mem::take(&mut deck.sections),
        mem::take(&mut deck.materials),
    );
    // a material is reported once, however many sections have it
    let mut told = BTreeSet::new();
    for section in &sections {
        let Some(elastic) = known.get(&section.material) else {
            if !deck.incomplete.names && told.insert(&section.material) {
                let got = format!("the material `{:.60}`", section.material);
                deck.doubt(
                    section.line,
                    got,
                    "a *MATERIAL with *ELASTIC",
                    "Define the material.",
                );
            }
            continue;
        };
        match material(section, elastic) {
            Some(material) => materials.push(material),
            None if elastic.unreadable || !told.insert(&section.material) => {}
            None => {
                let got = match elastic.values.len() {
                    count @ ..=MOST_CONSTANTS => format!("{count} elastic constants"),
                    _ => format!("more than {MOST_CONSTANTS} elastic constants"),
                };
                deck.doubt(
                    elastic.line,
                    got,
                    "E, ν; or E1, E2, E3, ν12, ν13, ν23, G12, G13, G23; at one temperature",
                    "Correct the constants.",
                );
            }
        }
    }
    materials
}

fn material(section: &Section, elastic: &Elastic) -> Option<Material> {
    // a temperature may follow
    let elasticity = match (elastic.engineering_constants, &elastic.values[..]) {
        (false, [e, nu] | [e, nu, _]) => Elasticity::Isotropic {
            youngs_modulus: *e,
            poissons_ratio: *nu,
        },
        (
            true,
            [e1, e2, e3, nu12, nu13, nu23, g12, _, _]
            | [e1, e2, e3, nu12, nu13, nu23, g12, _, _, _],
        ) => Elasticity::Orthotropic(Orthotropic {
            e1: *e1,
            e2: *e2,
            nu12: *nu12,
            g12: *g12,
            angle: 0.0,
            e3: Some(*e3),
            nu13: Some(*nu13),
            nu23: Some(*nu23),
        }),
        _ => return None,
    };
    Some(Material {
        elasticity,
        group: Some(section.elements.to_string()),
        name: Some(section.material.to_string()),
    })
}

/// One support for each row; a later row for the same nodes and component replaces the earlier one.
fn supports(deck: &Deck) -> Vec<Support> {
    let mut supports: Vec<Support> = Vec::new();
    let mut places: HashMap<String, usize> = HashMap::new();
    for row in &deck.prescribed {
        let nodes = Deck::name_of(&row.target, None);
        let place = *places.entry(nodes).or_insert_with_key(|nodes| {
            supports.push(Support {
                nodes: Some(nodes.clone()),
                ..Support::default()
            });
            supports.len() - 1
        });
        let value = Some(BoundaryValue::Constant(row.value));
        let (first, last) = row.components;
        if first == 1 {
            supports[place].ux = value;
        }
        if last == 2 {
            supports[place].uy = value;
        }
    }
    supports
}

fn loads(deck: &mut Deck, analysis: &Analysis) -> Vec<Load> {
    let mut loads: Vec<Load> = deck
        .pressures
        .iter()
        .map(|row| {
            let boundary = Deck::name_of(&row.target, row.side);
            Load::Pressure(boundary, BoundaryValue::Constant(row.value))
        })
        .collect();
    for row in deck.forces.clone() {
        if matches!(analysis, Analysis::Axisymmetric {}) {
            deck.doubt(
                row.line,
                "*CLOAD on a body of revolution",
                "a pressure",
                "Programs differ in the part of the ring that the force acts on.",
            );
        }
        let force = if row.component == 1 {
            [row.value, 0.0]
        } else {
            [0.0, row.value]
        };
        loads.push(Load::Force(Deck::name_of(&row.target, None), force));
    }
    loads
}
