"""The tutorial runs from top to bottom, and ends where it should.

SIGNORINI_FIGURES=FOLDER keeps its figures, to be looked at.
"""

from __future__ import annotations

import ast
import json
import os
import pathlib
from typing import Any

import pytest
from conftest import TOP

TUTORIAL = TOP / "clients/python/docs/tutorial.ipynb"


def run(cell: str, place: dict[str, Any]) -> Any:
    """Runs a cell as a notebook does; returns its last expression, which would be shown."""
    tree = ast.parse(cell)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), place)
    return eval(compile(ast.Expression(last.value), "cell", "eval"), place) if isinstance(last, ast.Expr) else None


def test_the_tutorial_runs(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("scipy")
    monkeypatch.chdir(tmp_path)
    folder = pathlib.Path(os.environ.get("SIGNORINI_FIGURES", tmp_path))
    cells = json.loads(TUTORIAL.read_text(encoding="utf-8"))["cells"]
    place: dict[str, Any] = {}
    shown = []
    for number, cell in enumerate(cells):
        if cell["cell_type"] == "code":
            assert not cell["outputs"], "the tutorial is kept without its outputs"
            shown.append(run("".join(cell["source"]), place))
            if type(shown[-1]).__name__ == "Figure" and "SIGNORINI_FIGURES" in os.environ:
                shown[-1].savefig(folder / f"{number:02}.png", dpi=100)
    assert sum(type(found).__name__ == "Figure" for found in shown) == 12
    assert all(result.converged for result in place["results"].values())
    assert set(place["table"]["status"]) == {"succeeded"} and len(place["table"]) == 30
    assert place["mu"] == pytest.approx(0.25, abs=4 * place["deviation"][0] + 1e-3)
    assert place["rho"] == pytest.approx(0.02, abs=4 * place["deviation"][1] + 1e-3)
