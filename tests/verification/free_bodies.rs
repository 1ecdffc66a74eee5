//! Bodies that nothing holds: validation refuses exactly those whose stiffness is singular, and says what moves.

use faer::Side;
use serde_json::{Value, json};
use solver::elasticity::{Dof, DofMap};
use solver::model::Model;
use solver::problem::Problem;

use crate::assembled::Assembled;
use crate::support::{Lattice, problem, solve};

/// Inline mesh of squares side by side or corner to corner, with supports of nodes.
#[derive(Clone)]
struct Squares {
    nodes: Vec<[f64; 2]>,
    elements: Vec<[usize; 8]>,
    /// Nodes held along x, along y.
    held: [Vec<usize>; 2],
}

impl Squares {
    /// Unit squares at these places of a lattice, each with nodes of its own.
    fn apart(cells: &[[i32; 2]]) -> Squares {
        #[rustfmt::skip]
        const PLACES: [[f64; 2]; 8] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.0], [1.0, 0.5], [0.5, 1.0], [0.0, 0.5]];
        let place = |[i, j]: &[i32; 2]| PLACES.map(|[x, y]| [f64::from(*i) + x, f64::from(*j) + y]);
        Squares {
            nodes: cells.iter().flat_map(place).collect(),
            elements: (0..cells.len())
                .map(|e| std::array::from_fn(|i| 8 * e + i))
                .collect(),
            held: [Vec::new(), Vec::new()],
        }
    }

    /// Nodes at the same place become one where `joined` says so of two elements and the place; sides follow their
    /// corners.
    fn join(&mut self, mut joined: impl FnMut(usize, usize, [f64; 2]) -> bool) {
        for e in 1..self.elements.len() {
            for other in 0..e {
                let mut both = Vec::new();
                for (a, b) in (0..4).flat_map(|a| (0..4).map(move |b| (a, b))) {
                    let (p, q) = (self.elements[e][a], self.elements[other][b]);
                    let here = self.nodes[p];
                    if here == self.nodes[q] && (p == q || joined(e, other, here)) {
                        self.rename(p, q);
                        both.push(here);
                    }
                }
            }
        }
        // a side between the same two corners is one side
        for e in 1..self.elements.len() {
            for other in 0..e {
                for (a, b) in (0..4).flat_map(|a| (0..4).map(move |b| (a, b))) {
                    let corners = |e: usize, a: usize| {
                        let (p, q) = (self.elements[e][a], self.elements[e][(a + 1) % 4]);
                        (p.min(q), p.max(q))
                    };
                    if corners(e, a) == corners(other, b) {
                        let (p, q) = (self.elements[e][4 + a], self.elements[other][4 + b]);
                        self.rename(p, q);
                    }
                }
            }
        }
        let mut used: Vec<usize> = self.elements.concat();
        used.sort_unstable();
        used.dedup();
        let number = |n: usize| used.binary_search(&n).unwrap();
        self.elements = self.elements.iter().map(|e| e.map(number)).collect();
        self.nodes = used.iter().map(|n| self.nodes[*n]).collect();
    }

    fn rename(&mut self, from: usize, to: usize) {
        let places = self.elements.iter_mut().flatten();
        places.filter(|n| **n == from).for_each(|n| *n = to);
    }

    fn value(&self, analysis: &str) -> Value {
        let [x, y] = &self.held;
        let sets = [("x", x), ("y", y)]
            .into_iter()
            .filter(|(_, set)| !set.is_empty());
        let sets: serde_json::Map<_, _> = sets
            .map(|(name, set)| (name.to_owned(), json!(set)))
            .collect();
        let supports: Vec<Value> = sets
            .keys()
            .map(|name| json!({"nodes": name, &format!("u{name}"): 0}))
            .collect();
        json!({
            "analysis": {"kind": analysis},
            "mesh": {"inline": {"nodes": self.nodes, "elements": self.elements, "node_sets": sets}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": supports,
        })
    }

    /// How many eigenvalues of the supported stiffness are zero: below 1e-10 of the largest, and none of the others
    /// below 1e-7.
    fn zero_energies(&self, axisymmetric: bool) -> usize {
        let mut all = self.clone();
        all.held = [0, 1].map(|_| (0..self.nodes.len()).collect());
        let analysis = if axisymmetric {
            "axisymmetric"
        } else {
            "plane_strain"
        };
        let model = Model::new(&problem(&all.value(analysis).to_string()), None).unwrap();
        let mut map = DofMap {
            dofs: vec![[Dof::Fixed(0.0); 2]; self.nodes.len()],
            axes: vec![None; self.nodes.len()],
            unknowns: 0,
        };
        for node in 0..self.nodes.len() {
            for a in (0..2).filter(|a| !self.held[*a].contains(&node)) {
                map.dofs[node][a] = Dof::Free(map.unknowns);
                map.unknowns += 1;
            }
        }
        let (k, _) = Assembled::new(&model.mesh, &model.section, 3, &map);
        let columns = k.dense();
        let values = faer::Mat::from_fn(map.unknowns, map.unknowns, |i, j| columns[j][i])
            .self_adjoint_eigenvalues(Side::Lower)
            .unwrap();
        let most = values.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        let below = |limit: f64| values.iter().filter(|v| v.abs() < limit * most).count();
        assert_eq!(below(1e-10), below(1e-7), "{values:?}");
        below(1e-10)
    }

    fn refusals(&self, analysis: &str) -> Vec<solver::error::Violation> {
        match Model::new(&problem(&self.value(analysis).to_string()), None) {
            Ok(_) => Vec::new(),
            Err(list) => list,
        }
    }
}

