"""Measures `signorini solve` as a whole process, against itself, a factorisation and other programs, and prints the
tables of docs/performance.md, "Against other programs".

    solver.py [--runs N] [--only NAME,...] [--against BINARY] [--members] [--large]

All tables without `--large` take some fifteen minutes, most of them `free`. Runs (5 when absent) of what is compared
take turns, so that a machine that slows down for a while slows both. Ratios are formed within a turn; each row has the
least, the median and the most of them. Seconds are processor time, so that other work on the machine does not count,
except where it says clock.

--only     of whole, growth, cholmod, pair, threads, iterations, increments, nonlocal, sweeps, fill, peers, free,
           free-peers
--against  another binary, such as an older build, in the turns of `whole`, `cholmod`, `threads`, `nonlocal` and `free`
--members  in `sweeps` also each of 1,000 members in a process of its own, some three minutes
--large    also `peers` and `free-peers`: GetFEM and CalculiX at 2e5 degrees of freedom on a grid and on a free mesh,
           twice each, some twenty minutes

Solutions take one thread, except where two are measured. `cargo build --release --workspace` comes first, or
SIGNORINI_BINARY; `reference`, of the same build and beside it, says what a factor has and what a dense one takes;
`free` needs that of the other binary too. `cholmod`, `fill` and `free` need the environment of tests/peers, `fill`,
`free` and `free-peers` Gmsh (Debian's package gmsh), `--large` the programs of tests/peers.
"""

import argparse
import json
import math
import os
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

TESTS = pathlib.Path(__file__).resolve().parent.parent
sys.path[:0] = [str(TESTS), str(TESTS / "peers")]

import problem
import programs
from measured import ONE_THREAD, measured, peak_bytes
from outside import BINARY

MIB = 1 << 20
PEER_RUNS = 2
ADAPTIVE_TOLERANCE = 3e-4
# Of the processors: what other programs may take of them while a clock is compared.
QUIET = 0.05
REFERENCE = BINARY.parent / "reference"
GMSH = {"fillet": (0, 0.04), "sheet": (8, 0.03), "hertz": (6, 0.25)}  # the family of elements, and the size of all
CONTACTS = {
    name: {"supports": [{"boundary": held, "ux": 0, "uy": 0}],
           "contacts": [{"boundary": contact, "indentation": 0.01,
                         "obstacle": {"kind": "circle", "radius": 8, "center": 1}}]}
    for name, held, contact in (("fillet", "bottom", "top"), ("sheet", "right", "bottom"), ("hertz", "base", "contact"))
}
# Free meshes of tests/data/gmsh/block.geo, by the nodes of an element and the unknowns: the size of all elements.
FREE = {(6, "2e5"): 0.0363, (8, "2e5"): 0.0327, (6, "6e5"): 0.021, (8, "6e5"): 0.01887}
HALF_CONTACT = 0.68  # of the problem of tests/peers
GOALS = {  # of issues 14 and 33
    "nonlocal": "≤ 1.15", "adaptive nonlocal": "≤ 1.5", "unknowns": "≤ 2",
    "whole/factorisation": "≤ 1.3", "cholmod": "≤ 0.5", "GetFEM": "≥ 50", "CalculiX": "≥ 140",
    "growth": "≤ 1.35", "iterations/whole": "≤ 0.25", "pair": "≥ 1.7", "increments": "≤ 1.5",
    "iterations/dense": "≤ 1", "user 2e5": "≤ 0.6", "user 1e6": "≤ 4", "peak 1e6": "≤ 1,434", "peak": "≤ 1.3",
    "threads": "≥ 1.5", "sweep/job": "≤ 2", "10,000 members": "≤ 5", "member": "≤ 1e-9",
    "free user": "≤ 1", "free": "≤ 0.8", "graded": "≤ 0.6", "free threads": "≥ 1.6", "free GetFEM": "≥ 30",
    "free CalculiX": "≥ 80",
}


def p1(mesh, normal="body"):
    return problem.problem(problem.mesh(mesh), problem.COEFFICIENT, normal)


def long_contact(radius):
    """A block with 500 elements along the contact: about 2,000 unknowns there."""
    made = p1("500")
    made["mesh"]["grid"]["y"] = [-problem.HEIGHT * (1 - j / 66) for j in range(67)]
    made["contacts"][0]["obstacle"]["radius"] = radius
    return made


