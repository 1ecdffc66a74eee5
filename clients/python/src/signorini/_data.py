"""Numbers, arrays and answers of the service, as plain data: nothing here talks to it."""

from __future__ import annotations

import io
import math
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from . import figures
from ._extras import load
from .errors import Violation

if TYPE_CHECKING:
    import pandas
    import pyarrow
    import pyvista
    from matplotlib.figure import Figure

Array = NDArray[Any]


class Number(float):
    """A number with its error: how far, by estimate, the mesh may have put it off.

    It counts as the plain number wherever one is needed. `error` is None where nothing is known of it, and `why`
    says why: `no_limit` for a peak that grows with every finer mesh.
    """

    error: float | None
    why: str

    def __new__(cls, value: float, error: float | None = None, why: str = "") -> Number:
        number = super().__new__(cls, value)
        number.error = error
        number.why = why
        return number

    def __getnewargs__(self) -> tuple[float, float | None, str]:  # type: ignore[override]
        return (float(self), self.error, self.why)

    @property
    def value(self) -> float:
        return float(self)

    @property
    def relative(self) -> float | None:
        """The error by the value; None where one of them is unknown or the value is 0."""
        return None if self.error is None or not self else abs(self.error / float(self))

    def __str__(self) -> str:
        value = float(self) + 0.0  # of −0 it makes 0
        if self.error is None:
            why = {"no_limit": "no limit", "": "error unknown"}.get(self.why, self.why.replace("_", " "))
            return f"{value:.5g} ({why})"
        if self.error == 0 or not math.isfinite(self.error):
            return f"{value:.6g} ± {self.error:g}"
        # as many decimals as the error has up to its second digit, one where it begins with 3 or more
        digits = 1 - math.floor(math.log10(self.error)) - (self.error / 10 ** math.floor(math.log10(self.error)) >= 3)
        if -6 < digits < 12 and abs(value) < 1e7:
            decimals = max(digits, 0)
            return f"{round(value, decimals) + 0.0:.{decimals}f} ± {self.error:.{decimals}f}"
        return f"{value:.6g} ± {self.error:.1e}"

    __repr__ = __str__

    def __format__(self, spec: str) -> str:
        if not spec:
            return str(self)
        error = "?" if self.error is None else format(self.error, spec)
        return f"{format(float(self) + 0.0, spec)} ± {error}"


@dataclass(frozen=True)
class Warning:
    """What to consider before relying on a result."""

    code: str
    """Stable name, which `signorini explain CODE` explains."""
    message: str
    pointer: str = ""
    """JSON Pointer into the problem."""
    severity: str = "warning"
    """`serious`: the result is not that of the intended problem; `warning`: some numbers are not, or may not be;
    `note`: a property of the problem."""

    @classmethod
    def from_json(cls, document: Mapping[str, Any]) -> Warning:
        pointer = str(document.get("pointer") or "")
        # services of earlier versions tell no severity
        severity = str(document.get("severity") or "warning")
        return cls(str(document["code"]), str(document["message"]), pointer.removeprefix("/problem"), severity)

    @property
    def kind(self) -> str:
        """What it is called before its text: `serious warning`, `warning` or `note`."""
        return "serious warning" if self.severity == "serious" else self.severity

    def __str__(self) -> str:
        return f"{self.code}: {self.message}"


