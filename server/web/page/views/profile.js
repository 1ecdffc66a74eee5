/** The stresses along a contact boundary: two panels, the values under the pointer, load steps. */

import { html, nothing, render } from "../vendor/lit-html-3.3.3/lit-html.js";
import { getSurely } from "../api.js";
import { Chart, robustRange } from "../chart.js";
import * as format from "../format.js";
import * as parts from "../parts.js";

/** @typedef {import("../types").ContactProfile} ContactProfile */

/** Where the values of a profile are. @type {[string, string][]} */
const POINTS = [
  ["all", "all points"],
  ["nodes", "nodes"],
  ["friction", "friction points"],
];

export class ProfilePanel {
  /** @type {ContactProfile | null} */
  profile = null;
  /** The boundaries that have a profile. @type {string[]} */
  boundaries = [];
  /** How often a profile was asked for: only the answer to the last question is shown. */
  reads = 0;
  boundary = "";
  /** @type {Chart | undefined} */
  normal;
  /** @type {Chart | undefined} */
  tangential;
  /** @type {import("../types").Job | undefined} */
  job;
  /** @type {import("../types").Result | undefined} */
  result;
  partial = false;
  told = "";
  points = "all";
  /** The step that is shown, by its number; the last one is -1. */
  step = -1;
  /** @type {unknown} */
  error = null;

  /**
   * @param {HTMLElement} root
   * @param {import("../app.js").App} app
   * @param {URLSearchParams} query
   */
  constructor(root, app, query) {
    this.root = root;
    this.app = app;
    this.closed = new AbortController();
    this.boundary = query.get("boundary") ?? "";
    this.step = Number(query.get("step") ?? -1);
  }

  close() {
    this.closed.abort();
    this.normal?.close();
    this.tangential?.close();
  }

  /** @param {string | null} step */
  setStep(step) {
    const wanted = Number(step ?? -1);
    if (wanted === this.step) return;
    this.step = wanted;
    this.read();
  }

  /**
   * @param {import("../types").Job} job
   * @param {import("../types").Result} result
   * @param {boolean} partial
   */
  load(job, result, partial) {
    this.job = job;
    this.result = result;
    this.partial = partial;
    this.boundaries = Object.keys(result.summary.contacts);
    if (!this.boundaries.includes(this.boundary)) this.boundary = this.boundaries[0] ?? "";
    if (!this.boundary) {
      render(html`<h2>No contact</h2><p class="note">The problem has no contact: there are displacements and stresses only.</p>`, this.root);
      return;
    }
    this.read();
  }

  async read() {
    if (!this.job || !this.boundary) return;
    this.reads += 1;
    const own = this.reads;
    const query = new URLSearchParams({ points: this.points, format: "json" });
    if (this.step >= 0) query.set("step", String(this.step));
    if (this.partial) query.set("partial", "true");
    try {
      /** @type {ContactProfile} */
      const profile = await getSurely(`v1/jobs/${this.job.id}/profiles/${encodeURIComponent(this.boundary)}?${query}`, this.closed.signal);
      // another step was asked for meanwhile
      if (own !== this.reads) return;
      this.profile = profile;
      this.error = null;
    } catch (error) {
      if (this.closed.signal.aborted) return;
      this.error = error;
    }
    this.draw();
  }

