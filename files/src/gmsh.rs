//! Meshes from Gmsh: MSH 2.2 and 4.1, ASCII and binary.
//!
//! The reader is written by hand: the crate for this format reads 4.1 only and wants the whole file in memory; here a
//! file is read as a stream, and five of the dozen sections of the format are needed.
//!
//! Physical curves become boundaries, physical surfaces groups of elements, physical points sets of nodes, all by their
//! names (or by numbers, where they have no names).

use std::collections::BTreeMap;
use std::io::BufRead;

use crate::source::{Labels, Plane, ReadError, Source};
use solver::element::Element;
use solver::error::Reason;
use solver::mesh::{self, Mesh, NO_NODE, RawMesh};
use solver::solution::Warning;

/// Gmsh's numbers of the supported kinds of elements, with their numbers of nodes.
const KINDS: [(i64, usize, Kind); 8] = [
    (1, 2, Kind::Line),
    (8, 3, Kind::Line),
    (2, 3, Kind::Triangle),
    (9, 6, Kind::Triangle),
    (3, 4, Kind::Quad),
    (16, 8, Kind::Quad),
    (10, 9, Kind::Quad),
    (15, 1, Kind::Point),
];

/// The largest number of bytes of a physical name; Gmsh itself cuts names at 128 characters.
const LONGEST_NAME: usize = 512;

/// Marks an element that is in no physical group.
const NO_GROUP: u32 = u32::MAX;

/// The largest average number of physical groups of an element: a file names the groups of a surface once for all of
/// its elements, and may name many.
const MOST_GROUPS: usize = 16;
/// For how many nodes and elements at most memory is reserved before they are read: the announced number may be wrong.
const MOST_RESERVED: u64 = 1 << 20;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Point,
    Line,
    Triangle,
    Quad,
}

/// Reads a Gmsh file, MSH 2.2 or 4.1, ASCII or binary, with warnings of what was changed.
///
/// # Errors
///
/// [`ReadError::Io`] if the reader fails; [`ReadError::Invalid`] with the violations of the file: another version,
/// sections that end too early, elements that no plane body has, and so on, each with its line.
pub fn read(reader: impl BufRead) -> Result<(Mesh, Vec<Warning>), ReadError> {
    let mut file = File::new(reader);
    file.sections()?;
    let mut faults: Vec<_> = file.plane.fault().into_iter().collect();
    match mesh::build(file.raw) {
        Ok(built) if faults.is_empty() => Ok(built),
        Ok(_) => Err(ReadError::Invalid(faults)),
        Err(found) => {
            faults.extend(found);
            Err(ReadError::Invalid(faults))
        }
    }
}

/// The physical tags of each entity, by the entity's dimension and number. The sign of a tag is a direction.
type Entities = BTreeMap<(u8, i64), Vec<u64>>;

struct File<R> {
    source: Source<R>,
    version: Version,
    binary: bool,
    /// Names of physical groups by dimension and tag.
    names: BTreeMap<(u8, u64), String>,
    entities: Entities,
    labels: Labels,
    plane: Plane,
    raw: RawMesh,
    /// The number of memberships of elements in physical groups.
    members: usize,
    seen: Seen,
}

#[derive(Clone, Copy, PartialEq)]
enum Version {
    Two,
    Four,
}

#[derive(Default)]
struct Seen {
    nodes: bool,
    elements: bool,
}

impl<R: BufRead> File<R> {
    fn new(reader: R) -> Self {
        File {
            source: Source::new(reader),
            version: Version::Four,
            binary: false,
            names: BTreeMap::new(),
            entities: Entities::new(),
            labels: Labels::default(),
            plane: Plane::default(),
            raw: RawMesh::default(),
            members: 0,
            seen: Seen::default(),
        }
    }

