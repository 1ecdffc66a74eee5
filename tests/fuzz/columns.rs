//! Fields as they are stored: any come back bit for bit, and no change of their bytes makes decoding panic or take more
//! memory than it says before.

use std::io::{Read, Write};

use files::columns::{Law, decode, encode, memory_to_decode};
use flate2::{Compression, read::DeflateDecoder, write::DeflateEncoder};
use proptest::prelude::*;
use solver::{
    element::Element,
    solution::{Fields, GaussFields},
};

use super::attack;

/// Numbers that are easily lost.
const EDGES: [f64; 12] = [
    0.0,
    -0.0,
    5e-324,
    -5e-324,
    f64::MIN_POSITIVE,
    -f64::MIN_POSITIVE / 3.0,
    f64::MAX,
    f64::MIN,
    f64::INFINITY,
    f64::NAN,
    1.0,
    -1.0 - f64::EPSILON,
];

/// The numbers of a column: all the same, a ramp, edges, or any bits.
fn column(random: &mut fastrand::Rng, length: usize) -> Vec<f64> {
    let (kind, from) = (random.u8(..4), random.f64() - 0.5);
    let number = |place| match kind {
        0 => 0.0,
        1 => from + 1e-3 * place as f64,
        2 => EDGES[random.usize(..EDGES.len())],
        _ => f64::from_bits(random.u64(..)),
    };
    (0..length).map(number).collect()
}

/// Some fields with a law: their numbers follow from `seed`.
fn fields(nodes: usize, elements: usize, order: u32, seed: u64) -> (Fields, Law) {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut element = || {
        let mut node = || random.u32(..nodes as u32);
        let own = std::array::from_fn(|_| node());
        match node() % 2 {
            0 => Element::Quad(own),
            _ => Element::Triangle(std::array::from_fn(|i| own[i])),
        }
    };
    let elements: Vec<Element> = (0..elements).map(|_| element()).collect();
    let points = elements.iter().map(|e| e.family().rule(order).len()).sum();
    let states = (0..nodes).map(|_| random.i8(..)).collect();
    let moduli = (0..random.usize(..4)).map(|_| column(&mut random, 16));
    let moduli = moduli.map(|m| std::array::from_fn(|i| std::array::from_fn(|j| m[4 * i + j])));
    let moduli = moduli.collect();
    let axisymmetric = random.bool();
    let mut at_nodes = || column(&mut random, nodes);
    let mut fields = Fields {
        x: at_nodes(),
        y: at_nodes(),
        ux: at_nodes(),
        uy: at_nodes(),
        stress_xx: at_nodes(),
        stress_yy: at_nodes(),
        stress_xy: at_nodes(),
        stress_zz: at_nodes(),
        contact_state: states,
        ..Fields::default()
    };
    fields.element_error = column(&mut random, elements.len());
    fields.elements = elements;
    let mut at_points = || column(&mut random, points);
    fields.gauss = GaussFields {
        order,
        x: at_points(),
        y: at_points(),
        stress_xx: at_points(),
        stress_yy: at_points(),
        stress_xy: at_points(),
        stress_zz: at_points(),
    };
    let law = Law {
        axisymmetric,
        moduli,
    };
    (fields, law)
}

/// All numbers of fields, by their bits.
fn bits(fields: &Fields) -> Vec<Vec<u64>> {
    let (f, g) = (fields, &fields.gauss);
    let nodal = [
        &f.x,
        &f.y,
        &f.ux,
        &f.uy,
        &f.stress_xx,
        &f.stress_yy,
        &f.stress_xy,
        &f.stress_zz,
    ];
    let at_points = [
        &g.x,
        &g.y,
        &g.stress_xx,
        &g.stress_yy,
        &g.stress_xy,
        &g.stress_zz,
    ];
    let columns = nodal.into_iter().chain(at_points).chain([&f.element_error]);
    columns
        .map(|column| column.iter().map(|number| number.to_bits()).collect())
        .collect()
}

/// Decodes within the memory that the head says, and that the size of the JSON allows.
fn decoded(stored: &[u8], json_bytes: usize) -> Result<Fields, String> {
    let told = memory_to_decode(stored).unwrap_or(0);
    let most = told.min(6 * json_bytes + (512 << 10));
    let before = allocator::held();
    allocator::forget_highest();
    let read = decode(stored, json_bytes);
    let took = allocator::highest() - before;
    assert!(
        took <= most as i64 + 4096,
        "{took} bytes in place of {most}"
    );
    read
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    #[test]
    fn any_fields_come_back_bit_for_bit(
        nodes in 1usize..60, elements in 0usize..20, order in prop_oneof![0u32..5, any::<u32>()], seed in any::<u64>(),
    ) {
        let (fields, law) = fields(nodes, elements, order, seed);
        let json_bytes = serde_json::to_vec(&fields).unwrap().len();
        let read = decoded(&encode(&fields, &law).unwrap(), json_bytes).unwrap();
        prop_assert_eq!(bits(&read), bits(&fields));
        prop_assert_eq!(&read.elements, &fields.elements);
        prop_assert_eq!(&read.contact_state, &fields.contact_state);
        prop_assert_eq!(read.gauss.order, fields.gauss.order);
    }
}

