"""Every view on a real service: what is shown, and what can be done from it."""

import json
import re

from outside import TOP, Server, check, equal, example, talkative
from browser import described, settled, until

EXAMPLES = ["rectangular_punch", "hertz", "two_bodies", "fretting"]


def submit(server, problem, **more):
    answer = server.call("POST", "/v1/jobs", {"problem": problem, **more})
    check(answer.status in (200, 201, 202), "submit: %r" % answer)
    return answer.json()["id"]


def stepped(steps, increments, **mesh):
    """A load in many steps, each of which is shown when it has ended."""
    return dict(example(**mesh), steps=[{"indentation": (n + 1) / steps, "increments": increments} for n in range(steps)])


def filled(server):
    """Jobs of several kinds; their ids by their names."""
    examples = {found["name"]: found["problem"] for found in server.json("/v1/examples")["examples"]}
    ids = {name: submit(server, examples[name], name=name, labels={"study": "examples"}) for name in EXAMPLES}
    for number in range(4):
        problem = json.loads(json.dumps(examples["rectangular_punch"]))
        problem["contacts"][0]["friction"]["coefficient"] = 0.1 + 0.1 * number
        ids["friction %d" % number] = submit(server, problem, name="friction %d" % number, labels={"study": "friction"})
    ids["fails"] = submit(server, dict(example(), solver={"max_iterations": 1}), name="fails")
    axes = [{"path": "/contacts/0/friction/coefficient", "values": [0.1, 0.2, 0.3]},
            {"path": "/contacts/0/indentation", "values": [0.1, 0.2]}]
    sweep = server.call("POST", "/v1/sweeps", {"base": examples["rectangular_punch"], "axes": axes, "name": "two axes"})
    ids["sweep"] = sweep.json()["id"]
    for name, job in ids.items():
        if name != "sweep":
            server.finished(job)
    until("the sweep ends", lambda: server.json("/v1/sweeps/" + ids["sweep"])["status"] == "succeeded")
    return ids


def list_of_jobs(tabs, server, ids):
    page = tabs.page("#/jobs", "friction 3")
    rows = page.locator("table.jobs tbody tr")
    check(rows.count() >= len(ids), "the rows of the list")
    row = rows.filter(has_text="hertz")
    for shown in ("succeeded", "good", "study=examples", "88.892"):
        check(shown in row.inner_text(), "the row of hertz has %s: %r" % (shown, row.inner_text()))
    check("good, but for one number" in rows.filter(has_text="rectangular_punch").first.inner_text(), "a peak without a limit is told")
    # a label adds a filter, and with shift excludes; the address is the view
    row.get_by_role("link", name="study=examples").click()
    until("only the examples", lambda: rows.count() == len(EXAMPLES))
    check("label.study=examples" in page.url, "the filter is in the address: " + page.url)
    page.go_back()
    until("all rows again", lambda: rows.count() >= len(ids))
    rows.filter(has_text="hertz").get_by_role("link", name="study=examples").click(modifiers=["Shift"])
    until("none of the examples", lambda: rows.filter(has_text="hertz").count() == 0 and rows.count() > 3)
    page.get_by_title("Remove this filter").click()
    search = page.get_by_label("Search jobs")
    search.fill("friction label=no study=friction")
    search.press("Enter")
    page.get_by_text("label = no").wait_for()
    search.fill("study=friction")
    search.press("Enter")
    page.get_by_title("Remove this filter").first.wait_for()
    page.goto(server.url + "/#/jobs?status=failed")
    until("the failed job", lambda: rows.count() == 1 and "fails" in rows.inner_text())

    # what arrives is announced, and moves nothing
    page.goto(server.url + "/#/jobs")
    until("all rows", lambda: rows.count() >= len(ids))
    page.mouse.wheel(0, 200)
    page.hover("table.jobs tbody tr:nth-child(3)")
    third = rows.nth(2).inner_text().split("\n")[0]
    late = submit(server, example("sheet"), name="came late")
    page.get_by_text("1 new").wait_for()
    equal(rows.nth(2).inner_text().split("\n")[0], third, "the row under the pointer")
    page.get_by_text("1 new").click()
    page.get_by_role("link", name="came late").wait_for()
    server.finished(late)
    until("the new row ends", lambda: "succeeded" in rows.filter(has_text="came late").inner_text())

    # all that match are selected and changed, not those of the page alone
    page.goto(server.url + "/#/jobs?label.study=friction")
    until("four rows", lambda: rows.count() == 4)
    page.get_by_label("Select all rows").check()
    page.get_by_text("4 jobs selected").wait_for()
    page.get_by_role("region", name="Selected jobs").get_by_role("link", name="Compare").click()
    page.get_by_role("heading", name="Compare").wait_for()
    page.close()


