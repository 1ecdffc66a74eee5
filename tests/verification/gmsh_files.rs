//! Meshes that Gmsh itself has written (`tests/data/gmsh`, with the script that made them): every
//! family of elements in every form of the format.

use std::collections::BTreeMap;

use files::gmsh;
use serde_json::{Value, json};
use solver::element::Family;
use solver::mesh::Mesh;
use solver::problem::Problem;

use crate::record::held;
use crate::support::{problem, quiet};

const FAMILIES: [&str; 3] = ["quad8", "tri6", "mixed"];
const FORMS: [&str; 4] = ["msh22-ascii", "msh22-binary", "msh41-ascii", "msh41-binary"];

fn bytes(name: &str) -> Vec<u8> {
    let path = format!("{}/data/gmsh/{name}.msh", env!("CARGO_MANIFEST_DIR"));
    std::fs::read(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

fn read(name: &str) -> (Mesh, Vec<&'static str>) {
    let (mesh, notes) =
        gmsh::read(&bytes(name)[..]).unwrap_or_else(|error| panic!("{name}: {error:#?}"));
    (
        mesh,
        notes.into_iter().map(|note| note.code.as_str()).collect(),
    )
}

fn area(mesh: &Mesh) -> f64 {
    let of_element = |element: &solver::element::Element| {
        let (family, nodes) = (element.family(), mesh.element_nodes(element));
        let points = family.rule(3).iter();
        points
            .map(|p| p.weight * family.map(&nodes, p.place).det)
            .sum::<f64>()
    };
    mesh.elements.iter().map(of_element).sum()
}

/// Four forms of one mesh are one mesh; its area is that of the drawing (the parabola through the three
/// nodes of a side is off a quarter circle by some 1e-5 of it), its boundaries are as long as drawn.
#[test]
fn every_form_of_a_file_has_the_same_mesh() {
    // 2 × 2 and 2 × 1, and the corner that the fillet fills
    let radius: f64 = 0.5;
    let drawn = 6.0 + radius * radius * (1.0 - std::f64::consts::FRAC_PI_4);
    for (geometry, exact, allowed) in [("fillet", drawn, 3e-5), ("sheet", 3.5, 1e-12)] {
        for family in FAMILIES {
            let meshes = FORMS.map(|form| read(&format!("{geometry}-{family}-{form}")));
            for ((mesh, notes), form) in meshes.iter().zip(FORMS) {
                let name = format!("{geometry}-{family}-{form}");
                held(
                    0,
                    &format!("{name}: area"),
                    "written by Gmsh",
                    area(mesh),
                    exact,
                    allowed,
                );
                let quads = mesh
                    .elements
                    .iter()
                    .filter(|e| e.family() == Family::Quad)
                    .count();
                let all = mesh.elements.len();
                match family {
                    "quad8" => assert_eq!(quads, all, "{name}"),
                    "tri6" => assert_eq!(quads, 0, "{name}"),
                    _ => assert!(0 < quads && quads < all, "{name}"),
                }
                assert_eq!(mesh.connected_parts().len(), 1);
                if geometry == "fillet" {
                    let names: Vec<&String> = mesh.boundaries.keys().collect();
                    assert_eq!(names, ["bottom", "fillet", "left", "right end", "top"]);
                    assert_eq!(mesh.groups.keys().collect::<Vec<_>>(), ["thick", "thin"]);
                    assert_eq!(mesh.groups.values().map(Vec::len).sum::<usize>(), all);
                    assert_eq!(mesh.nodes[mesh.node_sets["corner"][0] as usize], [0.0, 0.0]);
                    // the seam lies inside
                    assert_eq!(notes, &["lines_inside"], "{name}");
                    for node in mesh.boundaries["fillet"].iter().flatten() {
                        let [x, y] = mesh.nodes[*node as usize];
                        assert!(((x - 2.5).hypot(y - 1.5) - radius).abs() < 1e-12);
                    }
                }
            }
            let [(a, _), (b, _), (c, _), (d, _)] = meshes;
            // Gmsh writes 16 digits in ASCII
            let near = |p: &Vec<[f64; 2]>, q: &Vec<[f64; 2]>| {
                let close = |(p, q): (&[f64; 2], &[f64; 2])| {
                    (p[0] - q[0]).abs() < 1e-14 && (p[1] - q[1]).abs() < 1e-14
                };
                p.len() == q.len() && p.iter().zip(q).all(close)
            };
            for (ascii, binary) in [(&a, &b), (&c, &d)] {
                assert!(near(&ascii.nodes, &binary.nodes), "{geometry}-{family}");
                assert_eq!(ascii.elements, binary.elements, "{geometry}-{family}");
                assert_eq!(ascii.boundaries, binary.boundaries, "{geometry}-{family}");
            }
            // 2.2 and 4.1 number the nodes differently
            let sums = [&a, &c].map(|mesh| {
                let sum = |axis: usize| mesh.nodes.iter().map(|x| x[axis]).sum::<f64>();
                [sum(0), sum(1)]
            });
            assert_eq!(a.nodes.len(), c.nodes.len());
            for axis in 0..2 {
                assert!(
                    (sums[0][axis] - sums[1][axis]).abs() < 1e-10,
                    "{geometry}-{family}"
                );
            }
        }
    }
}

/// Gmsh's MSH 2.2 repeats an element for each of its physical groups; it is one. In one group twice it is a fault.
#[test]
fn an_element_in_two_groups_is_one() {
    let square = |tags: [u32; 2], binary: bool| {
        let nodes = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let mut file = format!("$MeshFormat\n2.2 {} 8\n", u8::from(binary)).into_bytes();
        if binary {
            file.extend(1i32.to_le_bytes());
            file.extend(b"\n");
        }
        file.extend(b"$EndMeshFormat\n$PhysicalNames\n2\n2 3 \"Steel\"\n2 4 \"All\"\n$EndPhysicalNames\n$Nodes\n4\n");
        for (k, [x, y]) in (1i32..).zip(nodes) {
            if binary {
                file.extend(k.to_le_bytes());
                file.extend([x, y, 0.0f64].iter().flat_map(|x| x.to_le_bytes()));
            } else {
                file.extend(format!("{k} {x} {y} 0\n").into_bytes());
            }
        }
        file.extend(b"$EndNodes\n$Elements\n2\n");
        for (k, tag) in (1u32..).zip(tags) {
            if binary {
                let row = [3, 1, 2, k, tag, 1, 1, 2, 3, 4];
                file.extend(row.iter().flat_map(|x| x.to_le_bytes()));
            } else {
                file.extend(format!("{k} 3 2 {tag} 1 1 2 3 4\n").into_bytes());
            }
        }
        file.extend(b"$EndElements\n");
        gmsh::read(&file[..])
    };
    for binary in [false, true] {
        let (mesh, _) = square([3, 4], binary).unwrap_or_else(|error| panic!("{error:?}"));
        assert_eq!(mesh.elements.len(), 1);
        assert_eq!(
            (&mesh.groups["Steel"], &mesh.groups["All"]),
            (&vec![0], &vec![0])
        );
        for tags in [[3, 3], [0, 0], [3, 0]] {
            assert!(square(tags, binary).is_err(), "{tags:?}");
        }
    }
}

/// Sections and line ends that other programs and versions write.
#[test]
fn comments_and_parametric_nodes_are_read() {
    let file = "$Comments\nby hand\n$EndComments\n$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Comments\nmore\n$EndComments\n\
        $PhysicalNames\n2\n1 1 \"F\u{fc}\u{df}e\"\n2 2 \"Body\"\n$EndPhysicalNames\n\
        $ParametricNodes\n4\n1 0 0 0 0 1\n2 1 0 0 1 1 0.5\n3 1 1 0 2 1 0.3 0.7\n4 0 1 0 3 1\n$EndParametricNodes\n\
        $Elements\n2\n1 1 2 1 1 1 2\n2 3 2 2 1 1 2 3 4\n$EndElements\n";
    let latin: Vec<u8> = file.chars().map(|c| c as u8).collect();
    let texts = [
        file.as_bytes().to_vec(),
        format!("\u{feff}{file}").into_bytes(),
        file.replace('\n', "\r\n").into_bytes(),
        file.replace('\n', "\r").into_bytes(),
        latin,
    ];
    for text in texts {
        let (format, mesh, _) =
            files::read_mesh(&text[..]).unwrap_or_else(|error| panic!("{error:?}"));
        assert_eq!((format, mesh.elements.len()), (files::MeshFormat::Gmsh, 1));
        assert_eq!(mesh.boundaries["Füße"].len(), 1);
    }
}

#[test]
fn centre_nodes_are_dropped_and_midsides_added() {
    let (mesh, notes) = read("fillet-quad9-msh22-ascii");
    assert_eq!(notes, ["centre_nodes_dropped", "lines_inside"]);
    assert_eq!(
        mesh.elements.len(),
        read("fillet-quad8-msh22-ascii").0.elements.len()
    );
    let (mesh, notes) = read("fillet-mixed1-msh41-ascii");
    assert_eq!(notes, ["raised_to_second_order", "lines_inside"]);
    // the fillet is a polygon now
    assert!((area(&mesh) - 6.0537).abs() > 1e-4 && (area(&mesh) - 6.0537).abs() < 0.02);
}

/// The mesh as it would be written out in a problem, its surface driven node by node.
fn driven(mesh: &Mesh, u: impl Fn([f64; 2]) -> [f64; 2]) -> Problem {
    let mut sets: BTreeMap<String, Vec<u32>> = BTreeMap::new();
    let mut supports: Vec<Value> = Vec::new();
    for node in mesh.surface().into_iter().flatten() {
        let name = node.to_string();
        if sets.insert(name.clone(), vec![node]).is_none() {
            let [ux, uy] = u(mesh.nodes[node as usize]);
            supports.push(json!({"nodes": name, "ux": ux, "uy": uy}));
        }
    }
    problem(
        &json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"inline": {"nodes": mesh.nodes, "elements": mesh.elements, "node_sets": sets}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": supports,
        })
        .to_string(),
    )
}

