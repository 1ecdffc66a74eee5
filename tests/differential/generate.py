"""Random problems by number: the same number is the same problem.

`problem(seed)` returns the problem as JSON, the inline mesh that the text of its mesh file stands for (None without one), and
the names of the features it has, for the table of counts.
"""

import random

import numpy as np

import obstacles
from elastic import arc_lengths, curve_error, smooth
from files import abaqus_text, gmsh_text
from meshes import Mesh, chains, from_grid, from_inline, name_parts, normals, quad_shape, triangle_shape

SIDES = ("bottom", "right", "top", "left")
# places of a side's nodes (corners, midside) in an element
SIDES_OF_QUAD = [(k, (k + 1) % 4, 4 + k) for k in range(4)]
SIDES_OF_TRIANGLE = [(k, (k + 1) % 3, 3 + k) for k in range(3)]


class Draw:
    """Random numbers that do not change with the version of Python."""

    def __init__(self, seed):
        self.random = random.Random(seed).random

    def between(self, low, high):
        return low + (high - low) * self.random()

    def integer(self, low, high):
        return low + int((high - low + 1) * self.random())

    def chance(self, part):
        return self.random() < part

    def one(self, choices):
        return choices[self.integer(0, len(choices) - 1)]

    def shuffled(self, items):
        return sorted(items, key=lambda _: self.random())

    def round(self, low, high, digits=3):
        return float(f"{self.between(low, high):.{digits}g}")


