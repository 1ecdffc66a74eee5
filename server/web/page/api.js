/** Requests to the service. Addresses are relative to the page, so that it works below any path. */

/** An answer that is an error, with its document. */
export class ApiError extends Error {
  /**
   * @param {number} status
   * @param {Partial<import("./types").Error>} document
   */
  constructor(status, document) {
    super(document.detail ?? document.title ?? `The service answered with status ${status}.`);
    this.status = status;
    this.document = document;
    /** @type {import("./types").Violation[]} */
    this.violations = /** @type {any} */ (document).errors ?? [];
  }
}

/** The service cannot be reached, or is about to start. */
export class Unreachable extends Error {
  constructor() {
    super("The service cannot be reached.");
  }
}

/** Whether the service can be reached; `change` is dispatched when that changes, `login` when a token is needed. */
class Connection extends EventTarget {
  /** When the service could no longer be reached (ms). @type {number | null} */
  lostAt = null;

  lost() {
    if (this.lostAt === null) {
      this.lostAt = Date.now();
      this.dispatchEvent(new Event("change"));
    }
  }

  found() {
    if (this.lostAt !== null) {
      this.lostAt = null;
      this.dispatchEvent(new Event("change"));
    }
  }

  needsToken() {
    this.dispatchEvent(new Event("login"));
  }
}

export const connection = new Connection();

/** Statuses of a proxy in front of a service that is not there, and of a service that starts or stops. */
const AWAY = [502, 503, 504];

/** The longest pause between two attempts (ms). */
const LONGEST_PAUSE = 15_000;

/**
 * The pause before an attempt, longer each time.
 * @param {number} attempt from 0
 */
export const pauseBefore = (attempt) => Math.min(LONGEST_PAUSE, 500 * 2 ** attempt) * (0.75 + 0.5 * Math.random());

/**
 * Waits, but not longer than the signal allows.
 * @param {number} ms
 * @param {AbortSignal} [signal]
 * @returns {Promise<void>}
 */
export function sleep(ms, signal) {
  return new Promise((resolve, reject) => {
    if (signal?.aborted) return reject(signal.reason);
    const stop = () => {
      clearTimeout(timer);
      reject(signal?.reason);
    };
    const timer = setTimeout(() => {
      signal?.removeEventListener("abort", stop);
      resolve();
    }, ms);
    signal?.addEventListener("abort", stop, { once: true });
  });
}

/**
 * Sends a request; gives an answer that is no error.
 * @param {string} path
 * @param {RequestInit} [init]
 * @returns {Promise<Response>}
 */
export async function request(path, init = {}) {
  /** @type {Response} */
  let response;
  try {
    response = await fetch(path, init);
  } catch (error) {
    if (init.signal?.aborted) throw error;
    connection.lost();
    throw new Unreachable();
  }
  if (AWAY.includes(response.status) && !(await isOurs(response))) {
    connection.lost();
    throw new Unreachable();
  }
  connection.found();
  if (response.ok || response.status === 304) return response;
  const document = await response.json().catch(() => ({}));
  if (response.status === 401) connection.needsToken();
  throw new ApiError(response.status, document);
}

/**
 * Whether an error is the service's own, which a repetition would not change: a full queue is, a start in progress is not.
 * @param {Response} response
 */
async function isOurs(response) {
  const document = await response.clone().json().catch(() => ({}));
  return Boolean(document.code) && !["starting", "draining"].includes(document.code);
}

/**
 * @template T
 * @param {string} path
 * @param {AbortSignal} [signal]
 * @returns {Promise<T>}
 */
export async function get(path, signal) {
  // the entity tag of a job names its version, which progress and partial results do not change
  const response = await request(path, { signal: signal ?? null, cache: "no-store", headers: { accept: "application/json" } });
  return response.json();
}

/**
 * Whether the same request may be answered later: the service is away, overloaded, or had a fault of its own.
 * @param {unknown} error
 */
export const isPassing = (error) => error instanceof Unreachable || (error instanceof ApiError && (error.status === 429 || error.status === 503));

/**
 * Gets JSON, and tries again while the service cannot be reached.
 * @template T
 * @param {string} path
 * @param {AbortSignal} signal
 * @returns {Promise<T>}
 */
export async function getSurely(path, signal) {
  for (let attempt = 0; ; attempt += 1) {
    try {
      return await get(path, signal);
    } catch (error) {
      if (!isPassing(error)) throw error;
    }
    await sleep(pauseBefore(attempt), signal);
  }
}

/**
 * Sends JSON; gives the JSON of the answer, or nothing.
 * @template T
 * @param {string} method
 * @param {string} path
 * @param {unknown} [body]
 * @param {Record<string, string>} [headers]
 * @returns {Promise<T>}
 */
export async function send(method, path, body, headers = {}) {
  const response = await request(path, {
    method,
    body: body === undefined ? null : JSON.stringify(body),
    headers: { accept: "application/json", ...(body === undefined ? {} : { "content-type": "application/json" }), ...headers },
  });
  return response.status === 204 ? /** @type {any} */ (undefined) : response.json();
}

/** A key by which a repeated submission is recognised. */
export function newKey() {
  const numbers = crypto.getRandomValues(new Uint32Array(4));
  return Array.from(numbers, (number) => number.toString(16).padStart(8, "0")).join("");
}

/**
 * The arrays of a view (docs/formats.md).
 * @typedef {{head: any, arrays: Record<string, Float32Array | Uint32Array>}} View
 */

/**
 * Gets a view.
 * @param {string} path
 * @param {RequestInit} [init]
 * @returns {Promise<View>}
 */
export async function getView(path, init = {}) {
  for (let attempt = 0; ; attempt += 1) {
    try {
      const response = await request(path, init);
      return readView(await response.arrayBuffer());
    } catch (error) {
      // the service draws few large bodies at a time
      if (!isPassing(error)) throw error;
    }
    await sleep(pauseBefore(attempt), init.signal ?? undefined);
  }
}

/**
 * @param {ArrayBuffer} buffer
 * @returns {View}
 */
export function readView(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  /** @type {Record<string, Float32Array | Uint32Array>} */
  const arrays = {};
  for (const { name, type, offset, length: count } of head.arrays) {
    const start = 4 + length + offset;
    arrays[name] = type === "f32" ? new Float32Array(buffer, start, count) : new Uint32Array(buffer, start, count);
  }
  return { head, arrays };
}