/// Patch test: a linear displacement on the surface, curved sides included, is one inside too.
#[test]
fn every_family_reproduces_constant_strain_on_the_curved_mesh() {
    let u = |[x, y]: [f64; 2]| [0.01 * x + 0.02 * y, 0.01 * x - 0.02 * y];
    for family in FAMILIES {
        let (mesh, _) = read(&format!("fillet-{family}-msh41-ascii"));
        let solution = solver::solve(&driven(&mesh, u), &mut quiet).unwrap();
        let fields = &solution.fields;
        let error = (0..fields.x.len())
            .map(|n| {
                let [ux, uy] = u([fields.x[n], fields.y[n]]);
                (fields.ux[n] - ux).abs().max((fields.uy[n] - uy).abs())
            })
            .fold(0.0, f64::max);
        let what = format!("patch test, {family} of a plate with a fillet: error of u");
        held(1, &what, "written by Gmsh", error, 0.0, 1e-12);
    }
}

fn on_file(file: &str) -> Value {
    let text = String::from_utf8(bytes(file)).unwrap();
    json!({"gmsh": text})
}

/// Contact on each family. The forces of three coarse meshes of one body agree to their own error.
#[test]
fn a_block_on_gmshs_plate_bears_the_same_on_every_family() {
    let forces: Vec<[f64; 2]> = FAMILIES
        .iter()
        .map(|family| {
            let mut mesh = on_file(&format!("fillet-{family}-msh22-ascii"));
            mesh["refine"] = json!(1);
            let text = suite::pressed(mesh).to_string();
            let summary = crate::support::solve(&problem(&text)).summary;
            assert!(summary.residuals.equilibrium < 1e-9);
            [summary.normal_force, summary.tangential_force]
        })
        .collect();
    for pair in forces.windows(2) {
        for k in 0..2 {
            assert!((pair[0][k] / pair[1][k] - 1.0).abs() < 0.02, "{forces:?}");
        }
    }
}

