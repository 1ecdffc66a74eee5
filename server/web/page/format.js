/** Numbers, times and sizes as people read them. */

const SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹";

/** @param {number} power */
export function powerOfTen(power) {
  const digits = String(Math.abs(power)).replace(/\d/g, (digit) => SUPERSCRIPTS[Number(digit)] ?? digit);
  return `10${power < 0 ? "⁻" : ""}${digits}`;
}

/** @param {string} text with the hyphen as minus sign */
const withMinus = (text) => text.replace("-", "−");

/** @param {string} text */
const withoutZeros = (text) => (text.includes(".") ? text.replace(/\.?0+$/, "") : text);

/**
 * A number with at most so many digits; very large and very small ones with a power of ten.
 * @param {number | null | undefined} value
 * @param {number} [digits]
 */
export function number(value, digits = 5) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "—";
  if (value === 0) return "0";
  const power = Math.floor(Math.log10(Math.abs(value)));
  if (power >= 6 || power < -4) {
    const [digitsOf, of] = value.toExponential(Math.max(digits - 2, 0)).split("e");
    return `${withMinus(withoutZeros(digitsOf ?? ""))} · ${powerOfTen(Number(of))}`;
  }
  return withMinus(withoutZeros(value.toFixed(Math.max(0, digits - 1 - power))));
}

/**
 * A number and its error, both with as many decimals as the two first digits of the error have.
 * @param {number} value
 * @param {number | null | undefined} error
 * @returns {[string, string]}
 */
export function withError(value, error) {
  if (error === null || error === undefined || !(error > 0)) {
    return [number(value), error === 0 ? "0" : "—"];
  }
  const power = Math.floor(Math.log10(error));
  const size = Math.max(Math.abs(value), error);
  if (size >= 1e6 || power < -6) {
    // with one power of ten for both
    const common = Math.floor(Math.log10(size));
    const decimals = Math.min(14, Math.max(0, common - power + 1));
    const shown = (/** @type {number} */ part) => `${withMinus((part / 10 ** common).toFixed(decimals))} · ${powerOfTen(common)}`;
    return [shown(value), shown(error)];
  }
  const decimals = Math.min(12, Math.max(0, 1 - power));
  return [withMinus(value.toFixed(decimals)), error.toFixed(decimals)];
}

/** @param {number | null | undefined} part */
export function percent(part) {
  if (part === null || part === undefined || !Number.isFinite(part)) return "—";
  const value = 100 * part;
  if (value > 1000) return `${count(Math.round(value))} %`;
  return `${value === 0 ? "0" : value < 0.01 ? "< 0.01" : value.toFixed(value < 10 ? 2 : 0)} %`;
}

/** @param {number | null | undefined} seconds */
export function duration(seconds) {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return "";
  if (seconds < 0.001) return "< 1 ms";
  if (seconds < 1) return `${Number((seconds * 1000).toPrecision(2))} ms`;
  if (seconds < 10) return `${seconds.toFixed(1)} s`;
  if (seconds < 60) return `${Math.round(seconds)} s`;
  const minutes = Math.floor(seconds / 60);
  if (minutes < 60) return `${minutes} min ${Math.floor(seconds % 60)} s`;
  const hours = Math.floor(minutes / 60);
  if (hours < 48) return `${hours} h ${minutes % 60} min`;
  return `${Math.floor(hours / 24)} days`;
}

/**
 * How long ago a time was, roughly.
 * @param {string | null | undefined} time as RFC 3339
 * @param {number} [now] milliseconds
 */
