"""What the types of `problem.py` have in common: values are checked against the annotations of the fields.

One function, `convert`, reads a value by the type that it should have. It takes what is convenient (plain
dictionaries, arrays, ranges, numbers of NumPy and of `decimal`, paths), returns what the field holds (dataclasses,
lists, floats), and notes everything that is wrong instead of stopping at the first fault, each fault with its JSON
Pointer, as the service does. Ranges of numbers are left to the service (`Problem.validate`), which knows them; here are
names, types and shapes.
"""

from __future__ import annotations

import dataclasses
import decimal
import difflib
import math
import numbers
import os
import types
import typing
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, TypeVar, Union

import numpy as np

from . import pointer as pointers
from .errors import Violation, invalid

P = TypeVar("P", bound="Part")

# what a class may be made of besides what its fields hold
JSON = Mapping[str, Any]
Real = Union[float, decimal.Decimal, "np.floating[Any]", "np.integer[Any]"]
Whole = Union[int, "np.integer[Any]"]


@dataclasses.dataclass(frozen=True)
class ListOf:
    """Annotation of a list: the type of its items, and how many there may be."""

    item: Any
    least: int = 0
    most: int | None = None


class Part:
    """A part of a problem: a dataclass that checks itself when it is made.

    Wherever a part is expected, a dictionary of the service's JSON will do. A field whose name is a word of Python
    ends in an underscore: `from_` is the JSON's `from`.
    """

    # a type checker would take it for leave to give any name
    if not typing.TYPE_CHECKING:

        def __new__(cls, *args: Any, **values: Any) -> Part:
            """Raises TypeError for a name that is none of its fields."""
            for name in values:
                if name not in hints(cls):
                    raise TypeError(no_field(cls, name))
            return super().__new__(cls)

    def __post_init__(self) -> None:
        found: list[Violation] = []
        for name, hint in hints(type(self)).items():
            setattr(self, name, convert(getattr(self, name), hint, "/" + json_name(name), found))
        if found:
            raise invalid(found, type(self).__name__)

    # a type checker would take it for leave to set any name
    if not typing.TYPE_CHECKING:

        def __setattr__(self, name: str, value: Any) -> None:
            """Sets a field. Raises AttributeError for another name, which the service would never see."""
            if name not in hints(type(self)):
                raise AttributeError(no_field(type(self), name))
            super().__setattr__(name, value)

    def __repr__(self) -> str:
        """Only what differs from the default: a problem has more than a hundred fields."""
        held = [(field, getattr(self, field.name)) for field in dataclasses.fields(typing.cast(Any, self))]
        shown = [f"{f.name}={v!r}" for f, v in held if v is not None and not is_default(f, v)]
        return f"{type(self).__name__}({', '.join(shown)})"

    def to_dict(self, *, defaults: bool = False) -> dict[str, Any]:
        """The JSON of the service; without what is absent and, unless `defaults`, without what is as by default."""
        document = {}
        for field in dataclasses.fields(typing.cast(Any, self)):
            value = getattr(self, field.name)
            # the kind is the default of its class, but tells the service which class it is
            if value is None or (not defaults and field.name != "kind" and is_default(field, value)):
                continue
            document[json_name(field.name)] = plain(value, defaults)
        return document

    @classmethod
    def from_dict(cls: type[P], document: Mapping[str, Any]) -> P:
        """Reads the service's JSON. Raises `InvalidProblem` with everything that is wrong."""
        found: list[Violation] = []
        part = convert(document, cls, "", found)
        if found:
            raise invalid(found, cls.__name__)
        return typing.cast(P, part)

    def with_values(self: P, values: Mapping[str, Any]) -> P:
        """A copy with other values, by dotted names or JSON Pointers: `{"contacts.0.friction.coefficient": 0.2}`."""
        document = self.to_dict(defaults=True)
        for path, value in values.items():
            pointers.put(document, path, plain(value, True))
        return type(self).from_dict(document)


_HINTS: dict[Any, dict[str, Any]] = {}


def hints(cls: Any) -> dict[str, Any]:
    """The types of the fields; read once, since that is slow."""
    if cls not in _HINTS:
        found = typing.get_type_hints(cls, include_extras=True)
        _HINTS[cls] = {field.name: found[field.name] for field in dataclasses.fields(cls)}
    return _HINTS[cls]


def no_field(cls: Any, name: str) -> str:
    """That a class has no field of this name, with the one that may be meant."""
    known = hints(cls)
    close = difflib.get_close_matches(name, known, 1)
    guess = f"Did you mean `{close[0]}`?" if close else f"It has {', '.join(known)}."
    return f"{cls.__name__} has no `{name}`. {guess}"


def json_name(name: str) -> str:
    return name.rstrip("_")


