//! Names, orders, sets and rules mean the first mesh, whatever its numbers, and refinement keeps them.

use std::collections::BTreeMap;
use std::fmt::Write;

use fastrand::Rng;
use serde_json::{Value, json};
use solver::error::{Reason, SolveError, Violation};
use solver::solution::{Fields, Solution};

use crate::support::{Lattice, close, problem, quiet, solve};

fn refined(mut text: Value, refine: Value) -> Value {
    text["mesh"]["refine"] = refine;
    text
}

fn solved(text: &Value) -> Solution {
    solve(&problem(&text.to_string()))
}

fn energy(solution: &Solution) -> f64 {
    solution.summary.strain_energy.unwrap()
}

fn violations(text: &Value) -> Vec<Violation> {
    let problem = problem(&text.to_string());
    let external = files::external_mesh(&problem, None);
    match solver::solve_on(&problem, external, &mut quiet) {
        Err(SolveError::Invalid(list)) => list,
        other => panic!("{other:?}"),
    }
}

/// A block of 2 × 1, of two elements of second order, on a rigid floor, with 4 downwards on each of the five nodes of its top.
fn pressed_by_nodes() -> Value {
    let deck = "*NODE\n1,0,0\n2,1,0\n3,2,0\n4,0,1\n5,1,1\n6,2,1\n11,.5,0\n12,1.5,0\n13,.5,1\n14,1.5,1\n15,0,.5\n16,1,.5\n17,2,.5\n\
        *ELEMENT,TYPE=CPE8,ELSET=B\n1,1,2,5,4,11,16,13,15\n2,2,3,6,5,12,17,14,16\n*NSET,NSET=TOP\n4,13,5,14,6\n*NSET,NSET=MID\n2,16,5\n\
        *SURFACE,NAME=SOLE\nB,S1\n";
    json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"abaqus": deck},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"nodes": "MID", "ux": 0}],
        "loads": [{"nodes": "TOP", "force": [0, -4]}],
        "contacts": [{"boundary": "SOLE", "obstacle": {"kind": "line", "point": [0, 0], "angle": 0}}]
    })
}

/// A force on a set acts on the nodes of the file: 5 × 4 on every mesh, refined uniformly, adaptively and to verify.
#[test]
fn forces_on_a_set_have_their_sum_on_every_mesh() {
    for refine in [
        json!(0),
        json!(1),
        json!(2),
        json!(3),
        json!({"tolerance": 0.05}),
    ] {
        for accuracy in ["estimate", "verify"] {
            let mut text = refined(pressed_by_nodes(), refine.clone());
            text["solver"] = json!({"accuracy": accuracy});
            let solution = solved(&text);
            close(solution.summary.normal_force, 20.0, 1e-10);
            let accuracy = solution.summary.accuracy.unwrap();
            for quantity in &accuracy.quantities {
                if let (Some(finer), Some("normal_force")) = (
                    quantity.finer,
                    serde_json::to_value(quantity.quantity).unwrap().as_str(),
                ) {
                    close(finer, 20.0, 1e-10);
                }
            }
        }
    }
}

/// A bar of one element, pulled by three nodes at its end with 10 each.
fn pulled_by_nodes(load: Value) -> Value {
    json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"inline": {
            "nodes": [[0,0],[1,0],[1,1],[0,1],[0.5,0],[1,0.5],[0.5,1],[0,0.5]],
            "elements": [[0,1,2,3,4,5,6,7]],
            "boundaries": {"west": [[3,0,7]], "east": [[1,2,5]]},
            "node_sets": {"end": [1,5,2], "low": [1], "middle": [5], "high": [2], "corners": [1,2]}}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0}],
        "supports": [{"boundary": "west", "un": 0}, {"boundary": "west", "ut": 0}],
        "loads": load
    })
}

