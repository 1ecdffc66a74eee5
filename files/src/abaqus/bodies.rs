//! Translates contact between two surfaces of elastic bodies, `*CONTACT PAIR` and `*TIE`, into contacts of two bodies.

use std::collections::{BTreeMap, BTreeSet};

use super::contact::{CLOSED, MOST_LOOKS, Made, Remarks, Source, looks};
use super::contact_parts::{Adjust, Behavior, Pair, Tie};
use super::tool::{dot, met};
use solver::mesh::{Edge, runs};
use solver::problem::{Against, BodyGap, Condition, Contact};

/// The largest distance of surfaces that `*TIE` joins where it gives none, in mean lengths of a side: that of Abaqus.
const TIED_WITHIN: f64 = 0.05;

/// How far behind a surface the other one is searched, as a part of the size of the mesh.
const BEHIND: f64 = 0.1;

/// The largest number of comparisons of a node with a side that all pairs of a deck take.
const MOST_COMPARED: usize = 300_000_000;

/// What the nodes of a surface face on the other one.
struct Distances {
    /// The distance of each node that faces the other surface, negative where they overlap.
    of_nodes: Vec<f64>,
    /// The largest distance that counts as none.
    closed: f64,
}

impl Distances {
    fn most(&self) -> f64 {
        self.of_nodes.iter().map(|d| d.abs()).fold(0.0, f64::max)
    }
}

