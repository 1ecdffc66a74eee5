"""Places in a problem: JSON Pointers (RFC 6901), or dotted names, which are easier to type.

`/contacts/0/friction/coefficient` and `contacts.0.friction.coefficient` are the same place.
"""

from __future__ import annotations

import collections
from collections.abc import Iterable, Sequence
from typing import Any


def to_pointer(path: str) -> str:
    """A path as a JSON Pointer."""
    if path.startswith("/"):
        return path
    return "".join("/" + escape(name) for name in path.split("."))


def escape(name: str) -> str:
    return name.replace("~", "~0").replace("/", "~1")


def names(path: str) -> list[str]:
    """The names along a path."""
    return [name.replace("~1", "/").replace("~0", "~") for name in to_pointer(path).split("/")[1:]]


def put(document: Any, path: str, value: Any) -> None:
    """Sets the value at a path. Raises KeyError, naming the part of the path that does not exist."""
    *around, last = names(path)
    place = document
    for name in around:
        try:
            place = place[int(name)] if isinstance(place, list) else place[name]
        except (KeyError, IndexError, ValueError, TypeError):
            raise KeyError(f"{path}: there is no {name!r}") from None
    if isinstance(place, list):
        if not last.isdigit() or int(last) >= len(place):
            raise KeyError(f"{path}: there is no {last!r}")
        place[int(last)] = value
    elif isinstance(place, dict):
        place[last] = value
    else:
        raise KeyError(f"{path}: there is no {last!r}")


def differences(documents: Sequence[Any], pointer: str = "") -> dict[str, list[Any]]:
    """Where documents differ: the pointer of each place, with its value in each of them; None where it is absent.

    Lists of different lengths, and lists that differ in most of their numbers, such as the coordinates of a mesh,
    differ as a whole.
    """
    if all(document == documents[0] for document in documents):
        return {}
    found: dict[str, list[Any]] = {}
    if all(isinstance(document, dict) for document in documents):
        for name in dict.fromkeys(name for document in documents for name in document):
            found |= differences([document.get(name) for document in documents], f"{pointer}/{escape(name)}")
        return found
    if all(isinstance(document, list) for document in documents):
        if len({len(document) for document in documents}) == 1:
            for number, values in enumerate(zip(*documents, strict=True)):
                found |= differences(list(values), f"{pointer}/{number}")
            objects = all(isinstance(value, dict) for document in documents for value in document)
            if objects or len(found) <= max(1, len(documents[0]) // 2):
                return found
    return {pointer: list(documents)}


def short_names(found: Sequence[str], taken: Iterable[str] = ()) -> dict[str, str]:
    """For each pointer a name that no other has, and none of those that are taken: the last part of it, or all of it
    with dots or, where even that is not enough, as it is."""
    given: dict[str, str] = {}
    for name in (_last, _dotted, str):
        rest = {pointer: name(pointer) for pointer in found if pointer not in given}
        used = collections.Counter([*rest.values(), *given.values(), *taken])
        given.update({pointer: name for pointer, name in rest.items() if used[name] == 1 and not name.isdigit()})
    return {pointer: given.get(pointer, pointer) for pointer in found}


def _last(pointer: str) -> str:
    return names(pointer)[-1]


def _dotted(pointer: str) -> str:
    return pointer[1:].replace("/", ".")