/// Hertz's cylinder on unstructured triangles: from the load found, half-width and peak pressure follow,
/// a = √(4PR/πE*), p₀ = √(PE*/πR), and p = p₀ √(1 − x²/a²).
#[test]
fn hertz_on_an_unstructured_mesh_of_triangles() {
    let (mesh, notes) = read("hertz-tri6-msh41-binary");
    // its outline runs clockwise, and so do its elements
    assert_eq!(notes, ["elements_reversed"]);
    let inline =
        json!({"nodes": mesh.nodes, "elements": mesh.elements, "boundaries": mesh.boundaries});
    let text = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"inline": inline},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "axis", "ux": 0}, {"boundary": "base", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "contact", "indentation": 0.2, "obstacle": {"kind": "parabola", "radius": 8}}],
    });
    let solution = crate::support::solve(&problem(&text.to_string()));
    let (modulus, radius, pi) = (1000.0 / 0.91, 8.0, std::f64::consts::PI);
    let load = 2.0 * solution.summary.normal_force;
    let half_width = f64::sqrt(4.0 * load * radius / (pi * modulus));
    let p0 = f64::sqrt(load * modulus / (pi * radius));
    let contact = &solution.summary.contacts["contact"];
    let peak = -contact.peak_normal_stress.unwrap().value;
    let what = format!("{} unstructured T6, h = .05", mesh.elements.len());
    held(
        9,
        "Hertz's cylinder on triangles: peak pressure",
        &what,
        peak,
        p0,
        1e-2,
    );
    let profile = &solution.node_profiles["contact"];
    let worst = (0..profile.x.len())
        .filter(|&i| profile.x[i] < 0.8 * half_width)
        .map(|i| {
            let exact = p0 * (1.0 - (profile.x[i] / half_width).powi(2)).sqrt();
            (-profile.normal_stress[i] - exact).abs() / p0
        })
        .fold(0.0, f64::max);
    held(
        9,
        "Hertz's cylinder on triangles: largest error of pressure within .8 a, of p₀",
        &what,
        worst,
        0.0,
        1e-2,
    );
    let [_, end] = contact.contact[0];
    assert!(
        (end - half_width).abs() < 0.05,
        "a = {end}, Hertz says {half_width}"
    );
}

