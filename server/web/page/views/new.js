/** A new job: an example, a file or a text, checked and drawn while it is written. */

import { html, nothing, render } from "../vendor/lit-html-3.3.3/lit-html.js";
import { ApiError, getSurely, getView, newKey, request, send } from "../api.js";
import { Drawing } from "../drawing.js";
import * as format from "../format.js";
import * as parts from "../parts.js";
import { lineOf, nearest, places, pretty } from "../pointers.js";
import { address } from "../route.js";

/** @typedef {import("../types").Validation} Validation */

/** How long a person has to pause before a text is checked (ms). */
const PAUSE = 350;
/** The size of a text (characters) above which a mesh in it is stored by itself. */
const LARGE = 200_000;

/** Values that people change, by patterns of their pointers. @type {[RegExp, string][]} */
const CONTROLS = [
  [/^\/contacts\/\d+\/indentation$/, "indentation"],
  [/^\/contacts\/\d+\/normal_force$/, "normal force"],
  [/^\/contacts\/\d+\/tangential_displacement$/, "tangential displacement"],
  [/^\/contacts\/\d+\/tangential_force$/, "tangential force"],
  [/^\/contacts\/\d+\/tilt$/, "tilt"],
  [/^\/contacts\/\d+\/gap\/(interference|clearance)$/, "gap"],
  [/^\/contacts\/\d+\/obstacle\/radius$/, "radius of the obstacle"],
  [/^\/contacts\/\d+\/obstacle\/angle$/, "angle of the obstacle (degrees)"],
  [/^\/contacts\/\d+\/obstacle\/slope$/, "slope of the obstacle"],
  [/^\/contacts\/\d+\/obstacle\/from$/, "obstacle from"],
  [/^\/contacts\/\d+\/obstacle\/to$/, "obstacle to"],
  [/^\/contacts\/\d+\/friction\/coefficient$/, "coefficient μ"],
  [/^\/contacts\/\d+\/friction\/nonlocal_radius$/, "nonlocal radius ρ"],
  [/^\/contacts\/\d+\/friction\/elastic_slip$/, "elastic slip ε"],
  [/^\/materials\/\d+\/youngs_modulus$/, "Young's modulus E"],
  [/^\/materials\/\d+\/poissons_ratio$/, "Poisson's ratio ν"],
  [/^\/loads\/\d+\/pressure$/, "pressure"],
  [/^\/mesh\/refine$/, "halvings of all elements"],
  [/^\/mesh\/refine\/tolerance$/, "refine until errors are below"],
];

/** What a click on a boundary can do: the list, the words, and the entry. @type {["supports" | "contacts" | "loads", string, string, object][]} */
const ENTRIES = [
  ["supports", "hold it", "release it", { ux: 0, uy: 0 }],
  ["contacts", "press on it", "take the obstacle away", { obstacle: { kind: "flat" }, indentation: 0.01 }],
  ["loads", "load it", "take the load away", { pressure: 1 }],
];

/**
 * @param {HTMLElement} root
 * @param {import("../route.js").Route} here
 * @param {import("../app.js").App} app
 * @returns {import("../app.js").Open}
 */
export function open(root, here, app) {
  return new NewView(root, here, app);
}

class NewView {
  /** @type {Drawing | undefined} */
  drawing;
  /** @type {AbortController | undefined} */
  checking;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  soon;
  due = 0;
  text = "";
  /** @type {any} */
  problem = null;
  /** Why the text is no JSON. @type {string | null} */
  malformed = null;
  /** @type {Validation | null} */
  checked = null;
  /** What a deck does differently. @type {import("../types").Warning[]} */
  notes = [];
  /** @type {unknown} */
  error = null;
  /** @type {import("../types").Example[]} */
  examples = [];
  /** What was typed into a control and cannot be read, by its pointer: the text, and what is wrong. @type {Map<string, {text: string, fault: string}>} */
  faults = new Map();
  /** Values that vary in a sweep, by their pointers. @type {Map<string, number[]>} */
  varied = new Map();
  busy = "";
  told = "";
  name = "";
  labels = "";
  priority = "";
  cache = "use";
  /** @type {any} */
  editor = null;
  boundary = "";
  boundaries = /** @type {string[]} */ ([]);
  key = newKey();
  drawable = true;

