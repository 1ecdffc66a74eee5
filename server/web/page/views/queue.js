/** The queue and the service: what runs, what waits and why, the load, the disk; for administrators owners and tokens. */

import { html, nothing, render } from "../vendor/lit-html-3.3.3/lit-html.js";
import { getSurely, send } from "../api.js";
import { Chart } from "../chart.js";
import * as format from "../format.js";
import * as parts from "../parts.js";
import { address } from "../route.js";
import { follow } from "../stream.js";

/** @typedef {import("../types").Job} Job */

const FIELDS = "id,name,status,owner,progress,started_at,created_at,labels,queue,attempt";
/** The shortest time between two readings of what waits (ms). */
const PACE = 1500;

/**
 * @param {HTMLElement} root
 * @param {import("../route.js").Route} _here
 * @param {import("../app.js").App} app
 * @returns {import("../app.js").Open}
 */
export function open(root, _here, app) {
  return new QueueView(root, app);
}

class QueueView {
  /** @type {import("../types").QueueState | null} */
  queue = null;
  /** The caller, as of now. @type {import("../types").Me | null} */
  me = null;
  begun = false;
  /** @type {import("../types").Forecast | null} */
  forecast = null;
  /** @type {import("../types").Info | null} */
  info = null;
  /** Those on other machines. @type {import("../types").WorkerState[]} */
  workers = [];
  /** @type {Map<string, Job>} */
  running = new Map();
  /** @type {import("../types").OwnerUse[]} */
  owners = [];
  /** @type {import("../types").Token[]} */
  tokens = [];
  /** @type {Chart | undefined} */
  load;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  soon;
  /** The secret of a token that was just made. */
  secret = "";
  /** @type {unknown} */
  error = null;

  /**
   * @param {HTMLElement} root
   * @param {import("../app.js").App} app
   */
  constructor(root, app) {
    this.root = root;
    this.app = app;
    this.closed = new AbortController();
    app.title("Queue");
    this.clock = setInterval(() => this.draw(), 2000);
    this.draw();
    this.unfollow = follow((after) => `v1/events?status=running&fields=${FIELDS}${after ? `&after=${encodeURIComponent(after)}` : ""}`, "", {
      event: (event) => this.told(event),
    });
  }

  close() {
    this.closed.abort();
    this.unfollow();
    clearInterval(this.clock);
    clearTimeout(this.soon);
    this.load?.close();
  }

  /** @param {any} event */
  told(event) {
    // after the stream has begun: nothing that changes meanwhile is missed
    if (!this.begun) {
      this.begun = true;
      this.read();
    }
    switch (event.type) {
      case "queue":
        this.queue = event.queue;
        this.readSoon();
        break;
      case "job":
        this.running.set(event.job.id, event.job);
        this.readSoon();
        break;
      case "removed":
        this.running.delete(event.id);
        this.readSoon();
        break;
      case "reset":
        this.read();
        break;
    }
    this.draw();
  }

  readSoon() {
    this.soon ??= setTimeout(() => {
      this.soon = undefined;
      this.readWaiting();
    }, PACE);
  }

  async readWaiting() {
    const { signal } = this.closed;
    const quietly = (/** @type {string} */ path, /** @type {any} */ before) => getSurely(path, signal).catch(() => before);
    const admin = this.app.may("admin");
    const [forecast, me, workers, owners] = await Promise.all([
      quietly("v1/queue/waiting", this.forecast),
      quietly("v1/me", this.me),
      quietly("v1/workers", { workers: this.workers }),
      admin ? quietly("v1/owners", { owners: this.owners }) : { owners: [] },
    ]);
    Object.assign(this, { forecast, me, workers: workers.workers, owners: owners.owners });
    if (!signal.aborted) this.draw();
  }

  async read() {
    const { signal } = this.closed;
    try {
      const [queue, info, running] = await Promise.all([
        /** @type {Promise<import("../types").QueueState>} */ (getSurely("v1/queue", signal)),
        /** @type {Promise<import("../types").Info>} */ (getSurely("v1/info", signal)),
        /** @type {Promise<import("../types").JobList>} */ (getSurely(`v1/jobs?status=running&fields=${FIELDS}`, signal)),
        this.readWaiting(),
      ]);
      Object.assign(this, { queue, info, running: new Map(running.jobs.map((job) => [job.id, job])) });
      if (this.app.may("admin")) await this.readAdministration();
    } catch (error) {
      if (signal.aborted) return;
      this.error = error;
    }
    this.draw();
  }

