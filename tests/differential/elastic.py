"""Linear elasticity on 8-node quadrilaterals and 6-node triangles by scikit-fem: stiffness, loads, supports, stresses.

Written from docs/formulation.md (3.1 for elements that do not lock) and the descriptions of the JSON Schema. Components of
strain and stress are xx, yy, zz, xy. Integrals carry the thickness, or r; the 2π of a body of revolution enters totals.
"""

import numpy as np
import scipy.sparse as sparse
import skfem

from meshes import normals, surface

GAUSS = np.polynomial.legendre.leggauss(3)
# above this ratio of κ to the shear stiffness elements get a pressure of their own
LOCKS = 24.0


def edge_shape(xi):
    """Of a side's start, end and midside, -1 … 1."""
    return np.array([xi * (xi - 1) / 2, xi * (xi + 1) / 2, 1 - xi * xi])


def side_error(points):
    """How far the direction of a side at its ends is from the curve that it stands for (radians), 3.12 of formulation.md."""
    start, end, mid = points
    chord, bow = end - start, mid - (start + end) / 2
    along, across = abs(chord @ bow) / (chord @ chord), (chord[0] * bow[1] - chord[1] * bow[0]) / (chord @ chord)
    half = np.arctan(4 * across)
    return abs(half) ** 3 / 4 + 4 * along * abs(half), 2 * half / np.hypot(*chord), np.hypot(*chord)


def curve_error(points):
    """The error of a normal at a side's end (radians)."""
    return min(4 * side_error(points)[0] + 5e-4, 0.26)


def smooth(before, after):
    """Whether the surface goes on smoothly from one side to the next."""
    (ax, ay), (bx, by) = edge_way(before, 1.0), edge_way(after, -1.0)
    turn = abs(np.arctan2(ay * bx - ax * by, ax * bx + ay * by))
    (e1, k1, h1), (e2, k2, h2) = side_error(before), side_error(after)
    return turn <= min(4 * (e1 + e2) + 2 * abs(h1 - h2) * abs(k1 - k2) / 6 + 1e-3, 0.26)


def node_normals(mesh, edges):
    """At every node of a boundary the mean normal of its sides, and of the side beyond an end where the surface goes on
    smoothly."""
    sums, own = {}, set(edges)
    after, before = {e[0]: e for e in surface(mesh)}, {e[1]: e for e in surface(mesh)}
    points = lambda edge: mesh.nodes[list(edge)]
    for edge in edges:
        start, end, mid = normals(mesh, edge)
        for node, n in zip(edge, (start, end, mid)):
            sums[node] = sums.get(node, 0) + n
        beyond = before.get(edge[0])
        if beyond not in own and beyond and smooth(points(beyond), points(edge)):
            sums[edge[0]] = sums[edge[0]] + normals(mesh, beyond)[1]
        beyond = after.get(edge[1])
        if beyond not in own and beyond and smooth(points(edge), points(beyond)):
            sums[edge[1]] = sums[edge[1]] + normals(mesh, beyond)[0]
    return {node: n / np.hypot(*n) for node, n in sums.items()}


def edge_way(points, xi):
    """dx/dξ of a side."""
    return np.array([xi - 0.5, xi + 0.5, -2 * xi]) @ points


def arc(points, low, high):
    """Arc length of a part of a side, by three points."""
    half = (high - low) / 2
    return sum(w * half * np.hypot(*edge_way(points, (low + high) / 2 + half * x)) for x, w in zip(*GAUSS))


def arc_lengths(nodes, chain):
    """Arc length at the nodes start, midside, end, midside … of a chain of sides."""
    s = [0.0]
    for edge in chain:
        points = nodes[list(edge)]
        for low, high in ((-1, 0), (0, 1)):
            s.append(s[-1] + arc(points, low, high))
    return np.array(s)


def values_along(mesh, edges, value):
    """A constant, or [start, end] by arc length, at the start, end and midside of each side of a boundary."""
    if np.isscalar(value):
        return np.full((len(edges), 3), float(value))
    s = arc_lengths(mesh.nodes, edges)
    part = s / s[-1]
    at = value[0] + (value[1] - value[0]) * part
    return np.array([[at[2 * k], at[2 * k + 2], at[2 * k + 1]] for k in range(len(edges))])


