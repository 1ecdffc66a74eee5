"""The page in a browser: Debian's Chromium, against the real service.

    python tests/page/run.py             all parts
    python tests/page/run.py live tabs   these

It needs Debian's chromium, and playwright and axe-playwright-python of tests/requirements.txt.
"""

import contextlib
import sys
import time

import browser
import log_in
import outside

PARTS = ["views", "log_in", "live", "tabs", "hostile", "everybody"]


def main():
    chosen = sys.argv[1:] or PARTS
    unknown = set(chosen) - set(PARTS)
    if unknown:
        sys.exit("unknown parts: %s; there are %s" % (", ".join(sorted(unknown)), ", ".join(PARTS)))
    chromium = browser.Browser()
    with contextlib.ExitStack() as at_the_end:
        at_the_end.callback(chromium.close)
        if "log_in" in chosen:
            at_the_end.enter_context(log_in.expiring(chromium))
        for name in chosen:
            began = time.monotonic()
            __import__(name).run(chromium)
            print("page, %s: %.0f s" % (name, time.monotonic() - began), flush=True)
    print("page: %d checks" % outside.checks)


main()