  /**
   * @param {HTMLElement} root
   * @param {import("../route.js").Route} here
   * @param {import("../app.js").App} app
   */
  constructor(root, here, app) {
    this.root = root;
    this.app = app;
    this.closed = new AbortController();
    app.title("New job");
    this.draw();
    this.start(here.query);
  }

  /** @param {import("../route.js").Route} here */
  update(here) {
    this.start(here.query);
  }

  close() {
    this.closed.abort();
    clearTimeout(this.soon);
    this.drawing?.close();
    this.editor?.remove?.();
  }

  /** @param {URLSearchParams} query */
  async start(query) {
    const { signal } = this.closed;
    await this.makeEditor();
    try {
      const from = query.get("from");
      if (from) {
        const [problem, job] = await Promise.all([
          getSurely(`v1/jobs/${from}/problem`, signal),
          /** @type {Promise<import("../types").Job>} */ (getSurely(`v1/jobs/${from}`, signal)),
        ]);
        this.name = job.name ?? "";
        this.labels = Object.entries(job.labels).map(([key, value]) => `${key}=${value}`).join(" ");
        this.setProblem(withoutDefaults(problem));
      }
      const mesh = query.get("mesh");
      if (mesh) await this.useMesh(await getSurely(`v1/meshes/${mesh}`, signal));
      /** @type {import("../types").Examples} */
      const { examples } = await getSurely("v1/examples", signal);
      this.examples = examples;
      const wanted = query.get("example");
      const example = examples.find(({ name }) => name === wanted) ?? (from || mesh || this.text ? undefined : examples[0]);
      if (example) this.setProblem(withoutDefaults(example.problem));
    } catch (error) {
      if (!signal.aborted) this.error = error;
    }
    this.draw();
  }

  async makeEditor() {
    if (this.editor) return;
    const place = /** @type {HTMLElement} */ (this.root.querySelector("#editor"));
    try {
      const [{ createEditor }] = await Promise.all([
        import("../vendor/prism-code-editor-5.4.0/dist/index.js"),
        import("../vendor/prism-code-editor-5.4.0/dist/prism/languages/json.js"),
      ]);
      addStylesheet("../vendor/prism-code-editor-5.4.0/dist/layout.css");
      const editor = createEditor(place, { language: "json", value: "", tabSize: 2, wordWrap: false });
      editor.textarea.setAttribute("aria-label", "The problem as JSON");
      editor.on("update", (/** @type {string} */ value) => this.typed(value));
      this.editor = editor;
    } catch {
      // a plain field will do
      const area = document.createElement("textarea");
      Object.assign(area, { className: "plain", spellcheck: false });
      area.setAttribute("aria-label", "The problem as JSON");
      area.addEventListener("input", () => this.typed(area.value));
      place.replaceChildren(area);
      this.editor = {
        textarea: area,
        setOptions: (/** @type {{value: string}} */ { value }) => {
          area.value = value;
          this.typed(value);
        },
      };
    }
  }

  /** @param {unknown} problem */
  setProblem(problem) {
    this.varied.clear();
    this.faults.clear();
    this.notes = [];
    this.error = null;
    this.setText(pretty(problem));
  }

  /** @param {string} text */
  setText(text) {
    this.editor?.setOptions({ value: text });
    if (this.text !== text) this.typed(text);
  }

  /** @param {string} text */
  typed(text) {
    if (text === this.text) return;
    this.text = text;
    this.key = newKey();
    try {
      this.problem = text.trim() ? JSON.parse(text) : null;
      this.malformed = null;
    } catch (error) {
      this.problem = null;
      this.malformed = /** @type {Error} */ (error).message;
    }
    clearTimeout(this.soon);
    this.soon = setTimeout(() => this.check(), PAUSE);
    this.drawSoon();
  }

  drawSoon() {
    if (this.due) return;
    this.due = requestAnimationFrame(() => {
      this.due = 0;
      this.draw();
    });
  }

