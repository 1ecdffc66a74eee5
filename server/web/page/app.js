/** The page: its header, its views, and the session of the person who looks at it. */

import { html, nothing, render } from "./vendor/lit-html-3.3.3/lit-html.js";
import { ApiError, connection, getSurely, request } from "./api.js";
import { duration } from "./format.js";
import { address, route } from "./route.js";
import { errorBox, loading } from "./parts.js";
import * as jobs from "./views/jobs.js";

/** @typedef {import("./types").Me} Me */

/**
 * A view that is open. `update` is told another address of the same view; `close` ends its streams.
 * @typedef {{update?: (route: import("./route.js").Route) => void, close: () => void, title?: string}} Open
 */

/**
 * What every view may use.
 * @typedef {object} App
 * @property {Me} me the caller
 * @property {(scope: string) => boolean} may whether the caller has a scope
 * @property {(text: string) => void} say tells a message for a few seconds, also to those who hear the page
 * @property {(title: string) => void} title sets the title of the window
 */

/** @typedef {{open: (root: HTMLElement, route: import("./route.js").Route, app: App) => Open}} View */

/** The views by the first part of their address; those that the first picture does not need are loaded with the view. */
/** @type {Record<string, () => Promise<View>>} */
const VIEWS = {
  "": async () => jobs,
  jobs: async () => jobs,
  job: () => import("./views/job.js"),
  new: () => import("./views/new.js"),
  compare: () => import("./views/compare.js"),
  sweeps: () => import("./views/sweeps.js"),
  sweep: () => import("./views/sweep.js"),
  queue: () => import("./views/queue.js"),
};

/** How often it is looked whether the session is still valid (ms). */
const LOOK = 10_000;

/** The scopes that views need. @type {Record<string, string>} */
const NEEDED = { new: "submit" };

const root = /** @type {HTMLElement} */ (document.getElementById("app"));

/** @type {{me: Me | null, needsToken: boolean, failed: string | null, open: Open | null, name: string, message: string, outdated: boolean}} */
const state = { me: null, needsToken: false, failed: null, open: null, name: "", message: "", outdated: false };

/** @type {HTMLElement} */
let main;

start();

async function start() {
  if (new URLSearchParams(location.search).get("login") === "failed") {
    state.failed = "The token is unknown, was revoked or has expired.";
    history.replaceState(null, "", location.pathname + location.hash);
  }
  connection.addEventListener("change", draw);
  connection.addEventListener("login", () => {
    state.needsToken = true;
    draw();
  });
  addEventListener("hashchange", show);
  setInterval(() => connection.lostAt !== null && draw(), 1000);
  // a view that has read all it shows asks nothing more, and would not be told that its session has ended
  setInterval(() => state.me && !state.needsToken && !document.hidden && request("v1/me", { cache: "no-store" }).catch(() => undefined), LOOK);
  document.addEventListener("keydown", shortcut);
  draw();
  // the modules of the first view come while the caller is asked for; `show` tells if they do not come
  VIEWS[viewOf(route())]?.().catch(() => undefined);
  try {
    state.me = await getSurely("v1/me", new AbortController().signal);
  } catch (error) {
    if (!(error instanceof ApiError && error.status === 401)) return drawFailure(error);
    return;
  }
  state.needsToken = false;
  draw();
  await show();
}

/** The name of the view that an address opens. */
function viewOf(/** @type {import("./route.js").Route} */ { path }) {
  const [first = "", second] = path;
  if (first === "jobs" && second) return "job";
  if (first === "sweeps" && second) return "sweep";
  return Object.hasOwn(VIEWS, first) ? first : "";
}

async function show() {
  if (!state.me) return;
  const here = route();
  const name = viewOf(here);
  const key = [name, ...(["job", "sweep"].includes(name) ? here.path.slice(1, 2) : [])].join("/");
  if (state.open && state.name === key && state.open.update) {
    state.open.update(here);
    return;
  }
  state.open?.close();
  Object.assign(state, { open: null, name: key, message: "" });
  draw();
  render(loading("Loading"), place());
  const scope = NEEDED[name];
  if (scope && !app().may(scope)) {
    state.name = "none";
    render(errorBox(`Your token has no scope "${scope}": it may look, and not submit. The list of jobs is at Jobs, above.`), place());
    return;
  }
  /** @type {View} */
  let view;
  try {
    view = await /** @type {() => Promise<View>} */ (VIEWS[name])();
  } catch {
    await notLoaded();
    return;
  }
  if (state.name !== key) return;
  const own = place();
  own.className = `view ${name || "jobs"}`;
  state.open = view.open(own, here, app());
  scrollTo(0, 0);
}

/** A new place for a view, in place of what was shown before. */
function place() {
  const own = document.createElement("div");
  main.replaceChildren(own);
  return own;
}