def averaged(lines, part, tolerance=None):
    """P1 on the named lines, friction averaged over a part of the half contact; adaptive if there is a tolerance."""
    made = p1(lines)
    made["contacts"][0]["friction"]["nonlocal_radius"] = part * HALF_CONTACT
    if tolerance:
        made["mesh"]["refine"] = {"tolerance": tolerance}
    return made


def increments():
    """A cylinder is pressed on, shifted and lifted in 80 increments, with 150 elements along the contact."""
    made = p1("41")
    made["mesh"]["grid"] = {"x": [-4 + 8 * i / 150 for i in range(151)],
                            "y": [-8, -6, -4.5, -3.4, -2.6, -2, -1.5, -1.1, -0.8, -0.5, -0.3, -0.12, 0]}
    made["supports"] = [{"boundary": "bottom", "ux": 0, "uy": 0}]
    contact = made["contacts"][0]
    contact["tangential_displacement"] = 0.02
    contact["friction"].update(nonlocal_radius=0.1, history="incremental")
    made["steps"] = [
        {"name": "load", "indentation": 1, "tangential_displacement": 0, "increments": 30},
        {"name": "shift", "indentation": 1, "tangential_displacement": 1, "increments": 20},
        {"name": "unload", "indentation": 0.1, "tangential_displacement": 1, "increments": 30},
    ]
    return made


def even(start, stop, count):
    return {"linspace": {"start": start, "stop": stop, "count": count}}


def axes(values):
    """The axes of a sweep, by the names of numbers of its contact."""
    return [{"path": "/contacts/0/" + name, **axis} for name, axis in values.items()]


def thousand():
    """1,000 members on P1 at 2e4 degrees of freedom."""
    return {"base": p1("2e4"), "axes": axes({
        "friction/nonlocal_radius": even(0.02, 0.04, 5), "friction/coefficient": even(0.05, 0.45, 5),
        "friction/elastic_slip": even(1e-4, 2e-4, 5), "indentation": even(0.06, 0.1, 8)})}


def ten_thousand():
    """10,000 members on example 1, of 56 elements."""
    base = json.loads((TESTS / "data/thesis/rectangular_punch.json").read_text())
    return {"base": base, "axes": axes({
        "friction/nonlocal_radius": even(0.008, 0.015, 10), "friction/coefficient": even(0.05, 0.5, 10),
        "friction/elastic_slip": {"logspace": {"start": 1e-5, "stop": 1e-3, "count": 10}},
        "indentation": even(0.1, 0.3, 10)})}


class Folder:
    """Problems as files, and where results go."""

    def __init__(self, name):
        self.path = pathlib.Path(name)

    def file(self, name, content):
        path = self.path / (name + ".json")
        path.write_text(json.dumps(content))
        return path

    def result(self):
        return self.path / "result.json"