/// What the west bears along x: the sum of the loads along x, from the displacements of the east of a bar without Poisson's
/// effect, E ∫ u_x dy / L with Simpson's rule on each side.
fn mean_pull(solution: &Solution) -> f64 {
    let f = &solution.fields;
    let mut pull = 0.0;
    for element in &f.elements {
        for [a, b, mid] in element.sides() {
            let at = |n: u32| (f.x[n as usize], f.y[n as usize], f.ux[n as usize]);
            let (a, b, mid) = (at(a), at(b), at(mid));
            if [a, b, mid].iter().all(|(x, ..)| (x - 1.0).abs() < 1e-12) {
                pull += (b.1 - a.1).abs() / 6.0 * (a.2 + 4.0 * mid.2 + b.2);
            }
        }
    }
    1000.0 * pull
}

/// Forces on all nodes of a side are a traction on it, on whatever mesh: the energy has a limit, which a point force's has
/// not, and the mean displacement is that of the sum. Set by set, node by node and from start to end it is one load.
#[test]
fn forces_on_all_nodes_of_a_side_have_a_limit() {
    let by_set = pulled_by_nodes(json!([{"nodes": "end", "force": [10, 0]}]));
    let by_node = ["low", "middle", "high"].map(|set| json!({"nodes": set, "force": [10, 0]}));
    let along = json!([{"boundary": "east", "nodal": [[10, 0], [10, 0], [10, 0]]}]);
    let others = [pulled_by_nodes(json!(by_node)), pulled_by_nodes(along)];
    let mut energies = Vec::new();
    for times in 0..5 {
        let solution = solved(&refined(by_set.clone(), json!(times)));
        close(mean_pull(&solution), 30.0, 1e-10);
        energies.push(energy(&solution));
        for other in &others {
            let other = solved(&refined(other.clone(), json!(times)));
            close(energy(&other), energy(&solution), 1e-12);
        }
    }
    let steps: Vec<f64> = energies.windows(2).map(|pair| pair[1] - pair[0]).collect();
    for pair in steps.windows(2) {
        assert!(pair[1] > 0.0 && pair[1] < 0.5 * pair[0], "{energies:?}");
    }
    close(energies[4], energies[3], 1e-3);
}

/// Forces at single nodes stay there: their sum is the same, and where they act the displacement grows by as much with each
/// refinement, without a limit.
#[test]
fn forces_on_single_nodes_stay_point_forces() {
    let text = pulled_by_nodes(json!([{"nodes": "corners", "force": [15, 0]}]));
    let end = |times: u32| {
        let solution = solved(&refined(text.clone(), json!(times)));
        close(mean_pull(&solution), 30.0, 1e-10);
        solution.fields.ux[1]
    };
    let u = [1, 2, 3, 4].map(end);
    let growth = [u[2] - u[1], u[3] - u[2]];
    assert!(
        growth[0] > 0.05 * u[0] && (growth[1] / growth[0] - 1.0).abs() < 0.1,
        "{u:?}"
    );
}

