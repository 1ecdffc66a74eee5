"""A problem as a function of vectors: evaluations are jobs, derivatives are differences of them."""

from __future__ import annotations

import copy
import json
import math
import os
import pathlib
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from . import pointer as pointers
from ._calls import Submission
from ._parametrised import Parametrised, read_file, scalar
from ._parts import simple
from .client import Client
from .errors import InvalidProblem, SignoriniError, Violation, invalid
from .job import Job, Result

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
"""The names that a model may have: they stand in the names and labels of jobs."""

Vectors = Sequence["Sequence[float] | NDArray[Any]"]
"""Vectors of numbers: lists or arrays."""


class ModelError(SignoriniError):
    """A model cannot be evaluated at an input.

    type: the error of the protocol: `InvalidInput`, `UnsupportedFeature` or `InvalidOutput`
    """

    def __init__(self, type: str, message: str) -> None:
        super().__init__(f"{type}: {message}")
        self.type = type
        self.message = message

    def __reduce__(self) -> tuple[type[ModelError], tuple[str, str]]:
        return ModelError, (self.type, self.message)


@dataclass(frozen=True)
class _Evaluation:
    """What came of one job."""

    job: str
    outputs: list[list[float]]
    unknowns: tuple[int, int]
    """Of the body, and on the contact boundaries."""
    residual: float


