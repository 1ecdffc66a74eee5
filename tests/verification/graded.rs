//! Refinement of single elements: the mesh stays whole, its elements keep their angles, its names their parts.

use std::collections::BTreeMap;

use solver::element::Element;
use solver::mesh::{GradedMesh, Mesh, grid_mesh};
use solver::model::Model;
use solver::problem::Grid;

use crate::catalogue;
use crate::support::graded;

fn of_file(name: &str) -> Mesh {
    let path = format!("{}/data/gmsh/{name}.msh", env!("CARGO_MANIFEST_DIR"));
    files::gmsh::read(&std::fs::read(path).unwrap()[..])
        .unwrap()
        .0
}

fn meshes() -> Vec<(&'static str, Mesh)> {
    let lines = |lines: &[f64]| lines.to_vec();
    let squares = Grid {
        x: lines(&[0.0, 1.0, 2.0, 3.0]),
        y: lines(&[0.0, 1.0, 2.0]),
        top: None,
        bottom: None,
    };
    let long = Grid {
        x: graded(0.0, 4.0, 0.05, 1.5),
        y: lines(&[0.0, 1.0, 2.0]),
        top: None,
        bottom: None,
    };
    let mut all = vec![
        ("squares", grid_mesh(&squares)),
        ("long cells", grid_mesh(&long)),
    ];
    for name in [
        "sheet-mixed-msh41-ascii",
        "sheet-tri6-msh41-ascii",
        "fillet-mixed-msh41-ascii",
        "fillet-tri6-msh41-ascii",
        "fillet-quad8-msh41-ascii",
    ] {
        all.push((name, of_file(name)));
    }
    // a group and a set to be inherited: what lies to the left, and the nodes of one boundary
    for (_, mesh) in &mut all {
        let middle = 0.5 * mesh.extent(0);
        let left = |e: &u32| {
            let element = mesh.elements[*e as usize];
            element.iter().all(|n| mesh.nodes[*n as usize][0] <= middle)
        };
        let group = (0..mesh.elements.len() as u32).filter(left).collect();
        let (_, edges) = mesh.boundaries.iter().next().unwrap();
        let mut set = edges.concat();
        set.sort_unstable();
        set.dedup();
        mesh.groups.insert("left half".to_owned(), group);
        mesh.node_sets.insert("on the first".to_owned(), set);
    }
    all
}

fn area(mesh: &Mesh, of: impl Fn(u32) -> bool) -> f64 {
    let elements = mesh.elements.iter().zip(0..).filter(|(_, e)| of(*e));
    elements
        .map(|(element, _)| {
            let (family, nodes) = (element.family(), mesh.element_nodes(element));
            let points = family.rule(3).iter();
            let part = points.map(|p| p.weight * family.map(&nodes, p.place).det);
            part.sum::<f64>()
        })
        .sum()
}

/// The smallest angle at a corner, degrees: between the tangents of two sides that meet, or with `diagonals` also
/// between such a tangent and the line to the opposite corner.
fn least_angle(mesh: &Mesh, diagonals: bool) -> f64 {
    let mut least = f64::INFINITY;
    for element in &mesh.elements {
        let corners = element.family().corners();
        let at = |local: usize| mesh.nodes[element[local] as usize];
        let mid = |side: usize| at(corners + side % corners);
        for i in 0..corners {
            let [x, y] = at(i);
            let to = |[x1, y1]: [f64; 2]| [x1 - x, y1 - y];
            let tangent = |end: [f64; 2], mid: [f64; 2]| {
                let (end, mid) = (to(end), to(mid));
                [0, 1].map(|a| 4.0 * mid[a] - end[a])
            };
            let mut lines = vec![tangent(at((i + 1) % corners), mid(i))];
            if diagonals && corners == 4 {
                lines.push(to(at((i + 2) % 4)));
            }
            lines.push(tangent(
                at((i + corners - 1) % corners),
                mid(i + corners - 1),
            ));
            for pair in lines.windows(2) {
                let (a, b) = (pair[0], pair[1]);
                let (cross, dot) = (a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]);
                least = least.min(cross.atan2(dot).to_degrees());
            }
        }
    }
    least
}

fn length(mesh: &Mesh, edges: &[[u32; 3]]) -> f64 {
    let chord = |edge: &[u32; 3]| {
        let [[x0, y0], [x1, y1], [xm, ym]] = mesh.edge_nodes(edge);
        (xm - x0).hypot(ym - y0) + (x1 - xm).hypot(y1 - ym)
    };
    edges.iter().map(chord).sum()
}

/// A side belongs to one element and the surface, or to two elements with the same three nodes; no corner lies inside
/// of a side.
fn assert_whole(name: &str, mesh: &Mesh) {
    let mut sides: BTreeMap<u32, Vec<[u32; 3]>> = BTreeMap::new();
    for element in &mesh.elements {
        for side in element.sides() {
            sides.entry(side[2]).or_default().push(side);
        }
    }
    let mut surface = Vec::new();
    for (mid, sides) in sides {
        match &sides[..] {
            [alone] => surface.push(*alone),
            [[a, b, _], [c, d, _]] => assert_eq!((a, b), (d, c), "{name}: midside {mid}"),
            more => panic!("{name}: {} elements at midside {mid}", more.len()),
        }
    }
    // a hanging node would make sides inside of the body look like its surface
    assert_eq!(surface.len(), mesh.surface().len());
    let mut used = vec![false; mesh.nodes.len()];
    let nodes = mesh.elements.iter().flat_map(|element| element.iter());
    nodes.for_each(|n| used[*n as usize] = true);
    assert!(used.iter().all(|used| *used), "{name}: an unused node");
}