/// Forces that a uniform pressure puts on the nodes of an uneven boundary, a ring's too, are that pressure on every mesh.
#[test]
fn nodal_forces_of_a_pressure_are_the_pressure_on_every_mesh() {
    let (x, y) = ([1.0, 1.5, 3.0, 3.4], 2.0);
    for (analysis, ring) in [("plane_strain", false), ("axisymmetric", true)] {
        let mut forces = [0.0; 7];
        for k in 0..3 {
            let (a, b) = (x[k], x[k + 1]);
            let parts = match ring {
                true => [a / 6.0, (a + b) / 3.0, b / 6.0].map(|p| 2.0 * std::f64::consts::PI * p),
                false => [1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0],
            };
            (0..3).for_each(|i| forces[2 * k + i] += -5.0 * (b - a) * parts[i]);
        }
        let nodal: Vec<[f64; 2]> = forces.iter().map(|f| [0.0, *f]).collect();
        let text = |load: Value| {
            json!({
                "analysis": {"kind": analysis},
                "mesh": {"grid": {"x": x, "y": [0, y]}},
                "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
                "supports": [{"boundary": "left", "ux": 0}],
                "loads": [load],
                "contacts": [{"boundary": "bottom", "obstacle": {"kind": "parabola", "radius": 40, "center": 2}}]
            })
        };
        let by_node = text(json!({"boundary": "top", "nodal": nodal}));
        let by_pressure = text(json!({"boundary": "top", "pressure": 5}));
        for refine in [json!(0), json!(1), json!(2), json!({"tolerance": 0.1})] {
            let [by_node, by_pressure] =
                [&by_node, &by_pressure].map(|text| solved(&refined(text.clone(), refine.clone())));
            close(energy(&by_node), energy(&by_pressure), 1e-9);
            close(
                by_node.summary.normal_force,
                by_pressure.summary.normal_force,
                1e-10,
            );
            assert_eq!(
                by_node.summary.refinements.len(),
                by_pressure.summary.refinements.len()
            );
        }
        // as many forces as the boundary has nodes
        let short = by_node["loads"][0]["nodal"].as_array().unwrap()[..5].to_vec();
        let mut wrong = refined(by_node, json!({"tolerance": 0.1}));
        wrong["loads"][0]["nodal"] = json!(short);
        let list = violations(&wrong);
        assert_eq!(
            (list[0].reason, &list[0].got[..]),
            (Reason::WrongLength, "5 forces")
        );
        assert!(
            list[0].expected.starts_with("7, one for each node"),
            "{}",
            list[0].expected
        );
    }
}

/// A bar of elements with corners only; `load`, `hold`: the rows after *CLOAD and *BOUNDARY.
fn linear_bar(kind: &str, load: &str, hold: &str) -> String {
    let elements = match kind {
        "CPS4" => "1, 1, 2, 5, 4\n2, 2, 3, 6, 5",
        _ => "1, 1, 2, 5\n2, 1, 5, 4\n3, 2, 3, 6\n4, 2, 6, 5",
    };
    format!(
        "*NODE\n1, 0., 0.\n2, 5., 0.\n3, 10., 0.\n4, 0., 1.\n5, 5., 1.\n6, 10., 1.\n*ELEMENT, TYPE={kind}, ELSET=BAR\n{elements}\n\
         *NSET, NSET=HOLD\n1, 4\n*NSET, NSET=PULL\n3, 6\n*MATERIAL, NAME=M\n*ELASTIC\n2000., 0.\n*SOLID SECTION, ELSET=BAR, MATERIAL=M\n1.\n\
         *BOUNDARY\n{hold}\n*STEP\n*STATIC\n*CLOAD\n{load}\n*END STEP\n"
    )
}

/// u = F L / (E A) = 6 · 10 / 2000 at the end, as CalculiX has it with its linear elements, on every mesh, and whether sets
/// or their nodes are written.
#[test]
fn forces_and_supports_on_corners_are_those_of_linear_elements() {
    for kind in ["CPS4", "CPS3"] {
        for (load, hold) in [
            ("PULL, 1, 3.", "HOLD, 1, 2"),
            ("3, 1, 3.\n6, 1, 3.", "1, 1, 2\n4, 1, 2"),
        ] {
            for times in 0..3 {
                let deck = linear_bar(kind, load, hold);
                let mut problem = files::abaqus::problem(&deck).unwrap();
                problem.mesh.refine = solver::problem::Refine::Times(times);
                let solution = solve(&problem);
                let f = &solution.fields;
                for (x, u) in f.x.iter().zip(&f.ux) {
                    assert!((u - 0.003 * x).abs() < 1e-12, "{kind}, {load}: {u} at {x}");
                }
            }
        }
        // displacements between corners are linear, as those of the elements
        let deck = linear_bar(
            kind,
            "3, 1, 0.",
            "1, 1, 2\n4, 1, 2\n3, 1, 1, 0.1\n6, 1, 1, 0.3",
        );
        for times in 0..3 {
            let mut problem = files::abaqus::problem(&deck).unwrap();
            problem.mesh.refine = solver::problem::Refine::Times(times);
            let f = solve(&problem).fields;
            for n in (0..f.x.len()).filter(|n| (f.x[*n] - 10.0).abs() < 1e-12) {
                assert!(
                    (f.ux[n] - 0.1 - 0.2 * f.y[n]).abs() < 1e-12,
                    "{} at {}",
                    f.ux[n],
                    f.y[n]
                );
            }
        }
    }
}

