"""Problems with known values: pairs that are the same problem, closed forms, refusals."""

import copy

import numpy as np

from meshes import from_grid

MATERIALS = [{"youngs_modulus": 1000, "poissons_ratio": 0.3}]
CLAMPED = [{"boundary": "bottom", "ux": 0, "uy": 0}]


def plane(mesh, supports, **other):
    return {"analysis": {"kind": "plane_strain"}, "mesh": mesh, "materials": MATERIALS, "supports": supports, **other}


def on_map(xs, ys, place, closed=False):
    """An inline mesh of quadrilaterals between lines, mapped, midsides included."""
    nodes, at, elements = [], {}, []
    half = lambda lines, k: (lines[k // 2] + lines[(k + 1) // 2]) / 2
    last = 2 * len(xs) - 2

    def node(i, j):
        i = i % last if closed else i
        if (i, j) not in at:
            at[i, j] = len(nodes)
            nodes.append([float(v) for v in place(half(xs, i), half(ys, j))])
        return at[i, j]

    top = 2 * len(ys) - 2
    for j in range(0, top, 2):
        for i in range(0, last, 2):
            places = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1)]
            elements.append([node(i + a, j + b) for a, b in places])
    along = lambda j: [[node(i, j), node(i + 2, j), node(i + 1, j)] for i in range(0, last, 2)]
    up = lambda i: [[node(i, j), node(i, j + 2), node(i, j + 1)] for j in range(0, top, 2)]
    boundaries = {"bottom": along(0), "top": along(top)}
    if not closed:
        boundaries.update(left=up(0), right=up(last))
    return {"nodes": nodes, "elements": elements, "boundaries": boundaries}


def inline_of(grid):
    mesh = from_grid(grid)
    return {
        "nodes": mesh.nodes.tolist(),
        "elements": [list(e) for e in mesh.elements],
        "boundaries": {name: [list(e) for e in edges] for name, edges in mesh.boundaries.items()},
    }


def orders():
    """The second of two components from start to end, on boundaries of every source and order: the same value."""
    grid = {"x": [0, 1, 2, 3], "y": [0, 1]}
    shuffled = inline_of(grid)
    shuffled["boundaries"]["top"] = [shuffled["boundaries"]["top"][k] for k in (1, 2, 0)]
    meshes = {
        "grid": ({"grid": grid}, "top"),
        "rule": ({"grid": grid, "boundaries": {"up": {"normal": [0, 1]}}}, "up"),
        "inline": ({"inline": shuffled}, "top"),
    }
    values = {"tangential": ([0, 1], 0.0014657718167131301), "traction": ([0, [0, -1]], 0.0004224744578511014)}
    for source, (mesh, boundary) in meshes.items():
        for load, (value, energy) in values.items():
            problem = plane(mesh, CLAMPED, loads=[{"boundary": boundary, load: value}])
            yield f"order: {load} on {source}", problem, {"strain_energy": energy}


def rules():
    """A rule names parts of the first mesh, however it is refined: a pressure of 1 on the side from 1 to 2."""
    for refine in (0, 1, 2, {"tolerance": 0.05}):
        mesh = {"grid": {"x": [0, 1, 2], "y": [0, 1]}, "boundaries": {"part": {"side": "top", "x": [0.5, 2]}}, "refine": refine}
        contact = {"boundary": "bottom", "obstacle": {"kind": "flat"}, "condition": "bonded"}
        problem = plane(mesh, [], loads=[{"boundary": "part", "pressure": 1}], contacts=[contact])
        yield f"rule: refine {refine}", problem, {"normal_force": 1.0}