/// What is reserved for decoding is kept from others meanwhile.
#[test]
fn decoding_takes_about_the_memory_that_it_says() {
    for order in [2, 3] {
        let (fields, law) = fields(3000, 1000, order, 7);
        let json_bytes = serde_json::to_vec(&fields).unwrap().len();
        let stored = encode(&fields, &law).unwrap();
        let told = memory_to_decode(&stored).unwrap();
        let before = allocator::held();
        decoded(&stored, json_bytes).unwrap();
        let took = (allocator::highest() - before) as usize;
        assert!(told < 2 * took, "{took} of {told} bytes");
    }
}

#[test]
fn changed_columns_are_read_or_refused() {
    let seeds = seeds();
    let words = ["\0\0\0\0\0\0\0\0\0", "\x01", "\x02", "\u{7f}"];
    attack("columns", seeds.clone(), &words, 20_000, kind);
    // changes of what was deflated would nearly all be refused as that
    let contents = seeds.iter().map(|stored| content(stored)).collect();
    attack("columns-content", contents, &words, 40_000, |content| {
        kind(&stored(content))
    });
}

fn seeds() -> Vec<Vec<u8>> {
    let shapes = [
        (8, 0, 3),
        (8, 1, 3),
        (12, 3, 2),
        (30, 8, 3),
        (20, 5, 1),
        (40, 12, 2),
    ];
    let made = (0..).zip(shapes);
    made.map(|(seed, (nodes, elements, order))| {
        let (fields, law) = fields(nodes, elements, order, seed);
        encode(&fields, &law).unwrap()
    })
    .collect()
}

fn kind(stored: &[u8]) -> String {
    match decoded(stored, 64 << 10) {
        Ok(fields) => {
            // whatever they are, they are fields
            encode(&fields, &Law::default()).unwrap();
            let all_zero = |column: &&Vec<u64>| column.iter().all(|bits| *bits == 0);
            let zeros = bits(&fields).iter().filter(all_zero).count();
            let order = fields.gauss.order.min(4);
            let counts = [fields.x.len(), fields.elements.len(), zeros];
            format!("{counts:?} of order {order}")
        }
        Err(error) => error.chars().filter(|c| !c.is_ascii_digit()).collect(),
    }
}

/// Sizes (two bytes each: nodes, elements, points, bytes that are kept as they are), then all that is stored, inflated.
fn content(stored: &[u8]) -> Vec<u8> {
    let mut rest = &stored[1..];
    let mut size = || {
        let mut size = 0usize;
        for shift in (0..).step_by(7) {
            let byte = rest[0];
            rest = &rest[1..];
            size |= usize::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                break;
            }
        }
        size
    };
    let [nodes, elements, points, random, _] = std::array::from_fn(|_| size());
    let mut all: Vec<u8> = [nodes, elements, points, random]
        .iter()
        .flat_map(|size| (*size as u16).to_le_bytes())
        .collect();
    let (random, deflated) = rest.split_at(random);
    all.extend(random);
    DeflateDecoder::new(deflated).read_to_end(&mut all).unwrap();
    all
}

/// The other way round: the sizes always fit the content, which may have been changed.
fn stored(content: &[u8]) -> Vec<u8> {
    let (sizes, content) = content.split_at(content.len().min(8));
    let mut size = [0; 4];
    for (size, bytes) in size.iter_mut().zip(sizes.chunks_exact(2)) {
        *size = usize::from(u16::from_le_bytes([bytes[0], bytes[1]]));
    }
    size[3] = size[3].min(content.len());
    let (random, stream) = content.split_at(size[3]);
    let mut stored = vec![1];
    for mut size in size.into_iter().chain([stream.len()]) {
        while size >= 0x80 {
            stored.push(size as u8 | 0x80);
            size >>= 7;
        }
        stored.push(size as u8);
    }
    stored.extend(random);
    let mut deflate = DeflateEncoder::new(stored, Compression::none());
    deflate.write_all(stream).unwrap();
    deflate.finish().unwrap()
}
