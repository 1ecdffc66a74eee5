/** One job: watched while it runs, read when it has ended. */

import { html, nothing, render } from "../vendor/lit-html-3.3.3/lit-html.js";
import { ApiError, getSurely, newKey, request, send } from "../api.js";
import { Chart, thinned } from "../chart.js";
import * as format from "../format.js";
import * as parts from "../parts.js";
import { address, go } from "../route.js";
import { follow } from "../stream.js";
import { BodyPanel } from "./body.js";
import { ProfilePanel } from "./profile.js";

/** @typedef {import("../types").Job} Job */
/** @typedef {import("../types").Result} Result */
/** @typedef {import("../types").HistoryRow & {attempt: number}} Row */
/** @typedef {import("../app.js").App} App */

/** The number of rows of a history that the first picture has. */
const FIRST_ROWS = 1000;
/** The shortest time between two pictures of a running job (ms). */
const PACE = 200;
/** How often a running job is asked for a partial result (ms). */
const POLL = 2000;

/**
 * @param {HTMLElement} root
 * @param {import("../route.js").Route} here
 * @param {App} app
 * @returns {import("../app.js").Open}
 */
export function open(root, here, app) {
  return new JobView(root, here, app);
}

class JobView {
  /** @type {Job | null} */
  job = null;
  /** @type {Result | null} */
  result = null;
  /** @type {Row[]} */
  rows = [];
  /** The meshes of adaptive refinement, as they were told. @type {{number: number, elements: number, error: number | null}[]} */
  meshes = [];
  /** @type {import("../types").Warning[]} */
  warnings = [];
  /** @type {ProfilePanel | undefined} */
  profiles;
  /** @type {BodyPanel | undefined} */
  body;
  /** @type {Chart | undefined} */
  residuals;
  /** @type {Chart | undefined} */
  forces;
  /** @type {Chart | undefined} */
  refining;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  soon;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  next;
  /** @type {ReturnType<typeof setInterval> | undefined} */
  poll;
  /** @type {(() => void) | undefined} */
  unfollow;
  description = "";
  /** Whether the job whose result has answered this one may be seen. */
  earlier = false;
  /** @type {unknown} */
  error = null;
  language = "Python";
  asking = false;
  /** When it was drawn last (ms). */
  drawnAt = 0;

  /**
   * @param {HTMLElement} root
   * @param {import("../route.js").Route} here
   * @param {App} app
   */
  constructor(root, here, app) {
    this.root = root;
    this.app = app;
    this.id = here.path[1] ?? "";
    this.query = here.query;
    this.closed = new AbortController();
    this.clock = setInterval(() => this.job && !this.ended() && this.drawSoon(), 1000);
    render(parts.loading("Loading the job"), root);
    this.load();
  }

  /** @param {import("../route.js").Route} here */
  update(here) {
    this.query = here.query;
    this.profiles?.setStep(this.query.get("step"));
  }

  close() {
    this.closed.abort();
    this.unfollow?.();
    clearInterval(this.clock);
    clearInterval(this.poll);
    clearTimeout(this.soon);
    clearTimeout(this.next);
    for (const part of [this.residuals, this.forces, this.refining, this.profiles, this.body]) part?.close();
  }

  ended() {
    return this.job !== null && ["succeeded", "failed", "canceled"].includes(this.job.status);
  }

  /** Whether the numbers are those of a state at which the job stopped. */
  partial() {
    return this.job !== null && ["failed", "canceled"].includes(this.job.status);
  }

  path(/** @type {string} */ rest) {
    return `v1/jobs/${this.id}${rest}`;
  }

  async load() {
    const { signal } = this.closed;
    const history = this.loadHistory();
    try {
      this.job = /** @type {Job} */ (await getSurely(this.path(""), signal));
    } catch (error) {
      if (signal.aborted) return;
      this.error = error;
      this.draw();
      return;
    }
    this.app.title(this.name());
    this.draw();
    const attempt = this.job?.attempt ?? 1;
    if (this.ended()) {
      await Promise.all([history.then((rows) => this.take(rows, attempt)), this.loadResult()]);
    } else {
      this.take(await history, attempt);
      if (signal.aborted) return;
      const last = this.rows[this.rows.length - 1];
      // it has ended meanwhile: all its events come, and rows without a number would come twice
      if (last && (last.seq === null || last.seq === undefined)) this.rows = [];
      this.watch(last?.seq ?? 0);
      if (this.job?.result_available === "partial") this.loadResult();
      this.poll = setInterval(() => this.ask(), POLL);
    }
    if (signal.aborted) return;
    this.body?.load(this.job, this.partial());
    this.loadDescription();
    if (this.job.cached_from) {
      const earlier = request(`v1/jobs/${this.job.cached_from}`, { signal });
      earlier.then(() => (this.earlier = true), () => undefined).then(() => this.drawSoon());
    }
  }