/** A module that is not there: the service was updated under the open page, or cannot be reached. */
async function notLoaded() {
  try {
    const page = await (await request("./", { cache: "no-store" })).text();
    const own = import.meta.url.split("/web/")[1]?.split("/")[0] ?? "";
    state.outdated = !page.includes(own);
  } catch {
    // told by the header
  }
  state.name = "none";
  draw();
  render(errorBox("This part of the page could not be loaded.", () => location.reload()), place());
}

/** @returns {App} */
function app() {
  const me = /** @type {Me} */ (state.me);
  return {
    me,
    may: (scope) => me.scopes.includes(/** @type {any} */ (scope)) || me.scopes.includes("admin"),
    say,
    title: (title) => {
      document.title = title ? `${title} – Signorini` : "Signorini";
    },
  };
}

/** @type {number | undefined} */
let silence;

/** @param {string} text */
function say(text) {
  state.message = text;
  draw();
  clearTimeout(silence);
  silence = setTimeout(() => {
    state.message = "";
    draw();
  }, 6000);
}

/** @param {KeyboardEvent} event */
function shortcut(event) {
  const target = /** @type {HTMLElement} */ (event.target);
  if (event.ctrlKey || event.metaKey || event.altKey || target.closest("input, textarea, select, [contenteditable]")) return;
  if (event.key === "n" && state.me && app().may("submit")) location.hash = address("new");
  if (event.key === "g") location.hash = address("jobs");
}

function drawFailure(/** @type {unknown} */ error) {
  draw();
  render(errorBox(error, () => location.reload()), place());
}

async function logOut() {
  try {
    await request("v1/session", { method: "DELETE" });
  } finally {
    location.reload();
  }
}

const NAVIGATION = [
  ["jobs", "Jobs"],
  ["sweeps", "Sweeps"],
  ["compare", "Compare"],
  ["queue", "Queue"],
];

function draw() {
  const me = state.me;
  const own = state.name.split("/")[0] || "jobs";
  const current = own === "job" ? "jobs" : own === "sweep" ? "sweeps" : own;
  render(
    html`<a class="skip" href="#main" @click=${skip}>To the content</a>
      <header>
        <a class="brand" href="#/jobs">Signorini</a>
        ${me
          ? html`<nav aria-label="Views">${NAVIGATION.map(
              ([to, name]) => html`<a href=${address(to ?? "")} aria-current=${current === to ? "page" : "false"}>${name}</a>`,
            )}</nav>`
          : nothing}
        <span class="space"></span>
        ${drawConnection()}
        ${me && !state.needsToken ? drawCaller(me) : nothing}
        ${me && app().may("submit") ? html`<a class="button primary" href=${address("new")}>New job</a>` : nothing}
      </header>
      ${state.outdated
        ? html`<div class="bar" role="alert">The service was updated. <button type="button" @click=${() => location.reload()}>Load the page again</button></div>`
        : nothing}
      ${state.needsToken ? drawLogIn() : nothing}
      <main id="main" tabindex="-1" ?hidden=${state.needsToken}></main>
      <div class="message" role="status" aria-live="polite" ?hidden=${!state.message}>${state.message}</div>`,
    root,
  );
  main = /** @type {HTMLElement} */ (document.getElementById("main"));
}

/** @param {Event} event */
function skip(event) {
  event.preventDefault();
  main.focus();
}

function drawConnection() {
  if (connection.lostAt === null) {
    return state.me && !state.needsToken ? html`<span class="live" title="What you see is up to date">● live</span>` : nothing;
  }
  const since = duration((Date.now() - connection.lostAt) / 1000);
  return html`<span class="live lost" role="status">○ no connection since ${since}: what you see may be old</span>`;
}

/** @param {Me} me */
function drawCaller(me) {
  if (me.owner === "local") return nothing;
  const scope = me.scopes.includes("admin") ? "admin" : me.scopes.join(", ");
  return html`<span class="caller">${me.owner} · ${scope}</span>
    <button type="button" class="small" @click=${logOut}>Log out</button>`;
}

function drawLogIn() {
  const again = state.me !== null;
  return html`<section class="login" aria-labelledby="login-title">
    <h1 id="login-title">${again ? "Your session has ended" : "Log in"}</h1>
    <p>${again ? "The token was revoked or has expired. " : ""}This service needs a token. An administrator makes one on the page
      of the queue, or with <code>signorini token create</code>.</p>
    ${state.failed ? html`<p class="box error" role="alert">${state.failed}</p>` : nothing}
    <form method="post" action="v1/session">
      <input type="hidden" name="part" value=${location.hash} />
      <label>Token <input type="password" name="token" required autocomplete="current-password" autofocus placeholder="sgn_…" /></label>
      <button class="primary">Log in</button>
    </form>
    <p class="note">The token becomes a cookie that scripts cannot read. The session ends with the token, or after 12 hours.</p>
  </section>`;
}
