//! Tests that fields stored by every version of the format are still read bit for bit.
#![allow(clippy::unwrap_used)]

use flate2::Crc;
use solver::{elasticity::isotropic, problem::Analysis};

use super::*;
use mechanics::Known;

/// A stored file: its name, its bytes, and the checksum of its fields as JSON.
type Stored = (&'static str, &'static [u8], u32);

macro_rules! stored {
    ($name:literal, $sum:literal) => {
        (
            $name,
            include_bytes!(concat!("version_1/", $name, ".bin")),
            $sum,
        )
    };
}

const VERSION_1: [Stored; 7] = [
    stored!("axisymmetric", 0x1d42_b3d7),
    stored!("plane_stress", 0x18cc_ff46),
    stored!("both_families", 0x5aab_c028),
    stored!("two_points", 0x22d6_8890),
    stored!("two_materials", 0x0508_3703),
    stored!("not_predicted", 0x9fa8_d614),
    stored!("extremes", 0xb9eb_23f1),
];

#[test]
fn fields_stored_by_version_1_are_read_bit_for_bit() {
    for (name, bytes, sum) in VERSION_1 {
        let read = decode(bytes, 1 << 20);
        assert!(
            read.is_ok_and(|read| checksum(&read) == sum),
            "{name}: results that are stored would be reported as damaged. A prediction has changed, by a rounding at least: \
             files/src/columns (mechanics, order, version_1). Undo that; or give the new formulas another version, with files \
             of its own, and have `decode` read both."
        );
    }
}

/// A checksum of fields as JSON: numbers with different bits, also 0 and −0, have different digits.
fn checksum(fields: &Fields) -> u32 {
    let mut sum = Crc::new();
    sum.update(&serde_json::to_vec(fields).unwrap());
    sum.sum()
}

/// Fields of every kind are decoded as they were encoded. If SIGNORINI_STORED_FOLDER names a folder, the test also
/// writes the encoded fields there, for a new version, and prints their checksums.
#[test]
fn fields_of_every_kind_come_back() {
    let folder = std::env::var("SIGNORINI_STORED_FOLDER").ok();
    for (name, fields, law) in of_every_kind() {
        let bytes = encode(&fields, &law).unwrap();
        let (read, sum) = (decode(&bytes, 1 << 20).unwrap(), checksum(&fields));
        assert_eq!(checksum(&read), sum, "{name}");
        if let Some(folder) = &folder {
            std::fs::write(format!("{folder}/{name}.bin"), bytes).unwrap();
            println!("stored!(\"{name}\", 0x{sum:08x}),");
        }
    }
}

/// Fields of all kinds that the format distinguishes.
fn of_every_kind() -> Vec<(&'static str, Fields, Law)> {
    let plane = Law {
        axisymmetric: false,
        moduli: vec![isotropic(&Analysis::PlaneStrain {}, 1000.0, 0.3)],
    };
    let ring = Law {
        axisymmetric: true,
        moduli: vec![isotropic(&Analysis::Axisymmetric {}, 210e9, 0.28)],
    };
    let sheet = Law {
        axisymmetric: false,
        moduli: vec![isotropic(
            &Analysis::PlaneStress { thickness: 2.0 },
            70.0,
            0.33,
        )],
    };
    let mut two = plane.clone();
    two.moduli
        .push(isotropic(&Analysis::PlaneStrain {}, 3.0, 0.45));
    let mixed = [true, false, false];
    vec![
        (
            "axisymmetric",
            near(lattice(3, &[false], 3, 0.0), &ring),
            ring,
        ),
        (
            "plane_stress",
            near(lattice(3, &[false], 3, 0.02), &sheet),
            sheet,
        ),
        (
            "both_families",
            near(lattice(3, &mixed, 3, 0.03), &plane),
            plane.clone(),
        ),
        (
            "two_points",
            near(lattice(3, &mixed, 2, 0.03), &plane),
            plane.clone(),
        ),
        (
            "two_materials",
            near(lattice(3, &mixed, 3, 0.03), &two),
            two,
        ),
        (
            "not_predicted",
            anything(lattice(1, &mixed, 3, 0.03), &random),
            plane.clone(),
        ),
        (
            "extremes",
            anything(lattice(2, &mixed, 3, 0.03), &extreme),
            plane,
        ),
    ]
}

