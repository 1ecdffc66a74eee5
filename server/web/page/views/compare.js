/** Many jobs beside one another: their profiles in one figure, their numbers in a table and as points, and only what differs. */

import { html, nothing, render } from "../vendor/lit-html-3.3.3/lit-html.js";
import { getSurely } from "../api.js";
import { Chart, robustRange } from "../chart.js";
import * as format from "../format.js";
import * as parts from "../parts.js";

/** @typedef {import("../types").ContactProfile} ContactProfile */
/** @typedef {Record<string, any>} TableRow */

/** The number of jobs whose profiles are laid over one another. */
const MOST_CURVES = 200;
/** The number of rows that are read. */
const MOST_ROWS = 10_000;
/** The number of rows of the table that are drawn. */
const SHOWN = 200;

const NUMBERS = ["normal_force", "tangential_force", "friction_force", "peak_normal_stress", "peak_tangential_stress", "run_s"];
const COLUMNS = ["id", "name", "status", "verdict", "without_limit", "contacts", "run_s", ...NUMBERS.slice(0, 5).flatMap((name) => [name, `${name}_error`])];
const COLORS = ["--curve-1", "--curve-2", "--curve-3", "--curve-4"];

/**
 * @param {HTMLElement} root
 * @param {import("../route.js").Route} here
 * @param {import("../app.js").App} app
 * @returns {import("../app.js").Open}
 */
export function open(root, here, app) {
  return new CompareView(root, here, app);
}

class CompareView {
  /** @type {TableRow[]} */
  rows = [];
  /** @type {string[]} */
  columns = [];
  /** Profiles by the ids of their jobs. @type {Map<string, ContactProfile>} */
  profiles = new Map();
  /** @type {Chart | undefined} */
  chart;
  /** @type {Chart | undefined} */
  tangential;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  soon;
  more = false;
  boundary = "";
  x = "";
  y = "normal_force";
  /** The job that the others are compared with. */
  baseline = "";
  loading = "";
  shown = SHOWN;
  /** @type {unknown} */
  error = null;
  pointed = "";

  /**
   * @param {HTMLElement} root
   * @param {import("../route.js").Route} here
   * @param {import("../app.js").App} app
   */
  constructor(root, here, app) {
    this.root = root;
    this.app = app;
    this.closed = new AbortController();
    app.title("Compare");
    this.update(here);
  }

  /** @param {import("../route.js").Route} here */
  update(here) {
    this.closed.abort();
    this.closed = new AbortController();
    this.query = new URLSearchParams(here.query);
    this.read();
  }

  close() {
    this.closed.abort();
    this.chart?.close();
    this.tangential?.close();
  }

  /** The filters of the table. */
  filters() {
    const filters = new URLSearchParams(this.query);
    const ids = filters.get("ids");
    for (const name of ["ids", "order_by", "page_token", "x", "y"]) filters.delete(name);
    if (ids) filters.set("id", ids);
    if (!filters.toString()) filters.set("status", "succeeded");
    return filters;
  }

  async read() {
    const { signal } = this.closed;
    Object.assign(this, { rows: [], columns: [], loading: "Reading the table", error: null });
    this.profiles.clear();
    this.draw();
    const query = this.filters();
    query.set("columns", COLUMNS.join(","));
    query.set("differing", "true");
    query.set("format", "json");
    try {
      let token = "";
      do {
        query.set("page_token", token);
        /** @type {import("../types").JobTable} */
        const page = await getSurely(`v1/jobs/table?${query}`, signal);
        this.rows.push(...page.rows);
        this.columns = [...new Set([...this.columns, ...page.columns])];
        token = page.next_page_token ?? "";
        this.loading = `${format.counted(this.rows.length, "row")} read`;
        this.draw();
      } while (token && this.rows.length < MOST_ROWS);
      this.more = Boolean(token);
      this.loading = "";
      this.x = this.parameters().find((name) => this.isNumber(name)) ?? "run_s";
      this.baseline = this.rows[0]?.id ?? "";
      this.boundary = this.contacts()[0] ?? "";
      this.draw();
      await this.readProfiles();
    } catch (error) {
      if (signal.aborted) return;
      Object.assign(this, { error, loading: "" });
      this.draw();
    }
  }

