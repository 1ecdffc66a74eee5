"""The tutorial runs from top to bottom as people run it, in a kernel of Jupyter, and shows what it was stored with.

SIGNORINI_TUTORIAL=store stores the new outputs in the notebook; look at its figures then.
"""

from __future__ import annotations

import ast
import base64
import importlib.metadata
import io
import os
import pathlib
import re
import sys
from typing import Any

import pytest
from conftest import TOP

TUTORIAL = TOP / "clients/python/docs/tutorial.ipynb"
FIGURES = 12

# What the stored text does not say: that every value is one that may be shown.
JUDGEMENT = """
assert all(result.converged for result in results.values())
assert set(table["status"]) == {"succeeded"} and len(table) == 30
assert abs(mu - 0.25) < 4 * deviation[0] + 1e-3 and abs(rho - 0.02) < 4 * deviation[1] + 1e-3
"""


def executed(folder: pathlib.Path) -> Any:
    """The notebook with new outputs."""
    nbclient = pytest.importorskip("nbclient")
    nbformat = pytest.importorskip("nbformat")
    config = pytest.importorskip("traitlets.config").Config()
    # sockets in this folder instead of ports, which others on this machine could read
    config.KernelManager.transport = "ipc"
    config.KernelManager.ip = str(folder / "kernel")
    notebook = nbformat.read(TUTORIAL, as_version=4)
    metadata = dict(notebook.metadata)
    notebook.cells.append(nbformat.v4.new_code_cell(JUDGEMENT))
    nbclient.NotebookClient(
        notebook,
        timeout=120,
        coalesce_streams=True,
        record_timing=False,
        resources={"metadata": {"path": str(folder)}},
        config=config,
    ).execute()
    notebook.cells.pop()
    # without the versions of what ran it
    notebook.metadata = nbformat.from_dict(metadata)
    return notebook


def shown(cell: Any) -> list[list[str]]:
    """The words of each output of a cell, without ids, times, and residuals, which are rounding."""
    outputs = []
    for output in cell.get("outputs", []):
        if output["output_type"] == "display_data":  # a card
            text = re.sub("<svg.*?</svg>", "", output["data"]["text/html"])
            text = re.sub("<tr><td[^>]*>(time|residual)</td>.*?</tr>", "", text)
            text = re.sub("<[^>]*>", " ", text)
        else:
            text = output["text"] if output["output_type"] == "stream" else output["data"]["text/plain"]
        outputs.append(re.sub("(job|sweep)_[0-9a-f-]{36}", r"\1", text).split())
    return outputs


def figures(notebook: Any) -> list[Any]:
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    return [output.data for output in outputs if "image/png" in output.get("data", {})]


def smaller(png: str) -> str:
    """The same picture in fewer bytes, since all of them are kept in the repository: with 256 colours, unless it has
    shades, which would become bands."""
    from PIL import Image

    picture = Image.open(io.BytesIO(base64.b64decode(png))).convert("RGB")
    small = io.BytesIO()
    if picture.getcolors(4000):
        # no channel is off by more than 15 of 255; the median cut loses the few pixels of a mark's colour
        picture = picture.quantize(256, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    picture.save(small, "png", optimize=True)
    return base64.b64encode(small.getvalue()).decode()


def test_the_tutorial_shows_what_it_was_stored_with(tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nbformat = pytest.importorskip("nbformat")
    pytest.importorskip("scipy")
    # the kernel's own way to draw, and no settings of whoever runs the tests
    monkeypatch.delenv("MPLBACKEND", raising=False)
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path))
    new = executed(tmp_path)
    assert len(figures(new)) == FIGURES
    if os.environ.get("SIGNORINI_TUTORIAL") == "store":
        for data in figures(new):
            data["image/png"] = smaller(data["image/png"])
        nbformat.write(new, TUTORIAL)
    stored = nbformat.read(TUTORIAL, as_version=4)
    assert len(figures(stored)) == FIGURES, "SIGNORINI_TUTORIAL=store stores its figures"
    for number, (before, after) in enumerate(zip(stored.cells, new.cells, strict=True)):
        assert shown(before) == shown(after), f"cell {number} shows something else; SIGNORINI_TUTORIAL=store stores it"


def test_the_extra_has_all_that_the_tutorial_imports() -> None:
    nbformat = pytest.importorskip("nbformat")
    cells = [cell.source for cell in nbformat.read(TUTORIAL, as_version=4).cells if cell.cell_type == "code"]
    imported = {
        name.split(".")[0]
        for node in ast.walk(ast.parse("\n".join(cells)))
        for name in (
            [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else []
        )
    }
    assert {"numpy", "scipy"} <= imported
    wanted = {"signorini"}
    extras = {"", "tutorial"}
    requirements = importlib.metadata.requires("signorini") or []
    for _ in range(2):  # an extra may name others
        for requirement in requirements:
            extra = re.search("extra == ['\"](.*?)['\"]", requirement)
            if (extra.group(1) if extra else "") in extras:
                wanted.add(re.split(r"[^\w.-]", requirement, maxsplit=1)[0])
                if others := re.match(r"signorini\[(.*?)\]", requirement):
                    extras |= set(others.group(1).split(","))
    assert imported - wanted - sys.stdlib_module_names == set()
    assert "jupyterlab" in wanted
