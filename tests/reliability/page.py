"""The service is killed under the open page of a running job, refuses connections, stands behind a proxy that answers 502 and 503,
and starts again: the page goes on with every event and none twice, and writes nothing of its own to the console.
"""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "page"))
import browser  # noqa: E402
import live  # noqa: E402


def main():
    chromium = browser.Browser()
    try:
        events = live.killed(chromium)
    finally:
        chromium.close()
    print("figure: %d events under the open page, none missing and none twice" % events)


main()