/// A pressure of 1 on the sides within ½ ≤ x ≤ 2 of a grid with lines at 0, 1, 2 acts on one side of it, on every mesh; and so
/// with groups, whose elements have another stiffness.
#[test]
fn rules_name_parts_of_the_first_mesh() {
    let text = |part: Value| {
        json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": [0, 1, 2], "y": [0, 1]}, "boundaries": {"part": part}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "loads": [{"boundary": "part", "pressure": 1}],
            "contacts": [{"boundary": "bottom", "obstacle": {"kind": "flat"}, "condition": "bonded"}]
        })
    };
    let parts = [
        json!({"side": "top", "x": [0.5, 2]}),
        json!({"x": [0.5, 2.2], "y": [0.7, 1]}),
        json!({"box": [[2.5, 1.3], [0.5, 0.6]]}),
        json!({"normal": [0, 1], "x": [0.5, 2]}),
    ];
    for part in parts {
        for refine in [json!(0), json!(1), json!(2), json!({"tolerance": 0.05})] {
            let mut text = refined(text(part.clone()), refine);
            text["solver"] = json!({"accuracy": "verify"});
            let solution = solved(&text);
            close(solution.summary.normal_force, 1.0, 1e-9);
        }
    }
    // sides of a curve that turns: their normals as they are on the first mesh, and the same part from start to end
    let arc = |times: u32| {
        let text = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"abaqus": arc_deck(), "refine": times, "boundaries": {"up": {"side": "OUT", "normal": [0, 1], "angle": 60}}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "IN", "ux": 0, "uy": 0}],
            "loads": [{"boundary": "up", "traction": [0, [0, 1]]}]
        });
        let problem = problem(&text.to_string());
        let external = files::external_mesh(&problem, None);
        let model = solver::model::Model::new(&problem, external).unwrap();
        let up = &model.mesh.boundaries["up"];
        let place = |node: u32| model.mesh.nodes[node as usize];
        (up.len(), place(up[0][0]), place(up[up.len() - 1][1]))
    };
    let (count, start, end) = arc(0);
    assert_eq!(count, 2);
    for times in 1..4 {
        assert_eq!(arc(times), (count << times, start, end));
    }
    // a group
    let grouped = |times: u32| {
        let text = json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": [0, 1, 2], "y": [0, 1]}, "refine": times, "groups": {"right": {"x": [0.5, 2]}, "left": {"x": [0, 1]}}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0, "group": "left"}, {"youngs_modulus": 10, "poissons_ratio": 0, "group": "right"}],
            "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "uy": 0}],
            "loads": [{"boundary": "right", "traction": [1, 0]}]
        });
        energy(&solved(&text))
    };
    for times in 0..3 {
        close(grouped(times), 0.5 * (1.0 / 1000.0 + 1.0 / 10.0), 1e-10);
    }
}

/// A quarter of a ring between radii 1 and 2, of three elements of second order, its outer sides out of order.
fn arc_deck() -> String {
    let mut deck = "*NODE\n".to_owned();
    let mut node = |label: usize, r: f64, sixth: f64| {
        let angle = sixth * std::f64::consts::PI / 12.0;
        writeln!(deck, "{label}, {}, {}", r * angle.cos(), r * angle.sin()).unwrap();
    };
    for k in 0..7 {
        let at = k as f64;
        node(10 + k, 1.0, at);
        node(30 + k, 2.0, at);
        if k % 2 == 0 {
            node(20 + k, 1.5, at);
        }
    }
    deck += "*ELEMENT, TYPE=CPE8, ELSET=B\n";
    for k in [2, 0, 4] {
        writeln!(
            deck,
            "{}, {}, {}, {}, {}, {}, {}, {}, {}",
            1 + k,
            10 + k,
            30 + k,
            32 + k,
            12 + k,
            20 + k,
            31 + k,
            22 + k,
            11 + k
        )
        .unwrap();
    }
    deck + "*SURFACE, NAME=OUT\n3, S2\n5, S2\n1, S2\n*SURFACE, NAME=IN\n1, S4\n5, S4\n3, S4\n"
}