  name() {
    return this.job?.name ?? `job …${this.id.slice(-6)}`;
  }

  async loadDescription() {
    /** @type {import("../types").Description} */
    const told = await getSurely(this.path("/description"), this.closed.signal).catch(() => ({ description: "" }));
    this.description = told.description;
    this.drawSoon();
  }

  /** @returns {Promise<import("../types").HistoryRow[]>} */
  loadHistory() {
    return getSurely(this.path(`/history?format=json&partial=true&max_points=${FIRST_ROWS}`), this.closed.signal).catch(() => []);
  }

  /**
   * @param {import("../types").HistoryRow[]} rows
   * @param {number} attempt whose rows they are
   */
  take(rows, attempt) {
    this.rows = rows.map((row) => ({ ...row, attempt }));
    this.draw();
  }

  async loadResult() {
    const { signal } = this.closed;
    if (!this.job || this.job.result_available === "none") return;
    try {
      /** @type {Result} */
      const result = await getSurely(this.path("/result"), signal);
      // asked while the job ran, and answered after its end
      if (result.result_available === "partial" && this.ended() && !this.partial()) return;
      this.result = result;
    } catch (error) {
      if (signal.aborted || (error instanceof ApiError && [404, 409].includes(error.status))) return;
      this.error = error;
    }
    this.draw();
    if (this.result) this.profiles?.load(this.job, this.result, this.partial());
  }

  /** @param {number} after the number of the last event that is known */
  watch(after) {
    this.unfollow = follow((last) => this.path(`/events?after_seq=${last}`), String(after), {
      event: (event) => this.told(event),
      refused: (error) => {
        this.error = error;
        this.draw();
      },
    });
  }

  /** Asks how far a running job is: whether it has a partial result is no event. */
  async ask() {
    if (document.hidden || this.ended() || this.asking) return;
    this.asking = true;
    const before = this.job;
    /** @type {Job} */
    const job = await getSurely(this.path(""), this.closed.signal).catch(() => /** @type {any} */ (before));
    this.asking = false;
    if (this.ended() || !job) return;
    this.job = job;
    if (job.result_available === "partial") await this.loadResult();
    this.drawSoon();
  }

  /** @param {any} event */
  told(event) {
    if (!this.job) return;
    switch (event.type) {
      case "iteration":
        this.rows.push(event);
        break;
      case "mesh":
        this.meshes.push({ number: event.number, elements: event.elements, error: event.error ?? null });
        break;
      case "stage":
        this.job = { ...this.job, progress: { ...emptyProgress, ...this.job.progress, stage: event.stage } };
        break;
      case "warning":
        this.warnings.push(event);
        break;
      case "status":
        if (event.attempt > this.job.attempt) Object.assign(this, { meshes: [], warnings: [] });
        this.job = { ...this.job, status: event.status, attempt: Math.max(this.job.attempt, event.attempt) };
        if (event.reason) this.app.say(event.reason === "drain" ? "The service stops: the job waits again." : `The job waits again: ${format.words(event.reason)}.`);
        this.ask();
        break;
      case "done":
        this.job = event.job;
        clearInterval(this.poll);
        this.draw();
        this.app.say(`${this.name()} ${{ succeeded: "has succeeded", failed: "has failed" }[/** @type {string} */ (event.job.status)] ?? "was canceled"}.`);
        this.loadResult();
        this.body?.load(event.job, this.partial());
        return;
    }
    this.drawSoon();
  }

  drawSoon() {
    if (this.soon) return;
    const pause = Math.max(0, PACE - (performance.now() - this.drawnAt));
    this.soon = setTimeout(() => {
      this.soon = undefined;
      if (!this.closed.signal.aborted) this.draw();
    }, pause);
  }