  /** The values in which the problems differ. */
  parameters() {
    return this.columns.filter((name) => name.startsWith("/"));
  }

  /**
   * The contact of jobs whose rows have no numbers, as members of a sweep.
   * @param {AbortSignal} signal
   */
  async findBoundary(signal) {
    const row = this.rows.find((row) => row.status === "succeeded");
    if (!row) return;
    /** @type {import("../types").Result | null} */
    const result = await getSurely(`v1/jobs/${row.id}/result`, signal).catch(() => null);
    this.boundary = Object.keys(result?.summary.contacts ?? {})[0] ?? "";
  }

  /** @param {string} name of a column */
  isNumber(name) {
    return this.rows.some((row) => typeof row[name] === "number");
  }

  /** The names of the contacts, those of the most jobs first. */
  contacts() {
    /** @type {Map<string, number>} */
    const found = new Map();
    for (const row of this.rows) {
      for (const name of String(row.contacts ?? "").split(", ").filter(Boolean)) found.set(name, (found.get(name) ?? 0) + 1);
    }
    return [...found].sort((a, b) => b[1] - a[1]).map(([name]) => name);
  }

  async readProfiles() {
    const { signal } = this.closed;
    if (!this.boundary) await this.findBoundary(signal);
    if (!this.boundary) return this.draw();
    const wanted = this.rows.filter((row) => row.status === "succeeded" && (!row.contacts || String(row.contacts).split(", ").includes(this.boundary))).slice(0, MOST_CURVES);
    const { boundary } = this;
    const queue = wanted.filter((row) => !this.profiles.has(row.id));
    const work = async () => {
      for (let row = queue.shift(); row; row = queue.shift()) {
        const path = `v1/jobs/${row.id}/profiles/${encodeURIComponent(this.boundary)}?format=json&points=${wanted.length > 20 ? 300 : "nodes"}`;
        /** @type {ContactProfile | null} */
        const profile = await getSurely(path, signal).catch(() => null);
        // another contact was chosen meanwhile
        if (signal.aborted || boundary !== this.boundary) return;
        if (profile) this.profiles.set(row.id, profile);
        this.loading = queue.length ? `${this.profiles.size} of ${format.counted(wanted.length, "profile")} read` : "";
        this.drawSoon();
      }
    };
    await Promise.all([work(), work(), work(), work()]);
    this.loading = "";
    this.draw();
  }

  drawSoon() {
    if (this.soon) return;
    this.soon = setTimeout(() => {
      this.soon = undefined;
      if (!this.closed.signal.aborted) this.draw();
    }, 150);
  }

  draw() {
    render(this.drawn(), this.root);
    this.drawProfiles();
    this.drawScatter();
  }

