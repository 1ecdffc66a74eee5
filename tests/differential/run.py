"""Solves random problems by the program and by an independent one, and compares everything that both know.

    run.py PROGRAM [--problems N] [--first SEED] [--record PAGE]
    run.py PROGRAM --seed SEED      one problem, with its differences

The cases with known values of cases.py come first. A problem that disagrees is kept in target/differential, with the inline
mesh that the text of its mesh file stands for; its number makes it again.
"""

import argparse
import collections
import concurrent.futures
import json
import os
import pathlib
import subprocess
import sys
import time
import traceback

# one thread each: there are several processes
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import skfem
from scipy.spatial import cKDTree

import cases
import contact
import generate
import meshes

# Both have the same discretisation, so what is left is rounding. Without contact differences are parts of what rounding of the
# stiffness may change in this body, which is computed, and of the sums that are made of it. With contact they are parts of the
# largest value: there the tolerance of the iterations (1e-10) is more, which slips of some elastic slips, and the ratio of
# friction to it, make larger.
ELASTIC, WITH_CONTACT, WITH_FRICTION = 1.0, 1e-7, 1e-6
SUMS = 1e-12
FOLDER = pathlib.Path("target/differential")


def program(path, problem, folder, name):
    """The document of the program, or why there is none."""
    given, out = folder / f"{name}.json", folder / f"{name}.out.json"
    given.write_text(json.dumps(problem))
    out.unlink(missing_ok=True)
    done = subprocess.run([path, "solve", str(given), "-o", str(out)], capture_output=True, text=True, timeout=300)
    if done.returncode not in (0, 9) or not out.exists():
        return None, f"exit {done.returncode}: {done.stderr.strip()[:600]}"
    document = json.loads(out.read_text())
    out.unlink()
    given.unlink()
    return document, None


def allowed(problem):
    laws = [c.get("friction") for c in problem.get("contacts", [])]
    if any(laws):
        return WITH_FRICTION
    return WITH_CONTACT if problem.get("contacts") else ELASTIC