  draw() {
    this.drawnAt = performance.now();
    if (!this.job) {
      render(this.error ? html`<h1>No such job</h1>${parts.errorBox(this.error)}<p><a href="#/jobs">All jobs</a></p>` : parts.loading("Loading the job"), this.root);
      return;
    }
    render(this.drawn(this.job), this.root);
    this.drawCharts();
  }

  /** @param {Job} job */
  drawn(job) {
    const contacts = this.rows.length > 0 || this.result !== null;
    return html`<p class="crumbs"><a href="#/jobs">Jobs</a> › <span>${this.id}</span></p>
      <div class="head">
        <h1>${this.name()}</h1>
        ${parts.statusBadge(job.status, this.drawTime(job))}
        ${parts.labelChips(job.labels, (key, value) => address("jobs", { [`label.${key}`]: value }))}
        ${job.owner === "local" ? nothing : html`<span class="note">${job.owner}</span>`}
        <div class="actions">${this.drawActions(job)}</div>
      </div>
      ${this.error ? parts.errorBox(this.error) : nothing}
      ${this.ended() ? this.drawVerdict(job) : this.drawProgress(job)}
      <div class="columns">
        <div>
          <section class="panel" ?hidden=${!this.result} id="profile"></section>
          <section class="panel" ?hidden=${!contacts || this.rows.length < 2}>
            <h2>${this.ended() ? "Convergence" : "Convergence, live"} ${this.drawAttempts()}</h2>
            <div id="residuals"></div>
            <p class="readout" id="residual-readout"></p>
            <p class="legend"><span><i></i>friction residual</span><span class="c2"><i></i>contact residual</span><span class="old"><i></i>tolerance${this.attempts() > 1 ? ", and earlier attempts" : ""}</span></p>
            <h3>Forces</h3>
            <div id="forces"></div>
            <p class="legend"><span><i></i>normal force</span><span class="c2"><i></i>tangential force</span></p>
            ${this.drawIterations()}
          </section>
          <section class="panel" id="body"></section>
        </div>
        <div>
          ${this.drawNumbers()}
          <section class="panel" ?hidden=${this.refinements().length < 2}><h2>Error by mesh</h2><div id="refining"></div>
            <p class="note">The largest relative error against the number of elements.</p></section>
          <section class="panel"><h2>The problem in words</h2>
            ${this.description ? html`<p>${this.description}</p>` : nothing}
            <p class="note">${job.cached_from ? html`Answered by the result of ${this.earlier ? html`<a href=${parts.jobAddress(job.cached_from)}>an earlier job</a>` : "an earlier job"} with the same problem. ` : nothing}
            ${job.parent ? html`Tried again after <a href=${parts.jobAddress(job.parent)}>another job</a>. ` : nothing}
            ${job.sweep ? html`Solves members of <a href=${address(`sweeps/${job.sweep}`)}>a sweep</a>. ` : nothing}
            Accepted ${parts.age(job.created_at)}, ${format.exactly(job.created_at)}${job.started_at ? html`, waited ${format.duration(job.queue_wait_s)}` : nothing}.</p></section>
          ${this.drawDownloads(job)} ${this.drawCode()}
        </div>
      </div>`;
  }

  /** @param {Job} job */
  drawTime(job) {
    if (job.status === "running" && job.started_at) return `, ${format.duration((Date.now() - Date.parse(job.started_at)) / 1000)}`;
    return job.run_s === null || job.run_s === undefined ? "" : ` ${job.status === "succeeded" ? "in" : "after"} ${format.duration(job.run_s)}`;
  }