  drawn() {
    const asked = (this.query?.get("ids") ?? "").split(",").filter(Boolean).length;
    const missing = this.loading ? 0 : asked - this.rows.length;
    const csv = this.filters();
    csv.set("columns", COLUMNS.join(","));
    csv.set("differing", "true");
    csv.set("format", "csv");
    const contacts = this.contacts();
    const across = [...this.parameters(), ...NUMBERS].filter((name) => this.isNumber(name));
    const curves = this.profiles.size;
    return html`<h1>Compare</h1>
      <p class="note">${this.loading || html`${format.counted(this.rows.length, "job")}${this.more ? `, of more than ${format.count(MOST_ROWS)}: the first are shown` : ""}${curves ? `; ${format.counted(curves, "profile")}` : ""}${missing > 0 ? `; ${format.counted(missing, "job")} of the address cannot be found, deleted or of another owner` : ""}. Choose jobs in <a href="#/jobs">the list</a>, or filter there and compare all that match.`}</p>
      ${this.error ? parts.errorBox(this.error, () => this.read()) : nothing}
      ${this.rows.length === 0 && !this.loading ? html`<p class="empty">There is nothing to compare yet.</p>` : nothing}
      <div class="columns">
        <section class="panel" ?hidden=${!curves}><h2>Profiles along "${this.boundary}"</h2>
          <div class="tools">${contacts.length > 1 ? html`<label>contact <select @change=${(/** @type {Event} */ event) => {
            this.boundary = /** @type {HTMLSelectElement} */ (event.target).value;
            this.profiles.clear();
            this.readProfiles();
          }}>${contacts.map((name) => html`<option ?selected=${name === this.boundary}>${name}</option>`)}</select></label>` : nothing}
          <button type="button" class="small" @click=${() => this.saveSvg()}>Save as SVG</button></div>
          <div id="normal"></div><div id="tangential"></div><p class="readout" id="values"></p>
          <p class="legend">${curves <= 8 ? this.rows.filter((row) => this.profiles.has(row.id)).map((row, n) => html`<span class="c${(n % 4) + 1} ${n > 3 ? "dash" : ""}"><i></i>${this.nameOf(row)}</span>`) : html`<span><i></i>the baseline</span><span class="old"><i></i>the others</span>`}</p>
        </section>
        <section class="panel" ?hidden=${!this.rows.length}><h2>Points</h2>
          <div class="tools">${this.drawChoice("x", across)}${this.drawChoice("y", across)}</div>
          <canvas class="scatter" tabindex="0" role="img" aria-label="${this.y} against ${this.x}; the table has the values"
            @pointermove=${(/** @type {PointerEvent} */ event) => this.pointAt(event)} @click=${() => this.pointed && (location.hash = parts.jobAddress(this.pointed))}></canvas>
          <p class="readout" id="point" .textContent=${this.pointed ? this.nameOf(this.rows.find((row) => row.id === this.pointed) ?? {}) : "A click on a point opens its job."}></p>
        </section>
      </div>
      ${this.drawDifferences()}
      ${this.rows.length ? html`<section class="panel"><h2>Table <a class="button small" href="v1/jobs/table?${csv}" download="jobs.csv">CSV</a></h2>${this.drawTable()}</section>` : nothing}`;
  }

  /**
   * @param {"x" | "y"} axis
   * @param {string[]} names
   */
  drawChoice(axis, names) {
    return html`<label>${axis === "x" ? "across" : "up"} <select @change=${(/** @type {Event} */ event) => {
      this[axis] = /** @type {HTMLSelectElement} */ (event.target).value;
      this.draw();
    }}>${names.map((name) => html`<option value=${name} ?selected=${name === this[axis]}>${format.quantity(name)}</option>`)}</select></label>`;
  }

  /** @param {TableRow} row */
  nameOf(row) {
    return row.name || String(row.id ?? "").slice(-8);
  }

  drawDifferences() {
    const parameters = this.parameters();
    const few = this.rows.slice(0, 12);
    if (!parameters.length) return this.rows.length > 1 && !this.loading ? html`<section class="panel"><h2>What differs</h2><p class="note">The problems are equal, but for their meshes.</p></section>` : nothing;
    return html`<section class="panel"><h2>What differs</h2><div class="table-box"><table class="numbers differences">
      <thead><tr><th scope="col">value</th>${few.map((row) => html`<th scope="col" class="number"><a href=${parts.jobAddress(row.id)}>${this.nameOf(row)}</a></th>`)}</tr></thead>
      <tbody>${parameters.map((name) => html`<tr><td><code>${name}</code></td>${few.map((row) => html`<td class="number">${shown(row[name])}</td>`)}</tr>`)}</tbody></table></div>
      ${this.rows.length > few.length ? html`<p class="note">Of the first ${few.length}; the table below has all.</p>` : nothing}</section>`;
  }