/// Boundaries by rule where the file names none.
#[test]
fn boundaries_are_found_by_box_and_by_normal() {
    let mut mesh = on_file("fillet-tri6-msh41-ascii");
    mesh["boundaries"] = json!({
        "up": {"normal": [0, 1]},
        "step": {"normal": [0, 1], "box": [[2.4, 2], [4, 0.9]]},
        "round": {"normal": [1, 1], "angle": 50, "x": [2, 2.5], "y": [1, 1.5]},
        "low": {"y": [0, 0]},
    });
    let text = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": mesh,
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "low", "ux": 0, "uy": 0}],
    });
    let problem = problem(&text.to_string());
    let external = files::external_mesh(&problem, None);
    let model = solver::model::Model::new(&problem, external).unwrap();
    let length = |name: &str| -> f64 {
        let chord = |edge: &[u32; 3]| {
            let [[x0, y0], [x1, y1], _] = model.mesh.edge_nodes(edge);
            (x1 - x0).hypot(y1 - y0)
        };
        model.mesh.boundaries[name].iter().map(chord).sum()
    };
    for (name, exact) in [("up", 3.5), ("step", 1.5), ("low", 4.0)] {
        assert!(
            (length(name) - exact).abs() < 1e-12,
            "{name}: {}",
            length(name)
        );
    }
    assert_eq!(
        model.mesh.boundaries["round"].len(),
        model.mesh.boundaries["fillet"].len()
    );
}

/// The length of a boundary is that of its arcs: the fillet is a quarter of a circle of radius ½, whose sides are
/// parabolas; each is longer or shorter by less than 1e-4 of it, and its chord is shorter by more.
#[test]
fn lengths_of_boundaries_are_those_of_their_arcs() {
    let text = bytes("fillet-mixed-msh41-binary");
    let Ok(found) = gmsh::read(&text[..]) else {
        panic!("it is a good file");
    };
    let mesh = found.0;
    let length = |name: &str| -> f64 {
        let edges = mesh.boundaries[name].iter();
        edges
            .map(|edge| solver::contact::edge_length(&mesh, edge))
            .sum()
    };
    assert_eq!(length("top"), 2.0);
    let quarter = std::f64::consts::FRAC_PI_4;
    assert!(
        (length("fillet") / quarter - 1.0).abs() < 1e-4,
        "{}",
        length("fillet")
    );
    let chord = |edge: &[u32; 3]| {
        let [[x0, y0], [x1, y1], _] = mesh.edge_nodes(edge);
        (x1 - x0).hypot(y1 - y0)
    };
    let chords: f64 = mesh.boundaries["fillet"].iter().map(chord).sum();
    assert!(chords < (1.0 - 1e-3) * quarter, "{chords}");
}

/// A fault of a file is reported with its line, its numbers and what is expected.
#[test]
fn a_broken_file_is_refused_with_its_line() {
    let good = String::from_utf8(bytes("fillet-mixed-msh22-ascii")).unwrap();
    let reported = |text: &str| {
        let Err(files::ReadError::Invalid(list)) = gmsh::read(text.as_bytes()) else {
            panic!("a broken file was read");
        };
        format!("{}: {}; {}", list[0].reason, list[0].got, list[0].expected)
    };
    let line = |n: usize| good.lines().nth(n - 1).unwrap();
    let nodes = 1 + good.lines().position(|l| l == "$Nodes").unwrap();
    let third = line(nodes + 4);
    let broken = third.replacen(' ', " x", 1);
    assert_eq!(
        reported(&good.replacen(third, &broken, 1)),
        format!(
            "malformed: line {}: `{}`; x",
            nodes + 4,
            broken.split(' ').nth(1).unwrap()
        )
    );
    assert!(
        reported(&good.replacen("2.2 0 8", "3.1 0 8", 1))
            .starts_with("unsupported: line 2: MSH 3.1; MSH 2.2 or 4.1")
    );
    assert!(reported(&good[..good.len() / 2]).starts_with("truncated"));
    assert!(reported("cube.geo").starts_with("malformed: line 1: `cube.geo`; $MeshFormat"));
    assert!(
        reported(&good.replacen(
            third,
            &third.replacen(" 0", " 7", 2).replace(" 07", " 7"),
            1
        ))
        .contains("z = ")
    );
    let elements = 1 + good.lines().position(|l| l == "$Elements").unwrap();
    let last = line(elements + 60);
    let stray = format!(
        "{} 99999",
        last.rsplit_once(' ').map_or("", |(start, _)| start)
    );
    assert!(
        reported(&good.replacen(last, &stray, 1)).contains("node 99999 in element"),
        "{stray}"
    );
    let mut three_d: Vec<&str> = last.split(' ').collect();
    three_d[1] = "11";
    assert!(reported(&good.replacen(last, &three_d.join(" "), 1)).contains("three dimensions"));
}