    fn sections(&mut self) -> Result<(), ReadError> {
        self.format()?;
        while self.source.advance()? {
            let line = self.source.text().trim().to_owned();
            match &line[..] {
                "" => {}
                "$PhysicalNames" => self.physical_names()?,
                "$Entities" if self.version == Version::Four => {
                    self.entities()?;
                    self.end("$EndEntities")?;
                }
                "$PartitionedEntities" => {
                    return Err(self.source.fault(
                        Reason::Unsupported,
                        "a partitioned mesh",
                        "a mesh in one part",
                        "Save it without partitions (Mesh.PartitionOldStyleMsh2 and $PartitionedEntities are not read).",
                    ));
                }
                "$Nodes" | "$ParametricNodes" => {
                    self.once(self.seen.nodes, "$Nodes")?;
                    self.seen.nodes = true;
                    let parametric = line == "$ParametricNodes";
                    match self.version {
                        Version::Two => self.nodes_2(parametric)?,
                        Version::Four => self.nodes_4()?,
                    }
                    self.end(&format!("$End{}", &line[1..]))?;
                }
                "$Elements" => {
                    self.once(self.seen.elements, "$Elements")?;
                    if !self.seen.nodes {
                        return Err(self.source.fault(
                            Reason::Malformed,
                            "$Elements before $Nodes",
                            "the nodes first",
                            "Save the mesh with Gmsh itself.",
                        ));
                    }
                    self.seen.elements = true;
                    match self.version {
                        Version::Two => self.elements_2()?,
                        Version::Four => self.elements_4()?,
                    }
                    // no later section names nodes, and the numbers of a large mesh take much memory
                    self.labels = Labels::default();
                    if self.version == Version::Two {
                        self.merge_repeated();
                    }
                    self.end("$EndElements")?;
                }
                section if section.starts_with('$') => {
                    let end = format!("$End{}", &section[1..]);
                    self.skip_to(&end)?;
                }
                _ => {
                    let got = format!("`{line:.40}`");
                    return Err(self.source.fault(
                        Reason::Malformed,
                        &got,
                        "a section, $…",
                        "Save the mesh again.",
                    ));
                }
            }
        }
        if !self.seen.elements {
            return Err(self.source.fault(
                Reason::Truncated,
                "the end of the file",
                "the sections $Nodes and $Elements",
                "Mesh the geometry before saving (gmsh -2), and send the whole file.",
            ));
        }
        Ok(())
    }

    fn once(&self, seen: bool, section: &str) -> Result<(), ReadError> {
        if seen {
            let got = format!("{section} a second time");
            return Err(self.source.fault(
                Reason::Malformed,
                &got,
                "each section once",
                "Save the mesh again.",
            ));
        }
        Ok(())
    }

    fn format(&mut self) -> Result<(), ReadError> {
        let mut first = String::new();
        while first.is_empty() && self.source.advance()? {
            first = self.source.text().trim().to_owned();
            // remarks of the program that wrote the file
            if first == "$Comments" {
                self.skip_to("$EndComments")?;
                first.clear();
            }
        }
        if first != "$MeshFormat" {
            return Err(self.source.fault(
                Reason::Malformed,
                &format!("`{first:.40}`"),
                "$MeshFormat in the first line",
                "Send a Gmsh mesh (.msh), not its geometry (.geo).",
            ));
        }
        let version = self.source.word("a version")?.to_owned();
        self.version = match &version[..] {
            "2" | "2.1" | "2.2" => Version::Two,
            "4.1" => Version::Four,
            _ => {
                return Err(self.source.fault(
                    Reason::Unsupported,
                    &format!("MSH {version:.20}"),
                    "MSH 2.2 or 4.1",
                    "Save with gmsh -format msh41 (or msh22).",
                ));
            }
        };
        self.binary = self.source.number::<u8>("0 (ASCII) or 1 (binary)")? == 1;
        let size: u8 = self.source.number("the size of a number")?;
        if size != 8 {
            let got = format!("numbers of {size} bytes");
            return Err(self.source.fault(
                Reason::Unsupported,
                &got,
                "8 bytes",
                "Save the mesh again.",
            ));
        }
        if self.binary {
            let one = i32::from_le_bytes(self.source.bytes("the number 1")?);
            self.source.swapped = one == 1i32.swap_bytes();
            if one != 1 && !self.source.swapped {
                return Err(self.source.fault(
                    Reason::Malformed,
                    "another number",
                    "the number 1",
                    "Check that the file was not sent as text.",
                ));
            }
        }
        self.end("$EndMeshFormat")
    }

    /// Reads the keyword that ends a section, and the line end that precedes it in a binary file.
    fn end(&mut self, end: &str) -> Result<(), ReadError> {
        let found = self.source.word(end)?;
        if found == end {
            return Ok(());
        }
        let got = format!("`{found:.40}`");
        Err(self.source.fault(
            Reason::Malformed,
            &got,
            end,
            "The count at the head of the section is wrong.",
        ))
    }

