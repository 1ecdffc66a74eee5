"""Meshes of a megabyte that would take gigabytes or minutes if they were taken at their word (item 7 of the attacks).

    decks.py [--soak]

Each file is read by `signorini solve` in a process of its own, in which memory and CPU time are measured: as the mesh
of a problem, and decks as a whole problem too. Most are refused, in words; some are harmless. With --soak the files
have 16 MiB.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

from outside import BINARY, check, equal

SOAK = "--soak" in sys.argv
MIB = 1 << 20
SIZE = 16 * MIB - 65536 if SOAK else MIB
# beyond what the process takes for an empty deck; what a mesh takes that is sound: positions, labels, sets, and the
# search for its surface
MOST_TIMES, MOST_CPU_S = 20, 8.0 if SOAK else 1.0


def fill(make, joint="\n", size=SIZE):
    """As many lines, made from their numbers, as fit."""
    lines, room = [], size
    while room > 0:
        lines.append(make(len(lines)))
        room -= len(lines[-1]) + len(joint)
    return joint.join(lines) + "\n"


def strip(count):
    """Nodes and elements of a strip of `count` squares."""
    nodes = "".join("%d,%d,%d\n" % (2 * k + j + 1, k, j) for k in range(count + 1) for j in (0, 1))
    squares = "".join("%d,%d,%d,%d,%d\n" % (k + 1, 2 * k + 1, 2 * k + 3, 2 * k + 4, 2 * k + 2) for k in range(count))
    return "*NODE\n%s*ELEMENT, TYPE=CPE4, ELSET=ALL\n%s" % (nodes, squares)


SQUARE = strip(1)
# a rigid circle on the third side of the first square, with its node of reference
TOUCHED = """*NODE
99999999,0,0
*SURFACE, TYPE=SEGMENTS, NAME=TOOL
START,4,5
CIRCL,0,1,0,5
CIRCL,-4,5,0,5
*RIGID BODY, ANALYTICAL SURFACE=TOOL, REF NODE=99999999
*SURFACE, NAME=FACE
1,S3
*SURFACE INTERACTION, NAME=I
*CONTACT PAIR, INTERACTION=I
FACE,TOOL
*BOUNDARY
99999999,1,6
"""


def decks():
    many = SIZE // 45
    labels = lambda: "".join("%d,\n" % (k + 1) for k in range(many))
    nodes = lambda: "*NODE\n" + "".join("%d,%d,0\n" % (k + 1, k) for k in range(many))
    yield "n sets that each name a set of n nodes", lambda: nodes() + "*NSET, NSET=N\n" + labels() + fill(
        lambda k: "*NSET, NSET=S%d\nN" % k, size=SIZE // 3)
    yield "a chain of sets", lambda: SQUARE + fill(lambda k: "*NSET, NSET=S%06d\nS%06d,1" % (k, k + 1))
    yield "3,000 chained sets", lambda: SQUARE + "".join("*NSET, NSET=S%d\nS%d\n" % (k, k + 1) for k in range(3000))
    yield "sets that all contain one another", lambda: SQUARE + "".join(
        "*NSET, NSET=S%d\n%s\n" % (k, ",".join("S%d" % j for j in range(400))) for k in range(400 if not SOAK else 1600))
    yield "a set that contains itself, often", lambda: SQUARE + "*NSET, NSET=A\n" + fill(lambda _: "A,A,A,A")
    yield "sets that do not exist, in a set", lambda: SQUARE + "*NSET, NSET=A\n" + fill(lambda k: "B%d" % k)
    yield "GENERATE to 2^63, often", lambda: SQUARE + "*NSET, NSET=A, GENERATE\n" + fill(lambda _: "1,9223372036854775807,1")
    yield "GENERATE in steps of 2^31", lambda: SQUARE + "*NSET, NSET=A, GENERATE\n" + fill(lambda k: "1,18446744073709551615,2147483648")
    half = SIZE // 2
    yield "GENERATE over all nodes, often", lambda: "*NODE\n" + fill(lambda k: "%d,%d,0" % (k + 1, k), size=half) + (
        "*NSET, NSET=A, GENERATE\n" + fill(lambda _: "1,99999999", size=half))
    yield "GENERATE over a hole of the labels", lambda: "*NODE\n" + fill(lambda k: "%d,%d,0" % (k + 1, k), size=half) + (
        "*NSET, NSET=A, GENERATE\n" + fill(lambda _: "50000,199999", size=half))
    yield "GENERATE over distant labels", lambda: "*NODE\n" + fill(lambda k: "%d,%d,0" % (10**12 + 7 * k, k), size=half) + (
        "*NSET, NSET=A, GENERATE\n" + fill(lambda _: "1,99999999999999", size=half))
    yield "surfaces of a large set", lambda: strip(SIZE // 60) + fill(lambda k: "*SURFACE, NAME=S%d\nALL,S1" % k, size=SIZE // 3)
    yield "a surface of the same set, often", lambda: strip(SIZE // 60) + "*SURFACE, NAME=S\n" + fill(lambda _: "ALL,S1", size=SIZE // 3)
    yield "pressures on a large set", lambda: strip(SIZE // 60) + "*DLOAD\n" + fill(lambda _: "ALL,P1,5", size=SIZE // 3)
    parts = "*PART, NAME=P\n%s*END PART\n"
    instances = lambda: fill(lambda k: "*INSTANCE, NAME=I%d, PART=P\n*END INSTANCE" % k, size=SIZE // 2)
    yield "instances without end", lambda: parts % "" + instances()
    yield "instances of a part", lambda: parts % strip(SIZE // 500) + instances()
    yield "names of many instances", lambda: parts % "" + "".join(
        "*INSTANCE, NAME=I%d, PART=P\n*END INSTANCE\n" % k for k in range(250)) + SQUARE + "*NSET, NSET=A\n" + fill(lambda k: "w.%d.x" % k)
    yield "nodes of a large set of elements, often", lambda: strip(SIZE // 200) + fill(lambda _: "*NSET, NSET=S, ELSET=ALL")
    yield "nodes of a large set of elements", lambda: strip(SIZE // 200) + fill(lambda k: "*NSET, NSET=S%d, ELSET=ALL" % k)
    yield "the surface of a large set", lambda: strip(SIZE // 200) + fill(lambda k: "*SURFACE, NAME=S%d\nALL" % k)
    yield "forces on a large set without elements", lambda: nodes() + "*NSET, NSET=N\n" + labels() + "*CLOAD\n" + fill(lambda _: "N,1,2", size=SIZE // 3)
    yield "conditions on a large set", lambda: nodes() + "*NSET, NSET=N\n" + labels() + "*BOUNDARY\n" + fill(lambda _: "N,1,2", size=SIZE // 3)
    held = lambda: strip(SIZE // 300) + "*NSET, NSET=N, ELSET=ALL\n" + TOUCHED + "N,1,2\n"
    step = "*STEP\n*STATIC\n%s*END STEP\n"
    yield "supports of a large set with elements, often", lambda: held() + fill(lambda _: "N,1,2", size=SIZE // 3)
    yield "forces on a large set with elements, often", lambda: held() + "*CLOAD\n" + fill(lambda _: "N,1,2", size=SIZE // 3)
    yield "surfaces of a large set beside a rigid body", lambda: held() + fill(
        lambda k: "*SURFACE, NAME=S%d\nALL,S1" % k, size=SIZE // 3)
    yield "supports of a large set in each step", lambda: held() + step % "*BOUNDARY\nN,1,2\n" * 999
    yield "supports of a large set anew in each step", lambda: held() + "*NSET, NSET=M, ELSET=ALL\n" + "".join(
        step % ("*BOUNDARY, OP=NEW\n%s,1,2\n99999999,1,6\n" % "NM"[k % 2]) for k in range(999))
    yield "motions of a rigid body, and many steps", lambda: SQUARE + TOUCHED + fill(
        lambda k: "99999999,1,1,%d" % k, size=half) + step % "" * 999
    body = "*RIGID BODY, NSET=R%d, REF NODE=1"
    yield "many rigid bodies in many steps", lambda: "*PART, NAME=P\n*NODE\n1,0,0\n" + "\n".join(
        body % k for k in range(1000)) + "\n*END PART\n" + "".join(
        "*INSTANCE, NAME=I%d, PART=P\n*END INSTANCE\n" % k for k in range(200)) + step % "" * 999
    yield "steps without end", lambda: SQUARE + TOUCHED + fill(lambda _: step % "", joint="", size=half)
    yield "a name of a whole line at every node", lambda: SQUARE + "*NODE, NSET=" + "N" * 500_000 + "\n" + fill(
        lambda k: "%d,0,0" % (k + 10), size=half)
    yield "long names that are unknown", lambda: SQUARE + "*NSET, NSET=A\n" + fill(lambda k: "B%d%s" % (k, "x" * 2000))
    yield "names without end", lambda: SQUARE + fill(lambda k: "*NSET, NSET=S%d\n1" % k)
    yield "one label, often", lambda: SQUARE + "*NSET, NSET=A\n" + fill(lambda _: "1,1,1,1,1,1,1,1")
    yield "a keyword of many lines", lambda: SQUARE + "*NSET, NSET=A,\n" + fill(lambda k: "P%d," % k)
    yield "elements with one node, often", lambda: SQUARE + "*ELEMENT, TYPE=CPE4\n" + fill(lambda k: "%d,1,1,1,1" % (k + 9))
    yield "elements of unknown nodes", lambda: SQUARE + "*ELEMENT, TYPE=CPE4\n" + fill(lambda k: "%d,7,8,9,10" % (k + 9))
    yield "constants without end", lambda: SQUARE + "*MATERIAL, NAME=M\n*ELASTIC\n" + fill(lambda _: "1,1,1,1", size=half) + fill(
        lambda _: "*SOLID SECTION, ELSET=ALL, MATERIAL=M", size=half)
    yield "rows of *BOUNDARY for different nodes", lambda: nodes() + "*BOUNDARY\n" + fill(lambda k: "%d,1" % (k % many + 1), size=SIZE // 2)
    yield "*INCLUDE", lambda: SQUARE + fill(lambda _: "*INCLUDE, INPUT=/dev/zero")
    yield "a line without end", lambda: "*NODE\n" + "1," * half


HEAD = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n"


def gmsh():
    yield "4e9 nodes declared", lambda: HEAD + "$Nodes\n1 4000000000 1 4000000000\n2 1 0 4000000000\n1\n"
    yield "2^63 nodes in version 2", lambda: "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n9223372036854775807\n1 0 0 0\n"
    yield "4e9 elements declared", lambda: HEAD + "$Nodes\n0 0 0 0\n$EndNodes\n$Elements\n4000000000 4000000000 1 2\n"
    yield "2^60 entities", lambda: HEAD + "$Entities\n1152921504606846976 0 0 0\n1 0 0 0 0\n"
    yield "2^60 tags of an entity", lambda: HEAD + "$Entities\n1 0 0 0\n1 0 0 0 1152921504606846976 1 2 3\n"
    yield "2^60 names", lambda: HEAD + '$PhysicalNames\n1152921504606846976\n1 1 "a"\n'
    half = SIZE // 2
    points = "$Nodes\n1 3 1 3\n2 1 0 3\n1\n2\n3\n0 0 0\n1 0 0\n0 1 0\n$EndNodes\n"

    def entity():
        tags = half // 4
        return HEAD + "$Entities\n0 0 1 0\n1 0 0 0 1 1 0 %d %s 0\n$EndEntities\n" % (tags, "1\n" * tags)

    def elements(head, lines):
        return "$Elements\n%s\n%s$EndElements\n" % (head % {"n": lines.count("\n")}, lines)

    triangles = lambda: elements("1 %(n)d 1 9\n2 1 2 %(n)d", fill(lambda k: "%d 1 2 3" % (k + 1), size=half))
    blocks = lambda: elements("%(n)d 0 1 9", fill(lambda k: "2 1 2 0", size=half))
    name = "n" * min(half, MIB - 100)
    yield "an entity in many groups", lambda: entity() + points + triangles()
    yield "blocks without elements of such an entity", lambda: entity() + points + blocks()
    yield "a long name at every element", lambda: HEAD + (
        '$PhysicalNames\n1\n2 1 "%s"\n$EndPhysicalNames\n$Entities\n0 0 1 0\n1 0 0 0 1 1 0 1 1 0\n$EndEntities\n'
    ) % name + points + triangles()
    yield "a periodic section without end", lambda: HEAD + "$Periodic\n" + fill(lambda k: "1 %d" % k)
    yield "a partitioned mesh", lambda: HEAD + "$PartitionedEntities\n" + fill(lambda k: "1 %d" % k)


def solve(folder, name):
    """Exit code, words, bytes of memory and CPU seconds of one run."""
    command = [BINARY, "solve", name]
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, cwd=folder)
    words = child.stderr.read(1 << 20).decode()
    _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    return child.returncode, words, used.ru_maxrss << 10, used.ru_utime + used.ru_stime


def write(folder, kind, text):
    """Writes the files of a case, in a process of its own: the peak of a new process counts from its parent's size."""
    writer = os.fork()
    if writer:
        equal(os.waitpid(writer, 0)[1], 0, "writing a file")
        return
    problem = {"analysis": {"kind": "plane_strain"}, "materials": [{"youngs_modulus": 1, "poissons_ratio": 0.3}]}
    mesh = text()
    with open(folder + "/problem.json", "w") as file:
        json.dump({**problem, "mesh": {kind: mesh}}, file)
    with open(folder + "/deck.inp", "w") as file:
        file.write(mesh + "*STEP\n*STATIC\n*END STEP\n")
    os._exit(0)