def off(a, b, least=0.0):
    """Largest difference as a part of the largest value."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    if not (np.all(np.isfinite(a)) and np.all(np.isfinite(b))):
        return np.inf
    size = max(np.abs(a).max(initial=0.0), np.abs(b).max(initial=0.0), least)
    return np.abs(a - b).max(initial=0.0) / size if size > 0 else 0.0


def parts_of_rounding(reference, results, ours, stresses, steps):
    """Differences without contact, as parts of what rounding may change. `stresses`: of both."""
    last, found = results[-1], {}
    displacement, stress, energy = reference.rounding(results)

    def note(name, a, b, rounding, largest=0.0):
        a, b = np.asarray(a, float), np.asarray(b, float)
        allowed = rounding + SUMS * max(np.abs(a).max(initial=largest), np.abs(b).max(initial=0.0))
        off = np.abs(a - b).max(initial=0.0)
        part = off / allowed if off > 0 else 0.0
        found[name] = max(found.get(name, 0.0), part if np.isfinite(part) else np.inf)

    note("displacements", ours, last["u"], displacement)
    note("stresses", *stresses, stress)
    for step, result in zip(steps, results):
        largest = max(abs(step["summary"]["energy"]), step["summary"]["strain_energy"])
        for name, value in result["summary"].items():
            is_energy = name.endswith(("energy", "work"))
            note(name, step["summary"][name], value, *((energy, largest) if is_energy else (0.0, 0.0)))
    return found


def compare(problem, document, reference, results):
    """Differences by quantity: without contact as parts of what rounding may change, else of the largest value of their kind."""
    last, found = results[-1], {}
    fields, mesh = document["fields"], reference.mesh
    place = cKDTree(np.column_stack([fields["x"], fields["y"]]))
    distance, at = place.query(mesh.nodes)
    if len(fields["x"]) != len(mesh.nodes) or distance.max() > 1e-9 * mesh.size or len(set(at)) != len(at):
        return {"nodes": np.inf}
    ours = np.column_stack([fields["ux"], fields["uy"]])[at]
    gauss = fields["gauss"]
    points = cKDTree(np.column_stack([gauss["x"], gauss["y"]]))
    stresses = np.column_stack([gauss[f"stress_{c}"] for c in ("xx", "yy", "zz", "xy")])
    theirs, own = [], []
    for x, stress in last["stress"]:
        distance, at = points.query(x)
        if distance.max() > 1e-9 * mesh.size:
            return {"integration points": np.inf}
        theirs.append(stress)
        own.append(stresses[at])
    steps = document["steps"] if problem.get("steps") else [document]
    if len(steps) != len(results):
        return {"steps": np.inf}
    stresses = [np.concatenate(part) if part else np.zeros((0, 4)) for part in (own, theirs)]
    if not problem.get("contacts"):
        return parts_of_rounding(reference, results, ours, stresses, steps)
    # a step that takes all loads away leaves rounding of the displacements before it
    largest = max(np.abs(result["u"]).max() for result in results)
    found["displacements"] = off(ours, last["u"], 1e-3 * largest)
    # stresses of a body that moves far and strains little are differences of its displacements
    modulus = max(np.abs(r).max() for r, _ in reference.body.stiffness)
    rounding = 1e-5 * modulus * largest / mesh.size
    found["stresses"] = off(*stresses, rounding)
    force = rounding * mesh.size * max(reference.body.thickness, 1) * reference.body.ring
    for step, result in zip(steps, results):
        summary = step["summary"]
        size = max(abs(summary["normal_force"]), abs(summary["friction_force"]), force)
        for name, value in result["summary"].items():
            if name == "friction_force" and any(c.get("condition") == "bonded" for c in problem.get("contacts", [])):
                continue
            if name.endswith(("energy", "work")):
                least = max(abs(summary["energy"]), summary["strain_energy"], force * largest)
            else:
                least = size
            found[name] = max(found.get(name, 0), off(summary[name], value, least))
        for boundary, own in result["profiles"].items():
            profiles(found, step["profiles"][boundary], own, result, largest, rounding)
            integral(found, step["profiles"][boundary], own, step["summary"]["contacts"][boundary], size)
    return found


def integral(found, theirs, own, summary, size):
    """The pressure between the nodes, quadratic on each edge, adds up to the normal force."""
    s, pressures = np.array(theirs["s"]), -np.array(theirs["normal_stress"])
    at = [int(np.argmin(np.abs(s - x))) for x in own["s"]]
    pressures, areas = pressures[at], own["areas"]
    for end, beside in ((0, 1), (-1, -2)):
        if areas[end] == 0 and pressures[end] > 0 and pressures[beside] <= 0:
            return  # the node on the axis has no area: without the one beside it the profile shows its pressure alone
    found["integral of a profile"] = max(
        found.get("integral of a profile", 0), off(areas @ pressures, summary["normal_force"], size)
    )


def profiles(found, theirs, own, result, largest, rounding):
    """Columns along a contact, at its nodes and where friction acts."""
    s = np.array(theirs["s"])
    stress = max(np.abs(theirs["normal_stress"]).max(initial=0), rounding)

    def note(name, a, b, least):
        found[name] = max(found.get(name, 0), off(a, b, least))

    def rows(at):
        nearest = [int(np.argmin(np.abs(s - x))) for x in at]
        near = np.abs(s[nearest] - at).max() <= 1e-8 * max(np.ptp(own["s"]), 1e-300)
        return nearest if near else None

    at = rows(own["s"])
    if at is None:
        found["profile rows"] = np.inf
        return
    gap = np.abs(own["gap"]).max()
    note("gap", np.array(theirs["gap"])[at], own["gap"], max(gap, largest))
    for name in ("normal_displacement", "tangential_displacement"):
        note(name, np.array(theirs[name])[at], own[name], largest)
    note("normal_stress", np.array(theirs["normal_stress"])[at], own["normal_stress"], stress)
    if "points" in own:
        points = own["points"]
        at = rows(points["s"])
        if at is None:
            found["friction rows"] = np.inf
            return
        for name in ("tangential_stress", "friction_bound", "nonlocal_pressure"):
            if name in points:
                note(name, np.array(theirs[name])[at], points[name], stress)


def one(path, seed, contacts=True):
    """Outcome of one problem: its features, differences, and what is wrong."""
    problem, stands_for, features = generate.problem(seed, contacts)
    limit = allowed(problem)
    report = {"seed": seed, "features": features, "differences": {}, "wrong": None, "limit": limit}
    document, refused = program(path, problem, FOLDER, f"seed-{seed}")
    mesh, results = meshes.read(problem["mesh"], stands_for), None
    if document and isinstance(problem["mesh"].get("refine"), dict):
        fields = document["fields"]
        mesh = meshes.descendant(mesh, np.column_stack([fields["x"], fields["y"]]), fields["elements"])
    if document:
        try:
            reference = contact.Reference(problem, mesh)
            results = reference.solve()
        except contact.Unsolved as reason:
            report["unsolved"] = {"seed": seed, "why": str(reason), "outcome": document["summary"]["outcome"]}
    if refused:
        report["wrong"] = refused
    elif results is not None:
        report["differences"] = compare(problem, document, reference, results)
        judge(report, problem, document, reference, path)
    if report["wrong"]:
        keep(seed, problem, stands_for)
    return report


def judge(report, problem, document, reference, path):
    """Notes what is wrong: differences beyond their limit, unless the program's is another solution of the same equations and is not
    called good."""
    wrong = beyond(report["differences"], report["limit"])
    if not wrong:
        return
    has_friction = any("friction" in c for c in problem.get("contacts", []))
    if has_friction and other_solution(problem, document, reference, report["limit"]):
        report["differences"], report["other"] = {}, said(document, problem, path, report["seed"])
        if report["other"]["verdict"] == "good":
            report["wrong"] = "there are several solutions, and the verdict is good"
        return
    report["wrong"] = ", ".join(f"{name} {d:.1e}" for name, d in sorted(wrong.items(), key=lambda x: -x[1]))
    report["outcome"] = document["summary"]["outcome"]
    report["warnings"] = [w["code"] for w in document["summary"]["warnings"]]


def beyond(differences, limit):
    return {name: d for name, d in differences.items() if not d <= limit}


def other_solution(problem, document, reference, limit):
    """Whether the program's result solves the reference's equations too: friction may have several solutions."""
    steps = document["steps"] if problem.get("steps") else [document]
    try:
        results = reference.solve([step["profiles"] for step in steps])
    except contact.Unsolved:
        return False
    return not beyond(compare(problem, document, reference, results), limit)


def said(document, problem, path, seed):
    """What the program says of a problem with several solutions, and whether `check_uniqueness` finds a second one."""
    checked = problem | {"solver": problem.get("solver", {}) | {"check_uniqueness": True}}
    again, _ = program(path, checked, FOLDER, f"seed-{seed}-checked")
    found = again and any(w["code"] == "not_unique" for w in again["summary"]["warnings"])
    laws = [given.get("friction") or {} for given in problem["contacts"]]
    return {
        "seed": seed, "verdict": document["summary"]["accuracy"]["verdict"], "found": bool(found),
        "cohesion": any(law.get("cohesion") for law in laws), "incremental": any(law.get("history") == "incremental" for law in laws),
    }  # fmt: skip


def keep(seed, problem, stands_for):
    (FOLDER / f"seed-{seed}.json").write_text(json.dumps(problem))
    if stands_for:
        (FOLDER / f"seed-{seed}.mesh.json").write_text(json.dumps(stands_for))


def independent(problem):
    """The reference's results; None where it has none: it does not refine adaptively."""
    if isinstance(problem["mesh"].get("refine", 0), dict):
        return None
    return contact.Reference(problem, meshes.read(problem["mesh"])).solve()


