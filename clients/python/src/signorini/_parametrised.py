"""A problem as a function: which of its numbers are given, and which numbers of its result are returned."""

from __future__ import annotations

import dataclasses
import json
import math
import pathlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast

from ._parts import Part, convert, fault, similar
from .errors import Violation
from .pointer import names, to_pointer
from .problem import Problem

TOTALS = ("normal_force", "tangential_force", "friction_force", "energy", "friction_work", "strain_energy")
FORCES = ("normal_force", "tangential_force", "friction_force")
WIDTHS = {"contact_width": "contact", "stick_width": "stick", "slip_width": "slip"}
MOTIONS = ("indentation", "tangential_displacement", "tilt", "moment")
"""What the summary of a contact has if its obstacle has a load or a tilt."""
PEAKS = ("peak_normal_stress", "peak_tangential_stress")
PLACES = ("value", "s", "x", "y")
SCALARS = (
    f"{', '.join(TOTALS)}; or contacts/BOUNDARY/ and {', '.join((*FORCES, *WIDTHS, *MOTIONS, *PEAKS))} "
    f"(of the peaks also /{', /'.join(PLACES)})"
)
"""All paths of scalars, in words."""

Quantity = Literal[
    "gap",
    "normal_displacement",
    "tangential_displacement",
    "normal_stress",
    "tangential_stress",
    "nonlocal_pressure",
    "friction_bound",
    "friction_ratio",
]
"""A column of a profile."""


@dataclass(kw_only=True, repr=False)
class Output(Part):
    """A vector of numbers of a result: either `scalars`, or `profile`, `quantity` and `points`.

    scalars: Paths into the summary of a result, such as `normal_force` or `contacts/top/peak_normal_stress`.
    profile: Name of a contact boundary.
    quantity: The column of its profile.
    points: How many evenly spaced points of it, ≥ 2; the ends of the boundary are among them.
    """

    scalars: list[str] | None = None
    profile: str | None = None
    quantity: Quantity | None = None
    points: int | None = None

    @property
    def size(self) -> int:
        """How many numbers it has."""
        return len(self.scalars) if self.scalars is not None else self.points or 0


@dataclass(kw_only=True, repr=False)
class Definition(Part):
    """A problem as a function of vectors with vectors as values.

    problem: The problem; it must be valid as it is.
    inputs: Vectors of JSON Pointers to numbers of the problem, those that are given.
    outputs: Vectors of numbers of the result.
    title: For people.
    """

    problem: Problem
    inputs: list[list[str]]
    outputs: list[Output]
    title: str | None = None


class Parametrised:
    """A definition whose pointers and paths lead somewhere.

    document: the problem as JSON, with its defaults
    inputs: vectors of JSON Pointers into it
    outputs: vectors of numbers of its result
    base: the numbers that the problem itself has at the inputs
    """

    def __init__(self, definition: Mapping[str, Any], found: list[Violation]) -> None:
        """Whatever is wrong with the definition is added to `found`; then this object is of no use."""
        read = cast(Definition, convert(definition, Definition, "", found))
        self.document: dict[str, Any] = {}
        self.inputs: list[list[str]] = []
        self.outputs: list[Output] = []
        self.title: str | None = None
        self.base: list[list[float]] = []
        if found:
            return
        self.document = read.problem.to_dict(defaults=True)
        self.inputs = [[to_pointer(pointer) for pointer in vector] for vector in read.inputs]
        self.outputs, self.title = read.outputs, read.title
        _not_empty("/inputs", [len(vector) for vector in self.inputs], found)
        _not_empty("/outputs", [1 if output.scalars is None else len(output.scalars) for output in self.outputs], found)
        seen: dict[str, str] = {}
        for n, vector in enumerate(self.inputs):
            self.base.append(
                [self._number(pointer, f"/inputs/{n}/{k}", seen, found) for k, pointer in enumerate(vector)]
            )
        boundaries = [str(contact["boundary"]) for contact in self.document.get("contacts", [])]
        for n, output in enumerate(self.outputs):
            _check_output(output, f"/outputs/{n}", boundaries, found)

    @property
    def input_sizes(self) -> list[int]:
        return [len(vector) for vector in self.inputs]

    @property
    def output_sizes(self) -> list[int]:
        return [output.size for output in self.outputs]

    @property
    def tolerance(self) -> float:
        """The residual that the problem is solved to."""
        return float(self.document["solver"]["tolerance"])

    def _number(self, pointer: str, at: str, seen: dict[str, str], found: list[Violation]) -> float:
        """The number that the problem has at a pointer."""
        if pointer in seen:
            fault(found, at, "duplicate", pointer, f"each number once; {seen[pointer]} is the same")
        seen.setdefault(pointer, at)
        value: Any = self.document
        for name in names(pointer):
            if isinstance(value, list) and name in map(str, range(len(value))):
                value = value[int(name)]
            elif isinstance(value, dict) and name in value:
                value = value[name]
            else:
                known = list(value) if isinstance(value, dict) else []
                hint = similar(name, known) or "Write the number in the problem: its size tells how large a change is."
                fault(found, at, "unknown_name", pointer, "a pointer to a number that the problem has", hint)
                return math.nan
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            hint = "Point to each number by itself, such as /supports/0/ux/1."
            got = value if isinstance(value, str) else json.dumps(value)
            fault(found, at, "wrong_type", f"{pointer}, where the problem has {got}", "a pointer to a number", hint)
            return math.nan
        return float(value)


