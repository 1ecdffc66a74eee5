"""Writes an example in every format and reads each back with the program it is meant for: pandas,
pyarrow, NumPy and VTK's own reader must see the numbers of the JSON, bit for bit.

    formats.py [BINARY]
"""

import json
import math
import pathlib
import subprocess
import sys
import tempfile
import warnings
import xml.etree.ElementTree as ElementTree

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.ipc
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkFiltersVerdict import vtkCellSizeFilter
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

TOP = pathlib.Path(__file__).resolve().parent.parent
BINARY = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else TOP / "target/release/signorini"
QUADRATIC_TRIANGLE, QUADRATIC_QUAD = 22, 23
STATES = {"open": 0, "stick": 1, "slip": 2}

# its default misreads a last bit before pandas 3.1, which warns about the argument that corrects it
warnings.filterwarnings("ignore", message=".*float_precision.*")

checks = 0


def check(holds, what):
    global checks
    checks += 1
    if not holds:
        sys.exit("formats.py: " + what)


def same(found, expected, what):
    """Equal in shape and in every bit; NaN is equal to NaN."""
    found, expected = np.asarray(found), np.asarray(expected)
    check(found.shape == expected.shape, "%s has shape %s, not %s" % (what, found.shape, expected.shape))
    if expected.dtype.kind == "f":
        check(found.dtype == np.float64, "%s is %s" % (what, found.dtype))
        nan = np.isnan(found) & np.isnan(expected)
        equal = nan | ((found == expected) & (np.signbit(found) == np.signbit(expected)))
    else:
        equal = found == expected
    check(equal.all(), "%s differs: %s, not %s" % (what, found[~equal][:3], expected[~equal][:3]))


def solve(problem, folder, *names):
    """Writes every file in one run; returns the document."""
    paths = [folder / name for name in names]
    arguments = [part for path in paths for part in ("-o", path)]
    done = subprocess.run([BINARY, "solve", problem, *arguments], capture_output=True, text=True)
    check(done.returncode == 0, "solve %s ended with %s:\n%s" % (problem, done.returncode, done.stderr))
    left = {path.name for path in folder.iterdir()} - set(names)
    check(not left, "solve left %s behind" % left)


def columns(rows):
    """A history as columns, with the names that tables have."""
    flat = []
    for row in rows:
        flat.append({})
        for name, value in row.items():
            parts = {"%s_%s" % (name, k): v for k, v in value.items()} if isinstance(value, dict) else {name: value}
            flat[-1].update(parts)
    return {name: [row[name] for row in flat] for name in flat[0]}


def array(values):
    """As NumPy arrays: missing numbers are NaN."""
    if any(isinstance(value, str) for value in values):
        return np.array(values, dtype=object)
    if any(value is None or isinstance(value, float) for value in values):
        return np.array([math.nan if value is None else value for value in values], dtype=np.float64)
    return np.array(values)


def check_table(folder, stem, expected):
    """The same columns, read from CSV, JSON Lines, Arrow and NPZ."""
    expected = {name: array(values) for name, values in expected.items()}
    rows = len(next(iter(expected.values())))
    reals = {name: np.float64 for name, values in expected.items() if values.dtype.kind == "f"}

    csv = pd.read_csv(folder / (stem + ".csv"), dtype=reals, float_precision="round_trip")
    jsonl = pd.DataFrame([json.loads(line) for line in (folder / (stem + ".jsonl")).open(encoding="utf-8")])
    with pa.memory_map(str(folder / (stem + ".arrow"))) as file:
        table = pa.ipc.open_file(file).read_all()
        table.validate(full=True)
        arrow = table.to_pandas()
    npz = np.load(folder / (stem + ".npz"))
    for kind, names, column in [
        ("csv", list(csv), lambda name: csv[name]),
        ("jsonl", list(jsonl), lambda name: jsonl[name].astype(reals.get(name, jsonl[name].dtype))),
        ("arrow", list(arrow), lambda name: arrow[name]),
        ("npz", list(npz), lambda name: npz[name]),
    ]:
        check(set(names) == set(expected), "%s.%s has the columns %s" % (stem, kind, names))
        check(names[0] in ("s", "k"), "%s.%s begins with %s" % (stem, kind, names[0]))
        for name, values in expected.items():
            found = column(name)
            check(len(found) == rows, "%s.%s has %d rows" % (stem, kind, len(found)))
            found = np.asarray(found, dtype=object if values.dtype == object else None)
            same(found, values, "%s.%s, %s" % (stem, kind, name))
    for name, values in expected.items():
        kind = {"f": pa.float64(), "i": pa.uint32(), "O": pa.string()}[values.dtype.kind]
        check(table.schema.field(name).type == kind, "%s.arrow: %s is %s" % (stem, name, table.schema.field(name).type))
        missing = int(np.isnan(values).sum()) if values.dtype.kind == "f" else 0
        check(table[name].null_count == missing, "%s.arrow: %s has other nulls" % (stem, name))