  /** What is submitted: a problem, or the base of a sweep. */
  base() {
    return this.problem?.base ?? this.problem?.problem ?? this.problem;
  }

  /** Where the problem stands in the text. */
  prefix() {
    return this.problem?.base ? "/base" : this.problem?.problem ? "/problem" : "";
  }

  async check() {
    this.checking?.abort();
    const checking = (this.checking = new AbortController());
    const signal = AbortSignal.any([checking.signal, this.closed.signal]);
    if (!this.problem) {
      this.checked = null;
      this.draw();
      return;
    }
    const body = JSON.stringify({ problem: this.base() });
    const init = { method: "POST", body, headers: { "content-type": "application/json" }, signal };
    try {
      const answer = await request("v1/problems/validate", { ...init });
      this.checked = await answer.json();
      this.error = null;
    } catch (error) {
      if (signal.aborted) return;
      this.error = error;
      this.checked = null;
    }
    this.draw();
    this.mark();
    if (this.checked && !this.checked.violations.length) {
      try {
        const view = await getView("v1/problems/view", init);
        this.boundaries = view.head.boundaries.map((/** @type {{name: string}} */ { name }) => name);
        this.drawing?.setBody(view);
        this.drawable = true;
      } catch (error) {
        if (signal.aborted) return;
        this.drawable = false;
      }
      this.draw();
    }
  }

  /** Marks the lines of the text that have violations. */
  mark() {
    const lines = this.editor?.lines ?? this.editor?.wrapper?.children;
    if (!lines) return;
    const all = places(this.text);
    const faulty = new Set((this.checked?.violations ?? []).map((violation) => this.line(all, violation.pointer)));
    [...lines].forEach((/** @type {Element} */ line, /** @type {number} */ n) => line.classList.toggle("faulty", faulty.has(n)));
  }

  /**
   * The line of a pointer of the service, whose problem is in a body of its own.
   * @param {Map<string, import("../pointers.js").Range>} all
   * @param {string} pointer
   */
  line(all, pointer) {
    const own = pointer.replace(/^\/problem/, this.prefix());
    return lineOf(this.text, nearest(all, own)?.start ?? 0);
  }

  /** @param {string} pointer */
  goTo(pointer) {
    const own = pointer.replace(/^\/problem/, this.prefix());
    const range = nearest(places(this.text), own);
    const area = /** @type {HTMLTextAreaElement | undefined} */ (this.editor?.textarea);
    if (!range || !area) return;
    area.focus();
    area.setSelectionRange(range.start, Math.min(range.end, range.start + 2000));
    const line = this.root.querySelectorAll(".pce-line")[lineOf(this.text, range.start) - 1];
    line?.scrollIntoView({ block: "center" });
  }

  /**
   * Replaces a value in the text, and leaves everything else as it is written.
   * @param {string} pointer
   * @param {string} value
   */
  replace(pointer, value) {
    const range = places(this.text).get(pointer);
    if (range) this.setText(this.text.slice(0, range.start) + value + this.text.slice(range.end));
  }

  /** @param {File} file */
  async openFile(file) {
    this.error = null;
    this.told = "";
    this.busy = `Reading ${file.name}`;
    this.draw();
    try {
      await this.read(file);
    } catch (error) {
      this.error = error;
    }
    this.busy = "";
    this.draw();
  }

  /** @param {File} file */
  async read(file) {
    const ending = file.name.split(".").pop()?.toLowerCase() ?? "";
    this.name ||= file.name.replace(/\.[^.]+$/, "");
    if (ending === "json") {
      const text = await file.text();
      if (text.length <= LARGE) return this.setText(text);
      const document = JSON.parse(text);
      if (document.nodes && document.elements) return this.useMesh(await upload(file));
      return this.setProblem(await this.withStoredMesh(document));
    }
    if (ending === "inp") {
      const text = await file.text();
      if (/^\s*\*step/im.test(text)) {
        const answer = await request("v1/problems/convert", { method: "POST", body: text, headers: { "content-type": "application/octet-stream" } });
        /** @type {{problem: any, warnings: import("../types").Warning[]}} */
        const { problem, warnings } = await answer.json();
        this.setProblem(await this.withStoredMesh(problem));
        this.notes = warnings;
        return undefined;
      }
    }
    return this.useMesh(await upload(file));
  }