    fn skip_to(&mut self, end: &str) -> Result<(), ReadError> {
        let first = self.source.line;
        // a binary section may contain any bytes, also such that are not text
        loop {
            match self.source.advance() {
                Ok(true) if self.source.text().trim_end().ends_with(end) => return Ok(()),
                Ok(true) | Err(ReadError::Invalid(_)) => {}
                Ok(false) => {
                    self.source.line = first;
                    return Err(self.source.fault(
                        Reason::Truncated,
                        "a section without its end",
                        end,
                        "Send the whole file.",
                    ));
                }
                Err(error) => return Err(error),
            }
        }
    }

    fn physical_names(&mut self) -> Result<(), ReadError> {
        let count: u64 = self.source.number("the number of names")?;
        for _ in 0..count {
            let dimension: u8 = self.source.number("a dimension")?;
            let tag: i64 = self.source.number("a physical tag")?;
            let text = self.source.text().to_owned();
            let quoted = text
                .split_once('"')
                .and_then(|(_, rest)| rest.rsplit_once('"'));
            let Some((name, _)) = quoted else {
                return Err(self.source.fault(
                    Reason::Malformed,
                    &format!("`{text:.40}`"),
                    "a physical name in quotes",
                    "Write dimension, tag and name, as in `1 3 \"top\"`.",
                ));
            };
            // it is compared and copied for every element that has it
            if name.len() > LONGEST_NAME {
                let got = format!("a name of {} bytes, `{name:.40}…`", name.len());
                let expected = format!("at most {LONGEST_NAME}");
                let hint = "Shorten the name of the physical group.";
                return Err(self.source.fault(Reason::TooLong, &got, &expected, hint));
            }
            self.names
                .insert((dimension, tag.unsigned_abs()), name.to_owned());
        }
        self.end("$EndPhysicalNames")
    }

    fn int(&mut self, what: &str) -> Result<i64, ReadError> {
        if self.binary {
            Ok(i64::from(i32::from_le_bytes(self.source.bytes(what)?)))
        } else {
            self.source.number(what)
        }
    }

    fn size(&mut self, what: &str) -> Result<u64, ReadError> {
        if self.binary {
            Ok(u64::from_le_bytes(self.source.bytes(what)?))
        } else {
            self.source.number(what)
        }
    }

    fn float(&mut self, what: &str) -> Result<f64, ReadError> {
        let value = if self.binary {
            f64::from_le_bytes(self.source.bytes(what)?)
        } else {
            self.source.number(what)?
        };
        if value.is_finite() {
            return Ok(value);
        }
        Err(self.source.fault(
            Reason::NotFinite,
            &format!("{value}"),
            "a finite number",
            "Coordinates and parameters are numbers: mesh the geometry again, and look for degenerate curves or elements there.",
        ))
    }

    fn entities(&mut self) -> Result<(), ReadError> {
        let mut counts = [0; 4];
        for count in &mut counts {
            *count = self.size("the number of entities")?;
        }
        for (dimension, count) in (0u8..).zip(counts) {
            for _ in 0..count {
                let tag = self.int("an entity's tag")?;
                for _ in 0..if dimension == 0 { 3 } else { 6 } {
                    self.float("a coordinate")?;
                }
                let mut physical = Vec::new();
                for _ in 0..self.size("the number of physical tags")? {
                    physical.push(self.int("a physical tag")?.unsigned_abs());
                }
                if dimension > 0 {
                    for _ in 0..self.size("the number of bounding entities")? {
                        self.int("a bounding entity")?;
                    }
                }
                self.entities.insert((dimension, tag), physical);
            }
        }
        Ok(())
    }

    fn node(&mut self, label: u64, place: [f64; 3]) -> Result<(), ReadError> {
        if self.raw.nodes.len() >= NO_NODE as usize {
            return Err(self.source.fault(
                Reason::TooMany,
                &format!("more than {NO_NODE} nodes"),
                "fewer nodes",
                "Use a coarser mesh.",
            ));
        }
        if !self.labels.add(label) {
            return Err(self.source.fault(
                Reason::RepeatedNode,
                &format!("node {label} a second time"),
                "each node once",
                "Save the mesh again.",
            ));
        }
        self.plane.add(label, place);
        self.raw.nodes.push([place[0], place[1]]);
        self.raw.node_labels.push(label);
        Ok(())
    }

