"""Contact boundaries, and the solution of a problem: condensed to them, by an active set and Newton's method.

Written from docs/formulation.md 1 to 3. The elastic body is that of `elastic.py`; nothing here is taken from the solver that
is tested.
"""

import numpy as np
import scipy.optimize
import scipy.sparse as sparse
import scipy.sparse.linalg

import friction
import obstacles
from elastic import GAUSS, Body, arc_lengths, curve_error, edge_shape, edge_way, node_normals
from meshes import ROUNDING, normals


# So many roundings an entry of a stiffness may be off by: it is a sum of hundreds of products, of both signs.
ROUNDINGS = 16


class Unsolved(Exception):
    """The reference found no solution."""


def without(ends, h):
    """Shape functions of an edge (start, end, midside) of which some ends take no part in friction: the straight line through the
    other two nodes goes on there, and of two such ends the midside node alone is left."""
    a, b, m = h
    return np.array({
        (False, False): [a, b, m],
        (True, False): [0.0, b - a, m + 2 * a],
        (False, True): [a - b, 0.0, m + 2 * b],
        (True, True): [0.0, 0.0, a + b + m],
    }[tuple(map(bool, ends))])  # fmt: skip


class Contact:
    """The part of a boundary that faces its obstacle: nodes in order of arc length, with normals, areas, gaps."""

    def __init__(self, body, given, held):
        self.given, self.body, mesh = given, body, body.mesh
        self.condition = given.get("condition", "unilateral")
        self.obstacle = given["obstacle"]
        edges = mesh.boundaries[given["boundary"]]
        s = arc_lengths(mesh.nodes, edges)
        self.rounding = ROUNDING * s[-1]
        self.edges, first = self.facing(mesh, edges, s)
        self.s = s[2 * first : 2 * (first + len(self.edges)) + 1]
        self.nodes = [self.edges[0][0]] + [n for _, end, mid in self.edges for n in (mid, end)]
        self.positions = mesh.nodes[self.nodes]
        self.normals = self.mean_normals(mesh, self.edges)
        self.snap(held)
        self.areas = np.zeros(len(self.nodes))
        self.points = []  # (s, places in the chain, shape functions, weight)
        for k, edge in enumerate(self.edges):
            own, points = [2 * k, 2 * k + 2, 2 * k + 1], mesh.nodes[list(edge)]
            for xi, w in zip(*GAUSS):
                h = edge_shape(xi)
                weight = w * np.hypot(*edge_way(points, xi)) * body.depth(h @ points[:, 0])
                self.areas[own] += weight * h
                self.points.append((h @ self.s[own], own, h, weight))
        self.law = given.get("friction")
        self.see()

    @staticmethod
    def mean_normals(mesh, edges):
        found = node_normals(mesh, edges)
        return np.array([found[n] for n in [edges[0][0]] + [n for _, end, mid in edges for n in (mid, end)]])

    def coordinate(self, position, s):
        return s if self.obstacle.get("along") == "arc_length" else position[0]

    def facing(self, mesh, edges, s):
        """The edges that face the obstacle with all three nodes, and the number of the first."""
        low, high = self.obstacle.get("from", -np.inf), self.obstacle.get("to", np.inf)
        room, ways = self.rounding, self.mean_normals(mesh, edges)
        found = []
        for k, edge in enumerate(edges):
            for place, node in zip((2 * k, 2 * k + 2, 2 * k + 1), edge):
                c = self.coordinate(mesh.nodes[node], s[place])
                if not low - room <= c <= high + room:
                    break
                if obstacles.seen(self.obstacle, mesh.nodes[node], ways[place], c, room) is None:
                    break
            else:
                found.append(k)
        if not found or found != list(range(found[0], found[-1] + 1)):
            raise Unsolved(f"the contact {self.given['boundary']} is not one chain")
        return [edges[k] for k in found], found[0]

    def snap(self, held):
        """An end that a support holds along its normal or tangent, within the errors of both, has exactly that direction."""
        for end, edge in ((0, self.edges[0]), (len(self.nodes) - 1, self.edges[-1])):
            error = curve_error(self.body.mesh.nodes[list(edge)])
            for way, _ in held.get(self.nodes[end], []):
                across = np.array([-way[1], way[0]])
                for exact in (way, -way, across, -across):
                    if self.normals[end] @ exact > np.cos(error):
                        self.normals[end] = exact

    def see(self):
        """Distance of the obstacle and the parts of a push along normal and tangent."""
        self.distance, self.push = np.zeros(len(self.nodes)), np.zeros((len(self.nodes), 2))
        self.push[:, 0] = 1
        for i, (position, s) in enumerate(zip(self.positions, self.s)):
            found = obstacles.seen(self.obstacle, position, self.normals[i], self.coordinate(position, s), self.rounding)
            if found is None:
                raise Unsolved("the obstacle is not seen along the contact's own normals")
            distance, slope = found
            if self.given.get("normal") == "obstacle":
                # where a support holds the node, what its direction may be off by is no slope (3.12)
                error = self.body.held_error.get(self.nodes[i])
                if error is not None and abs(slope) <= min(max(error, 1e-9), 1e-3):
                    slope = 0.0
                cosine = 1 / np.hypot(1, slope)
                n, t = self.normals[i], obstacles.turned(self.normals[i])
                self.normals[i] = cosine * (n - slope * t)
                self.push[i] = cosine, -cosine * slope
                distance *= cosine
            self.distance[i] = distance
        self.tangents = np.array([obstacles.turned(n) for n in self.normals])

    def gap(self, level):
        return self.distance - self.given.get("indentation", 0.0) * level["indentation"] * self.push[:, 0]

    def drag(self, level):
        moved = self.given.get("tangential_displacement", 0.0) * level["tangential_displacement"]
        return moved + self.given.get("indentation", 0.0) * level["indentation"] * self.push[:, 1]


