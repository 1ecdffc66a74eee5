/** The list of jobs: filters, counts, rows that change under the eyes, and what can be done with many at once. */

import { html, nothing, render } from "../vendor/lit-html-3.3.3/lit-html.js";
import { repeat } from "../vendor/lit-html-3.3.3/directives/repeat.js";
import { ApiError, getSurely, send } from "../api.js";
import * as format from "../format.js";
import * as parts from "../parts.js";
import { address, go } from "../route.js";
import { follow } from "../stream.js";

/** @typedef {import("../types").Job} Job */
/** @typedef {import("../app.js").App} App */

/** The fields of a row. */
const FIELDS =
  "id,status,reason,name,labels,owner,verdict,quantities,warnings,progress,queue,created_at,finished_at,started_at,run_s,sweep,pinned,cached_from,attempt,cancel_requested,version,result_available";

/** The filters of the service that the address of this view may have. */
const FILTERS = ["text", "status", "owner", "name", "name_contains", "verdict", "warning", "sweep", "parent", "pinned", "created_after", "created_before", "finished_after", "finished_before", "input_hash"];

const STATUSES = ["running", "queued", "succeeded", "failed", "canceled"];

/** @type {[string, string][]} */
const ORDERS = [
  ["", "newest first"],
  ["created_at asc", "oldest first"],
  ["finished_at desc", "ended last first"],
  ["run_s desc", "longest first"],
  ["run_s asc", "shortest first"],
];

const PAGE = 50;

/**
 * @param {HTMLElement} root
 * @param {import("../route.js").Route} first
 * @param {App} app
 * @returns {import("../app.js").Open}
 */
export function open(root, first, app) {
  return new JobList(root, first, app);
}

class JobList {
  /** @type {Job[]} */
  rows = [];
  /** Rows that are no longer in the list. @type {Set<string>} */
  gone = new Set();
  /** Jobs that were accepted since the list was read. @type {Set<string>} */
  fresh = new Set();
  /** @type {import("../types").Count | null} */
  counts = null;
  /** @type {Set<string>} */
  selected = new Set();
  /** Whether all jobs that match are selected, also those that are not shown. */
  all = false;
  /** The row that the keyboard is at. */
  at = -1;
  /** @type {string | null} */
  next = null;
  stale = true;
  /** @type {unknown} */
  error = null;
  /** @type {[string, number][]} */
  keys = [];
  closed = new AbortController();
  /** @type {(() => void) | null} */
  unfollow = null;
  /** Whether the stream has begun, after which the list is read: nothing that changes meanwhile is missed. */
  begun = false;
  /** What was told of jobs while the list was read. @type {any[]} */
  early = [];
  due = 0;
  asking = false;

  /**
   * @param {HTMLElement} root
   * @param {import("../route.js").Route} here
   * @param {App} app
   */
  constructor(root, here, app) {
    this.root = root;
    this.app = app;
    this.query = here.query;
    this.onKey = (/** @type {KeyboardEvent} */ event) => this.key(event);
    document.addEventListener("keydown", this.onKey);
    this.clock = setInterval(() => this.draw(), 5000);
    app.title("Jobs");
    this.read();
  }

  /** @param {import("../route.js").Route} here */
  update(here) {
    if (here.query.toString() === this.query.toString()) return;
    this.query = here.query;
    this.read();
  }

  close() {
    this.closed.abort();
    this.unfollow?.();
    clearInterval(this.clock);
    document.removeEventListener("keydown", this.onKey);
  }

  /** The filters in the address. */
  filters() {
    const filters = new URLSearchParams();
    for (const [name, value] of this.query) {
      if (FILTERS.includes(name) || name.startsWith("label.")) filters.append(name, value);
    }
    return filters;
  }

  /** Reads the list anew, and follows it from before that moment. */
  async read() {
    this.closed.abort();
    this.unfollow?.();
    const closed = (this.closed = new AbortController());
    Object.assign(this, { stale: true, error: null, all: false, at: -1, counts: null, begun: false, early: [] });
    this.selected.clear();
    this.draw();
    const filters = this.filters();
    const query = new URLSearchParams(filters);
    query.set("fields", FIELDS);
    this.unfollow = follow((after) => `v1/events?${query}${after ? `&after=${encodeURIComponent(after)}` : ""}`, "", {
      event: (data) => this.told(data),
      refused: (error) => this.failed(error),
    });
  }