  /** @param {Job} job */
  drawActions(job) {
    const act = (/** @type {string} */ word, /** @type {() => Promise<void>} */ action) =>
      html`<button type="button" @click=${() => action().catch((error) => this.app.say(error.message))}>${word}</button>`;
    return html`
      ${!this.ended() && this.app.may("cancel")
        ? act(job.cancel_requested ? "Is being canceled" : "Cancel", async () => {
            const whose = job.owner === "local" || job.owner === this.app.me.owner ? "this job" : `this job of ${job.owner}`;
            if (!confirm(`Cancel ${whose}?`)) return;
            const answer = await send("POST", this.path("/cancel"));
            this.job = /** @type {any} */ (answer).job;
            this.draw();
          })
        : nothing}
      <a class="button" href=${address("compare", { ids: this.id })}>Compare</a>
      ${this.ended() && this.app.may("submit")
        ? html`${act(job.pinned ? "Unpin" : "Pin", async () => {
            this.job = await send("PATCH", this.path(""), { pinned: !job.pinned });
            this.draw();
          })}
          ${act("Rename", async () => {
            const name = prompt("Name of the job", job.name ?? "");
            if (name === null) return;
            this.job = await send("PATCH", this.path(""), { name: name || null });
            this.draw();
          })}`
        : nothing}
      ${this.partial() && this.app.may("submit")
        ? act("Retry", async () => {
            /** @type {Job} */
            const again = await send("POST", this.path("/retry"), undefined, { "idempotency-key": newKey() });
            location.hash = parts.jobAddress(again.id);
          })
        : nothing}
      ${this.ended() && this.app.may("cancel")
        ? act("Delete …", async () => {
            if (!confirm("Delete this job and its result?")) return;
            await send("DELETE", this.path(""));
            go("#/jobs");
          })
        : nothing}
      ${this.app.may("submit") ? html`<a class="button primary" href=${address("new", { from: this.id })}>Edit and submit again</a>` : nothing}`;
  }

  /** @param {Job} job */
  drawVerdict(job) {
    const assessment = this.result?.assessment ?? null;
    const found = parts.trust({ ...job, warnings: job.warnings ?? [] });
    const kind = job.status === "succeeded" ? (found?.kind ?? "good") : "poor";
    const summary = this.result?.summary;
    const warnings = summary?.warnings ?? job.warnings ?? [];
    const said = (assessment?.sentence ?? "").toLowerCase();
    const others = (assessment?.findings ?? []).filter((finding) => !said.includes(finding.text.toLowerCase().replace(/\.$/, "")));
    return html`<section class="panel verdict trust-${kind}" aria-label="Verdict">
      ${job.status === "succeeded" ? parts.trustBadge(job) : html`<span class="badge failed">✕ no solution</span>`}
      ${job.failure
        ? html`<p class="sentence">${job.failure.title}</p><p>${format.sentence(job.failure.detail)} <a href=${`v1/errors/${job.failure.code}`} target="_blank">What to do</a></p>`
        : job.status === "canceled"
          ? html`<p class="sentence">The job was canceled before it was solved.</p>`
          : html`<p class="sentence">${assessment?.sentence ?? (summary ? "The result has no stated errors." : "Loading the result …")}</p>`}
      ${this.partial() && this.result ? html`<p class="box warning">What is shown below is the state at which the job stopped, not a solution.</p>` : nothing}
      ${others.length ? html`<ul>${others.map((finding) => html`<li>${finding.text}</li>`)}</ul>` : nothing}
      ${summary
        ? html`<p class="note">${format.counted(summary.iterations, "iteration")} · residual ${format.number(Math.max(summary.residuals.kkt, summary.residuals.friction), 2)} · forces in balance to ${format.number(summary.residuals.equilibrium, 2)}
            ${summary.uniqueness ? ` · ${summary.uniqueness.agrees ? "one solution" : "not unique"}` : ""}
            ${summary.contraction ? ` · contraction ${format.number(summary.contraction, 2)}` : ""}</p>`
        : nothing}
      ${warnings.length
        ? html`<details ?open=${warnings.some((warning) => warning.severity === "serious")}><summary>${format.countedWarnings(warnings)}</summary>
            <ul>${warnings.map((warning) => html`<li><strong>${warning.severity}</strong> ${warning.message} <a href=${`v1/warnings/${warning.code}`} target="_blank">${format.words(warning.code)}</a> <code>${warning.pointer}</code></li>`)}</ul></details>`
        : nothing}
    </section>`;
  }