/// Numbers in 0..below, always the same.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self, below: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (self.0 >> 33) as usize % below
    }
}

/// Random heaps of squares, joined along sides and at corners, with random supports of single nodes, on a square and on
/// a skewed lattice, at any scale and place: refused exactly where the stiffness has an eigenvalue 0.
#[test]
fn a_body_is_refused_exactly_where_its_stiffness_is_singular() {
    let mut numbers = Numbers(4);
    let (mut free, mut held, mut mechanisms) = (0, 0, 0);
    for trial in 0..400 {
        let columns = 2 + numbers.next(2) as i32;
        let mut cells: Vec<[i32; 2]> = (0..columns)
            .flat_map(|i| (0..2).map(move |j| [i, j]))
            .collect();
        while cells.len() > 3 && numbers.next(3) > 0 {
            cells.remove(numbers.next(cells.len()));
        }
        let mut squares = Squares::apart(&cells);
        squares.join(|_, _, _| numbers.next(4) > 0);
        let skewed = trial % 2 == 1;
        let axisymmetric = trial % 5 == 4;
        // a ring of large radius turns almost without energy
        let far = if axisymmetric { 1.0 } else { 1e3 };
        let (scale, shift) = [(1.0, 0.0), (1e-6, 0.0), (1e4, 0.0), (1.0, far)][trial % 4];
        for [x, y] in &mut squares.nodes {
            if skewed {
                (*x, *y) = (*x + 0.31 * *y + 0.03 * *x * *y, *y + 0.17 * *x);
            }
            (*x, *y) = (scale * (*x + shift + 0.5), scale * (*y + shift));
        }
        for _ in 0..2 + numbers.next(7) {
            let (axis, node) = (numbers.next(2), numbers.next(squares.nodes.len()));
            squares.held[axis].push(node);
        }
        for set in &mut squares.held {
            set.sort_unstable();
            set.dedup();
        }
        let zero = squares.zero_energies(axisymmetric);
        let list = squares.refusals(if axisymmetric {
            "axisymmetric"
        } else {
            "plane_strain"
        });
        assert_eq!(
            zero > 0,
            !list.is_empty(),
            "{trial}: {zero} {list:#?} {}",
            squares.value("plane_strain")
        );
        let refused = |v: &solver::error::Violation| {
            v.pointer == "/supports" && v.reason.as_str() == "free_body"
        };
        assert!(list.iter().all(refused), "{list:#?}");
        match zero {
            0 => held += 1,
            _ => free += 1,
        }
        mechanisms += usize::from(list.iter().any(|v| v.got.contains("hinged")));
    }
    assert!(
        free > 100 && held > 60 && mechanisms > 30,
        "{free} {held} {mechanisms}"
    );
}