def inside(path):
    """A deck with a load inside the body: refused, since it changes the solution."""
    deck = FOLDER / "inside.inp"
    deck.write_text(cases.INSIDE)
    done = subprocess.run([path, "solve", str(deck)], capture_output=True, text=True, timeout=60)
    return [] if done.returncode == 2 else [f"case load inside the body: exit {done.returncode}, expected a refusal"]


def guarded(arguments):
    seed = arguments[1]
    try:
        return one(*arguments)
    except Exception as fault:  # a fault of the test itself is a disagreement too
        return {"seed": seed, "features": [], "differences": {}, "wrong": f"the test failed: {fault!r}\n{traceback.format_exc()}"}


class Tally:
    """Counts by feature, the largest differences, and what disagrees."""

    def __init__(self):
        self.counts, self.disagreeing = collections.Counter(), collections.Counter()
        self.largest, self.compared = collections.defaultdict(float), collections.Counter()
        self.wrong, self.unsolved, self.others, self.problems = [], [], [], 0

    def add(self, report):
        self.problems += 1
        self.counts.update(report["features"])
        if report.get("unsolved"):
            self.unsolved.append(report["unsolved"])
        if report.get("other"):
            self.others.append(report["other"])
        if report["wrong"]:
            self.wrong.append(report)
            self.disagreeing.update(report["features"])
            about = [report.get("outcome", ""), " ".join(report.get("warnings", []))]
            print(f"seed {report['seed']}: {report['wrong'][:1500]} {' '.join(about)}".rstrip(), flush=True)
            return
        for name, value in report["differences"].items():
            kind = report["limit"]
            self.largest[name, kind] = max(self.largest[name, kind], value)
            self.compared[name, kind] += 1

    def not_compared(self):
        """The problems with several solutions, and those that the independent program did not solve, as Markdown."""
        lines = []
        for other in self.others:
            law = [word for word in ("cohesion", "incremental") if other[word]]
            checked = "finds a second one" if other["found"] else "finds no second one"
            lines.append(
                f"- {other['seed']}{' (' + ', '.join(law) + ')' if law else ''}: several solutions; verdict `{other['verdict']}`; "
                f"`check_uniqueness` {checked}"
            )
        for one in self.unsolved:
            lines.append(f"- {one['seed']}: not solved; {one['why']}; the outcome of `signorini` is `{one['outcome']}`")
        return "\n".join(lines)

    def table(self):
        """Markdown."""
        lines = ["| quantity | without contact | with contact | with friction |", "|---|---|---|---|"]
        for name in sorted({name for name, _ in self.largest}):
            cells = [
                f"{self.largest[name, kind]:.0e} ({self.compared[name, kind]})" if self.compared[name, kind] else ""
                for kind in (ELASTIC, WITH_CONTACT, WITH_FRICTION)
            ]
            lines.append(f"| {name.replace('_', ' ')} | " + " | ".join(cells) + " |")
        lines += ["", "| problems with | number | disagree |", "|---|---|---|"]
        for name, count in sorted(self.counts.items()):
            lines.append(f"| {name.replace('_', ' ')} | {count} | {self.disagreeing[name]} |")
        return "\n".join(lines) + "\n"