  draw() {
    const steps = this.result?.steps ?? [];
    const at = this.step < 0 ? steps.length - 1 : this.step;
    const summary = this.step >= 0 ? steps[this.step]?.summary : this.result?.summary;
    const contact = summary?.contacts[this.boundary];
    const states = this.profile?.state ?? [];
    const cut = this.profile ? robustRange([this.profile.normal_stress], this.profile.s).cut : false;
    render(
      html`<h2>Stress along the contact "${this.boundary}" ${this.result?.result_available === "partial" && !this.partial ? html`<span class="note">so far</span>` : nothing}</h2>
        <div class="tools">
          ${this.boundaries.length > 1
            ? html`<label>contact <select @change=${(/** @type {Event} */ event) => {
                this.boundary = /** @type {HTMLSelectElement} */ (event.target).value;
                this.read();
              }}>${this.boundaries.map((name) => html`<option ?selected=${name === this.boundary}>${name}</option>`)}</select></label>`
            : nothing}
          <label>values at <select @change=${(/** @type {Event} */ event) => {
            this.points = /** @type {HTMLSelectElement} */ (event.target).value;
            this.read();
          }}>${POINTS.map(([value, word]) => html`<option value=${value} ?selected=${value === this.points}>${word}</option>`)}</select></label>
          ${steps.length > 1
            ? html`<label>load step <input type="range" min="0" max=${steps.length - 1} .value=${String(at)} @input=${(/** @type {Event} */ event) => {
                const value = Number(/** @type {HTMLInputElement} */ (event.target).value);
                this.step = value === steps.length - 1 ? -1 : value;
                this.read();
              }} /> <strong>${steps[at]?.name ?? ""}</strong> (${at + 1} of ${steps.length})</label>`
            : nothing}
        </div>
        ${this.error ? parts.errorBox(this.error, () => this.read()) : nothing}
        <div id="normal-stress"></div>
        <div id="tangential-stress" ?hidden=${!this.hasFriction()}></div>
        <p class="readout" id="profile-readout" .textContent=${this.told ?? ""}></p>
        <p class="legend"><span><i></i>normal stress σₙ</span>${this.hasFriction() ? html`<span class="c2"><i></i>tangential stress σₜ</span><span class="old"><i></i>friction bound ± τ</span>${states.includes("stick") ? html`<span class="stick"><i></i>sticks</span>` : nothing}${states.includes("slip") ? html`<span class="slip"><i></i>slips</span>` : nothing}` : html`<span class="slip"><i></i>in contact</span>`}</p>
        ${cut ? html`<p class="note">▼ The axis leaves out values that are far beyond the others, as at an edge where the pressure has no limit. Drag to zoom, double click to see the whole boundary.</p>` : html`<p class="note">Drag to zoom, double click to see the whole boundary.</p>`}
        ${contact ? html`<p class="note">s is the arc length along the boundary. In contact ${intervals(contact.contact)}${contact.stick.length ? `; sticks ${intervals(contact.stick)}` : ""}.</p>` : nothing}
        ${this.drawTable()}`,
      this.root,
    );
    if (this.profile) this.drawCharts(this.profile);
  }

  hasFriction() {
    return Boolean(this.profile?.friction_bound.some((bound) => bound > 0));
  }

  /** @param {ContactProfile} profile */
  drawCharts(profile) {
    const find = (/** @type {string} */ id) => /** @type {HTMLElement} */ (this.root.querySelector(`#${id}`));
    const read = (/** @type {number | null} */ place) => this.read_(profileAt(this.profile, place));
    const few = profile.s.length < 80;
    const shades = shadesOf(profile);
    const first = this.firstPart(profile);
    this.normal ??= new Chart(find("normal-stress"), { label: "Normal stress along the contact", x: "", y: "normal stress", robust: true, height: 220, sync: "profile", read, ...first });
    this.normal.set([{ label: "normal stress", color: "--curve-1", points: few, x: profile.s, y: profile.normal_stress }], shades);
    if (!this.hasFriction()) return;
    this.tangential ??= new Chart(find("tangential-stress"), { label: "Tangential stress along the contact", x: "arc length s", y: "tangential stress", robust: true, height: 220, sync: "profile", read, ...first });
    this.tangential.set(
      [
        { label: "bound", color: "--curve-old", width: 1, dash: [4, 3], x: profile.s, y: profile.friction_bound },
        { label: "minus bound", color: "--curve-old", width: 1, dash: [4, 3], x: profile.s, y: profile.friction_bound.map((bound) => -bound) },
        { label: "tangential stress", color: "--curve-2", points: few, x: profile.s, y: profile.tangential_stress },
      ],
      shades,
    );
  }

