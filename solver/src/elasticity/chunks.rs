//! Work on all elements of a mesh, some at once, on one thread or two with the same result.

use crate::elasticity::geometry::{Elements, MOST_POINTS, MeshStations};
use crate::element::Element;
use crate::linear::{Interrupt, Stopped, for_each_in_order};

/// The largest number of elements of a chunk. What is found of so many stays in the caches of a processor.
const CHUNK: usize = 128;

/// The work for the stresses of one element, in multiplications.
const WORK_OF_AN_ELEMENT: usize = 3000;

/// Consecutive elements of a mesh.
pub(super) struct Chunk<'a> {
    /// The number of the first element.
    pub(super) first: usize,
    /// The number of its first integration point, among all of the mesh.
    pub(super) first_point: usize,
    pub(super) elements: &'a [Element],
}

impl<'a> Chunk<'a> {
    /// The elements with their numbers.
    pub(super) fn numbered(&self) -> impl Iterator<Item = (usize, &'a Element)> {
        (self.first..).zip(self.elements)
    }
}

impl<'a> Elements<'a> {
    /// Works on all elements, on `threads` threads, at least one: `work` has a chunk of them and a workspace, and `add` gets the
    /// workspace after it, in the order of the elements. `workspace`: makes one with the memory that a chunk needs, since memory
    /// is counted on the thread that takes it; it is given the largest numbers of elements and of integration points of a chunk.
    pub(super) fn for_each_chunk<W: Send>(
        self,
        threads: usize,
        workspace: impl Fn(usize, usize) -> W,
        work: impl Fn(&mut W, &mut MeshStations<'a>, &Chunk<'a>) + Sync,
        mut add: impl FnMut(&mut W, &Chunk<'a>) + Send,
        interrupt: &mut Interrupt<'_>,
    ) -> Result<(), Stopped> {
        let (mesh, quadrature) = (self.mesh, self.tables.quadrature);
        let mut first_point = 0;
        let chunks = mesh.elements.chunks(CHUNK).enumerate();
        let chunks = chunks.map(|(k, elements)| {
            let chunk = Chunk {
                first: k * CHUNK,
                first_point,
                elements,
            };
            let points = elements.iter().map(|e| e.family().rule(quadrature).len());
            first_point += points.sum::<usize>();
            chunk
        });
        let most = mesh.elements.len().min(CHUNK);
        let workspace = || workspace(most, most * MOST_POINTS);
        let workspaces = (0..threads).map(|_| (workspace(), self.stations()));
        for_each_in_order(
            (chunks, (WORK_OF_AN_ELEMENT * CHUNK) as f64),
            &mut workspaces.collect::<Vec<_>>(),
            |(own, stations), chunk| work(own, stations, chunk),
            |(own, _), chunk| add(own, &chunk),
            interrupt,
        )
    }
}
