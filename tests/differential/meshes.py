"""A mesh as the problem means it: nodes, elements, and what its names stand for, on the first mesh and on finer ones.

Read from the JSON of `grid` and `inline` meshes as the schema describes them. The text of a mesh file is not read here: who
writes one knows what is in it, and hands it over as the inline mesh it stands for.
"""

import dataclasses

import numpy as np

# positions agree to this part of the mesh's size
ROUNDING = 1e-9


@dataclasses.dataclass
class Mesh:
    """Elements as tuples of 8 or 6 node numbers: corners counter-clockwise, then midsides."""

    nodes: np.ndarray  # (nodes, 2)
    elements: list
    # name -> sides (start, end, midside), the body on the right of start -> end, in the order of the boundary
    boundaries: dict
    groups: dict  # name -> element numbers
    node_sets: dict  # name -> node numbers
    # side of the surface -> the side of the first mesh that it is a part of, and the places -1 … 1 of its start and end there
    parts: dict = dataclasses.field(default_factory=dict)
    first_boundaries: dict = dataclasses.field(default_factory=dict)
    # sides whose midsides are not in the file that they were read from
    raised: bool = False

    @property
    def size(self):
        return float(np.ptp(self.nodes, axis=0).max())


def sides(element):
    """The sides of an element, the body on the right."""
    n = len(element) // 2
    return [(element[(i + 1) % n], element[i], element[n + i]) for i in range(n)]


def surface(mesh):
    """The sides that belong to one element only."""
    found = {}
    for element in mesh.elements:
        for start, end, mid in sides(element):
            found.setdefault(frozenset((start, end)), []).append((start, end, mid))
    return [uses[0] for uses in found.values() if len(uses) == 1]


def chains(edges):
    """Edges in connected runs, each in order; a closed one starts at its first edge."""
    after = {edge[0]: edge for edge in edges}
    ends = {edge[1] for edge in edges}
    left, runs = dict(after), []
    for start in [e[0] for e in edges if e[0] not in ends] + [e[0] for e in edges]:
        run = []
        while start in left:
            run.append(left.pop(start))
            start = run[-1][1]
        if run:
            runs.append(run)
    return runs


def in_order(edges):
    return [edge for run in chains(edges) for edge in run]


def height(polyline, x):
    points = np.asarray(polyline, float)
    return np.interp(x, points[:, 0], points[:, 1])


def from_grid(grid):
    xs, ys = np.asarray(grid["x"], float), np.asarray(grid["y"], float)
    strip = grid.get("top") is not None or grid.get("bottom") is not None
    at = {}

    def corner(i, j):
        if not strip:
            return xs[i], ys[j]
        low = height(grid["bottom"], xs[i]) if grid.get("bottom") is not None else 0.0
        high = height(grid["top"], xs[i])
        return xs[i], low + ys[j] * (high - low)

    nodes = []

    def node(i, j):
        """A node by its place in half cells."""
        if (i, j) not in at:
            corners = [corner(a, b) for a in {i // 2, (i + 1) // 2} for b in {j // 2, (j + 1) // 2}]
            at[i, j] = len(nodes)
            nodes.append(np.mean(corners, axis=0))
        return at[i, j]

    elements = []
    for j in range(0, 2 * len(ys) - 2, 2):
        for i in range(0, 2 * len(xs) - 2, 2):
            places = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1)]
            elements.append(tuple(node(i + a, j + b) for a, b in places))
    right, top = 2 * len(xs) - 2, 2 * len(ys) - 2
    along_x, along_y = range(0, right, 2), range(0, top, 2)
    boundaries = {
        "top": [(node(i, top), node(i + 2, top), node(i + 1, top)) for i in along_x],
        "right": [(node(right, j + 2), node(right, j), node(right, j + 1)) for j in reversed(along_y)],
        "bottom": [(node(i + 2, 0), node(i, 0), node(i + 1, 0)) for i in reversed(along_x)],
        "left": [(node(0, j), node(0, j + 2), node(0, j + 1)) for j in along_y],
    }
    return Mesh(np.array(nodes), elements, boundaries, {}, {})


def from_inline(inline):
    mesh = Mesh(
        np.array(inline["nodes"], float),
        [tuple(e) for e in inline["elements"]],
        {},
        {name: list(e) for name, e in inline.get("groups", {}).items()},
        {name: sorted(set(n)) for name, n in inline.get("node_sets", {}).items()},
    )
    facing = {frozenset(e[:2]): e for e in surface(mesh)}
    for name, edges in inline.get("boundaries", {}).items():
        mesh.boundaries[name] = in_order([facing[frozenset(e[:2])] for e in edges])
    return mesh