def finished_job(tabs, server, ids):
    page = tabs.page("#/jobs/" + ids["rectangular_punch"], "Good, but for one number")
    page.get_by_role("heading", name='Stress along the contact "top"').wait_for()
    page.locator("#normal-stress canvas").wait_for()
    page.locator("#tangential-stress canvas").wait_for()
    page.get_by_text("A flat rigid obstacle").wait_for()
    text = page.inner_text("main")
    for shown in ("no limit", "95.278", "0.031", "sticks from s = 0 to 0.418"):
        check(shown in text, "the page of the punch has %r" % shown)
    # values under the pointer and by the keyboard, and as a table
    page.focus("#normal-stress")
    page.keyboard.press("End")
    page.keyboard.press("ArrowLeft")
    told = page.inner_text("#profile-readout")
    check(re.match(r"s = 0\.49\d*: σₙ = −\d", told), "the values under the keyboard: %r" % told)
    page.get_by_text("The values as a table").click()
    check(page.locator("#profile table tbody tr").count() > 50, "the values as a table")
    page.get_by_label("values at").select_option("friction")
    page.locator("#normal-stress canvas").wait_for()
    # fields, and their range
    page.get_by_role("button", name="|u|").click()
    until("the field", lambda: page.get_by_role("button", name="|u|").get_attribute("aria-pressed") == "true")
    settled(page)
    page.get_by_label("to", exact=True).fill("0.1")
    page.keyboard.press("Tab")
    # the same by other programs
    for language, word in (("curl", "curl "), ("command line", "signorini "), ("Python", "import signorini")):
        page.get_by_role("tab", name=language).click()
        check(word in page.inner_text(".code pre"), "the same as " + language)
    with page.expect_download() as downloaded:
        page.get_by_role("link", name="profile top.csv").click()
    check(b"normal_stress" in open(downloaded.value.path(), "rb").read(), "a download")
    page.close()

    page = tabs.page("#/jobs/" + ids["fretting"], "Good: forces")
    page.locator("#normal-stress canvas").wait_for()
    page.get_by_label("load step").fill("10")
    page.get_by_text("(11 of 41)").wait_for()
    page.close()
    page = tabs.page("#/jobs/" + ids["fails"], "The iteration did not converge")
    page.get_by_text("the state at which the job stopped, not a solution").wait_for()
    page.close()
    page = tabs.page("#/jobs/job_01890a5d-ac96-774b-bcce-b302099a8057", "No such job")
    page.close()


#: Which part of the drawing of a body is coloured by a field; the body without one is nearly grey.
COLOURED = """
(() => {
  const drawn = document.querySelector("#drawing canvas");
  const { width, height } = drawn;
  if (!width || !height) return null;
  const context = new OffscreenCanvas(width, height).getContext("2d");
  context.drawImage(drawn, 0, 0);
  const { data } = context.getImageData(0, 0, width, height);
  let coloured = 0;
  for (let n = 0; n < data.length; n += 4) coloured += data[n + 3] > 0 && Math.max(data[n], data[n + 1], data[n + 2]) - Math.min(data[n], data[n + 1], data[n + 2]) > 60;
  return coloured / (width * height);
})()
"""
#: The start of a worker in a browser without WebGL2.
WITHOUT_WEBGL = """
const { getContext } = OffscreenCanvas.prototype;
OffscreenCanvas.prototype.getContext = function (kind, ...more) { return kind === "webgl2" ? null : getContext.call(this, kind, ...more); };
"""