def stiffness_3d(material):
    """4 × 4, of xx, yy, zz, xy, and its split into κ and the rest."""
    if "orthotropic" in material:
        m = material["orthotropic"]
        e1, e2, nu12 = m["e1"], m["e2"], m["nu12"]
        e3, nu13, nu23 = m.get("e3", e1), m.get("nu13", 0.0), m.get("nu23", 0.0)
        compliance = np.zeros((4, 4))
        compliance[:3, :3] = [
            [1 / e1, -nu12 / e1, -nu13 / e1],
            [-nu12 / e1, 1 / e2, -nu23 / e2],
            [-nu13 / e1, -nu23 / e2, 1 / e3],
        ]
        compliance[3, 3] = 1 / m["g12"]
        c, s = np.cos(np.radians(m.get("angle", 0.0))), np.sin(np.radians(m.get("angle", 0.0)))
        # strains along the axes 1, 2, 3 from those along x, y, z
        turn = np.array([
            [c * c, s * s, 0, c * s],
            [s * s, c * c, 0, -c * s],
            [0, 0, 1, 0],
            [-2 * c * s, 2 * c * s, 0, c * c - s * s],
        ])  # fmt: skip
        return turn, np.linalg.inv(compliance)
    e, nu = material["youngs_modulus"], material["poissons_ratio"]
    lame, g = e * nu / ((1 + nu) * (1 - 2 * nu)), e / (2 * (1 + nu))
    return np.eye(4), np.diag([2 * g] * 3 + [g]) + lame * np.outer([1, 1, 1, 0], [1, 1, 1, 0])


def section_stiffness(material, plane_stress):
    """The stiffness R without volumetric part, κ, and whether the element has a pressure of its own."""
    turn, own = stiffness_3d(material)
    if plane_stress:
        sub = own - np.outer(own[:, 2], own[2]) / own[2, 2]
        return turn.T @ sub @ turn, 0.0
    kappa = min(own[0, 1], own[0, 2], own[1, 2])
    m = np.array([1.0, 1, 1, 0])
    rest = own - kappa * np.outer(m, m)
    # of an orthotropic material: the three in the plane and across it
    shear = np.trace(rest) / 7
    if kappa > LOCKS * shear * (1 + 1e-12) and np.linalg.eigvalsh(rest).min() > 0:
        return turn.T @ rest @ turn, kappa
    return turn.T @ own @ turn, 0.0


def rule(corners, quadrature):
    """Points and weights on scikit-fem's reference elements."""
    if corners == 4:
        x, w = np.polynomial.legendre.leggauss(quadrature)
        x, w = (x + 1) / 2, w / 2
        return np.array([[a, b] for b in x for a in x]).T, np.array([a * b for b in w for a in w])
    if quadrature == 2:
        return np.array([[1 / 6, 2 / 3, 1 / 6], [1 / 6, 1 / 6, 2 / 3]]), np.full(3, 1 / 6)
    return skfem.quadrature.get_quadrature(skfem.refdom.RefTri, 5)


