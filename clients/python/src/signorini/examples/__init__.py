"""The five examples of the thesis (A.C. Bolt, University of Cape Town, 1983, chapter 4), a tool under loads, and two
pairs of elastic bodies.

Each function returns a new `Problem`, which may be changed. Parameters that are not given stay as in the thesis:
rho is the nonlocal radius ρ (length), mu the coefficient of friction μ, epsilon the elastic slip ε (length). `refine`
replaces the refinement of the mesh: how often every element is split into four, or a tolerance below 1 to which the
mesh is refined where errors come from; those of the thesis have 0.002.
"""

from __future__ import annotations

import json
from importlib import resources

from ..problem import AdaptiveRefine, Friction, Problem

__all__ = [
    "annular_punch",
    "cylinder",
    "cylinder_on_end",
    "press_fit",
    "rectangular_punch",
    "roller_on_block",
    "sheet",
    "tool_under_load",
]


def rectangular_punch(
    rho: float | None = None, mu: float | None = None, epsilon: float | None = None, refine: float | None = None
) -> Problem:
    """A rigid rectangular punch on an elastic block, plane strain, thesis 4.1(i)."""
    return _example("rectangular_punch", rho, mu, epsilon, refine)


def cylinder(
    rho: float | None = None, mu: float | None = None, epsilon: float | None = None, refine: float | None = None
) -> Problem:
    """A rigid cylinder on an elastic block, plane strain, thesis 4.1(ii)."""
    return _example("cylinder", rho, mu, epsilon, refine)


def annular_punch(
    rho: float | None = None, mu: float | None = None, epsilon: float | None = None, refine: float | None = None
) -> Problem:
    """A flat annular punch, axisymmetric, thesis 4.2(i)."""
    return _example("annular_punch", rho, mu, epsilon, refine)


def cylinder_on_end(
    rho: float | None = None, mu: float | None = None, epsilon: float | None = None, refine: float | None = None
) -> Problem:
    """A rigid cylinder on its end, axisymmetric, thesis 4.2(ii)."""
    return _example("cylinder_on_end", rho, mu, epsilon, refine)


def sheet(
    rho: float | None = None, mu: float | None = None, epsilon: float | None = None, refine: float | None = None
) -> Problem:
    """A thin sheet pulled through an opening, plane stress, thesis 4.3."""
    return _example("sheet", rho, mu, epsilon, refine)


def tool_under_load(
    rho: float | None = None, mu: float | None = None, epsilon: float | None = None, refine: float | None = None
) -> Problem:
    """A flat punch that is free to move and to turn, under an eccentric force and a pull, plane strain."""
    return _example("tool_under_load", rho, mu, epsilon, refine)


def roller_on_block(
    rho: float | None = None, mu: float | None = None, epsilon: float | None = None, refine: float | None = None
) -> Problem:
    """An elastic roller that a load presses on an elastic block, half of both, plane strain."""
    return _example("roller_on_block", rho, mu, epsilon, refine)


def press_fit(
    rho: float | None = None, mu: float | None = None, epsilon: float | None = None, refine: float | None = None
) -> Problem:
    """A hub that is shrunk on a shaft, half of both, axisymmetric."""
    return _example("press_fit", rho, mu, epsilon, refine)


def _example(name: str, rho: float | None, mu: float | None, epsilon: float | None, refine: float | None) -> Problem:
    text = resources.files(__name__).joinpath(name + ".json").read_text(encoding="utf-8")
    problem = Problem.from_dict(json.loads(text))
    friction = problem.contacts[0].friction
    assert isinstance(friction, Friction), "every example has friction"
    if rho is not None:
        friction.nonlocal_radius = rho
    if mu is not None:
        friction.coefficient = mu
    if epsilon is not None:
        friction.elastic_slip = epsilon
    if refine is not None:
        problem.mesh.refine = AdaptiveRefine(tolerance=refine) if 0 < refine < 1 else int(refine)
    # once more, since these values have not been checked
    return Problem.from_dict(problem.to_dict())