def reference(*arguments):
    """What the program `reference` prints."""
    command = [REFERENCE, *map(str, arguments)]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def factor_bytes(file, binary=BINARY):
    """The bytes of a problem's factor and of its condensed stiffness, in the build of a binary."""
    command = [binary.parent / REFERENCE.name, "factor", str(file)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        _, entries = process.stdout.readline().split()
        process.kill()
    return 8 * int(entries)


def gmsh(folder, geometry, family, size, **numbers):
    """The file of a mesh that Gmsh makes from a geometry of tests/data/gmsh with some of its numbers set, all elements
    `size` times as large."""
    file = folder.path / ("%s-%d-%g.msh" % (geometry, family, size))
    if not file.exists():
        chosen = [word for pair in {"family": family, **numbers}.items() for word in ("-setnumber", *map(str, pair))]
        subprocess.run(["gmsh", str(TESTS / "data/gmsh" / (geometry + ".geo")), "-2", "-v", "2", "-format", "msh41",
                        *chosen, "-clscale", str(size), "-o", str(file)], check=True, stdout=subprocess.DEVNULL)
    return str(file)


def free_mesh(folder, nodes, unknowns):
    """The block of P1 in free elements of so many nodes, which grow away from the contact."""
    return gmsh(folder, "block", nodes, FREE[nodes, unknowns], width=problem.WIDTH, height=problem.HEIGHT)


def binaries(options):
    """The binaries that take turns, by their names in tables."""
    return {"Signorini": BINARY, **({"the other binary": options.against} if options.against else {})}


def one_thread(binary):
    """The option for one thread; older builds have none, and no second thread."""
    usage = subprocess.run([binary, "solve", "--help"], stdout=subprocess.PIPE, text=True).stdout
    return ["--threads", "1"] if "--threads" in usage else []


def solve(folder, file, binary=BINARY):
    """Solves a problem; returns what the process used, and the CPU seconds of factorisation and iterations."""
    starts = {}
    command = [str(binary), "solve", str(file), "-o", str(folder.result()), *one_thread(binary)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        # The clock of the processor time of another process: pthread_getcpuclockid(3) for processes. It is read when
        # the process tells that a phase begins; Linux brings it up to date every few milliseconds.
        clock = (~process.pid << 3) | 2
        lines = []
        for line in process.stderr:
            lines.append(line)
            words = line.split()
            if len(words) == 2 and words[1] == "…":
                starts[words[0]] = time.clock_gettime(clock), user_s(process.pid)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit("signorini solve ended with %d\n%s" % (process.returncode, "".join(lines[-5:])))
    cpu = used.ru_utime + used.ru_stime

    def between(phase, after):
        return [b - a for a, b in zip(starts[phase], starts[after])]

    factorisation = between("order", "iterate")  # the phases order, factor and condense
    return {
        "user": used.ru_utime, "system": used.ru_stime, "cpu": cpu, "faults": used.ru_minflt,
        "peak": peak_bytes(used), "iterate": between("iterate", "recover")[0],
        "factorisation": factorisation[0], "factorisation_user": factorisation[1],
        "summary": summary(folder.result()),
    }


def user_s(pid):
    """Seconds of processor time of a process, without the system's, to 0.01 s."""
    fields = pathlib.Path("/proc/%d/stat" % pid).read_text().rsplit(")", 1)[1].split()
    return int(fields[11]) / os.sysconf("SC_CLK_TCK")


def summary(result):
    """The summary, which is the first part of a result. The rest is not read: the memory of this process would be
    counted as that of the programs that it starts."""
    with result.open(encoding="utf-8") as file:
        head = file.read(MIB)
    opening = '{"summary":'
    if not head.startswith(opening):
        sys.exit("a result does not begin with its summary")
    return json.JSONDecoder().raw_decode(head, len(opening))[0]


def table(title, rows):
    """Rows of a name, the values of all runs and the goal."""
    print("\n**%s**\n" % title)
    print("| | least | median | most | goal |")
    print("|---|---|---|---|---|")
    for name, values, goal in rows:
        if not values:
            print("| %s | not measured: other programs were busy | | | %s |" % (name, goal))
            continue
        values = sorted(values)
        middle = (values[(len(values) - 1) // 2] + values[len(values) // 2]) / 2
        print("| %s | %s | %s |" % (name, " | ".join(map(shown, (values[0], middle, values[-1]))), goal))
    sys.stdout.flush()


def shown(value):
    """Three digits, thousands with a comma."""
    if value == 0:
        return "0"
    return "{:,.{}f}".format(value, max(0, 2 - math.floor(math.log10(abs(value)))))


def whole(folder, options):
    """P1 as a whole process against its own factorisation, and against another binary."""
    files = {size: folder.file(size, p1(size)) for size in problem.SIZES}
    held = {size: factor_bytes(file) + file.stat().st_size for size, file in files.items()}
    runs = {(size, binary): [] for size in files for binary in (BINARY, options.against) if binary}
    for _ in range(options.runs):
        for (size, binary), done in runs.items():
            done.append(solve(folder, files[size], binary))
    for size in files:
        ours = runs[size, BINARY]
        rows = [
            ("user CPU, s", [run["user"] for run in ours], GOALS.get("user " + size, "")),
            ("system CPU, s", [run["system"] for run in ours], ""),
            ("page faults", [run["faults"] for run in ours], ""),
            ("peak memory, MiB", [run["peak"] / MIB for run in ours], GOALS.get("peak " + size, "")),
            ("peak memory/bytes of the factor and the input", [run["peak"] / held[size] for run in ours],
             GOALS["peak"]),
            ("factorisation (`order`, `factor`, `condense`), CPU s", [run["factorisation"] for run in ours], ""),
        ]
        if size == "2e4":
            rows.append(("whole/factorisation", [run["cpu"] / run["factorisation"] for run in ours], ""))
        else:  # phases long enough for clocks of 0.01 s
            rows += [
                ("whole/factorisation", [run["cpu"] / run["factorisation"] for run in ours],
                 GOALS["whole/factorisation"]),
                ("whole/factorisation, user CPU", [run["user"] / run["factorisation_user"] for run in ours],
                 GOALS["whole/factorisation"]),
            ]
        if options.against:
            pairs = list(zip(ours, runs[size, options.against]))
            for name, key in (("user CPU", "user"), ("CPU", "cpu"), ("page faults", "faults"), ("peak memory", "peak")):
                rows.append(("%s, this/other binary" % name, [a[key] / b[key] for a, b in pairs], ""))
        table("Whole `signorini solve`, %s degrees of freedom (%d runs)"
              % ("{:,}".format(ours[0]["summary"]["dofs"]), options.runs), rows)
    return {size: runs[size, BINARY] for size in files}


def growth(folder, options, done):
    """How user time and memory grow from 2e4 to 1e6 degrees of freedom, from the runs of `whole` if there are."""
    small, large = "2e4", "1e6"
    if not done:
        files = {size: folder.file(size, p1(size)) for size in (small, large)}
        done = {size: [] for size in files}
        for _ in range(options.runs):
            for size, file in files.items():
                done[size].append(solve(folder, file))
    pairs = list(zip(done[small], done[large]))

    def exponents(key):
        return [math.log(b[key] / a[key]) / math.log(b["summary"]["dofs"] / a["summary"]["dofs"]) for a, b in pairs]

    table("Growth with n degrees of freedom from 2e4 to 1e6: the exponent (%d runs)" % len(pairs), [
        ("user CPU", exponents("user"), GOALS["growth"]), ("user and system CPU", exponents("cpu"), GOALS["growth"]),
        ("peak memory", exponents("peak"), ""),
    ])


def cholmod(folder, options):
    """The grid of equidistant lines, of which equal fronts are computed once."""
    against_cholmod(folder, options, "A grid", "2e5", ratio=GOALS["cholmod"])


def free(folder, options):
    """Meshes on which no two fronts are equal; memory, and two threads."""
    six, large = free_mesh(folder, 6, "2e5"), free_mesh(folder, 6, "6e5")
    against_cholmod(folder, options, "Free six-node triangles", six, user=GOALS["free user"], ratio=GOALS["free"])
    for unknowns in ("2e5", "6e5"):
        against_cholmod(folder, options, "Free eight-node quadrilaterals", free_mesh(folder, 8, unknowns),
                        ratio=GOALS["free"])
    against_cholmod(folder, options, "A graded grid", "geometric:129", ratio=GOALS["graded"])
    against_cholmod(folder, options, "Free six-node triangles", large, peak=GOALS["peak"])
    two_threads(folder, options, "6e5 degrees of freedom on free six-node triangles", large, GOALS["free threads"])


def against_cholmod(folder, options, kind, mesh, user="", ratio="", peak=""):
    """A whole `signorini solve` against analyse, factor and solve of the stiffness matrix alone; with its memory, if
    there is a goal for that."""
    file, compared = folder.file("cholmod", p1(mesh)), binaries(options)
    turns = [([solve(folder, file, binary) for binary in compared.values()], programs.solve("CHOLMOD", mesh))
             for _ in range(options.runs)]
    theirs = [run for _, run in turns]
    if not all(run["error"] <= programs.UNIAXIAL for run in theirs):
        sys.exit("CHOLMOD's solution of a uniform pressure is wrong")
    rows = [("CHOLMOD's three calls, user CPU, s", [run["user_s"] for run in theirs], "")]
    for k, (name, binary) in enumerate(compared.items()):
        ours = [runs[k] for runs, _ in turns]
        pairs = list(zip(ours, theirs))
        rows += [
            ("%s as a whole, user CPU, s" % name, [a["user"] for a in ours], user),
            ("user CPU, %s/CHOLMOD" % name, [a["user"] / b["user_s"] for a, b in pairs], ratio),
            ("user and system CPU, %s/CHOLMOD" % name, [a["cpu"] / programs.cpu(b) for a, b in pairs], ratio),
        ]
        if peak:
            held = factor_bytes(file, binary)
            rows += [
                ("%s, peak memory, MiB" % name, [a["peak"] / MIB for a in ours], ""),
                ("%s, peak memory/bytes of the factor" % name, [a["peak"] / held for a in ours], peak),
            ]
    if options.against:
        rows.append(("user CPU, this/other binary", [a["user"] / b["user"] for (a, b), _ in turns], ""))
    title = ("%s, %s degrees of freedom, against CHOLMOD's analyse, factor and solve of the stiffness matrix alone "
             "(%d runs)")
    table(title % (kind, "{:,}".format(turns[0][0][0]["summary"]["dofs"]), options.runs), rows)


def pair(folder, options):
    """Two solutions at once against one after the other, where other programs leave the processors alone."""
    file = folder.file("2e5", p1("2e5"))

    def clock(at_once):
        began = time.monotonic()
        running = []
        for k in range(2):
            out = folder.path / ("pair%d.json" % k)
            running.append(subprocess.Popen([BINARY, "solve", file, "-o", out, "--threads", "1"],
                                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
            if not at_once:
                running[-1].wait()
        if any(process.wait() for process in running):
            sys.exit("signorini solve failed")
        return time.monotonic() - began

    quiet, busy = quiet_turns(options.runs, lambda: (clock(False), clock(True)))
    title = "Two solutions of 2e5 degrees of freedom at once, by the clock (%d runs, without %d that others disturbed)"
    table(title % (len(quiet), busy), [
        ("one after the other, s", [a for a, _ in quiet], ""), ("at once, s", [b for _, b in quiet], ""),
        ("throughput, at once/one after the other", [a / b for a, b in quiet], GOALS["pair"]),
    ])


def threads(folder, options):
    two_threads(folder, options, "1e6 degrees of freedom", "1e6", GOALS["threads"])


def two_threads(folder, options, what, mesh, goal):
    """One solution on two threads against one, by the clock; the results have the same digest."""
    file = folder.file("threads", p1(mesh))
    compared = {name: binary for name, binary in binaries(options).items() if one_thread(binary)}

    def clock(binary, count):
        began = time.monotonic()
        subprocess.run([binary, "solve", file, "-o", folder.result(), "--threads", str(count)], check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        return time.monotonic() - began, summary(folder.result())["digest"]

    def turn():
        return [(clock(binary, 1), clock(binary, 2)) for binary in compared.values()]

    quiet, busy = quiet_turns(options.runs, turn)
    rows = []
    for k, name in enumerate(compared):
        pairs = [pairs[k] for pairs in quiet]
        if any(one != two for (_, one), (_, two) in pairs):
            sys.exit("one thread and two find different results: " + name)
        rows += [
            ("%s, one thread, s" % name, [one for (one, _), _ in pairs], ""),
            ("%s, two threads, s" % name, [two for _, (two, _) in pairs], ""),
            ("%s, one thread/two threads" % name, [one / two for (one, _), (two, _) in pairs], goal),
        ]
    table("A solution of %s alone, by the clock (%d runs, without %d that others disturbed)" % (what, len(quiet), busy),
          rows)


def quiet_turns(runs, turn):
    """Results of turns in which other programs left the processors alone, and how many were not counted."""
    quiet, busy = [], 0
    while len(quiet) < runs and busy < 4 * runs:
        began, before = time.monotonic(), others_s()
        result = turn()
        if others_s() - before <= QUIET * os.cpu_count() * (time.monotonic() - began):
            quiet.append(result)
        else:
            busy += 1
    return quiet, busy


def fill(folder, options):
    """Entries of the factor on three meshes of Gmsh, against other orderings of the same matrix."""
    rows = []
    for name, (family, size) in GMSH.items():
        mesh = gmsh(folder, name, family, size)
        made = {
            "analysis": {"kind": "plane_strain"}, "mesh": problem.mesh(mesh),
            "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}], **CONTACTS[name],
        }
        pattern = reference("factor", folder.file(name, made))
        python = str(TESTS.parent / "target/peers/bin/python")
        counted = subprocess.run([python, str(TESTS / "peers/fill.py")], input=pattern, check=True,
                                 stdout=subprocess.PIPE, text=True).stdout
        found = json.loads(counted)
        rows.append("| %s | {:,} | {:,} | %.2f | %.2f |".format(found["unknowns"], found["signorini"]) % (
            name, found["signorini"] / found["metis"], found["signorini"] / found["amd"]))
    print("\n**Entries of the factor, contact included, on meshes of Gmsh**\n")
    print("| mesh | unknowns | entries | Signorini/METIS | Signorini/AMD |\n|---|---|---|---|---|")
    print("\n".join(rows))


def others_s():
    """Seconds of processor time that all programs of this machine but this one and those that it has ended took, and
    its host from it."""
    words = pathlib.Path("/proc/stat").read_text().split("\n", 1)[0].split()
    user, nice, system, _, _, interrupts, soft, stolen = map(int, words[1:9])
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    own = sum(one.ru_utime + one.ru_stime for one in used)
    return (user + nice + system + interrupts + soft + stolen) / os.sysconf("SC_CLK_TCK") - own


def iterations(folder, options):
    """The iterations where the contact has about 2,000 unknowns, against the whole and a dense factorisation."""
    cases = {"a sixth of the length touches": 8.0, "all of it touches": 400.0}
    rows = []
    for name, radius in cases.items():
        file = folder.file("long", long_contact(radius))
        runs = []
        for _ in range(options.runs):
            run = solve(folder, file)
            unknowns = run["summary"]["contact_dofs"]
            runs.append((run, float(reference("dense", unknowns))))
        count = "%s: {:,} contact unknowns, %d sweeps".format(unknowns) % (name, runs[0][0]["summary"]["iterations"])
        rows.append((count + ", `iterate`, CPU s", [run["iterate"] for run, _ in runs], ""))
        rows.append((name + ": `iterate`/whole", [run["iterate"] / run["cpu"] for run, _ in runs],
                     GOALS["iterations/whole"]))
        rows.append((name + ": `iterate`/dense factorisation",
                     [run["iterate"] / dense for run, dense in runs], GOALS["iterations/dense"]))
    table("The iterations of a long contact with friction (%d runs)" % options.runs, rows)


def eighty_increments(folder, options):
    """A history of 80 increments."""
    file = folder.file("increments", increments())
    runs = [solve(folder, file) for _ in range(options.runs)]
    summary = runs[0]["summary"]
    table("%d increments (press, shift, lift) on 150 elements of contact, %d sweeps (%d runs)"
          % (summary["increments"], summary["iterations"], options.runs), [
              ("user CPU, s", [run["user"] for run in runs], ""),
              ("user and system CPU, s", [run["cpu"] for run in runs], GOALS["increments"]),
          ])


def nonlocal_law(folder, options):
    """What the average over the pressure costs, on fine edges and on meshes that are refined where errors come from."""
    binaries = [BINARY, *filter(None, [options.against])]
    made = {("fixed", part): averaged("graded:3", part) for part in (0, 0.8)}
    made |= {("adaptive", part): averaged("8", part, ADAPTIVE_TOLERANCE) for part in (0, 0.2, 0.8)}
    runs = {(binary, case): [] for binary in binaries for case in made}
    files = {case: folder.file("%s-%g" % case, content) for case, content in made.items()}
    for _ in range(options.runs):
        for (binary, case), done in runs.items():
            done.append(solve(folder, files[case], binary))
    for binary in binaries:
        rows = []
        for kind, part in made:
            done, local = runs[binary, (kind, part)], runs[binary, (kind, 0)]
            name = "%s mesh, ρ = %g of the contact: " % (kind, part)
            rows.append((name + "CPU s", [run["cpu"] for run in done], ""))
            if part:
                goal = GOALS["nonlocal" if kind == "fixed" else "adaptive nonlocal"]
                rows.append((name + "CPU/with ρ = 0", [a["cpu"] / b["cpu"] for a, b in zip(done, local)], goal))
            if kind == "adaptive":
                unknowns = [row["dofs"] for row in done[0]["summary"]["refinements"]]
                rows.append((name + "{:,} unknowns on {} meshes, in sum/on the last".format(unknowns[-1], len(unknowns)),
                             [sum(unknowns) / unknowns[-1]], GOALS["unknowns"]))
        title = "The nonlocal law: {:,} unknowns, and adaptive to {:g} (%d runs%s)".format(
            runs[binary, ("fixed", 0)][0]["summary"]["dofs"], ADAPTIVE_TOLERANCE)
        table(title % (options.runs, ", the other binary" * (binary != BINARY)), rows)


def sweep(folder, file):
    """Solves a sweep: the CPU seconds of the process, and the table."""
    table = folder.path / "table.json"
    used = measured([str(BINARY), "sweep", str(file), "-o", str(table)])
    return used.user_s + used.system_s, json.loads(table.read_text())


def sweeps(folder, options):
    """Sweeps against one job, and each member of one against its own solution in a process of its own."""
    made = thousand()
    many, large = folder.file("many", made), folder.file("large", ten_thousand())
    job = folder.file("job", made["base"])
    runs = []
    for _ in range(options.runs):
        cpu, rows = sweep(folder, many)
        runs.append((cpu, solve(folder, job)["cpu"], sweep(folder, large)[0]))
    worst = 0
    if options.members:
        for row in rows:
            alone = json.loads(json.dumps(made["base"]))
            for path, value in row["parameters"].items():
                *way, last = path.split("/")[1:]
                place = alone
                for token in way:
                    place = place[int(token) if token.isdigit() else token]
                place[last] = value
            own = solve(folder, folder.file("member", alone))["summary"]
            worst = max(worst, *differences(row, own))
    rows = [
        ("1,000 members on 2e4 degrees of freedom, CPU s", [a for a, _, _ in runs], ""),
        ("one job of them, CPU s", [b for _, b, _ in runs], ""),
        ("sweep/job", [a / b for a, b, _ in runs], GOALS["sweep/job"]),
        ("10,000 members on 56 elements, CPU s", [c for _, _, c in runs], GOALS["10,000 members"]),
    ]
    if options.members:
        rows.append(("largest relative difference of any of the 1,000 from its own `solve`", [worst], GOALS["member"]))
    table("Sweeps (%d runs)" % options.runs, rows)


def differences(row, own):
    """Relative differences of a row from a summary; widths as parts of the contact's."""
    contacts = own["contacts"].values()
    for name in ("normal_force", "tangential_force", "friction_force"):
        yield abs(row[name] - own[name]) / abs(own[name])
    for name in ("peak_normal_stress", "peak_tangential_stress"):
        peak = max((contact[name]["value"] for contact in contacts), key=abs)
        yield abs(row[name] - peak) / abs(peak)
    width = sum(end - start for contact in contacts for start, end in contact["contact"])
    for name in ("contact", "stick", "slip"):
        own_width = sum(end - start for contact in contacts for start, end in contact[name])
        yield abs(row[name + "_width"] - own_width) / width


def peers(folder, options):
    """GetFEM and CalculiX on the grid of 2e5 degrees of freedom."""
    found = []
    for coefficient in (0.0, problem.COEFFICIENT):
        found += side_by_side(options, "a grid", "2e5", coefficient, GOALS["GetFEM"], GOALS["CalculiX"])
    findings("of the half model on a grid", found, "graded:2")


def free_peers(folder, options):
    """The same on the free mesh of six-node triangles, with friction."""
    mesh = free_mesh(folder, 6, "2e5")
    found = side_by_side(options, "free six-node triangles", mesh, problem.COEFFICIENT, GOALS["free GetFEM"],
                         GOALS["free CalculiX"])
    # GetFEM does not reach its tolerance on "graded:4", in nine minutes
    findings("of the half model on free six-node triangles", found, "graded:3")


def side_by_side(options, kind, mesh, coefficient, *goals):
    """Prints what GetFEM and CalculiX take, and returns the coefficient and a result of each program."""
    done = {program: [] for program in ("Signorini", "GetFEM", "CalculiX")}
    runs = min(options.runs, PEER_RUNS)
    for _ in range(runs):
        for program, results in done.items():
            results.append(programs.solve(program, mesh, coefficient))
    rows = [("Signorini, user CPU, s", [run["user_s"] for run in done["Signorini"]], "")]
    for program, goal in zip(("GetFEM", "CalculiX"), goals):
        pairs = list(zip(done[program], done["Signorini"]))
        rows += [
            ("%s, user and system CPU, s" % program, [programs.cpu(a) for a, _ in pairs], ""),
            ("%s/Signorini, user CPU" % program, [a["user_s"] / b["user_s"] for a, b in pairs], goal),
            ("%s/Signorini, user and system CPU" % program,
             [programs.cpu(a) / programs.cpu(b) for a, b in pairs], goal),
            ("%s/Signorini, peak memory" % program, [a["peak_bytes"] / b["peak_bytes"] for a, b in pairs], ""),
        ]
    table("Against GetFEM and CalculiX, %s of 2e5 degrees of freedom, μ = %g (%d runs)" % (kind, coefficient, runs),
          rows)
    return [(coefficient, results[0]) for results in done.values()]


def findings(where, found, fine):
    """Prints what programs find, and the distance of each from its limit, by a fine mesh."""
    limits = {coefficient: programs.limits(fine, coefficient) for coefficient, _ in found}
    print("\n**What they find, %s**\n" % where)
    print("| μ | program | degrees of freedom | iterations | peak MiB | force down | across | peak pressure "
          "| error of the force down | across | of the peak | peak/Hertz's of that force |")
    print("|" + "---|" * 12)
    for coefficient, result in found:
        errors = []
        for key in programs.QUANTITIES:
            stated = result.get("stated", {}).get(key)
            errors.append("%.1e" % programs.error(result, limits[coefficient][result["program"]], key)
                          + (" (stated: %.1e)" % stated if stated else ""))
        hertz = "" if coefficient else "%.4f" % (result["peak_pressure"] / problem.hertz(result["vertical_force"]))
        print("| %g | %s | {:,} | %d | {:,.0f} | %s | %s | %s |".format(
            result["dofs"], result["peak_bytes"] / MIB) % (
                coefficient, result["program"], result["iterations"],
                " | ".join("%.4f" % result[key] for key in programs.QUANTITIES), " | ".join(errors), hertz))
    for coefficient, each in limits.items():
        print("\nLimits (%s), μ = %g: %s." % (fine, coefficient, "; ".join(
            "%s %s" % (program, ", ".join("%.4f" % limit[key] for key in programs.QUANTITIES))
            for program, limit in each.items())))
    sys.stdout.flush()


def main():
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--only", type=lambda names: names.split(","))
    parser.add_argument("--against", type=pathlib.Path)
    parser.add_argument("--members", action="store_true")
    parser.add_argument("--large", action="store_true")
    options = parser.parse_args()
    tables = {
        "cholmod": cholmod, "pair": pair, "threads": threads, "iterations": iterations, "increments": eighty_increments,
        "nonlocal": nonlocal_law, "sweeps": sweeps, "fill": fill, "peers": peers, "free": free,
        "free-peers": free_peers,
    }
    every = {"whole", "growth", *tables}
    chosen = options.only or every - (set() if options.large else {"peers", "free-peers"})
    unknown = set(chosen) - every
    if unknown or options.runs < 1:
        parser.error("unknown: " + ", ".join(sorted(unknown)) if unknown else "--runs is at least 1")
    needed = [BINARY, REFERENCE, options.against]
    if options.against and "free" in chosen:
        needed.append(options.against.parent / REFERENCE.name)
    for binary in filter(None, needed):
        if not os.access(binary, os.X_OK):
            parser.error("%s is not a program; `cargo build --release` makes it" % binary)
    os.environ.update(ONE_THREAD)
    with tempfile.TemporaryDirectory() as name:
        folder = Folder(name)
        done = whole(folder, options) if "whole" in chosen else None
        if "growth" in chosen:
            growth(folder, options, done)
        # large meshes come last: the memory of this process is counted as that of the programs after it
        for name, bench in tables.items():
            if name in chosen:
                bench(folder, options)


main()