def is_default(field: dataclasses.Field[Any], value: Any) -> bool:
    if field.default is not dataclasses.MISSING:
        default = field.default
    elif field.default_factory is not dataclasses.MISSING:
        default = field.default_factory()
    else:
        return False
    try:
        return bool(value == default)
    except ValueError:  # an array, of which each number would be compared: somebody has set it
        return False


def plain(value: Any, defaults: bool = False) -> Any:
    """Plain JSON of a value."""
    value = simple(value)
    if isinstance(value, Part):
        return value.to_dict(defaults=defaults)
    if isinstance(value, Mapping):
        return {str(key): plain(item, defaults) for key, item in value.items()}
    if isinstance(value, list):
        return [plain(item, defaults) for item in value]
    return value


def simple(value: Any) -> Any:
    """A value of NumPy, pandas or the standard library as what JSON has: numbers, texts, lists."""
    if isinstance(value, np.generic):
        return value.item()
    if value is None or isinstance(value, (str, bytes, int, float, list, set, frozenset, Mapping, Part)):
        return value
    if isinstance(value, (numbers.Real, decimal.Decimal)):
        number = float(value)
        return int(number) if number.is_integer() and value == int(number) else number
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if hasattr(value, "__array__"):  # a Series of pandas, an array of another library
        return np.asarray(value).tolist()
    return list(value) if isinstance(value, Iterable) else value


def convert(value: Any, hint: Any, pointer: str, found: list[Violation]) -> Any:
    """`value` as its field holds it; what is wrong is added to `found`."""
    value = simple(value)
    origin = typing.get_origin(hint)
    if origin is Union or isinstance(hint, types.UnionType):
        return convert_union(value, typing.get_args(hint), pointer, found)
    if origin is Literal:
        choices = typing.get_args(hint)
        if value in choices and isinstance(value, str):
            return value
        names = ", ".join(f"`{choice}`" for choice in choices)
        return fault(found, pointer, "unknown_value", value, f"one of {names}", similar(value, choices))
    if shape := list_shape(hint):
        return convert_list(value, shape, pointer, found)
    if origin is dict:
        return convert_mapping(value, typing.get_args(hint)[1], pointer, found)
    if issubclass(hint, Part):
        return convert_part(value, hint, pointer, found)
    return convert_scalar(value, hint, pointer, found)


def convert_scalar(value: Any, hint: type, pointer: str, found: list[Violation]) -> Any:
    if hint in (float, int) and isinstance(value, numbers.Real) and not isinstance(value, bool):
        if not math.isfinite(value):
            return fault(found, pointer, "not_finite", value, "a finite number")
        number = value if isinstance(value, int) else float(value)
        if hint is float:
            return number
        if number == int(number) and number >= 0:
            return int(number)
    elif hint in (bool, str) and isinstance(value, hint):
        return value
    return fault(found, pointer, "wrong_type", value, expected(hint))


def convert_list(value: Any, shape: ListOf, pointer: str, found: list[Violation]) -> Any:
    if not isinstance(value, list):
        return fault(found, pointer, "wrong_type", value, described(shape))
    if len(value) < shape.least or (shape.most is not None and len(value) > shape.most):
        return fault(found, pointer, "wrong_length", f"{len(value)} items", described(shape))
    return [convert(item, shape.item, f"{pointer}/{number}", found) for number, item in enumerate(value)]


def convert_mapping(value: Any, item: Any, pointer: str, found: list[Violation]) -> Any:
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        return fault(found, pointer, "wrong_type", value, "a mapping of names")
    return {key: convert(entry, item, f"{pointer}/{pointers.escape(key)}", found) for key, entry in value.items()}


def convert_part(value: Any, cls: type[Part], pointer: str, found: list[Violation]) -> Any:
    if isinstance(value, cls):
        return value
    if not isinstance(value, Mapping):
        return fault(found, pointer, "wrong_type", value, expected(cls))
    known = {json_name(name): name for name in hints(cls)}
    for key in value:
        if key not in known:
            names = ", ".join(f"`{name}`" for name in known)
            fault(found, f"{pointer}/{key}", "unknown_name", key, f"one of {names}", similar(key, list(known)))
    # made without its __init__, which would check all of it once more, and in part before it is complete
    part = object.__new__(cls)
    for field in dataclasses.fields(typing.cast(Any, cls)):
        key = json_name(field.name)
        if key in value:
            held = convert(value[key], hints(cls)[field.name], f"{pointer}/{key}", found)
        elif field.default is not dataclasses.MISSING:
            held = field.default
        elif field.default_factory is not dataclasses.MISSING:
            held = field.default_factory()
        else:
            held = fault(found, f"{pointer}/{key}", "missing", "nothing", f"`{key}`, which is required")
        setattr(part, field.name, held)
    return part