  async readRows() {
    const closed = this.closed;
    const query = this.filters();
    query.set("fields", FIELDS);
    try {
      const rows = await this.page(query, this.query.get("page_token") ?? "", closed.signal);
      if (closed.signal.aborted) return;
      Object.assign(this, { rows, stale: false });
      this.gone.clear();
      this.fresh.clear();
      this.early.splice(0).forEach((event) => this.told(event));
      this.draw();
      this.readKeys(closed.signal);
    } catch (error) {
      if (!closed.signal.aborted) this.failed(error);
    }
  }

  /**
   * A page of rows; the service may check many jobs for few rows, and is then asked again.
   * @param {URLSearchParams} filters
   * @param {string} token
   * @param {AbortSignal} signal
   */
  async page(filters, token, signal) {
    /** @type {Job[]} */
    const rows = [];
    const query = new URLSearchParams(filters);
    const order = this.query.get("order_by");
    if (order) query.set("order_by", order);
    do {
      query.set("page_size", String(PAGE - rows.length));
      query.set("page_token", token);
      /** @type {import("../types").JobList} */
      const page = await getSurely(`v1/jobs?${query}`, signal);
      rows.push(...page.jobs);
      token = page.next_page_token ?? "";
    } while (token && rows.length < PAGE);
    this.next = token || null;
    return rows;
  }

  /** @param {AbortSignal} signal */
  async readKeys(signal) {
    /** @type {import("../types").Count} */
    const count = await getSurely("v1/jobs/count?group_by=label", signal).catch(() => ({ total: 0, groups: {} }));
    this.keys = Object.entries(count.groups).sort((a, b) => b[1] - a[1]);
    this.draw();
  }

  /** @param {unknown} error */
  failed(error) {
    if (error instanceof ApiError && error.status === 401) return;
    this.error = error;
    this.stale = false;
    this.draw();
  }

  /** @param {any} event of the stream of the list */
  told(event) {
    if (!this.begun && event.type !== "reset") {
      this.begun = true;
      this.readRows();
    }
    if (this.stale && ["job", "removed"].includes(event.type)) {
      this.early.push(event);
      return;
    }
    switch (event.type) {
      case "reset":
        this.read();
        return;
      case "counts":
        this.counts = event.counts;
        break;
      case "job": {
        const place = this.rows.findIndex((row) => row.id === event.job.id);
        if (place >= 0) {
          if (event.job.version >= (this.rows[place]?.version ?? 0)) this.rows[place] = event.job;
          this.gone.delete(event.job.id);
        } else if (!this.stale && this.isNew(event.job)) {
          this.fresh.add(event.job.id);
        }
        break;
      }
      case "removed":
        this.fresh.delete(event.id);
        if (this.rows.some((row) => row.id === event.id)) this.gone.add(event.id);
        break;
      case "queue":
        if (this.rows.some((row) => row.status === "queued")) this.readWaiting();
        break;
    }
    this.drawSoon();
  }

  /** Draws once for all that is told at a time. */
  drawSoon() {
    this.due ||= requestAnimationFrame(() => {
      this.due = 0;
      this.draw();
    });
  }

  /** @param {Job} job that is not in the list */
  isNew(job) {
    const newest = this.rows[0]?.created_at ?? "";
    return !this.query.get("page_token") && !this.query.get("order_by") && job.created_at >= newest;
  }

  /** Reads the places of waiting rows again, which change when other jobs start. */
  async readWaiting() {
    if (this.asking) return;
    this.asking = true;
    const waiting = this.rows.filter((row) => row.status === "queued").map((row) => row.id);
    const query = new URLSearchParams({ fields: FIELDS, page_size: String(PAGE) });
    waiting.forEach((id) => query.append("id", id));
    const closed = this.closed.signal;
    /** @type {import("../types").JobList} */
    const page = await getSurely(`v1/jobs?${query}`, closed).catch(() => ({ jobs: [], next_page_token: null }));
    this.asking = false;
    for (const job of page.jobs) {
      const place = this.rows.findIndex((row) => row.id === job.id);
      if (place >= 0 && job.version >= (this.rows[place]?.version ?? 0)) this.rows[place] = job;
    }
    this.draw();
  }