/// A node or side that a list has twice is refused, in sets of nodes as in boundaries and groups.
#[test]
fn a_node_twice_in_a_set_is_refused() {
    let mut text = pulled_by_nodes(json!([{"nodes": "end", "force": [10, 0]}]));
    text["mesh"]["inline"]["node_sets"]["end"] = json!([1, 5, 1]);
    let list = violations(&text);
    let found: Vec<_> = list.iter().map(|v| (v.reason, &v.pointer[..])).collect();
    assert_eq!(
        found,
        [(Reason::RepeatedNode, "/mesh/inline/node_sets/end/2")]
    );
}

/// A value from start to end, and forces one by one, need both ends: a closed loop has none, and neither have two pieces.
#[test]
fn values_from_start_to_end_need_both() {
    let text = |boundaries: Value, load: Value| {
        json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": [0, 1, 2], "y": [0, 1, 2, 3]}, "boundaries": boundaries},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
            "loads": [load]
        })
    };
    let around = json!({"part": {}});
    let sides = json!({"part": {"x": [0, 2], "y": [0.5, 3], "normal": [1, 0], "angle": 0.5}});
    let pieces = json!({"part": {"y": [1, 2]}});
    for (boundaries, load, got) in [
        (
            &around,
            json!({"boundary": "part", "pressure": [0, 1]}),
            Some("a closed loop"),
        ),
        (
            &around,
            json!({"boundary": "part", "traction": [0, [0, 1]]}),
            Some("a closed loop"),
        ),
        (
            &around,
            json!({"boundary": "part", "nodal": [[0, 1]]}),
            Some("a closed loop"),
        ),
        (&around, json!({"boundary": "part", "pressure": 1}), None),
        (
            &sides,
            json!({"boundary": "part", "tangential": [0, 1]}),
            None,
        ),
        (&pieces, json!({"boundary": "part", "pressure": 1}), None),
        (
            &pieces,
            json!({"boundary": "part", "pressure": [0, 1]}),
            Some("a boundary of 2 pieces"),
        ),
    ] {
        let text = text(boundaries.clone(), load);
        match got {
            None => drop(solved(&text)),
            Some(got) => {
                let list = violations(&text);
                assert_eq!((list[0].reason, &list[0].got[..]), (Reason::NotAChain, got));
            }
        }
    }
    let mut two = text(
        json!({"part": {"normal": [0, 1]}}),
        json!({"boundary": "part", "pressure": [0, 1]}),
    );
    two["mesh"]["grid"]["top"] = json!([[0, 2], [1, 2], [1.1, 2.5], [2, 2.5]]);
    two["mesh"]["grid"]["x"] = json!([0, 1, 1.1, 2]);
    two["mesh"]["grid"]["y"] = json!([0, 0.5, 1]);
    assert_eq!(violations(&two)[0].got, "a boundary of 2 pieces");
}

/// A body of columns × rows with an uneven top, its nodes, elements and lists in any order.
struct Shuffled {
    dice: Rng,
    lattice: Lattice,
    columns: usize,
    rows: usize,
    /// The number of each node of the lattice.
    number: Vec<usize>,
    /// The elements of the lattice, in the order of the mesh, each from one of its corners on.
    order: Vec<(usize, usize)>,
}