  async readAdministration() {
    const { signal } = this.closed;
    /** @type {[import("../types").Owners, import("../types").TokenList]} */
    const [owners, tokens] = await Promise.all([getSurely("v1/owners", signal), getSurely("v1/tokens", signal)]);
    this.owners = owners.owners;
    this.tokens = tokens.tokens;
  }

  /** @param {() => Promise<unknown>} action */
  async act(action) {
    try {
      await action();
    } catch (error) {
      this.app.say(/** @type {Error} */ (error).message);
    }
    this.draw();
  }

  draw() {
    if (this.closed.signal.aborted) return;
    render(this.drawn(), this.root);
    const hour = this.forecast?.last_hour ?? [];
    if (hour.length > 1) {
      const minutes = hour.map((point) => (Date.parse(point.t) - Date.now()) / 60_000);
      this.load ??= new Chart(/** @type {HTMLElement} */ (this.root.querySelector("#load")), { label: "Load of the last hour", x: "minutes", y: "jobs", height: 160 });
      this.load.set([
        { label: "waiting", color: "--curve-2", x: minutes, y: hour.map((point) => point.queued) },
        { label: "running", color: "--curve-1", x: minutes, y: hour.map((point) => point.running) },
      ]);
    }
  }

  drawn() {
    const { queue, info } = this;
    return html`<h1>Queue and service</h1>
      ${this.error ? parts.errorBox(this.error, () => this.read()) : nothing}
      ${queue?.paused ? html`<p class="box warning" role="status">The queue is paused: no job starts until it is resumed. Running jobs go on.</p>` : nothing}
      <div class="columns"><div>
        <section class="panel"><h2>Running ${queue ? html`<span class="note">${queue.running} of ${format.counted(queue.workers, "worker")} busy</span>` : nothing}</h2>${this.drawRunning()}</section>
        <section class="panel"><h2>Waiting ${queue ? html`<span class="note">${format.count(queue.queued)} of at most ${format.count(queue.max_queued)}</span>` : nothing}</h2>${this.drawWaiting()}</section>
        <section class="panel" ?hidden=${(this.forecast?.last_hour.length ?? 0) < 2}><h2>The last hour</h2><div id="load"></div>
          <p class="legend"><span class="c2"><i></i>waiting</span><span><i></i>running</span></p></section>
        ${this.app.may("admin") && this.app.me.owner !== "local" ? this.drawTokens() : nothing}
      </div><div>
        <section class="panel"><h2>Service</h2>${info ? this.drawInfo(info) : parts.loading("Loading")}
          ${this.app.may("admin") && queue
            ? html`<p><button type="button" @click=${() => this.act(async () => {
                this.queue = await send("POST", `v1/queue/${queue.paused ? "resume" : "pause"}`);
              })}>${queue.paused ? "Resume the queue" : "Pause the queue"}</button></p>`
            : nothing}</section>
        ${this.workers.length ? this.drawWorkers() : nothing}
        ${this.drawMe()}
        ${this.app.may("admin") ? this.drawOwners() : nothing}
        <section class="panel"><h2>For programs</h2><p><a href="docs">REST: try requests</a> · <a href="openapi.json">OpenAPI</a> · <a href="proto/signorini.proto">gRPC</a> · <a href="v1/schema/problem.json">fields of a problem</a> · <a href="metrics">metrics</a></p></section>
      </div></div>`;
  }

