"""What hostile bodies cost the server in memory, CPU time and words (R13, and the bound of every body).

    bodies.py [--soak]

Every body must be answered by 400, 413 or 422 (or by the violations, where a problem is only validated) in a short
document, and its peak of memory be at most ten times the body and 16 MiB. Without --soak the bodies have 1 MiB and
must be answered in 100 ms, the best of some times; where other programs keep all processors busy, 100 ms of CPU time
count instead. With it they have 16 MiB and may take one CPU second each. So may the largest meshes that are sound, which
are accepted: in lists, from Gmsh, and as a deck.
"""

import concurrent.futures
import json
import os
import time

from attack import MIB, SOAK, Attacked, Bystander, check
# a little less than the limit of a body
SIZE = 16 * MIB - 4096 if SOAK else MIB
MOST_CPU_S, MOST_S = (1.0, None) if SOAK else (0.1, 0.1)
# beside ten times the body: what the process takes for its first request of a kind
FLOOR = 16 * MIB
LONGEST_ANSWER = 256 << 10

ANALYSIS, GRID = '"analysis":{"kind":"plane_strain"}', '"mesh":{"grid":{"x":[0,1],"y":[0,1]}}'
MATERIALS = '"materials":[{"youngs_modulus":1000,"poissons_ratio":0.3}]'
FLAT = '{"boundary":"top","obstacle":{"kind":"flat"}}'


def problem(analysis=ANALYSIS, mesh=GRID, materials=MATERIALS, more="", before=""):
    """The text of a body with a problem, one part of which is another."""
    parts = ",".join(part for part in (before, analysis, mesh, materials, more) if part)
    return '{"problem":{%s}}' % parts


def fill(head, item, tail, joint=","):
    """As many items as fit between head and tail. An item may have its number in it."""
    numbered = "%d" in item
    room = SIZE - len(head) - len(tail)
    if numbered:
        count = room // (len(item) + len(joint) + 6)
        return head + joint.join(item % n for n in range(count)) + tail
    count = (room + len(joint)) // (len(item) + len(joint))
    return head + joint.join([item] * count) + tail


def around(text, item, joint=","):
    """The body with § replaced by as many items as fit."""
    head, tail = text.split("§")
    return fill(head, item, tail, joint)


def inline(nodes="[0,0]", elements="[0,1,2,3,4,5]", more=""):
    return problem(mesh='"mesh":{"inline":{"nodes":[%s],"elements":[%s]%s}}' % (nodes, elements, more))