PAGE = """# Random problems, solved twice

Generated by `tests/soak differential`; `tests/run` does the same with the first 200 problems.

{problems} problems from a generator (`tests/differential/generate.py`) are solved by `signorini solve` and by an independent program
(`elastic.py` and `contact.py` beside it): elements and assembly of scikit-fem {version}, contact by a small active set, friction by
Newton's method on the condensed system, all written from formulation.md and the descriptions in the JSON Schema. Both have
the same discretisation, so everything must agree to rounding. What rounding may change is computed for each body without contact:
the entries of its stiffness are known to {roundings} roundings of themselves, and forces of that size, with random signs, are applied
to it. They do most to bodies that are thin or nearly incompressible, or that move far and strain little. With contact
{contact:.0e} of the largest value is allowed, and {friction:.0e} with friction, where the tolerance of the iterations and the ratio of
slips to the elastic slip are more than rounding.
Displacements are compared at all nodes, stresses at all integration points, forces and energies of every load step,
gaps, displacements, pressures, averages and friction along every contact; and the pressure of every profile is integrated.

**{wrong} of {problems} problems disagree.** {others} have several solutions, as friction allows (formulation 4.8): the independent
program found another one first, and that of `signorini` when it began near it. None of these results may have the verdict `good`.
{unsolved} were not solved by the independent program, and are not compared.

{not_compared}

Largest differences, with the number of problems compared; without contact as parts of what rounding may change, else of the
largest value:

{table}"""


def parser():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--problems", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--seed", type=int, help="one problem only")
    parser.add_argument("--no-contacts", action="store_true")
    parser.add_argument("--record", type=pathlib.Path, help="write the table there")
    return parser


def main():
    options = parser().parse_args()
    FOLDER.mkdir(parents=True, exist_ok=True)
    path = str(pathlib.Path(options.program).resolve())
    contacts = not options.no_contacts
    if options.seed is not None:
        print(json.dumps(guarded((path, options.seed, contacts)), indent=1))
        return
    start = time.time()
    name_of = lambda name: "case-" + "".join(c if c.isalnum() else "-" for c in name)
    known = cases.check(lambda problem, name: program(path, problem, FOLDER, name_of(name)), independent) + inside(path)
    print("\n".join(known) if known else "cases with known values: all agree", flush=True)
    tally = Tally()
    with concurrent.futures.ProcessPoolExecutor(options.processes) as pool:
        jobs = ((path, options.first + k, contacts) for k in range(options.problems))
        for report in pool.map(guarded, jobs, chunksize=8):
            tally.add(report)
    print(tally.table())
    print(tally.not_compared())
    print(f"{tally.problems} problems in {time.time() - start:.0f} s: {len(tally.wrong)} disagree")
    if options.record:
        options.record.write_text(PAGE.format(
            problems=tally.problems, version=skfem.__version__, roundings=contact.ROUNDINGS, contact=WITH_CONTACT, friction=WITH_FRICTION,
            wrong=len(tally.wrong), unsolved=len(tally.unsolved), others=len(tally.others),
            not_compared=tally.not_compared(), table=tally.table(),
        ))  # fmt: skip
    # a reference that gives up often compares nothing
    many = len(tally.unsolved + tally.others) > max(3, 0.01 * tally.problems)
    if many:
        print("more than 1 % of the problems were not compared, or found by beginning near")
    sys.exit(bool(tally.wrong or known or many))


if __name__ == "__main__":
    main()
