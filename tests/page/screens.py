"""Pictures of every view, light and dark, for docs/screens: written anew by hand, and looked at one by one.

    target/python/bin/python tests/page/screens.py
"""

import io
import pathlib

from PIL import Image

from browser import Browser, settled, until
from log_in import log_in, token
from outside import TOP, Server
from views import filled, stepped

FOLDER = TOP / "docs/screens"
#: Pictures of a page are few colours: with so many they are a fifth as large, and look the same.
COLOURS = 128


def take(page, name, whole=True):
    page.mouse.move(0, 0)
    picture = Image.open(io.BytesIO(page.screenshot(full_page=whole)))
    picture.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(FOLDER / (name + ".png"), optimize=True)


def views(browser, scheme):
    with Server() as server, browser.at(server, color_scheme=scheme) as tabs:
        page = tabs.page("", "There are no jobs yet")
        take(page, "empty-" + scheme)
        ids = filled(server)
        addresses = {"jobs": "#/jobs", "job": "#/jobs/" + ids["rectangular_punch"], "steps": "#/jobs/" + ids["fretting"],
                     "two_bodies": "#/jobs/" + ids["two_bodies"], "failed": "#/jobs/" + ids["fails"], "new": "#/new",
                     "compare": "#/compare?label.study=friction", "sweeps": "#/sweeps", "sweep": "#/sweeps/" + ids["sweep"]}
        for name, address in addresses.items():
            page.goto(server.url + "/" + address)
            settled(page)
            page.wait_for_timeout(1500)
            take(page, "%s-%s" % (name, scheme))
        job = server.submit(stepped(60, 100, refine=5), name="a long load")
        for number in range(4):
            server.submit(stepped(60, 101 + number, refine=5), name="waits %d" % number)
        page.goto(server.url + "/#/jobs/" + job)
        page.get_by_text("so far").wait_for(timeout=60_000)
        page.wait_for_timeout(1000)
        take(page, "running-" + scheme)
        page.goto(server.url + "/#/queue")
        until("what waits", lambda: "waits" in page.inner_text("main"))
        settled(page)
        take(page, "queue-" + scheme)
        page.set_viewport_size({"width": 390, "height": 844})
        for name in ("jobs", "job"):
            page.goto(server.url + "/" + addresses[name])
            settled(page)
            page.wait_for_timeout(1000)
            take(page, "phone_%s-%s" % (name, scheme), whole=False)
    with Server() as server, browser.at(server, color_scheme=scheme) as tabs:
        _, admin = token(server, "root", ["admin"])
        page = tabs.page("", "Log in")
        take(page, "log_in-" + scheme, whole=False)
        log_in(page, admin)
        page.get_by_text("There are no jobs yet").wait_for()
        page.goto(server.url + "/#/queue")
        page.get_by_role("heading", name="Tokens").wait_for()
        settled(page)
        take(page, "administrator-" + scheme)


def main():
    FOLDER.mkdir(exist_ok=True)
    browser = Browser()
    for scheme in ("light", "dark"):
        views(browser, scheme)
    browser.close()


main()