class Model:
    """A problem as a function of vectors with vectors as values; each evaluation is a job with the label `model`.

        model = Model("punch", {"problem": problem, "inputs": [["/contacts/0/indentation"]], "outputs": [
            {"scalars": ["normal_force"]}]}, client)
        (force,), = model([[0.2]])
        derivative, = model.gradient(0, 0, [[0.2]], [1.0])

    name: at most 64 letters, digits, `_`, `.` and `-`
    definition: as in a file:
        problem: a `Problem` or its JSON, valid as it is
        inputs: vectors of JSON Pointers, or dotted names, of numbers of the problem: those that are given. The numbers
            that the problem itself has there should be of usual size: steps of differences are taken from them.
        outputs: vectors of numbers of the result, each `{"scalars": [paths]}`, or
            `{"profile": boundary, "quantity": column, "points": how many}`
        title: for people; may be left out
    client: sends the jobs

    Vectors have no place for a verdict: the first evaluation whose verdict is `poor` gives a Python warning with its
    reason.

    Raises `InvalidProblem` with everything that is wrong. Its methods raise `ModelError`, where a job has no solution
    `JobFailed`, and whatever else a client raises.
    """

    def __init__(self, name: str, definition: Mapping[str, Any], client: Client) -> None:
        self.name = name
        self._client = client
        self._of = _checked(name, definition, client)
        self._told = False  # that the verdict on an evaluation is poor

    @property
    def title(self) -> str | None:
        return self._of.title

    @classmethod
    def from_file(cls, name: str, path: str | os.PathLike[str], client: Client) -> Model:
        """A model from a JSON file; its `problem` may be the name of another file, from the folder of this one. Raises
        also OSError and ValueError, which name the file."""
        return cls(name, read_file(pathlib.Path(path)), client)

    # What `serve_models` of the package `umbridge` asks a model for

    def get_input_sizes(self, config: Mapping[str, Any] | None = None) -> list[int]:
        """How many numbers each vector of inputs has."""
        _without_options(config)
        return self._of.input_sizes

    def get_output_sizes(self, config: Mapping[str, Any] | None = None) -> list[int]:
        """How many numbers each vector of outputs has."""
        _without_options(config)
        return self._of.output_sizes

    def supports_evaluate(self) -> bool:
        return True

    def supports_gradient(self) -> bool:
        """Unless the problem has 0 at an input: then no size is known from which to take the step of a difference."""
        return all(number != 0 for vector in self._of.base for number in vector)

    def supports_apply_jacobian(self) -> bool:
        """As the gradient."""
        return self.supports_gradient()

    def supports_apply_hessian(self) -> bool:
        """Never: a difference of differences would be mostly rounding."""
        return False

    def __call__(self, parameters: Vectors, config: Mapping[str, Any] | None = None) -> list[list[float]]:
        """The outputs at an input."""
        _without_options(config)
        (found,) = self._solved([self._flat(parameters)])
        return found.outputs

    def gradient(
        self,
        out_wrt: int,
        in_wrt: int,
        parameters: Vectors,
        sens: Sequence[float],
        config: Mapping[str, Any] | None = None,
    ) -> list[float]:
        """sᵀJ: the derivatives of s · F by the numbers of the vector of inputs `in_wrt`, where F is the vector of
        outputs `out_wrt`, by central differences: two jobs for each number."""
        at, numbers = self._derivative(out_wrt, in_wrt, parameters, config)
        sens = _numbers(sens, "sens", self._of.output_sizes[out_wrt], f"output {out_wrt}")
        points, widths = [], []
        for k in numbers:
            plus, minus = list(at), list(at)
            plus[k] += self._step * self._size(at, k)
            minus[k] -= self._step * self._size(at, k)
            points += [plus, minus]
            widths.append(plus[k] - minus[k])  # what the step is once it is added: numbers are rounded
        found = self._solved(points)
        derivatives = []
        for one, other, width in zip(found[::2], found[1::2], widths, strict=True):
            self._check_comparable(one, other)
            values = [_dot(end.outputs[out_wrt], sens) for end in (one, other)]
            derivatives.append((values[0] - values[1]) / width)
        return _finite(derivatives)

    def apply_jacobian(
        self,
        out_wrt: int,
        in_wrt: int,
        parameters: Vectors,
        vec: Sequence[float],
        config: Mapping[str, Any] | None = None,
    ) -> list[float]:
        """J v: the derivative of the vector of outputs `out_wrt` along v in the vector of inputs `in_wrt`, by a central
        difference: two jobs."""
        at, numbers = self._derivative(out_wrt, in_wrt, parameters, config)
        vec = _numbers(vec, "vec", self._of.input_sizes[in_wrt], f"input {in_wrt}")
        # no number moves by more than the step that a gradient takes for it, and one by as much
        largest = max(abs(v / self._size(at, k)) for k, v in zip(numbers, vec, strict=True))
        t = self._step / largest if largest else 1.0  # without a direction both ends are the point itself
        if not (0 < t < math.inf):
            extent = "small" if t else "large"
            raise ModelError("InvalidInput", f"vec is too {extent}: its numbers are scaled to a step")
        ends = [list(at), list(at)]
        for k, v in zip(numbers, vec, strict=True):
            ends[0][k] += t * v
            ends[1][k] -= t * v
        one, other = self._solved(ends)
        self._check_comparable(one, other)
        pairs = zip(one.outputs[out_wrt], other.outputs[out_wrt], strict=True)
        return _finite([(plus - minus) / (2 * t) for plus, minus in pairs])

    # Jobs

    def _solved(self, points: Sequence[Sequence[float]]) -> list[_Evaluation]:
        """What comes of a job at each of these points; all of them are submitted, or none."""
        labels, name = {"model": self.name}, f"model {self.name}"
        problems = [self._problem(point) for point in points]
        try:
            jobs = self._client.submit_many([Submission(problem, name, labels) for problem in problems])
        except InvalidProblem as error:
            raise self._refused(points, error.violations) from error
        return [self._evaluation(job) for job in jobs]

    def _problem(self, point: Sequence[float]) -> Mapping[str, Any]:
        """The problem at a point. Whole numbers are written without a point, for the fields that take no others."""
        document = copy.deepcopy(self._of.document)
        for path, number in zip(self._pointers, point, strict=True):
            pointers.put(document, path, int(number) if number.is_integer() and abs(number) < 2**53 else number)
        return document

    def _evaluation(self, job: Job) -> _Evaluation:
        """What comes of a job, once it has ended. Without a converged solution this is an error."""
        result = job.wait(progress=False)
        if not result.converged:
            raise ModelError("InvalidOutput", f"{job.id} did not converge")
        if result.verdict == "poor" and not self._told:
            self._told = True
            why = next(iter(result.reasons), "see its result")
            later = f"Later ones are not reported: see GET /v1/jobs?label.model={self.name}&verdict=poor"
            warnings.warn(f"model {self.name}: the verdict on {job.id} is poor: {why} {later}", stacklevel=2)
        outputs = [self._vector(n, result) for n in range(len(self._of.outputs))]
        summary = result.summary
        residuals = [float(summary["residuals"][name]) for name in ("kkt", "friction", "monolithic")]
        return _Evaluation(job.id, outputs, (int(summary["dofs"]), int(summary["contact_dofs"])), max(residuals))

    def _vector(self, n: int, result: Result) -> list[float]:
        """A vector of outputs."""
        output, job = self._of.outputs[n], result.job.id
        if output.scalars is None:
            column = getattr(result.profile(output.profile, points=output.points), str(output.quantity))
            found = [float(value) for value in column]
        else:
            found = []
            for path in output.scalars:
                value = scalar(result.summary, path)
                if value is None:
                    why = "without friction" if "peak_tangential_stress" in path else "without contact"
                    raise ModelError("InvalidOutput", f"{job} succeeded, but has no {path}: {why} there is none")
                found.append(value)
        if len(found) != output.size or not all(map(math.isfinite, found)):
            raise ModelError("InvalidOutput", f"{job} has other values for output {n} than {output.size} finite ones")
        return found

    def _refused(self, points: Sequence[Sequence[float]], violations: Sequence[Violation]) -> ModelError:
        """The problem at a point is invalid: the violations of the first such point."""
        place = re.compile(r"/jobs/(\d+)(?:/problem)?(.*)")
        found = [(match, v) for v in violations if (match := place.fullmatch(v.pointer))]
        if not found:
            return ModelError("InvalidInput", "; ".join(map(str, violations)))
        first = int(found[0][0][1])
        told = [
            f"{m[2] or '(the problem)'}: got {v.got}, expected {v.expected}" for m, v in found if int(m[1]) == first
        ]
        at = ", ".join(f"{p} = {number:.3g}" for p, number in zip(self._pointers, points[first], strict=True))
        return ModelError("InvalidInput", f"the problem with {at} is invalid: {' | '.join(told[:3])}")

    # Inputs and steps

    @property
    def _pointers(self) -> list[str]:
        return [pointer for vector in self._of.inputs for pointer in vector]

    def _flat(self, parameters: Vectors) -> list[float]:
        """All numbers of an input, in one list."""
        sizes, vectors = self._of.input_sizes, simple(parameters)
        if not isinstance(vectors, list):
            raise ModelError("InvalidInput", f"input: expected a list of vectors, got {shown(vectors)}")
        if len(vectors) != len(sizes):
            raise ModelError("InvalidInput", f"input has {len(vectors)} vectors; the model takes {len(sizes)}")
        flat = []
        for n, (vector, size) in enumerate(zip(vectors, sizes, strict=True)):
            flat += _numbers(vector, f"input {n}", size, "the model")
        return flat

    def _derivative(
        self, out_wrt: int, in_wrt: int, parameters: Vectors, config: Mapping[str, Any] | None
    ) -> tuple[list[float], range]:
        """The numbers of an input, and which of them belong to the vector `in_wrt`."""
        _without_options(config)
        if not self.supports_gradient():
            why = "the problem has 0 at an input, so that no size is known from which to take the step of a difference"
            raise ModelError(
                "UnsupportedFeature", f"derivatives are not supported: {why}; write a number of usual size"
            )
        at = self._flat(parameters)
        sizes = self._of.input_sizes
        for name, index, count in (("outWrt", out_wrt, len(self._of.outputs)), ("inWrt", in_wrt, len(sizes))):
            if isinstance(index, bool) or not isinstance(index, int):
                raise ModelError("InvalidInput", f"{name}: expected the number of a vector, got {shown(index)}")
            if not 0 <= index < count:
                raise ModelError("InvalidInput", f"{name} is {index}; expected 0 … {count - 1}")
        start = sum(sizes[:in_wrt])
        return at, range(start, start + sizes[in_wrt])

    @property
    def _step(self) -> float:
        """The step of a central difference, relative to the size of a number: the cube root of the precision of the
        function, which is the tolerance of the solver and not that of the machine. A step h has an error of h² from
        the curvature, and of tolerance/h from what the solver leaves; at this step both are alike."""
        return float(self._of.tolerance ** (1 / 3))

    def _size(self, at: Sequence[float], k: int) -> float:
        """The size of an input: at least that of the problem's own number, so that steps at and around 0 are sound."""
        return max(abs(at[k]), abs([number for vector in self._of.base for number in vector][k]))

    def _check_comparable(self, one: _Evaluation, other: _Evaluation) -> None:
        """An error unless the difference of two solutions is one of the problem, and not of their meshes or of what
        rounding leaves: a residual r puts the derivative off by some r/step of its size, and may do so by as much as
        the step is."""
        not_supported = "a derivative at this input is not supported"
        if one.unknowns != other.unknowns:
            (a, c), (b, d) = one.unknowns, other.unknowns
            raise ModelError(
                "UnsupportedFeature",
                f"{not_supported}: {one.job} and {other.job}, the ends of a step, have {a} and {b} unknowns "
                f"({c} and {d} on contacts), so that their difference is not a derivative: the problem is refined "
                "until its result is accurate, or an input changes the mesh or the contact boundary; write a number "
                "for `mesh.refine`, and take no derivative by such an input",
            )
        worse = max(one, other, key=lambda end: end.residual)
        if worse.residual > self._step**2:
            raise ModelError(
                "UnsupportedFeature",
                f"{not_supported}: {worse.job} has a residual of {worse.residual:.1e}, where rounding ended its "
                f"iterations: a difference with a step of {self._step:.1e} would be off by "
                f"{worse.residual / self._step:.1e} of its size; give the problem a tolerance of {worse.residual:.0e} "
                "or more, which makes the step larger",
            )


