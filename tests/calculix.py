"""Runs decks unchanged in CalculiX and in Signorini and compares the displacements of every node.

Usage: calculix.py SIGNORINI
"""

import json
import pathlib
import re
import subprocess
import sys
import tempfile

# Relative to the largest displacement. In plane strain both are the same discretisation: seven printed
# digits, and room for the rounding of coordinates. CalculiX makes bodies of revolution of a sector of two
# degrees and sheets of a layer of bricks, whose thickness strain follows the bricks' shapes: there the
# two agree as far as that approximation goes. In elements with full integration it takes the temperature of a midside
# node, which lies on an arc, for the mean of those at the ends.
ALLOWED = {"ring-cpe": 1e-5, "ring-cax": 5e-4, "ring-cps": 1e-2, "mass-cpe": 1e-5, "mass-cax": 5e-4,
           "heat-cpe8r": 1e-5, "heat-cpe": 1e-3, "heat-cps": 1e-2, "heat-cax": 5e-4,
           "spring-cpe": 1e-5, "spring-cps": 1e-2}

# Rigid tools: CalculiX's contact is a stiff spring at each node, along the normal of the deformed surface. Friction, which
# reaches its bound at a slip in proportion to the pressure there, differs more.
ALLOWED |= {"roller-cpe": 1e-3, "push-cpe": 5e-3, "disc-cpe": 1e-3, "drag-cpe": 5e-3}

# Two elastic bodies: at the end of a contact its penalty lets nodes press that ours leaves open, and it integrates the contact of
# arcs of unequal sides otherwise.
ALLOWED |= {"pair-roller": 1e-2, "pair-fit": 1e-2}
# Of plane elements it makes bricks, and its *TIE leaves their midside nodes out ("no tied constraint is generated").
ONLY_OURS = {"pair-tie-cpe8"}
DECKS = pathlib.Path(__file__).parent / "data" / "abaqus"


def calculix(deck, folder):
    """Displacements by node number."""
    (folder / deck.name).write_bytes(deck.read_bytes())
    done = subprocess.run(["ccx", deck.stem], cwd=folder, capture_output=True, text=True, timeout=120)
    table = folder / f"{deck.stem}.dat"
    if done.returncode != 0 or not table.exists():
        sys.exit(f"{deck.name}: CalculiX failed\n{done.stdout[-2000:]}")
    last = table.read_text().split("displacements")[-1]
    rows = re.findall(r"^\s+(\d+)\s+(\S+)\s+(\S+)\s+\S+$", last, re.M)
    return {int(node): (float(x), float(y)) for node, x, y in rows}


def signorini(program, deck, folder, numbers):
    """Displacements by node number; `numbers`: those of the deck's nodes in their order, which the result keeps. Nodes
    that elements of first order were given come after them."""
    out = folder / f"{deck.stem}.json"
    done = subprocess.run([program, "solve", str(deck), "-o", str(out)], capture_output=True, text=True, timeout=120)
    if done.returncode != 0:
        sys.exit(f"{deck.name}: not solved ({done.returncode})\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    fields = json.loads(out.read_text())["fields"]
    if len(numbers) > len(fields["ux"]):
        sys.exit(f"{deck.name}: {len(numbers)} nodes in the deck, {len(fields['ux'])} in the result")
    return dict(zip(numbers, zip(fields["ux"], fields["uy"])))


def difference(theirs, ours):
    """The largest difference of displacements, relative to the largest displacement, and that."""
    # a body may be at rest
    size = max(abs(u) for pair in theirs.values() for u in pair) or 1.0
    if theirs.keys() != ours.keys():
        sys.exit("the nodes differ")
    return max(abs(a - b) for node in theirs for a, b in zip(theirs[node], ours[node])) / size, size


def main():
    program = str(pathlib.Path(sys.argv[1]).resolve())
    decks = sorted(deck for deck in DECKS.glob("*.inp") if deck.stem not in ONLY_OURS)
    missing = [name for name in ALLOWED if not any(deck.stem.startswith(name) for deck in decks)]
    if missing:
        sys.exit(f"there is no deck {', '.join(missing)}")
    failed = False
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for deck in decks:
            # those of the body, or of both bodies; those of tools are not in the result
            blocks = re.findall(r"^\*NODE(?:, NSET=(\w+))?\n((?:\d+, .*\n)+)", deck.read_text(), re.M)
            nodes = blocks[0][1] + "".join(block for name, block in blocks[1:] if name == "NB")
            numbers = [int(n) for n in re.findall(r"^(\d+), \S+, \S+$", nodes, re.M)]
            ours = signorini(program, deck, folder, numbers)
            off, size = difference(calculix(deck, folder), ours)
            allowed = next(value for name, value in ALLOWED.items() if deck.stem.startswith(name))
            failed |= not off <= allowed
            print(f"{deck.stem:16} {len(ours):4} nodes, largest difference {off:.1e} of {size:.4f}, allowed {allowed:.0e}")
    if failed:
        sys.exit("CalculiX and Signorini differ")


if __name__ == "__main__":
    main()