  /**
   * A problem whose mesh, if it is large, is stored by itself: a text of a hundred thousand nodes is nothing to edit.
   * @param {any} problem
   */
  async withStoredMesh(problem) {
    const { inline, ...mesh } = problem.mesh ?? {};
    if (!inline || JSON.stringify(inline).length < LARGE / 10) return problem;
    const info = await upload(new Blob([JSON.stringify(inline)]));
    return { ...problem, mesh: { stored: info.hash, ...mesh } };
  }

  /** @param {import("../types").MeshInfo} info */
  async useMesh(info) {
    const names = Object.keys(info.boundaries);
    this.setProblem({
      analysis: { kind: "plane_strain" },
      mesh: { stored: info.hash },
      materials: [{ youngs_modulus: 210000, poissons_ratio: 0.3 }],
      supports: [],
      contacts: [],
    });
    this.notes = info.warnings;
    this.boundaries = names;
    this.told = `The mesh is stored: ${format.counted(info.nodes, "node")}. Nothing is held or pressed yet: click a boundary in the picture. E = 210000 and ν = 0.3 are assumed: correct them.`;
    this.drawing?.setBody(await getView(`v1/meshes/${info.hash}/view`, { signal: this.closed.signal }));
    this.draw();
  }

  /**
   * Adds an entry for a boundary.
   * @param {"supports" | "loads" | "contacts"} list
   * @param {object} entry
   */
  add(list, entry) {
    const base = this.base();
    if (!base) return;
    base[list] = [...(base[list] ?? []), entry];
    this.setText(pretty(this.problem));
  }

  /**
   * Whether a list has an entry for a boundary.
   * @param {"supports" | "loads" | "contacts"} list
   * @param {string} boundary
   */
  has(list, boundary) {
    return (this.base()?.[list] ?? []).some((/** @type {any} */ entry) => entry?.boundary === boundary);
  }

  /**
   * Takes the entries for a boundary away.
   * @param {"supports" | "loads" | "contacts"} list
   * @param {string} boundary
   */
  remove(list, boundary) {
    const base = this.base();
    base[list] = base[list].filter((/** @type {any} */ entry) => entry?.boundary !== boundary);
    this.setText(pretty(this.problem));
  }

  async submit() {
    const base = this.base();
    if (!base || this.busy) return;
    const pairs = this.labels.split(/[\s,]+/).filter(Boolean);
    const wrong = pairs.find((pair) => !/^[^=]+=./.test(pair));
    if (wrong) {
      this.error = new Error(`A label is key=value, such as study=depth, without spaces; "${wrong}" is none.`);
      this.draw();
      return;
    }
    this.busy = "Submitting";
    this.error = null;
    this.draw();
    const labels = Object.fromEntries(pairs.map((pair) => {
      const [key = "", ...value] = pair.split("=");
      return [key, value.join("=")];
    }));
    const envelope = {
      ...(this.name ? { name: this.name } : {}),
      ...(Object.keys(labels).length ? { labels } : {}),
      ...(this.priority ? { priority: Number(this.priority) } : {}),
    };
    const headers = { "idempotency-key": this.key };
    try {
      if (this.problem.base || this.varied.size) {
        const axes = [...this.varied].map(([path, values]) => ({ path, values }));
        const sweep = this.problem.base ? this.problem : { base, axes };
        /** @type {import("../types").Sweep} */
        const accepted = await send("POST", "v1/sweeps", { ...sweep, ...envelope }, headers);
        location.hash = address(`sweeps/${accepted.id}`);
      } else {
        const more = this.cache === "use" ? {} : { cache: this.cache };
        /** @type {import("../types").Job} */
        const job = await send("POST", "v1/jobs", { problem: base, ...envelope, ...more }, headers);
        location.hash = parts.jobAddress(job.id);
      }
    } catch (error) {
      if (error instanceof ApiError && error.violations.length && this.checked) {
        this.checked = { ...this.checked, valid: false, violations: error.violations };
      } else {
        this.error = error;
      }
      // a request whose answer was lost may have been accepted: the same key finds its job
      if (error instanceof ApiError) this.key = newKey();
    }
    this.busy = "";
    if (!this.closed.signal.aborted) this.draw();
  }

