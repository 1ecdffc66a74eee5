/** The body of a job: as it was asked, and deformed with a field in colours. */

import { html, nothing, render } from "../vendor/lit-html-3.3.3/lit-html.js";
import { ApiError, Unreachable, getView } from "../api.js";
import { Drawing, bounds } from "../drawing.js";
import * as format from "../format.js";
import * as parts from "../parts.js";

/** The fields that can be shown, by the words of the service; `size` is made of the displacements. @type {[string, string][]} */
const FIELDS = [
  ["none", "as asked"],
  ["von_mises", "von Mises"],
  ["stress_xx", "σₓ"],
  ["stress_yy", "σᵧ"],
  ["stress_xy", "τₓᵧ"],
  ["stress_zz", "σ_z"],
  ["principal_stress_1", "largest principal"],
  ["principal_stress_3", "smallest principal"],
  ["size", "|u|"],
  ["contact_state", "state of contact"],
  ["element_error", "error of elements"],
];

export class BodyPanel {
  /** @type {import("../api.js").View | null} */
  view = null;
  /** @type {Map<string, Float32Array>} */
  fields = new Map();
  field = "none";
  scale = 1;
  /** The range of the colours that a person has chosen. @type {[number | null, number | null]} */
  chosen = [null, null];
  /** @type {Drawing | undefined} */
  drawing;
  /** @type {import("../types").Job | undefined} */
  job;
  /** @type {[number, number] | undefined} */
  range;
  /** @type {Float32Array | null} */
  shownValues = null;
  query = "";
  loading = true;
  /** How often a body was asked for: only the answer to the last question is shown. */
  loads = 0;
  solved = false;
  /** @type {unknown} */
  error = null;

  /** @param {HTMLElement} root */
  constructor(root) {
    this.root = root;
    this.closed = new AbortController();
  }

  close() {
    this.closed.abort();
    this.drawing?.close();
  }

  /**
   * @param {import("../types").Job} job
   * @param {boolean} partial
   */
  async load(job, partial) {
    this.job = job;
    this.query = partial ? "?partial=true" : "";
    const ended = ["succeeded", "failed", "canceled"].includes(job.status);
    this.solved = ended && job.result_available !== "none";
    this.loading = true;
    this.loads += 1;
    const own = this.loads;
    this.fields.clear();
    this.draw();
    try {
      const signal = this.closed.signal;
      const first = this.solved ? ["displacement", "von_mises"] : [];
      const view = await getView(`v1/jobs/${job.id}/view${this.query}`, { signal });
      if (own !== this.loads) return;
      this.view = view;
      this.drawing?.setBody(view);
      this.draw();
      // one after another: the service reads the fields of a large body for few at a time
      const fields = [];
      for (const name of first) fields.push(await this.fetchField(name).catch(() => null));
      if (own !== this.loads) return;
      this.solved = this.solved && fields.every((field) => field !== null) && fields.length > 0;
      this.error = null;
      this.loading = false;
      this.field = this.solved ? "von_mises" : "none";
      this.draw();
      this.showField();
      if (this.solved) await this.fetchField("contact_state").catch(() => null);
      if (own === this.loads) this.showContact(true);
    } catch (error) {
      if (this.closed.signal.aborted || own !== this.loads) return;
      this.error = error instanceof ApiError || error instanceof Unreachable ? error : new Error("The body cannot be drawn.");
      this.loading = false;
      this.draw();
    }
  }

  /**
   * @param {string} name
   * @returns {Promise<Float32Array>}
   */
  async fetchField(name) {
    const known = this.fields.get(name);
    if (known) return known;
    const { arrays } = await getView(`v1/jobs/${this.job?.id}/view/${name}${this.query}`, { signal: this.closed.signal });
    const values = /** @type {Float32Array} */ (arrays.values);
    this.fields.set(name, values);
    return values;
  }

  /** Values at the corners of the field that is chosen. */
  async values() {
    if (this.field === "none") return null;
    if (this.field === "size") {
      const moved = await this.fetchField("displacement");
      return new Float32Array(moved.length / 2).map((_, n) => Math.hypot(moved[2 * n] ?? 0, moved[2 * n + 1] ?? 0));
    }
    const values = await this.fetchField(this.field);
    return this.field === "element_error" ? this.toCorners(values) : values;
  }

