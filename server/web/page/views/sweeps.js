/** The list of sweeps. */

import { html, nothing, render } from "../vendor/lit-html-3.3.3/lit-html.js";
import { repeat } from "../vendor/lit-html-3.3.3/directives/repeat.js";
import { getSurely } from "../api.js";
import * as format from "../format.js";
import * as parts from "../parts.js";
import { address } from "../route.js";
import { follow } from "../stream.js";

/** @typedef {import("../types").Sweep} Sweep */

/**
 * @param {HTMLElement} root
 * @param {import("../route.js").Route} _here
 * @param {import("../app.js").App} app
 * @returns {import("../app.js").Open}
 */
export function open(root, _here, app) {
  const closed = new AbortController();
  /** @type {Sweep[]} */
  let sweeps = [];
  let next = "";
  let loading = true;
  /** @type {unknown} */
  let error = null;
  app.title("Sweeps");

  const draw = () => render(drawn(), root);

  const read = async (/** @type {string} */ token) => {
    try {
      /** @type {import("../types").SweepList} */
      const page = await getSurely(`v1/sweeps?page_size=50&page_token=${token}`, closed.signal);
      sweeps = token ? [...sweeps, ...page.sweeps] : page.sweeps;
      next = page.next_page_token ?? "";
      error = null;
    } catch (failure) {
      if (closed.signal.aborted) return;
      error = failure;
    }
    loading = false;
    draw();
  };

  const drawn = () => html`<h1>Sweeps</h1>
    <p class="note">One problem with many values, solved together. ${app.may("submit") ? html`A new one: give several values to a number of a <a href=${address("new")}>new job</a>.` : nothing}</p>
    ${error ? parts.errorBox(error, () => read("")) : nothing}
    ${loading ? parts.loading("Loading the sweeps") : nothing}
    ${sweeps.length
      ? html`<div class="table-box"><table><thead><tr><th scope="col">Status</th><th scope="col">Name</th><th scope="col">Members</th><th scope="col" class="wide">Varies</th><th scope="col" class="number">Age</th></tr></thead>
        <tbody>${repeat(sweeps, (/** @type {Sweep} */ sweep) => sweep.id, (/** @type {Sweep} */ sweep) => {
          const { total, succeeded, failed, canceled } = sweep.members;
          const done = succeeded + failed + canceled;
          return html`<tr><td>${parts.statusBadge(sweep.status)}</td><td class="name"><a href=${address(`sweeps/${sweep.id}`)}>${sweep.name ?? `…${sweep.id.slice(-8)}`}</a></td>
            <td><progress max=${total} value=${done} aria-label="${done} of ${total}"></progress> <span class="note">${format.count(done)} of ${format.count(total)}${failed ? `, ${failed} failed` : ""}</span></td>
            <td class="wide">${sweep.paths.map((path) => html`<code>${path}</code> `)}</td><td class="number">${parts.age(sweep.created_at)}</td></tr>`;
        })}</tbody></table></div>`
      : loading || error
        ? nothing
        : html`<p class="empty">There are no sweeps yet.</p>`}
    ${next ? html`<button type="button" @click=${() => read(next)}>Older ↓</button>` : nothing}`;

  read("");
  const unfollow = follow((after) => `v1/events?status=running&fields=id${after ? `&after=${encodeURIComponent(after)}` : ""}`, "", {
    event: (event) => {
      if (event.type === "reset") read("");
      if (event.type !== "sweep") return;
      const place = sweeps.findIndex((sweep) => sweep.id === event.sweep.id);
      if (place >= 0) sweeps[place] = event.sweep;
      else read("");
      draw();
    },
  });
  return {
    close: () => {
      closed.abort();
      unfollow();
    },
  };
}