class Generator:
    def __init__(self, seed, contacts=True):
        self.draw, self.features = Draw(seed), set()
        self.problem = {"title": f"problem {seed}"}
        self.analysis()
        self.body()
        self.materials()
        self.roles(contacts)
        self.supports()
        self.contacts()
        self.loads()
        self.steps()
        self.adapt()

    def has(self, *features):
        self.features.update(features)

    def analysis(self):
        kind = self.draw.one(["plane_strain", "plane_strain", "plane_stress", "axisymmetric"])
        self.kind = kind
        self.problem["analysis"] = {"kind": kind}
        if kind == "plane_stress":
            self.problem["analysis"]["thickness"] = self.draw.round(0.05, 2)
        self.has(kind)

    # the body: cells between lines, on a map

    def lines(self, length, count):
        draw = self.draw
        steps = [draw.between(0.6, 1.4) for _ in range(count)]
        at = np.cumsum([0.0] + steps) / sum(steps) * length
        return [float(f"{x:.6g}") for x in at]

    def body(self):
        draw = self.draw
        nx, ny = draw.integer(1, 6), draw.integer(1, 4)
        width, height = draw.between(1, 3), draw.between(0.7, 2)
        left = 0.0
        if self.kind == "axisymmetric" and draw.chance(0.6):
            left = draw.between(0.3, 2)
        elif self.kind != "axisymmetric":
            left = draw.between(-2, 1)
        left = float(f"{left:.4g}")
        xs = [float(f"{left + x:.8g}") for x in self.lines(width, nx)]
        self.cells = nx * ny
        source = draw.one(["grid", "strip", "inline", "inline", "inline", "gmsh", "gmsh", "abaqus", "abaqus"])
        self.stands_for = None
        self.source = source
        self.curved = False
        if source in ("grid", "strip"):
            grid = {"x": xs, "y": self.lines(height, ny)}
            if source == "strip":
                grid["y"] = self.lines(1.0, ny)
                at = [x for k, x in enumerate(xs) if k in (0, nx) or draw.chance(0.5)]
                grid["top"] = [[x, float(f"{height * draw.between(0.85, 1.15):.6g}")] for x in at]
                if draw.chance(0.5):
                    at = [x for k, x in enumerate(xs) if k in (0, nx) or draw.chance(0.3)]
                    grid["bottom"] = [[x, float(f"{height * draw.between(-0.15, 0.1):.6g}")] for x in at]
            self.problem["mesh"] = {"grid": grid}
            self.mesh = from_grid(grid)
            self.has(f"mesh: {source}")
        else:
            ys = self.lines(height, ny)
            mesh = self.mapped(xs, ys, draw.one(["plain", "skew", "arc", "disc", "bump", "hollow"]))
            if folded(mesh):
                mesh = self.mapped(xs, ys, "plain")
            linear = source != "inline" and not self.curved and draw.chance(0.4)
            inline = self.written(mesh, linear)
            self.mesh = from_inline(inline)
            if source == "inline":
                self.problem["mesh"] = {"inline": inline}
                self.has("mesh: inline")
            else:
                self.stands_for = inline
                if source == "gmsh":
                    version = draw.one(["2.2", "4.1"])
                    text = gmsh_text(draw, inline, version, linear)
                    self.has(f"mesh: Gmsh {version}" + (", linear elements" if linear else ""))
                else:
                    text = abaqus_text(draw, inline, self.kind, linear)
                    self.has("mesh: Abaqus" + (", linear elements" if linear else ""))
                self.problem["mesh"] = {source: text}
            if self.curved:
                self.has("curved sides")
            kinds = {len(e) for e in self.mesh.elements}
            self.has({8: "quadrilaterals", 6: "triangles"}[kinds.pop()] if len(kinds) == 1 else "mixed elements")
        refine = draw.one([0, 0, 0, 1, 1, 2])
        while self.cells * 4**refine > 64:
            refine -= 1
        if refine:
            self.problem["mesh"]["refine"] = refine
        self.refine = refine
        self.has(f"refine {refine}")
        if self.cells > 2 and draw.chance(0.1):
            self.problem["quadrature"] = 2
            self.has("quadrature 2")
        self.rules()
        self.size = self.mesh.size

    def mapped(self, xs, ys, shape):
        """Cells between lines, on a map; some of them cut into triangles."""
        draw = self.draw
        width, height, left = xs[-1] - xs[0], ys[-1], xs[0]
        amount = draw.between(0.1, 0.35)
        lean = draw.between(-0.3, 0.3)
        angle, radius = draw.between(0.3, 1.0), draw.between(0.5, 2)
        self.curved = shape not in ("plain", "skew")
        if shape == "arc" and self.kind == "axisymmetric":
            begin, end = (0.0 if xs[0] == 0 else 0.2), 0.2 + angle
        else:
            begin, end = -angle, draw.between(0.2, 1.0)

        def place(x, y):
            part = (x - left) / width
            if shape == "skew":
                if self.kind == "axisymmetric":
                    return x, y + lean * (x - left)
                return x + lean * y, y
            if shape == "arc":
                theta = begin + (end - begin) * part
                r = radius + y
                return r * np.sin(theta), r * np.cos(theta)
            if shape == "disc":
                big = width / (0.6 + amount)
                low = big - np.sqrt(big**2 - (x - left) ** 2)
                return x, low + y / height * (height + big * 0.35 - low)
            if shape == "bump":
                return x, y * (1 + amount * np.sin(np.pi * part))
            if shape == "hollow":
                return x, y * (1 - amount * np.sin(np.pi * part)) - 0.3 * amount * (1 - y / height) * (2 * part - 1) ** 2
            return x, y

        nodes, at = [], {}
        nx, ny = len(xs) - 1, len(ys) - 1
        half = lambda lines, k: (lines[k // 2] + lines[(k + 1) // 2]) / 2

        def node(i, j):
            if (i, j) not in at:
                at[i, j] = len(nodes)
                nodes.append([float(v) for v in place(half(xs, i), half(ys, j))])
            return at[i, j]

        elements, cut = [], draw.one([0.0, 0.0, 1.0, 0.5])
        for j in range(0, 2 * ny, 2):
            for i in range(0, 2 * nx, 2):
                n = lambda a, b, i=i, j=j: node(i + a, j + b)
                if not draw.chance(cut):
                    elements.append([n(0, 0), n(2, 0), n(2, 2), n(0, 2), n(1, 0), n(2, 1), n(1, 2), n(0, 1)])
                elif draw.chance(0.5):
                    elements.append([n(0, 0), n(2, 0), n(2, 2), n(1, 0), n(2, 1), n(1, 1)])
                    elements.append([n(0, 0), n(2, 2), n(0, 2), n(1, 1), n(1, 2), n(0, 1)])
                else:
                    elements.append([n(0, 0), n(2, 0), n(0, 2), n(1, 0), n(1, 1), n(0, 1)])
                    elements.append([n(2, 0), n(2, 2), n(0, 2), n(2, 1), n(1, 2), n(1, 1)])
        last, top = 2 * nx, 2 * ny
        boundaries = {
            "top": [(node(i, top), node(i + 2, top), node(i + 1, top)) for i in range(0, last, 2)],
            "right": [(node(last, j + 2), node(last, j), node(last, j + 1)) for j in range(top - 2, -1, -2)],
            "bottom": [(node(i + 2, 0), node(i, 0), node(i + 1, 0)) for i in range(last - 2, -1, -2)],
            "left": [(node(0, j), node(0, j + 2), node(0, j + 1)) for j in range(0, top, 2)],
        }
        return Mesh(np.array(nodes), elements, boundaries, {}, {})

    def written(self, mesh, linear):
        """As an inline mesh: numbers, elements and lists in random order, and more names."""
        draw = self.draw
        nodes = mesh.nodes.copy()
        if linear:
            for element in mesh.elements:
                n = len(element) // 2
                for i in range(n):
                    nodes[element[n + i]] = (nodes[element[i]] + nodes[element[(i + 1) % n]]) / 2
        order = draw.shuffled(range(len(nodes)))
        number = {old: new for new, old in enumerate(order)}
        turned = []
        for element in draw.shuffled(mesh.elements):
            n, k = len(element) // 2, draw.integer(0, len(element) // 2 - 1)
            corners, mids = element[:n], element[n:]
            turned.append([number[v] for v in corners[k:] + corners[:k] + mids[k:] + mids[:k]])
        boundaries = {}
        for name, edges in mesh.boundaries.items():
            found = [[number[a], number[b], number[m]] for a, b, m in edges]
            boundaries[name] = found
            if len(found) > 1 and draw.chance(0.5):
                first = draw.integer(0, len(found) - 1)
                boundaries[f"{name}_part"] = found[first : draw.integer(first, len(found) - 1) + 1]
        if self.source == "inline":
            for name, edges in boundaries.items():
                edges = [[b, a, m] if draw.chance(0.3) else [a, b, m] for a, b, m in edges]
                boundaries[name] = draw.shuffled(edges)
        groups = {}
        if self.source in ("gmsh", "abaqus") and draw.chance(0.3):
            groups["ALL"] = list(range(len(turned)))
            self.has("elements in two groups")
        if draw.chance(0.4):
            count = draw.integer(2, 3)
            of = [draw.integer(0, count - 1) for _ in turned]
            groups.update({f"G{k}": [i for i, g in enumerate(of) if g == k] for k in range(count) if k in of})
        sets = {}
        corners = sorted({v for e in turned for v in e[: len(e) // 2]})
        chosen = draw.shuffled(corners if linear else range(len(nodes)))
        some = chosen[: draw.integer(1, min(4, len(chosen)))]
        # what forces on all nodes of a side mean on finer meshes is another question
        sides = [tuple(e[k] for k in side) for e in turned for side in (SIDES_OF_QUAD if len(e) == 8 else SIDES_OF_TRIANGLE)]
        whole = lambda set_: any(set(side[:2] if linear else side) <= set(set_) for side in sides)
        while whole(some):
            some = some[:-1]
        sets["some"] = sorted(some)
        if draw.chance(0.4):
            # all nodes of some sides that follow one another
            edges = boundaries[draw.one(["top", "bottom", "left", "right"])]
            first = draw.integer(0, len(edges) - 1)
            nodes_of = lambda edge: edge[:2] if linear else edge
            last = min(draw.integer(first, first + 1), len(edges) - 1)
            sets["sides"] = sorted({n for e in mesh_order(edges)[first : last + 1] for n in nodes_of(e)})
        return {
            "nodes": [[float(v) for v in nodes[old]] for old in order],
            "elements": turned,
            "boundaries": boundaries,
            "groups": groups,
            "node_sets": sets,
            **({"linear": True} if linear else {}),
        }

    def rules(self):
        """Names for parts by rules."""
        draw, given = self.draw, self.problem["mesh"]
        found = {}
        for side, axis, normal in (("top", 0, [0, 1]), ("bottom", 0, [0, -1]), ("left", 1, [-1, 0]), ("right", 1, [1, 0])):
            if not draw.chance(0.3):
                continue
            name = f"{side}_rule"
            edges = self.mesh.boundaries[side]
            at = sorted({float(self.mesh.nodes[n][axis]) for e in edges for n in e[:2]})
            straight = all(abs(n @ normal) > 0.99999 for e in edges for n in normals(self.mesh, e))
            form = draw.one(["range", "range", "box", "normal"])
            low = draw.between(at[0] - 0.3, at[0] + 0.4 * (at[-1] - at[0]))
            high = draw.between(at[0] + 0.6 * (at[-1] - at[0]), at[-1] + 0.3)
            low, high = float(f"{low:.5g}"), float(f"{high:.5g}")
            if form == "normal" and straight:
                rule = {"normal": normal}
                if draw.chance(0.5):
                    rule["angle"] = draw.round(0.5, 5)
            elif form == "box":
                box = [[-1e3, -1e3], [1e3, 1e3]]
                box[0][axis], box[1][axis] = low, high
                rule = {"side": side, "box": draw.shuffled(box) if draw.chance(0.3) else box}
            else:
                rule = {"side": side, "xy"[axis]: [low, high]}
            trial = Mesh(self.mesh.nodes, self.mesh.elements, dict(self.mesh.boundaries), {}, {})
            name_parts(trial, {"boundaries": {name: rule}})
            part = trial.boundaries[name]
            if part and len(chains(part)) == 1 and {e[:2] for e in part} <= {e[:2] for e in edges}:
                found[name] = rule
                self.has("boundary by " + ("normal" if "normal" in rule else "box" if "box" in rule else "range"))
        if found:
            given["boundaries"] = found
        self.grouped = [name for name in self.mesh.groups if name != "ALL"]
        if not self.grouped and draw.chance(0.3):
            axis = draw.integer(0, 1)
            low, high = np.min(self.mesh.nodes[:, axis]), np.max(self.mesh.nodes[:, axis])
            limits = [float(f"{low - 0.1:.5g}"), float(f"{draw.between(low, high):.5g}")]
            given["groups"] = {"low": {"xy"[axis]: limits}}
            self.grouped = ["low"]
        name_parts(self.mesh, given)
        if "low" in self.grouped:
            if not self.mesh.groups["low"] or len(self.mesh.groups["low"]) == len(self.mesh.elements):
                del given["groups"]
                self.grouped = []
            else:
                self.has("group by range")

    # materials

    def materials(self):
        draw = self.draw
        covered = sum(len(self.mesh.groups[g]) for g in self.grouped)
        found = []
        for group in self.grouped + ([None] if covered < len(self.mesh.elements) else []):
            material = self.material()
            if group:
                material["group"] = group
            found.append(material)
        self.problem["materials"] = draw.shuffled(found)
        if len(found) > 1:
            self.has("several materials")

    def material(self):
        draw = self.draw
        if draw.chance(0.3):
            e = [draw.round(400, 2000) for _ in range(3)]
            own = {"e1": e[0], "e2": e[1], "nu12": draw.round(0.05, 0.35), "g12": draw.round(150, 600)}
            if draw.chance(0.6):
                own["angle"] = draw.round(-90, 90)
            if self.kind != "plane_stress":
                own.update(e3=e[2], nu13=draw.round(0.05, 0.3), nu23=draw.round(0.05, 0.3))
            self.has("orthotropic")
            return {"orthotropic": own}
        nu = draw.round(0.1, 0.45)
        if draw.chance(0.15):
            nu = draw.one([0.485, 0.49, 0.499])
            self.has("nearly incompressible")
        elif draw.chance(0.05):
            nu = -0.2
        return {"youngs_modulus": draw.round(300, 3000), "poissons_ratio": nu}

    # what happens at each side

    def straight(self, side):
        found = [n for e in self.mesh.boundaries[side] for n in normals(self.mesh, e)]
        return all(np.hypot(*(n - found[0])) < 1e-9 for n in found)

    def axis_parallel(self, side):
        n = normals(self.mesh, self.mesh.boundaries[side][0])[0]
        return self.straight(side) and np.abs(n).min() < 1e-12

    def on_axis(self, side):
        return self.kind == "axisymmetric" and all(self.mesh.nodes[n][0] == 0 for e in self.mesh.boundaries[side] for n in e)

    def smooth(self, side):
        """Without corners of its own."""
        edges = self.mesh.boundaries[side]
        return all(smooth(self.mesh.nodes[list(a)], self.mesh.nodes[list(b)]) for a, b in zip(edges, edges[1:]))

    def roles(self, contacts):
        draw = self.draw
        self.role = dict.fromkeys(SIDES, "free")
        left = [side for side in SIDES if not self.on_axis(side)]
        for side in SIDES:
            if side not in left:
                self.role[side] = "axis"
        plan = draw.one(["clamped", "clamped", "clamped", "rollers", "rollers", "pulled", "pressed"])
        base = draw.one(left)
        pairs = [
            (a, b)
            for k, a in enumerate(SIDES)
            for b in (SIDES[(k + 1) % 4],)
            if self.axis_parallel(a) and self.axis_parallel(b) and self.role[a] != "axis" and self.role[b] != "axis"
        ]
        opposite = SIDES[(SIDES.index(base) + 2) % 4]
        if plan == "rollers" and pairs:
            for side in draw.one(pairs):
                self.role[side] = "roller"
            self.has("rollers")
        elif plan == "pulled" and self.role[opposite] == "free":
            self.role[base], self.role[opposite] = "clamp", "pull"
            self.has("prescribed displacements at both ends")
        elif plan == "pressed" and contacts and self.axis_parallel("bottom") and self.role["left"] == "axis":
            self.role["bottom"], self.role["top"] = "contact", "press"
            self.has("held by contact alone")
        elif plan == "pressed" and contacts and self.axis_parallel("bottom") and self.axis_parallel("left") and self.kind != "axisymmetric":
            self.role["left"], self.role["bottom"], self.role["top"] = "roller", "contact", "press"
            self.has("held by contact alone")
        else:
            self.role[base] = "clamp"
            self.has("clamped")
        if not contacts:
            return
        free = draw.shuffled([side for side in SIDES if self.role[side] == "free"])
        wanted = draw.one([0, 1, 1, 1, 1, 2])
        taken = []
        for side in free:
            if len(taken) >= wanted:
                break
            neighbours = [SIDES[(SIDES.index(side) + k) % 4] for k in (1, 3)]
            if any(n in taken for n in neighbours) and not draw.chance(0.3):
                continue
            self.role[side] = "contact"
            taken.append(side)

    def value(self, low, high, feature):
        """A number, or [start, end]."""
        draw = self.draw
        if draw.chance(0.4):
            self.has(feature + " [start, end]")
            return [draw.round(low, high), draw.round(low, high)]
        return draw.round(low, high)

    def supports(self):
        draw, found = self.draw, []
        size = 0.01 * self.size
        for side, role in self.role.items():
            neighbours = [self.role[SIDES[(SIDES.index(side) + k) % 4]] for k in (1, 3)]
            if role == "clamp":
                form = draw.one(["xy", "nt" if self.smooth(side) else "xy", "split"])
                values = [0, 0]
                # a corner that a contact ends at keeps its place; one on the axis keeps its radius
                still = "contact" in neighbours or "axis" in neighbours or self.touches_axis(side)
                if not still and draw.chance(0.4):
                    values = [self.value(-size, size, "support value") for _ in values]
                keys = ("un", "ut") if form == "nt" else ("ux", "uy")
                self.has("support " + "/".join(keys))
                halves = self.halves(side) if form == "nt" and values == [0, 0] and draw.chance(0.5) else None
                if halves:
                    found += [{"boundary": half, "un": 0, "ut": 0} if k else {"boundary": half, "un": 0} for k, half in enumerate(halves)]
                    self.has("supports that meet on a side")
                elif form == "split":
                    found += [{"boundary": side, keys[0]: values[0]}, {"boundary": side, keys[1]: values[1]}]
                else:
                    found.append({"boundary": side, keys[0]: values[0], keys[1]: values[1]})
            elif role == "roller":
                axis = "ux" if side in ("left", "right") else "uy"
                key = draw.one([axis, "un"])
                # rollers at right angles share a corner without a clash
                value = 0
                if "contact" not in neighbours and not self.touches_axis(side) and draw.chance(0.4):
                    value = self.value(-size, size, "support value")
                self.has(f"support {key}")
                found.append({"boundary": side, key: value})
            elif role == "pull":
                key = draw.one(["ux", "uy", "un", "ut"])
                if key in ("un", "ut") and not self.smooth(side):
                    key = "uy"
                if self.touches_axis(side):
                    key = "uy"
                names = [n for n in self.mesh.boundaries if n.startswith(side)]
                self.has(f"support {key}")
                found.append({"boundary": draw.one(names), key: self.value(-size, size, "support value")})
        held = {n for s in found for e in self.mesh.boundaries[s["boundary"]] for n in e}
        touching = {n for side, role in self.role.items() if role == "contact" for e in self.mesh.boundaries[side] for n in e}
        free = set(self.mesh.node_sets.get("some", [])) - held - touching
        apart = free == set(self.mesh.node_sets.get("some", [])) and free
        inside = all(self.mesh.nodes[n][0] > 0 or self.kind != "axisymmetric" for n in free)
        if apart and inside and self.refine == 0 and draw.chance(0.3):
            found.append({"nodes": "some", draw.one(["ux", "uy"]): draw.round(-size, size)})
            self.has("support of a node set")
        self.problem["supports"] = draw.shuffled(found)

    def halves(self, side):
        """Names for two parts of a side, if its mesh can have them."""
        edges = self.mesh.boundaries[side]
        if len(edges) < 2 or self.source != "inline":
            return None
        at = self.draw.integer(1, len(edges) - 1)
        inline = self.problem["mesh"]["inline"]
        for name, part in ((f"{side}_first", edges[:at]), (f"{side}_second", edges[at:])):
            self.mesh.boundaries[name] = part
            inline["boundaries"][name] = [[int(n) for n in edge] for edge in part]
        return f"{side}_first", f"{side}_second"

    def touches_axis(self, side):
        return self.kind == "axisymmetric" and any(self.mesh.nodes[n][0] == 0 for e in self.mesh.boundaries[side] for n in e)

    def loads(self):
        draw, found = self.draw, []
        pressed = any(p == "press" for p in self.role.values())
        for side, role in self.role.items():
            names = [n for n in self.mesh.boundaries if n.startswith(side)]
            if role == "press":
                found.append({"boundary": side, "pressure": draw.round(2, 10)})
                continue
            if role not in ("free", "contact") or not draw.chance(0.6 if role == "free" else 0.1) or pressed:
                continue
            name = draw.one(names)
            form = draw.one(["pressure", "traction", "normal", "tangential", "both", "nodal"])
            if form == "nodal" and len(chains(self.mesh.boundaries[name])) > 1:
                form = "traction"
            self.has(f"load {form}" if form != "both" else "load normal and tangential")
            if name != side:
                self.has("load on a part of a side")
            value = lambda form=form: self.value(-8, 8, f"load {form}")
            load = {"boundary": name}
            if form == "pressure":
                load["pressure"] = value()
            elif form == "traction":
                load["traction"] = [value(), value()]
            elif form == "nodal":
                count = 2 * len(self.mesh.boundaries[name]) + 1
                load["nodal"] = [[draw.round(-1, 1), draw.round(-1, 1)] for _ in range(count)]
            else:
                if form != "tangential":
                    load["normal"] = value()
                if form != "normal":
                    load["tangential"] = value()
            found.append(load)
        if not pressed and draw.chance(0.3):
            found.append({"body_force": [draw.round(-4, 4), draw.round(-4, 4)]})
            self.has("body force")
        some = self.mesh.node_sets.get("some", [])
        off_axis = self.kind != "axisymmetric" or all(self.mesh.nodes[n][0] > 0 for n in some)
        if some and off_axis and not pressed and draw.chance(0.5):
            found.append({"nodes": "some", "force": [draw.round(-2, 2), draw.round(-2, 2)]})
            self.has("force on a node set")
        whole = self.mesh.node_sets.get("sides", [])
        # what two sets name together is not what each names
        forced = any("force" in load for load in found)
        if whole and not pressed and not forced and draw.chance(0.6) and all(self.mesh.nodes[n][0] > 0 or self.kind != "axisymmetric" for n in whole):
            found.append({"nodes": "sides", "force": [draw.round(-1, 1), draw.round(-1, 1)]})
            self.has("force on a node set of whole sides")
        self.problem["loads"] = found

    # contacts

    def contacts(self):
        found = []
        for side, role in self.role.items():
            if role == "contact":
                contact = self.contact(side)
                if contact is not None and all(self.together(contact, other) for other in found):
                    found.append(contact)
        if found:
            self.problem["contacts"] = found
            if len(found) > 1:
                self.has("two contacts")

    def together(self, one, other):
        """Whether two contacts may stand side by side: a bonded one has all its nodes for itself."""
        nodes = [{n for e in self.mesh.boundaries[c["boundary"]] for n in e} for c in (one, other)]
        return not nodes[0] & nodes[1] or "bonded" not in (one.get("condition"), other.get("condition"))

    def contact(self, side):
        draw = self.draw
        names = [n for n in self.mesh.boundaries if n.startswith(side)]
        pressed = self.role["top"] == "press"
        name = side if pressed or draw.chance(0.7) else draw.one(names)
        edges = self.mesh.boundaries[name]
        if len(chains(edges)) > 1 or not self.corners_are_slight(edges):
            return None
        chain = Chain(self.mesh, edges)
        condition = "unilateral" if pressed or draw.chance(0.85) else draw.one(["bonded", "none"])
        edges = self.away_from_supports(edges, condition == "bonded")
        if not edges:
            return None
        ends = Chain(self.mesh, edges)
        whole = len(edges) == len(self.mesh.boundaries[name])
        push = draw.between(0.002, 0.012) * self.size
        kinds = ["flat", "circle", "parabola", "wedge", "cone", "tilted", "power", "rounded_flat", "table", "line", "polyline"]
        kind = draw.one(["flat", "line"] if pressed else kinds)
        along_x = side in ("top", "bottom") and chain.monotonic()
        along = "x" if along_x and draw.chance(0.6) else "arc_length"
        if not whole and kind in ("line", "polyline") and draw.chance(0.5):
            kind = "flat"
        obstacle, at = self.obstacle(kind, chain, ends, along, push, whole and not pressed)
        if kind != "flat" or along == "arc_length":
            obstacle["along"] = along
        contact = {"boundary": name, "obstacle": obstacle, "indentation": at}
        if condition != "unilateral":
            contact["condition"] = condition
            self.has(f"condition {condition}")
        if draw.chance(0.3):
            contact["normal"] = "obstacle"
            self.has("normal: obstacle")
        self.has(f"obstacle {kind}" + (f", {obstacle['interpolation']}" if "interpolation" in obstacle else ""), f"contact {side}")
        if condition == "none" or (condition == "unilateral" and draw.chance(0.5)):
            contact["friction"] = self.friction(chain, condition, side)
            if draw.chance(0.5) and not pressed:
                contact["tangential_displacement"] = draw.round(-0.006 * self.size, 0.006 * self.size)
                self.has("obstacle dragged")
        elif condition == "bonded" and draw.chance(0.5):
            contact["tangential_displacement"] = draw.round(-0.004 * self.size, 0.004 * self.size)
        return contact

    def corners_are_slight(self, edges):
        return all(
            normals(self.mesh, a)[1] @ normals(self.mesh, b)[0] > np.cos(np.radians(25)) for a, b in zip(edges, edges[1:])
        )

    def away_from_supports(self, edges, bonded):
        """Without the first or last side, if a support holds its end against the obstacle, or at all."""
        held = {}
        if bonded and self.kind == "axisymmetric":
            held = {n: [[1, 0], [0, 1]] for e in edges for n in e if self.mesh.nodes[n][0] == 0}
        for support in self.problem["supports"]:
            if "nodes" in support:
                held.update((n, [[1, 0], [0, 1]]) for n in self.mesh.node_sets[support["nodes"]])
                continue
            own = self.mesh.boundaries[support["boundary"]]
            for edge in own:
                for node, n in zip(edge, normals(self.mesh, edge)):
                    ways = {"ux": [1, 0], "uy": [0, 1], "un": n, "ut": [n[1], -n[0]]}
                    held.setdefault(node, []).extend(ways[key] for key in ways if key in support)
        def against(node, n, edge=None):
            error = curve_error(self.mesh.nodes[list(edge)]) if edge else 1e-9
            return any(bonded or abs(n @ np.array(way)) > error for way in held.get(node, []))

        if edges and against(edges[0][0], normals(self.mesh, edges[0])[0], edges[0]):
            edges = edges[1:]
        if edges and against(edges[-1][1], normals(self.mesh, edges[-1])[1], edges[-1]):
            edges = edges[:-1]
        inner = any(against(n, normals(self.mesh, e)[0]) for e in edges for n in e)
        return [] if inner else edges

    def obstacle(self, kind, chain, ends, along, push, partly):
        """The obstacle, placed so that it touches, and its indentation; it faces the part `ends` of the boundary `chain`, or
        with `partly` even less of it."""
        draw = self.draw
        c = chain.coordinates(along)
        first = next(k for k, n in enumerate(chain.nodes) if n == ends.nodes[0])
        c = c[first : first + len(ends.nodes)]
        low, high = min(c), max(c)
        length = high - low
        center = float(f"{draw.between(low + 0.2 * length, high - 0.2 * length):.5g}")
        if draw.chance(0.3):
            center = float(draw.one(list(c)))
        found = {"kind": kind}
        limits = sorted((float(c[0]), float(c[-1])))
        if len(ends.nodes) < len(chain.nodes):
            found["from"], found["to"] = limits
            self.has("from/to")
        lengths = np.ptp(chain.s)
        if partly and len(c) > 3 and draw.chance(0.5 if kind == "flat" else 0.2):
            corners = sorted(float(x) for x in c[::2])
            one = draw.integer(0, len(corners) - 2)
            other = draw.integer(one + 1, len(corners) - 1)
            if one:
                found["from"] = corners[one]
            if other < len(corners) - 1:
                found["to"] = corners[other]
            self.has("from/to")
            if kind in ("line", "polyline"):
                self.has(f"from/to of a {kind}")
        if kind == "flat":
            return found, float(f"{push:.4g}")
        if kind == "line":
            middle = ends.mid()
            tilt = draw.between(-0.02, 0.02) if partly else 0.0
            way = np.array([-middle[1][1], middle[1][0]])  # normal turned left
            angle = np.degrees(np.arctan2(way[1], way[0]) + tilt) + draw.one([0, 180])
            found.update(point=[float(v) for v in middle[0]], angle=float(f"{angle:.8g}"))
            least = min(obstacles.in_space(found, p, n)[0] for p, n in zip(ends.positions, ends.normals))
            inside = draw.chance(0.5)
            move = -least - push if inside else -least + draw.between(0, 0.1)
            found["point"] = [float(v) for v in middle[0] + move * middle[1]]
            if inside:
                self.has("overlap by a line")
                return found, 0.0
            return found, float(f"{move + least + push:.6g}")
        if kind == "polyline":
            count = draw.integer(3, 6)
            at = np.linspace(-0.15, 1.15, count) * lengths
            bend = draw.between(0.02, 0.2)
            middle = draw.between(0.3, 0.7) * lengths
            points = []
            for s in at:
                p, n = chain.at(s)
                points.append([float(v) for v in p + n * (bend * (s - middle) ** 2 / lengths)])
            found["points"] = points if draw.chance(0.5) else points[::-1]
            if draw.chance(0.5):
                found["interpolation"] = "cubic"
            seen = [obstacles.in_space(found, p, n) for p, n in zip(ends.positions, ends.normals)]
            least = min(hit[0] for hit in seen if hit)
            if draw.chance(0.5):
                move = (least + push) * ends.mid()[1]
                found["points"] = [[float(v) for v in np.array(p) - move] for p in found["points"]]
                seen = [obstacles.in_space(found, p, n) for p, n in zip(ends.positions, ends.normals)]
                if all(seen):
                    self.has("overlap by a polyline")
                    return found, 0.0
                found["points"] = points
            return found, float(f"{least + push:.6g}")
        if kind == "table":
            count = draw.integer(4, 9)
            xs = [float(f"{x:.8g}") for x in np.linspace(low - 0.1 * length, high + 0.1 * length, count)]
            bend = draw.between(0.02, 0.2) / length
            gaps = [bend * (x - center) ** 2 for x in xs]
            form = draw.one(["linear", "cubic", "smoothed"])
            if form == "smoothed":
                found.update(interpolation="cubic", smoothing={"standard_deviation": float(f"{0.001 * max(gaps):.3g}")})
                self.has("smoothing")
            else:
                gaps = [g + draw.between(0, 0.2 * bend * length**2 / count) for g in gaps]
                if form == "cubic":
                    found["interpolation"] = "cubic"
            found.update(x=xs, gap=gaps)
            least = min(obstacles.profile(found, x)[0] for x in c)
            return found, float(f"{least + push:.6g}")
        if kind == "circle":
            found["radius"] = draw.round(1.3 * length, 6 * length)
        elif kind == "parabola":
            found["radius"] = draw.round(0.6 * length, 6 * length)
        elif kind in ("wedge", "cone"):
            found["angle"] = draw.round(1, 10)
        elif kind == "tilted":
            found["slope"] = draw.round(-0.03, 0.03)
        elif kind == "power":
            found["coefficient"] = draw.round(0.02, 0.2)
            found["exponent"] = draw.one([1.5, 2, 2.5, 3, 4])
        elif kind == "rounded_flat":
            found["half_width"] = draw.round(0.1 * length, 0.3 * length)
            found["radius"] = draw.round(1.2 * length, 4 * length)
        if center or draw.chance(0.5):
            found["center"] = center
        least = min(obstacles.profile(found, x)[0] for x in c)
        return found, float(f"{least + push:.6g}")

    def friction(self, chain, condition, side):
        draw = self.draw
        law = {"elastic_slip": draw.round(2e-4 * self.size, 5e-3 * self.size)}
        length = float(np.ptp(chain.s))
        if condition == "none" or draw.chance(0.2):
            if draw.chance(0.5):
                law["bound"] = draw.round(0.5, 5)
            else:
                law["bound"] = {
                    "s": [float(f"{x:.6g}") for x in (0.1 * length, 0.5 * length, 0.8 * length)],
                    "bound": [draw.round(0, 5) for _ in range(3)],
                }
            self.has("friction: prescribed bound")
        else:
            law["coefficient"] = draw.round(0.1, 0.6)
            law["nonlocal_radius"] = 0 if draw.chance(0.35) else draw.round(0.05 * length, 0.6 * length)
            self.has("friction: nonlocal" if law["nonlocal_radius"] else "friction: Coulomb")
            if draw.chance(0.2):
                law["kernel"] = "parabola"
                self.has("kernel parabola")
            if draw.chance(0.2) and law["nonlocal_radius"]:
                law["normalization"] = draw.one(["peak_one", "conserving"])
                self.has(f"normalization {law['normalization']}")
            if draw.chance(0.1):
                law["shear_cap"] = draw.round(0.5, 5)
                self.has("shear cap")
            if draw.chance(0.1) and law["nonlocal_radius"]:
                law["cohesion"] = draw.round(0.1, 1)
                self.has("cohesion")
            flat = side in ("top", "bottom") and self.axis_parallel(side)
            conserving = law.get("normalization") == "conserving"
            if self.kind == "axisymmetric" and flat and law["nonlocal_radius"] and not conserving and draw.chance(0.3):
                law["measure"] = "surface"
                self.has("measure surface")
        if draw.chance(0.3):
            law["points"] = "nodal"
            self.has("friction at nodes")
        if draw.chance(0.2):
            law["transition"] = "tanh"
            self.has("transition tanh")
        elif draw.chance(0.3):
            law["history"] = "incremental"
            self.has("incremental law")
        return law

    def steps(self):
        draw = self.draw
        if not draw.chance(0.25):
            return
        if any(p == "press" for p in self.role.values()):
            return
        found = []
        for _ in range(draw.integer(1, 3)):
            step = {}
            for key in ("indentation", "tangential_displacement", "loads", "supports"):
                if draw.chance(0.6):
                    step[key] = draw.round(0.2, 1.2)
            if draw.chance(0.5):
                step["increments"] = draw.integer(1, 3)
            contacts = self.problem.get("contacts", [])
            incremental = any(c.get("friction", {}).get("history") for c in contacts)
            powers = ("circle", "parabola", "power", "wedge", "cone")
            if contacts and not incremental and all(c["obstacle"]["kind"] in powers for c in contacts) and draw.chance(0.2):
                step["spacing"] = "contact_width"
            found.append(step)
        self.problem["steps"] = found
        self.has("load steps")


    def adapt(self):
        """Sometimes the mesh is refined where errors are."""
        unilateral = any("condition" not in c for c in self.problem.get("contacts", []))
        if unilateral and "quadrature" not in self.problem and self.refine == 0 and self.cells < 13 and self.draw.chance(0.15):
            self.problem["mesh"]["refine"] = {"tolerance": self.draw.one([0.1, 0.2])}
            self.features.discard("refine 0")
            self.has("adaptive refinement")


def mesh_order(edges):
    """The sides of a boundary that may be stored in any order and direction, one after the other."""
    left = [list(e) for e in edges]
    found = [left.pop(0)]
    while left:
        for e in left:
            ends = {found[0][0], found[0][1], found[-1][0], found[-1][1]}
            if set(e[:2]) & ends:
                left.remove(e)
                touches_first = set(e[:2]) & set(found[0][:2])
                found = [e, *found] if touches_first and (len(found) == 1 or not set(e[:2]) & set(found[-1][:2])) else [*found, e]
                break
    return found


def folded(mesh):
    """Whether an element is folded, or nearly so, at one of its nodes."""
    places = {
        8: [(-1, -1), (1, -1), (1, 1), (-1, 1), (0, -1), (1, 0), (0, 1), (-1, 0)],
        6: [(0, 0), (1, 0), (0, 1), (0.5, 0), (0.5, 0.5), (0, 0.5)],
    }
    for element in mesh.elements:
        shape = quad_shape if len(element) == 8 else triangle_shape
        points, h = mesh.nodes[list(element)], 1e-6
        dets = []
        for x, y in places[len(element)]:
            dx = (shape(x + h, y) - shape(x - h, y)) @ points / (2 * h)
            dy = (shape(x, y + h) - shape(x, y - h)) @ points / (2 * h)
            dets.append(dx[0] * dy[1] - dx[1] * dy[0])
        if min(dets) < 0.15 * max(dets):
            return True
    return False


class Chain:
    """A boundary in order: corner, midside, corner …"""

    def __init__(self, mesh, edges):
        self.nodes = [edges[0][0]] + [n for _, end, mid in edges for n in (mid, end)]
        self.positions = mesh.nodes[self.nodes]
        self.s = arc_lengths(mesh.nodes, edges)
        sums = np.zeros((len(self.nodes), 2))
        for k, edge in enumerate(edges):
            for place, n in zip((2 * k, 2 * k + 2, 2 * k + 1), normals(mesh, edge)):
                sums[place] += n
        self.normals = sums / np.hypot(*sums.T)[:, None]

    def coordinates(self, along):
        return self.s if along == "arc_length" else self.positions[:, 0]

    def monotonic(self):
        steps = np.diff(self.positions[:, 0])
        return bool(np.all(steps > 0) or np.all(steps < 0))

    def mid(self):
        k = len(self.nodes) // 2
        return self.positions[k], self.normals[k]

    def at(self, s):
        """Position and normal at an arc length, straight on beyond the ends."""
        n = np.array([np.interp(s, self.s, self.normals[:, a]) for a in (0, 1)])
        p = np.array([np.interp(s, self.s, self.positions[:, a]) for a in (0, 1)])
        for end, beyond in ((0, min(s, 0.0)), (-1, max(s - self.s[-1], 0.0))):
            p = p + beyond * np.array([self.normals[end][1], -self.normals[end][0]])
        return p, n / np.hypot(*n)


def problem(seed, contacts=True):
    made = Generator(seed, contacts)
    return made.problem, made.stands_for, sorted(made.features)