def normals(mesh, edge):
    """Unit outward normals at the start, the end and the midside of a side."""
    start, end, mid = mesh.nodes[list(edge)]
    found = []
    for xi in (-1.0, 1.0, 0.0):
        dx, dy = (xi - 0.5) * start + (xi + 0.5) * end - 2 * xi * mid
        found.append(np.array([-dy, dx]) / np.hypot(dx, dy))
    return found


def name_parts(mesh, given):
    """Adds the boundaries and groups that rules name: parts of the first mesh."""
    room = ROUNDING * mesh.size

    def within(nodes, axis, limits):
        low, high = limits
        return all(low - room <= mesh.nodes[n][axis] <= high + room for n in nodes)

    def meets(edge, rule):
        if rule.get("x") and not within(edge, 0, rule["x"]):
            return False
        if rule.get("y") and not within(edge, 1, rule["y"]):
            return False
        if rule.get("box"):
            corners = np.sort(np.array(rule["box"], float), axis=0)
            if not all(within(edge, axis, corners[:, axis]) for axis in (0, 1)):
                return False
        if rule.get("normal"):
            way = np.array(rule["normal"], float)
            least = np.cos(np.radians(rule.get("angle", 1.0)))
            return all(n @ way / np.hypot(*way) >= least - 1e-12 for n in normals(mesh, edge))
        return True

    for name, rule in given.get("boundaries", {}).items():
        edges = mesh.boundaries[rule["side"]] if rule.get("side") else surface(mesh)
        mesh.boundaries[name] = in_order([edge for edge in edges if meets(edge, rule)])
    for name, rule in given.get("groups", {}).items():
        mesh.groups[name] = [
            i
            for i, element in enumerate(mesh.elements)
            if all(within(element, axis, rule[key]) for axis, key in enumerate("xy") if rule.get(key))
        ]


def quad_shape(x, y):
    """Of the 8-node element on (-1, 1)²."""
    corner = lambda a, b: (1 + a * x) * (1 + b * y) * (a * x + b * y - 1) / 4
    return np.array([
        corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1),
        (1 - x * x) * (1 - y) / 2, (1 - y * y) * (1 + x) / 2, (1 - x * x) * (1 + y) / 2, (1 - y * y) * (1 - x) / 2,
    ])  # fmt: skip


def triangle_shape(x, y):
    """Of the 6-node element on x, y, x + y within 0 … 1."""
    a, b, c = 1 - x - y, x, y
    return np.array([a * (2 * a - 1), b * (2 * b - 1), c * (2 * c - 1), 4 * a * b, 4 * b * c, 4 * c * a])


def refine(mesh):
    """Every element in four, on its own map, so that curved sides keep their parabolas."""
    nodes, new = [tuple(p) for p in mesh.nodes], {}

    def make(key, position):
        if key not in new:
            new[key] = len(nodes)
            nodes.append(tuple(position))
        return new[key]

    def quarter(corner, other, mid):
        """The node between a corner and the midside of a side."""
        a, b, m = mesh.nodes[[corner, other, mid]]
        return make((corner, mid), 0.375 * a - 0.125 * b + 0.75 * m)

    elements, children = [], []
    for number, element in enumerate(mesh.elements):
        n, points = len(element) // 2, mesh.nodes[list(element)]
        corners, mids = element[:n], element[n:]
        first = len(elements)
        if n == 4:
            at = lambda x, y: make((number, x, y), quad_shape(x, y) @ points)
            centre = at(0, 0)
            # from the centre towards each midside
            inner = [at(0, -0.5), at(0.5, 0), at(0, 0.5), at(-0.5, 0)]
            for i in range(4):
                c, before, after = corners[i], mids[i - 1], mids[i]
                elements.append((
                    c, after, centre, before,
                    quarter(c, corners[(i + 1) % 4], after), inner[i], inner[i - 1], quarter(c, corners[i - 1], before),
                ))  # fmt: skip
        else:
            at = lambda x, y: make((number, x, y), triangle_shape(x, y) @ points)
            # between the midsides: beside each corner
            inner = [at(0.25, 0.25), at(0.5, 0.25), at(0.25, 0.5)]
            for i in range(3):
                c, before, after = corners[i], mids[i - 1], mids[i]
                elements.append((
                    c, after, before,
                    quarter(c, corners[(i + 1) % 3], after), inner[i], quarter(c, corners[i - 1], before),
                ))  # fmt: skip
            elements.append((mids[0], mids[1], mids[2], inner[1], inner[2], inner[0]))
        children.append(range(first, len(elements)))
    boundaries = {
        name: [
            half
            for a, b, m in edges
            for half in ((a, m, quarter(a, b, m)), (m, b, quarter(b, a, m)))
        ]
        for name, edges in mesh.boundaries.items()
    }
    groups = {name: [c for e in group for c in children[e]] for name, group in mesh.groups.items()}
    parts = {}
    for (a, b, m), (side, low, high) in mesh.parts.items():
        parts[a, m, quarter(a, b, m)] = side, low, (low + high) / 2
        parts[m, b, quarter(b, a, m)] = side, (low + high) / 2, high
    # the quarters of the surface exist already: nothing was added
    return Mesh(np.array(nodes), elements, boundaries, groups, mesh.node_sets, parts, mesh.first_boundaries, mesh.raised)