/// The one violation of a problem.
#[track_caller]
fn only(value: &Value) -> String {
    let list = Model::new(&problem(&value.to_string()), None).unwrap_err();
    let [violation] = &list[..] else {
        panic!("{list:#?}")
    };
    assert_eq!(
        (&violation.pointer[..], violation.reason.as_str()),
        ("/supports", "free_body")
    );
    format!("{} | {}", violation.got, violation.hint)
}

#[track_caller]
fn says(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "{part:?} in {text:?}");
    }
}

#[test]
fn the_motion_is_named_with_its_direction_or_centre_and_a_node() {
    // the directions of two rollers meet in (1, 1)
    let mut square = Squares::apart(&[[0, 0]]);
    square.held = [vec![3], vec![1]];
    says(
        &only(&square.value("plane_strain")),
        &["a body free to move: in rotation about (1, 1), e.g. node"],
    );
    // one roller: along it, and about any point of its line
    square.held = [vec![0], vec![]];
    says(
        &only(&square.value("plane_strain")),
        &["along y and in rotation about (0.5, 0)"],
    );
    square.held = [vec![], vec![]];
    says(
        &only(&square.value("plane_strain")),
        &["along x, along y and in rotation"],
    );
    // a slanted side on rollers
    let body = Lattice::new(2, 2, |i, j| {
        let (x, y) = (0.5 * i as f64, 0.5 * j as f64);
        [0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y]
    });
    let edges = body.edges(2, |k| (k, 0));
    let text = only(&json!({
        "analysis": {"kind": "plane_strain"},
        "mesh": {"inline": {"nodes": body.nodes, "elements": body.elements, "boundaries": {"ramp": edges}}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "ramp", "un": 0}],
    }));
    says(
        &text,
        &[
            "a body free to move: along (0.8000, 0.6000), e.g. node",
            "`ux` or `uy`",
        ],
    );
}

#[test]
fn hinges_are_mechanisms_and_two_of_them_hold() {
    // a clamped square, and one at its corner: it turns about node 2
    let mut squares = Squares::apart(&[[0, 0], [1, 1]]);
    squares.join(|_, _, _| true);
    squares.held = [vec![0, 1], vec![0, 1]];
    let text = only(&squares.value("plane_strain"));
    says(
        &text,
        &[
            "part 2 of 2 of the body",
            "in rotation about node 2 at (1, 1), where it is hinged",
            "share",
        ],
    );
    // a roller on the circle of its motion is not enough, one across it is
    squares.held[0].push(squares.elements[1][1]);
    says(
        &only(&squares.value("plane_strain")),
        &["in rotation about node 2"],
    );
    squares.held[1].push(squares.elements[1][1]);
    assert!(squares.refusals("plane_strain").is_empty());
    assert!(
        solve(&problem(&squares.value("plane_strain").to_string()))
            .summary
            .converged
    );
    // a triangle of three bars, hinged to one another, is rigid: it needs three rollers like one body
    let ring = |held: [Vec<usize>; 2]| {
        let mut squares = Squares::apart(&[[0, 0], [1, 1], [2, 0]]);
        squares.join(|_, _, _| true);
        // the third hinge: the right end of the first square and the left one of the last
        let (p, q) = (squares.elements[0][1], squares.elements[2][0]);
        squares.nodes[p] = [1.5, 0.0];
        squares.nodes[q] = [1.5, 0.0];
        for (e, a, b, mid) in [(0, 0, 1, 4), (0, 1, 2, 5), (2, 0, 1, 4), (2, 3, 0, 7)] {
            let [[x0, y0], [x1, y1]] = [a, b].map(|i| squares.nodes[squares.elements[e][i]]);
            squares.nodes[squares.elements[e][mid]] = [0.5 * (x0 + x1), 0.5 * (y0 + y1)];
        }
        squares.join(|_, _, _| true);
        squares.held = held;
        squares
    };
    let three = ring([vec![0], vec![0, 16]]);
    assert_eq!(
        (
            three.zero_energies(false),
            three.refusals("plane_strain").len()
        ),
        (0, 0)
    );
    let two = ring([vec![0], vec![0]]);
    says(
        &only(&two.value("plane_strain")),
        &[
            "3 of 3 parts of the body, hinged to one another, free to move: in rotation about (0, 0)",
        ],
    );
}