def read_file(path: pathlib.Path) -> Mapping[str, Any]:
    """A definition from a JSON file; if its `problem` is a text, that names the file of the problem, from the folder of
    this one. Raises OSError and ValueError, which name the file."""
    definition = _json(path)
    if not isinstance(definition, dict):
        raise ValueError(f"{path}: expected an object with problem, inputs and outputs")
    if isinstance(definition.get("problem"), str):
        definition["problem"] = _json(path.parent / definition["problem"])
    return definition


def _json(path: pathlib.Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: {error}") from error


def _not_empty(at: str, sizes: Sequence[int], found: list[Violation]) -> None:
    if not sizes:
        fault(found, at, "too_few", "no vectors", "at least one vector")
    for n, size in enumerate(sizes):
        if size == 0:
            fault(found, f"{at}/{n}", "too_few", "an empty vector", "at least one number in each vector")


def _check_output(output: Output, at: str, boundaries: Sequence[str], found: list[Violation]) -> None:
    """What is wrong with a vector of outputs."""
    given = [field.name for field in dataclasses.fields(output) if getattr(output, field.name) is not None]
    if given not in (["scalars"], ["profile", "quantity", "points"]):
        wanted = "either scalars, or profile, quantity and points together"
        fault(found, at, "wrong_fields", ", ".join(given) or "nothing", wanted)
        return
    for k, path in enumerate(output.scalars or []):
        if (tokens := _tokens(path)) is None:
            fault(found, f"{at}/scalars/{k}", "unknown_name", path, SCALARS)
        elif len(tokens) > 1:
            _check_boundary(tokens[1], f"{at}/scalars/{k}", boundaries, found)
    if output.profile is not None:
        _check_boundary(output.profile, f"{at}/profile", boundaries, found)
        if output.points is not None and output.points < 2:
            fault(found, f"{at}/points", "out_of_range", output.points, "at least 2: both ends are among them")


def _check_boundary(name: str, at: str, boundaries: Sequence[str], found: list[Violation]) -> None:
    if name not in boundaries:
        wanted = f"a contact boundary of the problem: {', '.join(boundaries)}"
        fault(found, at, "unknown_boundary", name, wanted, similar(name, boundaries))


def _tokens(path: str) -> list[str] | None:
    """The names along a path of a scalar, a peak's with its `value`; None if there is no such path."""
    tokens = names("/" + path)
    if len(tokens) == 1 and tokens[0] in TOTALS:
        return tokens
    if tokens[0] != "contacts" or len(tokens) < 3:
        return None
    _, _, quantity, *rest = tokens
    if quantity in PEAKS:
        rest = rest or ["value"]
        return [*tokens[:3], *rest] if len(rest) == 1 and rest[0] in PLACES else None
    return tokens if not rest and quantity in (*FORCES, *WIDTHS, *MOTIONS) else None


def scalar(summary: Mapping[str, Any], path: str) -> float | None:
    """The number of a summary at a path that was checked; None if the result has none, as a peak without contact.

    A width is the length of all parts of a contact that touch, stick or slip.
    """
    tokens = _tokens(path) or []
    value: Any = summary
    for name in tokens:
        if name in WIDTHS:
            return float(sum(end - start for start, end in value[WIDTHS[name]]))
        value = value.get(name)
        if value is None:
            return None
    return float(value)