class Part:
    """Elements of one shape and one formulation, each a piece of its own in scikit-fem."""

    def __init__(self, body, numbers, corners, mixed):
        mesh = body.mesh
        self.body, self.numbers, self.mixed = body, numbers, mixed
        conn = np.array([mesh.elements[i] for i in numbers])
        points = mesh.nodes[conn]
        if corners == 4:
            # scikit-fem's 9-node map is that of 8 nodes with the centre where these put it
            centre = points[:, 4:].sum(axis=1) / 2 - points[:, :4].sum(axis=1) / 4
            points = np.concatenate([points, centre[:, None]], axis=1)
        p = points.reshape(-1, 2).T
        t = np.arange(p.shape[1]).reshape(len(numbers), -1).T
        kinds = {
            (4, False): (skfem.MeshQuad2, skfem.ElementQuadS2),
            (4, True): (skfem.MeshQuad2, skfem.ElementQuad2),
            (3, False): (skfem.MeshTri2, skfem.ElementTriP2),
            (3, True): (skfem.MeshTri2, skfem.ElementTriP2B),
        }
        shape, element = kinds[corners, mixed]
        self.quadrature = 3 if mixed else body.quadrature
        self.basis = skfem.Basis(
            shape(p, t), skfem.ElementVector(element()), quadrature=rule(corners, self.quadrature)
        )
        x = np.asarray(self.basis.global_coordinates())
        self.x = x
        self.depth = x[0] if body.axisymmetric else np.full_like(x[0], body.thickness)
        self.weight = self.basis.dx * self.depth
        dofs = np.stack([2 * conn, 2 * conn + 1], axis=2).reshape(len(numbers), -1)
        if mixed:
            inner = body.inner_dofs(len(numbers))
            dofs = np.concatenate([dofs, inner], axis=1)
        self.dofs = dofs
        rest = np.array([body.stiffness[body.material[i]][0] for i in numbers])
        self.kappa = np.array([body.stiffness[body.material[i]][1] for i in numbers])
        self.rest = rest
        # strains of every basis function: (4, elements, points) each
        self.strains = []
        self.values = []
        for (function,) in self.basis.basis:
            du, u = function.grad, function.value
            shape = self.weight.shape
            hoop = u[0] / x[0] if body.axisymmetric else np.zeros(shape)
            self.strains.append(
                np.array([np.broadcast_to(c, shape) for c in (du[0, 0], du[1, 1], hoop, du[0, 1] + du[1, 0])])
            )
            self.values.append(np.array([np.broadcast_to(c, shape) for c in u]))
        self.strains = np.array(self.strains)  # (functions, 4, elements, points)
        self.values = np.array(self.values)

    def matrices(self):
        """By scikit-fem's assembly, and the volumetric part of those that do not lock."""
        rest, depth, axisymmetric = self.rest, self.depth, self.body.axisymmetric

        def strain(u, w):
            du = u.grad
            hoop = u.value[0] / w.x[0] if axisymmetric else 0 * du[0, 0]
            return [du[0, 0], du[1, 1], hoop, du[0, 1] + du[1, 0]]

        @skfem.BilinearForm
        def form(u, v, w):
            a, b = strain(u, w), strain(v, w)
            return depth * sum(rest[:, i, j, None] * a[j] * b[i] for i in range(4) for j in range(4))

        local = form.elemental(self.basis).tolocal()
        if self.mixed:
            g = self.volumes()
            local = local + np.einsum("e,eki,ekj->eij", self.kappa, g, g)
        return local

    def polynomials(self):
        """1, x, y of every element, orthonormal in it: (elements, 3, points)."""
        ones = np.ones_like(self.weight)
        x = self.x - self.x.mean(axis=2, keepdims=True)
        raw = np.stack([ones, x[0], x[1]], axis=1)
        gram = np.einsum("ekq,elq,eq->ekl", raw, raw, self.weight)
        return np.linalg.solve(np.linalg.cholesky(gram), raw)

    def volumes(self):
        """∫ ψ_k div of every basis function: (elements, 3, functions)."""
        div = self.strains[:, :3].sum(axis=1)
        return np.einsum("ekq,feq,eq->ekf", self.polynomials(), div, self.weight)

    def body_force(self, force):
        return np.einsum("faeq,a,eq->ef", self.values, np.asarray(force, float), self.weight)

    def stresses(self, u):
        """At the integration points: strain, stress (4, elements, points)."""
        own = u[self.dofs]
        strain = np.einsum("fceq,ef->ceq", self.strains, own)
        stress = np.einsum("eij,jeq->ieq", self.rest, strain)
        if self.mixed:
            psi, g = self.polynomials(), self.volumes()
            theta = np.einsum("ekq,ekf,ef->eq", psi, g, own)
            stress[:3] += self.kappa[:, None] * theta
            energy = np.sum(self.weight * (np.einsum("ceq,ceq->eq", strain, np.einsum("eij,jeq->ieq", self.rest, strain)) + self.kappa[:, None] * theta**2)) / 2
        else:
            energy = np.sum(self.weight * np.einsum("ceq,ceq->eq", strain, stress)) / 2
        if self.body.plane_stress:
            stress[2] = 0
        return strain, stress, energy


