"""The page for everybody: those who hear it, who have no mouse, who enlarge it, who want no movement, on a phone and on paper."""

import pathlib

import axe_playwright_python
from outside import Server, check, equal, example, talkative
from browser import described, settled, until
from views import filled

AXE = (pathlib.Path(axe_playwright_python.__file__).parent / "axe.min.js").read_text(encoding="utf-8")
SIZES = {"phone": (390, 844), "laptop": (1280, 900), "large": (2560, 1440), "laptop at 200 %": (640, 450)}


def addresses(ids):
    return {"jobs": "#/jobs", "job": "#/jobs/" + ids["rectangular_punch"], "steps": "#/jobs/" + ids["fretting"],
            "failed": "#/jobs/" + ids["fails"], "new": "#/new", "compare": "#/compare?label.study=friction", "sweeps": "#/sweeps",
            "sweep": "#/sweeps/" + ids["sweep"], "queue": "#/queue"}


def serious(page):
    """The serious and critical findings of axe."""
    page.evaluate(AXE)
    found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")["violations"]
    return [(one["id"], [node["target"] for node in one["nodes"]][:3]) for one in found if one["impact"] in ("serious", "critical")]


def run(browser):
    with Server() as server:
        ids = filled(server)
        for scheme in ("light", "dark"):
            with browser.at(server, color_scheme=scheme, bypass_csp=False) as tabs:
                page = tabs.page("#/jobs", "hertz")
                for name, address in addresses(ids).items():
                    page.goto(server.url + "/" + address)
                    settled(page)
                    equal(serious(page), [], "axe, %s, %s" % (name, scheme))
        for size, (width, height) in SIZES.items():
            with browser.at(server, viewport={"width": width, "height": height}) as tabs:
                page = tabs.page("#/jobs", "hertz")
                for name, address in addresses(ids).items():
                    page.goto(server.url + "/" + address)
                    settled(page)
                    wide = page.evaluate("document.documentElement.scrollWidth")
                    check(wide <= width, "%s on a %s is %d wide" % (name, size, wide))
        with browser.at(server) as tabs:
            by_keyboard(tabs, server, ids)
        with browser.at(server, reduced_motion="reduce") as tabs:
            job = server.submit(talkative(2000, refine=5), name="runs")
            page = tabs.page("#/jobs/" + job, "Convergence, live")
            equal(page.evaluate("document.getAnimations().length"), 0, "movements")
            server.call("POST", "/v1/jobs/%s/cancel" % job)
        with browser.at(server) as tabs:
            page = tabs.page("#/jobs/" + ids["rectangular_punch"], "Good, but")
            page.locator("#normal-stress canvas").wait_for()
            page.emulate_media(media="print")
            check(not page.locator("header").is_visible() and not page.get_by_role("button", name="Copy").is_visible(), "what paper has no use for")
            check(page.get_by_text("Good, but for one number:").is_visible(), "the verdict on paper")
            check(len(page.pdf()) > 20_000, "the page on paper")
    with Server() as server:
        server.call("POST", "/v1/tokens", {"name": "t", "owner": "ada", "scopes": ["admin"]})
        with browser.at(server) as tabs:
            page = tabs.page("", "Log in")
            equal(serious(page), [], "axe, the log-in")


def focused(page):
    return page.evaluate("(document.activeElement.innerText || document.activeElement.getAttribute('aria-label') || document.activeElement.name || '').trim()")


def tab_to(page, wanted, most=200):
    """Goes by the tabulator to an element of this name; it has a visible ring."""
    for _ in range(most):
        page.keyboard.press("Tab")
        if focused(page).startswith(wanted):
            ring = page.evaluate("getComputedStyle(document.activeElement).outlineStyle")
            check(ring != "none", "%r has no visible ring" % wanted)
            return
    raise AssertionError("%r is not reached by the tabulator" % wanted)


def by_keyboard(tabs, server, ids):
    page = tabs.page("#/jobs", "hertz")
    page.keyboard.press("Tab")
    equal(focused(page), "To the content", "the first stop")
    page.keyboard.press("Enter")
    # the list: move, select, open, and back
    page.keyboard.press("j")
    page.keyboard.press("j")
    page.keyboard.press("x")
    page.get_by_text("1 job selected").wait_for()
    page.keyboard.press("Enter")
    page.wait_for_url("**/#/jobs/job_*")
    page.go_back()
    page.get_by_role("heading", name="Jobs").wait_for()
    page.keyboard.press("/")
    equal(focused(page), "Search jobs", "the search")
    page.keyboard.type("hertz\n")
    until("one row", lambda: page.locator("table.jobs tbody tr").count() == 1)
    page.goto(server.url + "/#/jobs/" + ids["rectangular_punch"])
    page.get_by_role("heading", name="Numbers").wait_for()
    for wanted in ("Compare", "Normal stress along the contact", "|u|", "problem.json", "curl"):
        tab_to(page, wanted)
    page.goto(server.url + "/#/queue")
    page.get_by_role("heading", name="Queue and service").wait_for()
    page.keyboard.press("n")
    described(page)
    # the editor does not hold the focus for ever
    page.get_by_label("The problem as JSON").focus()
    page.keyboard.press("Escape")
    tab_to(page, "Submit")
    page.keyboard.press("Enter")
    page.get_by_role("heading", name="Numbers").wait_for()