  /**
   * Numbers of elements at their corners: the mean of the elements around.
   * @param {Float32Array} values
   */
  toCorners(values) {
    const arrays = this.view?.arrays ?? {};
    const corners = (arrays.positions?.length ?? 0) / 2;
    const [sums, counts] = [new Float32Array(corners), new Float32Array(corners)];
    let element = 0;
    for (const [ids, size] of /** @type {[Uint32Array, number][]} */ ([[arrays.quads, 4], [arrays.triangles, 3]])) {
      for (let n = 0; n < ids.length; n += size, element += 1) {
        for (let k = 0; k < size; k += 1) {
          const corner = ids[n + k] ?? 0;
          sums[corner] = (sums[corner] ?? 0) + (values[element] ?? 0);
          counts[corner] = (counts[corner] ?? 0) + 1;
        }
      }
    }
    return sums.map((sum, n) => sum / Math.max(counts[n] ?? 1, 1));
  }

  async showField() {
    const { drawing } = this;
    if (!drawing || !this.view) return;
    const { field } = this;
    this.error = null;
    const values = await this.values().catch((error) => {
      this.error = error;
      return null;
    });
    // another field was chosen meanwhile
    if (field !== this.field) return;
    drawing.around = true;
    drawing.scale = this.scale;
    drawing.setMoved(this.field === "none" ? null : (this.fields.get("displacement") ?? null));
    this.shownValues = values;
    this.range = values ? robust(values, this.view.arrays) : [0, 1];
    const [low, high] = [this.chosen[0] ?? this.range[0] ?? 0, this.chosen[1] ?? this.range[1] ?? 1];
    const chosen = this.chosen[0] !== null || this.chosen[1] !== null;
    drawing.setValues(values, [low, high > low ? high : low + (Math.abs(low) || 1) * 1e-6], !chosen);
    this.draw();
  }

  /**
   * Shows the part of the body that is at the contact.
   * @param {boolean} ifSmall only if the contact is a small part of the body
   */
  showContact(ifSmall) {
    const { view, drawing } = this;
    if (!view || !drawing) return;
    const lines = drawing.lines("obstacles");
    const points = lines.flatMap((line) => [...line.points]);
    const positions = view.arrays.positions;
    if (!points.length || !positions) return;
    const whole = bounds(positions);
    const size = Math.max((whole[2] ?? 0) - (whole[0] ?? 0), (whole[3] ?? 0) - (whole[1] ?? 0));
    const state = this.fields.get("contact_state");
    let box = bounds(points);
    if (state) {
      /** @type {number[]} */
      const touching = [];
      state.forEach((value, n) => value > 0 && touching.push(positions[2 * n] ?? 0, positions[2 * n + 1] ?? 0));
      if (touching.length) box = bounds(touching);
    }
    const near = Math.max((box[2] ?? 0) - (box[0] ?? 0), (box[3] ?? 0) - (box[1] ?? 0), 0.01 * size);
    if (ifSmall && near > 0.35 * size) return;
    const middle = [((box[0] ?? 0) + (box[2] ?? 0)) / 2, ((box[1] ?? 0) + (box[3] ?? 0)) / 2];
    drawing.fit([(middle[0] ?? 0) - near, (middle[1] ?? 0) - 0.8 * near, (middle[0] ?? 0) + near, (middle[1] ?? 0) + 0.6 * near]);
  }

  /** What the field that is chosen is called. */
  word() {
    return FIELDS.find(([name]) => name === this.field)?.[1] ?? "";
  }

  /** The field in words, with its greatest value and the place of that. */
  drawLargest() {
    const { shownValues: values, view } = this;
    if (!values || !view || this.field === "none") return nothing;
    if (this.field === "contact_state") return html`Colours: ${this.word()}; −1 not on a contact, 0 open, 1 sticks, 2 slips. `;
    let largest = 0;
    for (let n = 0; n < values.length; n += 1) if (Math.abs(values[n] ?? 0) > Math.abs(values[largest] ?? 0)) largest = n;
    const positions = view.arrays.positions ?? [];
    return html`Colours: ${this.word()}, the largest at a corner of an element ${format.number(values[largest])} at x = ${format.number(positions[2 * largest], 4)}, y = ${format.number(positions[2 * largest + 1], 4)}, without a stated error. `;
  }

