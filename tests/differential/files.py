"""An inline mesh as the text of a mesh file, with numbers that are neither dense nor in order."""


def numbered(draw, count):
    """Different numbers from 1, with gaps, in random order."""
    numbers, last = [], 0
    for _ in range(count):
        last += draw.integer(1, 3)
        numbers.append(last)
    return draw.shuffled(numbers)


def corners(element):
    return element[: len(element) // 2]


def used(inline, linear):
    """The nodes that a file lists: with elements of the first order, corners only."""
    if not linear:
        return range(len(inline["nodes"]))
    return sorted({n for e in inline["elements"] for n in corners(e)})


def gmsh_text(draw, inline, version, linear):
    """MSH 2.2 or 4.1, ASCII: boundaries as physical curves, groups as surfaces, node sets as points."""
    nodes = used(inline, linear)
    number = dict(zip(nodes, numbered(draw, len(nodes))))
    names = []  # (dimension, tag, name)
    for dimension, key in ((1, "boundaries"), (2, "groups"), (0, "node_sets")):
        names += [(dimension, len(names) + k + 1, name) for k, name in enumerate(inline[key])]
    tag = {(dimension, name): t for dimension, t, name in names}
    short = {16: 3, 9: 2, 8: 1} if linear else {16: 16, 9: 9, 8: 8}
    # entities: parts with the same names; (dimension, names) -> [(type, node numbers)]
    parts = {}

    def add(dimension, own, kind, members):
        members = [number[n] for n in members]
        parts.setdefault((dimension, tuple(own)), []).append((kind, members))

    groups_of = {}
    for name, list_ in inline["groups"].items():
        for e in list_:
            groups_of.setdefault(e, []).append(name)
    for i in draw.shuffled(range(len(inline["elements"]))):
        element = inline["elements"][i]
        own = groups_of.get(i, [])
        kind = 16 if len(element) == 8 else 9
        add(2, own, short[kind], corners(element) if linear else element)
    edges = {}
    for name, list_ in inline["boundaries"].items():
        for edge in list_:
            edges.setdefault(tuple(edge), []).append(name)
    for edge in draw.shuffled(list(edges)):
        flip = draw.chance(0.3)
        a, b, m = edge
        ends = [b, a] if flip else [a, b]
        add(1, edges[edge], short[8], ends if linear else [*ends, m])
    for name, list_ in inline["node_sets"].items():
        for node in list_:
            add(0, [name], 15, [node])
    lines = ["$MeshFormat", f"{version} 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names))]
    lines += [f'{dimension} {t} "{name}"' for dimension, t, name in names] + ["$EndPhysicalNames"]
    text = lambda n: f"{inline['nodes'][n][0]!r} {inline['nodes'][n][1]!r} 0"
    ordered = draw.shuffled(nodes)
    if version == "2.2":
        lines += ["$Nodes", str(len(nodes))] + [f"{number[n]} {text(n)}" for n in ordered] + ["$EndNodes"]
        rows = []
        for entity, ((dimension, own), members) in enumerate(parts.items(), 1):
            for kind, list_ in members:
                for physical in [tag[dimension, name] for name in own] or [0]:
                    rows.append(f"{kind} 2 {physical} {entity} " + " ".join(map(str, list_)))
        ids = numbered(draw, len(rows))
        lines += ["$Elements", str(len(rows))] + [f"{i} {row}" for i, row in zip(ids, rows)] + ["$EndElements"]
        return "\n".join(lines) + "\n"
    entities = {key: k for k, key in enumerate(parts, 1)}
    box = "-100 -100 0 100 100 0"
    counts = [sum(key[0] == dimension for key in parts) for dimension in (0, 1, 2)]
    lines += ["$Entities", " ".join(map(str, [*counts, 0]))]
    for dimension in (0, 1, 2):
        for (of, own), entity in entities.items():
            if of == dimension:
                tags = " ".join(str(tag[of, name]) for name in own)
                where = "0 0 0" if dimension == 0 else box
                lines.append(f"{entity} {where} {len(own)} {tags}".rstrip() + ("" if dimension == 0 else " 0"))
    lines += ["$EndEntities", "$Nodes", f"1 {len(nodes)} {min(number.values())} {max(number.values())}"]
    surface = next(entity for (of, _), entity in entities.items() if of == 2)
    lines += [f"2 {surface} 0 {len(nodes)}"] + [str(number[n]) for n in ordered] + [text(n) for n in ordered] + ["$EndNodes"]
    blocks = []
    for key, members in parts.items():
        for kind in sorted({kind for kind, _ in members}):
            blocks.append((key[0], entities[key], kind, [list_ for k, list_ in members if k == kind]))
    total = sum(len(block[3]) for block in blocks)
    ids = iter(numbered(draw, total))
    lines += ["$Elements", f"{len(blocks)} {total} 1 {3 * total}"]
    for dimension, entity, kind, members in blocks:
        lines.append(f"{dimension} {entity} {kind} {len(members)}")
        lines += [f"{next(ids)} " + " ".join(map(str, list_)) for list_ in members]
    return "\n".join(lines + ["$EndElements"]) + "\n"


def abaqus_text(draw, inline, kind, linear):
    """A deck: boundaries as surfaces of element faces, groups as element sets, node sets."""
    nodes = used(inline, linear)
    number = dict(zip(nodes, numbered(draw, len(nodes))))
    lines = ["*HEADING", "a mesh", "*NODE"]
    for n in draw.shuffled(nodes):
        x, y = inline["nodes"][n]
        lines.append(f"{number[n]}, {x!r}, {y!r}")
    family = {"plane_strain": "CPE", "plane_stress": "CPS", "axisymmetric": "CAX"}[kind]
    elements = inline["elements"]
    ids = numbered(draw, len(elements))
    for size in (8, 6):
        rows = [i for i, e in enumerate(elements) if len(e) == size]
        if rows:
            lines.append(f"*ELEMENT, TYPE={family}{size // 2 if linear else size}, ELSET=ALL{size}")
        for i in rows:
            own = corners(elements[i]) if linear else elements[i]
            lines.append(f"{ids[i]}, " + ", ".join(str(number[n]) for n in own))

    def listed(items):
        return [", ".join(map(str, items[k : k + 8])) for k in range(0, len(items), 8)]

    for name, list_ in inline["groups"].items():
        lines += [f"*ELSET, ELSET={name}"] + listed([ids[i] for i in draw.shuffled(list_)])
    faces = {}
    for i, element in enumerate(elements):
        n = len(element) // 2
        for k in range(n):
            faces[frozenset((element[k], element[(k + 1) % n]))] = f"{ids[i]}, S{k + 1}"
    for name, list_ in inline["boundaries"].items():
        lines.append(f"*SURFACE, NAME={name}, TYPE=ELEMENT")
        lines += [faces[frozenset(edge[:2])] for edge in draw.shuffled(list_)]
    for name, list_ in inline["node_sets"].items():
        lines += [f"*NSET, NSET={name}"] + listed([number[n] for n in list_])
    return "\n".join(lines) + "\n"