  drawTable() {
    const names = ["name", ...this.parameters().slice(0, 8), "verdict", ...NUMBERS];
    const base = this.rows.find((row) => row.id === this.baseline);
    return html`<div class="table-box"><table class="numbers"><thead><tr><th scope="col">baseline</th>${names.map((name) => html`<th scope="col" class=${name === "name" || name === "verdict" ? "" : "number"}>${name.startsWith("/") ? html`<code>${name}</code>` : format.quantity(name)}</th>`)}</tr></thead>
      <tbody>${this.rows.slice(0, this.shown).map((row) => html`<tr class=${row.id === this.baseline ? "picked" : ""}>
        <td><input type="radio" name="baseline" aria-label="Compare with ${this.nameOf(row)}" .checked=${row.id === this.baseline} @change=${() => {
          this.baseline = row.id;
          this.draw();
        }} /></td>
        ${names.map((name) => this.drawCell(row, name, base))}</tr>`)}</tbody></table></div>
      ${this.rows.length > this.shown ? html`<p>${format.count(this.shown)} of ${format.count(this.rows.length)} rows. <button type="button" @click=${() => {
        this.shown += 1000;
        this.draw();
      }}>More</button></p>` : nothing}`;
  }

  /**
   * @param {TableRow} row
   * @param {string} name
   * @param {TableRow | undefined} base
   */
  drawCell(row, name, base) {
    if (name === "name") return html`<td><a href=${parts.jobAddress(row.id)}>${this.nameOf(row)}</a></td>`;
    if (name === "verdict") return html`<td>${row.verdict ? parts.trustBadge({ verdict: row.verdict, quantities: withoutLimit(row.without_limit), warnings: [] }) : row.status}</td>`;
    const value = row[name];
    if (typeof value !== "number" && name === "peak_normal_stress" && row.without_limit) return html`<td class="number">no limit</td>`;
    if (typeof value !== "number") return html`<td class="number">${shown(value)}</td>`;
    const [text, error] = format.withError(value, row[`${name}_error`]);
    const before = base && base.id !== row.id ? base[name] : null;
    const ratio = typeof before === "number" && before !== 0 && NUMBERS.includes(name) ? value / before - 1 : null;
    const change = ratio !== null && Math.abs(ratio) < 5e-5 ? null : ratio;
    return html`<td class="number">${text}${error === "—" ? nothing : html` <span class="error-of">± ${error}</span>`}
      ${change === null ? nothing : html`<br /><span class="note">${change > 0 ? "+" : "−"}${format.percent(Math.abs(change))}</span>`}</td>`;
  }

  drawProfiles() {
    const rows = this.rows.filter((row) => this.profiles.has(row.id));
    if (!rows.length) return;
    const few = rows.length <= 8;
    const curves = (/** @type {"normal_stress" | "tangential_stress"} */ column) =>
      rows
        .map((row, n) => {
          const profile = /** @type {ContactProfile} */ (this.profiles.get(row.id));
          const color = few ? (COLORS[n % 4] ?? "--curve-1") : row.id === this.baseline ? "--curve-1" : "--curve-old";
          return { label: this.nameOf(row), color, width: few || row.id === this.baseline ? 2 : 0.8, ...(few && n > 3 ? { dash: [6, 3] } : {}), x: profile.s, y: profile[column] };
        })
        .sort((a, b) => Number(a.color === "--curve-1") - Number(b.color === "--curve-1"));
    const find = (/** @type {string} */ id) => /** @type {HTMLElement} */ (this.root.querySelector(`#${id}`));
    this.chart ??= new Chart(find("normal"), { label: "Normal stresses", x: "", y: "normal stress", robust: true, sync: "compare", read: (place) => this.read_(place) });
    this.chart.set(curves("normal_stress"));
    this.tangential ??= new Chart(find("tangential"), { label: "Tangential stresses", x: "arc length s", y: "tangential stress", robust: true, sync: "compare" });
    this.tangential.set(curves("tangential_stress"));
  }

