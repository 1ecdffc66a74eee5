"""Texts of people in every place where the page shows one: none of them is taken for markup, script or an address."""

import json
import re
import tempfile
import pathlib

from outside import Server, check, equal, example
from browser import described, settled

MARKUP = "<img src=x onerror='hit=1'><script>hit=2</script>\"'`&amp;${hit=3}"
#: Names as boundaries may have them.
SHORT = "<img src=x onerror='hit=4'>"


def submit(server, problem, **more):
    answer = server.call("POST", "/v1/jobs", {"problem": problem, **more})
    check(answer.status in (200, 201, 202), "submit: %r" % answer)
    return answer.json()["id"]


def hostile_problem():
    """A sheet whose names are all markup."""
    return {
        "title": MARKUP,
        "units": {"length": "<b>m", "force": "<b>N", "stress": "<b>Pa"},
        "analysis": {"kind": "plane_strain"},
        "mesh": {
            "grid": {"x": [0, 1, 2], "y": [0, 1]},
            "boundaries": {SHORT: {"side": "top"}, "__proto__x": {"side": "bottom"}, "</script>": {"side": "left"}},
            "groups": {SHORT: {"x": [0, 1], "y": [0, 1]}, "constructor": {"x": [1, 2], "y": [0, 1]}},
        },
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3, "group": SHORT, "name": MARKUP},
                      {"youngs_modulus": 1000, "poissons_ratio": 0.3, "group": "constructor"}],
        "supports": [{"boundary": "__proto__x", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": SHORT, "obstacle": {"kind": "flat"}, "indentation": 0.01,
                      "friction": {"coefficient": 0.3, "nonlocal_radius": 0.5, "elastic_slip": 1e-4}}],
        "steps": [{"name": MARKUP[:40], "indentation": 0.5}, {"name": SHORT}],
    }


def run(browser):
    with Server() as server, browser.at(server) as tabs:
        tabs.context.on("dialog", lambda dialog: tabs.messages.append(("exception", "a dialog: " + dialog.message)))
        labels = {"study": MARKUP[:60], "__proto__": SHORT, "constructor": "javascript:hit=5"}
        jobs = [submit(server, hostile_problem(), name=MARKUP, labels=labels),
                submit(server, hostile_problem(), name="javascript:hit=6", labels={"study": "b"}, cache="off")]
        hasty = dict(example(), solver={"max_iterations": 1}, title=MARKUP)
        jobs.append(submit(server, hasty, name=SHORT))
        for job in jobs:
            server.finished(job)
        axes = [{"path": "/contacts/0/friction/coefficient", "values": [0.1, 0.2]}]
        sweep = server.call("POST", "/v1/sweeps", {"base": hostile_problem(), "axes": axes, "name": MARKUP, "labels": labels}).json()["id"]

        page = tabs.page("#/jobs", SHORT)
        check(MARKUP in page.inner_text("main"), "the name as it was given")
        addresses = ["#/jobs/" + job for job in jobs]
        addresses += ["#/compare?ids=" + ",".join(jobs[:2]), "#/sweeps", "#/sweeps/" + sweep, "#/queue", "#/new?from=" + jobs[0],
                      "#/jobs?text=" + SHORT, "#/jobs?label.study!=" + SHORT, "#/jobs/" + SHORT, "#/" + SHORT]
        for address in addresses:
            page.goto(server.url + "/" + address)
            settled(page)
            equal(page.evaluate("[typeof hit, document.querySelectorAll('img, script:not([src])').length]"), ["undefined", 0],
                  "script or markup at " + address)
            for link in page.evaluate("[...document.querySelectorAll('a')].map((a) => a.href)"):
                check(not link.startswith("javascript:"), "a link at %s: %s" % (address, link))

        # what is wrong is told with what was given
        page.goto(server.url + "/#/new?from=" + jobs[0])
        described(page)
        editor = page.get_by_label("The problem as JSON")
        text = json.loads(editor.input_value())
        text["supports"][0]["boundary"] = MARKUP
        text[MARKUP] = 1
        editor.fill(json.dumps(text))
        page.get_by_role("button", name=re.compile("expected")).first.wait_for()
        page.wait_for_timeout(500)
        with tempfile.TemporaryDirectory() as folder:
            for ending in (".msh", ".inp", ".json"):
                name = pathlib.Path(folder) / (SHORT.replace("/", "") + ending)
                name.write_text(MARKUP)
                page.set_input_files("input[type=file]", name)
                page.wait_for_timeout(500)
        equal(page.evaluate("[typeof hit, document.querySelectorAll('img, script:not([src])').length]"), ["undefined", 0], "script in errors")