@dataclass(frozen=True)
class Validation:
    """What the service thinks of a problem."""

    valid: bool
    violations: list[Violation]
    warnings: list[Warning]
    estimate: Mapping[str, float] | None
    """`dofs`; `memory_bytes`; `run_s`, seconds on one thread. None where the mesh cannot be read."""
    input_hash: str | None
    description: str | None
    """The problem in words: what is asked of the solver, as the service has read it. None where it cannot be read."""

    @classmethod
    def from_json(cls, document: Mapping[str, Any]) -> Validation:
        return cls(
            bool(document["valid"]),
            [Violation.from_json(v) for v in document["violations"]],
            [Warning.from_json(w) for w in document["warnings"]],
            document.get("estimate"),
            document.get("input_hash"),
            document.get("description"),
        )

    def __bool__(self) -> bool:
        return self.valid

    def __str__(self) -> str:
        lines = ["valid" if self.valid else f"invalid: {len(self.violations)} violation(s)"]
        lines += [f"  {n}. {violation}" for n, violation in enumerate(self.violations, 1)]
        lines += [f"  {warning.kind}: {warning}" for warning in self.warnings]
        if self.estimate:
            mebibytes = self.estimate["memory_bytes"] / 2**20
            lines.append(
                f"  about {self.estimate['dofs']:,.0f} unknowns, at most {self.estimate['run_s']:.2g} s on one thread "
                f"and {mebibytes:.0f} MiB"
            )
        return "\n".join(lines)


@dataclass(frozen=True)
class Event:
    """One event of a job or sweep. `seq` counts from 1 without gaps, also across restarts of the service."""

    seq: int
    type: str
    """Of a job: status, stage, mesh, iteration, warning, done; of a sweep: member, done."""
    data: Mapping[str, Any]
    """Everything that the service says of it, `seq` and `type` included."""

    @property
    def attempt(self) -> int:
        return int(self.data.get("attempt", 0))

    def __getitem__(self, name: str) -> Any:
        return self.data[name]

    def __contains__(self, name: object) -> bool:
        return name in self.data


@dataclass(frozen=True)
class StoredMesh:
    """A mesh that the service keeps, without its nodes and elements."""

    hash: str
    """`sha256:…` of the file."""
    dofs: int
    nodes: int
    boundaries: Mapping[str, Any]
    """Of each named boundary its number of `edges` and its `length`."""
    groups: Mapping[str, int]
    node_sets: Mapping[str, int]
    warnings: list[Warning]
    """Changes that were made when it was read."""
    document: Mapping[str, Any] = field(repr=False)
    """All that the service says of it: quality, extent, format, …"""

    @classmethod
    def from_json(cls, document: Mapping[str, Any]) -> StoredMesh:
        names = ("hash", "dofs", "nodes", "boundaries", "groups", "node_sets")
        warnings = [Warning.from_json(w) for w in document["warnings"]]
        return cls(**{name: document[name] for name in names}, warnings=warnings, document=document)


@dataclass(frozen=True, repr=False)
class Columns:
    """Columns of equal length."""

    def columns(self) -> dict[str, Array]:
        """The columns by name."""
        named = {f.name: getattr(self, f.name) for f in fields(self)}
        return {name: column for name, column in named.items() if isinstance(column, np.ndarray)}

    def to_pandas(self) -> pandas.DataFrame:
        """As a table of pandas (`pip install signorini[pandas]`)."""
        table: pandas.DataFrame = load("pandas", "pandas").DataFrame(self.columns())
        return table

    def to_arrow(self) -> pyarrow.Table:
        """As a table of Arrow (`pip install signorini[arrow]`), for Parquet, polars, DuckDB."""
        table: pyarrow.Table = load("pyarrow", "arrow").table(self.columns())
        return table

    def __len__(self) -> int:
        return len(next(iter(self.columns().values())))

    def __repr__(self) -> str:
        columns = ", ".join(f".{name}" for name in self.columns())
        return f"<{type(self).__name__}{self._which()}: {len(self)} rows; {columns}; .to_pandas(), .plot()>"

    def _which(self) -> str:
        return ", partial" if getattr(self, "partial", False) else ""


