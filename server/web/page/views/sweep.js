/** One sweep: a table that grows, and its numbers over one or two values. */

import { html, nothing, render, svg } from "../vendor/lit-html-3.3.3/lit-html.js";
import { getSurely, newKey, send } from "../api.js";
import { Chart } from "../chart.js";
import * as format from "../format.js";
import * as parts from "../parts.js";
import { address, go } from "../route.js";
import { follow } from "../stream.js";

/** @typedef {import("../types").Sweep} Sweep */
/** @typedef {import("../types").MemberRow} Member */

const NUMBERS = ["normal_force", "tangential_force", "friction_force", "contact_width", "stick_width", "slip_width", "peak_normal_stress", "peak_tangential_stress", "obstacle_indentation", "obstacle_tangential_displacement", "obstacle_tilt", "iterations"];
/** The number of rows of the table that are drawn. */
const SHOWN = 200;
/** The largest number of values on an axis of the map. */
const MOST_CELLS = 60;

/**
 * @param {HTMLElement} root
 * @param {import("../route.js").Route} here
 * @param {import("../app.js").App} app
 * @returns {import("../app.js").Open}
 */
export function open(root, here, app) {
  return new SweepView(root, here, app);
}

class SweepView {
  /** @type {Sweep | null} */
  sweep = null;
  /** @type {Map<number, Member>} */
  members = new Map();
  /** @type {Chart | undefined} */
  chart;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  soon;
  /** @type {(() => void) | undefined} */
  unfollow;
  quantity = "normal_force";
  picked = -1;
  shown = SHOWN;
  /** @type {unknown} */
  error = null;

  /**
   * @param {HTMLElement} root
   * @param {import("../route.js").Route} here
   * @param {import("../app.js").App} app
   */
  constructor(root, here, app) {
    this.root = root;
    this.app = app;
    this.id = here.path[1] ?? "";
    this.closed = new AbortController();
    this.quantity = here.query.get("number") ?? "normal_force";
    this.picked = Number(here.query.get("member") ?? -1);
    render(parts.loading("Loading the sweep"), root);
    this.load();
  }

  close() {
    this.closed.abort();
    this.unfollow?.();
    clearTimeout(this.soon);
    this.chart?.close();
  }

  async load() {
    try {
      this.sweep = await getSurely(`v1/sweeps/${this.id}`, this.closed.signal);
    } catch (error) {
      if (this.closed.signal.aborted) return;
      this.error = error;
      this.draw();
      return;
    }
    this.app.title(this.name());
    this.draw();
    // its events are its rows, past ones first
    this.unfollow = follow((after) => `v1/sweeps/${this.id}/events?after_seq=${after}`, "0", {
      event: (event) => {
        if (event.type === "member") {
          this.members.set(event.member.number, event.member);
          if (this.sweep?.status === "queued") this.sweep = { ...this.sweep, status: "running" };
        }
        else if (event.type === "done") this.sweep = event.sweep;
        this.drawSoon();
      },
      refused: (error) => {
        this.error = error;
        this.drawSoon();
      },
    });
  }

  drawSoon() {
    this.soon ??= setTimeout(() => {
      this.soon = undefined;
      if (!this.closed.signal.aborted) this.draw();
    }, 150);
  }

  name() {
    return this.sweep?.name ?? `sweep …${this.id.slice(-6)}`;
  }

  /** @param {Member} member @param {string} path */
  value(member, path) {
    return /** @type {any} */ (member.parameters)[path];
  }

