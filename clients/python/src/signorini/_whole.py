"""What a whole problem can do besides its parts: ask a service about itself, and draw itself."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

from . import figures
from ._parts import Part

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ._data import Validation
    from .client import Client
    from .problem import Problem


class WholeProblem(Part):
    """The verbs of `Problem`."""

    def validate(self, client: Client) -> Validation:
        """Asks the service: every violation, the warnings, and the estimated cost; nothing is stored."""
        return client.validate(cast("Problem", self))

    def plot(self, **options: Any) -> Figure:
        """Draws mesh, supports, loads and obstacles; see `signorini.figures.problem`."""
        return figures.problem(cast("Problem", self), **options)