  draw() {
    render(this.drawn(), this.root);
    this.drawing ??= new Drawing(/** @type {HTMLElement} */ (this.root.querySelector("#picture")), {
      label: "The problem",
      read: (text) => {
        const place = this.root.querySelector("#picture-readout");
        if (place) place.textContent = text;
      },
      picked: (boundary) => {
        this.boundary = boundary;
        this.draw();
      },
    });
  }

  drawn() {
    const over = (/** @type {boolean} */ on) => (/** @type {DragEvent} */ event) => {
      event.preventDefault();
      this.root.querySelector(".drop")?.classList.toggle("over", on);
    };
    return html`<div @dragover=${over(true)} @dragleave=${over(false)} @drop=${(/** @type {DragEvent} */ event) => {
        over(false)(event);
        const file = event.dataTransfer?.files[0];
        if (file) this.openFile(file);
      }}>
      <h1>New job</h1>
      <details class="panel"><summary>Examples: ${this.examples.length} problems to begin with</summary>
        <div class="examples">${this.examples.map((example) => html`<button type="button" @click=${() => this.setProblem(withoutDefaults(example.problem))}>
          <strong>${example.title || example.name}</strong><br /><span class="note">${example.description}</span></button>`)}</div></details>
      <p class="drop"><label>Open a file: a problem (.json), a deck of Abaqus or CalculiX (.inp), a mesh of Gmsh (.msh)
        <input type="file" accept=".json,.inp,.msh" @change=${(/** @type {Event} */ event) => {
          const file = /** @type {HTMLInputElement} */ (event.target).files?.[0];
          if (file) this.openFile(file);
        }} /></label> or drop it here</p>
      ${this.busy ? parts.loading(this.busy) : nothing}
      ${this.error ? parts.errorBox(this.error) : nothing}
      ${this.told ? html`<p class="box" role="status">${this.told}</p>` : nothing}
      ${this.notes.map((note) => html`<p class="box warning">${note.message}</p>`)}
      <div class="columns">
        <div>
          <section class="panel"><h2>The problem <a class="note" href="v1/schema/problem.json">all fields</a></h2><div id="editor" class="editor"></div></section>
          ${this.drawControls()}
        </div>
        <div>
          ${this.drawSubmit()}
          <section class="panel"><h2>Picture</h2>${this.drawable && (!this.checked || this.checked.valid) ? nothing : html`<p class="note">The picture is of what could be drawn last, not of the problem as it stands.</p>`}<div id="picture"></div>
            <p class="readout" id="picture-readout"></p>${this.drawBoundary()}</section>
          ${this.drawFindings()}
        </div>
      </div></div>`;
  }

  drawSubmit() {
    const checked = this.checked;
    const members = [...this.varied.values()].reduce((product, values) => product * values.length, 1);
    const word = this.problem?.base ? "Submit the sweep" : this.varied.size ? `Submit a sweep of ${members}` : "Submit";
    const field = (/** @type {"name" | "labels" | "priority"} */ name) => (/** @type {Event} */ event) => {
      this[name] = /** @type {HTMLInputElement} */ (event.target).value;
    };
    return html`<section class="panel"><h2>Submit</h2>
      ${checked?.description ? html`<p>${checked.description}</p>` : nothing}
      <p class="note">${this.malformed ? html`<strong>The text is no JSON:</strong> ${this.malformed}` : checked?.valid && checked.estimate ? this.drawEstimate(checked) : ""}</p>
      ${members > 1 ? html`<p class="note">${format.counted(members, "member")}: ${[...this.varied].map(([pointer, values]) => `${pointer} = ${values.join(", ")}`).join("; ")}. The sentence and the estimate are those of the first.</p>` : nothing}
      <form class="plain-form" @submit=${(/** @type {Event} */ event) => {
        event.preventDefault();
        this.submit();
      }}>
        <label>Name <input name="name" .value=${this.name} @input=${field("name")} maxlength="256" /></label>
        <label>Labels <input name="labels" .value=${this.labels} @input=${field("labels")} placeholder="study=radius part=a" /></label>
        ${this.app.may("admin") ? html`<label>Priority <input name="priority" type="number" min="-10" max="10" .value=${this.priority} @input=${field("priority")} /></label>` : nothing}
        <label>If it was solved before <select @change=${(/** @type {Event} */ event) => {
          this.cache = /** @type {HTMLSelectElement} */ (event.target).value;
        }}><option value="use">take that result</option><option value="refresh">solve it again</option></select></label>
        <button class="primary" ?disabled=${!this.problem || Boolean(this.busy) || this.faults.size > 0 || (checked !== null && !checked.valid)}>${word}</button>
      </form></section>`;
  }

