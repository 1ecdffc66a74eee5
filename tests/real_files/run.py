"""Reads the mesh files and decks that other programs ship, and says what becomes of each: docs/real_files.md.

Usage: run.py SIGNORINI [--write]

The files are fetched by pip and apt-get into target/real_files and are not part of the repository. A registry that cannot
be reached ends the run with exit code 1 and its name: nothing is skipped silently. Without --write the page is compared.
Needs the packages of requirements.txt beside it (meshio counts, gmsh meshes its own tutorials) and CalculiX (ccx).
"""

import collections
import gzip
import pathlib
import re
import subprocess
import sys
import tarfile
import zipfile

import meshio

TOP = pathlib.Path(__file__).resolve().parents[2]
STORE = TOP / "target" / "real_files"
PAGE = TOP / "docs" / "real_files.md"

# sdists and wheels with meshes or decks; several others were looked through and have none
PACKAGES = {"meshio": ("5.3.5", "--no-binary"), "gmsh": ("4.15.2", "--only-binary")}
DEBIAN = "calculix-ccx-test"

# plane files that are refused for what is wrong with them
BROKEN = {
    "beamfsh1.inp": "its first line is `>**`, which is neither a comment nor a keyword",
    "scheibe.inp": "a set names node 29, which does not exist; CalculiX warns, and leaves it out",
}

# those of Gmsh's tutorials that are plane, and small
PLANE_TUTORIALS = ("t1", "t4", "t6", "t8", "t11")

# relative to the largest displacement, as in tests/calculix.py
ALLOWED = {"CPE": 1e-5, "CAX": 5e-4, "CPS": 1e-2}


def fetch():
    """The folders with the files of each source."""
    sources = {}
    for name, (version, kind) in PACKAGES.items():
        folder = STORE / f"{name}-{version}"
        if not (folder / "complete").exists():
            folder.mkdir(parents=True, exist_ok=True)
            command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", kind, name, "-d", folder, f"{name}=={version}"]
            called(command, f"{name} {version} from PyPI")
            for archive in [*folder.glob("*.tar.gz"), *folder.glob("*.whl"), *folder.glob("*.zip")]:
                unpack(archive, folder)
            (folder / "complete").touch()
        sources[f"{name} {version}"] = folder
    folder = STORE / DEBIAN
    if not (folder / "complete").exists():
        folder.mkdir(parents=True, exist_ok=True)
        called(["apt-get", "download", "--quiet", DEBIAN], f"{DEBIAN} from Debian", cwd=folder)
        for archive in folder.glob("*.deb"):
            called(["dpkg-deb", "-x", archive, folder], f"{archive.name}")
        (folder / "complete").touch()
    [package] = folder.glob("*.deb")
    sources[package.name.removesuffix("_all.deb").replace("_", " ")] = folder
    return sources


def called(command, what, cwd=None):
    done = subprocess.run([str(part) for part in command], cwd=cwd, capture_output=True, text=True, timeout=600)
    if done.returncode != 0:
        sys.exit(f"real_files: cannot fetch {what}: {done.stderr.strip().splitlines()[-1:]}")


def unpack(archive, folder):
    """Only what may be a mesh, a deck or a geometry."""
    wanted = re.compile(r"\.(inp|msh|geo|pos)(\.gz)?$")
    if archive.name.endswith(".tar.gz"):
        with tarfile.open(archive) as tar:
            members = [member for member in tar.getmembers() if member.isfile() and wanted.search(member.name)]
            tar.extractall(folder, members, filter="data")
    else:
        with zipfile.ZipFile(archive) as packed:
            packed.extractall(folder, [name for name in packed.namelist() if wanted.search(name)])


def files(folder):
    """Meshes and decks, unpacked."""
    for path in sorted(folder.rglob("*.gz")):
        if path.name.endswith((".inp.gz", ".msh.gz")) and not path.with_suffix("").exists():
            path.with_suffix("").write_bytes(gzip.decompress(path.read_bytes()))
    return sorted({*folder.rglob("*.inp"), *folder.rglob("*.msh")}, key=lambda path: path.name)