  /**
   * The part of the boundary that is shown at first: the contact with as much beside it, if that is a small part.
   * @param {ContactProfile} profile
   * @returns {{first?: [number, number]}}
   */
  firstPart(profile) {
    const touching = profile.s.filter((_, n) => profile.state[n] !== "open");
    const [start = 0, end = 0] = [profile.s[0], profile.s[profile.s.length - 1]];
    const [from = start, to = end] = [touching[0], touching[touching.length - 1]];
    const width = Math.max(to - from, 0);
    return width > 0 && 3 * width < end - start ? { first: [Math.max(start, from - width), Math.min(end, to + width)] } : {};
  }

  /** @param {string} told */
  read_(told) {
    this.told = told;
    const place = this.root.querySelector("#profile-readout");
    if (place) place.textContent = told;
  }

  drawTable() {
    const profile = this.profile;
    if (!profile) return nothing;
    const every = Math.max(1, Math.ceil(profile.s.length / 200));
    const rows = [...profile.s.keys()].filter((n) => n % every === 0);
    return html`<details><summary>The values as a table${every > 1 ? `, one row in ${every} of ${profile.s.length}` : ""}</summary><div class="scroll"><table class="numbers">
      <thead><tr>${["s", "x", "y", "gap", "σₙ", "σₜ", "τ", "state"].map((name) => html`<th scope="col" class="number">${name}</th>`)}</tr></thead>
      <tbody>${rows.map((n) => html`<tr>${[profile.s, profile.x, profile.y, profile.gap, profile.normal_stress, profile.tangential_stress, profile.friction_bound].map((column) => html`<td class="number">${format.number(column[n])}</td>`)}<td class="number">${stateOf(profile, n)}</td></tr>`)}</tbody>
    </table></div></details>`;
  }
}

/** @param {number[][]} pairs */
function intervals(pairs) {
  return pairs.slice(0, 4).map(([from, to]) => `from s = ${format.number(from)} to ${format.number(to)}`).join(", ") + (pairs.length > 4 ? ` and ${pairs.length - 4} more` : "");
}

/**
 * The state at a point; without friction what touches neither sticks nor slips.
 * @param {ContactProfile} profile
 * @param {number} place
 */
function stateOf(profile, place) {
  const state = profile.state[place] ?? "";
  return state !== "open" && !profile.friction_bound.some((bound) => bound > 0) ? "in contact" : state;
}

/**
 * The values of a profile at one of its points, in words.
 * @param {ContactProfile | null} profile
 * @param {number | null} place
 */
function profileAt(profile, place) {
  if (!profile || place === null || place >= profile.s.length) return "";
  const at = (/** @type {number[]} */ column) => format.number(column[place]);
  const friction = (profile.friction_bound[place] ?? 0) > 0 ? `, σₜ = ${at(profile.tangential_stress)}, τ = ${at(profile.friction_bound)}` : "";
  return `s = ${at(profile.s)}: σₙ = ${at(profile.normal_stress)}${friction}, ${stateOf(profile, place)}`;
}

/**
 * The parts of the contact that stick and slip.
 * @param {ContactProfile} profile
 */
function shadesOf(profile) {
  /** @type {import("../chart.js").Shade[]} */
  const shades = [];
  const colors = /** @type {Record<string, string>} */ ({ stick: "--stick", slip: "--slip" });
  for (let n = 0; n + 1 < profile.s.length; n += 1) {
    const [here, next] = [profile.state[n], profile.state[n + 1]];
    const state = here === next ? here : here === "open" ? next : here;
    const color = state && here !== "open" && next !== "open" ? colors[state] : undefined;
    if (!color) continue;
    const last = shades[shades.length - 1];
    const [from, to] = [profile.s[n] ?? 0, profile.s[n + 1] ?? 0];
    if (last && last.color === color && last.to === from) last.to = to;
    else shades.push({ from, to, color });
  }
  return shades;
}