  draw() {
    const { view } = this;
    const number = (/** @type {Event} */ event) => {
      const text = /** @type {HTMLInputElement} */ (event.target).value;
      return text === "" || !Number.isFinite(Number(text)) ? null : Number(text);
    };
    render(
      html`<h2>${this.solved ? "Deformed body" : "The problem"}</h2>
        ${this.solved
          ? html`<div class="tools" role="group" aria-label="Field">${FIELDS.map(([name, word]) => html`<button type="button" class="small" aria-pressed=${name === this.field} @click=${() => {
              this.field = name;
              this.chosen = [null, null];
              this.showField();
            }}>${word}</button>`)}</div>`
          : nothing}
        <div class="tools">
          <button type="button" class="small" @click=${() => this.drawing?.showAll()}>show the whole body</button>
          <button type="button" class="small" @click=${() => this.showContact(false)}>show the contact</button>
          <label><input type="checkbox" .checked=${this.drawing?.edges ?? true} @change=${(/** @type {Event} */ event) => {
            if (!this.drawing) return;
            this.drawing.edges = /** @type {HTMLInputElement} */ (event.target).checked;
            this.drawing.draw();
          }} /> mesh</label>
          ${this.solved && this.field !== "none"
            ? html`<label>displacements × <input type="number" class="range" min="0" step="any" .value=${String(this.scale)} @change=${(/** @type {Event} */ event) => {
                this.scale = number(event) ?? 1;
                this.showField();
              }} /></label>
              <label>colours from <input class="range" type="number" step="any" placeholder=${format.number(this.range?.[0], 4)} .value=${this.chosen[0] === null ? "" : String(this.chosen[0])} @change=${(/** @type {Event} */ event) => {
                this.chosen[0] = number(event);
                this.showField();
              }} /></label>
              <label>to <input class="range" type="number" step="any" placeholder=${format.number(this.range?.[1], 4)} .value=${this.chosen[1] === null ? "" : String(this.chosen[1])} @change=${(/** @type {Event} */ event) => {
                this.chosen[1] = number(event);
                this.showField();
              }} /></label>`
            : nothing}
        </div>
        ${this.error ? parts.errorBox(this.error) : nothing}
        ${this.loading ? parts.loading("Loading the body") : nothing}
        <div id="drawing"></div>
        <p class="readout" id="body-readout"></p>
        <p class="note">${this.drawLargest()}${view ? `${format.count(view.head.elements)} elements, ${format.count(view.head.nodes)} nodes. ` : ""}Drag moves, Ctrl and the wheel zoom (the wheel alone, once it was clicked), a double click shows all.</p>`,
      this.root,
    );
    this.drawing ??= new Drawing(/** @type {HTMLElement} */ (this.root.querySelector("#drawing")), {
      label: "The body",
      value: () => this.word(),
      read: (text) => {
        const place = this.root.querySelector("#body-readout");
        if (place) place.textContent = text;
      },
    });
  }
}

/** The number of elements whose values are sorted for a range of colours. */
const SAMPLE = 20_000;

/**
 * A range that leaves out values on a very small part of the body that are far beyond all others, as at a singular corner.
 * @param {Float32Array} values at the corners
 * @param {Record<string, any>} arrays of the view
 * @returns {[number, number]}
 */
function robust(values, { positions, quads, triangles }) {
  /** The mean and the area of elements. @type {[number, number][]} */
  const weighed = [];
  let [least, most] = [Infinity, -Infinity];
  for (const value of values) {
    if (value < least) least = value;
    if (value > most) most = value;
  }
  const every = Math.ceil((quads.length / 4 + triangles.length / 3) / SAMPLE);
  for (const [ids, size] of /** @type {[Uint32Array, number][]} */ ([[quads, 4], [triangles, 3]])) {
    for (let n = 0; n < ids.length; n += size * every) {
      let [area, sum] = [0, 0];
      for (let k = 0; k < size; k += 1) {
        const [a, b] = [ids[n + k] ?? 0, ids[n + ((k + 1) % size)] ?? 0];
        area += 0.5 * (positions[2 * a] * positions[2 * b + 1] - positions[2 * b] * positions[2 * a + 1]);
        sum += (values[a] ?? 0) / size;
      }
      if (Number.isFinite(sum)) weighed.push([sum, Math.abs(area)]);
    }
  }
  if (!weighed.length || !(most > least)) return [Number.isFinite(least) ? least : 0, Number.isFinite(most) ? most : 1];
  weighed.sort((a, b) => a[0] - b[0]);
  const total = weighed.reduce((all, [, area]) => all + area, 0);
  const at = (/** @type {number} */ part) => {
    let sum = 0;
    for (const [value, area] of weighed) if ((sum += area) >= part * total) return value;
    return most;
  };
  const [low, high] = [at(0.002), at(0.998)];
  const room = 1.5 * Math.max(high - low, 1e-300);
  return [least < low - room ? low - 0.25 * (high - low) : least, most > high + room ? high + 0.25 * (high - low) : most];
}