  /** @param {Validation} checked */
  drawEstimate(checked) {
    const shown = (/** @type {import("../types").Estimate} */ { dofs, memory_bytes, run_s }) =>
      `${format.count(dofs)} unknowns, ${format.bytes(memory_bytes)}, ${format.duration(run_s)}`;
    const { estimate, first_mesh: first } = checked;
    if (!estimate) return nothing;
    return first ? html`First mesh ${shown(first)}; at most ${shown(estimate)}, and most problems end far below.` : html`About ${shown(estimate)}.`;
  }

  drawFindings() {
    const checked = this.checked;
    if (!checked || (!checked.violations.length && !checked.warnings.length)) return nothing;
    const all = places(this.text);
    return html`<section class="panel" aria-live="polite"><h2>${checked.violations.length ? format.counted(checked.violations.length, "violation") : "Valid, with remarks"}</h2>
      <ul class="violations">${checked.violations.slice(0, 100).map((violation) => html`<li><button type="button" @click=${() => this.goTo(violation.pointer)}>
        <strong>line ${this.line(all, violation.pointer)}</strong> <code>${violation.pointer.replace(/^\/problem/, "") || "/"}</code><br />expected ${violation.expected}, got ${violation.got}. ${violation.hint}</button></li>`)}</ul>
      ${checked.warnings.map((warning) => html`<p class="box warning"><strong>${warning.severity}</strong> ${warning.message}</p>`)}</section>`;
  }

  drawBoundary() {
    if (!this.boundary) return this.boundaries.length ? html`<p class="note">Boundaries: ${this.boundaries.join(", ")}. Click one.</p>` : nothing;
    const boundary = this.boundary;
    return html`<p>Boundary <strong>${boundary}</strong>: ${ENTRIES.map(([list, word, without, entry]) => this.has(list, boundary)
        ? html`<button type="button" class="small on" @click=${() => this.remove(list, boundary)}>${without}</button> `
        : html`<button type="button" class="small" @click=${() => this.add(list, { boundary, ...entry })}>${word}</button> `)}</p>`;
  }

  drawControls() {
    const base = this.base();
    if (!base || typeof base !== "object") return nothing;
    /** @type {[string, string, number][]} */
    const found = [];
    for (const [pointer, range] of places(this.text)) {
      const own = pointer.slice(this.prefix().length);
      const control = pointer.startsWith(this.prefix()) ? CONTROLS.find(([pattern]) => pattern.test(own)) : undefined;
      const value = Number(this.text.slice(range.start, range.end));
      if (control && Number.isFinite(value)) found.push([own, control[1], value]);
    }
    if (!found.length || this.problem?.base) return nothing;
    const several = (/** @type {string} */ own) => /\/(\d+)\//.exec(own)?.[1];
    return html`<section class="panel"><h2>What people change</h2><div class="controls">${found.slice(0, 40).map(
      ([own, label, value]) => html`<label>${label}${Number(several(own)) > 0 ? ` ${Number(several(own)) + 1}` : ""}
        <input .value=${this.faults.get(own)?.text ?? this.varied.get(own)?.join(", ") ?? String(value)} aria-invalid=${this.faults.has(own)} inputmode="decimal" @change=${(/** @type {Event} */ event) => this.changed(own, /** @type {HTMLInputElement} */ (event.target).value)} />${this.faults.has(own) ? html`<span class="fault" role="alert">${this.faults.get(own)?.fault}</span>` : nothing}</label>`,
    )}${this.drawRefine(base)}</div><p class="note">Several values, such as <code>0.1, 0.2, 0.3</code>, make a sweep: all of them are solved, as one table.</p></section>`;
  }