def derived(fields):
    """The arrays of VTU and NPZ, from the JSON by NumPy's own means."""
    real = {name: np.array(fields[name], dtype=np.float64) for name in fields if name[0] in "xyus"}
    zero = np.zeros_like(real["x"])
    xx, yy, xy, zz = (real["stress_" + part] for part in ("xx", "yy", "xy", "zz"))
    tensors = np.stack([xx, xy, zero, xy, yy, zero, zero, zero, zz], axis=1).reshape(-1, 3, 3)
    deviators = tensors - np.trace(tensors, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3
    return {
        "points": np.stack([real["x"], real["y"], zero], axis=1),
        "displacement": np.stack([real["ux"], real["uy"], zero], axis=1),
        "stress": np.stack([xx, yy, zz, xy, zero, zero], axis=1),
        "contact_state": np.array(fields["contact_state"]),
        "element_error": np.array(fields["element_error"], dtype=np.float64),
    }, {
        # by another way of computing, so equal to rounding only
        "principal_stress": np.linalg.eigvalsh(tensors)[:, ::-1],
        "von_mises": np.sqrt(1.5 * (deviators**2).sum(axis=(1, 2))),
    }


def check_fields(arrays, exact, rounded, what):
    scale = np.abs(exact["stress"]).max()
    for name, values in exact.items():
        same(arrays[name], values, "%s, %s" % (what, name))
    for name, values in rounded.items():
        check(arrays[name].shape == values.shape, "%s, %s has shape %s" % (what, name, arrays[name].shape))
        error = np.abs(arrays[name] - values).max()
        check(error < 1e-12 * scale, "%s, %s is off by %g" % (what, name, error))


def check_vtu(path, fields, exact, rounded):
    failures = []
    reader = vtkXMLUnstructuredGridReader()
    reader.AddObserver("ErrorEvent", lambda *_: failures.append("error"))
    reader.AddObserver("WarningEvent", lambda *_: failures.append("warning"))
    reader.SetFileName(str(path))
    reader.Update()
    check(reader.GetErrorCode() == 0 and not failures, "VTK cannot read %s" % path.name)
    grid = reader.GetOutput()
    points, cells = grid.GetPointData(), grid.GetCellData()
    arrays = {points.GetArrayName(i): vtk_to_numpy(points.GetArray(i)) for i in range(points.GetNumberOfArrays())}
    arrays["points"] = vtk_to_numpy(grid.GetPoints().GetData())
    arrays["element_error"] = vtk_to_numpy(cells.GetArray("element_error"))
    check(set(arrays) == {*exact, *rounded}, "%s holds %s" % (path.name, set(arrays)))
    check_fields(arrays, exact, rounded, path.name)
    check(arrays["contact_state"].dtype == np.int8, "contact_state is %s" % arrays["contact_state"].dtype)
    names = [points.GetArray("stress").GetComponentName(i) for i in range(6)]
    check(names == ["xx", "yy", "zz", "xy", "yz", "xz"], "the stress has the components %s" % names)

    check(grid.GetNumberOfCells() == len(fields["elements"]), "%s has other cells" % path.name)
    for i, nodes in enumerate(fields["elements"]):
        cell = grid.GetCell(i)
        kind = {8: QUADRATIC_QUAD, 6: QUADRATIC_TRIANGLE}[len(nodes)]
        check(cell.GetCellType() == kind, "cell %d is of type %d" % (i, cell.GetCellType()))
        found = [cell.GetPointId(k) for k in range(cell.GetNumberOfPoints())]
        check(found == nodes, "cell %d has the nodes %s" % (i, found))
    # if midsides were in another order, VTK's own areas would differ
    size = vtkCellSizeFilter()
    size.SetInputData(grid)
    size.Update()
    area = vtk_to_numpy(size.GetOutput().GetCellData().GetArray("Area"))
    check((area > 0).all(), "a cell has the area %g" % area.min())
    return area.sum()


def check_npz_fields(arrays, fields, exact, rounded, what):
    check_fields(arrays, exact, rounded, what)
    elements = [None] * len(fields["elements"])
    for kind, width in (("quad", 8), ("triangle", 6)):
        nodes, numbers = arrays[kind + "s"], arrays[kind + "_numbers"]
        check(nodes.shape == (len(numbers), width), "%s: %ss have shape %s" % (what, kind, nodes.shape))
        for number, row in zip(numbers, nodes):
            elements[number] = row.tolist()
    check(elements == fields["elements"], "%s has other elements" % what)
    gauss = {name: np.array(values, dtype=np.float64) for name, values in fields["gauss"].items() if name != "order"}
    zero = np.zeros_like(gauss["x"])
    same(arrays["gauss_points"], np.stack([gauss["x"], gauss["y"], zero], axis=1), what + ", gauss_points")
    stress = [gauss["stress_" + part] for part in ("xx", "yy", "zz", "xy")]
    same(arrays["gauss_stress"], np.stack([*stress, zero, zero], axis=1), what + ", gauss_stress")
    # the points of an element lie within the box of its nodes
    of_point = arrays["gauss_element"]
    check(len(of_point) == len(zero), "%s: gauss_element has %d entries" % (what, len(of_point)))
    low = np.array([exact["points"][nodes].min(axis=0) for nodes in fields["elements"]])
    high = np.array([exact["points"][nodes].max(axis=0) for nodes in fields["elements"]])
    places = arrays["gauss_points"]
    inside = (places >= low[of_point]).all() and (places <= high[of_point]).all()
    check(inside, "%s: an integration point lies outside of its element" % what)
    check(set(of_point) == set(range(len(elements))), "%s: an element has no integration point" % what)


def check_example(folder):
    tables = ("csv", "jsonl", "arrow", "npz")
    solve(
        TOP / "tests/data/thesis/rectangular_punch.json", folder,
        "punch.json", "punch.npz", "punch.vtu", "punch.svg", "punch.csv", "punch.jsonl", "punch.arrow",
        *("punch.profile." + ending for ending in tables), *("punch.history." + ending for ending in tables),
        "punch.profile.top.csv", "punch.fields.npz", "punch.profile.json", "punch.history.json", "punch.fields.json",
    )
    document = json.loads((folder / "punch.json").read_text(encoding="utf-8"))
    profile, history, fields = document["profiles"]["top"], document["history"], document["fields"]
    for part, values in (("profile", profile), ("history", history), ("fields", fields)):
        check(json.loads((folder / ("punch.%s.json" % part)).read_text()) == values, part + ".json differs")
    check(len(history) == document["summary"]["iterations"] > 3, "the history has %d rows" % len(history))
    peak = document["summary"]["contacts"]["top"]["peak_tangential_stress"]["value"]
    check(max(profile["tangential_stress"], key=abs) == peak, "the profile does not hold the peak")
    check(len(profile["s"]) > 10 and max(profile["normal_stress"]) <= 1e-9, "the profile is no punch's")
    check_table(folder, "punch.profile", profile)
    check_table(folder, "punch.history", columns(history))
    for ending in ("csv", "jsonl", "arrow"):
        short, named = folder / ("punch." + ending), folder / ("punch.profile." + ending)
        check(short.read_bytes() == named.read_bytes(), "punch.%s is no profile" % ending)
    check((folder / "punch.profile.top.csv").read_bytes() == (folder / "punch.csv").read_bytes(), "the profile of top differs")

    exact, rounded = derived(fields)
    check(len(fields["x"]) == 199 and len(fields["elements"]) == 56, "the mesh has other nodes or elements")
    area = check_vtu(folder / "punch.vtu", fields, exact, rounded)
    check(abs(area - 16) < 1e-9, "the body of 4 × 4 has the area %g" % area)
    check_npz_fields(np.load(folder / "punch.fields.npz"), fields, exact, rounded, "punch.fields.npz")

    everything = np.load(folder / "punch.npz")
    part = lambda prefix: {name[len(prefix):]: everything[name] for name in everything if name.startswith(prefix)}
    check_npz_fields(part("fields/"), fields, exact, rounded, "punch.npz")
    for prefix, values in (("history/", columns(history)), ("profiles/top/", profile)):
        found = part(prefix)
        check(set(found) == set(values), "punch.npz, %s holds %s" % (prefix, set(found)))
        for name, column in values.items():
            column = array(column)
            same(found[name].astype(object) if column.dtype == object else found[name], column, prefix + name)

    # the state at a node is that of the profile, and only nodes of the profile have one
    state = exact["contact_state"]
    place = {(x, y): node for node, (x, y) in enumerate(zip(fields["x"], fields["y"]))}
    rows = [row for row, xy in enumerate(zip(profile["x"], profile["y"])) if xy in place]
    touched = [place[profile["x"][row], profile["y"][row]] for row in rows]
    check(len(rows) == 11, "the profile has %d nodes" % len(rows))
    same(state[touched], np.array([STATES[profile["state"][row]] for row in rows]), "contact_state along the profile")
    check((np.delete(state, touched) == -1).all(), "a node off the contact has a state")

    root = ElementTree.parse(folder / "punch.svg").getroot()
    check(root.tag == "{http://www.w3.org/2000/svg}svg", "punch.svg is a %s" % root.tag)


def check_mixed_and_two(folder):
    """Both kinds of element, a contact below and above: pressed from both sides."""
    nodes, number = [], {}

    def node(x, y):
        if (x, y) not in number:
            number[x, y] = len(nodes)
            nodes.append([x, y])
        return number[x, y]

    def element(*corners):
        midsides = [((a[0] + b[0]) / 2, (a[1] + b[1]) / 2) for a, b in zip(corners, corners[1:] + corners[:1])]
        return [node(*place) for place in (*corners, *midsides)]

    def edge(a, b):
        return [node(*a), node(*b), node((a[0] + b[0]) / 2, (a[1] + b[1]) / 2)]

    elements = []
    for i in range(6):
        for j in range(4):
            a, b, c, d = (i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)
            elements += [element(a, b, c, d)] if (i + j) % 2 else [element(a, b, c), element(a, c, d)]
    contact = lambda name: {"boundary": name, "obstacle": {"kind": "circle", "radius": 20, "center": 3}, "indentation": 0.05,
                            "friction": {"coefficient": 0.3, "nonlocal_radius": 0.05, "elastic_slip": 1e-4}}
    problem = {
        "analysis": {"kind": "plane_strain"},
        "mesh": {"inline": {"nodes": nodes, "elements": elements, "boundaries": {
            "over": [edge((i, 4), (i + 1, 4)) for i in range(6)],
            "under": [edge((i, 0), (i + 1, 0)) for i in range(6)],
            "left": [edge((0, j), (0, j + 1)) for j in range(4)],
        }}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}],
        "supports": [{"boundary": "left", "ux": 0, "uy": 0}],
        "contacts": [contact("over"), contact("under")],
    }
    file = folder / "problem.json"
    file.write_text(json.dumps(problem))
    out = folder / "out"
    out.mkdir()
    solve(file, out, "m.json", "m.npz", "m.vtu", "m.profile.over.csv", "m.profile.under.csv")
    document = json.loads((out / "m.json").read_text(encoding="utf-8"))
    fields = document["fields"]
    check({len(e) for e in fields["elements"]} == {6, 8}, "the mesh is not mixed")
    exact, rounded = derived(fields)
    area = check_vtu(out / "m.vtu", fields, exact, rounded)
    check(abs(area - 24) < 1e-9, "the body of 6 × 4 has the area %g" % area)
    everything = np.load(out / "m.npz")
    check_npz_fields({name[7:]: everything[name] for name in everything if name.startswith("fields/")}, fields, exact, rounded, "m.npz")
    for name in ("over", "under"):
        csv = pd.read_csv(out / ("m.profile.%s.csv" % name), float_precision="round_trip")
        for column, values in document["profiles"][name].items():
            values = array(values)
            same(csv[column].to_numpy(dtype=object if values.dtype == object else None), values, "%s, %s" % (name, column))
            found = everything["profiles/%s/%s" % (name, column)]
            same(found.astype(object) if values.dtype == object else found, values, "m.npz, %s" % column)