  /** @param {Job} job */
  drawProgress(job) {
    if (job.status === "queued") {
      return html`<section class="panel verdict" role="status"><p class="sentence">Waits: ${format.waits(job.queue)}.</p></section>`;
    }
    const progress = job.progress;
    const own = this.rows.findIndex((row) => row.attempt === job.attempt);
    const last = own < 0 ? undefined : this.rows[this.rows.length - 1];
    const begun = own < 0 ? undefined : this.rows[own];
    const residual = last ? Math.max(last.residual, last.friction_residual) : progress?.residual;
    const tolerance = last?.tolerance ?? progress?.tolerance ?? null;
    const start = begun ? Math.max(begun.residual, begun.friction_residual) : null;
    const part = residual && tolerance && start && start > tolerance ? Math.log(residual / start) / Math.log(tolerance / start) : null;
    const mesh = this.meshes[this.meshes.length - 1] ?? (progress?.mesh ? { number: progress.mesh, elements: progress.mesh_elements, error: progress.mesh_error } : null);
    return html`<section class="panel verdict" aria-label="Progress">
      <p class="sentence">${last ? html`Iteration ${format.count(last.k)}` : html`${format.words(progress?.stage || "starts")}`}
        ${residual && tolerance ? html`<span class="note"> residual ${format.number(residual, 2)} → ${format.number(tolerance, 2)}</span>` : nothing}
        ${last?.contraction ? html`<span class="note"> × ${format.number(last.contraction, 2)} per iteration</span>` : nothing}
        ${progress?.eta_s ? html`<span class="note"> about ${format.duration(progress.eta_s)} more</span>` : nothing}</p>
      ${part === null ? html`<progress aria-label="Progress"></progress>` : html`<progress aria-label="Progress" max="1" value=${Math.max(0, Math.min(1, part))}></progress>`}
      ${mesh ? html`<p class="note">Mesh ${mesh.number} of the refinement: ${format.count(mesh.elements ?? 0)} elements${mesh.error ? `, error ${format.percent(mesh.error)} on the one before` : ""}</p>` : nothing}
      ${last ? html`<p class="note">${last.contact.active} nodes in contact (${last.contact.entered} entered, ${last.contact.left} left) · ${last.friction.stick} points stick, ${last.friction.slip} slip · normal force ${format.number(last.force.normal)} · tangential force ${format.number(last.force.tangential)}</p>` : nothing}
      ${this.warnings.map((warning) => html`<p class="box warning">${warning.message}</p>`)}
    </section>`;
  }

  attempts() {
    return new Set(this.rows.map((row) => row.attempt)).size;
  }

  drawAttempts() {
    return this.attempts() > 1 ? html`<span class="note">started again: earlier attempts are grey</span>` : nothing;
  }

  drawIterations() {
    const newest = this.rows.slice(-12).reverse();
    return html`<details ?open=${!this.ended()}><summary>Iterations, newest first</summary><div class="scroll"><table class="numbers">
      <thead><tr><th scope="col">k</th><th scope="col">stage</th><th class="number" scope="col">contact residual</th><th class="number" scope="col">friction residual</th><th class="number" scope="col">in contact</th><th class="number" scope="col">stick / slip</th><th class="number" scope="col">normal force</th></tr></thead>
      <tbody>${newest.map((row) => html`<tr><td>${row.k}</td><td>${row.stage}</td><td class="number">${format.number(row.residual, 2)}</td><td class="number">${format.number(row.friction_residual, 2)}</td><td class="number">${row.contact.active} (+${row.contact.entered} −${row.contact.left})</td><td class="number">${row.friction.stick} / ${row.friction.slip}</td><td class="number">${format.number(row.force.normal)}</td></tr>`)}</tbody>
    </table></div></details>`;
  }

  /** The meshes of adaptive refinement with their errors, of the result or as they were told. */
  refinements() {
    const done = this.result?.summary.refinements ?? [];
    if (done.length) return done.filter((mesh) => mesh.error).map((mesh) => ({ elements: mesh.elements, error: mesh.error ?? 0 }));
    const told = [];
    for (let n = 1; n < this.meshes.length; n += 1) {
      const [before, here] = [this.meshes[n - 1], this.meshes[n]];
      if (before && here?.error) told.push({ elements: before.elements, error: here.error });
    }
    return told;
  }