impl Shuffled {
    /// The body of `body`, with the numbers of `order`; 0: as they come.
    fn new(body: u64, order: u64) -> Shuffled {
        let mut shape = Rng::with_seed(body);
        let (columns, rows) = (shape.usize(2..5), shape.usize(1..4));
        let (bend, slope) = (shape.f64() - 0.5, shape.f64() - 0.5);
        let stretch = 1.0 + shape.f64();
        let lattice = Lattice::new(columns, rows, |i, j| {
            let (x, y) = (0.5 * i as f64 * stretch, 0.5 * j as f64);
            let part = y / rows as f64;
            [
                x + 0.3 * slope * y,
                y + part * (0.2 * slope * x + 0.1 * bend * x * x),
            ]
        });
        let mut dice = Rng::with_seed(order);
        let mut number: Vec<usize> = (0..lattice.nodes.len()).collect();
        let mut elements: Vec<usize> = (0..lattice.elements.len()).collect();
        if order > 0 {
            dice.shuffle(&mut number);
            dice.shuffle(&mut elements);
        }
        let mut turn = |e: usize| (e, if order > 0 { dice.usize(0..4) } else { 0 });
        let order = elements.into_iter().map(&mut turn).collect();
        Shuffled {
            dice,
            lattice,
            columns,
            rows,
            number,
            order,
        }
    }

    fn nodes(&self) -> Vec<[f64; 2]> {
        let mut nodes = vec![[0.0; 2]; self.number.len()];
        let places = self.number.iter().zip(&self.lattice.nodes);
        places.for_each(|(n, place)| nodes[*n] = *place);
        nodes
    }

    fn elements(&self) -> Vec<[usize; 8]> {
        let turned = |(e, by): &(usize, usize)| {
            let p = self.lattice.elements[*e];
            std::array::from_fn(|i| self.number[p[i / 4 * 4 + (i + by) % 4]])
        };
        self.order.iter().map(turned).collect()
    }

    /// The sides of the lattice: name, number of sides, half-steps of a node.
    fn sides(&self) -> BTreeMap<&'static str, Vec<[usize; 3]>> {
        let (w, h) = (2 * self.columns, 2 * self.rows);
        let edges =
            |count: usize, at: &dyn Fn(usize) -> (usize, usize)| self.lattice.edges(count, at);
        BTreeMap::from([
            ("top", edges(self.columns, &|k| (k, h))),
            ("bottom", edges(self.columns, &|k| (k, 0))),
            ("left", edges(self.rows, &|k| (0, k))),
            ("right", edges(self.rows, &|k| (w, k))),
        ])
    }

    fn inline(&mut self) -> Value {
        let mut sides = self.sides();
        for edges in sides.values_mut() {
            for edge in edges.iter_mut() {
                *edge = edge.map(|n| self.number[n]);
                if self.dice.bool() {
                    edge.swap(0, 1);
                }
            }
            self.dice.shuffle(edges);
        }
        let mut set: Vec<usize> = self.sides()["right"].concat();
        set.sort_unstable();
        set.dedup();
        self.dice.shuffle(&mut set);
        let set: Vec<usize> = set.iter().map(|n| self.number[*n]).collect();
        json!({"inline": {"nodes": self.nodes(), "elements": self.elements(), "boundaries": sides, "node_sets": {"right": set}}})
    }

    /// The same as a file of Gmsh, with physical curves and points.
    fn gmsh(&mut self) -> Value {
        let places = self.nodes();
        let names = ["bottom", "left", "right", "top"];
        let mut elements = Vec::new();
        for (name, edges) in self.sides() {
            let tag = 1 + names.iter().position(|n| *n == name).unwrap();
            for edge in edges {
                elements.push((LINE, tag, edge.map(|n| self.number[n]).to_vec()));
            }
        }
        let mut set = self.sides()["right"].concat();
        set.sort_unstable();
        set.dedup();
        elements.extend(set.iter().map(|n| (POINT, 9, vec![self.number[*n]])));
        self.dice.shuffle(&mut elements);
        let quads = self.elements().into_iter();
        elements.extend(quads.map(|nodes| (QUAD, 7, nodes.to_vec())));
        let mut file = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n5\n".to_owned();
        for (k, name) in names.iter().enumerate() {
            writeln!(file, "1 {} \"{name}\"", k + 1).unwrap();
        }
        write!(
            file,
            "0 9 \"right\"\n$EndPhysicalNames\n$Nodes\n{}\n",
            places.len()
        )
        .unwrap();
        for (n, [x, y]) in places.iter().enumerate() {
            writeln!(file, "{} {x} {y} 0", n + 1).unwrap();
        }
        write!(file, "$EndNodes\n$Elements\n{}\n", elements.len()).unwrap();
        for (e, (kind, tag, nodes)) in elements.iter().enumerate() {
            let numbers: Vec<String> = nodes.iter().map(|n| (n + 1).to_string()).collect();
            writeln!(file, "{} {kind} 2 {tag} {tag} {}", e + 1, numbers.join(" ")).unwrap();
        }
        file += "$EndElements\n";
        json!({"gmsh": file})
    }

    /// The same as a deck, with surfaces by numbers of sides.
    fn deck(&mut self) -> Value {
        let mut nodes: Vec<usize> = (0..self.number.len()).collect();
        self.dice.shuffle(&mut nodes);
        let places = self.nodes();
        let mut deck = "*NODE\n".to_owned();
        for n in nodes {
            writeln!(deck, "{}, {}, {}", n + 1, places[n][0], places[n][1]).unwrap();
        }
        deck += "*ELEMENT, TYPE=CPE8, ELSET=ALL\n";
        let elements = self.elements();
        for (e, element) in elements.iter().enumerate() {
            let numbers: Vec<String> = element.iter().map(|n| (n + 1).to_string()).collect();
            writeln!(deck, "{}, {}", e + 1, numbers.join(", ")).unwrap();
        }
        for (name, mut edges) in self.sides() {
            self.dice.shuffle(&mut edges);
            writeln!(deck, "*SURFACE, NAME={name}").unwrap();
            for [_, _, mid] in edges {
                let mid = self.number[mid];
                let found = elements.iter().enumerate().find_map(|(e, element)| {
                    Some((e, element[4..].iter().position(|n| *n == mid)?))
                });
                let (e, side) = found.unwrap();
                writeln!(deck, "{}, S{}", e + 1, side + 1).unwrap();
            }
        }
        deck += "*NSET, NSET=right\n";
        for edge in &self.sides()["right"] {
            writeln!(
                deck,
                "{}",
                edge.map(|n| (self.number[n] + 1).to_string()).join(", ")
            )
            .unwrap();
        }
        json!({"abaqus": deck})
    }
}

