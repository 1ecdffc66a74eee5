#![allow(clippy::unwrap_used)]

use solver::problem::Problem;

use super::*;
use crate::fields::tests::mixed;

/// A problem of this kind on a grid, with the given materials and mesh.
fn problem(kind: &str, materials: &str, mesh: &str) -> Problem {
    let text = format!(
        r#"{{"analysis": {{"kind": "{kind}"}}, "mesh": {mesh}, "materials": {materials},
            "supports": [{{"boundary": "left", "ux": 0}}, {{"boundary": "bottom", "ux": 0, "uy": 0}}],
            "contacts": [{{"boundary": "top", "obstacle": {{"kind": "flat", "from": 0, "to": 0.5}}, "indentation": 0.1,
                "friction": {{"coefficient": 0.3, "nonlocal_radius": 0.2, "elastic_slip": 1e-3}}}}]}}"#
    );
    crate::parse(&text).unwrap()
}

const GRID: &str = r#"{"grid": {"x": [0, 0.1, 0.25, 0.5, 0.8, 1.3, 2], "y": [-2, -1.2, -0.7, -0.3, -0.1, 0]}, "refine": 1}"#;
const ONE: &str = r#"[{"youngs_modulus": 1000, "poissons_ratio": 0.3}]"#;

fn solved(problem: &Problem) -> Fields {
    let solution = solver::solve(problem, &mut ());
    solution.unwrap().fields
}

fn bits(fields: &Fields) -> Vec<u8> {
    // shortest digits come back as the same number, and -0.0 differs from 0.0
    serde_json::to_vec(fields).unwrap()
}

/// The number of bytes for each number of a nodal column; checks that the fields are restored exactly.
fn checked(fields: &Fields, law: &Law) -> usize {
    let encoded = encode(fields, law).unwrap();
    let decoded = decode(&encoded, 1 << 20).unwrap();
    assert_eq!(&decoded, fields);
    assert_eq!(bits(&decoded), bits(fields));
    encoded.len()
}

#[test]
fn fields_come_back_bit_for_bit_in_a_tenth_of_their_json() {
    for kind in ["plane_strain", "axisymmetric"] {
        let problem = problem(kind, ONE, GRID);
        let fields = solved(&problem);
        let bytes = checked(&fields, &Law::of(&problem));
        let json = bits(&fields).len();
        assert!(bytes * 10 < json, "{kind}: {bytes} of {json} bytes");
    }
}

#[test]
fn fields_come_back_whatever_the_prediction_is_worth() {
    let materials = [
        // nearly incompressible: the solver takes other elements
        r#"[{"youngs_modulus": 1000, "poissons_ratio": 0.4999}]"#,
        r#"[{"orthotropic": {"e1": 900, "e2": 300, "nu12": 0.2, "g12": 150, "angle": 30, "e3": 300, "nu13": 0.2, "nu23": 0.3}}]"#,
    ];
    for material in materials {
        let problem = problem("plane_strain", material, GRID);
        let fields = solved(&problem);
        checked(&fields, &Law::of(&problem));
        checked(&fields, &Law::default());
        let other = Law {
            axisymmetric: true,
            moduli: vec![[[f64::NAN; 4]; 4], [[1e308; 4]; 4]],
        };
        checked(&fields, &other);
    }
}

#[test]
fn the_material_of_an_element_is_found_from_its_stresses() {
    let materials = r#"[{"youngs_modulus": 1000, "poissons_ratio": 0.3}, {"youngs_modulus": 10, "poissons_ratio": 0.2, "group": "soft"}]"#;
    let mesh = r#"{"grid": {"x": [0, 0.5, 1, 2], "y": [-2, -1, -0.5, 0]}, "groups": {"soft": {"y": [-2, -1]}}}"#;
    let problem = problem("plane_strain", materials, mesh);
    let (fields, law) = (solved(&problem), Law::of(&problem));
    assert_eq!(law.moduli.len(), 2);
    let numbers = mechanics::materials_by_element(&fields, &law);
    assert!(numbers.contains(&0) && numbers.contains(&1), "{numbers:?}");
    let (of_both, of_one) = (
        checked(&fields, &law),
        checked(
            &fields,
            &Law {
                moduli: law.moduli[..1].to_vec(),
                ..law
            },
        ),
    );
    assert!(of_both < of_one, "{of_both} and {of_one} bytes");
}

#[test]
fn both_families_of_elements_and_made_up_stresses_come_back() {
    checked(&mixed(), &Law::default());
    let mut empty = Fields::default();
    empty.gauss.order = 3;
    checked(&empty, &Law::default());
    let mut strange = mixed();
    strange.ux[3] = -0.0;
    strange.uy[5] = f64::MIN_POSITIVE / 4.0;
    strange.gauss.stress_xx[7] = -f64::MAX;
    checked(
        &strange,
        &Law {
            axisymmetric: true,
            moduli: vec![[[1.0; 4]; 4]],
        },
    );
    let mut short = mixed();
    short.gauss.x.pop();
    assert!(encode(&short, &Law::default()).is_err());
}

#[test]
fn damaged_bytes_are_an_error_or_other_numbers_and_never_a_panic() {
    let whole = encode(
        &mixed(),
        &Law {
            axisymmetric: false,
            moduli: vec![[[1.0; 4]; 4]],
        },
    )
    .unwrap();
    for length in 0..whole.len() {
        // the last bits of a deflated stream only say that it ends
        let cut = decode(&whole[..length], 1 << 16);
        assert!(cut.is_err() || cut.unwrap() == mixed(), "{length}");
    }
    for place in 0..whole.len() {
        for change in [1u8, 0x80, 0xff] {
            let mut changed = whole.clone();
            changed[place] ^= change;
            let _ = decode(&changed, 1 << 16);
        }
    }
    let error = decode(&[9, 0, 0], 1 << 16).unwrap_err();
    assert!(error.contains("version 9"), "{error}");
    assert!(decode(&whole, 100).unwrap_err().contains("larger"));
    assert!(decode(&whole, usize::MAX).is_ok());
}

#[test]
fn counts_that_cannot_be_those_of_the_json_are_refused_before_they_take_memory() {
    // a terabyte, which would end the process; the JSON has 10 MB
    for [nodes, elements] in [[1 << 35, 0], [1, 1 << 30], [300_000, 0], [0, 50_000]] {
        let bytes = Writer::new().finish([nodes, elements, 9 * elements]);
        let error = decode(&bytes, 10_000_000).unwrap_err();
        assert!(error.contains("larger"), "{error}");
    }
}

#[test]
fn as_many_materials_as_are_stored_and_no_more() {
    let law = |materials: usize| Law {
        axisymmetric: false,
        moduli: vec![[[1.0; 4]; 4]; materials],
    };
    checked(&mixed(), &law(mechanics::MOST_MATERIALS));
    assert!(encode(&mixed(), &law(mechanics::MOST_MATERIALS + 1)).is_err());
}
