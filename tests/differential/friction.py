"""The friction law of Oden and Pires: the averaging operator and the bound, from docs/formulation.md 1.3, 1.4, 2 and 3.4."""

import numpy as np

from elastic import edge_shape

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(60)
# ∫ exp(1/(x² − 1)) over −1 … 1, and 2π ∫ x exp(1/(x² − 1)) over 0 … 1
LINE, DISC = 0.443993816168079, 1 / 2.1435657758


def kernel(law, surface=False):
    """ω(x) for |x| < ρ, as a function of arrays."""
    radius, shape = law["nonlocal_radius"], law.get("kernel", "bump")
    peak_one = law.get("normalization") == "peak_one"
    if shape == "bump":
        constant = 1 / (DISC * radius**2) if surface else 1 / (LINE * radius)
        bell = lambda z: np.exp(1 / np.minimum(z * z - 1, -1e-300))
        # ω(0) = C e⁻¹
        constant = np.e if peak_one else constant
    else:
        constant = 2 / (np.pi * radius**2) if surface else 3 / (4 * radius)
        bell = lambda z: 1 - z * z
        constant = 1.0 if peak_one else constant
    return lambda x: np.where(np.abs(x) < radius, constant * bell(np.clip(x / radius, -1, 1)), 0.0)


def average(law, s, at, mirrored, positions=None):
    """The rows of W: S at the arc lengths `at` from nodal pressures at s (start, midside, end, midside …).

    `mirrored`: whether the pressure continues as an even function beyond the start and the end. `positions`: (r, z) of the nodes,
    where the average is over rings of the contact surface: beyond a mirror they are mirrored too.
    """
    radius = law["nonlocal_radius"]
    rows = np.zeros((len(at), len(s)))
    edges = [[2 * k, 2 * k + 2, 2 * k + 1] for k in range(len(s) // 2)]
    if radius <= 1e-9 * (s[-1] - s[0]):
        for row, place in zip(rows, at):
            edge, xi = locate(s, edges, place)
            row[edge] = edge_shape(xi)
        return rows
    omega, copies = kernel(law, positions is not None), images(s, radius, mirrored)
    conserving = law.get("normalization") == "conserving"
    for row, place in zip(rows, at):
        own_radius = None if positions is None else radius_at(s, edges, positions[:, 0], place)
        for edge in edges:
            for sign, shift in copies:
                radii = None if positions is None else moved(positions, s, sign, shift)
                ends = sorted(sign * s[edge[k]] + shift for k in (0, 1))
                for y, weight in pieces(*ends, place, radius, 8 if radii is not None else 1):
                    shape = np.array([edge_shape(xi) for xi in position(s, edge, sign * (y - shift))])
                    if radii is None:
                        weight = weight * omega(place - y)
                    else:
                        weight = weight * ring(omega, radius, own_radius, shape @ radii[edge])
                    if conserving:
                        weight = weight / on_boundary(omega, s, radius, copies, sign * (y - shift))
                    row[edge] += shape.T @ weight
    return rows


def images(s, radius, mirrored):
    """The chain and its mirror images, each as y -> sign · y + shift, as far as a kernel reaches."""
    start, end = s[0], s[-1]
    if mirrored == [True, True]:
        most = int(radius / (end - start)) + 2
        return [c for k in range(-most, most + 1) for c in ((1, 2 * k * (end - start)), (-1, 2 * start + 2 * k * (end - start)))]
    return [(1, 0.0)] + [(-1, 2 * x) for x, is_mirror in zip((start, end), mirrored) if is_mirror]


def moved(positions, s, sign, shift):
    """Distances from the axis of the nodes of an image of the chain, which is reflected at one end after the other."""

    def reflected(x, end, middle, other):
        if positions[end][0] == 0:
            return x * [-1, 1]
        along = 4 * positions[middle] - 3 * positions[end] - positions[other]
        along /= np.linalg.norm(along)
        return x - 2 * np.outer((x - positions[end]) @ along, along)

    at_start, at_end = (lambda x: reflected(x, 0, 1, 2)), (lambda x: reflected(x, -1, -2, -3))
    x = positions if sign > 0 else at_start(positions)
    periods = round((shift - (2 * s[0] if sign < 0 else 0)) / (2 * (s[-1] - s[0])))
    for _ in range(abs(periods)):
        x = at_end(at_start(x)) if periods > 0 else at_start(at_end(x))
    return x[:, 0]


def pieces(start, end, centre, radius, parts=1):
    """Points and weights on the part of an interval that a kernel covers, cut at its centre."""
    start, end = max(start, centre - radius), min(end, centre + radius)
    if end <= start:
        return
    cuts = sorted({*np.linspace(start, end, parts + 1), *([centre] if start < centre < end else [])})
    for low, high in zip(cuts, cuts[1:]):
        yield (low + high) / 2 + (high - low) / 2 * POINTS, WEIGHTS * (high - low) / 2


def radius_at(s, edges, radii, place):
    edge, xi = locate(s, edges, place)
    return edge_shape(xi) @ radii[edge]


def ring(omega, radius, at, r):
    """∫ ω(distance) r dθ round rings of the radii r in a plane, seen from a point of the radius `at`."""
    found = np.zeros_like(r)
    for k, own in enumerate(r):
        near = abs(own - at)
        if near >= radius or own <= 0:
            continue
        if own + at <= radius:
            reach = np.pi
        else:
            reach = np.arccos(np.clip((own**2 + at**2 - radius**2) / (2 * own * at), -1, 1))
        theta = reach * (POINTS + 1) / 2
        distance = np.sqrt(np.maximum(own**2 + at**2 - 2 * own * at * np.cos(theta), 0))
        found[k] = own * 2 * np.sum(WEIGHTS * reach / 2 * omega(distance))
    return found


def on_boundary(omega, s, radius, copies, centres):
    """The part of a kernel's integral that lies on the boundary and its images, by its centre."""
    found = np.zeros_like(centres)
    for k, centre in enumerate(centres):
        for sign, shift in copies:
            ends = sorted((sign * s[0] + shift, sign * s[-1] + shift))
            found[k] += sum(weight @ omega(z - centre) for z, weight in pieces(*ends, centre, radius))
    return found


def position(s, edge, y):
    """ξ of arc lengths on an edge, on which s is the parabola through its nodes."""
    start, end, mid = s[edge]
    a, b, c = (start + end) / 2 - mid, (end - start) / 2, mid - np.asarray(y)
    return np.clip(-2 * c / (b + np.sqrt(np.maximum(b * b - 4 * a * c, 0))), -1, 1)


def locate(s, edges, place):
    for edge in edges:
        if place <= s[edge[1]] or edge is edges[-1]:
            return edge, float(position(s, edge, place))


def bound(law, rows, pressure, s):
    """τ and dτ/dS at the friction points, of which `rows` gives the averages."""
    given = law.get("bound")
    if given is not None:
        if np.isscalar(given):
            return np.full(len(s), float(given)), np.zeros(len(s))
        return np.interp(s, given["s"], given["bound"], left=0.0, right=0.0), np.zeros(len(s))
    cohesion, cap, mu = law.get("cohesion", 0.0), law.get("shear_cap"), law["coefficient"]
    averaged = rows @ pressure
    least = 1e-9 * max(np.max(pressure, initial=0.0), 0.0) if cohesion else 0.0
    acts = averaged > least
    tau = np.where(acts, cohesion + mu * averaged, 0.0)
    slope = np.where(acts, mu, 0.0)
    if cap is not None:
        slope = np.where(tau > cap, 0.0, slope)
        tau = np.minimum(tau, cap)
    return tau, slope


def transition(law, e):
    """φ(|e|) sign e and its derivative, and the potential ψ."""
    length = law["elastic_slip"]
    x = e / length
    if law.get("transition") == "tanh":
        phi = np.tanh(x)
        potential = length * np.where(np.abs(x) > 20, np.abs(x) - np.log(2), np.log(np.cosh(np.clip(x, -20, 20))))
        return phi, (1 - phi**2) / length, potential
    inside = np.abs(x) < 1
    potential = length * np.where(inside, x * x / 2, np.abs(x) - 0.5)
    return np.clip(x, -1, 1), np.where(inside, 1 / length, 0.0), potential