def tutorials(folder, into):
    """Gmsh's own tutorials, meshed by Gmsh in the formats that are read here, by first and by second order."""
    into.mkdir(exist_ok=True)
    made = []
    gmsh = pathlib.Path(sys.executable).with_name("gmsh")
    for path in (found for name in PLANE_TUTORIALS for found in folder.rglob(f"tutorials/{name}.geo")):
        for order in (1, 2):
            for kind, ending in (("msh22", "msh"), ("msh41", "msh"), ("inp", "inp")):
                out = into / f"{path.stem}-{kind}-order{order}.{ending}"
                made.append(out)
                if out.exists():
                    continue
                command = [sys.executable, gmsh, path, "-2", "-order", order, "-format", kind, "-o", out, "-nopopup", "-v", "1"]
                called(command, f"{out.name}, which Gmsh makes", cwd=path.parent)
    return made


# elements of three dimensions, which Gmsh writes instead of their surface; in a deck they stand beside the plane ones
SOLID = re.compile(r"tetra|hexahedron|wedge|pyramid")

# plane elements of decks with their number of nodes: solids, and what has a plane shape and another stiffness
PLANE = re.compile(r"(CPE|CPS|CAX|STRI|M3D|SFM3D|DC2D|DCAX|DS|S)(\d)")


class Content:
    """What a file holds, by a reader that is not ours: plane elements, by their nodes; `foreign`: the types of those that are
    geometry here, but have another stiffness (shells, membranes)."""

    def __init__(self, elements, points, others, foreign=()):
        self.others = sorted(others)
        self.foreign = sorted(foreign)
        self.elements = elements
        used = {node for element in elements for node in element}
        z = {points[node][2] for node in used if node in points}
        self.plane = bool(elements) and not any(SOLID.match(name) for name in others) and len(z) == 1
        self.missing = any(node not in points for node in used)
        # elements of first order get midsides, which neighbours share
        second = {edge(e, k) for e in elements if len(e) in (6, 8, 9) for k in range(corners(e))}
        first = {edge(e, k) for e in elements if len(e) in (3, 4) for k in range(corners(e))}
        centres = {e[8] for e in elements if len(e) == 9}
        self.nodes = len(used - centres) + len(first - second)


def corners(element):
    return 3 if len(element) in (3, 6) else 4


def edge(element, k):
    return frozenset((element[k], element[(k + 1) % corners(element)]))


def content(path):
    return deck_content(path) if path.suffix == ".inp" else gmsh_content(path)


def gmsh_content(path):
    try:
        mesh = meshio.read(path)
    except (Exception, SystemExit) as error:  # meshio raises many kinds, or exits
        return f"meshio: {type(error).__name__}"
    points = {k: (*point, 0.0)[:3] for k, point in enumerate(mesh.points)}
    plane = re.compile(r"(triangle|quad)(6|8|9)?$")
    elements = [tuple(map(int, row)) for block in mesh.cells if plane.match(block.type) for row in block.data]
    others = {block.type for block in mesh.cells if not plane.match(block.type)}
    return Content(elements, points, others)


def deck_content(path):
    """meshio reads few decks of CalculiX: nodes and elements, by the format's own rules."""
    points, elements, others, foreign, pending, mode = {}, [], set(), set(), [], None
    for line in path.read_text(encoding="latin-1").splitlines():
        line = line.strip()
        if not line or line.startswith("**"):
            continue
        if line.startswith("*"):
            words = [word.strip().upper() for word in line.split(",")]
            name, mode, pending = words[0].replace(" ", ""), None, []
            if name == "*INCLUDE":
                return "an *INCLUDE"
            if name == "*NODE":
                mode = "node"
            elif name == "*ELEMENT":
                kind = next((word.split("=")[1].strip() for word in words if word.replace(" ", "").startswith("TYPE=")), "")
                plane = PLANE.match(kind)
                mode = int(plane[2]) if plane else None
                others |= set() if plane else {kind}
                foreign |= {kind} if plane and not plane[1].startswith("C") else set()
        elif mode == "node":
            words = [word.strip() for word in line.split(",")]
            values = [float(word.upper().replace("D", "E")) if word else 0.0 for word in words[1:4]]
            points[int(words[0])] = tuple(values + [0.0] * (3 - len(values)))
        elif mode:
            pending += [int(word) for word in line.split(",") if word.strip()]
            while len(pending) > mode:
                elements.append(tuple(pending[1 : mode + 1]))
                pending = pending[mode + 1 :]
    return Content(elements, points, others, foreign)