def bodies():
    """Name and text of every body."""
    depth = SIZE // 2
    yield "depth 1e5", problem(more='"loads":' + "[" * 100_000 + "]" * 100_000)
    yield "depth of the whole body, unclosed", "[" * SIZE
    yield "depth of objects", '{"problem":' * (SIZE // 12) + "1"
    yield "nested to the end inside a kind", problem(more='"contacts":[{"obstacle":' + "[" * depth)
    yield "1e6 keys of the body", around('{"problem":1,§}', '"k%d":1')
    yield "keys of the problem", around(problem(more="§"), '"k%d":1')
    yield "keys of an obstacle", around(problem(more='"contacts":[{"boundary":"top","obstacle":{"kind":"flat",§}}]'), '"k%d":[]')
    yield "keys of the analysis before its kind", around(problem(analysis='"analysis":{§,"kind":"plane_strain"}'), '"k%d":[[]]')
    yield "the same key", around(problem(more="§"), '"title":""')
    yield "the same key of the body", around('{"problem":1,§}', '"name":""')
    yield "the same boundary", around(inline(more=',"boundaries":{§}'), '"a":[]')
    yield "one huge string", problem(more='"title":' + json.dumps("x" * (SIZE - 300)) + ',"tittle":1')
    yield "one huge string of escapes", problem(more='"loads":"' + "\\u0041" * (SIZE // 6 - 60) + '"')
    yield "one huge name", problem(more='"' + "n" * (SIZE - 300) + '":1')
    yield "a huge kind", problem(analysis='"analysis":{"kind":"' + "n" * (SIZE - 300) + '"}')
    yield "a number of a whole body", problem(more='"quadrature":1' + "0" * (SIZE - 300))
    yield "a fraction of a whole body", problem(more='"quadrature":0.' + "3" * (SIZE - 300))
    yield "1e999", problem(more='"quadrature":1e999')
    yield "many 1e999", around(problem(mesh='"mesh":{"grid":{"x":[§],"y":[0,1]}}'), "1e999")
    yield "NaN", problem(more='"quadrature":NaN')
    yield "lone surrogates", around(problem(more='"title":"§"'), "\\ud800", "")
    yield "numbers half-way between two", around(problem(mesh='"mesh":{"grid":{"x":[§],"y":[0,1,""]}}'), "9007199254740993")
    yield "numbers of 800 digits", around(
        problem(mesh='"mesh":{"grid":{"x":[§],"y":[0,1,""]}}'), "2.4703282292062327208" + "1" * 780 + "e-324")
    empties = ("[]", "{}", "[[]]", '""', "null", "0", "[0,0]", "-1e-9")
    places = {
        "grid lines": problem(mesh='"mesh":{"grid":{"x":[§],"y":[0,1,""]}}'),
        "polylines of a grid": problem(mesh='"mesh":{"grid":{"x":[0,1],"y":[0,1,""],"top":[§]}}'),
        "nodes": inline(nodes="§", elements="[0,1,2,3]"),
        "elements": inline(elements="§,[]"),
        "an element": inline(elements="[§]"),
        "an edge": inline(more=',"boundaries":{"a":[[§]]}'),
        "a boundary": inline(more=',"boundaries":{"a":[§,[]]}'),
        "a group": inline(more=',"groups":{"a":[§,[]]}'),
        "materials": problem(materials='"materials":[§]'),
        "supports": problem(more='"supports":[§,1]'),
        "loads": problem(more='"loads":[§,1]'),
        "contacts": problem(more='"contacts":[§]'),
        "steps": problem(more='"steps":[§,1]'),
        "a load along a boundary": problem(more='"loads":[{"boundary":"top","pressure":[§]}]'),
        "a table": problem(more='"contacts":[{"boundary":"top","obstacle":{"kind":"table","x":[§],"gap":[]}}]'),
        "points before the kind": problem(
            more='"contacts":[{"boundary":"top","obstacle":{"points":[§],"kind":"polyline"}}]'),
        "a table of friction": problem(
            more='"contacts":[{"boundary":"top","obstacle":{"kind":"flat"},"friction":{"elastic_slip":1,"bound":{"s":[§],"bound":[]}}}]'),
        "jobs": '{"jobs":[§]}',
        "a problem": '{"problem":[§]}',
    }
    for place, text in places.items():
        for empty in empties:
            yield "%s in %s" % (empty, place), around(text, empty)
    # refused for their number; half a million are a sound list, and the answer is one of meaning
    if SOAK:
        yield "lines of a grid that are all 0", around(problem(mesh='"mesh":{"grid":{"x":[§],"y":[0,1]}}'), "0")
    yield "names of boundaries", around(inline(more=',"boundaries":{§}'), '"%d":[]')
    yield "names of parts", around(problem(mesh='"mesh":{"grid":{"x":[0,1],"y":[0,1]},"boundaries":{§}}'), '"%d":{}')
    yield "loads that are almost all forms", around(
        problem(more='"loads":[§]'), '{"boundary":"top","nodes":"a","pressure":1,"traction":[0,1],"normal":1,"nodal":[]}')
    yield "contacts of no kind", around(problem(more='"contacts":[§]'), '{"boundary":"top","obstacle":{"radius":1,"kind":"o"}}')
    yield "labels", around('{"problem":{},"labels":{§}}', '"%d":""')
    yield "jobs of a hundred violations each", around('{"jobs":[§]}', '{"problem":{%s}}' % ",".join('"%s":0' % chr(33 + n) for n in range(93) if chr(33 + n) not in '"\\'))
    yield "jobs of one field", around('{"jobs":[§]}', '{"problem":0}')


def sound_meshes():
    """Name and mesh of problems that fill a body: squares of six-node triangles in lists, and of four-node squares in files
    of others. The coordinates have nine digits behind the point, as programs write them."""
    scale = (SIZE / MIB) ** 0.5
    count = int(74 * scale)
    lines = 2 * count + 1
    at = lambda x, y: y * lines + x
    place = lambda step, all: "%.9f" % (1.2345 * step / all)
    triangles = []
    for y in range(0, 2 * count, 2):
        for x in range(0, 2 * count, 2):
            a, b, c, d, middle = at(x, y), at(x + 2, y), at(x + 2, y + 2), at(x, y + 2), at(x + 1, y + 1)
            triangles += ([a, b, c, at(x + 1, y), at(x + 2, y + 1), middle], [a, c, d, middle, at(x + 1, y + 2), at(x, y + 1)])
    sides = {name: [[at(x, y), at(x + 2, y), at(x + 1, y)] for x in range(0, 2 * count, 2)]
             for name, y in (("bottom", 0), ("top", 2 * count))}
    nodes = ",".join("[%s,%s]" % (place(x, lines), place(y, lines)) for y in range(lines) for x in range(lines))
    yield "lists", '{"inline":{"nodes":[%s],"elements":%s,"boundaries":%s}}' % (
        nodes, json.dumps(triangles, separators=(",", ":")), json.dumps(sides, separators=(",", ":")))

    def squares(count):
        """Nodes and elements, each with its number."""
        lines = count + 1
        nodes = [(y * lines + x + 1, place(x, lines), place(y, lines)) for y in range(lines) for x in range(lines)]
        corners = (y * lines + x + 1 for y in range(count) for x in range(count))
        return nodes, [(number + 1, a, a + 1, a + lines + 1, a + lines) for number, a in enumerate(corners)]

    nodes, elements = squares(count := int(117 * scale))
    sides = [(1, x + 1, x + 2) for x in range(count)] + [(2, x + 1, x + 2) for x in range(count * count + count, len(nodes) - 1)]
    lines = ["%d 1 2 %d %d %d %d" % (len(elements) + n, side, side, a, b) for n, (side, a, b) in enumerate(sides, 1)]
    lines += ["%d 3 2 3 3 %d %d %d %d" % one for one in elements]
    yield "Gmsh", json.dumps({"gmsh": '$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n3\n1 1 "bottom"\n1 2 "top"\n2 3 "body"\n'
                              "$EndPhysicalNames\n$Nodes\n%d\n%s\n$EndNodes\n$Elements\n%d\n%s\n$EndElements\n" % (
                                  len(nodes), "\n".join("%d %s %s 0" % one for one in nodes), len(lines), "\n".join(lines))})
    nodes, elements = squares(count := int(125 * scale))
    yield "deck", json.dumps({"abaqus": "*NODE\n%s\n*ELEMENT, TYPE=CPE4, ELSET=body\n%s\n*NSET, NSET=bottom, GENERATE\n1,%d,1\n"
                              "*NSET, NSET=top, GENERATE\n%d,%d,1\n" % (
                                  "\n".join("%d,%s,%s" % one for one in nodes),
                                  "\n".join("%d,%d,%d,%d,%d" % one for one in elements),
                                  count + 1, count * (count + 1) + 1, len(nodes))})


def accept(server):
    """The largest meshes that are sound, of jobs that are only queued; what they took at most, as `attack` says it."""
    worst, smallest = [0.0, 0.0, 0.0], SIZE
    check(server.call("POST", "/v1/queue/pause").status == 200, "pausing the queue")
    for name, mesh in sound_meshes():
        text = problem(mesh='"mesh":' + mesh, more='"supports":[{"boundary":"bottom","ux":0,"uy":0}],"contacts":[%s]' % FLAT)
        check(0.8 * SIZE < len(text) <= SIZE, "the body with a mesh from %s has %d bytes" % (name, len(text)))
        smallest = min(smallest, len(text))
        for path, status in (("/v1/problems/validate", 200), ("/v1/jobs", 202)):
            grown, cpu, took = 0, float("inf"), float("inf")
            for _ in range(20):
                answer, more, *times = send(server, path, text)
                check(answer.status == status and answer.json().get("valid") in (True, None), "a sound mesh: %r" % answer)
                grown, cpu, took = max(grown, more), min(cpu, times[0]), min(took, times[1])
                if path == "/v1/jobs":
                    job = answer.json()["id"]
                    check(server.call("POST", "/v1/jobs/%s/cancel" % job).status == 200, "canceling it")
                    check(server.call("DELETE", "/v1/jobs/" + job).status == 204, "deleting it")
                if cpu <= MOST_CPU_S and (MOST_S is None or took <= MOST_S):
                    break
            print("%-45s %3d  %5.1f MiB  × %5.1f  CPU %.2f s  %4.0f ms" % (
                "a sound mesh: " + name, answer.status, grown / MIB, grown / len(text), cpu, 1e3 * took), flush=True)
            check(max(0, grown - FLOOR) <= 10 * len(text), "%s: memory of %.1f times its size" % (name, grown / len(text)))
            check(cpu <= MOST_CPU_S, "%s: %.2f CPU s" % (name, cpu))
            worst = [max(pair) for pair in zip(worst, (grown / len(text), cpu, took))]
    check(server.call("POST", "/v1/queue/resume").status == 200, "resuming the queue")
    return smallest, worst


def send(server, path, text):
    """One body: the answer, bytes of growth, CPU seconds and seconds."""
    server.forget_peak()  # the highest mark of its memory begins anew
    memory, cpu, began = server.memory(), server.cpu_s(), time.monotonic()
    answer = server.call("POST", path, text.encode())
    took = time.monotonic() - began
    return answer, server.peak() - memory, server.cpu_s() - cpu, took


def attack(server, name, text):
    paths = ["/v1/jobs/batch"] if text.startswith('{"jobs"') else ["/v1/problems/validate", "/v1/jobs"]
    worst = [0.0, 0.0, 0.0]
    for path in paths[: None if SOAK else 1]:
        answer, grown, cpu, took = send(server, path, text)
        for _ in range(20):
            if cpu > MOST_CPU_S or MOST_S and took > MOST_S:
                time.sleep(0.2)  # another machine on the same hardware may be busy for a while
                answer, again, *times = send(server, path, text)
                grown, cpu, took = max(grown, again), min(cpu, times[0]), min(took, times[1])
        share = max(0, grown - FLOOR) / len(text)
        print("%-45s %3d  %5.1f MiB  × %5.1f  CPU %.2f s  %4.0f ms" % (
            name[:45], answer.status, grown / MIB, grown / len(text), cpu, 1e3 * took), flush=True)
        found = answer.json()
        refused = answer.status in (400, 413, 422) or (answer.status == 200 and not found["valid"])
        check(refused, "%s: %r" % (name, answer))
        check(found.get("errors") or found.get("violations") or found.get("detail"), "%s: no reason" % name)
        check(len(answer.body) < LONGEST_ANSWER, "%s: an answer of %d bytes" % (name, len(answer.body)))
        check(share <= 10, "%s: memory of %.1f times its %d bytes" % (name, share, len(text)))
        check(cpu <= MOST_CPU_S, "%s: %.2f CPU s" % (name, cpu))
        busy = os.getloadavg()[0] > (os.cpu_count() or 1)
        check(MOST_S is None or busy or took <= MOST_S, "%s: %.0f ms" % (name, 1e3 * took))
        # of a small body it says nothing: a request takes some memory of its own
        times = grown / len(text) if len(text) >= MIB / 2 else 0.0
        worst = [max(pair) for pair in zip(worst, (times, cpu, took))]
    return worst


def check_words(server):
    """Some of the messages, as a reader sees them."""
    def one(text, pointer):
        errors = server.call("POST", "/v1/problems/validate", text.encode()).json()["violations"]
        found = [e for e in errors if e["pointer"] == pointer]
        check(found, "no violation at %s: %r" % (pointer, errors))
        return found[0]

    short = inline(nodes="[0,0],[1,0],[1,1],[0,1]", elements="[0,1,2,3]")
    check("6 or 8" in one(short, "/problem/mesh/inline/elements/0")["expected"], "an element of four nodes")
    misspelt = problem(materials='"materials":[{"young_modulus":1,"poissons_ratio":0}]')
    check("`youngs_modulus`" in one(misspelt, "/problem/materials/0/young_modulus")["hint"], "a misspelt field")
    many = problem(mesh='"mesh":{"grid":{"x":[%s],"y":[0,1]}}' % ",".join(["[]"] * 1000))
    errors = server.call("POST", "/v1/problems/validate", many.encode()).json()["violations"]
    check(len(errors) == 100 and "more" in errors[-1]["hint"], "a thousand violations")


def four_at_once(server):
    """Bytes of growth for four of the same body at the same time."""
    text = around(problem(mesh='"mesh":{"grid":{"x":[§],"y":[0,1]}}'), "[]").encode()
    server.forget_peak()
    before = server.memory()
    with concurrent.futures.ThreadPoolExecutor(4) as clients:
        answers = list(clients.map(lambda _: server.call("POST", "/v1/jobs", text), range(4)))
    for answer in answers:
        check(answer.status == 422, "one of four: %r" % answer)
    grown = server.peak() - before
    check(grown <= 4 * 10 * len(text) + FLOOR, "four at once take %.0f MiB" % (grown / MIB))
    return grown


def main():
    worst, count, largest = [0.0, 0.0, 0.0], 0, 0
    with Attacked() as server, Bystander(server):
        check_words(server)
        for name, text in bodies():
            check(len(text) <= 16 * MIB, "%s has %d bytes" % (name, len(text)))
            found = attack(server, name, text)
            worst = [max(pair) for pair in zip(worst, found)]
            count, largest = count + 1, max(largest, len(text))
        grown = four_at_once(server)
        check(server.call("GET", "/readyz").status == 200, "the server is ready")
        peak = server.memory()
    # the memory that a job may take is not what is attacked here
    with Attacked("--memory-budget-bytes", str(8 << 30)) as server, Bystander(server):
        smallest, sound = accept(server)
    print("figure: %d hostile bodies of up to %.0f MiB refused in words; the large ones took at most %.1f times their size in memory, "
          "%.2f CPU s and %.0f ms; four at once of empty arrays took %.0f MiB; sound meshes of %.1f MiB and more at most %.1f times "
          "their size and %.2f CPU s; %.0f MiB held afterwards" % (
              count, largest / MIB, worst[0], worst[1], 1e3 * worst[2], grown / MIB, smallest / MIB, sound[0], sound[1], peak / MIB))


main()
