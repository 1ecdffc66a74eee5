"""Rigid obstacles as the schema describes them: the distance along the body's normal, and its slope along t."""

import numpy as np
from scipy.interpolate import CubicSpline


def profile(obstacle, c, rounding=1e-9):
    """Distance and slope over the coordinate c of the kinds that have one; None where there is no obstacle. `rounding`: how near a
    place is to a kink to be at it."""
    kind, x = obstacle["kind"], c - obstacle.get("center", 0.0)
    if kind == "flat":
        return 0.0, 0.0
    if kind == "circle":
        radius = obstacle["radius"]
        if abs(x) >= radius:
            return None
        depth = np.sqrt(radius * radius - x * x)
        return radius - depth, x / depth
    if kind == "parabola":
        return x * x / (2 * obstacle["radius"]), x / obstacle["radius"]
    if kind in ("wedge", "cone"):
        rise = np.tan(np.radians(obstacle["angle"]))
        # at the kink, if only up to rounding, the mean of both sides
        return abs(x) * rise, (np.sign(x) if abs(x) > rounding else 0.0) * rise
    if kind == "tilted":
        return obstacle["slope"] * x, obstacle["slope"]
    if kind == "power":
        a, m = obstacle["coefficient"], obstacle["exponent"]
        slope = np.sign(x) * a * m * abs(x) ** (m - 1) if x else 0.0
        return a * abs(x) ** m, slope
    if kind == "rounded_flat":
        radius, beyond = obstacle["radius"], max(abs(x) - obstacle["half_width"], 0.0)
        if beyond >= radius:
            return None
        depth = np.sqrt(radius * radius - beyond * beyond)
        return radius - depth, np.sign(x) * beyond / depth
    assert kind == "table", kind
    xs, gaps = np.array(obstacle["x"], float), np.array(obstacle["gap"], float)
    room = 1e-9 * (xs[-1] - xs[0])
    if c < xs[0] - room or c > xs[-1] + room:
        return None
    c = min(max(c, xs[0]), xs[-1])
    if obstacle.get("smoothing"):
        # the generator smooths exact parabolas only, which smoothing leaves as they are
        curve = np.poly1d(np.polyfit(xs, gaps, 2))
        return curve(c), curve.deriv()(c)
    if obstacle.get("interpolation") == "cubic":
        curve = CubicSpline(xs, gaps)
        return float(curve(c)), float(curve(c, 1))
    slopes = np.diff(gaps) / np.diff(xs)
    # at a kink the mean of both sides
    before = slopes[max(np.searchsorted(xs, c - room) - 1, 0)]
    after = slopes[min(np.searchsorted(xs, c + room, side="right") - 1, len(slopes) - 1)]
    return float(np.interp(c, xs, gaps)), 0.5 * (before + after)


def turned(n):
    """t: n turned clockwise."""
    return np.array([n[1], -n[0]])


def in_space(obstacle, position, n):
    """Distance along n and slope along t of a line or polyline; None where the normal meets nothing."""
    t = turned(n)
    if obstacle["kind"] == "line":
        angle = np.radians(obstacle["angle"])
        way, to = np.array([np.cos(angle), np.sin(angle)]), np.array(obstacle["point"], float) - position
        # the place on the line with no part along t
        place = to - way * (to @ t) / (way @ t)
        return place @ n, (way @ n) / (way @ t)
    points = np.array(obstacle["points"], float)
    along = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    if obstacle.get("interpolation") == "cubic":
        curve = CubicSpline(along, points - position)
        found = []
        across = CubicSpline(along, (points - position) @ t)
        for root in across.roots(extrapolate=False):
            if along[0] <= root <= along[-1]:
                way = curve(root, 1)
                found.append((curve(root) @ n, (way @ n) / (way @ t)))
    else:
        found, room = [], 1e-9 * along[-1]
        for a, b in zip(points[:-1] - position, points[1:] - position):
            way = b - a
            if abs(way @ t) < 1e-12 * np.hypot(*way):
                continue
            part = -(a @ t) / (way @ t)
            if -room <= part * np.hypot(*way) <= np.hypot(*way) + room:
                found.append(((a + part * way) @ n, (way @ n) / (way @ t)))
    if not found:
        return None
    # the nearest piece; two that meet at a point give the mean of their slopes
    nearest = min(found, key=lambda hit: abs(hit[0]))
    same = [hit[1] for hit in found if abs(hit[0] - nearest[0]) <= 1e-9 * along[-1]]
    return nearest[0], np.mean(same)


def seen(obstacle, position, n, c, rounding):
    """Distance along n and slope along t as seen from a place with the coordinate c; None where nothing is seen."""
    if obstacle["kind"] in ("line", "polyline"):
        return in_space(obstacle, position, n)
    found = profile(obstacle, c, rounding)
    if found is None:
        return None
    per_length = 1.0 if obstacle.get("along") == "arc_length" else turned(n)[0]
    return found[0], found[1] * per_length