  drawCharts() {
    const find = (/** @type {string} */ id) => /** @type {HTMLElement} */ (this.root.querySelector(`#${id}`));
    this.profiles ??= new ProfilePanel(find("profile"), this.app, this.query);
    this.body ??= new BodyPanel(find("body"));
    if (this.rows.length > 1) {
      this.drawResiduals(find("residuals"), find("residual-readout"));
      // in a task of its own: while one lasts, the page does not answer
      clearTimeout(this.next);
      this.next = setTimeout(() => this.drawForces(find("forces")));
    }
    const meshes = this.refinements();
    if (meshes.length > 1) {
      this.refining ??= new Chart(find("refining"), { label: "The error by the number of elements", x: "elements", y: "relative error", log: true, whole: true, height: 170 });
      this.refining.set([{ label: "error", color: "--curve-1", points: true, x: meshes.map((mesh) => mesh.elements), y: meshes.map((mesh) => mesh.error) }]);
    }
  }

  /**
   * The rows of an attempt that are drawn.
   * @param {number | undefined} attempt
   */
  rowsOf(attempt) {
    return thinned(this.rows.filter((row) => row.attempt === attempt), (row) => Math.log(Math.max(row.friction_residual, 1e-300)));
  }

  /**
   * @param {HTMLElement} residuals
   * @param {HTMLElement} readout
   */
  drawResiduals(residuals, readout) {
    const attempts = [...new Set(this.rows.map((row) => row.attempt))];
    const now = this.rowsOf(attempts[attempts.length - 1]);
    const x = now.map((row) => row.k);
    const few = now.length < 60;
    const hasFriction = now.some((row) => row.friction_residual > 0);
    this.residuals ??= new Chart(residuals, {
      label: "Residuals by iteration",
      x: "iteration",
      y: "residual",
      log: true,
      whole: true,
      sync: "convergence",
      read: (place) => {
        const k = place === null ? null : this.residuals?.data.x[place];
        const row = this.rows.findLast((row) => row.k === k);
        readout.textContent = row ? `k = ${row.k}: contact ${format.number(row.residual, 3)}, friction ${format.number(row.friction_residual, 3)}, normal force ${format.number(row.force.normal)}, tangential force ${format.number(row.force.tangential)}` : "";
      },
    });
    const old = attempts.slice(0, -1).slice(-5).map((attempt) => {
      const rows = this.rowsOf(attempt);
      return { label: `attempt ${attempt}`, color: "--curve-old", width: 1, x: rows.map((row) => row.k), y: rows.map((row) => Math.max(row.residual, row.friction_residual)) };
    });
    this.residuals.set([
      ...old,
      { label: "tolerance", color: "--curve-old", dash: [5, 4], width: 1, x, y: now.map((row) => row.tolerance) },
      { label: "contact residual", color: "--curve-2", points: few, x, y: now.map((row) => row.residual) },
      ...(hasFriction ? [{ label: "friction residual", color: "--curve-1", points: few, x, y: now.map((row) => row.friction_residual) }] : []),
    ]);
  }

  /** @param {HTMLElement} forces */
  drawForces(forces) {
    const now = this.rowsOf(this.rows[this.rows.length - 1]?.attempt);
    const x = now.map((row) => row.k);
    this.forces ??= new Chart(forces, { label: "Forces by iteration", x: "iteration", y: "force", whole: true, height: 170, sync: "convergence" });
    this.forces.set([
      { label: "normal force", color: "--curve-1", x, y: now.map((row) => row.force.normal) },
      { label: "tangential force", color: "--curve-2", x, y: now.map((row) => row.force.tangential) },
    ]);
  }

  drawNumbers() {
    const summary = this.result?.summary;
    if (!summary) return nothing;
    const quantities = summary.accuracy?.quantities ?? [];
    const contacts = [...new Set(quantities.map((q) => q.contact))];
    if (!quantities.length) {
      return html`<section class="panel"><h2>Numbers</h2><dl class="facts">
        <dt>normal force</dt><dd>${format.number(summary.normal_force)}</dd>
        <dt>tangential force</dt><dd>${format.number(summary.tangential_force)}</dd>
        <dt>friction force</dt><dd>${format.number(summary.friction_force)}</dd></dl></section>`;
    }
    return html`<section class="panel"><h2>Numbers</h2><div class="table-box"><table class="numbers">
      <thead><tr><th scope="col">quantity</th><th class="number" scope="col">value</th><th class="number" scope="col">± error</th><th class="number" scope="col">± in %</th></tr></thead>
      <tbody>${contacts.map((contact) => html`
        ${contacts.length > 1 ? html`<tr><th colspan="4" scope="rowgroup">${contact}</th></tr>` : nothing}
        ${quantities.filter((q) => q.contact === contact).map((q) => this.drawNumber(q))}`)}</tbody></table></div>
      <p class="note">Percentages are parts of the number; for ends of contact of the length of the contact, in a half model of both halves, and for tangential numbers of the friction that acts.
        ${quantities.some((q) => q.increments || q.direction || q.measurement) ? "* the error has further parts: point at it." : nothing}</p></section>`;
  }