def run(program, path):
    """What `signorini solve` says: exit code, and its lines."""
    done = subprocess.run([program, "solve", str(path)], capture_output=True, text=True, timeout=120)
    return done.returncode, done.stderr.strip().splitlines()


def as_mesh(program, path):
    """Nodes and elements as we read them, or the words of the first violation."""
    given = path
    if path.suffix == ".inp":
        text = path.read_bytes()
        # what comes before the first step is a mesh by itself
        given = STORE / "mesh.inp"
        given.write_bytes(re.split(rb"(?im)^\s*\*\s*STEP\b", text)[0])
    _, lines = run(program, given)
    counts = re.search(r" is a mesh, not a problem: (\d+) nodes, (\d+) elements", lines[0]) if lines else None
    return (int(counts[1]), int(counts[2])) if counts else words(lines)


def words(lines):
    """The first violation in short, without its hint."""
    # the first line counts them
    text = next((line.strip() for line in lines if ": expected " in line), lines[0] if lines else "nothing is said")
    found = re.search(r"got (.*)", text)
    text = re.sub(r"^line \d+: ", "", found[1] if found else text)
    return re.split(r"\. [A-Z*]", text)[0][:90].rstrip(".").replace("|", "\\|")


def against_calculix(path, ours):
    """The largest difference from CalculiX's displacements, relative to their size; none for elements of first order, which
    are of second order here."""
    text = path.read_text(encoding="latin-1")
    kinds = set(re.findall(r"(?im)^\*ELEMENT\b.*?TYPE\s*=\s*(C\w+)", text))
    if not kinds or any(re.search(r"[34]", kind[3:4]) for kind in kinds):
        return None
    folder = STORE / "ccx"
    folder.mkdir(exist_ok=True)
    requests = re.sub(r"(?im)^\*END STEP", "*NODE FILE, GLOBAL=YES, OUTPUT=2D\nU\n*END STEP", text)
    (folder / "deck.inp").write_text(requests, encoding="latin-1")
    subprocess.run(["ccx", "deck"], cwd=folder, capture_output=True, timeout=120)
    theirs, reading = {}, False
    for line in (folder / "deck.frd").read_text().splitlines():
        if line.startswith(" -4  DISP"):
            theirs, reading = {}, True
        elif line.startswith(" -3"):
            reading = False
        elif reading and line.startswith(" -1"):
            theirs[int(line[3:13])] = (float(line[13:25]), float(line[25:37]))
    size = max(abs(u) for pair in theirs.values() for u in pair)
    labels = sorted(set(theirs) & set(ours))
    if size == 0 or len(labels) < 3:
        sys.exit(f"{path.name}: nothing to compare with CalculiX")
    off = max(abs(a - b) for label in labels for a, b in zip(theirs[label], ours[label]))
    return off / size, ALLOWED[next(iter(kinds))[:3].upper()]


def displacements(program, path):
    """By the labels of the nodes that elements use, in the order of the file."""
    import json

    out = STORE / "solved.json"
    subprocess.run([program, "solve", str(path), "-o", str(out)], check=True, capture_output=True, timeout=120)
    fields = json.loads(out.read_text())["fields"]
    found = content(path)
    used = {node for element in found.elements for node in element}
    order = [int(row[0]) for row in nodes_of(path) if int(row[0]) in used]
    return dict(zip(order, zip(fields["ux"], fields["uy"])))


def nodes_of(path):
    mode = False
    for line in path.read_text(encoding="latin-1").splitlines():
        if line.startswith("*"):
            mode = mode if line.startswith("**") else line.split(",")[0].strip().upper() == "*NODE"
        elif mode and line.strip():
            yield line.split(",")