def convert_union(value: Any, choices: Sequence[Any], pointer: str, found: list[Violation]) -> Any:
    if value is None and type(None) in choices:
        return None
    choices = [choice for choice in choices if choice is not type(None)]
    kinds = {kind_of(choice): choice for choice in choices if kind_of(choice)}
    if kinds and isinstance(value, Mapping):
        kind = value.get("kind")
        if kind in kinds:
            return convert_part(value, kinds[kind], pointer, found)
        names = ", ".join(f"`{name}`" for name in kinds)
        got = "nothing" if kind is None else kind
        return fault(found, f"{pointer}/kind", "unknown_value", got, f"one of {names}", similar(kind, list(kinds)))
    fitting = [choice for choice in choices if fits(value, choice)]
    if fitting:
        return convert(value, fitting[0], pointer, found)
    return fault(found, pointer, "wrong_type", value, " or ".join(expected(choice) for choice in choices))


def kind_of(hint: Any) -> str:
    """The `kind` that tells a class from its alternatives; empty without one."""
    if isinstance(hint, type) and issubclass(hint, Part) and "kind" in hints(hint):
        return str(typing.get_args(hints(hint)["kind"])[0])
    return ""


def fits(value: Any, hint: Any) -> bool:
    """Whether a value is meant to be of this type, though it may not be right in detail."""
    if typing.get_origin(hint) is Literal:
        return isinstance(value, str)
    if typing.get_origin(hint) is Union or isinstance(hint, types.UnionType):
        return any(fits(value, choice) for choice in typing.get_args(hint))
    if list_shape(hint):
        return isinstance(value, list)
    if typing.get_origin(hint) is dict:
        return isinstance(value, Mapping)
    if isinstance(hint, type) and issubclass(hint, Part):
        return isinstance(value, hint) or (isinstance(value, Mapping) and not kind_of(hint))
    if hint in (int, float):
        return isinstance(value, numbers.Real) and not isinstance(value, bool)
    return isinstance(value, hint)


def within(hint: Any, name: str) -> list[Any]:
    """The types that a value of a type may have at a name or number in it; `int` and `float` stand for themselves."""
    if shape := list_shape(hint):
        found = shape.item
    elif typing.get_origin(hint) is dict:
        found = typing.get_args(hint)[1]
    elif isinstance(hint, type) and issubclass(hint, Part):
        found = {json_name(field): inner for field, inner in hints(hint).items()}.get(name)
    else:
        return []
    return alternatives(found)


def kinds_at(cls: Any, path: str) -> set[Any]:
    """Which of the plain types `int`, `float`, `bool` and `str` a value at a place in a part may have."""
    hints = [cls]
    for name in pointers.names(path):
        hints = [inner for hint in hints for inner in within(hint, name)]
    return {hint for hint in hints if hint in (int, float, bool, str)}


def alternatives(hint: Any) -> list[Any]:
    if typing.get_origin(hint) is Union or isinstance(hint, types.UnionType):
        return [inner for choice in typing.get_args(hint) for inner in alternatives(choice)]
    return [hint]


def list_shape(hint: Any) -> ListOf | None:
    if typing.get_origin(hint) is typing.Annotated:
        return typing.cast(ListOf, hint.__metadata__[0])
    if typing.get_origin(hint) is list:
        return ListOf(typing.get_args(hint)[0])
    return None


def expected(hint: Any) -> str:
    """A type in words."""
    if shape := list_shape(hint):
        return described(shape)
    if typing.get_origin(hint) is Union or isinstance(hint, types.UnionType):
        return " or ".join(expected(choice) for choice in typing.get_args(hint) if choice is not type(None))
    if typing.get_origin(hint) is Literal:
        return " or ".join(f"`{choice}`" for choice in typing.get_args(hint))
    simple = {float: "a number", int: "a whole number ≥ 0", bool: "True or False", str: "a text"}
    return simple.get(hint) or f"a {hint.__name__} or a dictionary"


def described(shape: ListOf) -> str:
    if shape.most is None:
        return f"a list, each item {expected(shape.item)}"
    number = str(shape.most) if shape.least == shape.most else f"{shape.least} to {shape.most}"
    return f"a list of {number}, each {expected(shape.item)}"


def similar(got: Any, choices: Sequence[str]) -> str:
    """A hint where the value is nearly right."""
    close = difflib.get_close_matches(str(got), choices, 1, 0.6)
    return f"Did you mean `{close[0]}`?" if close else ""


def fault(found: list[Violation], pointer: str, reason: str, got: Any, wanted: str, hint: str = "") -> Any:
    text = got if isinstance(got, str) else repr(got)
    if reason == "wrong_type" and isinstance(got, str):
        text = repr(got)
    if reason in ("unknown_name", "unknown_value") and got != "nothing":
        text = f"`{text}`"
    found.append(Violation(pointer, reason, text if len(text) <= 80 else text[:77] + "…", wanted, hint))
    return got