def place_on(points, position):
    """ξ of the place on a side that is nearest to a position, and how far it is."""
    start, end, mid = points
    xi = 0.0
    for _ in range(30):
        off = xi * (xi - 1) / 2 * start + xi * (xi + 1) / 2 * end + (1 - xi * xi) * mid - position
        way, bend = (xi - 0.5) * start + (xi + 0.5) * end - 2 * xi * mid, start + end - 2 * mid
        xi -= (off @ way) / max(way @ way + off @ bend, 0.1 * way @ way)
    return xi, np.hypot(*off)


def inside(points, position):
    """How far inside of an element a position is, in its master coordinates; negative outside."""
    at, shape = np.array([0.0, 0.0] if len(points) == 8 else [1 / 3, 1 / 3]), quad_shape if len(points) == 8 else triangle_shape
    h = 1e-6
    for _ in range(30):
        off = shape(*at) @ points - position
        dx = (shape(at[0] + h, at[1]) - shape(at[0] - h, at[1])) @ points / (2 * h)
        dy = (shape(at[0], at[1] + h) - shape(at[0], at[1] - h)) @ points / (2 * h)
        at = np.clip(at - np.linalg.solve(np.array([dx, dy]).T, off), -2, 2)
    if np.hypot(*(shape(*at) @ points - position)) > 1e-6 * np.ptp(points):
        return -np.inf
    return 1 - abs(at).max() if len(points) == 8 else min(at[0], at[1], 1 - at.sum())


def descendant(first, nodes, elements):
    """A finer mesh, of the given nodes and elements, with the names of the first one: its sides are parts of sides there, its
    elements of elements."""
    mesh = Mesh(np.asarray(nodes, float), [tuple(e) for e in elements], {}, {}, {}, {}, {}, first.raised)
    room, parent, places = 1e-8 * first.size, {}, {}
    coarse = surface(first)
    for fine in surface(mesh):
        for edge in coarse:
            found = [place_on(first.nodes[list(edge)], mesh.nodes[n]) for n in fine]
            # small sides near a corner are near to the next side too: the midside is on their own
            if all(off < room and abs(xi) < 1 + 1e-6 for xi, off in found) and abs(found[2][0]) < 1:
                parent[fine] = edge
                places[fine] = [xi for xi, _ in found[:2]]
    for name, edges in first.boundaries.items():
        own = {frozenset(e[:2]) for e in edges}
        mesh.boundaries[name] = in_order([fine for fine, edge in parent.items() if frozenset(edge[:2]) in own])
    # of a curved element, the middle of its corners may lie outside
    middle = lambda e: quad_shape(0, 0) if len(e) == 8 else triangle_shape(1 / 3, 1 / 3)
    centres = [middle(e) @ mesh.nodes[list(e)] for e in mesh.elements]
    # the most of a small element beside another one is in its own
    points = [first.nodes[list(e)] for e in first.elements]
    own = [int(np.argmax([inside(p, c) for p in points])) for c in centres]
    for name, group in first.groups.items():
        members = set(group)
        mesh.groups[name] = [i for i, e in enumerate(own) if e in members]
    same = lambda n: int(np.argmin(np.hypot(*(mesh.nodes - first.nodes[n]).T)))
    mesh.parts = {fine: (tuple(same(n) for n in edge), *places[fine]) for fine, edge in parent.items()}
    mesh.first_boundaries = {name: [tuple(same(n) for n in e) for e in edges] for name, edges in first.boundaries.items()}
    for name, members in first.node_sets.items():
        mesh.node_sets[name] = [same(n) for n in members]
    return mesh


def read(given, stands_for=None):
    """The mesh of a problem, refined as often as it asks; `stands_for`: the inline mesh that the text of a file stands for.

    The midsides of a file with elements of corners only belong to no node set, which tells that it has none.
    """
    raised = bool(stands_for and stands_for.get("linear"))
    if "grid" in given:
        mesh = from_grid(given["grid"])
    else:
        mesh = from_inline(stands_for or given["inline"])
    name_parts(mesh, given)
    mesh.raised = raised
    mesh.parts = {side: (side, -1.0, 1.0) for side in surface(mesh)}
    mesh.first_boundaries = dict(mesh.boundaries)
    times = given.get("refine", 0)
    for _ in range(0 if isinstance(times, dict) else times):
        mesh = refine(mesh)
    return mesh
