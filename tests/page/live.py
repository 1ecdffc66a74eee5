"""A job watched while it runs, through everything that may happen to the service: killed, away, behind a proxy that has no service,
started again. Not one iteration is missing, and none comes twice.
"""

import http.server
import threading
import time

from outside import Server, check, equal, free_port, talkative
from browser import described, until
from views import stepped

#: Notes the id of every event that a stream brings, in the order in which they come.
NOTES = """
window.ids = [];
const plain = window.fetch;
window.fetch = async (address, init) => {
  const response = await plain(address, init);
  if (!(response.headers.get("content-type") ?? "").startsWith("text/event-stream")) return response;
  let rest = "";
  const noted = response.body.pipeThrough(new TransformStream({
    transform(piece, to) {
      rest += new TextDecoder().decode(piece);
      const lines = rest.split("\\n");
      rest = lines.pop();
      for (const line of lines) if (line.startsWith("id: ")) window.ids.push(Number(line.slice(4)));
      to.enqueue(piece);
    },
  }));
  return new Response(noted, { status: response.status, headers: response.headers });
};
"""


class Away:
    """A proxy without a service behind it: it answers everything with one status."""

    def __init__(self, port, status):
        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                asked.append(self.path)
                self.send_response(status)
                self.send_header("content-type", "text/html")
                self.end_headers()
                self.wfile.write(b"<h1>no service</h1>")

            def log_message(self, *_):
                pass

        asked = self.asked = []
        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", port), Handler)
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def close(self):
        self.server.shutdown()
        self.server.server_close()


def killed(browser):
    """Killed under the open page: row R35 of tests/reliability."""
    port = free_port()
    with Server(port=port) as server, browser.at(server) as tabs:
        tabs.context.add_init_script(NOTES)
        job = server.submit(talkative(250, refine=4), name="watched")
        page = tabs.page("#/jobs/" + job, "Convergence, live")
        page.locator("#residuals canvas").wait_for()
        until("a hundred events", lambda: page.evaluate("ids.length") > 100)
        check("normal force" in page.inner_text("main"), "the forces beside the residuals")
        before = page.evaluate("ids.length")
        server.kill()
        page.get_by_text("no connection since").wait_for()
        for status in (502, 503):
            away = Away(port, status)
            until("it is asked while the answer is %d" % status, lambda: away.asked, 40)
            time.sleep(0.5)
            check("no connection since" in page.inner_text("header"), "the page says that it may be old, at %d" % status)
            away.close()
        server.start()
        until("it goes on", lambda: page.evaluate("ids.length") > before + 100, 40)
        until("it is up to date", lambda: "live" in page.inner_text("header"))
        page.get_by_text("earlier attempts are grey").wait_for()
        server.finished(job)
        page.get_by_text("succeeded").first.wait_for(timeout=60_000)
        page.get_by_role("heading", name="Numbers").wait_for()
        events = [event["seq"] for event in server.events(job)]
        ids = page.evaluate("ids")
        asked = [int(url.rsplit("after_seq=", 1)[1]) for url in tabs.asked if "/events?after_seq=" in url]
        equal(ids[0], min(asked) + 1, "the first event of the stream follows the history")
        equal(ids, list(range(ids[0], events[-1] + 1)), "the ids of the events that the page has received")
        # read again, the page shows the same
        page.reload()
        page.get_by_role("heading", name="Numbers").wait_for()
        page.close()
        return len(ids)


def submitted_and_watched(browser):
    """From the editor to the profile, over an adaptive job whose meshes are told."""
    with Server() as server, browser.at(server) as tabs:
        page = tabs.page("", "There are no jobs yet")
        page.get_by_role("link", name="Try an example").click()
        described(page)
        page.get_by_role("button", name="Submit", exact=True).click()
        page.get_by_role("heading", name='Stress along the contact "top"').wait_for()
        page.get_by_role("heading", name="Error by mesh").wait_for()
        check("Good" in page.inner_text(".verdict"), "the verdict")
        page.go_back()
        page.get_by_role("heading", name="New job").wait_for()
        page.goto(server.url + "/#/jobs")
        page.locator("table.jobs tbody tr").wait_for()

        # steps of a long load are shown while it goes on
        job = server.submit(stepped(60, 100, refine=5), name="long")
        page.get_by_text("1 new").click()
        page.get_by_role("link", name="long").click()
        page.get_by_text("so far").wait_for(timeout=60_000)
        page.locator("#normal-stress canvas").wait_for()
        page.once("dialog", lambda dialog: dialog.accept())
        page.get_by_role("button", name="Cancel").click()
        page.get_by_text("was canceled before it was solved").wait_for()
        equal(server.finished(job)["status"], "canceled", "the job")


def run(browser):
    submitted_and_watched(browser)
