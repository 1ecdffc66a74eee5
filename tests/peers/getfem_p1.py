"""Solves the problem with GetFEM and prints one line of JSON.

Usage: /usr/bin/python3 getfem_p1.py MESH COEFFICIENT

Debian's python3-getfem belongs to Debian's Python and NumPy. As GetFEM's documentation advises: quadratic
elements, contact as an integral over the boundary with a multiplier (linear there, which satisfies the inf-sup
condition and needs fewer iterations than a quadratic one), semi-smooth Newton, MUMPS. Without friction the symmetric
variant is taken, which MUMPS factors as such. The CPU time is that of the whole process.
"""

import json
import resource
import sys
import typing

import getfem
import numpy

import body
import problem

LEFT, BOTTOM, TOP = 1, 2, 3
UNSYMMETRIC, SYMMETRIC = 1, 2
# Supports by penalty keep the matrix as small as it is; its error is 1e-6 of the stiffness of one element.
PENALTY = 1e9


class Kind(typing.NamedTuple):
    """What GetFEM calls the shape of a kind of elements, with its corners in GetFEM's order; the displacements, linear
    and complete quadratic functions on it; and an integration that is exact to the fourth degree."""

    shape: str
    corners: list
    displacements: str
    linear: str
    quadratic: str
    integration: str


KINDS = {
    6: Kind("GT_PK(2,1)", [0, 1, 2], "FEM_PK(2,2)", "FEM_PK(2,1)", "FEM_PK(2,2)", "IM_TRIANGLE(4)"),
    8: Kind("GT_QK(2,1)", [0, 1, 3, 2], "FEM_Q2_INCOMPLETE(2)", "FEM_QK(2,1)", "FEM_QK(2,2)",
            "IM_GAUSS_PARALLELEPIPED(2,4)"),
}


def read(mesh_name):
    """The mesh with straight sides, as all of them are, and the kind of its elements."""
    made = body.read(mesh_name)
    kind = KINDS[len(made.elements[0])]
    corners = numpy.array(made.elements)[:, kind.corners]
    mesh = getfem.Mesh("empty", 2)
    mesh.add_convex(getfem.GeoTrans(kind.shape), numpy.array(made.nodes)[corners].transpose(2, 1, 0))
    return mesh, kind


def main(mesh_name, coefficient):
    mesh, kind = read(mesh_name)
    outer = mesh.outer_faces()
    normal = mesh.normal_of_faces(outer)
    mesh.set_region(LEFT, outer[:, normal[0] < -0.5])
    mesh.set_region(BOTTOM, outer[:, normal[1] < -0.5])
    mesh.set_region(TOP, outer[:, normal[1] > 0.5])

    displacements, multipliers = getfem.MeshFem(mesh, 2), getfem.MeshFem(mesh, 2 if coefficient else 1)
    displacements.set_fem(getfem.Fem(kind.displacements))
    multipliers.set_fem(getfem.Fem(kind.linear))
    distances = getfem.MeshFem(mesh, 1)
    distances.set_fem(getfem.Fem(kind.quadratic))
    gauss = getfem.MeshIm(mesh, getfem.Integ(kind.integration))

    model = getfem.Model("real")
    model.add_fem_variable("u", displacements)
    model.add_filtered_fem_variable("p", multipliers, TOP)
    model.add_initialized_data("E", problem.YOUNGS_MODULUS)
    model.add_initialized_data("nu", problem.POISSONS_RATIO)
    model.add_isotropic_linearized_elasticity_pstrain_brick(gauss, "u", "E", "nu")
    for region in (LEFT, BOTTOM):
        # the last argument says that the term is symmetric
        model.add_linear_term(gauss, "%g*(u.Normal)*(Test_u.Normal)" % PENALTY, region, True)

    at = distances.basic_dof_nodes()
    distance = numpy.hypot(at[0], at[1] - (problem.RADIUS - problem.INDENTATION)) - problem.RADIUS
    model.add_initialized_fem_data("obstacle", distances, distance)
    model.add_initialized_data("augmentation", problem.YOUNGS_MODULUS)
    if coefficient:
        model.add_initialized_data("mu", coefficient)
        model.add_initialized_data("one", 1.0)
        # what the cylinder has moved: slip is counted from there
        moved = model.interpolation("[0; -%r]" % problem.INDENTATION, displacements)
        model.add_initialized_fem_data("moved", displacements, moved)
        model.add_integral_contact_with_rigid_obstacle_brick(
            gauss, "u", "p", "obstacle", "augmentation", "mu", TOP, UNSYMMETRIC, "one", "moved")
    else:
        model.add_integral_contact_with_rigid_obstacle_brick(
            gauss, "u", "p", "obstacle", "augmentation", TOP, SYMMETRIC)
    iterations, converged = model.solve("max_res", 1e-8, "max_iter", 50, "lsolver", "mumps")
    if not converged:
        sys.exit("GetFEM did not converge within %d iterations" % iterations)

    # The multiplier is the stress along the obstacle's normal or, with friction, its components. At x = 0 it is
    # along y either way.
    stress = "p(%d)" if coefficient else "p*Grad_obstacle(%d)/Norm(Grad_obstacle)"
    across, down = (getfem.asm_generic(gauss, 0, stress % component, TOP, model) for component in (1, 2))
    on_axis = model.interpolation("p", numpy.array([[0.0], [0.0]]), mesh)
    used = resource.getrusage(resource.RUSAGE_SELF)
    print(json.dumps({
        "program": "GetFEM",
        "dofs": displacements.nbdof(),
        "iterations": iterations,
        "user_s": used.ru_utime,
        "system_s": used.ru_stime,
        "peak_bytes": used.ru_maxrss * 1024,
        "vertical_force": abs(down),
        "horizontal_force": abs(across),
        "peak_pressure": abs(float(numpy.ravel(on_axis)[-1])),
    }))


main(sys.argv[1], float(sys.argv[2]))