  /** @param {import("../types").EstimatedQuantity} q */
  drawNumber(q) {
    const [value, error] = format.withError(q.value, q.error);
    if (q.method === "no_limit") {
      return html`<tr><td>${format.quantity(q.quantity)}</td><td class="number" title="On this mesh ${format.number(q.value)}; it grows as the mesh is refined">no limit</td><td class="number">—</td><td class="number">—</td></tr>`;
    }
    const named = /** @type {[string, number | null | undefined][]} */ ([["increments", q.increments], ["direction", q.direction], ["noise of the measured obstacle", q.measurement]]);
    const of = named.filter(([, part]) => part).map(([name, part]) => `${format.number(part, 2)} by ${name}`);
    const finer = q.finer === null || q.finer === undefined ? "" : `on the refined mesh ${format.number(q.finer, 6)}`;
    return html`<tr><td>${format.quantity(q.quantity)}</td><td class="number">${value}</td>
      <td class="number" title=${[...of, finer].filter(Boolean).join("; ")}>${error}${of.length ? "*" : ""}</td><td class="number quiet">${format.percent(q.relative)}</td></tr>`;
  }

  /** @param {Job} job */
  drawDownloads(job) {
    const partial = this.partial() ? "&partial=true" : "";
    const file = (/** @type {string} */ name, /** @type {string} */ path) => html`<a class="button small" href=${this.path(path)} download>${name}</a>`;
    const contacts = Object.keys(this.result?.summary.contacts ?? {});
    const solved = job.result_available !== "none";
    return html`<section class="panel screen"><h2>Download</h2><div class="downloads">
      ${file("problem.json", "/problem")}
      ${solved ? contacts.map((name) => file(`profile ${name}.csv`, `/profiles/${encodeURIComponent(name)}?format=csv${partial}`)) : nothing}
      ${solved && this.ended() ? html`${file("fields.vtu (ParaView)", `/fields?format=vtu${partial}`)}${file("fields.npz (NumPy)", `/fields?format=npz${partial}`)}${file("result.json", "/result")}` : nothing}
      ${this.rows.length ? file("history.csv", `/history?format=csv&partial=true`) : nothing}
      ${solved && contacts.length ? html`${file("profile.svg", `/plots/profile.svg?size=page${partial}`)}${file("profile.pdf", `/plots/profile.pdf?size=page${partial}`)}` : nothing}
      ${solved && this.ended() ? file("deformed.svg", `/plots/deformed.svg?size=page${partial}`) : nothing}
      ${file("mesh.svg", "/plots/mesh.svg?size=page")}</div></section>`;
  }

  drawCode() {
    const url = location.origin + location.pathname.replace(/\/$/, "");
    /** @type {Record<string, string>} */
    const texts = {
      Python: `import signorini as sg\n\njob = sg.Client("${url}").job("${this.id}")\nresult = job.wait()\nprint(result.verdict, result.normal_force)`,
      curl: `curl ${url}/v1/jobs/${this.id}/result`,
      "command line": `export SIGNORINI_URL=${url}\nsignorini result ${this.id}`,
    };
    return html`<section class="panel screen"><h2>The same by a program</h2>
      <div class="tabs" role="tablist">${Object.keys(texts).map((name) => html`<button type="button" role="tab" aria-selected=${this.language === name} @click=${() => {
        this.language = name;
        this.draw();
      }}>${name}</button>`)}</div>
      ${parts.copyable(texts[this.language] ?? "")}</section>`;
  }
}

/** @type {import("../types").Progress} */
const emptyProgress = { stage: "", iteration: 0, residual: null, tolerance: null, contact_changes: null, rate: null, eta_s: null, mesh: null, mesh_elements: null, mesh_error: null, residuals: [] };