#[test]
fn parts_without_common_nodes_are_held_each_by_itself() {
    let mut squares = Squares::apart(&[[0, 0], [1, 0]]);
    squares.held = [vec![0, 1], vec![0, 1]];
    says(
        &only(&squares.value("plane_strain")),
        &[
            "part 2 of 2 of the body free to move: along x, along y and in rotation",
            "without common nodes they are separate",
        ],
    );
    // in axisymmetry a part hangs on a common node
    squares.nodes.iter_mut().for_each(|x| x[0] += 1.0);
    says(
        &only(&squares.value("axisymmetric")),
        &["part 2 of 2", "along the axis"],
    );
    let mut joined = Squares::apart(&[[0, 0], [1, 1]]);
    joined.join(|_, _, _| true);
    joined.nodes.iter_mut().for_each(|x| x[0] += 1.0);
    joined.held = [vec![], vec![0]];
    assert!(joined.refusals("axisymmetric").is_empty());
}

/// A block on a flat: without friction it slides, with friction or bonded it does not, and rollers at its side do.
#[test]
fn contacts_hold_along_their_normal_and_with_friction_along_the_tangent() {
    let block = |contact: Value, supports: Value| {
        json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": [0, 1, 2], "y": [0, 1]}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": supports, "contacts": [contact],
            "loads": [{"body_force": [0, -1]}],
        })
    };
    let flat = json!({"boundary": "bottom", "obstacle": {"kind": "flat"}});
    let with = |name: &str, value: Value| {
        let mut contact = flat.clone();
        contact[name] = value;
        contact
    };
    let text = only(&block(flat.clone(), json!([])));
    says(
        &text,
        &[
            "a body free to move: along x, e.g. node",
            "`ux`",
            "friction",
        ],
    );
    let law = json!({"coefficient": 0.3, "nonlocal_radius": 0.1, "elastic_slip": 1e-4});
    for (contact, supports) in [
        (flat.clone(), json!([{"boundary": "left", "ux": 0}])),
        (with("friction", law), json!([])),
        (with("condition", json!("bonded")), json!([])),
    ] {
        let model = Model::new(&problem(&block(contact, supports).to_string()), None).unwrap();
        assert!(model.held_by_contact);
    }
    let law = json!({"coefficient": 0, "nonlocal_radius": 0.1, "elastic_slip": 1e-4});
    says(
        &only(&block(with("friction", law), json!([]))),
        &["along x"],
    );
}