    /// Reserves memory for the announced number of nodes.
    fn reserve_nodes(&mut self, count: u64) {
        let count = count.min(MOST_RESERVED) as usize;
        self.raw.nodes.reserve_exact(count);
        self.raw.node_labels.reserve_exact(count);
    }

    /// Reserves memory for the announced number of elements.
    fn reserve_elements(&mut self, count: u64) {
        let count = count.min(MOST_RESERVED) as usize;
        self.raw.elements.reserve_exact(count);
        self.raw.element_labels.reserve_exact(count);
    }

    /// Reads the nodes of version 2. `parametric`: each position is followed by an entity, and by the node's
    /// coordinates on that entity.
    fn nodes_2(&mut self, parametric: bool) -> Result<(), ReadError> {
        let count: u64 = self.source.number("the number of nodes")?;
        self.reserve_nodes(count);
        for _ in 0..count {
            let label = self.int("a node number")?;
            let place = [self.float("x")?, self.float("y")?, self.float("z")?];
            if parametric {
                let dimension = self.int("a dimension")?;
                self.int("an entity's tag")?;
                // points have none, and volumes those of space
                for _ in 0..if (1..3).contains(&dimension) {
                    dimension
                } else {
                    0
                } {
                    self.float("a parametric coordinate")?;
                }
            }
            self.node(label as u64, place)?;
        }
        Ok(())
    }

    fn nodes_4(&mut self) -> Result<(), ReadError> {
        let blocks = self.size("the number of blocks")?;
        let count = self.size("the number of nodes")?;
        self.size("the least node number")?;
        self.size("the largest node number")?;
        self.reserve_nodes(count);
        let mut labels = Vec::new();
        for _ in 0..blocks {
            let dimension = self.int("a dimension")?;
            self.int("an entity's tag")?;
            let parametric = self.int("0 or 1")? == 1;
            labels.clear();
            for _ in 0..self.size("the number of nodes in the block")? {
                labels.push(self.size("a node number")?);
            }
            for &label in &labels {
                let place = [self.float("x")?, self.float("y")?, self.float("z")?];
                for _ in 0..if parametric { dimension } else { 0 } {
                    self.float("a parametric coordinate")?;
                }
                self.node(label, place)?;
            }
        }
        Ok(())
    }

    fn elements_2(&mut self) -> Result<(), ReadError> {
        let count: u64 = self.source.number("the number of elements")?;
        self.reserve_elements(count);
        let mut read = 0;
        while read < count {
            // in binary files a head precedes a run of elements of one kind
            let (label, kind, run, tags) = if self.binary {
                let kind = self.int("a kind of element")?;
                (
                    0,
                    kind,
                    self.int("a number of elements")?.max(1) as u64,
                    self.int("a number of tags")?,
                )
            } else {
                let label: u64 = self.source.number("an element number")?;
                (
                    label,
                    self.source.number("a kind of element")?,
                    1,
                    self.source.number("a number of tags")?,
                )
            };
            let (size, kind) = self.kind(kind)?;
            for _ in 0..run {
                let label = if self.binary {
                    self.int("an element number")? as u64
                } else {
                    label
                };
                let mut physical = 0;
                for tag in 0..tags {
                    let value = self.int("a tag")?;
                    if tag == 0 {
                        physical = value.unsigned_abs();
                    }
                }
                // 0: in no physical group
                let group = [physical];
                self.element(label, kind, size, if physical == 0 { &[] } else { &group })?;
            }
            read += run;
        }
        Ok(())
    }

