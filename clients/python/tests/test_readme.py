"""What the README shows, and what a first script has, runs as it stands, against a service of its own."""

from __future__ import annotations

import pathlib
import re
from typing import Any

import pytest
from conftest import TOP

import signorini as sg

README = TOP / "clients/python/README.md"

# A first script, which uses nearly all there is, and what its comments name; the id in its last line is that of a job that exists.
SCRIPT = """
import signorini as sg
c   = sg.Client()                                   # SIGNORINI_URL / SIGNORINI_TOKEN; sg.Client.local() starts the binary by itself
p   = sg.examples.rectangular_punch(rho=0.01)       # typed dataclasses that validate; p.plot() shows mesh, supports, obstacle
job = c.submit(p, name="punch")                     # idempotency key made here, kept across retries
r   = job.wait()                                    # one progress line: iteration, residual → tolerance, contact ±, eta; Ctrl-C detaches
r.verdict; r.normal_force                           # a number with its error
r.profile().to_pandas(); r.plot_profile(); r.history.plot(); r.fields().to_pyvista(); r.save_vtu("punch.vtu")
s   = c.sweep(p, {"contacts.0.friction.nonlocal_radius": [.008, .010, .015], "contacts.0.friction.coefficient": sg.linspace(0, .5, 6)})
df  = s.wait().to_pandas()
for ev in job.events(): ...                         # reconnects by itself, exact resume; async twin sg.AsyncClient
c.job(job.id).result(partial=True)                  # another machine, the next day
p.plot()
"""


@pytest.fixture
def elsewhere(server: sg.LocalServer, tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch) -> pathlib.Path:
    monkeypatch.setenv("SIGNORINI_URL", server.url)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_first_script_runs(elsewhere: pathlib.Path) -> None:
    place: dict[str, Any] = {}
    try:
        import pyvista  # noqa: F401
    except ImportError:  # large, and not there for every version of Python
        exec(SCRIPT.replace(".to_pyvista()", ""), place)
    else:
        exec(SCRIPT, place)
    assert place["r"].verdict == "good" and place["r"].normal_force.error < 0.2
    assert len(place["df"]) == 18 and set(place["df"]["status"]) == {"succeeded"}
    assert place["ev"].type == "done"
    assert (elsewhere / "punch.vtu").read_bytes().startswith(b"<?xml")


def test_the_readme_runs(elsewhere: pathlib.Path, capsys: pytest.CaptureFixture[str]) -> None:
    blocks = re.findall(r"^```python\n(.*?)^```$", README.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    assert len(blocks) >= 7
    place: dict[str, Any] = {}
    for block in blocks:
        exec(block, place)
    said = capsys.readouterr().out
    assert said.startswith("good 95.28 ± 0.03\n")
    assert "Friction is invalid:\n  1. /elastic_slip: got nan, expected a finite number" in said
    assert "too few iterations failed: The iteration did not converge" in said
    assert place["sphere"].validate(place["c"]).valid, place["sphere"].validate(place["c"])
    assert len(place["table"]) == 60 and not place["unfinished"]
    for name in ("punch.csv", "punch.png", "convergence.png", "punch.vtu", "study.png", "why.png"):
        assert (elsewhere / name).stat().st_size > 1000, name