  /**
   * Goes to the list with another filter.
   * @param {(query: URLSearchParams) => void} change
   */
  goTo(change) {
    go(this.to(change));
  }

  /** @param {(query: URLSearchParams) => void} change */
  to(change) {
    const query = new URLSearchParams(this.query);
    query.delete("page_token");
    change(query);
    return address("jobs", query);
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const target = /** @type {HTMLElement} */ (event.target);
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (target.closest("input:not([type=checkbox]), textarea, select")) return;
    const row = this.rows[this.at];
    switch (event.key) {
      case "j":
        this.at = Math.min(this.rows.length - 1, this.at + 1);
        break;
      case "k":
        this.at = Math.max(0, this.at - 1);
        break;
      case "x":
        if (row) this.select(row.id, !this.selected.has(row.id));
        break;
      case "Enter":
        if (!row || target.closest("a, button")) return;
        location.hash = parts.jobAddress(row.id);
        break;
      case "/":
        this.root.querySelector("input")?.focus();
        break;
      default:
        return;
    }
    event.preventDefault();
    this.draw();
    this.root.querySelector("tr.at")?.scrollIntoView({ block: "nearest" });
  }

  /**
   * @param {string} id
   * @param {boolean} on
   */
  select(id, on) {
    this.all = false;
    if (on) this.selected.add(id);
    else this.selected.delete(id);
    this.draw();
  }

  /** The filters of what is selected. */
  selectedFilters() {
    if (this.all) return this.filters();
    return new URLSearchParams([...this.selected].map((id) => ["id", id]));
  }

  /**
   * @param {"cancel" | "delete"} what
   */
  async change(what) {
    const filters = this.selectedFilters();
    const many = this.all ? (this.total() ?? 0) : this.selected.size;
    // not those that are accepted after the question
    if (this.all && !filters.has("created_before")) filters.append("created_before", this.newest());
    const done = what === "cancel" ? "cancel" : "delete";
    if (!confirm(`Really ${done} ${format.counted(many, "job")}?${what === "delete" ? " Their results are lost." : ""}`)) return;
    try {
      const path = what === "cancel" ? `v1/jobs/cancel?${filters}` : `v1/jobs?${filters}`;
      /** @type {import("../types").Many} */
      const answer = await send(what === "cancel" ? "POST" : "DELETE", path);
      const word = what === "cancel" ? "are being canceled" : "were deleted";
      this.app.say(`${format.count(answer.changed)} of ${format.counted(answer.matched, "job")} ${word}.`);
      this.selected.clear();
      this.all = false;
      if (what === "delete") return this.read();
    } catch (error) {
      this.app.say(String(/** @type {Error} */ (error).message));
    }
    this.draw();
  }

  /** The moment after the newest job that may be seen: in another order than that of their age, now. */
  newest() {
    const newest = this.query.get("order_by") ? Date.now() : Math.max(...this.rows.map((row) => Date.parse(row.created_at)));
    return new Date(newest + 1).toISOString();
  }

  total() {
    const wanted = (this.query.getAll("status").join(",") || "").split(",").filter(Boolean);
    if (!this.counts) return null;
    const groups = this.counts.groups;
    return wanted.length ? wanted.reduce((sum, status) => sum + (groups[status] ?? 0), 0) : this.counts.total;
  }

  draw() {
    if (this.root.isConnected || this.stale) render(this.drawn(), this.root);
  }

  drawn() {
    return html`<h1>Jobs</h1>
      ${this.drawCounts()} ${this.drawFilters()} ${this.drawSelection()}
      ${this.error ? parts.errorBox(this.error, () => this.read()) : nothing}
      ${this.fresh.size
        ? html`<button type="button" class="fresh" title="Show them" @click=${() => this.read()}>${format.counted(this.fresh.size, "new job")} ↑</button>`
        : nothing}
      ${this.rows.length || this.stale ? this.drawTable() : this.drawNothing()} ${this.drawEnd()}`;
  }