/// Gmsh's numbers of a point, a line, and a quadrilateral of second order.
const POINT: usize = 15;
const LINE: usize = 8;
const QUAD: usize = 16;

/// Displacements in the order of places.
fn by_place(f: &Fields) -> Vec<[f64; 4]> {
    let mut all: Vec<[f64; 4]> = (0..f.x.len())
        .map(|n| [f.x[n], f.y[n], f.ux[n], f.uy[n]])
        .collect();
    let key = |row: &[f64; 4]| [row[0], row[1]].map(|x| (x * 1e7).round() as i64);
    all.sort_by_key(key);
    all
}

/// Every kind of thing that runs along a boundary, on random bodies: their numbers and the order of their lists change
/// nothing but rounding, on every mesh.
#[test]
fn numbers_and_orders_of_lists_change_nothing() {
    for body in 1..=12 {
        let mut dice = Rng::with_seed(1000 + body);
        let mut forces = Vec::new();
        let rows = Shuffled::new(body, 0).rows;
        (0..2 * rows + 1).for_each(|_| forces.push([dice.f64(), dice.f64()]));
        let loads = [
            json!({"boundary": "top", "tangential": [1, 3]}),
            json!({"boundary": "top", "traction": [0.5, [0, -2]]}),
            json!({"boundary": "top", "traction": [[1, 0], -1]}),
            json!({"boundary": "top", "normal": [-2, 0], "tangential": 1}),
            json!({"boundary": "ceiling", "tangential": [1, 3]}),
            json!({"boundary": "right", "nodal": forces}),
            json!({"nodes": "right", "force": [1, -0.5]}),
        ];
        let load = &loads[body as usize % loads.len()];
        let supports = match body % 3 {
            0 => json!([{"boundary": "bottom", "un": [0, 0.01], "ut": 0}]),
            1 => json!([{"boundary": "bottom", "ux": 0, "uy": [0.01, 0]}]),
            _ => json!([{"boundary": "left", "ux": 0}, {"boundary": "right", "uy": 0}]),
        };
        let contacts = match body % 3 {
            2 => {
                json!([{"boundary": "bottom", "obstacle": {"kind": "parabola", "radius": 9, "center": 1, "along": "arc_length"},
                "friction": {"coefficient": 0.3, "nonlocal_radius": 0.3, "elastic_slip": 1e-3}, "indentation": 0.02}])
            }
            _ => json!([]),
        };
        let text = |mut mesh: Value, refine: &Value| {
            mesh["boundaries"] = json!({"ceiling": {"normal": [0, 1], "angle": 60}});
            mesh["refine"] = refine.clone();
            json!({
                "analysis": {"kind": "plane_strain"},
                "mesh": mesh,
                "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
                "supports": supports, "loads": [load], "contacts": contacts
            })
        };
        let mut refine = vec![json!(0), json!(1), json!(2)];
        if contacts != json!([]) {
            refine.push(json!({"tolerance": 0.1}));
        }
        for refine in &refine {
            let reference = solved(&text(Shuffled::new(body, 0).inline(), refine));
            let places = by_place(&reference.fields);
            let size = places
                .iter()
                .fold(0.0f64, |m, row| m.max(row[2].hypot(row[3])));
            for order in 1..=4 {
                let mut shuffled = Shuffled::new(body, 100 * body + order);
                let mesh = match order {
                    3 => shuffled.deck(),
                    4 => shuffled.gmsh(),
                    _ => shuffled.inline(),
                };
                let other = solved(&text(mesh, refine));
                let what = format!("body {body}, order {order}, refine {refine}, {load}");
                let others = by_place(&other.fields);
                assert_eq!(others.len(), places.len(), "{what}");
                for (a, b) in places.iter().zip(&others) {
                    let off = (0..4).fold(0.0f64, |m, k| m.max((a[k] - b[k]).abs()));
                    assert!(off < 1e-8 * size.max(1.0), "{what}: {a:?} and {b:?}");
                }
                close(energy(&other), energy(&reference), 1e-8);
            }
        }
    }
}