  draw() {
    const sweep = this.sweep;
    if (!sweep) {
      render(html`<h1>No such sweep</h1>${parts.errorBox(this.error)}<p><a href="#/sweeps">All sweeps</a></p>`, this.root);
      return;
    }
    const rows = [...this.members.values()].sort((a, b) => a.number - b.number);
    const { total } = sweep.members;
    const solved = rows.filter((row) => row.status === "succeeded");
    const names = NUMBERS.filter((name) => solved.some((row) => typeof /** @type {any} */ (row)[name] === "number"));
    const drawable = names.filter((name) => solved.every((row) => hasLimit(row, name)));
    if (drawable.length && !drawable.includes(this.quantity)) this.quantity = drawable[0] ?? "normal_force";
    const poor = solved.filter((row) => row.verdict === "poor").length;
    const ended = ["succeeded", "failed", "canceled"].includes(sweep.status);
    render(
      html`<p class="crumbs"><a href="#/sweeps">Sweeps</a> › ${this.id}</p>
        <div class="head"><h1>${this.name()}</h1>${parts.statusBadge(sweep.status)}
          ${Object.entries(sweep.labels).map(([key, value]) => html`<span class="chip">${key}=${value}</span>`)}<span class="space"></span>
          <a class="button" href="v1/sweeps/${this.id}/results?format=csv" download>CSV</a>
          <a class="button" href="#/jobs?sweep=${this.id}">Its jobs</a>
          ${!ended && this.app.may("cancel") ? html`<button type="button" @click=${() => confirm("Cancel the jobs of this sweep?") && this.act("POST", "/cancel")}>Cancel</button>` : nothing}
          ${ended && this.app.may("cancel") ? html`<button type="button" @click=${() => confirm("Delete this sweep, its jobs and its rows?") && this.act("DELETE", "")}>Delete …</button>` : nothing}
        </div>
        ${this.error ? parts.errorBox(this.error) : nothing}
        <p><progress max=${total} value=${rows.length} aria-label="Members that have ended"></progress>
          <span role="status">${format.count(rows.length)} of ${format.counted(total, "member")}</span>${poor ? html`, <strong>${format.count(poor)} not to be trusted</strong>` : nothing}${rows.length - solved.length ? html`, ${format.count(rows.length - solved.length)} without a solution` : nothing}</p>
        <section class="panel" ?hidden=${!solved.length}><h2>${format.words(this.quantity)}</h2>
          <div class="tools"><label>number <select @change=${(/** @type {Event} */ event) => {
            this.quantity = /** @type {HTMLSelectElement} */ (event.target).value;
            this.remember();
            this.draw();
          }}>${drawable.map((name) => html`<option value=${name} ?selected=${name === this.quantity}>${format.words(name)}</option>`)}</select></label></div>
          ${sweep.paths.length === 2 ? this.drawMap(solved) : nothing}
          <div id="lines" ?hidden=${sweep.paths.length !== 1}></div>
          ${this.drawPicked()}
          <p class="note">The rows state no errors. Solve a member as a job to get the errors of its numbers, its profile and its fields.</p></section>
        <section class="panel"><h2>Table</h2><div class="table-box"><table class="numbers">
          <thead><tr><th scope="col" class="number">n</th>${sweep.paths.map((path) => html`<th scope="col" class="number"><code>${path}</code></th>`)}<th scope="col">status</th><th scope="col">trust</th>${names.map((name) => html`<th scope="col" class="number">${format.words(name)}</th>`)}</tr></thead>
          <tbody>${rows.slice(0, this.shown).map((row) => html`<tr class=${row.number === this.picked ? "picked" : ""}>
            <td class="number"><button type="button" class="link" @click=${() => this.pick(row.number)}>${row.number}</button></td>
            ${sweep.paths.map((path) => html`<td class="number">${shown(this.value(row, path))}</td>`)}
            <td>${parts.statusBadge(row.status)}${row.detail ? html`<span class="note"> ${row.detail}</span>` : nothing}</td>
            <td>${row.verdict ? parts.trustBadge({ verdict: row.verdict, quantities: [], warnings: /** @type {any} */ (row.warnings.map((code) => ({ code }))) }) : html`<span class="note" title="Of the members on one body the first and the last have stated errors">not stated</span>`}</td>
            ${names.map((name) => html`<td class="number">${hasLimit(row, name) ? format.number(/** @type {any} */ (row)[name]) : "no limit"}</td>`)}</tr>`)}</tbody></table></div>
          ${rows.length > this.shown ? html`<p>${format.count(this.shown)} of ${format.count(rows.length)} rows. <button type="button" @click=${() => {
            this.shown += 1000;
            this.draw();
          }}>More</button></p>` : nothing}</section>`,
      this.root,
    );
    if (sweep.paths.length === 1) this.drawLines(solved, sweep.paths[0] ?? "");
  }

  /** @param {number} number */
  pick(number) {
    this.picked = number;
    this.remember();
    this.draw();
  }

  /** Keeps what is chosen in the address. */
  remember() {
    const chosen = { number: this.quantity, ...(this.picked >= 0 ? { member: String(this.picked) } : {}) };
    history.replaceState(null, "", address(`sweeps/${this.id}`, chosen));
  }

  drawPicked() {
    const member = this.members.get(this.picked);
    if (!member) return html`<p class="note">Click a member to look at it.</p>`;
    const values = this.sweep?.paths.map((path) => `${path} = ${shown(this.value(member, path))}`).join(", ");
    return html`<p>Member ${member.number}: ${values}. ${format.words(this.quantity)} ${format.number(/** @type {any} */ (member)[this.quantity])}.
      ${this.app.may("submit")
        ? html`<button type="button" @click=${() => this.solve(member.number)}>Solve it as a job: profile, errors and fields</button> <span class="note">costs a solution</span>`
        : html`<span class="note">Its profile needs a job of its own, for which your token has no scope.</span>`}</p>`;
  }

  /** @param {number} number */
  async solve(number) {
    try {
      /** @type {import("../types").Job} */
      const job = await send("POST", `v1/sweeps/${this.id}/members/${number}/job`, undefined, { "idempotency-key": newKey() });
      location.hash = parts.jobAddress(job.id);
    } catch (error) {
      this.app.say(/** @type {Error} */ (error).message);
    }
  }

  /**
   * @param {string} method
   * @param {string} path
   */
  async act(method, path) {
    try {
      const answer = await send(method, `v1/sweeps/${this.id}${path}`);
      if (method === "DELETE") go("#/sweeps");
      else this.sweep = /** @type {Sweep} */ (answer);
    } catch (error) {
      this.app.say(/** @type {Error} */ (error).message);
    }
    this.draw();
  }