/// Marks what lies within a distance of a point, which halves from level to level, and some others.
fn levels(mesh: &Mesh, count: u32) -> Vec<Mesh> {
    let mut graded = GradedMesh::new(mesh);
    let (mut now, mut parts) = graded.closed();
    let mut dice = fastrand::Rng::with_seed(7);
    let target = mesh.nodes[mesh.surface()[0][0] as usize];
    let mut found = Vec::new();
    for level in 0..count {
        let reach = 0.4 * mesh.extent(0) * 0.5f64.powi(level as i32);
        let near = |element: &Element| {
            element.iter().any(|n| {
                let [x, y] = now.nodes[*n as usize];
                (x - target[0]).hypot(y - target[1]) < reach
            })
        };
        let mut marked = vec![false; graded.elements()];
        for (element, part) in now.elements.iter().zip(&parts) {
            marked[*part as usize] |= near(element) || dice.u32(0..50) == 0;
        }
        graded.refine(&marked);
        (now, parts) = graded.closed();
        found.push(now.clone());
    }
    found
}

/// Red divisions keep the shape of an element, or make a long one shorter; a closure takes a part of an angle, and only
/// once, since it is undone: eight levels make no smaller angles than one division of any one element, or a median of
/// a side in the first mesh.
#[test]
fn elements_keep_their_angles_over_eight_levels() {
    for (name, mesh) in meshes() {
        let divided = |e: usize| {
            let mut graded = GradedMesh::new(&mesh);
            let marked: Vec<bool> = (0..mesh.elements.len()).map(|other| other == e).collect();
            graded.refine(&marked);
            least_angle(&graded.closed().0, false)
        };
        let single = (0..mesh.elements.len()).map(divided);
        let bound = 0.9 * single.fold(0.5 * least_angle(&mesh, true), f64::min);
        for (level, finer) in levels(&mesh, 8).iter().enumerate() {
            assert_whole(name, finer);
            assert!(finer.inverted_elements(true).is_empty(), "{name}");
            // where an arc leaves a line tangentially, elements have angles near 0 from the beginning
            let least = least_angle(finer, false);
            assert!(
                name.starts_with("fillet") || least > bound,
                "{name}, level {level}: {least} below {bound}"
            );
            let (ratio, _) = finer.worst_element();
            let first = mesh.worst_element().0.min(0.5);
            assert!(ratio > 0.5 * first, "{name}, level {level}: {ratio}");
        }
    }
}

#[test]
fn boundaries_groups_and_sets_keep_their_parts() {
    for (name, mesh) in meshes() {
        let fine = levels(&mesh, 5).pop().unwrap();
        let whole = area(&mesh, |_| true);
        assert!(
            (area(&fine, |_| true) / whole - 1.0).abs() < 1e-12,
            "{name}"
        );
        for (group, elements) in &mesh.groups {
            let (coarse, now) = (
                area(&mesh, |e| elements.contains(&e)),
                area(&fine, |e| fine.groups[group].binary_search(&e).is_ok()),
            );
            assert!((now / coarse - 1.0).abs() < 1e-12, "{name}, {group}");
        }
        let surface = fine.surface();
        for (boundary, edges) in &mesh.boundaries {
            let finer = &fine.boundaries[boundary];
            assert!(
                finer.iter().all(|edge| surface.contains(edge)),
                "{name}, {boundary}"
            );
            // a curve is longer than its chords
            let (coarse, now) = (length(&mesh, edges), length(&fine, finer));
            assert!((now / coarse - 1.0).abs() < 2e-3, "{name}, {boundary}");
        }
        let first = fine.boundaries.values().next().unwrap();
        let mut on_it = first.concat();
        on_it.sort_unstable();
        on_it.dedup();
        assert_eq!(fine.node_sets["on the first"], on_it, "{name}");
        assert!(on_it.len() > mesh.node_sets["on the first"].len());
        // and again, to the last bit
        assert_eq!(levels(&mesh, 5).pop().unwrap(), fine);
    }
}

/// All at once is what `mesh::refine` does, where no element is long.
#[test]
fn refining_all_elements_is_uniform_refinement() {
    let long = ["long cells", "fillet-quad8-msh41-ascii"];
    for (name, mesh) in meshes()
        .into_iter()
        .filter(|(name, _)| !long.contains(name))
    {
        let mut graded = GradedMesh::new(&mesh);
        graded.refine(&vec![true; mesh.elements.len()]);
        assert_eq!(graded.closed().0, solver::mesh::refine(&mesh), "{name}");
    }
}

/// Halves of long quadrilaterals beside triangles asked for one another without end, in problem 115 among others. Divisions
/// end, and each element that is asked for brings few others with it.
#[test]
fn divisions_end_among_long_quadrilaterals_and_triangles() {
    for number in 0..240 {
        let problem = catalogue::unstructured(number);
        let mesh = Model::new(&problem, None).unwrap().mesh;
        let mut graded = GradedMesh::new(&mesh);
        let (mut dice, mut asked) = (fastrand::Rng::with_seed(number), 0);
        for _ in 0..6 {
            let marked: Vec<bool> = (0..graded.elements())
                .map(|_| dice.u32(0..30) == 0)
                .collect();
            asked += marked.iter().filter(|marked| **marked).count();
            graded.refine(&marked);
        }
        assert_whole(&number.to_string(), &graded.closed().0);
        // four for one, and as many again for its neighbours, some of which are long: 8 at most
        let added = graded.elements() - mesh.elements.len();
        assert!(added <= 12 * asked, "{number}: {added} for {asked}");
    }
}