  drawRunning() {
    const jobs = [...this.running.values()];
    if (!jobs.length) return html`<p class="note">${this.queue?.running && !this.app.may("admin") ? "Nothing of yours runs." : "Nothing runs."}</p>`;
    return html`<div class="table-box"><table><tbody>${jobs.map((job) => {
      const progress = job.progress;
      const since = job.started_at ? (Date.now() - Date.parse(job.started_at)) / 1000 : null;
      return html`<tr><td class="name"><a href=${parts.jobAddress(job.id)}>${job.name ?? `…${job.id.slice(-8)}`}</a></td><td>${parts.sparkline(progress)}</td>
        <td class="note">${progress?.stage}${progress?.iteration ? `, iteration ${progress.iteration}` : ""}${progress?.mesh ? `, mesh ${progress.mesh}` : ""}</td>
        <td class="number">${format.duration(since)}</td>${job.owner === "local" ? nothing : html`<td>${job.owner}</td>`}</tr>`;
    })}</tbody></table></div>`;
  }

  drawWaiting() {
    const waiting = (this.forecast?.waiting ?? []).filter((job) => !this.running.has(job.id));
    if (!waiting.length) return html`<p class="note">${this.queue?.queued && !this.app.may("admin") ? "Nothing of yours waits." : "Nothing waits."}</p>`;
    return html`<div class="table-box"><table><thead><tr><th scope="col">Job</th><th scope="col">Why it waits</th><th scope="col" class="number">Starts in about</th></tr></thead>
      <tbody>${waiting.map((job) => html`<tr><td class="name"><a href=${parts.jobAddress(job.id)}>${job.name ?? `…${job.id.slice(-8)}`}</a>${job.owner === "local" ? nothing : html` <span class="note">${job.owner}</span>`}</td>
        <td>${format.waits({ position: job.position, ahead: job.position - 1, reason: job.reason })}</td><td class="number">${job.starts_in_s === null ? "—" : format.duration(job.starts_in_s)}</td></tr>`)}</tbody></table></div>`;
  }

  drawWorkers() {
    return html`<section class="panel"><h2>Workers on other machines</h2><div class="table-box"><table class="numbers"><thead><tr><th scope="col">name</th><th class="number" scope="col">jobs</th><th class="number" scope="col">slots</th><th class="number" scope="col">memory</th><th class="number" scope="col">heard of</th></tr></thead>
      <tbody>${this.workers.map((worker) => html`<tr><td class="name" title=${worker.id}>${worker.name}</td><td class="number">${worker.jobs}</td><td class="number">${worker.slots}</td><td class="number">${format.bytes(worker.memory_bytes)}</td>
        <td class="number">${worker.silent_s < 2 ? "now" : `${format.duration(worker.silent_s)} ago`}</td></tr>`)}</tbody></table></div></section>`;
  }

  /** @param {import("../types").Info} info */
  drawInfo(info) {
    const { disk, limits, body_cache: cache } = info;
    return html`<dl class="facts">
      <dt>version</dt><dd>${info.version}</dd>
      <dt>workers</dt><dd>${info.workers}, in ${info.isolation === "process" ? "processes of their own" : "threads"}</dd>
      <dt>disk</dt><dd>${format.bytes(disk.used_bytes)} used, ${format.bytes(disk.free_bytes)} free</dd>
      <dt>memory for jobs</dt><dd>${format.bytes(limits.memory_budget_bytes)}</dd>
      <dt>factored bodies, kept for later jobs</dt><dd>${cache.bodies} (${format.bytes(cache.bytes)}), used ${format.count(cache.hits)} times</dd>
      <dt>largest request</dt><dd>${format.bytes(limits.max_body_bytes)}; a mesh ${format.bytes(limits.max_mesh_bytes)}</dd>
      <dt>results are kept</dt><dd>${keptFor(info.retention)}</dd></dl>`;
  }

  drawMe() {
    const me = this.me ?? this.app.me;
    const of = (/** @type {{used: number, limit: number | null}} */ { used, limit }, /** @type {(n: number) => string} */ shown) => `${shown(used)}${limit === null ? "" : ` of ${shown(limit)}`}`;
    return html`<section class="panel"><h2>You, and your limits</h2><dl class="facts"><dt>name</dt><dd>${me.owner}</dd><dt>may</dt><dd>${me.scopes.join(", ")}</dd>
      <dt>waiting jobs</dt><dd>${of(me.queued, format.count)}</dd><dt>running jobs</dt><dd>${of(me.running, format.count)}</dd><dt>stored</dt><dd>${of(me.stored_bytes, format.bytes)}</dd></dl></section>`;
  }