def main():
    worst, count = [0.0, 0.0, 0.0], 0
    with tempfile.TemporaryDirectory() as folder:
        write(folder, "abaqus", str)
        floor = solve(folder, "problem.json")[2]
        cases = [("abaqus", *deck) for deck in decks()] + [("gmsh", *mesh) for mesh in gmsh()]
        for kind, name, text in cases:
            write(folder, kind, text)
            for file in ("problem.json", "deck.inp")[: 2 if kind == "abaqus" else 1]:
                size = os.path.getsize(folder + "/" + file)
                code, words, peak, cpu = solve(folder, file)
                grown = max(0, peak - floor)
                print("%-45s %-12s %d  %6.1f MiB  × %4.1f  CPU %.2f s  %s" % (
                    name[:45], file, code, grown / MIB, grown / size, cpu, " ".join(words.split())[:90]), flush=True)
                check(code in (0, 2, 9), "%s: exit code %d, %s" % (name, code, words[-600:]))
                check(code == 0 or words, "%s: no words" % name)
                check(len(words) < 128 << 10, "%s: %d bytes of words" % (name, len(words)))
                check(grown <= MOST_TIMES * size + 4 * MIB, "%s: %.0f MiB" % (name, grown / MIB))
                check(cpu <= MOST_CPU_S, "%s: %.2f CPU s" % (name, cpu))
                worst = [max(worst[0], grown / MIB), max(worst[1], grown / size if size > MIB // 2 else 0), max(worst[2], cpu)]
                count += 1
        check_follow_on(folder)
    print("figure: %d hostile mesh files of up to %.1f MiB, each read or refused with at most %.0f MiB (%.0f times its "
          "size) and %.2f CPU s; one bad line is one violation" % (count, SIZE / MIB, *worst))


def check_follow_on(folder):
    """One bad line is one violation, whatever needs what it would have said."""
    good = SQUARE + "*NSET, NSET=A\n1,2\n*SURFACE, NAME=S\nALL,S1\n*MATERIAL, NAME=M\n*ELASTIC\n1000,0.3\n" \
        "*SOLID SECTION, ELSET=ALL, MATERIAL=M\n*STEP\n*STATIC\n*BOUNDARY\nA,1,2\n*DLOAD\n1,P3,1\n*END STEP\n"
    pathlib.Path(folder, "good.inp").write_text(good)
    code, words, _, _ = solve(folder, "good.inp")
    check(code == 0, "the good deck: %s" % words)
    for old, new in (("1,0,0\n", "1,O,0\n"), ("1,1,3,4,2\n", "1,1,3,x,2\n"), ("NSET=A\n", "NSET\n"), ("1000,0.3", "1OOO,0.3")):
        check(old in good, "the deck has %r" % old)
        pathlib.Path(folder, "bad.inp").write_text(good.replace(old, new, 1))
        code, words, _, _ = solve(folder, "bad.inp")
        check(code == 2 and words.count("expected") == 1, "%r instead of %r: %s" % (new, old, words))


main()
