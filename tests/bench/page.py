"""How soon the page shows something, beside the same answers without a browser.

    target/python/bin/python tests/bench/page.py

A real service with 10,000 jobs, a job of 20,000 iterations that still runs, and a result of 100,000 elements, in Debian's Chromium.
Milliseconds from the opening of an address, each the median of five; the right column is the raw request for the same data. The
last column is the longest task of the page's own: while it lasts, the page does not answer.
"""

import json
import pathlib
import statistics
import sys
import time

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parents[1] / "page"), str(pathlib.Path(__file__).resolve().parents[1])]
from browser import Browser, until  # noqa: E402
from outside import Server, check  # noqa: E402
from views import stepped  # noqa: E402

ROUNDS = 5
JOBS, ITERATIONS, SIDE = 10_000, 20_000, 316
#: Notes when each of the wanted things is there first, and how long tasks are.
NOTES = """
window.seen = {}; window.longest = 0;
new PerformanceObserver((list) => { for (const task of list.getEntries()) longest = Math.max(longest, task.duration); }).observe({ type: "longtask", buffered: true });
const wanted = WANTED;
const look = () => {
  for (const [name, test] of Object.entries(wanted)) if (!(name in seen) && test()) seen[name] = performance.now();
  requestAnimationFrame(look);
};
requestAnimationFrame(look);
"""


def raw(server, path):
    """Milliseconds of a request without a browser, its answer read to the end."""
    times = []
    for _ in range(ROUNDS):
        began = time.monotonic()
        server.call("GET", path)
        times.append((time.monotonic() - began) * 1000)
    return statistics.median(times)


def opened(browser, server, address, wanted):
    """Milliseconds until each of the wanted things is there, and the longest task: medians."""
    found = {name: [] for name in [*wanted, "longest task"]}
    for _ in range(ROUNDS):
        with browser.at(server) as tabs:
            tabs.context.add_init_script(NOTES.replace("WANTED", "{%s}" % ", ".join("%s: () => %s" % (json.dumps(name), test() if callable(test) else test) for name, test in wanted.items())))
            page = tabs.context.new_page()
            page.goto(server.url + "/" + address, wait_until="commit")
            # each question is work for the page that is measured
            page.wait_for_timeout(2500)
            until("%s at %s" % (", ".join(wanted), address), lambda: page.evaluate("Object.keys(window.seen ?? {}).length") == len(wanted), 60)
            seen = page.evaluate("seen")
            for name in wanted:
                found[name].append(seen[name])
            found["longest task"].append(page.evaluate("longest"))
    return {name: statistics.median(times) for name, times in found.items()}


def block(side):
    """A square of side × side elements under a punch."""
    lines = [n / side for n in range(side + 1)]
    return {
        "analysis": {"kind": "plane_strain"}, "mesh": {"grid": {"x": lines, "y": lines}},
        "materials": [{"youngs_modulus": 1000, "poissons_ratio": 0.3}], "supports": [{"boundary": "bottom", "ux": 0, "uy": 0}],
        "contacts": [{"boundary": "top", "obstacle": {"kind": "flat", "to": 0.25}, "indentation": 0.01}],
    }


def told(what, times, limits, beside):
    for name, limit in limits.items():
        print("%-34s %6.0f ms   at most %5d%s" % (name + " " + what, times[name], limit, "   raw request %.0f ms" % beside if beside else ""))
    print("%-34s %6.0f ms" % ("longest task " + what, times["longest task"]))


def main():
    browser = Browser()
    with Server() as server:
        submission = {"problem": json.loads((pathlib.Path(__file__).resolve().parents[1] / "data/thesis/sheet.json").read_text())}
        for _ in range(JOBS // 1000):
            server.call("POST", "/v1/jobs/batch", {"jobs": [submission] * 1000})
        until("the jobs end", lambda: server.json("/v1/jobs/count?status=succeeded")["total"] == JOBS, 120)
        times = opened(browser, server, "#/jobs", {"shell": "document.querySelector('header nav')", "list": "document.querySelector('table.jobs tbody tr')"})
        told("of %d jobs" % JOBS, times, {"shell": 300, "list": 500}, raw(server, "/v1/jobs?page_size=50"))

        job = server.submit(stepped(20, 1000, refine=5), name="long")
        count = lambda: (server.json("/v1/jobs/" + job)["progress"] or {}).get("iteration", 0)
        until("%d iterations" % ITERATIONS, lambda: count() >= ITERATIONS, 600)
        shown = r"Number((document.querySelector('.sentence')?.textContent.match(/Iteration ([\d\s]+)/)?.[1] ?? '0').replace(/\D/g, ''))"
        times = opened(browser, server, "#/jobs/" + job, {
            "thin curve": "document.querySelector('#residuals canvas')", "caught up": lambda: "%s >= %d" % (shown, count())})
        told("at %d iterations" % count(), times, {"thin curve": 600, "caught up": 1000}, raw(server, "/v1/jobs/%s/history?format=json&partial=true&max_points=1000" % job))
        server.call("POST", "/v1/jobs/%s/cancel" % job)

        job = server.submit(block(SIDE))
        check(server.finished(job)["status"] == "succeeded", "the large job")
        times = opened(browser, server, "#/jobs/" + job, {"first picture": "/elements/.test(document.querySelector('#body .note')?.textContent ?? '')"})
        told("of %d elements" % SIDE**2, times, {"first picture": 2500}, raw(server, "/v1/jobs/%s/view" % job))
    browser.close()


main()