  /**
   * A control that has the mesh refined where the errors come from, in a problem whose mesh is not.
   * @param {any} base
   */
  drawRefine(base) {
    if (!base.mesh || typeof base.mesh !== "object" || base.mesh.refine) return nothing;
    return html`<label>refine until errors are below
      <input placeholder="not refined; 0.01 is 1 %" inputmode="decimal" @change=${(/** @type {Event} */ event) => {
        const read = format.typedNumbers(/** @type {HTMLInputElement} */ (event.target).value);
        if ("fault" in read) return this.app.say(read.fault);
        base.mesh.refine = { tolerance: read.numbers[0] };
        this.setText(pretty(this.problem));
      }} /></label>`;
  }

  /**
   * @param {string} own pointer in the problem
   * @param {string} text
   */
  changed(own, text) {
    const read = format.typedNumbers(text);
    this.key = newKey();
    if ("fault" in read) {
      // what was typed stays where it is, and nothing else is submitted in its place
      this.faults.set(own, { text, fault: read.fault });
    } else {
      this.faults.delete(own);
      if (read.numbers.length > 1) this.varied.set(own, read.numbers);
      else this.varied.delete(own);
      this.replace(this.prefix() + own, String(read.numbers[0]));
    }
    this.draw();
  }
}

/**
 * Stores a mesh file.
 * @param {Blob} file
 * @returns {Promise<import("../types").MeshInfo>}
 */
async function upload(file) {
  const answer = await request("v1/meshes", { method: "POST", body: file, headers: { "content-type": "application/octet-stream" } });
  return answer.json();
}

/** @param {string} path */
function addStylesheet(path) {
  const href = new URL(path, import.meta.url).href;
  if ([...document.styleSheets].some((sheet) => sheet.href === href)) return;
  const link = document.createElement("link");
  Object.assign(link, { rel: "stylesheet", href });
  document.head.append(link);
}

/** What a problem has where nothing is given: left out, so that a text has what a person wrote. */
const DEFAULTS = /** @type {Record<string, unknown>} */ ({
  quadrature: 3,
  supports: [],
  loads: [],
  contacts: [],
  steps: [],
  kernel: "bump",
  normalization: "unit_integral",
  transition: "linear",
  history: "total",
  points: "gauss3",
  measure: "line",
  cohesion: 0,
  along: "x",
  condition: "unilateral",
});

/**
 * A problem without the defaults that the service has filled in.
 * @param {any} problem
 * @returns {any}
 */
function withoutDefaults(problem) {
  if (Array.isArray(problem)) return problem.map(withoutDefaults);
  if (problem === null || typeof problem !== "object") return problem;
  const kept = Object.entries(problem).filter(([name, value]) => {
    if (value === null || (name === "solver" && isDefaultSolver(value))) return false;
    if (["boundaries", "groups", "curves", "node_sets"].includes(name) && Object.keys(/** @type {object} */ (value)).length === 0) return false;
    return !(name in DEFAULTS && JSON.stringify(value) === JSON.stringify(DEFAULTS[name]));
  });
  return Object.fromEntries(kept.map(([name, value]) => [name, withoutDefaults(value)]));
}

/** @param {any} solver */
function isDefaultSolver(solver) {
  const { algorithm = "auto", tolerance = 1e-10, max_iterations = 200, check_uniqueness = false, check_increments = false, accuracy = "estimate", ...rest } = solver;
  return algorithm === "auto" && tolerance === 1e-10 && max_iterations === 200 && !check_uniqueness && !check_increments && accuracy === "estimate" && Object.values(rest).every((value) => value === null || JSON.stringify(value) === "{}");
}