def look(program, path):
    """A row of the table: what the file is, what becomes of it as a mesh and as a problem, and whether that is a fault."""
    expected, mesh = content(path), as_mesh(program, path)
    if isinstance(expected, str) or not expected.plane:
        what = expected if isinstance(expected, str) else ("not plane" if expected.elements else "no plane elements")
        others = "" if isinstance(expected, str) else ", ".join(expected.others[:4])
        is_read = isinstance(mesh, tuple)
        # a file that another reader cannot read is no fault of either
        fault = is_read and not isinstance(expected, str) and path.name not in BROKEN
        return [what + (f" ({others})" if others else ""), "read" if is_read else f"refused: {mesh}", "", fault]
    right = (expected.nodes, len(expected.elements))
    what = f"plane, {right[1]} elements" + (f" ({', '.join(expected.foreign)})" if expected.foreign else "")
    if mesh != right:
        fault = path.name not in BROKEN
        return [what, f"refused: {mesh}" if isinstance(mesh, str) else f"{mesh} for {right}", BROKEN.get(path.name, ""), fault]
    row = [what, f"read: {right[0]} nodes", "", False]
    if path.suffix == ".inp" and re.search(r"(?im)^\*STEP\b", path.read_text(encoding="latin-1")):
        code, lines = run(program, path)
        if code == 0:
            off = against_calculix(path, displacements(program, path))
            row[2] = "solved" if off is None else f"solved; from CalculiX {off[0]:.0e}"
            row[3] = bool(expected.foreign) or (off is not None and off[0] > off[1])
        else:
            row[2] = f"refused: {words(lines)}"
    return row


def main():
    program = str(pathlib.Path(sys.argv[1]).resolve())
    sources = fetch()
    page = ["# Files of other programs", "", "Generated by `tests/real_files/run.py`: mesh files and decks that packages ship, each read by `signorini` and by a reader",
            "that is not ours (meshio, or the format's rules in forty lines). Plane files are listed, others counted by the words",
            "that refuse them. Nothing of these files is in the repository.", ""]
    faults = []
    made = next(folder for name, folder in sources.items() if name.startswith("gmsh"))
    groups = {name: files(folder) for name, folder in sources.items()}
    groups["Gmsh's tutorials, meshed by Gmsh"] = tutorials(made, STORE / "tutorials")
    for name, paths in groups.items():
        if not paths:
            sys.exit(f"real_files: {name} has no mesh and no deck any more")
        rows = {path.name: look(program, path) for path in paths}
        plane = {file: row for file, row in rows.items() if row[0].startswith("plane")}
        page += [f"## {name}", "", f"{len(rows)} files, {len(plane)} of them plane.", ""]
        if plane:
            page += ["| file | is | as a mesh | as a problem |", "|---|---|---|---|"]
            page += [f"| {file} | {row[0]} | {row[1]} | {row[2]} |" for file, row in plane.items()] + [""]
        others = collections.Counter((row[0].split(" (")[0], re.sub(r"`[^`]*`", "`…`", re.sub(r"\d\S*", "…", row[1]))) for file, row in rows.items() if file not in plane)
        if others:
            page += ["| others | | files |", "|---|---|---|"]
            page += [f"| {what} | {said} | {count} |" for (what, said), count in sorted(others.items(), key=lambda item: (-item[1], item[0]))] + [""]
        faults += [f"{name}: {file}: {row[0]}; {row[1]}; {row[2]}" for file, row in rows.items() if row[3]]
        print(f"{name}: {len(rows)} files, {len(plane)} plane, {sum(row[1].startswith('read') for row in rows.values())} read,"
              f" {sum(row[2].startswith('solved') for row in rows.values())} solved")
    text = "\n".join(page)
    if "--write" in sys.argv:
        PAGE.write_text(text, encoding="utf-8")
    elif PAGE.read_text(encoding="utf-8") != text:
        faults.append("docs/real_files.md is not what this run found: run with --write and look at the difference")
    for fault in faults:
        print(f"FAULT {fault}")
    if faults:
        sys.exit(f"real_files: {len(faults)} faults")


main()