def _checked(name: str, definition: Mapping[str, Any], client: Client) -> Parametrised:
    """The definition, if the service accepts its problem. Raises `InvalidProblem` with everything that is wrong."""
    found: list[Violation] = []
    parametrised = Parametrised(definition, found)
    if not NAME.fullmatch(name):
        wanted = "1 … 64 letters, digits, _ . and -, the first a letter or digit"
        found.append(Violation("/name", "bad_name", name, wanted))
    if parametrised.document:
        for violation in client.validate(parametrised.document).violations:
            place = "/problem" + violation.pointer
            found.append(Violation(place, violation.reason, violation.got, violation.expected, violation.hint))
    if found:
        raise invalid(found, f"The model {name}")
    return parametrised


def _without_options(config: Mapping[str, Any] | None) -> None:
    """An error if there are options: they would have no effect."""
    if config is None or config == {}:
        return
    if not isinstance(config, dict):
        raise ModelError("InvalidInput", f"config: expected an object, got {shown(config)}")
    first = shown(next(iter(config)))
    raise ModelError("InvalidInput", f"config has {first}; no model has options, so that it is left out or {{}}")


def _numbers(values: Any, what: str, size: int, whose: str) -> list[float]:
    """A vector of so many finite numbers."""
    values = simple(values)
    if not isinstance(values, list):
        raise ModelError("InvalidInput", f"{what}: expected a list of finite numbers, got {shown(values)}")
    if len(values) != size:
        raise ModelError("InvalidInput", f"{what} has {len(values)} numbers; expected {size}, as {whose} has")
    found = []
    for value in values:
        try:
            number = float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else math.nan
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise ModelError("InvalidInput", f"{what}: expected a list of finite numbers, got {shown(value)} in it")
        found.append(number)
    return found


def _finite(numbers: list[float]) -> list[float]:
    """A derivative, unless a number is beyond double precision."""
    if not all(map(math.isfinite, numbers)):
        raise ModelError("InvalidInput", "the derivative is beyond double precision: scale sens or vec down")
    return numbers


def _dot(one: Sequence[float], other: Sequence[float]) -> float:
    return sum(a * b for a, b in zip(one, other, strict=True))


def shown(value: Any) -> str:
    text = json.dumps(value, default=str)
    return text if len(text) <= 60 else text[:57] + "…"