def drawn_body(tabs, server, ids):
    def opened():
        page = tabs.page("#/jobs/" + ids["rectangular_punch"], "Good, but for one number")
        page.get_by_role("button", name="von Mises").wait_for()
        return page

    page = opened()
    until("the colours of a field", lambda: (page.evaluate(COLOURED) or 0) > 0.1)
    page.get_by_role("button", name="as asked").click()
    until("a body without a field", lambda: page.evaluate(COLOURED) == 0)
    page.close()

    def plain(route):
        answer = route.fetch()
        route.fulfill(response=answer, body=WITHOUT_WEBGL + answer.text())
    tabs.context.route("**/painter.js", plain)
    page = opened()
    until("the colours of a field without WebGL2", lambda: (page.evaluate(COLOURED) or 0) > 0.1)
    page.close()
    tabs.context.unroute("**/painter.js")

    tabs.context.route("**/painter.js", lambda route: route.fulfill(status=404))
    page = opened()
    page.get_by_text("The body cannot be drawn. Load the page again.").wait_for()
    page.close()
    tabs.context.unroute("**/painter.js")


def new_job(tabs, server, ids):
    page = tabs.page("#/new", "An elastic body")
    page.locator("#picture canvas").first.wait_for()
    editor = page.get_by_label("The problem as JSON")
    # a violation has its line
    text = editor.input_value()
    at = text.index('"boundary": "left"')
    editor.fill(text.replace('"boundary": "left"', '"boundary": "lef"'))
    found = page.get_by_role("button", name=re.compile("line 15.*boundary", re.S))
    found.wait_for()
    check("left" in found.inner_text(), "the violation proposes what is there: " + found.inner_text())
    check(page.locator(".pce-line.faulty").count() == 1, "the line is marked")
    editor.fill(text[:at])
    page.get_by_text("The text is no JSON").wait_for()
    check(page.get_by_role("button", name="Submit", exact=True).is_disabled(), "a text that is no JSON is not submitted")
    editor.fill(text)
    # what people change
    page.get_by_label("coefficient μ").fill("0.25")
    page.keyboard.press("Tab")
    until("the text follows", lambda: '"coefficient": 0.25' in editor.input_value())
    for wrong in ("0,3", "abc", "0.1:0.3"):
        page.get_by_label("coefficient μ").fill(wrong)
        page.keyboard.press("Tab")
        page.locator(".fault").wait_for()
        check(page.get_by_role("button", name="Submit", exact=True).is_disabled(), "%r is not taken for a number" % wrong)
    page.get_by_label("coefficient μ").fill("0.1, 0.2")
    page.keyboard.press("Tab")
    page.get_by_role("button", name="Submit a sweep of 2").click()
    page.get_by_role("heading", name="sweep").first.wait_for()
    until("its members", lambda: "2 of 2 members" in page.inner_text("main"))

    # a mesh, a deck, a problem: each from a file
    page.goto(server.url + "/#/new")
    described(page)
    page.set_input_files("input[type=file]", TOP / "tests/data/gmsh/fillet-tri6-msh22-ascii.msh")
    page.get_by_text("The mesh is stored").wait_for()
    until("the mesh in the text", lambda: '"stored": "sha256:' in editor.input_value())
    settled(page)
    box = page.locator("#picture canvas").first.bounding_box()
    for step in range(1, 40):  # from the left, until a boundary is under the pointer
        page.mouse.click(box["x"] + box["width"] * step / 40, box["y"] + box["height"] / 2)
        if page.get_by_role("button", name="press on it").count():
            break
    page.get_by_role("button", name="hold it").click()
    until("the support in the text", lambda: '"ux": 0' in editor.input_value())
    deck = TOP / "tests/data/decks/page.inp"
    page.set_input_files("input[type=file]", deck)
    until("the deck as a problem", lambda: '"pressure": 1' in editor.input_value())
    # submitted with a name and labels, watched, and there
    page.get_by_label("Name", exact=True).fill("from a deck")
    page.get_by_label("Labels").fill("kind=deck")
    page.get_by_role("button", name="Submit", exact=True).click()
    page.get_by_role("heading", name="from a deck").wait_for()
    page.get_by_text("kind=deck").wait_for()
    until("it ends", lambda: "succeeded" in page.inner_text(".head"))
    page.get_by_role("link", name="Edit and submit again").click()
    page.get_by_role("heading", name="New job").wait_for()
    until("the problem again", lambda: '"pressure": 1' in editor.input_value())
    page.close()