  drawCounts() {
    const wanted = this.query.getAll("status").join(",").split(",").filter(Boolean);
    const groups = this.counts?.groups ?? {};
    const toggle = (/** @type {string} */ status) => (/** @type {URLSearchParams} */ query) => {
      const others = wanted.includes(status) ? wanted.filter((other) => other !== status) : [...wanted, status];
      query.delete("status");
      if (others.length) query.set("status", others.join(","));
    };
    return html`<div class="counts" role="group" aria-label="Status">
      <a class="chip ${wanted.length ? "" : "on"}" href=${this.to((query) => query.delete("status"))}>all ${this.counts ? format.count(this.counts.total) : ""}</a>
      ${STATUSES.map(
        (status) => html`<a href=${this.to(toggle(status))} aria-pressed=${wanted.includes(status)} role="button" class="${wanted.includes(status) ? "on" : ""}">
          ${parts.statusBadge(status, html` ${this.counts ? format.count(groups[status] ?? 0) : ""}`)}</a>`,
      )}
    </div>`;
  }

  drawFilters() {
    /** @type {[string, string][]} */
    const chips = [...this.filters()].filter(([name]) => !["text", "status"].includes(name));
    const remove = (/** @type {[string, string]} */ [name, value]) =>
      this.to((query) => {
        const others = query.getAll(name).filter((other) => other !== value);
        query.delete(name);
        others.forEach((other) => query.append(name, other));
      });
    const shown = (/** @type {[string, string]} */ [name, value]) =>
      name.startsWith("label.")
        ? `${name.slice(6).replace(/!$/, "")} ${name.endsWith("!") ? "≠" : "="} ${value}`
        : `${format.words(name)}: ${value}`;
    const admin = this.app.may("admin") && this.app.me.owner !== "local";
    return html`<form class="filters" role="search" @submit=${(/** @type {SubmitEvent} */ event) => {
        event.preventDefault();
        const text = /** @type {HTMLInputElement} */ (/** @type {HTMLFormElement} */ (event.target).elements.namedItem("text")).value;
        this.search(text);
        /** @type {HTMLFormElement} */ (event.target).reset();
        this.draw();
      }}>
      <input type="search" name="text" aria-label="Search jobs" placeholder="words, label=value, label!=value; Enter" .value=${this.query.get("text") ?? ""} list="label-keys"
        @keydown=${(/** @type {KeyboardEvent} */ event) => event.key === "Escape" && this.goTo((query) => query.delete("text"))} />
      <datalist id="label-keys">${this.keys.map(([key, jobs]) => html`<option value="${key}=">${jobs} jobs</option>`)}</datalist>
      ${chips.map((chip) => html`<a class="chip on" href=${remove(chip)} title="Remove this filter">${shown(chip)} <span aria-hidden="true">×</span></a>`)}
      <label class="quiet">Trust <select @change=${(/** @type {Event} */ event) => {
        const value = /** @type {HTMLSelectElement} */ (event.target).value;
        this.goTo((query) => (value ? query.set("verdict", value) : query.delete("verdict")));
      }}>${[["", "any"], ["good", "good"], ["fair", "fair"], ["poor", "do not use"]].map(([value, word]) => html`<option value=${value ?? ""} ?selected=${(this.query.get("verdict") ?? "") === value}>${word}</option>`)}</select></label>
      <label class="quiet"><span class="hidden">Order</span> <select @change=${(/** @type {Event} */ event) => {
        const value = /** @type {HTMLSelectElement} */ (event.target).value;
        this.goTo((query) => (value ? query.set("order_by", value) : query.delete("order_by")));
      }}>${ORDERS.map(([value, word]) => html`<option value=${value} ?selected=${(this.query.get("order_by") ?? "") === value}>${word}</option>`)}</select></label>
      ${admin
        ? html`<label class="quiet"><input type="checkbox" .checked=${!this.query.get("owner")} @change=${(/** @type {Event} */ event) => {
            const all = /** @type {HTMLInputElement} */ (event.target).checked;
            this.goTo((query) => (all ? query.delete("owner") : query.set("owner", this.app.me.owner)));
          }} /> all owners</label>`
        : nothing}
    </form>`;
  }

