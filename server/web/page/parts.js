/** Small parts that several views show. */

import { html, nothing, svg } from "./vendor/lit-html-3.3.3/lit-html.js";
import * as format from "./format.js";
import { address } from "./route.js";

/** @typedef {import("./types").Job} Job */

/** @type {Record<string, [string, string]>} */
const STATUS = {
  queued: ["◌", "waiting"],
  running: ["◐", "running"],
  succeeded: ["✓", "succeeded"],
  failed: ["✕", "failed"],
  canceled: ["⊘", "canceled"],
};

/**
 * @param {string} status
 * @param {unknown} [more] after the word
 */
export function statusBadge(status, more = nothing) {
  const [sign, word] = STATUS[status] ?? ["", status];
  return html`<span class="badge ${status}"><span aria-hidden="true">${sign}</span> ${word}${more}</span>`;
}

/** @param {Pick<Job, "quantities" | "warnings">} job */
function withoutLimit(job) {
  const own = (job.quantities ?? []).filter((q) => q.method === "no_limit").length;
  // a member of a sweep has no quantities in its row, but the note that there is such a number
  return own || (!(job.quantities ?? []).length && (job.warnings ?? []).some((warning) => warning.code === "sharp_edge") ? 1 : 0);
}

/**
 * How far the numbers of a job can be trusted, as a sign, a word and a colour.
 * @param {Pick<Job, "verdict" | "quantities" | "warnings">} job
 * @returns {{kind: string, sign: string, word: string, title: string} | null}
 */
export function trust(job) {
  const serious = (job.warnings ?? []).some((warning) => warning.severity === "serious");
  const first = (job.warnings ?? [])[0]?.message ?? "";
  switch (job.verdict) {
    case "good": {
      const exceptions = withoutLimit(job);
      if (exceptions) {
        const numbers = exceptions === 1 ? "one number" : `${exceptions} numbers`;
        return { kind: "care", sign: "⚠", word: `good, but for ${numbers}`, title: `Good, but for ${numbers} without a limit.` };
      }
      return { kind: "good", sign: "✓", word: "good", title: first };
    }
    case "fair":
      return { kind: "care", sign: "⚠", word: "fair", title: first };
    case "poor":
      return { kind: "poor", sign: "✕", word: "do not use", title: first };
    default:
      return serious ? { kind: "poor", sign: "✕", word: "serious warning", title: first } : null;
  }
}

/** @param {Pick<Job, "verdict" | "quantities" | "warnings">} job */
export function trustBadge(job) {
  const found = trust(job);
  if (!found) return nothing;
  return html`<span class="badge trust-${found.kind}" title=${found.title}><span aria-hidden="true">${found.sign}</span> ${found.word}</span>`;
}

/**
 * Residuals as a small curve, with the tolerance as a dashed line.
 * @param {import("./types").Progress | null | undefined} progress
 */
export function sparkline(progress) {
  const values = progress?.residuals ?? [];
  if (values.length < 2) return nothing;
  const [width, height] = [118, 24];
  const logs = values.map((value) => Math.log10(Math.max(value, 1e-17)));
  const goal = Math.log10(progress?.tolerance ?? 1e-10);
  const most = Math.max(...logs, goal);
  const least = Math.min(...logs, goal);
  const y = (/** @type {number} */ log) => 2 + ((height - 4) * (most - log)) / Math.max(most - least, 1e-9);
  const points = logs.map((log, n) => `${((width * n) / (logs.length - 1)).toFixed(1)},${y(log).toFixed(1)}`);
  const last = values[values.length - 1] ?? 0;
  return html`<svg class="sparkline" viewBox="0 0 ${width} ${height}" role="img" aria-label="residual ${format.number(last, 2)}">
    ${svg`<line class="goal" x1="0" x2=${width} y1=${y(goal)} y2=${y(goal)} /><polyline points=${points.join(" ")} />`}
  </svg>`;
}

/**
 * The number that a list shows of a job.
 * @param {Pick<Job, "quantities" | "status">} job
 */
export function mainNumber(job) {
  const force = (job.quantities ?? []).find((q) => q.quantity === "normal_force");
  if (!force) return nothing;
  const [value, error] = format.withError(force.value, force.error);
  return html`${value}${error === "—" ? nothing : html` <span class="error-of">± ${error}</span>`}`;
}

/** @param {string | null | undefined} time */
export const age = (time) =>
  time ? html`<time datetime=${time} title=${format.exactly(time)}>${format.ago(time)}</time>` : nothing;

/**
 * Labels of a job, each as a link that adds it to the filters; with shift or alt it is excluded.
 * @param {Record<string, string>} labels
 * @param {(key: string, value: string, exclude: boolean) => string} to the address of the list with this label
 */
export function labelChips(labels, to) {
  return Object.entries(labels ?? {}).map(
    ([key, value]) => html`<a class="chip" href=${to(key, value, false)} title="Only jobs with this label; with shift only those without it"
        @click=${(/** @type {MouseEvent} */ event) => {
          if (!event.shiftKey && !event.altKey) return;
          event.preventDefault();
          location.hash = to(key, value, true);
        }}>${key}=${value}</a>`,
  );
}

/**
 * An error as a box, with what to do.
 * @param {unknown} error
 * @param {() => void} [again]
 */
export function errorBox(error, again) {
  const text = error instanceof Error ? error.message : String(error);
  const violations = /** @type {any} */ (error)?.violations ?? [];
  return html`<div class="box error" role="alert">
    <p>${text}</p>
    ${violations.length
      ? html`<ul>${violations.map((/** @type {import("./types").Violation} */ v) => html`<li><code>${v.pointer || "/"}</code>: expected ${v.expected}, got ${v.got}. ${v.hint}</li>`)}</ul>`
      : nothing}
    ${again ? html`<button type="button" @click=${again}>Try again</button>` : nothing}
  </div>`;
}

/** @param {string} text */
export const loading = (text) => html`<p class="loading" aria-live="polite">${text} …</p>`;

/** @param {string} id of a job */
export const jobAddress = (id) => address(`jobs/${id}`);

/**
 * A text that can be copied.
 * @param {string} text
 */
export function copyable(text) {
  return html`<div class="code"><pre tabindex="0">${text}</pre>
    <button type="button" class="small" @click=${async (/** @type {Event} */ event) => {
      const button = /** @type {HTMLButtonElement} */ (event.currentTarget);
      try {
        await navigator.clipboard.writeText(text);
        button.textContent = "Copied";
      } catch {
        // only a page over https, or of this machine, may use the clipboard
        const range = document.createRange();
        range.selectNodeContents(/** @type {Node} */ (button.previousElementSibling));
        getSelection()?.removeAllRanges();
        getSelection()?.addRange(range);
        button.textContent = "Selected: press Ctrl+C";
      }
    }}>Copy</button></div>`;
}

/**
 * Saves a text as a file of the person's machine.
 * @param {string} name
 * @param {string} type
 * @param {string} text
 */
export function save(name, type, text) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}