    /// Merges the copies of an element that version 2 writes, one for each of its physical groups. An element that
    /// occurs twice in one group, or twice without a group, is a fault of the mesh.
    fn merge_repeated(&mut self) {
        let elements = &self.raw.elements;
        let mut order: Vec<u32> = (0..elements.len() as u32).collect();
        let nodes = |e: u32| {
            let mut nodes = [NO_NODE; 8];
            let element = elements[e as usize].iter();
            nodes
                .iter_mut()
                .zip(element)
                .for_each(|(slot, node)| *slot = *node);
            nodes
        };
        order.sort_unstable_by_key(|e| (nodes(*e), *e));
        // the first element with the same nodes
        let mut first: Vec<u32> = (0..elements.len() as u32).collect();
        for pair in order.windows(2) {
            let [a, b] = [pair[0], pair[1]].map(|e| e as usize);
            if elements[a] == elements[b] {
                first[b] = first[a];
            }
        }
        let mut groups = vec![NO_GROUP; elements.len()];
        for (number, group) in (0..).zip(self.raw.groups.values()) {
            for element in group {
                groups[*element as usize] = number;
            }
        }
        let mut seen = std::collections::BTreeSet::new();
        for &e in &order {
            let one = first[e as usize];
            if one != e {
                seen.insert((one, groups[one as usize]));
                let group = groups[e as usize];
                if group == NO_GROUP || !seen.insert((one, group)) {
                    first[e as usize] = e;
                }
            }
        }
        if (0..first.len() as u32).all(|e| first[e as usize] == e) {
            return;
        }
        let mut number = vec![0; first.len()];
        let mut kept = 0;
        for e in 0..first.len() {
            if first[e] as usize == e {
                number[e] = kept;
                self.raw.elements[kept as usize] = self.raw.elements[e];
                self.raw.element_labels[kept as usize] = self.raw.element_labels[e];
                kept += 1;
            }
        }
        self.raw.without_centre = self.raw.without_centre.min(kept as usize);
        self.raw.elements.truncate(kept as usize);
        self.raw.element_labels.truncate(kept as usize);
        for element in self.raw.groups.values_mut().flatten() {
            *element = number[first[*element as usize] as usize];
        }
    }

    fn elements_4(&mut self) -> Result<(), ReadError> {
        let blocks = self.size("the number of blocks")?;
        let count = self.size("the number of elements")?;
        self.size("the least element number")?;
        self.size("the largest element number")?;
        self.reserve_elements(count);
        // taken out, so that the groups of an entity are not copied for each of its blocks
        let entities = std::mem::take(&mut self.entities);
        for _ in 0..blocks {
            let dimension = self.int("a dimension")?;
            let entity = self.int("an entity's tag")?;
            let kind = self.int("a kind of element")?;
            let (size, kind) = self.kind(kind)?;
            let physical = u8::try_from(dimension)
                .ok()
                .and_then(|d| entities.get(&(d, entity)));
            let physical = physical.map_or(&[][..], |tags| tags);
            for _ in 0..self.size("the number of elements in the block")? {
                let label = self.size("an element number")?;
                self.element(label, kind, size, physical)?;
            }
        }
        Ok(())
    }

    /// The number of nodes and the kind of an element type, given by its number in Gmsh.
    fn kind(&self, number: i64) -> Result<(usize, Kind), ReadError> {
        let known = KINDS.iter().find(|kind| kind.0 == number);
        if let Some((_, size, kind)) = known {
            return Ok((*size, *kind));
        }
        let (got, hint) = match number {
            4..=7 | 11..=14 | 17..=19 | 29..=34 => (
                format!("elements of three dimensions (Gmsh's kind {number})"),
                "Mesh the surface only (gmsh -2), or give physical groups to surfaces only.",
            ),
            _ => (
                format!("elements of Gmsh's kind {number}"),
                "Mesh with first or second order (gmsh -order 2; Mesh.SecondOrderIncomplete = 1 for 8 nodes).",
            ),
        };
        Err(self.source.fault(
            Reason::Unsupported,
            &got,
            "triangles of 3 or 6 nodes, quadrilaterals of 4, 8 or 9, lines of 2 or 3, points",
            hint,
        ))
    }