  /** @param {string} text what was typed: words, and filters such as label=value */
  search(text) {
    const words = text.split(/\s+/).filter(Boolean);
    /** @type {string[]} */
    const rest = [];
    this.goTo((query) => {
      query.delete("text");
      for (const word of words) {
        const found = /^([^=!]+)(!?)=(.+)$/.exec(word);
        if (!found) {
          rest.push(word);
          continue;
        }
        const [, key = "", not = "", value = ""] = found;
        const name = key.replace(/^label\./, "");
        if (FILTERS.includes(name) && not) this.app.say(`${name} cannot be excluded: only labels can.`);
        else if (FILTERS.includes(name)) query.set(name, value);
        else if (!query.getAll(`label.${name}${not}`).includes(value)) query.append(`label.${name}${not}`, value);
      }
      if (rest.length) query.set("text", rest.join(" "));
    });
  }

  drawSelection() {
    const count = this.all ? this.total() : this.selected.size;
    if (!count) return nothing;
    const total = this.total();
    const shown = this.rows.length > 0 && this.rows.every((row) => this.selected.has(row.id));
    const compare = this.all ? address("compare", this.filters()) : address("compare", { ids: [...this.selected].join(",") });
    return html`<div class="selection" role="region" aria-label="Selected jobs">
      <strong>${format.counted(count, "job")} selected</strong>
      ${!this.all && shown && total !== null && total > this.selected.size
        ? html`<button type="button" class="link" @click=${() => {
            this.all = true;
            this.draw();
          }}>Select all ${format.count(total)} that match</button>`
        : nothing}
      <a class="button" href=${compare}>Compare</a>
      ${this.app.may("cancel")
        ? html`<button type="button" @click=${() => this.change("cancel")}>Cancel</button>
            <button type="button" @click=${() => this.change("delete")}>Delete …</button>`
        : nothing}
      <button type="button" class="link" @click=${() => {
        this.selected.clear();
        this.all = false;
        this.draw();
      }}>Clear</button>
    </div>`;
  }

  drawTable() {
    const all = this.rows.length > 0 && this.rows.every((row) => this.selected.has(row.id));
    return html`<div class="table-box ${this.stale ? "stale" : ""}"><table class="jobs">
      <caption class="hidden">Jobs</caption>
      <thead><tr>
        <th scope="col"><input type="checkbox" aria-label="Select all rows" .checked=${all} @change=${(/** @type {Event} */ event) => {
          const on = /** @type {HTMLInputElement} */ (event.target).checked;
          this.rows.forEach((row) => this.select(row.id, on));
        }} /></th>
        <th scope="col">Status</th><th scope="col">Name</th><th scope="col" class="wide">Labels</th><th scope="col">Trust</th>
        <th scope="col">Convergence</th><th scope="col" class="number wide">Normal force</th><th scope="col" class="number wide"><a href=${this.to((query) => query.set("order_by", this.query.get("order_by") === "run_s desc" ? "run_s asc" : "run_s desc"))}>Ran</a></th>
        <th scope="col" class="number wide"><a href=${this.to((query) => (this.query.get("order_by") === "created_at asc" ? query.delete("order_by") : query.set("order_by", "created_at asc")))}>Age</a></th>${this.app.me.owner === "local" ? nothing : html`<th scope="col" class="wide">Owner</th>`}
      </tr></thead>
      <tbody>${repeat(this.rows, (/** @type {Job} */ row) => row.id, (/** @type {Job} */ row, /** @type {number} */ place) => this.drawRow(row, place))}</tbody>
    </table></div>`;
  }