export function ago(time, now = Date.now()) {
  if (!time) return "";
  const seconds = Math.max(0, (now - Date.parse(time)) / 1000);
  if (seconds < 5) return "now";
  if (seconds < 60) return `${Math.floor(seconds / 5) * 5} s`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min`;
  if (seconds < 48 * 3600) return `${Math.floor(seconds / 3600)} h`;
  return `${Math.floor(seconds / 86400)} days`;
}

/**
 * A time as the person's own clock shows it.
 * @param {string | null | undefined} time as RFC 3339
 */
export const exactly = (time) => (time ? new Date(time).toLocaleString(undefined, { dateStyle: "medium", timeStyle: "medium" }) : "");

/** @param {number | null | undefined} count */
export function bytes(count) {
  if (count === null || count === undefined) return "—";
  const units = ["B", "kB", "MB", "GB", "TB"];
  let place = 0;
  let value = count;
  while (value >= 1000 && place < units.length - 1) {
    value /= 1000;
    place += 1;
  }
  return `${place === 0 ? value : Number(value.toPrecision(3))} ${units[place]}`;
}

/** @param {number} count */
export const count = (count) => count.toLocaleString("en").replaceAll(",", " ");

/**
 * A count with its noun.
 * @param {number} number
 * @param {string} noun in the singular
 */
export const counted = (number, noun) => `${count(number)} ${noun}${number === 1 ? "" : "s"}`;

/** @type {Record<string, string>} */
const QUANTITIES = {
  normal_force: "normal force",
  tangential_force: "tangential force",
  friction_force: "friction force",
  peak_normal_stress: "peak normal stress σₙ",
  peak_tangential_stress: "peak tangential stress σₜ",
  contact_width: "contact width",
  run_s: "run time (s)",
  contact_start: "contact begins at s",
  contact_end: "contact ends at s",
  stick_end: "stick ends at s",
  indentation: "indentation",
  tangential_displacement: "tangential displacement",
  tilt: "tilt (rad)",
};

/** @param {string} name of a quantity */
export const quantity = (name) => QUANTITIES[name] ?? words(name);

/** @param {string} code */
export const words = (code) => code.replaceAll("_", " ").replaceAll("-", " ");

/** @type {Record<string, string>} */
const WAITING = {
  workers_busy: "all workers are busy",
  no_worker_fits: "there is no worker, or none with as much memory",
  memory: "the running jobs leave too little memory",
  paused: "the queue is paused",
  low_disk: "the disk is full",
  owner_limit: "you have as many running jobs as you may",
  coalesced: "another job has the same input, and its result is awaited",
};

/**
 * Why a job waits, in words.
 * @param {import("./types").QueuePosition | null | undefined} queue
 */
export function waits(queue) {
  if (!queue) return "waits";
  const why = WAITING[queue.reason] ?? words(queue.reason);
  if (queue.position <= 0) return why;
  return `${ordinal(queue.position)} in line, ${why}`;
}

/** @param {number} place */
function ordinal(place) {
  const teen = place % 100 >= 11 && place % 100 <= 13;
  const ending = teen ? "th" : ({ 1: "st", 2: "nd", 3: "rd" }[place % 10] ?? "th");
  return `${count(place)}${ending}`;
}

/**
 * A text with a capital letter at its beginning and a full stop at its end.
 * @param {string} text
 */
export const sentence = (text) => text.charAt(0).toUpperCase() + text.slice(1) + (/[.!?]$/.test(text) ? "" : ".");

/**
 * Warnings counted by what they are called.
 * @param {{severity: string}[]} warnings
 */
export function countedWarnings(warnings) {
  const notes = warnings.filter((warning) => warning.severity === "note").length;
  const others = warnings.length - notes;
  return [others ? counted(others, "warning") : "", notes ? counted(notes, "note") : ""].filter(Boolean).join(", ");
}

/**
 * Numbers that a person has typed: one, or several for a sweep, separated by spaces, semicolons, or commas with a space.
 * @param {string} text
 * @returns {{numbers: number[]} | {fault: string}}
 */
export function typedNumbers(text) {
  if (/\d,\d/.test(text)) return { fault: `Write ${text.trim().replace(/,/g, ".")} for one number, and ${text.trim().replace(/,\s*/g, ", ")} for several.` };
  const numbers = text.split(/[,;\s]+/).filter(Boolean).map(Number);
  if (!numbers.length || numbers.some((value) => !Number.isFinite(value))) return { fault: `"${text}" is no number, and no list of numbers such as 0.1, 0.2, 0.3.` };
  return { numbers };
}

/**
 * Round numbers within a range, for an axis: four to ten of them.
 * @param {number} low
 * @param {number} high
 */
export function ticks(low, high) {
  const power = 10 ** Math.floor(Math.log10((high - low) / 4));
  const step = [1, 2, 5].map((part) => part * power).findLast((part) => (high - low) / part >= 4) ?? power;
  const first = Math.ceil(low / step);
  // a range of a few last digits of large numbers has no such numbers
  return Number.isFinite(first) ? Array.from({ length: Math.min(11, Math.floor(high / step) - first + 1) }, (_, n) => (first + n) * step) : [];
}
