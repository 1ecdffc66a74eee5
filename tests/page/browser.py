"""A browser for the tests of the page: Debian's Chromium, driven by Playwright. Every page is watched: it may ask nobody but the
service, and may write nothing to the console but what Chromium itself says of a lost connection or of a refused request.
"""

import contextlib
import pathlib
import re
import shutil
import sys
import time

from playwright.sync_api import sync_playwright

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from outside import check, equal  # noqa: E402

#: What Chromium itself writes: when a server is killed, and for an answer with one of these statuses: no session, nothing there, a mesh or deck that is refused, a proxy
#: without a service, a service that starts or is busy. A page cannot prevent it. A request that the page should not have sent,
#: such as one with status 400, is not among them.
OF_THE_BROWSER = re.compile(
    r"^Failed to load resource: (net::|the server responded with a status of (401|404|422|502|503) )"
    r"|net::ERR_(CONNECTION_REFUSED|INCOMPLETE_CHUNKED_ENCODING|CONNECTION_RESET|EMPTY_RESPONSE)"
    # the software renderer, when a picture of the page is taken
    r"|GPU stall due to ReadPixels"
)


class Browser:
    """Chromium with one context after another, each for one server."""

    def __init__(self):
        self.playwright = sync_playwright().start()
        program = shutil.which("chromium")
        check(program, "chromium is not there: Debian's package chromium has it")
        self.chromium = self.playwright.chromium.launch(executable_path=program)

    def close(self):
        self.chromium.close()
        self.playwright.stop()

    @contextlib.contextmanager
    def at(self, server, **options):
        """A context for a server, whose pages are watched. Options are those of Playwright, such as `color_scheme`."""
        context = self.chromium.new_context(**{"viewport": {"width": 1280, "height": 900}, **options})
        context.set_default_timeout(20_000)
        watched = Watched(context, server)
        try:
            yield watched
        finally:
            context.close()
        watched.has_only_asked_the_service()


class Watched:
    """A context, its requests and its messages."""

    def __init__(self, context, server):
        self.context, self.server = context, server
        self.asked, self.messages = set(), []
        context.on("request", lambda request: self.asked.add(request.url))
        context.on("console", lambda message: self.messages.append((message.type, message.text)))
        context.on("weberror", lambda error: self.messages.append(("exception", "%s %s" % (error.error, (error.error.stack or "")[:700]))))

    def page(self, address="", seen=None):
        """A page at an address of the page's own, such as `#/queue`; waits until the text `seen` is there."""
        page = self.context.new_page()
        page.goto(self.server.url + "/" + address)
        if seen:
            page.get_by_text(seen).filter(visible=True).first.wait_for()
        return page

    def has_only_asked_the_service(self):
        home = self.server.url + "/"
        others = [url for url in self.asked if not (url + "/").startswith(home) and not url.startswith(("data:", "blob:" + home))]
        equal(others, [], "addresses of others that the page has asked")
        own = [found for found in self.messages if found[0] in ("error", "warning", "exception") and not OF_THE_BROWSER.search(found[1])]
        equal(own, [], "messages of the page's own in the console")


def until(what, holds, seconds=20):
    """Waits until something holds; the page goes on meanwhile."""
    end = time.monotonic() + seconds
    while True:
        found = holds()
        if found:
            return found
        check(time.monotonic() < end, "not within %d s: %s" % (seconds, what))
        time.sleep(0.05)


def settled(page):
    """Waits until nothing is asked for half a second, apart from streams."""
    page.wait_for_timeout(500)
    page.wait_for_function("!document.querySelector('.loading')")


def described(page):
    """Waits until the problem of a new job is told in words: it is valid then, and can be submitted."""
    page.locator(".columns p", has_text="An elastic body").first.wait_for()