class Body:
    """The elastic body of a problem: stiffness, and how its nodes are held and loaded."""

    def __init__(self, problem, mesh):
        kind = problem["analysis"]["kind"]
        self.problem, self.mesh = problem, mesh
        self.axisymmetric, self.plane_stress = kind == "axisymmetric", kind == "plane_stress"
        self.thickness = problem["analysis"].get("thickness", 1.0)
        self.ring = 2 * np.pi if self.axisymmetric else 1.0
        self.quadrature = problem.get("quadrature", 3)
        self.stiffness = [section_stiffness(m, self.plane_stress) for m in problem["materials"]]
        self.material = {}
        for k, material in enumerate(problem["materials"]):
            if not material.get("group"):
                self.material.update((i, k) for i in range(len(mesh.elements)) if i not in self.material)
        for k, material in enumerate(problem["materials"]):
            if material.get("group"):
                self.material.update((i, k) for i in mesh.groups[material["group"]])
        self.size = 2 * len(mesh.nodes)
        self.parts = []
        for corners in (4, 3):
            for mixed in (False, True):
                numbers = [
                    i
                    for i, e in enumerate(mesh.elements)
                    if len(e) == 2 * corners and (self.stiffness[self.material[i]][1] > 0) == mixed
                ]
                if numbers:
                    self.parts.append(Part(self, numbers, corners, mixed))
        rows, columns, entries = [], [], []
        for part in self.parts:
            local, n = part.matrices(), part.dofs.shape[1]
            rows.append(np.repeat(part.dofs, n, axis=1).ravel())
            columns.append(np.tile(part.dofs, (1, n)).ravel())
            entries.append(local.reshape(len(local), -1).ravel())
        join = np.concatenate
        self.matrix = sparse.csr_matrix((join(entries), (join(rows), join(columns))), (self.size, self.size))
        self.force = self.loads(problem.get("loads", []))

    def inner_dofs(self, elements):
        """Unknowns of the bubbles."""
        found = np.arange(self.size, self.size + 2 * elements).reshape(elements, 2)
        self.size += 2 * elements
        return found

    def depth(self, x):
        return x if self.axisymmetric else self.thickness

    def loads(self, loads):
        force, left = np.zeros(self.size), {}

        def at_nodes(given, sides=None):
            for node, f in self.at_nodes(force, given, sides).items():
                left[node] = left.get(node, 0.0) + f

        for load in loads:
            if "body_force" in load:
                for part in self.parts:
                    np.add.at(force, part.dofs, part.body_force(load["body_force"]))
            elif "force" in load:
                at_nodes(dict.fromkeys(self.mesh.node_sets[load["nodes"]], load["force"]))
            elif "nodal" in load:
                edges = self.mesh.first_boundaries[load["boundary"]]
                nodes = [edges[0][0]] + [n for _, end, mid in edges for n in (mid, end)]
                at_nodes(dict(zip(nodes, load["nodal"], strict=True)), edges)
            else:
                self.traction(force, load)
        # a side's forces may come from several sets: its corners and its midsides
        for node, f in self.at_nodes(force, left).items():
            force[2 * node : 2 * node + 2] += f / self.ring
        return force

    def at_nodes(self, force, given, sides=None):
        """Forces on nodes of the first mesh. Those on all nodes of a side of the surface are the traction on it that does
        their work on all displacements it has there: on finer meshes they act between the nodes too. Returns those that remain at their nodes."""
        mesh, parts = self.mesh, {}
        for fine, (side, low, high) in mesh.parts.items():
            parts.setdefault(side, []).append((fine, low, high))
        named = lambda side: side[0] in given and side[1] in given and (side[2] in given or mesh.raised)
        # of a side that is not divided its forces are these; it has its share of those on its corners
        whole = [side for side in (sides or parts) if named(side)]
        lengths = {side: arc_lengths(mesh.nodes, [side])[-1] for side in whole}
        around = {}
        for side in whole:
            for node in side[:2]:
                around[node] = around.get(node, 0.0) + lengths[side]
        for side in whole:
            # sides share the force on their common corner by their lengths
            own = [np.array(given[n]) * lengths[side] / around[n] for n in side[:2]]
            if side[2] in given:
                shape, own = edge_shape, [*own, np.array(given[side[2]])]
            else:
                shape = lambda xi: np.array([1 - xi, 1 + xi]) / 2
            mass = sum(w * np.outer(shape(x), shape(x)) for x, w in zip(*GAUSS))
            stress = np.linalg.solve(mass, own)
            for fine, low, high in parts[side]:
                for x, w in zip(*GAUSS):
                    xi = (low + high) / 2 + (high - low) / 2 * x
                    for node, h in zip(fine, edge_shape(x)):
                        force[2 * node : 2 * node + 2] += w * (high - low) / 2 * h * (shape(xi) @ stress) / self.ring
        spent = {n for side in whole for n in side}
        return {node: np.array(f) for node, f in given.items() if node not in spent}

    def traction(self, force, load):
        edges = self.mesh.boundaries[load["boundary"]]
        along = lambda value: values_along(self.mesh, edges, value)
        if "traction" in load:
            first, second = map(along, load["traction"])
        else:
            first = along(load["normal"] if "normal" in load else load.get("pressure", 0.0))
            first = -first if "pressure" in load else first
            second = along(load.get("tangential", 0.0))
        for edge, a, b in zip(edges, first, second):
            points = self.mesh.nodes[list(edge)]
            for xi, w in zip(*GAUSS):
                h, (dx, dy) = edge_shape(xi), edge_way(points, xi)
                part = w * self.depth(h @ points[:, 0])
                if "traction" in load:
                    stress = np.array([h @ a, h @ b]) * np.hypot(dx, dy)
                else:
                    stress = (h @ a) * np.array([-dy, dx]) + (h @ b) * np.array([dx, dy])
                for node, shape in zip(edge, h):
                    force[2 * node : 2 * node + 2] += part * shape * stress

    def supports(self):
        """Held directions of each node with their values: node -> [(unit vector, value)]. How far the most exact of them may be
        off is left in `held_error`."""
        held, mesh = {}, self.mesh
        self.held_error = {}
        if self.axisymmetric:
            for node in np.flatnonzero(mesh.nodes[:, 0] == 0):
                held[int(node)] = [(np.array([1.0, 0]), 0.0)]
                self.held_error[int(node)] = 0.0
        own = self.support_normals()
        for number, support in enumerate(self.problem.get("supports", [])):
            for field in ("ux", "uy", "un", "ut"):
                if support.get(field) is None:
                    continue
                if "nodes" in support:
                    members = mesh.node_sets[support["nodes"]]
                    # a side that is held at all its nodes is held between them too
                    held_sides = [
                        fine
                        for fine, (side, _, _) in mesh.parts.items()
                        if all(n in members for n in (side[:2] if mesh.raised else side))
                    ]
                    members = {*members, *(n for side in held_sides for n in side)}
                    found = dict.fromkeys(members, float(support[field]))
                else:
                    edges = mesh.boundaries[support["boundary"]]
                    found = {
                        n: v
                        for edge, values in zip(edges, values_along(mesh, edges, support[field]))
                        for n, v in zip(edge, values)
                    }
                for node, value in found.items():
                    if field in ("ux", "uy"):
                        way, error = np.array([1.0, 0] if field == "ux" else [0, 1.0]), 0.0
                    else:
                        way, sides = own[number][node], mesh.boundaries[support["boundary"]]
                        error = max(curve_error(mesh.nodes[list(side)]) for side in sides if node in side)
                        way = way if field == "un" else np.array([way[1], -way[0]])
                    held.setdefault(node, []).append((way, value))
                    self.held_error[node] = min(error, self.held_error.get(node, np.inf))
        return held

    def support_normals(self):
        """The normals of the supports along normal or tangent, by the support's number and the node."""
        along = lambda support: support.get("un") is not None or support.get("ut") is not None
        return {
            number: node_normals(self.mesh, self.mesh.boundaries[support["boundary"]])
            for number, support in enumerate(self.problem.get("supports", []))
            if along(support)
        }
