"""The problem that all programs of this folder solve: half of a block under a rigid cylinder.

          cylinder, R = 8, pushed down by 0.1
    y = 0   ┌────────────┐
            │            │   plane strain, E = 1000, ν = 0.3
    u_x = 0 │            │   nx by 2 nx squares of eight nodes,
            │            │   or a mesh of Gmsh
    y = −8  └────────────┘   u_y = 0, u_x free
           x = 0        x = 4

Without friction, or with μ = 0.3. The other programs have Coulomb's local law; Signorini's nonlocal law is
close to it here, since its radius (0.02) and its elastic slip (1e-4) are small beside the contact (0.68) and
the slip at its edge (some 1e-2). All directions follow the obstacle's normal, as they do in the other programs,
and the cylinder moves: where its surface is inclined, it slides along the body by a part of the indentation.

Standard library only: every script here runs in the Python of the program that it drives.
"""

import math
import pathlib

WIDTH, HEIGHT = 4.0, 8.0
YOUNGS_MODULUS, POISSONS_RATIO = 1000.0, 0.3
RADIUS, INDENTATION = 8.0, 0.1
COEFFICIENT, NONLOCAL_RADIUS, ELASTIC_SLIP = 0.3, 0.02, 1e-4
# elements along the top for about so many degrees of freedom
SIZES = {"2e4": 41, "2e5": 129, "1e6": 288}


def mesh(name):
    """The mesh by its name, as Signorini is given it: the file of a mesh of Gmsh ("….msh"), or a grid."""
    if name.endswith(".msh"):
        return {"gmsh": pathlib.Path(name).read_text(encoding="utf-8")}
    x, y = lines(name)
    return {"grid": {"x": x, "y": y}}


def lines(grid):
    """The lines x and y of a grid: of equal squares for a number of elements along the top ("41"); for "graded:k" equal
    up to 0.8 from the axis (elements of 0.02/k) and growing beyond, for limits; for "geometric:n", with n elements
    along the top, growing all the way, so that no element is like another."""
    if grid.startswith("geometric:"):
        n = int(grid.removeprefix("geometric:"))
        return _geometric(WIDTH, n, 10), [-y for y in reversed(_geometric(HEIGHT, 2 * n, 30))]
    if grid.startswith("graded:"):
        k = int(grid.removeprefix("graded:"))
        return _graded(40 * k, 20 * k, 0.8, WIDTH), [-y for y in reversed(_graded(40 * k, 30 * k, 0.8, HEIGHT))]
    n = int(SIZES.get(grid, grid))
    return _even(0.0, WIDTH, n), _even(-HEIGHT, 0.0, 2 * n)


def problem(mesh, coefficient, normal="obstacle"):
    """The problem for Signorini on a mesh as `mesh` makes it; frictionless if `coefficient` is 0."""
    contact = {
        "boundary": "top", "normal": normal, "indentation": INDENTATION,
        "obstacle": {"kind": "circle", "radius": RADIUS},
    }
    if coefficient:
        contact["friction"] = {
            "coefficient": coefficient, "nonlocal_radius": NONLOCAL_RADIUS, "elastic_slip": ELASTIC_SLIP,
        }
    return {
        "title": "Half of a block under a rigid cylinder",
        "analysis": {"kind": "plane_strain"},
        "mesh": mesh,
        "materials": [{"youngs_modulus": YOUNGS_MODULUS, "poissons_ratio": POISSONS_RATIO}],
        "supports": [{"boundary": "left", "ux": 0}, {"boundary": "bottom", "uy": 0}],
        "contacts": [contact],
    }


def hertz(half_force):
    """The peak pressure of a cylinder on a half-plane, of the force on half of it.

    The block is finite (the contact is a sixth of its width), so that what programs converge to is about
    0.14 % below it: a check on all of them, not the measure of their errors.
    """
    modulus = YOUNGS_MODULUS / (1 - POISSONS_RATIO**2)
    return math.sqrt(2 * half_force * modulus / (math.pi * RADIUS))


def _even(start, end, steps):
    return [start + (end - start) * i / steps for i in range(steps + 1)]


def _geometric(end, steps, ratio):
    """From 0 to `end` in steps that grow by one factor; the last is `ratio` times the first."""
    factor = ratio ** (1 / (steps - 1))
    return [end * (factor**i - 1) / (factor**steps - 1) for i in range(steps)] + [end]


def _graded(even, growing, core, end):
    """From 0 to `core` in equal steps, then to `end` in steps that grow by one factor."""
    step, low, high = core / even, 1.0 + 1e-9, 3.0
    for _ in range(200):
        factor = (low + high) / 2
        reached = core + step * factor * (factor**growing - 1) / (factor - 1)
        low, high = (factor, high) if reached < end else (low, factor)
    points = _even(0.0, core, even)
    for _ in range(growing):
        step *= factor
        points.append(points[-1] + step)
    return points[:-1] + [end]