@dataclass(frozen=True, repr=False)
class Profile(Columns):
    """What lies along a contact boundary, sorted by arc length. Stresses are those on the body.

    Nodes, the points where friction acts, and the peaks each have a row. `normal_stress` is negative in compression,
    `tangential_stress` positive along t, the outward normal turned clockwise.
    """

    s: Array
    """Arc length from the start of the named boundary."""
    x: Array
    y: Array
    gap: Array
    """Before deformation: profile of the obstacle − indentation."""
    normal_displacement: Array
    tangential_displacement: Array
    normal_stress: Array
    tangential_stress: Array
    nonlocal_pressure: Array
    """S_ρ(p), the pressure averaged over the nonlocal radius."""
    friction_bound: Array
    """τ = μ max(S_ρ, 0)."""
    friction_ratio: Array
    """φ, from 0 (no slip) to 1 (the bound is reached)."""
    state: Array
    """`open`, `stick` or `slip`."""
    boundary: str = ""
    about: Mapping[str, Any] = field(default_factory=dict, repr=False)
    """What a figure says besides: title, parameters, verdict, units."""
    partial: bool = False
    """Whether this is the last state of an iteration that did not end."""

    def plot(self, **options: Any) -> Figure:
        """Draws the stresses along the contact; see `signorini.figures.profile`."""
        return figures.profile(self, **options)

    def _which(self) -> str:
        return f" of {self.boundary!r}" + super()._which()


@dataclass(frozen=True, repr=False)
class History(Columns):
    """A row for each iteration of the last attempt. Residuals are dimensionless; NaN is a number that is absent."""

    k: Array
    stage: Array
    step: Array
    increment: Array
    residual: Array
    friction_residual: Array
    r_f: Array
    """Relative change of the nodal normal stress, thesis 3.5."""
    tolerance: Array
    contact_active: Array
    contact_entered: Array
    contact_left: Array
    friction_slip: Array
    friction_stick: Array
    force_normal: Array
    force_tangential: Array
    contraction: Array
    inner: Array
    wall_s: Array
    motion_indentation: Array | None = None
    """Motion of the obstacle that loads move, along the direction of its indentation (length); `None` without one."""
    motion_tangential_displacement: Array | None = None
    motion_tilt: Array | None = None
    """Counter-clockwise (radians)."""
    about: Mapping[str, Any] = field(default_factory=dict, repr=False)
    partial: bool = False

    def plot(self, **options: Any) -> Figure:
        """Draws the convergence; see `signorini.figures.convergence`."""
        return figures.convergence(self, **options)


@dataclass(frozen=True, repr=False)
class Fields:
    """Displacements and stresses at the nodes, and the mesh.

    Six components of a stress are xx, yy, zz, xy, yz, xz; in axisymmetry x is r and zz the hoop stress.
    """

    points: Array
    """Positions before deformation, a row (x, y, 0) for each node."""
    displacement: Array
    stress: Array
    principal_stress: Array
    von_mises: Array
    contact_state: Array
    """−1 off the contact boundaries, 0 open, 1 stick, 2 slip."""
    element_error: Array
    """Of each element the energy norm of its estimated error."""
    quads: Array
    """Eight node numbers for each quadrilateral: corners, then midsides."""
    quad_numbers: Array
    """The number of each quadrilateral among all elements."""
    triangles: Array
    triangle_numbers: Array
    gauss_points: Array
    gauss_element: Array
    gauss_stress: Array
    profiles: Mapping[str, Profile] = field(default_factory=dict, repr=False)
    """The contacts with an obstacle at their nodes, by the names of their boundaries; for figures."""
    about: Mapping[str, Any] = field(default_factory=dict, repr=False)
    partial: bool = False

    def __repr__(self) -> str:
        elements = len(self.quads) + len(self.triangles)
        partial = ", partial" if self.partial else ""
        return (
            f"<Fields{partial}: {len(self.points)} nodes, {elements} elements; .points, .displacement, .stress, "
            ".principal_stress, .von_mises, …; .to_pyvista(), .plot()>"
        )

    def to_pyvista(self) -> pyvista.UnstructuredGrid:
        """As an unstructured grid of PyVista (`pip install signorini[pyvista]`)."""
        vista = load("pyvista", "pyvista")
        blocks = [(23, self.quads), (22, self.triangles)]  # VTK's quadratic quadrilateral and triangle
        cells = [np.column_stack([np.full(len(c), c.shape[1]), c]).ravel() for _, c in blocks if len(c)]
        types = np.concatenate([np.full(len(c), kind, np.uint8) for kind, c in blocks])
        grid: pyvista.UnstructuredGrid = vista.UnstructuredGrid(
            np.concatenate(cells).astype(np.int64), types, self.points
        )
        for name in ("displacement", "stress", "principal_stress", "von_mises", "contact_state"):
            grid.point_data[name] = getattr(self, name)
        numbers = np.concatenate([self.quad_numbers, self.triangle_numbers]).astype(int)
        grid.cell_data["element_error"] = self.element_error[numbers]
        return grid

    def plot(self, **options: Any) -> Figure:
        """Draws the deformed body; see `signorini.figures.deformed`."""
        return figures.deformed(self, **options)