def check_large(folder):
    """Arrays of several compressed blocks, for VTK and for NumPy."""
    problem = json.loads((TOP / "tests/data/thesis/rectangular_punch.json").read_text(encoding="utf-8"))
    problem["mesh"]["refine"] = 4
    file = folder / "problem.json"
    file.write_text(json.dumps(problem))
    out = folder / "out"
    out.mkdir()
    solve(file, out, "l.json", "l.vtu", "l.fields.npz", *("l.profile." + ending for ending in ("csv", "jsonl", "arrow", "npz")))
    document = json.loads((out / "l.json").read_text(encoding="utf-8"))
    fields = document["fields"]
    check(len(fields["elements"]) == 56 * 4**4, "the mesh is not refined")
    exact, rounded = derived(fields)
    area = check_vtu(out / "l.vtu", fields, exact, rounded)
    check(abs(area - 16) < 1e-9, "the refined body has the area %g" % area)
    check_npz_fields(np.load(out / "l.fields.npz"), fields, exact, rounded, "l.fields.npz")
    check_table(out, "l.profile", document["profiles"]["top"])


def check_refusals(folder):
    problem = TOP / "tests/data/thesis/rectangular_punch.json"
    for name in ("punch.xlsx", "punch", "punch.fields.csv", "punch.profile.left.csv", "no-such-folder/punch.csv"):
        done = subprocess.run([BINARY, "solve", problem, "-o", folder / name], capture_output=True, text=True)
        check(done.returncode == 2, "-o %s ended with %d" % (name, done.returncode))
        check("residual" not in done.stderr, "-o %s was refused only after solving" % name)
    check(not list(folder.iterdir()), "a refusal left files behind")


def main():
    for part in (check_example, check_mixed_and_two, check_large, check_refusals):
        with tempfile.TemporaryDirectory() as folder:
            part(pathlib.Path(folder))
    print("every format is read back as it was written: %d checks" % checks)


main()