/// A mesh of this many cells along x and two along y, each a quadrilateral or two triangles in turn, with curved sides.
fn lattice(cells: u32, split: &[bool], order: u32, curved: f64) -> Fields {
    let mut fields = Fields::default();
    let width = 2 * cells + 1;
    for (b, a) in (0..5).flat_map(|b| (0..width).map(move |a| (f64::from(b), f64::from(a)))) {
        let (x, y) = (1.0 + 0.5 * a + curved * a * b, 0.4 * b + curved * a * a);
        fields.x.push(x);
        fields.y.push(y);
        fields.ux.push(1e-3 * (x * y + 0.3 * x * x));
        fields.uy.push(-2e-3 * (y * y - 0.7 * x * y + 0.1 * x));
        fields
            .contact_state
            .push(if b < 4.0 { -1 } else { (a % 3.0) as i8 });
    }
    let cells = (0..2).flat_map(|j| (0..cells).map(move |i| (i, j)));
    for ((i, j), split) in cells.zip(split.iter().cycle()) {
        let node = |a: u32, b: u32| (2 * j + b) * width + 2 * i + a;
        let sides = [node(0, 0), node(2, 0), node(2, 2), node(0, 2)];
        let [bottom, right, top, left] = [node(1, 0), node(2, 1), node(1, 2), node(0, 1)];
        let [a, b, c, d] = sides;
        if *split {
            fields.elements.extend([
                Element::Triangle([a, b, c, bottom, right, node(1, 1)]),
                Element::Triangle([a, c, d, node(1, 1), top, left]),
            ])
        } else {
            fields
                .elements
                .push(Element::Quad([a, b, c, d, bottom, right, top, left]))
        }
    }
    fields.element_error = (0..fields.elements.len())
        .map(|e| 0.01 / (e + 1) as f64)
        .collect();
    fields.gauss.order = order;
    fields
}

/// Fields with stresses near the predicted ones, of each material of the law in turn.
fn near(mut fields: Fields, law: &Law) -> Fields {
    let materials: Vec<u8> = (0..fields.elements.len())
        .map(|e| (e % law.moduli.len()) as u8)
        .collect();
    let predicted = predicted_stresses(&Known::of(&fields), law, &materials);
    let mut place = 0u64;
    let mut near = |column: Vec<f64>| -> Vec<f64> {
        let moved = |value: f64| {
            place += 1;
            f64::from_bits(value.to_bits() ^ (mixed_up(place) & 3))
        };
        column.into_iter().map(moved).collect()
    };
    [fields.gauss.x, fields.gauss.y] = predicted.points.map(&mut near);
    let gauss = &mut fields.gauss;
    [
        gauss.stress_xx,
        gauss.stress_yy,
        gauss.stress_xy,
        gauss.stress_zz,
    ] = predicted.at_points.map(&mut near);
    [
        fields.stress_xx,
        fields.stress_yy,
        fields.stress_xy,
        fields.stress_zz,
    ] = predicted.at_nodes.map(&mut near);
    fields
}

/// Fields with unrelated numbers, except for the places.
fn anything(mut fields: Fields, number: &dyn Fn(u64) -> f64) -> Fields {
    let nodes = fields.x.len();
    let points = fields
        .elements
        .iter()
        .map(|e| e.family().rule(fields.gauss.order).len())
        .sum();
    let mut place = 0u64;
    let mut column = |length: usize| -> Vec<f64> {
        place += 1000;
        (place..).take(length).map(number).collect()
    };
    (fields.ux, fields.uy) = (column(nodes), column(nodes));
    (fields.stress_xx, fields.stress_yy) = (column(nodes), column(nodes));
    (fields.stress_xy, fields.stress_zz) = (column(nodes), column(nodes));
    fields.element_error = column(fields.elements.len());
    let gauss = &mut fields.gauss;
    (gauss.x, gauss.y) = (column(points), column(points));
    (gauss.stress_xx, gauss.stress_yy) = (column(points), column(points));
    (gauss.stress_xy, gauss.stress_zz) = (column(points), column(points));
    fields
}

fn random(place: u64) -> f64 {
    mixed_up(place) as f64 * 1e-19 - 1.0
}

fn extreme(place: u64) -> f64 {
    const ALL: [f64; 10] = [
        0.0,
        -0.0,
        5e-324,
        -5e-324,
        f64::MIN_POSITIVE,
        -f64::MIN_POSITIVE / 3.0,
        f64::MAX,
        f64::MIN,
        f64::EPSILON,
        1e300,
    ];
    ALL[(mixed_up(place) % 10) as usize]
}

/// A number whose bits are well mixed (the end of SplitMix64).
fn mixed_up(number: u64) -> u64 {
    let mut mixed = number.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ (mixed >> 31)
}
