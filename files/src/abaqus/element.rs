//! Types of elements: which make up a plane body, and what the others mean for a mesh and for a problem.

use solver::element::Family;

/// The two-dimensional theory of a type of element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Theory {
    PlaneStrain,
    PlaneStress,
    Axisymmetric,
}

/// The mechanics of a type of element that a problem can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Mechanics {
    pub(super) theory: Theory,
    pub(super) family: Family,
    /// Whether integration is reduced.
    pub(super) reduced: bool,
}

/// The first elements of a deck with the given mechanics.
#[derive(Clone, Debug)]
pub(super) struct Typed {
    pub(super) mechanics: Mechanics,
    /// The line of the keyword that defines the elements.
    pub(super) line: u64,
    /// The type that the keyword names.
    pub(super) name: String,
}

impl Mechanics {
    pub(super) fn is_triangle(&self) -> bool {
        self.family == Family::Triangle
    }
}

/// The meaning of a type of element for a plane mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    /// A triangle or quadrilateral with this number of nodes; a ninth is in the centre.
    Plane(Family, usize),
    /// A line with 2 or 3 nodes, which may name a part of the boundary; with one node a spring to the ground.
    Line(usize),
    /// Another element, with its number of nodes if the name shows it.
    Other(Option<usize>),
}

/// A type of element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ElementType {
    pub(super) shape: Shape,
    /// The mechanics; present for solids of plane strain, plane stress and revolution.
    pub(super) mechanics: Option<Mechanics>,
    /// Whether the type has no effect on a linear static step.
    pub(super) idle: bool,
}

/// The beginnings of the names of plane types: solids; variants with a generalised third direction, for heat and for
/// sound; shells, membranes and surfaces, which programs write for plane meshes too.
const PLANE: [&str; 14] = [
    "CPEG", "CGAX", "DC2D", "DCAX", "AC2D", "ACAX", "SFM3D", "STRI", "M3D", "CPE", "CPS", "CAX",
    "DS", "S",
];

/// The names of line types (trusses, beams, pipes, rigid and other lines), with their numbers of nodes; and springs to the
/// ground, which have one.
const LINES: [(&str, usize); 33] = [
    ("SPRING1", 1),
    ("T2D2", 2),
    ("T2D3", 3),
    ("T3D2", 2),
    ("T3D3", 3),
    ("B21", 2),
    ("B22", 3),
    ("B23", 2),
    ("B31", 2),
    ("B32", 3),
    ("B33", 2),
    ("PIPE21", 2),
    ("PIPE22", 3),
    ("PIPE31", 2),
    ("PIPE32", 3),
    ("FRAME2D", 2),
    ("R2D2", 2),
    ("RAX2", 2),
    ("RB2D2", 2),
    ("SAX1", 2),
    ("SAX2", 3),
    ("MAX1", 2),
    ("MAX2", 3),
    ("SFMAX1", 2),
    ("SFMAX2", 3),
    ("DSAX1", 2),
    ("DSAX2", 3),
    ("DC1D2", 2),
    ("DC1D3", 3),
    ("AC1D2", 2),
    ("AC1D3", 3),
    ("F2D2", 2),
    ("FAX2", 2),
];

impl ElementType {
    /// The type of element with this name, in capitals.
    pub(super) fn new(name: &str) -> Self {
        let line = LINES.iter().find(|(start, _)| {
            let rest = name.strip_prefix(start);
            rest.is_some_and(|rest| !rest.starts_with(|c: char| c.is_ascii_digit()))
        });
        let shape = match (plane(name), line) {
            (Some((family, nodes, _)), _) => Shape::Plane(family, nodes),
            (None, Some((_, nodes))) => Shape::Line(*nodes),
            (None, None) => Shape::Other(solid_nodes(name)),
        };
        ElementType {
            shape,
            mechanics: plane(name).and_then(|(_, _, mechanics)| mechanics),
            idle: matches!(name, "MASS" | "ROTARYI"),
        }
    }
}

