"""Assembles the stiffness matrix of the problem, has CHOLMOD factor it and solve one system, and prints one line of
JSON.

Usage: target/peers/bin/python cholmod_p1.py MESH

There is no contact here: this is the least that a program needs which solves one linear system of this matrix. The
times are those of analyse, factor and solve alone, by scikit-sparse on Debian's SuiteSparse and the BLAS that is
installed. The load is a uniform pressure, whose solution is known: `error` is the largest of the top's displacement,
relative.
"""

import json
import resource
import sys

import numpy
import scipy.sparse
import sksparse.cholmod

import problem

# CHOLMOD takes 1.76 CPU s with it at 2e5 degrees of freedom, 2.6 by nested dissection of its own, 3.1 by METIS.
ORDERING = "amd"


def element_stiffness(width, height):
    """The stiffness matrix of a rectangle of eight nodes, 3 × 3 Gauss points; corners first, as CPE8."""
    e, nu = problem.YOUNGS_MODULUS, problem.POISSONS_RATIO
    lame = e * nu / ((1 + nu) * (1 - 2 * nu))
    shear = e / (2 * (1 + nu))
    hooke = numpy.array([[lame + 2 * shear, lame, 0], [lame, lame + 2 * shear, 0], [0, 0, shear]])
    places = [(-1, -1), (1, -1), (1, 1), (-1, 1), (0, -1), (1, 0), (0, 1), (-1, 0)]
    points, weights = numpy.polynomial.legendre.leggauss(3)
    stiffness = numpy.zeros((16, 16))
    for x, weight_x in zip(points, weights):
        for y, weight_y in zip(points, weights):
            strain = numpy.zeros((3, 16))
            for node, (a, b) in enumerate(places):
                if a and b:  # a corner: (1 + ax)(1 + by)(ax + by − 1)/4
                    dx = a * (1 + b * y) * (2 * a * x + b * y) / 4
                    dy = b * (1 + a * x) * (2 * b * y + a * x) / 4
                elif b:  # (1 − x²)(1 + by)/2
                    dx, dy = -x * (1 + b * y), b * (1 - x * x) / 2
                else:  # (1 − y²)(1 + ax)/2
                    dx, dy = a * (1 - y * y) / 2, -y * (1 + a * x)
                dx, dy = dx * 2 / width, dy * 2 / height
                strain[:, 2 * node:2 * node + 2] = [[dx, 0], [0, dy], [dy, dx]]
            stiffness += weight_x * weight_y * width * height / 4 * strain.T @ hooke @ strain
    return stiffness


def assemble(x, y):
    """The stiffness matrix of the whole grid without supports, and the number of the node at each place of the
    grid of corners and middles (−1: none)."""
    across, up = 2 * len(x) - 1, 2 * len(y) - 1
    exists = (numpy.arange(up)[:, None] % 2 == 0) | (numpy.arange(across)[None, :] % 2 == 0)
    number = numpy.where(exists, numpy.cumsum(exists).reshape(up, across) - 1, -1)
    places = ((0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1))
    cells = numpy.stack(
        [number[b:up - 2 + b:2, a:across - 2 + a:2] for a, b in places], axis=-1).reshape(-1, 8)
    dofs = (2 * cells[:, :, None] + numpy.arange(2)).reshape(-1, 16)
    wide, high = numpy.round(numpy.diff(x), 12), numpy.round(numpy.diff(y), 12)
    shapes = {}
    values = numpy.empty((len(cells), 16, 16))
    for row, height in enumerate(high):
        for column, width in enumerate(wide):
            if (width, height) not in shapes:
                shapes[width, height] = element_stiffness(width, height)
            values[row * len(wide) + column] = shapes[width, height]
    rows, columns = numpy.repeat(dofs, 16, axis=1), numpy.tile(dofs, (1, 16))
    size = 2 * int(exists.sum())
    return scipy.sparse.csc_matrix((values.ravel(), (rows.ravel(), columns.ravel())), (size, size)), number


def pressed(number, x):
    """The nodal forces of a uniform pressure of 1 on the top: a sixth, two thirds and a sixth of each edge."""
    load = numpy.zeros(2 * (number.max() + 1))
    for edge, width in enumerate(numpy.diff(x)):
        for place, share in enumerate((1 / 6, 2 / 3, 1 / 6)):
            load[2 * number[-1, 2 * edge + place] + 1] -= share * width
    return load


def main(mesh):
    x, y = problem.lines(mesh)
    matrix, number = assemble(x, y)
    load = pressed(number, x)
    free = numpy.ones(len(load), dtype=bool)
    left = number[:, 0]
    free[2 * left[left >= 0]] = False
    free[2 * number[0] + 1] = False
    stiffness = matrix[free][:, free].tocsc()

    before = resource.getrusage(resource.RUSAGE_SELF)
    symbolic = sksparse.cholmod.analyze(stiffness, ordering_method=ORDERING, mode="supernodal")
    factor = symbolic.cholesky(stiffness)
    solution = factor.solve_A(load[free])
    after = resource.getrusage(resource.RUSAGE_SELF)

    displacements = numpy.zeros(len(load))
    displacements[free] = solution
    reaction = (matrix @ displacements)[2 * number[0] + 1].sum()
    # uniaxial: the block is free to widen in the plane, and held across it
    exact = -problem.HEIGHT * (1 - problem.POISSONS_RATIO**2) / problem.YOUNGS_MODULUS
    print(json.dumps({
        "program": "CHOLMOD",
        "dofs": len(load),
        "user_s": after.ru_utime - before.ru_utime,
        "system_s": after.ru_stime - before.ru_stime,
        "peak_bytes": after.ru_maxrss * 1024,
        "vertical_force": float(reaction),
        "error": float(abs(displacements[2 * number[-1] + 1] / exact - 1).max()),
    }))


main(sys.argv[1])
