"""Assembles the stiffness matrix of the problem, has CHOLMOD factor it and solve one system, and prints one line of
JSON.

Usage: target/peers/bin/python cholmod_p1.py MESH

There is no contact here: this is the least that a program needs which solves one linear system of this matrix. The
times are those of analyse, factor and solve alone, by scikit-sparse on Debian's SuiteSparse and the BLAS that is
installed. The load is a uniform pressure, whose solution is known: `error` is the largest of the top's displacement,
relative.
"""

import itertools
import json
import resource
import sys

import numpy
import scipy.sparse
import sksparse.cholmod

import body
import problem

# CHOLMOD takes 1.76 CPU s with it at 2e5 degrees of freedom, 2.6 by nested dissection of its own, 3.1 by METIS.
ORDERING = "amd"


def triangle():
    """Gradients of the six functions at the points of an integration that is exact to the second degree, and its
    weights: arrays of points × 2 × nodes and of points."""
    gradients = []
    for x, y in ((1 / 6, 1 / 6), (2 / 3, 1 / 6), (1 / 6, 2 / 3)):
        at = 1 - x - y
        gradients.append([
            [1 - 4 * at, 4 * x - 1, 0, 4 * (at - x), 4 * y, -4 * y],
            [1 - 4 * at, 0, 4 * y - 1, -4 * x, 4 * x, 4 * (at - y)],
        ])
    return numpy.array(gradients), numpy.full(3, 1 / 6)


def quadrilateral():
    """The same of the eight functions, at 3 × 3 Gauss points."""
    points, weights = numpy.polynomial.legendre.leggauss(3)
    gradients = []
    for x, y in itertools.product(points, points):
        columns = []
        for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1), (0, -1), (1, 0), (0, 1), (-1, 0)):
            if a and b:  # a corner: (1 + ax)(1 + by)(ax + by − 1)/4
                columns.append((a * (1 + b * y) * (2 * a * x + b * y) / 4, b * (1 + a * x) * (2 * b * y + a * x) / 4))
            elif b:  # (1 − x²)(1 + by)/2
                columns.append((-x * (1 + b * y), b * (1 - x * x) / 2))
            else:  # (1 − y²)(1 + ax)/2
                columns.append((a * (1 - y * y) / 2, -y * (1 + a * x)))
        gradients.append(numpy.transpose(columns))
    return numpy.array(gradients), numpy.outer(weights, weights).ravel()


def element_stiffness(places):
    """The stiffness matrices of elements with nodes at these places (elements × nodes × 2), the two unknowns of a node
    side by side."""
    e, nu = problem.YOUNGS_MODULUS, problem.POISSONS_RATIO
    lame, shear = e * nu / ((1 + nu) * (1 - 2 * nu)), e / (2 * (1 + nu))
    count, nodes, _ = places.shape
    stiffness = numpy.zeros((count, nodes, 2, nodes, 2))
    for reference, weight in zip(*(triangle() if nodes == 6 else quadrilateral())):
        jacobian = reference @ places
        gradients = numpy.linalg.solve(jacobian, numpy.broadcast_to(reference, (count, 2, nodes)))
        volume = weight * numpy.linalg.det(jacobian)
        # λ ∂ᵢa ∂ⱼb + μ (∂ⱼa ∂ᵢb + δᵢⱼ ∇a·∇b)
        products = numpy.einsum("e,eia,ejb->eaibj", volume, gradients, gradients)
        stiffness += lame * products + shear * products.swapaxes(2, 4)
        both = shear * numpy.trace(products, axis1=2, axis2=4)
        for component in (0, 1):
            stiffness[:, :, component, :, component] += both
    return stiffness.reshape(count, 2 * nodes, 2 * nodes)


def assemble(made):
    """The stiffness matrix of the whole body without supports."""
    nodes, elements = numpy.array(made.nodes), numpy.array(made.elements, dtype=numpy.int32)
    dofs = (2 * elements[:, :, None] + numpy.arange(2, dtype=numpy.int32)).reshape(len(elements), -1)
    rows, columns = numpy.repeat(dofs, dofs.shape[1], axis=1), numpy.tile(dofs, (1, dofs.shape[1]))
    values = element_stiffness(nodes[elements])
    return scipy.sparse.csc_matrix((values.ravel(), (rows.ravel(), columns.ravel())), (nodes.size, nodes.size))


def pressed(made):
    """The nodal forces of a uniform pressure of 1 on the top: a sixth, two thirds and a sixth of each side."""
    load = numpy.zeros(2 * len(made.nodes))
    for _, _, side in made.top_sides():
        width = abs(made.nodes[side[2]][0] - made.nodes[side[0]][0])
        for node, share in zip(side, (1 / 6, 2 / 3, 1 / 6)):
            load[2 * node + 1] -= share * width
    return load


def main(mesh):
    made = body.read(mesh)
    matrix, load = assemble(made), pressed(made)
    bottom, top = 2 * numpy.array(made.bottom()) + 1, 2 * numpy.array(made.top()) + 1
    free = numpy.ones(len(load), dtype=bool)
    free[2 * numpy.array(made.left())] = False
    free[bottom] = False
    stiffness = matrix[free][:, free].tocsc()

    before = resource.getrusage(resource.RUSAGE_SELF)
    symbolic = sksparse.cholmod.analyze(stiffness, ordering_method=ORDERING, mode="supernodal")
    factor = symbolic.cholesky(stiffness)
    solution = factor.solve_A(load[free])
    after = resource.getrusage(resource.RUSAGE_SELF)

    displacements = numpy.zeros(len(load))
    displacements[free] = solution
    reaction = (matrix @ displacements)[bottom].sum()
    # uniaxial: the block is free to widen in the plane, and held across it
    exact = -made.height() * (1 - problem.POISSONS_RATIO**2) / problem.YOUNGS_MODULUS
    print(json.dumps({
        "program": "CHOLMOD",
        "dofs": len(load),
        "user_s": after.ru_utime - before.ru_utime,
        "system_s": after.ru_stime - before.ru_stime,
        "peak_bytes": after.ru_maxrss * 1024,
        "vertical_force": float(reaction),
        "error": float(abs(displacements[top] / exact - 1).max()),
    }))


main(sys.argv[1])
