"""Places in a problem: JSON Pointers (RFC 6901), or dotted names, which are easier to type.

`/contacts/0/friction/coefficient` and `contacts.0.friction.coefficient` are the same place.
"""

from __future__ import annotations

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
