"""The body as nodes and elements, for programs that are given those: of a grid, or of a mesh of Gmsh.

Standard library only, as `problem.py`.
"""

import dataclasses
import itertools

import problem

CLOSE = 1e-9  # coordinates that differ by less are equal
KINDS = ("9", "16")  # Gmsh's numbers of the plane elements: six-node triangles, eight-node quadrilaterals


@dataclasses.dataclass(frozen=True)
class Body:
    """A rectangle with its upper left corner at the origin. `elements` has the places in `nodes` of each element's
    nodes: corners counter-clockwise, then the middle of each side, as CPE6 and CPE8. All elements are of one kind."""

    nodes: list
    elements: list

    def left(self):
        return self._where(0, 0.0)

    def bottom(self):
        return self._where(1, -self.height())

    def top(self):
        return self._where(1, 0.0)

    def height(self):
        return -min(y for _, y in self.nodes)

    def _where(self, axis, value):
        """The places of the nodes with this coordinate."""
        return [k for k, node in enumerate(self.nodes) if abs(node[axis] - value) < CLOSE]

    def top_sides(self):
        """The element, the side (0: from its first corner to its second) and the nodes (end, middle, end) of each side
        on the top."""
        top, corners = set(self.top()), len(self.elements[0]) // 2
        for number, element in enumerate(self.elements):
            for side in range(corners):
                ends = element[side], element[(side + 1) % corners]
                if top.issuperset(ends):
                    yield number, side, (ends[0], element[corners + side], ends[1])


def read(mesh):
    """The body of a mesh by its name, as `problem.mesh` has it."""
    given = problem.mesh(mesh)
    return _gmsh(given["gmsh"]) if "gmsh" in given else _grid(**given["grid"])


def _grid(x, y):
    """Elements of eight nodes between lines, row by row from the lower left."""
    nodes, number = [], {}
    for j, b in enumerate(_halved(y)):
        for i, a in enumerate(_halved(x)):
            if i % 2 == 0 or j % 2 == 0:
                number[i, j] = len(nodes)
                nodes.append((a, b))
    places = ((0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1))
    cells = itertools.product(range(0, 2 * len(y) - 2, 2), range(0, 2 * len(x) - 2, 2))
    return Body(nodes, [tuple(number[i + a, j + b] for a, b in places) for j, i in cells])


def _halved(lines):
    """The coordinates of the nodes along an axis: the lines and the points halfway between them."""
    halfway = [(a + b) / 2 for a, b in zip(lines, lines[1:])]
    return [c for pair in zip(lines, halfway) for c in pair] + [lines[-1]]


def _gmsh(text):
    """Nodes and plane elements of a file in format 4.1, ASCII. Its sections are blocks with a head of four numbers: the
    last is the count of what follows; the third of a block of elements their kind."""
    nodes, number, elements = [], {}, []
    for _, rows in _blocks(text, "Nodes", lines_each=2):  # all tags of a block, then all places
        half = len(rows) // 2
        for (tag,), place in zip(rows[:half], rows[half:]):
            number[int(tag)] = len(nodes)
            nodes.append((float(place[0]), float(place[1])))
    for head, rows in _blocks(text, "Elements", lines_each=1):
        if head[2] in KINDS:
            elements += [tuple(number[int(tag)] for tag in row[1:]) for row in rows]
    if len({len(element) for element in elements}) != 1:
        raise ValueError("elements of one kind are expected, six-node triangles or eight-node quadrilaterals")
    return Body(nodes, elements)


def _blocks(text, section, lines_each):
    """The head and the rows of each block, as words."""
    begin, end = text.index("$%s\n" % section), text.index("$End%s\n" % section)
    lines = (line.split() for line in text[begin:end].splitlines()[2:])
    for head in lines:
        yield head, list(itertools.islice(lines, lines_each * int(head[3])))