ATTEMPTS = 20
"""NumPy reads headers with Python's parser, which in some versions fails when several threads use it (gh-106905)."""


def arrays(content: bytes) -> dict[str, Array]:
    """The arrays of an `npz` file. No pickles: whatever a server sends, nothing of it is run. Raises ValueError or
    EOFError if it is not whole."""
    for left in reversed(range(ATTEMPTS)):
        try:
            with np.load(io.BytesIO(content), allow_pickle=False) as file:
                return {name: file[name] for name in file.files}
        except (zipfile.BadZipFile, zlib.error, AttributeError) as error:
            raise ValueError(f"no npz file: {error}") from error
        except SystemError:
            if not left:
                raise
    raise AssertionError("the last attempt returns or raises")


def known(cls: type, found: Mapping[str, Array]) -> dict[str, Any]:
    """What of the arrays the class has a field for; a newer service may send more."""
    return {f.name: found[f.name] for f in fields(cls) if f.name in found}


@dataclass(frozen=True)
class Peak:
    """Where a stress is largest along a contact."""

    value: Number
    s: float
    x: float
    y: float


@dataclass(frozen=True)
class ContactResult:
    """Forces and extents of one contact; forces are those on the body."""

    normal_force: Number
    """∫p ≥ 0."""
    tangential_force: Number
    """∫σ_t, positive along t."""
    friction_force: Number
    """∫|σ_t|."""
    contact: list[tuple[float, float]]
    """Intervals of arc length."""
    stick: list[tuple[float, float]]
    slip: list[tuple[float, float]]
    peak_normal_stress: Peak | None
    peak_tangential_stress: Peak | None