/// Sides, and the values along them, of a grid's own boundary and of a rule without a `side`, whose sides come in the order of
/// the elements.
#[test]
fn a_rule_runs_as_the_side_does() {
    for (own, normal, held) in [
        ("bottom", [0, -1], "top"),
        ("top", [0, 1], "bottom"),
        ("left", [-1, 0], "right"),
        ("right", [1, 0], "left"),
    ] {
        for load in [
            json!({"tangential": [0, 1]}),
            json!({"traction": [1, [0, -1]]}),
            json!({"normal": [1, 0], "tangential": 2}),
        ] {
            let on = |boundary: &str| {
                let mut load = load.clone();
                load["boundary"] = json!(boundary);
                let text = json!({
                    "analysis": {"kind": "plane_strain"},
                    "mesh": {"grid": {"x": [0, 1, 2, 3], "y": [0, 1, 2.5]}, "boundaries": {"rule": {"normal": normal}}},
                    "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
                    "supports": [{"boundary": held, "ux": 0, "uy": 0}],
                    "loads": [load]
                });
                energy(&solved(&text))
            };
            close(on("rule"), on(own), 1e-12);
        }
    }
    // by an independent program
    let text = json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"grid": {"x": [0, 1, 2, 3], "y": [0, 1]}, "boundaries": {"down": {"normal": [0, -1]}}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "top", "ux": 0, "uy": 0}],
        "loads": [{"boundary": "down", "tangential": [0, 1]}]
    });
    close(energy(&solved(&text)), 0.0014657718167131301, 1e-10);
}