impl Source<'_> {
    /// Translates a pair of two surfaces of elastic bodies, of which the first carries the law. `steps`: their number.
    pub(super) fn between_bodies(
        &self,
        pair: &Pair,
        [own, other]: &[String; 2],
        steps: usize,
        remarks: &mut Remarks,
    ) -> Option<Made> {
        let line = pair.line;
        if own == other {
            return remarks.refuse(
                line,
                format!("`{own:.60}` against itself"),
                "two surfaces",
                "A surface that touches itself is divided by *SURFACE into the two parts that meet.",
            );
        }
        let sides = [own, other].map(|name| self.sides(line, name, remarks));
        let [Some(sides), Some(there)] = sides else {
            return None;
        };
        let interaction = self.interaction(pair, remarks);
        let tied = interaction.is_some_and(|i| matches!(i.behavior, Behavior::Tied { .. }));
        let gap = match &pair.tie {
            Some(tie) => {
                let distances = self.distances(sides, there);
                self.check_tie(line, tie, there, &distances, remarks)?;
                None
            }
            None => self.gap(pair, [own, other], [sides, there], remarks)?,
        };
        // load steps scale an interference as they do an indentation
        let overlap = gap.and_then(|gap| gap.interference).unwrap_or(0.0);
        let bonded = tied || pair.tie.is_some();
        let friction = interaction.filter(|_| !bonded);
        let friction = friction.and_then(|interaction| {
            self.behavior(&interaction.behavior, sides, 0.0, remarks);
            self.friction(interaction.friction.as_ref()?, sides, 0.0, remarks)
        });
        Some(Made {
            contact: Contact {
                boundary: own.clone(),
                obstacle: None,
                against: Some(Against {
                    boundary: other.clone(),
                }),
                gap,
                indentation: 0.0,
                normal_force: None,
                direction: None,
                tangential_displacement: 0.0,
                tangential_force: None,
                tilt: None,
                moment: None,
                about: None,
                stiffness: None,
                normal: None,
                condition: match bonded {
                    true => Condition::Bonded,
                    false => Condition::Unilateral,
                },
                friction,
            },
            free: [false; 3],
            moved: vec![[overlap, 0.0, 0.0, 0.0, 0.0, 0.0]; steps],
        })
    }

    /// The distances from nodes of one surface, of a long one only of some, along their normals to the other.
    fn distances(&self, sides: &[Edge], there: &[Edge]) -> Distances {
        let chains = runs(there);
        let points = |chain: &[Edge]| {
            let first = self.mesh.edge_nodes(&chain[0])[0];
            let rest = chain.iter().flat_map(|edge| {
                let [_, end, middle] = self.mesh.edge_nodes(edge);
                [middle, end]
            });
            std::iter::once(first).chain(rest).collect::<Vec<_>>()
        };
        let chains: Vec<_> = chains.iter().map(|chain| points(chain)).collect();
        // all pairs of a deck together within some seconds
        let most = MOST_COMPARED / self.said.pairs.len().max(1);
        let stride = (3 * sides.len()).min(3 * MOST_LOOKS) * 2 * there.len() / most.max(1);
        let size = self.size();
        let nearest = |(place, n)| {
            let hits = chains.iter().filter_map(|chain| {
                let (distance, outward) = met(chain, place, n, BEHIND * size)?;
                (dot(outward, n) < 0.0).then_some(distance)
            });
            hits.min_by(|a, b| a.abs().total_cmp(&b.abs()))
        };
        Distances {
            of_nodes: looks(self.mesh, sides)
                .step_by(stride + 1)
                .filter_map(nearest)
                .collect(),
            closed: CLOSED * size,
        }
    }

    /// The distance that the deck gives two surfaces: by `*CLEARANCE`, or by an `ADJUST` that closes it everywhere.
    fn gap(
        &self,
        pair: &Pair,
        names: [&String; 2],
        [sides, there]: [&[Edge]; 2],
        remarks: &mut Remarks,
    ) -> Option<Option<BodyGap>> {
        let clearances = self.said.clearances.iter().zip(self.clearances);
        let mut of_pair = clearances.filter(|(_, of)| of.each_ref() == names);
        if let Some((clearance, _)) = of_pair.next_back() {
            let apart = clearance.value;
            return Some(Some(BodyGap {
                interference: (apart < 0.0).then_some(-apart),
                clearance: (apart >= 0.0).then_some(apart),
            }));
        }
        let Some(adjust) = pair.adjust else {
            return Some(None);
        };
        let distances = self.distances(sides, there);
        let of_nodes = &distances.of_nodes;
        let moved = of_nodes
            .iter()
            .filter(|d| adjust.moves(**d, distances.closed));
        let moved = moved.count();
        let open = |distance: &&f64| distance.abs() > distances.closed;
        let all = moved == of_nodes.iter().filter(open).count();
        match moved {
            0 => Some(None),
            // a set may have only some of the nodes
            _ if all && matches!(adjust, Adjust::Within(_)) => {
                remarks.differs(format!(
                    "*CONTACT PAIR on line {}: ADJUST closes the distance of the surfaces, up to {:.2e}. Nodes are not moved for it here: the distance counts as 0.",
                    pair.line,
                    distances.most()
                ));
                Some(Some(BodyGap {
                    interference: None,
                    clearance: Some(0.0),
                }))
            }
            _ => remarks.refuse(
                pair.line,
                format!("*CONTACT PAIR with ADJUST, which moves {moved} of the {} nodes examined", of_nodes.len()),
                "an ADJUST that moves all nodes that are not on the other surface, or none",
                "Mesh the bodies so that they touch, and remove ADJUST; or give the distance of all nodes by *CLEARANCE, MASTER=…, SLAVE=…, VALUE=….",
            ),
        }
    }

    /// Checks that `*TIE` joins all nodes of its first surface that face the second, as a bonded contact does.
    fn check_tie(
        &self,
        line: u64,
        tie: &Tie,
        there: &[Edge],
        distances: &Distances,
        remarks: &mut Remarks,
    ) -> Option<()> {
        let within = tie.within.unwrap_or(TIED_WITHIN * self.mean_side(there));
        let within = within.max(distances.closed);
        let of_nodes = &distances.of_nodes;
        let beyond = of_nodes.iter().filter(|d| d.abs() > within).count();
        if beyond == 0 && !of_nodes.is_empty() {
            return Some(());
        }
        let got = match of_nodes.len() {
            0 => "*TIE of two surfaces that do not face one another".to_owned(),
            count => format!(
                "*TIE of two surfaces of which {beyond} of the {count} nodes examined are farther apart than {within:.3e}: the farthest by {:.3e}",
                distances.most()
            ),
        };
        remarks.refuse(
            line,
            got,
            "surfaces of which all nodes that face one another are within POSITION TOLERANCE",
            "Nodes that are farther away are not tied in the deck. Divide the first surface by *SURFACE, so that it has only the sides that are to be tied, or set POSITION TOLERANCE.",
        )
    }

    /// Reports pairs that are written in both directions, and distances of pairs that the deck has not.
    pub(super) fn check_pairs(&self, remarks: &mut Remarks) {
        let pairs = &self.said.pairs;
        let mut known: BTreeMap<[&String; 2], u64> = BTreeMap::new();
        for (pair, [own, other]) in pairs.iter().zip(self.pairs) {
            if let Some(before) = known.get(&[other, own]).filter(|_| own != other) {
                remarks.doubt(
                    pair.line,
                    format!("`{own:.60}` and `{other:.60}` once more, in the opposite direction: the first is on line {before}"),
                    "each pair of surfaces once",
                    "Delete one of the two: the first surface of a pair carries the law, the second follows it. The finer of the two is best put first.",
                );
            }
            known.entry([own, other]).or_insert(pair.line);
        }
        let of_bodies = |(pair, names): &(&Pair, &[String; 2])| {
            let rigid = names.iter().any(|n| self.tools.by_surface.contains_key(n));
            pair.tie.is_none() && !rigid
        };
        let between = pairs.iter().zip(self.pairs).filter(of_bodies);
        let between: BTreeSet<&[String; 2]> = between.map(|(_, names)| names).collect();
        for (clearance, names) in self.said.clearances.iter().zip(self.clearances) {
            let [own, other] = names;
            if !between.contains(names) {
                remarks.doubt(
                    clearance.line,
                    format!("*CLEARANCE between `{own:.60}` (SLAVE) and `{other:.60}` (MASTER)"),
                    "the two surfaces of a *CONTACT PAIR of elastic bodies, in its order",
                    "A rigid surface is placed by its coordinates.",
                );
            }
        }
    }
}