class Summary:
    """What the service says of a solution; common to `Result` and `AsyncResult`.

    Forces are those on the body, of the modelled part: a half model gives half, axisymmetric totals include 2π, plane
    stress includes the thickness.
    """

    def __init__(self, document: Mapping[str, Any], partial: bool) -> None:
        self.summary: Mapping[str, Any] = document["summary"]
        self.steps: Sequence[Mapping[str, Any]] = document.get("steps") or []
        self.partial = partial
        accuracy = self.summary.get("accuracy") or {}
        self._errors = {
            (q["quantity"], q.get("contact")): (q.get("error"), "" if q["method"] == "unknown" else q["method"])
            for q in accuracy.get("quantities", [])
        }

    @property
    def verdict(self) -> str:
        """`good`, `fair` or `poor`: how far the numbers can be trusted; empty where the service does not say."""
        return str((self.summary.get("accuracy") or {}).get("verdict", ""))

    @property
    def reasons(self) -> list[str]:
        """Why the verdict is what it is, the most serious reason first."""
        return list((self.summary.get("accuracy") or {}).get("reasons", []))

    @property
    def converged(self) -> bool:
        return bool(self.summary["converged"])

    @property
    def outcome(self) -> str:
        return str(self.summary["outcome"])

    @property
    def warnings(self) -> list[Warning]:
        return [Warning.from_json(w) for w in self.summary.get("warnings", [])]

    @property
    def contacts(self) -> dict[str, ContactResult]:
        """Each contact by the name of its boundary."""
        return {name: self._contact(name, document) for name, document in self.summary["contacts"].items()}

    @property
    def normal_force(self) -> Number:
        """∫p ≥ 0 over all contacts (force)."""
        return self._total("normal_force")

    @property
    def tangential_force(self) -> Number:
        """∫σ_t over all contacts, positive along t (force)."""
        return self._total("tangential_force")

    @property
    def friction_force(self) -> Number:
        """∫|σ_t| over all contacts (force)."""
        return self._total("friction_force")

    @property
    def peak_normal_stress(self) -> Number | None:
        """The largest pressure of all contacts, as a stress (≤ 0); None without contact."""
        return self._largest("peak_normal_stress")

    @property
    def peak_tangential_stress(self) -> Number | None:
        """The largest |σ_t| of all contacts, with its sign; None without friction."""
        return self._largest("peak_tangential_stress")

    def _number(self, value: float, quantity: str, contact: str) -> Number:
        return Number(value, *self._errors.get((quantity, contact), (None, "")))

    def _total(self, quantity: str) -> Number:
        parts = [cast(Number, getattr(contact, quantity)) for contact in self.contacts.values()]
        errors = [part.error for part in parts]
        known_errors = [error for error in errors if error is not None]
        # the errors of several contacts may add up
        error = sum(known_errors) if parts and len(known_errors) == len(parts) else None
        return Number(self.summary[quantity], error, parts[0].why if len(parts) == 1 else "")

    def _largest(self, quantity: str) -> Number | None:
        peaks = [getattr(contact, quantity) for contact in self.contacts.values()]
        values = [cast(Number, peak.value) for peak in peaks if peak is not None]
        return max(values, key=abs, default=None)

    def _contact(self, name: str, document: Mapping[str, Any]) -> ContactResult:
        def number(quantity: str) -> Number:
            return self._number(document[quantity], quantity, name)

        def peak(quantity: str) -> Peak | None:
            found = document.get(quantity)
            if found is None:
                return None
            return Peak(self._number(found["value"], quantity, name), found["s"], found["x"], found["y"])

        def extent(part: str) -> list[tuple[float, float]]:
            return [(start, end) for start, end in document[part]]

        return ContactResult(
            number("normal_force"),
            number("tangential_force"),
            number("friction_force"),
            extent("contact"),
            extent("stick"),
            extent("slip"),
            peak("peak_normal_stress"),
            peak("peak_tangential_stress"),
        )

    def _boundary(self, boundary: str | None) -> str:
        names = list(self.summary["contacts"])
        if boundary is None and len(names) == 1:
            return str(names[0])
        if boundary in names:
            return str(boundary)
        raise ValueError(f"which contact: boundary=… is one of {names}" if names else "the problem has no contacts")

    def lines(self) -> Iterator[tuple[str, str]]:
        """The summary in words, a name and a value each."""
        if self.outcome == "unfinished":
            yield "state", "PARTIAL: load steps are missing; these are the numbers after the last one solved"
        elif self.partial:
            yield "state", f"PARTIAL: the last state of an iteration that did not end ({self.outcome})"
        else:
            yield "outcome", self.outcome.replace("_", " ")
        yield "verdict", self.verdict
        yield "normal force", str(self.normal_force)
        yield "tangential force", str(self.tangential_force)
        yield "friction force", str(self.friction_force)
        for quantity, name in [("peak_normal_stress", "peak σₙ"), ("peak_tangential_stress", "peak σₜ")]:
            if (value := self._largest(quantity)) is not None:
                yield name, str(value)
        for name, contact in self.contacts.items():
            for part in ("contact", "stick", "slip"):
                found = ", ".join(f"{start:.5g} … {end:.5g}" for start, end in getattr(contact, part))
                yield f"{part} on {name}", found or "nowhere"
        yield "iterations", str(self.summary["iterations"])
        yield "unknowns", f"{self.summary['dofs']:,}"

    def __str__(self) -> str:
        rows = list(self.lines())
        width = max(len(name) for name, _ in rows)
        text = "\n".join(f"{name:<{width}}  {value}" for name, value in rows)
        notes = [f"verdict: {reason}" for reason in self.reasons] + [f"{w.kind}: {w}" for w in self.warnings]
        return "\n".join([text, *notes])

    __repr__ = __str__
