"""Modules of the package use only what lies below them, and the map in `__init__.py` has them in that order."""

from __future__ import annotations

import ast
import graphlib
import importlib.util
import pathlib
from collections.abc import Iterator

import pytest

import signorini as sg

FOLDER = pathlib.Path(sg.__file__).parent
MODULES = {
    ".".join(("signorini", *path.relative_to(FOLDER).with_suffix("").parts)).removesuffix(".__init__"): path
    for path in FOLDER.rglob("*.py")
}


def executed(node: ast.AST) -> Iterator[ast.AST]:
    """The parts of a module, functions included, without what only type checkers read."""
    for child in ast.iter_child_nodes(node):
        if not (isinstance(child, ast.If) and ast.unparse(child.test) == "TYPE_CHECKING"):
            yield child
            yield from executed(child)


def used(name: str) -> set[str]:
    """The modules of the package that a module imports, at its top or inside a function."""
    path = MODULES[name]
    package = name if path.stem == "__init__" else name.rpartition(".")[0]
    found = set()
    for node in executed(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            source = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
            # `from . import figures` is of a module, `from .errors import Violation` is of what is in one
            inner = {f"{source}.{alias.name}" for alias in node.names}
            found |= {module if module in MODULES else source for module in inner}
    return found & MODULES.keys()


def test_no_modules_import_each_other_in_a_circle() -> None:
    try:
        graphlib.TopologicalSorter({name: used(name) for name in MODULES}).prepare()
    except graphlib.CycleError as error:
        pytest.fail("imports go in a circle: " + " imports ".join(reversed(error.args[1])))


def test_the_map_names_each_module_after_those_that_it_uses() -> None:
    lines = str(sg.__doc__).partition("Where to look")[2].splitlines()
    rows = [line.strip().partition("  ")[0] for line in lines if line.startswith("    ")]
    order = [f"signorini.{name}" for row in rows for name in row.split(", ")]
    assert sorted(order) == sorted(MODULES.keys() - {"signorini"})
    for number, name in enumerate(order):
        later = used(name) - set(order[:number])
        assert not later, f"the map has {name} before {', '.join(sorted(later))}, which it imports"


def test_the_licences_are_those_of_the_project() -> None:
    for name in ("LICENSE-APACHE", "LICENSE-MIT"):
        client = pathlib.Path(__file__).resolve().parents[1]
        assert (client / name).read_bytes() == (client.parents[1] / name).read_bytes(), name
