"""Many tabs, a service that is updated under an open tab, and a service below a path behind nginx."""

import contextlib
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import time

from outside import Server, check, equal, example, free_port, talkative
from browser import described, until


def twelve_tabs(browser):
    """Browsers allow six connections to a service over plain HTTP, and every tab wants a stream."""
    with Server() as server, browser.at(server) as tabs:
        job = server.submit(talkative(250, refine=3), name="in all tabs")
        pages = []
        for number in range(12):
            page = tabs.page("#/jobs/" + job if number % 2 else "#/jobs", "in all tabs")
            pages.append(page)
        began = time.monotonic()
        last = tabs.context.new_page()
        last.goto(server.url + "/#/jobs", wait_until="commit")
        last.get_by_role("link", name="in all tabs").wait_for()
        took = time.monotonic() - began
        check(took <= 1, "the thirteenth tab shows its list after %.2f s" % took)
        server.finished(job)
        for page in pages:
            until("every tab is told of the end", lambda page=page: "succeeded" in page.inner_text("main"), 40)


def later_version(context, server):
    """From now on the browser meets a later version of the page at the same service: its page names other files, and the files
    of the version before are gone."""
    home = server.call("GET", "/")
    before = re.search(rb"web/([0-9a-f]+)/app\.js", home.body)[1].decode()
    later = before[::-1]
    headers = {name: home.headers[name] for name in ("content-type", "content-security-policy", "cache-control")}
    files = "%s/web/%%s/**" % server.url
    context.route(server.url + "/", lambda route: route.fulfill(body=home.body.decode().replace(before, later), headers=headers))
    context.route(files % before, lambda route: route.fulfill(status=404, body="{}", content_type="application/problem+json"))
    context.route(files % later, lambda route: route.fulfill(response=route.fetch(url=route.request.url.replace(later, before))))


def updated(browser):
    """An open tab goes on after an update; what it has not loaded yet is asked for by a reload, and not half shown."""
    with Server(port=free_port()) as server, browser.at(server) as tabs:
        server.finished(server.submit(example("sheet"), name="of before"))
        page = tabs.page("#/jobs", "of before")
        server.stop()
        server.start()
        later_version(tabs.context, server)
        job = server.submit(example("sheet"), name="of after")
        page.get_by_role("link", name="of after").or_(page.get_by_text("1 new")).first.wait_for(timeout=40_000)
        page.get_by_role("link", name="Queue").click()
        page.get_by_text("The service was updated").wait_for()
        page.get_by_role("button", name="Load the page again").click()
        page.get_by_role("heading", name="Queue and service").wait_for()
        page.goto(server.url + "/#/jobs/" + job)
        page.get_by_role("heading", name="Numbers").wait_for()


NGINX = """
daemon off; worker_processes 1; pid %(folder)s/pid; error_log stderr; %(user)s
events {}
http {
    access_log off;
    %(places)s
    server {
        listen 127.0.0.1:%(port)d;
        location /lab/signorini {
            proxy_pass http://%(address)s;
            proxy_http_version 1.1;
            proxy_set_header Host $http_host;
            proxy_set_header X-Forwarded-Proto $scheme;
            proxy_set_header X-Forwarded-For $remote_addr;
            proxy_read_timeout 1h;
        }
        location / { return 404; }
    }
}
"""


class Proxied:
    """A service below a path of nginx."""

    def __init__(self, port):
        self.url = "http://127.0.0.1:%d/lab/signorini" % port


@contextlib.contextmanager
def nginx(server):
    with tempfile.TemporaryDirectory() as folder:
        kinds = ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
        names = {"folder": folder, "port": free_port(), "address": server.address, "user": "user root;" if os.geteuid() == 0 else "",
                 "places": " ".join("%s_temp_path %s/%s;" % (kind, folder, kind) for kind in kinds)}
        path = pathlib.Path(folder) / "nginx.conf"
        path.write_text(NGINX % names)
        with open(os.path.join(folder, "log"), "w") as log:
            process = subprocess.Popen([shutil.which("nginx") or "/usr/sbin/nginx", "-c", path, "-p", folder], stderr=log)
        try:
            yield Proxied(names["port"])
        finally:
            process.terminate()
            process.wait(10)


def below_a_path(browser):
    with Server("--path-prefix", "/lab/signorini", "--trusted-proxy", "127.0.0.1", "--allow-unauthenticated") as server, nginx(server) as proxied:
        body = {"name": "t", "owner": "ada", "scopes": ["admin"]}
        secret = server.call("POST", "/lab/signorini/v1/tokens", body).json()["secret"]
        with browser.at(proxied) as tabs:
            page = tabs.context.new_page()
            # without the slash, as a person types it
            until("nginx answers", lambda: opened(page, proxied.url))
            equal(page.url, proxied.url + "/", "the address")
            page.get_by_label("Token").fill(secret)
            page.get_by_role("button", name="Log in").click()
            page.get_by_role("link", name="Try an example").click()
            described(page)
            page.get_by_role("button", name="Submit", exact=True).click()
            page.get_by_role("heading", name="Numbers").wait_for()
            cookie = tabs.context.cookies()[0]
            equal(cookie["path"], "/lab/signorini", "the path of the cookie")
            with page.expect_download() as downloaded:
                page.get_by_role("link", name="profile.svg").click()
            check(b"<svg" in open(downloaded.value.path(), "rb").read(), "a figure")
            page.get_by_role("link", name="Sweeps").click()
            page.get_by_text("There are no sweeps yet").wait_for()


def opened(page, url):
    try:
        return page.goto(url).status == 200
    except Exception:  # nginx has not begun
        return False


def run(browser):
    twelve_tabs(browser)
    updated(browser)
    below_a_path(browser)