  /**
   * @param {Member[]} rows
   * @param {string} path
   */
  drawLines(rows, path) {
    const points = rows
      .map((row) => [this.value(row, path), /** @type {any} */ (row)[this.quantity]])
      .filter(([x, y]) => typeof x === "number" && typeof y === "number")
      .sort((a, b) => a[0] - b[0]);
    if (points.length < 2) return;
    const place = /** @type {HTMLElement} */ (this.root.querySelector("#lines"));
    const name = format.words(this.quantity);
    if (this.chart?.options.y !== name || this.chart.options.x !== path) {
      this.chart?.close();
      place.replaceChildren();
      this.chart = new Chart(place, { label: `${name} by ${path}`, x: path, y: name, height: 300 });
    }
    this.chart.set([{ label: name, color: "--curve-1", points: points.length < 200, x: points.map(([x]) => x), y: points.map(([, y]) => y) }]);
  }

  /** @param {Member[]} rows */
  drawMap(rows) {
    const [across = "", up = ""] = this.sweep?.paths ?? [];
    const sorted = (/** @type {string} */ path) => [...new Set(rows.map((row) => this.value(row, path)))].sort((a, b) => (typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b))));
    const [xs, ys] = [sorted(across), sorted(up)];
    if (xs.length > MOST_CELLS || ys.length > MOST_CELLS) return html`<p class="note">A map of ${xs.length} × ${ys.length} values is too large to be drawn.</p>`;
    const values = rows.map((row) => /** @type {any} */ (row)[this.quantity]).filter((value) => typeof value === "number");
    const [least, most] = [Math.min(...values), Math.max(...values)];
    const [wide, high] = [Math.max(14, Math.min(110, 760 / xs.length)), Math.max(14, Math.min(44, 400 / ys.length))];
    const cell = (/** @type {Member} */ row) => {
      const [x, y] = [xs.indexOf(this.value(row, across)), ys.indexOf(this.value(row, up))];
      const value = /** @type {any} */ (row)[this.quantity];
      const part = typeof value === "number" ? (value - least) / (most - least || 1) : 0;
      const text = `${across} = ${shown(xs[x])}, ${up} = ${shown(ys[y])}: ${format.number(value)}`;
      return svg`<rect class="cell" tabindex="0" role="button" aria-label=${text} x=${90 + x * wide} y=${10 + (ys.length - 1 - y) * high} width=${wide - 1} height=${high - 1} fill=${color(part)} stroke=${row.number === this.picked ? "var(--text)" : "none"} stroke-width="2"
        @click=${() => this.pick(row.number)} @keydown=${(/** @type {KeyboardEvent} */ event) => ["Enter", " "].includes(event.key) && (event.preventDefault(), this.pick(row.number))}><title>${text}</title></rect>
        ${wide > 56 && high > 20 ? svg`<text class="inside ${part > 0.55 ? "dark" : ""}" x=${90 + (x + 0.5) * wide} y=${14 + (ys.length - 0.5 - y) * high} text-anchor="middle">${format.number(value)}</text>` : nothing}`;
    };
    const every = (/** @type {number} */ count, /** @type {number} */ room) => Math.max(1, Math.ceil(count / room));
    return html`<div class="table-box"><svg class="map" width=${100 + xs.length * wide} height=${60 + ys.length * high} role="group" aria-label="Map of ${this.quantity}">
      ${rows.map(cell)}
      ${xs.map((x, n) => (n % every(xs.length, 8) ? nothing : svg`<text class="tick" x=${90 + (n + 0.5) * wide} y=${26 + ys.length * high} text-anchor="middle">${shown(x)}</text>`))}
      ${ys.map((y, n) => (n % every(ys.length, 12) ? nothing : svg`<text class="tick" x="84" y=${14 + (ys.length - 0.5 - n) * high} text-anchor="end">${shown(y)}</text>`))}
      ${svg`<text class="tick" x=${90 + (xs.length * wide) / 2} y=${46 + ys.length * high} text-anchor="middle">${across}</text>`}
    </svg></div><p class="note">Up: <code>${up}</code>. From ${format.number(least)} (dark) to ${format.number(most)} (light).</p>`;
  }
}

/**
 * Whether a number of a member has a limit on ever finer meshes: at a sharp edge the pressure has none.
 * @param {Member} row
 * @param {string} name
 */
const hasLimit = (row, name) => name !== "peak_normal_stress" || !row.warnings.includes("sharp_edge");

/** @param {unknown} value */
const shown = (value) => (typeof value === "number" ? format.number(value) : typeof value === "string" ? value : JSON.stringify(value ?? null));

/**
 * A colour from dark to light.
 * @param {number} part from 0 to 1
 */
function color(part) {
  const stops = [[38, 69, 107], [46, 125, 143], [117, 184, 128], [232, 217, 115]];
  const at = Math.max(0, Math.min(1, part)) * (stops.length - 1);
  const [low = [], high = []] = [stops[Math.floor(at)], stops[Math.min(stops.length - 1, Math.floor(at) + 1)]];
  return `rgb(${low.map((value, n) => Math.round(value + (at % 1) * ((high[n] ?? 0) - value))).join(",")})`;
}