  /** @param {number | null} place of the common arc lengths */
  read_(place) {
    const readout = this.root.querySelector("#values");
    const chart = this.chart;
    if (!readout || !chart) return;
    const { curves, data } = chart;
    const told = place === null ? [] : curves.slice(0, 8).map((curve, n) => {
      const value = data.y[n]?.[place];
      return value === null || value === undefined ? "" : `${curve.label}: ${format.number(value)}`;
    });
    readout.textContent = place === null ? "" : `s = ${format.number(data.x[place])}, σₙ of ${told.filter(Boolean).join(", ")}`;
  }

  /** Points of the scatter on the canvas: x, y and the id. @type {[number, number, string][]} */
  points = [];

  drawScatter() {
    const canvas = /** @type {HTMLCanvasElement | null} */ (this.root.querySelector("canvas.scatter"));
    const context = canvas?.getContext("2d");
    const rows = this.rows.filter((row) => typeof row[this.x] === "number" && typeof row[this.y] === "number");
    this.points = [];
    if (!canvas || !context || !canvas.clientWidth) return;
    const ratio = devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    Object.assign(canvas, { width: width * ratio, height: height * ratio });
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const css = (/** @type {string} */ name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
    context.font = '12px system-ui, "DejaVu Sans", sans-serif';
    const [left, right, top, bottom] = [76, width - 14, 12, height - 40];
    const span = (/** @type {string} */ name) => {
      const values = rows.map((row) => row[name]);
      const [least, most] = [values.reduce((a, b) => Math.min(a, b), Infinity), values.reduce((a, b) => Math.max(a, b), -Infinity)];
      const margin = 0.05 * (most - least || Math.abs(most) || 1);
      return [least - margin, most + margin];
    };
    const [x0 = 0, x1 = 1] = rows.length ? span(this.x) : [0, 1];
    const [y0 = 0, y1 = 1] = rows.length ? span(this.y) : [0, 1];
    const at = (/** @type {number} */ x, /** @type {number} */ y) => [left + ((x - x0) / (x1 - x0)) * (right - left), bottom - ((y - y0) / (y1 - y0)) * (bottom - top)];
    context.strokeStyle = css("--line");
    context.fillStyle = css("--quiet");
    context.beginPath();
    context.textAlign = "center";
    for (const x of format.ticks(x0, x1)) {
      const [px = 0] = at(x, y0);
      context.moveTo(px, top);
      context.lineTo(px, bottom);
      const text = format.number(x, 6);
      context.fillText(text, Math.min(px, width - 2 - context.measureText(text).width / 2), bottom + 16);
    }
    context.textAlign = "right";
    for (const y of format.ticks(y0, y1)) {
      const [, py = 0] = at(x0, y);
      context.moveTo(left, py);
      context.lineTo(right, py);
      context.fillText(format.number(y, 6), left - 6, py + 4);
    }
    context.stroke();
    context.textAlign = "center";
    context.fillText(this.x, (left + right) / 2, height - 8);
    context.fillStyle = css("--curve-1");
    context.globalAlpha = rows.length > 500 ? 0.5 : 0.9;
    for (const row of rows) {
      const [px = 0, py = 0] = at(row[this.x], row[this.y]);
      this.points.push([px, py, row.id]);
      context.beginPath();
      context.arc(px, py, rows.length > 2000 ? 2 : 3.5, 0, 2 * Math.PI);
      context.fill();
    }
    context.globalAlpha = 1;
  }

  /** @param {PointerEvent} event */
  pointAt(event) {
    let [best, found] = [100, ""];
    for (const [x, y, id] of this.points) {
      const far = (x - event.offsetX) ** 2 + (y - event.offsetY) ** 2;
      if (far < best) [best, found] = [far, id];
    }
    if (found === this.pointed) return;
    this.pointed = found;
    const row = this.rows.find((other) => other.id === found);
    const place = this.root.querySelector("#point");
    if (place) place.textContent = row ? `${this.nameOf(row)}: ${this.x} = ${shown(row[this.x])}, ${this.y} = ${shown(row[this.y])}` : "";
  }

  /** Saves the profiles as a figure. */
  saveSvg() {
    const rows = this.rows.filter((row) => this.profiles.has(row.id));
    const [width, height] = [720, 300];
    const all = rows.map((row) => /** @type {ContactProfile} */ (this.profiles.get(row.id)));
    const most = Math.max(...all.map((profile) => profile.s[profile.s.length - 1] ?? 0), 1e-300);
    const colors = ["#1f5ca8", "#b8410f", "#2b7a3d", "#7a4fa3"];
    const panel = (/** @type {"normal_stress" | "tangential_stress"} */ column, /** @type {number} */ top) => {
      const ranges = all.map((profile) => robustRange([profile[column]], profile.s).range);
      const [low, high] = [Math.min(...ranges.map(([least]) => least)), Math.max(...ranges.map(([, greatest]) => greatest))];
      const x = (/** @type {number} */ s) => 80 + (s / most) * (width - 100);
      const y = (/** @type {number} */ value) => top + 20 + ((high - Math.max(low, Math.min(high, value))) / (high - low)) * (height - 70);
      const lines = all.map((profile, n) => `<polyline fill="none" stroke="${colors[n % 4]}" stroke-width="1.2"${n % 8 > 3 ? ' stroke-dasharray="6 3"' : ""} points="${profile.s.map((s, k) => `${x(s).toFixed(1)},${y(profile[column][k] ?? 0).toFixed(1)}`).join(" ")}"/>`);
      const marks = [
        ...round(0, most).map((s) => `<line x1="${x(s)}" x2="${x(s)}" y1="${top + height - 50}" y2="${top + height - 45}" stroke="#888"/><text x="${x(s)}" y="${top + height - 31}" text-anchor="middle">${format.number(s, 4)}</text>`),
        ...round(low, high).map((value) => `<line x1="75" x2="80" y1="${y(value)}" y2="${y(value)}" stroke="#888"/><text x="71" y="${y(value) + 4}" text-anchor="end">${format.number(value, 4)}</text>`),
      ];
      return `<rect x="80" y="${top + 20}" width="${width - 100}" height="${height - 70}" fill="none" stroke="#888"/>${lines.join("")}${marks.join("")}<text x="80" y="${top + 13}">${format.words(column)} along ${escaped(this.boundary)}</text><text x="${80 + (width - 100) / 2}" y="${top + height - 14}" text-anchor="middle">arc length s</text>`;
    };
    const legend = rows.slice(0, 24).map((row, n) => {
      const [left, top] = [80 + 210 * (n % 3), 2 * height + 18 + 18 * Math.floor(n / 3)];
      return `<line x1="${left}" x2="${left + 22}" y1="${top - 4}" y2="${top - 4}" stroke="${colors[n % 4]}" stroke-width="2"${n % 8 > 3 ? ' stroke-dasharray="6 3"' : ""}/><text x="${left + 28}" y="${top}">${escaped(String(this.nameOf(row)).slice(0, 28))}</text>`;
    });
    const whole = 2 * height + 30 + 18 * Math.ceil(legend.length / 3);
    const text = `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${whole}" font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="#fff"/>${panel("normal_stress", 0)}${panel("tangential_stress", height)}${legend.join("")}</svg>`;
    parts.save("profiles.svg", "image/svg+xml", text);
  }
}

/**
 * As many numbers without a limit.
 * @param {number} count
 * @returns {any[]}
 */
const withoutLimit = (count) => new Array(count || 0).fill({ method: "no_limit" });

/** @param {unknown} value */
const shown = (value) => (typeof value === "number" ? format.number(value, 6) : value === null || value === undefined || value === "" ? "—" : String(value));

/**
 * Round numbers from one to another, about five of them.
 * @param {number} low
 * @param {number} high
 */
function round(low, high) {
  const rough = (high - low) / 5 || 1;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = power * ([1, 2, 5, 10].find((factor) => factor * power >= rough) ?? 10);
  const found = [];
  for (let n = Math.ceil(low / step); n * step <= high + 1e-9 * step; n += 1) found.push(n * step);
  return found;
}

/** @param {string} text */
const escaped = (text) => text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");