  /**
   * @param {Job} job
   * @param {number} place
   */
  drawRow(job, place) {
    const picked = this.all || this.selected.has(job.id);
    const gone = this.gone.has(job.id);
    const label = (/** @type {string} */ key, /** @type {string} */ value, /** @type {boolean} */ exclude) =>
      this.to((query) => {
        const name = `label.${key}${exclude ? "!" : ""}`;
        if (!query.getAll(name).includes(value)) query.append(name, value);
      });
    const running = job.status === "running";
    const since = running && job.started_at ? (Date.now() - Date.parse(job.started_at)) / 1000 : job.run_s;
    return html`<tr class="${picked ? "picked" : ""} ${gone ? "gone" : ""} ${place === this.at ? "at" : ""}">
      <td><input type="checkbox" aria-label="Select ${job.name ?? job.id}" .checked=${picked} @change=${(/** @type {Event} */ event) =>
        this.select(job.id, /** @type {HTMLInputElement} */ (event.target).checked)} /></td>
      <td class="status">${parts.statusBadge(job.status)}${job.attempt > 1 ? html`<span class="note" title="It was started ${job.attempt} times"> ×${job.attempt}</span>` : nothing}</td>
      <td class="name"><a href=${parts.jobAddress(job.id)}>${job.name ?? shortId(job.id)}</a>${job.pinned ? html` <span title="Pinned: it is kept, however old" role="img" aria-label="pinned">★</span>` : nothing}
        ${job.sweep ? html`<a class="chip" href=${address(`sweeps/${job.sweep}`)}>sweep</a>` : nothing}</td>
      <td class="labels">${parts.labelChips(job.labels, label)}</td>
      <td class="trust">${gone ? html`<span class="note">no longer in this list</span>` : parts.trustBadge(job)}</td>
      <td class="curve">${this.drawConvergence(job)}</td>
      <td class="number force">${parts.mainNumber(job)}</td>
      <td class="number ran">${format.duration(since)}</td>
      <td class="number age">${parts.age(job.created_at)}</td>
      ${this.app.me.owner === "local" ? nothing : html`<td class="owner">${job.owner}</td>`}
    </tr>`;
  }

  /** @param {Job} job */
  drawConvergence(job) {
    if (job.status === "queued") return html`<span class="note">${format.waits(job.queue)}</span>`;
    if (job.status === "canceled") return html`<span class="note">canceled</span>`;
    const curve = parts.sparkline(job.progress);
    if (job.status === "failed" && curve === nothing) return html`<span class="note">${format.words(job.reason ?? "failed")}</span>`;
    if (job.cached_from) return html`<span class="note">answered from an earlier result</span>`;
    if (job.status === "running" && curve === nothing) {
      const mesh = job.progress?.mesh ? `, mesh ${job.progress.mesh}` : "";
      return html`<span class="note">${job.cancel_requested ? "is being canceled" : `${job.progress?.stage ?? "starts"}${mesh}`}</span>`;
    }
    return curve;
  }

  drawNothing() {
    if (this.filters().toString()) return html`<p class="empty">No job matches. <a href="#/jobs">Show all jobs</a></p>`;
    return html`<section class="empty"><h2>There are no jobs yet</h2>
      ${this.app.may("submit") ? html`<p><a class="button primary" href=${address("new")}>Try an example</a></p>` : nothing}
      ${this.app.may("submit") ? html`<p>Or from a shell: <code>signorini submit problem.json --watch</code></p>` : html`<p>You see the jobs of ${this.app.me.owner} alone, and your token may not submit any.</p>`}</section>`;
  }

  drawEnd() {
    const total = this.total();
    const token = this.query.get("page_token");
    return html`<footer class="list-end">
      <span>${this.rows.length ? html`${format.counted(this.rows.length, "row")}${total === null ? nothing : ` of ${format.count(total)}`}` : nothing}</span>
      ${token ? html`<button type="button" @click=${() => history.back()}>Newer ↑</button>` : nothing}
      ${this.next
        ? html`<a class="button" href=${address("jobs", withToken(this.query, this.next))}>Older ↓</a>`
        : nothing}
      <span class="space"></span>
      <span class="note keys">Keys: <kbd>j</kbd> <kbd>k</kbd> move, <kbd>x</kbd> select, <kbd>Enter</kbd> open, <kbd>/</kbd> search, <kbd>n</kbd> new</span>
    </footer>`;
  }
}

/**
 * @param {URLSearchParams} query
 * @param {string} token
 */
function withToken(query, token) {
  const next = new URLSearchParams(query);
  next.set("page_token", token);
  return next;
}

/** @param {string} id */
const shortId = (id) => `${id.slice(0, 12)}…${id.slice(-4)}`;