def comparison(tabs, server, ids):
    page = tabs.page("#/compare?label.study=friction", "4 profiles")
    text = page.inner_text("main")
    check("/contacts/0/friction/coefficient" in text and "/mesh" not in text, "only what differs is shown")
    page.locator("#normal canvas").wait_for()
    with page.expect_download() as downloaded:
        page.get_by_role("button", name="Save as SVG").click()
    svg = open(downloaded.value.path(), encoding="utf-8").read()
    equal(svg.count("<polyline"), 8, "the curves of the figure")
    page.get_by_role("radio").nth(2).check()
    until("changes against the baseline", lambda: page.inner_text("table").count("%") or page.inner_text("main").count(" %") > 5)
    with page.expect_download() as downloaded:
        page.get_by_role("link", name="CSV").click()
    check(b"/contacts/0/friction/coefficient" in open(downloaded.value.path(), "rb").read(), "the table")
    page.close()


def sweeps(tabs, server, ids):
    page = tabs.page("#/sweeps", "two axes")
    page.get_by_role("link", name="two axes").click()
    page.get_by_text("6 of 6 members").wait_for()
    cells = page.locator("svg.map rect.cell")
    equal(cells.count(), 6, "the cells of the map")
    check("no limit" in page.inner_text("main"), "a peak without a limit is no number")
    cells.nth(2).click()
    page.get_by_text("Member 2:").wait_for()
    page.get_by_role("button", name=re.compile("Solve it as a job")).click()
    page.get_by_role("heading", name="Numbers").wait_for()
    page.close()


def queue(tabs, server, ids):
    page = tabs.page("#/queue", "Pause the queue")
    page.get_by_role("button", name="Pause the queue").click()
    page.get_by_role("button", name="Resume").wait_for()
    job = submit(server, example("sheet"), name="waits here", cache="off")
    page.get_by_role("link", name="waits here").wait_for()
    check("paused" in page.inner_text("main"), "why it waits")
    page.get_by_role("button", name="Resume").click()
    page.get_by_text("Nothing waits.").wait_for()
    server.finished(job)
    slow = submit(server, talkative(2000, refine=5), name="runs here")
    page.get_by_role("link", name="runs here").wait_for()
    page.get_by_role("link", name="runs here").click()
    page.once("dialog", lambda dialog: dialog.accept())
    page.get_by_role("button", name="Cancel").click()
    until("it is canceled", lambda: "canceled" in page.inner_text(".head"))
    page.get_by_text("was canceled before it was solved").wait_for()
    equal(server.finished(slow)["status"], "canceled", "the job")
    page.close()


def run(browser):
    with Server() as server:
        ids = filled(server)
        with browser.at(server) as tabs:
            for view in (list_of_jobs, finished_job, drawn_body, new_job, comparison, sweeps, queue):
                view(tabs, server, ids)