/// Long chains and loose elements: refused at once, whatever their number. A cubic or quadratic check would take hours.
#[test]
fn very_many_parts_are_refused_at_once() {
    let loose: Vec<[i32; 2]> = (0..40_000)
        .map(|i| [2 * (i % 200), 2 * (i / 200)])
        .collect();
    let mut squares = Squares::apart(&loose);
    let list = squares.refusals("plane_strain");
    assert_eq!(list.len(), 100);
    assert!(
        list[99].hint.contains("39900 more violations"),
        "{}",
        list[99].hint
    );
    // corner to corner
    let chain = |count: usize| {
        let cells: Vec<[i32; 2]> = (0..count as i32).map(|i| [i, i]).collect();
        let mut squares = Squares::apart(&cells);
        for e in 1..count {
            squares.elements[e][0] = squares.elements[e - 1][2];
        }
        squares.join(|_, _, _| false);
        squares.held = [vec![0, 1], vec![0, 1]];
        squares
    };
    let found = |squares: &Squares| {
        let list = squares.refusals("plane_strain");
        assert_eq!(list.len(), 1, "{list:#?}");
        (
            list[0].pointer.clone(),
            list[0].reason.as_str(),
            list[0].got.clone(),
        )
    };
    let (pointer, reason, got) = found(&chain(65));
    assert_eq!((&pointer[..], reason), ("/supports", "free_body"));
    assert!(got.contains("63 more motions"), "{got}");
    let (pointer, reason, got) = found(&chain(66));
    assert_eq!((&pointer[..], reason), ("/mesh", "too_many"));
    assert!(got.contains("65 parts"), "{got}");
    // held one by one, any number is
    squares = chain(2000);
    let all = |squares: &Squares| {
        squares
            .elements
            .iter()
            .flat_map(|e| [e[1], e[3]])
            .collect::<Vec<_>>()
    };
    squares.held = [all(&squares), all(&squares)];
    assert!(squares.refusals("plane_strain").is_empty());
}

/// An obstacle pushed against a body that nothing else holds along its normal pushes it away: there is no pressure, whatever
/// the iterations say. A load against the obstacle, or a contact on the other side, makes it a problem.
#[test]
fn a_body_that_is_only_pushed_away_is_refused() {
    let block = |loads: Value, contacts: Value| {
        json!({
            "analysis": {"kind": "plane_strain"},
            "mesh": {"grid": {"x": [0, 1, 2, 3, 4], "y": [0, 1, 2]}},
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
            "supports": [{"boundary": "left", "ux": 0}],
            "loads": loads,
            "contacts": contacts,
        })
    };
    let on = |boundary: &str| {
        json!({"boundary": boundary, "obstacle": {"kind": "flat"}, "indentation": 0.01,
            "friction": {"coefficient": 0.3, "nonlocal_radius": 1, "elastic_slip": 1e-4}})
    };
    let refused = |problem: &Value| {
        let problem: Problem = serde_json::from_value(problem.clone()).unwrap();
        match solver::check(&problem, None) {
            Ok(_) => None,
            Err(violations) => Some(violations[0].got.clone()),
        }
    };
    let told = refused(&block(json!([]), json!([on("top")]))).unwrap();
    assert!(
        told.contains("along y from the contact that holds it on one side only"),
        "{told}"
    );
    // here it may also turn
    let mut rolling = block(json!([]), json!([on("top")]));
    rolling["supports"] = json!([{"boundary": "bottom", "ux": 0}]);
    let told = refused(&rolling).unwrap();
    assert!(told.contains("on one side only"), "{told}");
    // friction at another side holds it along y, with or without an obstacle there
    let grip = json!({"boundary": "right", "obstacle": {"kind": "flat"}, "condition": "none",
        "friction": {"bound": 5, "elastic_slip": 1e-4}});
    assert_eq!(refused(&block(json!([]), json!([on("top"), grip]))), None);
    // the load does nothing along y
    let aside = json!([{"boundary": "right", "pressure": 1}]);
    assert!(refused(&block(aside, json!([on("top")]))).is_some());
    let pressed = json!([{"boundary": "bottom", "pressure": 1}]);
    assert_eq!(refused(&block(pressed, json!([on("top")]))), None);
    assert_eq!(
        refused(&block(json!([]), json!([on("top"), on("bottom")]))),
        None
    );
}