  drawOwners() {
    if (!this.owners.length) return nothing;
    return html`<section class="panel"><h2>Owners</h2><div class="table-box"><table class="numbers"><thead><tr><th scope="col">owner</th><th class="number" scope="col">jobs</th><th class="number" scope="col">stored</th><th class="number" scope="col">waiting</th><th class="number" scope="col">running</th></tr></thead>
      <tbody>${this.owners.map((owner) => html`<tr><td><a href=${address("jobs", { owner: owner.owner })}>${owner.owner}</a></td><td class="number">${format.count(owner.jobs)}</td><td class="number">${format.bytes(owner.job_bytes + owner.mesh_bytes)}</td><td class="number">${owner.queued}</td><td class="number">${owner.running}</td></tr>`)}</tbody></table></div></section>`;
  }

  drawTokens() {
    const valid = (/** @type {import("../types").Token} */ token) => !token.revoked_at && !(token.expires_at && Date.parse(token.expires_at) < Date.now());
    return html`<section class="panel"><h2>Tokens</h2>
      ${this.secret ? html`<div class="box warning"><p>The new token. It is shown only now:</p>${parts.copyable(this.secret)}</div>` : nothing}
      <div class="table-box"><table class="numbers"><thead><tr><th scope="col">name</th><th scope="col">owner</th><th scope="col">may</th><th scope="col">until</th><th scope="col"></th></tr></thead>
      <tbody>${this.tokens.filter(valid).map((token) => html`<tr><td>${token.name}</td><td>${token.owner}</td><td>${token.scopes.join(", ")}</td><td>${token.expires_at ? format.exactly(token.expires_at) : "no end"}</td>
        <td><button type="button" class="small" @click=${() => confirm(`Revoke the token ${token.name} of ${token.owner}?`) && this.act(async () => {
          await send("DELETE", `v1/tokens/${token.id}`);
          this.secret = "";
          await this.readAdministration();
        })}>Revoke</button></td></tr>`)}</tbody></table></div>
      <form class="plain-form" @submit=${(/** @type {SubmitEvent} */ event) => {
        event.preventDefault();
        const form = /** @type {HTMLFormElement} */ (event.target);
        const data = new FormData(form);
        this.act(async () => {
          const days = Number(data.get("days"));
          /** @type {import("../types").NewToken} */
          const made = await send("POST", "v1/tokens", { name: data.get("name"), owner: data.get("owner"), scopes: data.getAll("scope"), ...(days ? { expires_in_s: days * 86400 } : {}) });
          this.secret = made.secret;
          form.reset();
          await this.readAdministration();
        });
      }}>
        <label>Name, for people <input name="name" required maxlength="64" /></label><label>Owner, whose jobs it sees <input name="owner" required pattern="[A-Za-z0-9._@+\\-]+" maxlength="64" title="letters, digits and . _ @ + -" /></label>
        <fieldset><legend>May</legend>${["read", "submit", "cancel", "work", "admin"].map((scope) => html`<label><input type="checkbox" name="scope" value=${scope} ?checked=${scope !== "work" && scope !== "admin"} /> ${scope}</label> `)}</fieldset>
        <label>Days <input name="days" type="number" min="1" placeholder="no end" /></label><button>Make a token</button></form></section>`;
  }
}

/**
 * How long results are kept, in words.
 * @param {import("../types").Retention} retention
 */
function keptFor({ days, fields_days, bytes, bytes_per_owner, jobs, jobs_per_owner }) {
  const limits = [
    days && `${format.counted(days, "day")}`,
    fields_days && `their fields ${format.counted(fields_days, "day")}`,
    bytes && `at most ${format.bytes(bytes)}`,
    bytes_per_owner && `${format.bytes(bytes_per_owner)} of each owner`,
    jobs && `at most ${format.counted(jobs, "job")}`,
    jobs_per_owner && `${format.counted(jobs_per_owner, "job")} of each owner`,
  ].filter(Boolean);
  return limits.length ? `${limits.join("; ")}. Beyond that the oldest that are not pinned are removed` : "without a limit";
}
