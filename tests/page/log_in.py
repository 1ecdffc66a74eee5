"""Sessions in a browser: log-in, a token that ends under the open page, and buttons that a token may not use."""

import contextlib

from outside import Server, check, equal, example
from browser import until


def token(server, owner, scopes, admin=None, **more):
    headers = {"authorization": "Bearer " + admin} if admin else {}
    body = {"name": "browser", "owner": owner, "scopes": scopes, **more}
    made = server.call("POST", "/v1/tokens", body, **headers).json()
    return made["token"]["id"], made["secret"]


def log_in(page, secret):
    page.get_by_label("Token").fill(secret)
    page.get_by_role("button", name="Log in").click()


@contextlib.contextmanager
def expiring(browser):
    """A session whose token expires under the open page while other tests go on. The shortest life is a minute."""
    with Server() as server, browser.at(server) as tabs:
        _, admin = token(server, "root", ["admin"])
        _, short = token(server, "ada", ["read"], admin, expires_in_s=60)
        page = tabs.page("", "Log in")
        log_in(page, short)
        page.get_by_text("There are no jobs").wait_for()
        cookie = tabs.context.cookies()[0]
        check(cookie["httpOnly"] and cookie["sameSite"] == "Strict", "the cookie: %r" % cookie)
        yield
        page.get_by_role("heading", name="Your session has ended").wait_for(timeout=75_000)


def run(browser):
    with Server() as server:
        _, admin = token(server, "root", ["admin"])
        of_ada, ada = token(server, "ada", ["read", "submit", "cancel"], admin)
        _, reader = token(server, "ada", ["read"], admin)
        job = server.call("POST", "/v1/jobs", {"problem": example("sheet"), "name": "of ada"}, authorization="Bearer " + ada).json()["id"]

        with browser.at(server) as tabs:
            page = tabs.page("#/queue", "Log in")
            log_in(page, "sgn_000000000000_wrong")
            page.get_by_text("unknown, was revoked or has expired").wait_for()
            check("login=" not in page.url and page.url.endswith("#/queue"), "the address after a wrong log-in: " + page.url)
            log_in(page, ada)
            page.get_by_role("heading", name="Queue and service").wait_for()
            check(page.url.endswith("#/queue"), "the log-in leads back: " + page.url)
            check("ada" in page.inner_text("header"), "who is logged in")
            # no script can read the token, and no storage has it
            read = page.evaluate("[document.cookie, JSON.stringify(localStorage), JSON.stringify(sessionStorage), location.href].join(' ')")
            check("sgn_" not in read, "what scripts can read: " + read)
            # figures and downloads are the browser's own requests
            page.goto(server.url + "/#/jobs/" + job)
            page.get_by_role("link", name="result.json").wait_for()
            with page.expect_download() as downloaded:
                page.get_by_role("link", name="profile").first.click()
            check(open(downloaded.value.path(), "rb").read(), "a download with a session")
            # revoked under the open page: told, and the view is not left behind readable as if it were live
            page.goto(server.url + "/#/jobs")
            page.get_by_role("link", name="of ada").wait_for()
            equal(server.call("DELETE", "/v1/tokens/" + of_ada, authorization="Bearer " + admin).status, 200, "revoked")
            page.get_by_role("heading", name="Your session has ended").wait_for()
            log_in(page, reader)
            page.get_by_role("link", name="of ada").wait_for()
            # a reader sees no button that would be refused
            page.get_by_label("Select of ada").check()
            shown = page.inner_text("body")
            for word in ("New job", "Cancel", "Delete"):
                check(word not in shown, "a reader is offered %r in the list" % word)
            page.goto(server.url + "/#/jobs/" + job)
            page.get_by_role("heading", name="Numbers").wait_for()
            shown = page.inner_text("body")
            for word in ("Edit and submit", "Rename", "Pin", "Delete", "Retry", "New job"):
                check(word not in shown, "a reader is offered %r at a job" % word)
            page.goto(server.url + "/#/queue")
            page.get_by_role("heading", name="Queue and service").wait_for()
            for word in ("Pause the queue", "Tokens", "Owners"):
                check(word not in page.inner_text("main"), "a reader is offered %r at the queue" % word)
            page.goto(server.url + "/#/new")
            page.get_by_text("has no scope").first.wait_for()
            page.get_by_role("button", name="Log out").click()
            page.get_by_role("heading", name="Log in").wait_for()
            page.close()

        # a person who opens the description of the API is asked for a password, as README says
        with browser.at(server, http_credentials={"username": "any", "password": admin}) as tabs:
            page = tabs.page("docs")
            page.get_by_text("Submit, get, list, watch, cancel").first.wait_for()
        # an administrator makes a token, sees it once, and revokes it
        with browser.at(server) as tabs:
            page = tabs.page("#/queue", "Log in")
            log_in(page, admin)
            page.get_by_role("heading", name="Tokens").wait_for()
            page.get_by_label("Name").fill("of eve")
            page.get_by_label("Owner").fill("eve")
            page.get_by_role("button", name="Make a token").click()
            until("the new token", lambda: "sgn_" in page.inner_text("main"))
            secret = next(word for word in page.inner_text("main").split() if word.startswith("sgn_"))
            equal(server.call("GET", "/v1/me", authorization="Bearer " + secret).json()["owner"], "eve", "the new token")