WHOLE = {"indentation": 1.0, "tangential_displacement": 1.0, "loads": 1.0, "supports": 1.0}


class Reference:
    """A problem, condensed to its contact boundaries."""

    def __init__(self, problem, mesh):
        self.problem, self.mesh = problem, mesh
        self.body = body = Body(problem, self.mesh)
        self.held = body.supports()
        self.contacts = [Contact(body, given, self.held) for given in problem.get("contacts", [])]
        self.supports()
        self.condense()
        self.open = set()
        self.constraints()
        self.both = set()
        self.alone = self.nearest()
        self.friction_points()

    def supports(self):
        """u = free · y + prescribed."""
        size = self.body.size
        self.prescribed = np.zeros(size)
        rows, columns, entries, count = [], [], [], 0

        def add(dof, column, entry):
            rows.append(dof), columns.append(column), entries.append(entry)

        for node in range(len(self.mesh.nodes)):
            x, y = 2 * node, 2 * node + 1
            ways = self.held.get(node, [])
            if not ways:
                add(x, count, 1.0), add(y, count + 1, 1.0)
                count += 2
                continue
            a = np.array([way for way, _ in ways])
            values = np.array([value for _, value in ways])
            if len(ways) == 1 or np.linalg.svd(a, compute_uv=False)[1] < 1e-6:
                self.prescribed[[x, y]] = ways[0][0] * values[0]
                add(x, count, -ways[0][0][1]), add(y, count, ways[0][0][0])
                count += 1
            else:
                self.prescribed[[x, y]] = np.linalg.lstsq(a, values, rcond=None)[0]
        for dof in range(2 * len(self.mesh.nodes), size):
            add(dof, count, 1.0)
            count += 1
        self.free = sparse.csr_matrix((entries, (rows, columns)), (size, count))

    def condense(self):
        stiffness = (self.free.T @ self.body.matrix @ self.free).tocsc()
        nodes = sorted({n for contact in self.contacts for n in contact.nodes})
        dofs = np.array([d for n in nodes for d in (2 * n, 2 * n + 1)], int)
        on = np.unique(self.free[dofs].nonzero()[1]) if len(dofs) else np.array([], int)
        off = np.setdiff1d(np.arange(stiffness.shape[0]), on)
        self.on, self.off = on, off
        self.loads = self.free.T @ self.body.force
        self.pulls = -(self.free.T @ (self.body.matrix @ self.prescribed))
        self.factor = sparse.linalg.splu(stiffness[off][:, off]) if len(off) else None
        self.across = stiffness[off][:, on]
        self.stiffness = stiffness[on][:, on].toarray()
        if len(off) and len(on):
            self.stiffness -= self.across.T @ self.factor.solve(self.across.toarray())
        self.stiffness = (self.stiffness + self.stiffness.T) / 2

    def row(self, node, way):
        """The row that gives the part of a node's free displacement along a direction."""
        dense = self.free[[2 * node, 2 * node + 1]][:, self.on].toarray()
        return np.asarray(way) @ dense

    def constraints(self):
        """Rows of u_n ≤ gap, and of bonded nodes; each belongs to a node of a contact."""
        self.unilateral, self.bonds, rows, bonds = [], [], [], []
        largest = 1e-9
        for number, contact in enumerate(self.contacts):
            contact.first = len(rows)
            contact.index = {}
            if contact.condition == "none":
                continue
            axis = {beside: end for end, beside in self.axis_ends(contact) if contact.nodes[end] not in self.open}
            for i, node in enumerate(contact.nodes):
                if contact.condition == "bonded":
                    for way, which in ((contact.normals[i], 0), (contact.tangents[i], 1)):
                        row = self.row(node, way)
                        if np.abs(row).max() > largest:
                            bonds.append(row)
                            self.bonds.append((number, i, which))
                    continue
                row = self.row(node, contact.normals[i])
                if np.abs(row).max() <= largest:
                    continue
                beside = axis.get(i)
                if beside is not None:
                    row = row - self.row(contact.nodes[beside], contact.normals[beside]) / 8
                contact.index[i] = len(rows)
                rows.append(row)
                self.unilateral.append((number, i, beside))
        self.rows = np.array(rows).reshape(len(rows), len(self.on))
        self.bond_rows = np.array(bonds).reshape(len(bonds), len(self.on))

    def axis_ends(self, contact):
        """Ends on the axis, each with the midside node beside it."""
        last = len(contact.nodes) - 1
        return [pair for pair in ((0, 1), (last, last - 1)) if self.body.axisymmetric and contact.positions[pair[0]][0] == 0]

    def hollow(self):
        """Whether an obstacle is further from a node on the axis than from the midside node beside it (3.5)."""
        return any(
            contact.gap(WHOLE)[end] - contact.gap(WHOLE)[beside] > 1e-10 * (contact.s[-1] - contact.s[0])
            for contact in self.contacts if contact.condition == "unilateral" for end, beside in self.axis_ends(contact)
        )  # fmt: skip

    def limits(self, level):
        """The right sides of the constraints."""
        own = level["supports"] * self.prescribed
        right = np.zeros(len(self.unilateral))
        gaps = [contact.gap(level) for contact in self.contacts]
        drags = [contact.drag(level) for contact in self.contacts]

        def moved(number, i, way):
            node = self.contacts[number].nodes[i]
            return own[[2 * node, 2 * node + 1]] @ way

        for k, (number, i, beside) in enumerate(self.unilateral):
            ways = self.contacts[number].normals
            right[k] = gaps[number][i] - moved(number, i, ways[i])
            if beside is not None:
                right[k] -= (gaps[number][beside] - moved(number, beside, ways[beside])) / 8
        bonded = np.zeros(len(self.bonds))
        for k, (number, i, which) in enumerate(self.bonds):
            contact = self.contacts[number]
            way = (contact.normals, contact.tangents)[which][i]
            bonded[k] = (gaps, drags)[which][number][i] - moved(number, i, way)
        return right, bonded

    def common(self):
        """Ends of two contacts that no support holds, with both."""
        found = {}
        for contact in self.contacts:
            for i in (0, len(contact.nodes) - 1):
                if contact.nodes[i] not in self.held:
                    found.setdefault(contact.nodes[i], []).append((contact, i))
        return {node: ends for node, ends in found.items() if len(ends) == 2}

    def nearest(self):
        """Of which contact a common end is first taken to be: that whose obstacle overlaps the body there or is nearer (3.11)."""
        levels = [dict(WHOLE, **step) for step in self.problem.get("steps") or [{}]]

        def gap(contact, i):
            given = contact.law is not None and contact.law.get("bound") is not None
            return -np.inf if given else min(contact.gap(level)[i] for level in levels)

        gaps = {node: [gap(*end) for end in ends] for node, ends in self.common().items()}
        return {
            node: self.common()[node][0 if own[0] <= own[1] else 1][0] for node, own in gaps.items() if max(own) > 0
        }  # fmt: skip

    def touching(self, states):
        """Of which contact each common end is, from the forces of all steps; where both touch, of both."""
        alone = dict(self.alone)
        states = [np.where(f > 1e-9 * np.abs(f).max(initial=0.0), f, 0.0) for f in states]  # without rounding
        for node, ends in self.common().items():
            force = [[f[c.index[i]] if i in c.index else 0.0 for c, i in ends] for f in states]
            if any(min(of) > 0 for of in force):
                self.both.add(node)
            if node in self.both:
                alone.pop(node, None)
                continue
            at = [of > 0 for of in force[-1]]
            anywhere = [any(states[-1][k] > 0 for k in c.index.values()) for c, _ in ends]
            for own in (at, anywhere if not any(at) else at):
                if sum(own) == 1:
                    alone[node] = ends[own.index(True)][0]
                    break
        return alone

    def oblique(self, contact, i):
        """Whether two directions that are not perpendicular belong to a contact node."""
        node = contact.nodes[i]
        if any(other is not contact and node in other.nodes for other in self.contacts):
            return self.alone.get(node) is not contact
        ways = self.held.get(node, [])
        if not ways or np.linalg.matrix_rank(self.row(node, [1, 0]) ** 2 + self.row(node, [0, 1]) ** 2) == 0:
            return False
        cosine = abs(contact.normals[i] @ ways[0][0])
        return 1e-7 < cosine < 1 - 1e-12

    def friction_points(self):
        """Friction points of all contacts: rows of u_t, weights, the averaging operator."""
        self.patches = []
        for number, contact in enumerate(self.contacts):
            law = contact.law
            if law is None or contact.condition == "bonded":
                continue
            last, oblique = len(contact.nodes) - 1, {}
            for i in (0, last):
                oblique[i] = self.oblique(contact, i)
            points = contact.points
            if law.get("points") == "nodal":
                points = []
                for i in range(last + 1):
                    if self.body.axisymmetric and contact.positions[i][0] == 0:
                        continue
                    k = min(i // 2, last // 2 - 1)
                    own = [2 * k, 2 * k + 2, 2 * k + 1]
                    points.append((contact.s[i], own, np.array([float(j == i) for j in own]), contact.areas[i]))
            slips = []
            for s, own, h, weight in points:
                slips.append((own, without([oblique.get(own[place], False) for place in (0, 1)], h)))
            rows = np.array([
                sum(shape * self.row(contact.nodes[j], contact.tangents[j]) for j, shape in zip(own, h)) for own, h in slips
            ])  # fmt: skip
            patch = {
                "number": number, "contact": contact, "law": law, "rows": rows, "slips": slips,
                "s": np.array([p[0] for p in points]), "weight": np.array([p[3] for p in points]),
                "anchor": np.zeros(len(points)), "average": None,
            }  # fmt: skip
            if law.get("bound") is None:
                patch["operator"] = lambda at, c=contact, law=law: self.average(c, law, at)
                patch["average"] = patch["operator"](patch["s"])
            self.patches.append(patch)

    def mirrored(self, contact, i):
        if self.body.axisymmetric and contact.positions[i][0] == 0:
            return True
        node = contact.nodes[i]
        ways = self.held.get(node, [])
        u = self.prescribed[[2 * node, 2 * node + 1]]
        if not ways or np.any(np.abs(self.row(node, contact.tangents[i])) > 1e-9):
            # an obstacle's normal at a line of symmetry: that of the body decides
            own = self.body_normal(contact, i)
            along = len(ways) == 1 and abs(abs(ways[0][0] @ obstacles.turned(own)) - 1) < 1e-6 and ways[0][1] == 0
            return bool(along)
        return abs(u @ contact.tangents[i]) == 0

    def body_normal(self, contact, i):
        edge = contact.edges[0] if i == 0 else contact.edges[-1]
        return normals(self.mesh, edge)[0 if i == 0 else 1]

    def average(self, contact, law, at):
        ends = [self.mirrored(contact, i) for i in (0, len(contact.nodes) - 1)]
        rings = law.get("measure") == "surface" and self.body.axisymmetric
        return friction.average(law, contact.s, at, ends, contact.positions if rings else None)

    def area(self, contact, i):
        """∫h of a contact node, from the force of its constraint to a pressure; at the axis 3.5 has it."""
        if self.body.axisymmetric and contact.positions[i][0] == 0:
            return contact.areas[1 if i == 0 else i - 1] / 8
        return contact.areas[i]

    def pressures(self, forces, ties):
        """Nodal pressures of every contact from the forces of the constraints."""
        found = [np.zeros(len(contact.nodes)) for contact in self.contacts]
        for force, (number, i, _) in zip(forces, self.unilateral):
            found[number][i] = force / self.area(self.contacts[number], i)
        for number, contact in enumerate(self.contacts):
            for beside, end in self.beside_axis(contact, forces):
                found[number][beside] = (7 / 8 * forces[contact.index[beside]] + forces[contact.index[end]]) / contact.areas[beside]
        for force, (number, i, which) in zip(ties, self.bonds):
            if which == 0:
                found[number][i] = force / self.contacts[number].areas[i]
        return found

    def on_axis(self, contact):
        """Which nodes are on the axis: on a curved side their own shape function has some area, which nothing belongs to (3.5)."""
        return self.body.axisymmetric * (contact.positions[:, 0] == 0)

    def beside_axis(self, contact, forces):
        """The midside node beside one on the axis, where it is in contact: it carries what that node has, R₀ + R₁ (3.5)."""
        for end, beside in self.axis_ends(contact):
            closed = contact.nodes[end] not in self.open
            if closed and end in contact.index and beside in contact.index and forces[contact.index[beside]] > 0:
                yield beside, end

    def pressure_rows(self, patch, forces):
        """dp/d(forces of the constraints) of a patch's contact."""
        contact = patch["contact"]
        rows = np.zeros((len(contact.nodes), len(self.unilateral)))
        for i, k in contact.index.items():
            rows[i, k] = 1 / self.area(contact, i)
        for beside, end in self.beside_axis(contact, forces):
            rows[beside, contact.index[beside]] *= 7 / 8
            rows[beside, contact.index[end]] = 1 / contact.areas[beside]
        return rows

    def right_side(self, level):
        whole = level["loads"] * self.loads + level["supports"] * self.pulls
        right = whole[self.on].copy()
        if len(self.off) and len(self.on):
            right -= self.across.T @ self.factor.solve(whole[self.off])
        return right

    def slip(self, patch, v, level):
        contact = patch["contact"]
        drag, own = contact.drag(level), level["supports"] * self.prescribed
        e = patch["rows"] @ v - patch["anchor"]
        for k, (places, h) in enumerate(patch["slips"]):
            for j, shape in zip(places, h):
                node = contact.nodes[j]
                e[k] += shape * (own[[2 * node, 2 * node + 1]] @ contact.tangents[j] - drag[j])
        return e

    def frictionless(self, right, limit, bonded):
        """Displacements and forces without friction: the least energy, by non-negative least squares of its dual.

        Supports may leave a rigid motion free, and bonds are stiff springs here: each pass adds a small stiffness, moves the
        state it pulls to, and ends when the contact stays. Newton's method goes on from there, exactly.
        """
        n, m = len(self.on), len(self.unilateral)
        v, forces = np.zeros(n), np.zeros(m)
        if n == 0:
            return v, forces
        scale = np.mean(np.diag(self.stiffness))
        shift, bond = 1e-7 * scale, 1e6 * scale
        base = self.stiffness + shift * np.eye(n) + bond * self.bond_rows.T @ self.bond_rows
        lower = np.linalg.cholesky(base)
        across = np.linalg.solve(lower, self.rows.T)
        own = np.linalg.lstsq(across.T, limit, rcond=None)[0] if m else 0.0
        for _ in range(30):
            load, before = right + shift * v + bond * self.bond_rows.T @ bonded, forces
            if m:
                target = np.linalg.solve(lower, load) - own
                unit = max(np.abs(target).max(), 1e-300)
                forces = unit * scipy.optimize.nnls(across, target / unit, maxiter=50 * m)[0]
            v = np.linalg.solve(lower.T, np.linalg.solve(lower, load - self.rows.T @ forces))
            if np.array_equal(before > 0, forces > 0):
                break
        return v, forces

    def newton(self, level, v, forces, ties, strength=1.0, widen=1.0, most=100, exact=1e-12):
        """Newton's method for everything at once; `strength` and `widen` change friction on the way to the problem."""
        right = self.right_side(level)
        limit, bonded = self.limits(level)
        n, m, b = len(self.on), len(self.unilateral), len(self.bonds)
        stiff = np.mean(np.diag(self.stiffness)) if n else 1.0
        best = np.inf
        for count in range(most):
            jacobian = np.zeros((n + m + b, n + m + b))
            jacobian[:n, :n] = self.stiffness
            jacobian[:n, n : n + m], jacobian[:n, n + m :] = self.rows.T, self.bond_rows.T
            residual = np.zeros(n + m + b)
            terms = np.abs(self.stiffness) @ np.abs(v) + np.abs(right)
            residual[:n] = self.stiffness @ v - right + self.rows.T @ forces + self.bond_rows.T @ ties
            for patch in self.patches:
                law = dict(patch["law"], elastic_slip=patch["law"]["elastic_slip"] * widen)
                to_pressure = self.pressure_rows(patch, forces)
                tau, slope = friction.bound(law, patch["average"], to_pressure @ forces, patch["s"])
                e = self.slip(patch, v, level)
                phi, stiffness, _ = friction.transition(law, e)
                weight = strength * patch["weight"]
                residual[:n] += patch["rows"].T @ (weight * tau * phi)
                terms += np.abs(patch["rows"]).T @ (weight * tau * np.abs(phi))
                jacobian[:n, :n] += patch["rows"].T @ ((weight * tau * stiffness)[:, None] * patch["rows"])
                if patch["average"] is not None:
                    change = slope[:, None] * (patch["average"] @ to_pressure)
                    jacobian[:n, n : n + m] += patch["rows"].T @ ((weight * phi)[:, None] * change)
            over = self.rows @ v - limit
            active = forces + stiff * over > 0
            residual[n : n + m] = np.where(active, stiff * over, -forces)
            for k in range(m):
                if active[k]:
                    jacobian[n + k, :n] = stiff * self.rows[k]
                else:
                    jacobian[n + k, n + k] = -1.0
            residual[n + m :] = stiff * (self.bond_rows @ v - bonded)
            jacobian[n + m :, :n] = stiff * self.bond_rows
            size = max(np.max(terms, initial=0.0), np.abs(forces).max(initial=0.0), 1e-300)
            best = np.abs(residual).max(initial=0.0) / size
            if best <= exact:
                return v, forces, ties
            try:
                step = np.linalg.solve(jacobian, -residual)
            except np.linalg.LinAlgError:
                jacobian[:n, :n] += 1e-9 * stiff * np.eye(n)
                step = np.linalg.lstsq(jacobian, -residual, rcond=None)[0]
            # shorter steps lead out of a cycle between stick and slip, whole ones to the end
            step *= 1.0 if count < 20 or count % 10 > 5 else 0.4
            v, forces, ties = v + step[:n], forces + step[n : n + m], ties + step[n + m :]
            if not np.all(np.isfinite(v)):
                break
        if best <= 1e-9:
            return v, forces, ties
        raise Unsolved(f"Newton's method ended at a residual of {best:.1e}")

    def near(self, level, profiles):
        """The state near one that is given by its profiles: displacements and pressures at the contact nodes."""
        u, forces = level["supports"] * self.prescribed, np.zeros(len(self.unilateral))
        for contact in self.contacts:
            given = profiles[contact.given["boundary"]]
            at = [int(np.argmin(np.abs(np.array(given["s"]) - s))) for s in contact.s]
            for i, (node, row) in enumerate(zip(contact.nodes, at)):
                n, t = (given[f"{way}_displacement"][row] for way in ("normal", "tangential"))
                u[[2 * node, 2 * node + 1]] = n * contact.normals[i] + t * contact.tangents[i]
                if i in contact.index:
                    forces[contact.index[i]] = -given["normal_stress"][row] * self.area(contact, i)
        v = (self.free.T @ (u - level["supports"] * self.prescribed))[self.on]
        return self.newton(level, v, forces, np.zeros(len(self.bonds)))

    def level(self, level):
        """The state at one load level: by Newton's method at once, else along a way on which friction grows or hardens."""
        limit, bonded = self.limits(level)
        first = (*self.frictionless(self.right_side(level), limit, bonded), np.zeros(len(self.bonds)))
        # each a list of (strength of friction, its elastic slip in those of the law)
        plans = [[(1.0, 1.0)]]
        if self.patches:
            plans.append([(1.0, 2.0**k) for k in range(12, -1, -1)])
            plans.append([(k / 16, 1.0) for k in range(17)])
            plans.append([(k / 8, 2.0**10) for k in range(9)] + [(1.0, 2.0 ** (k / 2)) for k in range(19, -1, -1)])
        for plan in plans:
            state = first
            try:
                for strength, widen in plan:
                    state = self.newton(level, *state, strength, widen)
                return state
            except Unsolved as failure:
                last = failure
        raise last

    def solve(self, known=None):
        """The result of every load step; `known`: profiles at the end of each, near which a solution is sought.

        Again where an end of two contacts was taken to be of the wrong one, and once more with plain bounds where an obstacle is
        hollow at the axis (3.5), unless the node there touches then.
        """
        self.open = set()
        self.constraints()
        closed = None
        for _ in range(8):
            results, states = self.follow(known)
            alone = self.touching(states)
            if alone != self.alone:
                self.alone = alone
                self.friction_points()
                continue
            if closed is not None:
                return closed if self.on_axis_touch(states[-1]) else results
            self.open = self.open_on_axis(states[-1]) if self.hollow() else set()
            if not self.open:
                return results
            closed = results
            self.constraints()
            self.friction_points()
        raise Unsolved("a common end of two contacts changes between them")

    def open_on_axis(self, forces):
        """Nodes on the axis that are open beside a midside node that presses."""
        least = 1e-9 * np.abs(forces).max(initial=0.0)

        def pressed(contact, i):
            return i in contact.index and forces[contact.index[i]] > least

        ends = ((contact, *pair) for contact in self.contacts for pair in self.axis_ends(contact))
        return {c.nodes[end] for c, end, beside in ends if end in c.index and pressed(c, beside) and not pressed(c, end)}

    def on_axis_touch(self, forces):
        """Whether a node that was left open touches."""
        least = 1e-9 * np.abs(forces).max(initial=0.0)
        indices = (c.index.get(i) for c in self.contacts for i, node in enumerate(c.nodes) if node in self.open)
        return any(k is not None and forces[k] > least for k in indices)

    def follow(self, known):
        """The results of all steps, and the forces of the constraints at the end of each increment."""
        steps = self.problem.get("steps") or [None]
        for patch in self.patches:
            patch["anchor"] = np.zeros(len(patch["s"]))
        before = dict.fromkeys(WHOLE, 0.0)
        results, states = [], []
        for number, step in enumerate(steps):
            end = dict(WHOLE)
            increments = 1
            if step is not None:
                end = {key: step.get(key, 0.0 if key == "tangential_displacement" else 1.0) for key in WHOLE}
                increments = step.get("increments", 1)
            # an increment matters to a law that depends on the path, and to which contact a common end is of
            whole_path = self.common() or any(p["law"].get("history") == "incremental" for p in self.patches)
            for k in range(1, increments + 1):
                if not whole_path and k < increments:
                    continue
                part = k / increments
                level = {key: before[key] + part * (end[key] - before[key]) for key in WHOLE}
                state = self.near(level, known[number]) if known and k == increments else self.level(level)
                result = self.result(level, *state)
                self.anchor(level, *state)
                states.append(state[1])
            before = end
            results.append(result)
        return results, states

    def anchor(self, level, v, forces, ties):
        taus = []
        for patch in self.patches:
            tau, _ = friction.bound(patch["law"], patch["average"], self.pressure_rows(patch, forces) @ forces, patch["s"])
            taus.append(tau)
        largest = max((tau.max(initial=0.0) for tau in taus), default=0.0)
        for patch, tau in zip(self.patches, taus):
            if patch["law"].get("history") == "incremental":
                e, length = self.slip(patch, v, level), patch["law"]["elastic_slip"]
                patch["anchor"] = patch["anchor"] + np.where(tau <= 1e-12 * largest, e, e - np.clip(e, -length, length))

    def strained(self, u):
        """Stresses at the integration points that are reported, and the strain energy (without 2π)."""
        stresses, strain_energy = [], 0.0
        for part in self.body.parts:
            _, stress, energy = part.stresses(u)
            strain_energy += energy
            if part.quadrature == self.body.quadrature:
                # elements that do not lock are reported at fewer points than they are integrated with, if it is so asked
                stresses.append((part.x.reshape(2, -1).T, stress.reshape(4, -1).T))
        return stresses, strain_energy

    def rounding(self, results):
        """How much rounding of the stiffness may change a body without contact: (displacements, stresses, energies), in any step.

        An entry K_ij is known to some roundings of itself, which changes the force on i by that part of K_ij u_j. What such forces,
        with random signs, do to the body is large where it moves far and strains little, is thin, or nearly incompressible. The
        largest of a few trials.
        """
        if self.factor is None:
            return 0.0, 0.0, 0.0
        random, trials = np.random.default_rng(1), []
        entries = abs(self.body.matrix)
        # a step that takes all loads away leaves rounding of the displacements before it
        terms = np.max([entries @ np.abs(result["whole"]) for result in results], axis=0)
        for _ in range(8):
            forces = ROUNDINGS * 2.0**-52 * terms * random.choice([-1.0, 1.0], len(terms))
            error = self.free @ self.factor.solve(self.free.T @ forces)
            stresses = max((np.abs(stress).max() for _, stress in self.strained(error)[0]), default=0.0)
            changes = [self.strained(result["whole"] + error)[1] - self.strained(result["whole"])[1] for result in results]
            trials.append((np.abs(error[: 2 * len(self.mesh.nodes)]).max(), stresses, self.body.ring * np.abs(changes).max()))
        return np.max(trials, axis=0)

    def result(self, level, v, forces, ties):
        body, ring = self.body, self.body.ring
        whole = level["loads"] * self.loads + level["supports"] * self.pulls
        y = np.zeros(len(whole))
        y[self.on] = v
        if len(self.off):
            y[self.off] = self.factor.solve(whole[self.off] - self.across @ v)
        u = self.free @ y + level["supports"] * self.prescribed
        stress, strain_energy = self.strained(u)
        found = {"u": u[: 2 * len(self.mesh.nodes)].reshape(-1, 2), "whole": u, "stress": stress}
        energy = strain_energy - level["loads"] * body.force @ u
        normal, tangential, total, work = 0.0, 0.0, 0.0, 0.0
        pressures = self.pressures(forces, ties)
        found["profiles"], found["contacts"] = {}, {}
        for number, contact in enumerate(self.contacts):
            reactions = np.zeros(len(contact.nodes))
            shear = 0.0
            for force, (of, i, beside) in zip(forces, self.unilateral):
                if of == number:
                    reactions[i] += force
                    if beside is not None:
                        reactions[beside] -= force / 8
            for force, (of, i, which) in zip(ties, self.bonds):
                if of == number and which == 0:
                    reactions[i] += force
                elif of == number:
                    shear -= force
            own = {"normal_force": ring * reactions.sum(), "tangential_force": ring * shear, "friction_force": 0.0}
            n, t = (np.einsum("ia,ia->i", found["u"][contact.nodes], way) for way in (contact.normals, contact.tangents))
            profile = {
                "s": contact.s, "gap": contact.gap(level), "normal_displacement": n, "tangential_displacement": t,
                "normal_stress": -pressures[number], "areas": ring * contact.areas * (1 - self.on_axis(contact)),
            }  # fmt: skip
            for patch in self.patches:
                if patch["number"] == number:
                    law = patch["law"]
                    tau, _ = friction.bound(law, patch["average"], pressures[number], patch["s"])
                    e = self.slip(patch, v, level)
                    phi, _, potential = friction.transition(law, e)
                    stress, w = -tau * phi, patch["weight"]
                    own["tangential_force"] = ring * (w @ stress)
                    own["friction_force"] = ring * (w @ np.abs(stress))
                    energy += w @ (tau * potential)
                    work += ring * (w @ (tau * np.abs(phi * e)))
                    profile["points"] = {"s": patch["s"], "tangential_stress": stress, "friction_bound": tau}
                    if patch["average"] is not None:
                        profile["points"]["nonlocal_pressure"] = patch["average"] @ pressures[number]
            normal += own["normal_force"]
            tangential += own["tangential_force"]
            total += own["friction_force"]
            found["profiles"][contact.given["boundary"]] = profile
            found["contacts"][contact.given["boundary"]] = own
        found["summary"] = {
            "normal_force": normal, "tangential_force": tangential, "friction_force": total,
            "strain_energy": ring * strain_energy, "energy": ring * energy,
        }  # fmt: skip
        if not any(p["law"].get("history") == "incremental" for p in self.patches):
            found["summary"]["friction_work"] = work
        return found