/// Family, number of nodes and mechanics of a plane type; none for other types.
fn plane(name: &str) -> Option<(Family, usize, Option<Mechanics>)> {
    let start = PLANE.iter().find(|start| {
        let rest = name.strip_prefix(**start);
        rest.is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()))
    })?;
    let rest = &name[start.len()..];
    let letters = rest.trim_start_matches(|c: char| c.is_ascii_digit());
    let (family, nodes) = match &rest[..rest.len() - letters.len()] {
        "3" => (Family::Triangle, 3),
        "6" | "65" => (Family::Triangle, 6),
        "4" => (Family::Quad, 4),
        "8" => (Family::Quad, 8),
        "9" => (Family::Quad, 9),
        _ => return None,
    };
    let theory = match *start {
        "CPE" => Some(Theory::PlaneStrain),
        "CPS" => Some(Theory::PlaneStress),
        "CAX" => Some(Theory::Axisymmetric),
        _ => None,
    };
    // reduced, incompatible modes, hybrid, modified, with temperatures: other ways to the same displacements. Pore
    // pressure and electric potential change them.
    let same = letters.chars().all(|c| "RIHMT".contains(c));
    let mechanics = theory.filter(|_| same).map(|theory| Mechanics {
        theory,
        family,
        reduced: nodes > 4 && family == Family::Quad && letters.contains('R'),
    });
    Some((family, nodes, mechanics))
}

/// The number of nodes of a three-dimensional solid, which may be written on several lines.
fn solid_nodes(name: &str) -> Option<usize> {
    let rest = ["C3D", "DC3D", "AC3D"]
        .iter()
        .find_map(|start| name.strip_prefix(start))?;
    let letters = rest.trim_start_matches(|c: char| c.is_ascii_digit());
    rest[..rest.len() - letters.len()].parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variants_of_plane_elements_are_read_and_others_are_classified() {
        let plane = |name: &str| match ElementType::new(name).shape {
            Shape::Plane(_, nodes) => nodes,
            other => panic!("{name}: {other:?}"),
        };
        for name in [
            "CPE8", "CPE8R", "CPE8RH", "CPE8RHT", "CPS8T", "CAX8H", "CPEG8", "DC2D8", "DCAX8",
        ] {
            assert_eq!(plane(name), 8, "{name}");
        }
        for name in [
            "CPE4I", "CPS4RT", "CAX4H", "S4", "S4R", "M3D4R", "SFM3D4", "AC2D4",
        ] {
            assert_eq!(plane(name), 4, "{name}");
        }
        assert_eq!(["CPE6M", "STRI65", "CPE6MH"].map(plane), [6; 3]);
        assert_eq!(["CPE3", "S3", "STRI3"].map(plane), [3; 3]);
        assert_eq!(["CPS9", "M3D9R"].map(plane), [9; 2]);
        for (name, shape) in [
            ("T3D2", Shape::Line(2)),
            ("T3D3", Shape::Line(3)),
            ("T2D2H", Shape::Line(2)),
            ("R2D2", Shape::Line(2)),
            ("SAX1", Shape::Line(2)),
            ("C3D20R", Shape::Other(Some(20))),
            ("C3D8", Shape::Other(Some(8))),
            ("SPRINGA", Shape::Other(None)),
            ("MASS", Shape::Other(None)),
            ("SC8R", Shape::Other(None)),
            ("CAXA8R", Shape::Other(None)),
            ("CINPE4", Shape::Other(None)),
            ("COH2D4", Shape::Other(None)),
            ("", Shape::Other(None)),
        ] {
            assert_eq!(ElementType::new(name).shape, shape, "{name}");
        }
        let solid = |name: &str| ElementType::new(name).mechanics;
        assert!(solid("CPE8R").unwrap().reduced && !solid("CPE4R").unwrap().reduced);
        assert!(solid("CPE8RT").is_some() && solid("CPE8P").is_none() && solid("S8").is_none());
    }
}