def kinks():
    """An obstacle that ends at a corner of its boundary: a line, pushed, is the same as a flat face."""
    grid = {"x": [0, 0.5, 1, 1.5, 2], "y": [0, 0.5, 1], "top": [[0, 1], [1, 1], [2, 0.64]]}
    line = {"kind": "line", "point": [0, 1.2], "angle": 0, "to": 1}
    long_line = {"kind": "polyline", "points": [[-1, 1.2], [3, 1.2]], "to": 1}
    for name, obstacle, push in (("flat", {"kind": "flat", "to": 1}, 0.05), ("line", line, 0.25), ("polyline", long_line, 0.25)):
        contact = {"boundary": "top", "obstacle": obstacle, "indentation": push}
        problem = plane({"grid": grid, "refine": 1}, CLAMPED, contacts=[contact])
        yield f"corner: {name}", problem, {"normal_force": 68.51903584687838}


def sleeves():
    """A ring turned in a smooth sleeve, of one part or of several: a rigid rotation."""
    ring = on_map(
        list(np.linspace(0, 2 * np.pi, 25)), [1.0, 2.0], lambda a, r: (r * np.cos(-a), r * np.sin(-a)), closed=True
    )
    for parts in (1, 2, 3):
        mesh = copy.deepcopy(ring)
        outer = mesh["boundaries"].pop("top")
        supports = [{"boundary": "bottom", "ut": 0.01, "un": 0}]
        for k in range(parts):
            mesh["boundaries"][f"outer{k}"] = outer[k * 24 // parts : (k + 1) * 24 // parts]
            supports.append({"boundary": f"outer{k}", "un": 0})
        yield f"sleeve of {parts}", plane({"inline": mesh}, supports), {"strain_energy": 0.0}


def half_discs():
    """A half model of a curved body is half of the whole one."""
    low = lambda x: 3 - np.sqrt(9 - x * x)
    place = lambda x, part: (x, low(x) + part * (1 - low(x)))
    law = {"coefficient": 0.5, "nonlocal_radius": 0.3, "elastic_slip": 0.001}
    contact = {"boundary": "bottom", "obstacle": {"kind": "parabola", "radius": 6}, "friction": law}
    press = [{"boundary": "top", "uy": -0.05, "ux": 0}]
    ys = [0.0, 0.2, 0.5, 1.0]
    whole = plane({"inline": on_map([k / 8 - 1 for k in range(17)], ys, place)}, press, contacts=[contact])
    mirror = [{"boundary": "left", "ux": 0}]
    half = plane({"inline": on_map([k / 8 for k in range(9)], ys, place)}, press + mirror, contacts=[contact])
    bonded = [{"boundary": "bottom", "obstacle": {"kind": "flat"}, "condition": "bonded"}]
    return whole, half, dict(half, contacts=bonded, supports=mirror, loads=[{"boundary": "top", "pressure": 1}])


def others():
    flat = {"boundary": "top", "obstacle": {"kind": "flat"}, "indentation": 0.1}
    mesh = {"grid": {"x": [0, 1], "y": [0, 1]}}
    problem = plane(mesh, CLAMPED, contacts=[flat]) | {"analysis": {"kind": "axisymmetric"}}
    yield "axis: flat punch", problem, {"normal_force": 336.96223184652894, "profile": True}
    inline = inline_of({"x": [0, 1, 2], "y": [0, 1]})
    corner = inline["nodes"].index([1.0, 1.0])
    for members in ([corner], [corner, corner]):
        own = dict(inline, node_sets={"s": members})
        problem = plane({"inline": own}, CLAMPED, loads=[{"nodes": "s", "force": [0, -1]}])
        yield f"node set of {len(members)}", problem, {"strain_energy": None, "or refused": len(members) > 1}


# a pressure on a side inside the body, which changes the solution
INSIDE = """*HEADING
a load inside
*NODE,NSET=NALL
1,0,0
2,1,0
3,2,0
4,0,1
5,1,1
6,2,1
7,.5,0
8,1.5,0
9,.5,1
10,1.5,1
11,0,.5
12,1,.5
13,2,.5
*ELEMENT,TYPE=CPE8,ELSET=EALL
1,1,2,5,4,7,12,9,11
2,2,3,6,5,8,13,10,12
*NSET,NSET=BOT
1,2,3,7,8
*MATERIAL,NAME=M
*ELASTIC
1000,.3
*SOLID SECTION,ELSET=EALL,MATERIAL=M
*BOUNDARY
BOT,1,2
*STEP
*STATIC
*DLOAD
EALL,P2,5
*END STEP
"""


def triangles():
    """A group by range holds triangles, wherever it lies."""
    inline = inline_of({"x": [2, 3, 4], "y": [5, 6]})
    cut = []
    for e in inline["elements"]:
        centre = len(inline["nodes"])
        inline["nodes"].append(np.mean([inline["nodes"][n] for n in e[:4]], axis=0).tolist())
        cut += [[e[0], e[1], e[2], e[4], e[5], centre], [e[0], e[2], e[3], centre, e[6], e[7]]]
    inline["elements"] = cut
    soft = [{"youngs_modulus": 1000, "poissons_ratio": 0.3}, {"youngs_modulus": 500, "poissons_ratio": 0.3, "group": "right"}]
    named = dict(inline, groups={"right": [2, 3]})
    pull = [{"boundary": "top", "traction": [0, 1]}]
    for name, mesh in (
        ("a list", {"inline": named}),
        ("a range", {"inline": inline, "groups": {"right": {"x": [3, 4]}}}),
    ):
        yield f"triangles in a group by {name}", plane(mesh, CLAMPED, loads=pull) | {"materials": soft}, {"strain_energy": None}


def all_cases():
    """(name, problem, values of the summary); a value that is None is that of the reference."""
    for part in (orders, rules, kinks, sleeves, others, triangles):
        yield from part()


def check(solve, reference):
    """What is wrong with the cases, as lines. `solve(problem, name)` gives a document or a refusal; `reference(problem)` its
    own result, None where it has none."""
    wrong = []

    def differ(name, what, got, expected, size=None):
        size = abs(expected) if size is None else size
        if not abs(got - expected) <= 1e-8 * size:
            wrong.append(f"case {name}: {what} {got!r}, expected {expected!r}")

    for name, problem, values in all_cases():
        document, refused = solve(problem, name)
        if refused:
            if not values.get("or refused"):
                wrong.append(f"case {name}: {refused}")
            continue
        own = reference(problem)
        for key, value in values.items():
            if key == "or refused":
                continue
            if key == "profile":
                # the quadratic through the nodes, by radius: 2π ∫ p r dr of p = 1, 4, 1 parts at r = 0, ½, 1
                profile = document["profiles"]["top"]
                at = [int(np.argmin(np.abs(np.array(profile["s"]) - r))) for r in (0.0, 0.5, 1.0)]
                force = -2 * np.pi * np.dot([0, 1 / 3, 1 / 6], np.array(profile["normal_stress"])[at])
                differ(name, "integral of the profile", force, document["summary"]["normal_force"])
                continue
            got = document["summary"][key]
            if value == 0:
                differ(name, key, got, 0.0, 1e-4)  # of 0.15, what it is where the parts hold their common nodes
                continue
            if value is not None:
                differ(name, key, got, value)
            if own is not None:
                differ(name, f"{key} of the reference", got, own[-1]["summary"][key])
    whole, half, bonded = half_discs()
    results = []
    for name, problem in (("whole disc", whole), ("half disc", half), ("bonded half disc", bonded)):
        document, refused = solve(problem, name)
        if refused:
            wrong.append(f"case {name}: {refused}")
        results.append(document)
    if results[0] and results[1]:
        for key in ("normal_force", "friction_force"):
            # the pressure beside the line of symmetry depends on the last normal, which is off by the curve's parabola
            a, b = (r["summary"][key] for r in results[:2])
            if abs(a - 2 * b) > 1e-6 * a:
                wrong.append(f"case half disc: {key} {b!r}, expected half of {a!r}")
        at = [
            r["profiles"]["bottom"]["nonlocal_pressure"][int(np.argmin(np.abs(r["profiles"]["bottom"]["x"])))]
            for r in results[:2]
        ]
        if abs(at[0] - at[1]) > 1e-6 * at[0]:
            wrong.append(f"case half disc: S at the line of symmetry {at[1]!r}, expected {at[0]!r}")
    return wrong
