"""What is known of a sweep, and its table; common to `Sweep` and `AsyncSweep`, which add the verbs."""

from __future__ import annotations

import collections
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _html, figures
from . import pointer as pointers
from ._data import Array
from ._parts import kinds_at
from ._progress import sweep_line
from ._table import Table
from .problem import Problem

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure

TABLE_S = 5.0
"""Seconds for which a table is asked for that is only told about."""
SHOWN_COLUMNS = (
    "status",
    "verdict",
    "normal_force",
    "tangential_force",
    "stick_width",
    "peak_tangential_stress",
    "warnings",
)
"""What it shows besides the parameters."""


def about_table(problem: Mapping[str, Any]) -> dict[str, Any]:
    """What figures of a table say besides its numbers."""
    return {"units": problem.get("units") or {}, "analysis": (problem.get("analysis") or {}).get("kind", "")}


class SweepView:
    """A sweep as the service last described it."""

    def __init__(self, document: Mapping[str, Any]) -> None:
        self.document = document
        self._told = False  # what to look at in its table
        self._of_table: Mapping[str, Any] | None = None

    @property
    def id(self) -> str:
        return str(self.document["id"])

    @property
    def status(self) -> str:
        """`queued`, `running`; `succeeded` if at least one member has, `failed`, `canceled`."""
        return str(self.document["status"])

    @property
    def ended(self) -> bool:
        return self.document.get("finished_at") is not None

    @property
    def name(self) -> str | None:
        return self.document.get("name")

    @property
    def title(self) -> str:
        return self.name or self.id

    @property
    def labels(self) -> dict[str, str]:
        return dict(self.document.get("labels") or {})

    @property
    def paths(self) -> list[str]:
        """What members differ in: JSON Pointers into the problem."""
        return list(self.document["paths"])

    @property
    def counts(self) -> Mapping[str, int]:
        """Members by their status, and their `total`."""
        counts: Mapping[str, int] = self.document["members"]
        return counts

    def line(self) -> str:
        """The sweep on one line."""
        return sweep_line(self.title, self.document)

    def __len__(self) -> int:
        return self.counts["total"]

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.id}{f' {self.name!r}' if self.name else ''} {self.status}>"

    def __str__(self) -> str:
        return self.line()

    def _card(self, residuals: Sequence[float]) -> str:
        return self._repr_html_()

    def _repr_html_(self) -> str:
        return _html.sweep(self)


class SweepTable(Table):
    """A row for each member: its parameters and what came of it. NaN where a member is not solved, or has no
    solution (column `status`). `verdict` has the verdict on the first and the last member of each body, "" elsewhere.

    columns: arrays by name. A parameter is named by the last part of its pointer, `nonlocal_radius`, or by all of it
        where several end alike, or like the name of a result.
    parameters: the names of these columns
    title: the name of the sweep, which a figure has as its title
    about: units and kind of analysis of its problem, for the axes of figures
    """

    def __init__(self, found: Mapping[str, Array], title: str = "", about: Mapping[str, Any] | None = None) -> None:
        self.about: Mapping[str, Any] = about or {}
        pointed = [name for name in found if name.startswith("/")]
        short = pointers.short_names(pointed, [name for name in found if name not in pointed])
        super().__init__(
            {short.get(name, name): _typed(name, column) if name in short else column for name, column in found.items()}
        )
        self.parameters = [short[name] for name in pointed]
        self.title = title

    def __repr__(self) -> str:
        names = ["number", *self.parameters, *(name for name in SHOWN_COLUMNS if name in self.columns)]
        return "\n".join([*self._lines(names), *self.hinted_notes()])

    def plot(self, quantity: str, **options: Any) -> Figure:
        """Draws a column over the parameters; see `signorini.figures.sweep`."""
        return figures.sweep(self, quantity, **options)

    def notes(self) -> list[str]:
        """How many members have no solution, or one with warnings, and which; empty if all is well."""
        lines = []
        without = np.isin(self["status"], ["failed", "canceled"])
        if without.any():
            reasons = counted(self["reason"][without].tolist())
            lines.append(f"{without.sum()} of {len(self)} members have no solution: {reasons}")
        codes = [text.split() for text in self["warnings"].tolist()]
        warned = sum(1 for of_member in codes if of_member)
        if warned:
            words = counted(code for of_member in codes for code in of_member)
            lines.append(f"{warned} of {len(self)} members have warnings: {words}")
        verdicts = self["verdict"] if "verdict" in self.columns else np.array([""])
        known = np.flatnonzero(verdicts != "")
        below = [f"{verdicts[i]} (member {self['number'][i]})" for i in known if verdicts[i] != "good"]
        if below:
            rest = "" if len(known) == len(self) else f"; the other {len(self) - len(known)} members have no verdict"
            shown = ", ".join(below[:3]) + (", …" if len(below) > 3 else "")
            lines.append(f"verdict {shown}{rest}")
        return lines

    def hinted_notes(self) -> list[str]:
        """The same, and how to learn more."""
        notes = self.notes()
        return [*notes, "client.explain(code) tells what a code means"] if notes else []

    def to_pandas(self) -> pandas.DataFrame:
        """As a table of pandas (`pip install signorini[pandas]`), with the numbers of the members as its index."""
        return super().to_pandas().set_index("number")


def counted(words: Iterable[str]) -> str:
    """Words with how often they occur, the most frequent first."""
    return ", ".join(f"{word} {count}" for word, count in collections.Counter(words).most_common())


def _typed(pointer: str, column: Array) -> Array:
    """The values of a parameter as the problem has them: the service's table has no whole numbers, and no booleans."""
    kinds = kinds_at(Problem, pointer)
    if kinds == {int} and column.dtype.kind == "f" and bool(np.all(column == np.round(column))):
        return column.astype(np.int64)
    if kinds == {bool} and set(column.tolist()) <= {"true", "false"}:
        return np.asarray(column == "true")
    return column


class Member:
    """A member of a sweep: its parameters and what came of it.

    row: everything that the service says of it, such as `normal_force`, `stick_width`, `warnings`
    """

    def __init__(self, row: Mapping[str, Any]) -> None:
        self.row = row

    @property
    def number(self) -> int:
        return int(self.row["number"])

    @property
    def parameters(self) -> Mapping[str, Any]:
        """Its values by JSON Pointer."""
        found: Mapping[str, Any] = self.row["parameters"]
        return found

    @property
    def status(self) -> str:
        return str(self.row["status"])

    @property
    def reason(self) -> str | None:
        """Why it failed."""
        return self.row.get("reason")

    def __getitem__(self, name: str) -> Any:
        return self.row[name]

    def __contains__(self, name: object) -> bool:
        return name in self.row

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.number} {self.status} {dict(self.parameters)}>"