    fn element(
        &mut self,
        label: u64,
        kind: Kind,
        size: usize,
        physical: &[u64],
    ) -> Result<(), ReadError> {
        let mut nodes = [NO_NODE; 9];
        for slot in &mut nodes[..size] {
            let node = self.size_or_int()?;
            *slot = self.labels.get(node).ok_or_else(|| {
                self.source.fault(
                    Reason::UnknownNode,
                    &format!("node {node} in element {label}"),
                    "a node of $Nodes",
                    "Save the mesh again, with all its nodes.",
                )
            })?;
        }
        let place = self.raw.elements.len() as u32;
        let dimension = match kind {
            Kind::Point => 0,
            Kind::Line => 1,
            _ => 2,
        };
        match (kind, nodes) {
            (Kind::Triangle, [a, b, c, ab, bc, ca, ..]) => {
                self.raw
                    .elements
                    .push(Element::Triangle([a, b, c, ab, bc, ca]));
            }
            (Kind::Quad, [a, b, c, d, ab, bc, cd, da, _]) => {
                self.raw.without_centre += usize::from(size == 9);
                self.raw
                    .elements
                    .push(Element::Quad([a, b, c, d, ab, bc, cd, da]));
            }
            _ => {}
        }
        if dimension == 2 {
            self.raw.element_labels.push(label);
        }
        self.members += physical.len();
        let most = (1 << 16) + MOST_GROUPS * (self.raw.elements.len() + self.raw.nodes.len());
        if self.members > most {
            return Err(self.source.fault(
                Reason::TooMany,
                &format!("elements in {} physical groups in total", self.members),
                "at most 16 groups for an element on average",
                "Leave out the groups that are not used.",
            ));
        }
        for tag in physical {
            let name = match self.names.get(&(dimension, *tag)) {
                Some(name) => name.clone(),
                None => tag.to_string(),
            };
            match kind {
                Kind::Point => self.raw.node_sets.entry(name).or_default().push(nodes[0]),
                Kind::Line => self
                    .raw
                    .lines
                    .entry(name)
                    .or_default()
                    .push([nodes[0], nodes[1]]),
                _ => self.raw.groups.entry(name).or_default().push(place),
            }
        }
        Ok(())
    }

    /// Reads a node of an element: version 2 has 4 bytes, version 4 has 8.
    fn size_or_int(&mut self) -> Result<u64, ReadError> {
        match self.version {
            Version::Two => Ok(self.int("a node number")? as u64),
            Version::Four => self.size("a node number"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mesh of one triangle with a physical tag, given in MSH 2.2 at the element, in MSH 4.1 at its surface.
    fn triangle(version: Version, tag: i64) -> String {
        match version {
            Version::Two => format!(
                "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n$EndNodes\n\
                 $Elements\n1\n1 2 2 {tag} 1 1 2 3\n$EndElements\n"
            ),
            Version::Four => format!(
                "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Entities\n0 0 1 0\n1 0 0 0 1 1 0 1 {tag} 0\n$EndEntities\n\
                 $Nodes\n1 3 1 3\n2 1 0 3\n1\n2\n3\n0 0 0\n1 0 0\n0 1 0\n$EndNodes\n\
                 $Elements\n1 1 1 1\n2 1 2 1\n1 1 2 3\n$EndElements\n"
            ),
        }
    }

    #[test]
    fn the_sign_of_a_physical_tag_is_ignored_also_of_the_least_integer() {
        for version in [Version::Two, Version::Four] {
            for (tag, name) in [(-7, "7"), (i64::MIN, "9223372036854775808")] {
                let (mesh, _) = read(triangle(version, tag).as_bytes()).unwrap();
                assert_eq!(mesh.groups[name], [0]);
            }
        }
    }

    #[test]
    fn groups_of_a_surface_are_bounded_as_are_their_names() {
        let refused = |file: &str| match read(file.as_bytes()) {
            Err(ReadError::Invalid(list)) => (list[0].reason, list[0].got.clone()),
            _ => panic!("it was read"),
        };
        let tags = |count: usize| "1 ".repeat(count);
        let elements = |count: usize| -> String {
            let lines: String = (1..=count).map(|k| format!("{k} 1 2 3\n")).collect();
            format!("$Elements\n1 {count} 1 {count}\n2 1 2 {count}\n{lines}$EndElements\n")
        };
        let file = triangle(Version::Four, 1);
        let start = file.find("$Elements").unwrap();
        let many =
            file[..start].replace("1 1 0\n$EndEnt", &format!("2000 {}0\n$EndEnt", tags(2000)));
        assert!(many.contains("2000 1 1"));
        let (reason, got) = refused(&(many + &elements(1000)));
        assert_eq!(reason, Reason::TooMany);
        assert!(got.starts_with("line "), "{got}");
        let name = "n".repeat(1000);
        let named =
            format!("$EndMeshFormat\n$PhysicalNames\n1\n2 1 \"{name}\"\n$EndPhysicalNames\n");
        let (reason, got) = refused(&file.replace("$EndMeshFormat\n", &named));
        assert_eq!((reason, got.len() < 200), (Reason::TooLong, true));
    }
}
