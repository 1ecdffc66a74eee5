/**
 * Streams of events. They are read by fetch: an EventSource gives up for good when a proxy answers 502, and tells nothing of an
 * expired session. A tab that nobody sees has no stream, and one that other tabs leave no connection for (see tabs.js) reads its
 * stream for a moment every few seconds: each time it goes on where it stopped.
 */

import { ApiError, connection, isPassing, pauseBefore, request, sleep } from "./api.js";
import { tabs } from "./tabs.js";

/** How long a stream that is not kept is read: until nothing comes for a while, and not longer than the second (ms). */
const QUIET = 300;
const LONGEST_LOOK = 1000;
/** The pause before it is read again (ms). */
const UNTIL_NEXT_LOOK = 5000;

/**
 * @typedef {object} Followed
 * @property {(data: any, kind: string) => void} event receives the data of each event
 * @property {() => void} [ended] is called when the stream has ended for good
 * @property {(error: ApiError) => void} [refused] is called when the service refuses the stream
 */

/**
 * Follows a stream; gives a function that ends it.
 * @param {(after: string) => string} address of the stream after the event with this id
 * @param {string} after the id of the last event that is known
 * @param {Followed} followed
 * @returns {() => void}
 */
export function follow(address, after, followed) {
  const closed = new AbortController();
  let last = after;
  const run = async () => {
    for (let attempt = 0; !closed.signal.aborted; attempt += 1) {
      await visible(closed.signal);
      // ends the reading when nobody sees the tab any more, and when other tabs need the connection
      const given = new AbortController();
      const kept = tabs.mayKeep();
      const giveUp = () => (document.hidden || (kept && !tabs.mayKeep())) && given.abort();
      document.addEventListener("visibilitychange", giveUp);
      tabs.addEventListener("change", giveUp);
      const signal = AbortSignal.any([closed.signal, given.signal]);
      try {
        const response = await request(address(last), { signal, headers: { accept: "text/event-stream" } });
        if (response.status === 204 || !response.body) return followed.ended?.();
        const look = kept ? undefined : looksShortly(given);
        const done = await read(response.body, look, (event) => {
          attempt = 0;
          if (event.id) last = event.id;
          followed.event(event.data, event.kind);
        });
        if (done) return followed.ended?.();
        if (!signal.aborted) connection.lost();
      } catch (error) {
        if (closed.signal.aborted) return;
        if (error instanceof ApiError && !isPassing(error)) return followed.refused?.(error);
        if (!given.signal.aborted) connection.lost();
      } finally {
        document.removeEventListener("visibilitychange", giveUp);
        tabs.removeEventListener("change", giveUp);
      }
      if (!given.signal.aborted) await sleep(pauseBefore(attempt), closed.signal);
      else if (!tabs.mayKeep()) await untilNextLook(closed.signal);
    }
  };
  run().catch((error) => {
    if (!closed.signal.aborted) throw error;
  });
  return () => closed.abort();
}

/**
 * Ends a reading when nothing comes for a while; gives a function that tells that something has come.
 * @param {AbortController} reading
 */
function looksShortly(reading) {
  const end = performance.now() + LONGEST_LOOK;
  let timer = setTimeout(() => reading.abort(), QUIET);
  return () => {
    clearTimeout(timer);
    timer = setTimeout(() => reading.abort(), Math.min(QUIET, Math.max(0, end - performance.now())));
  };
}

/**
 * Waits until a stream that is not kept is to be read again, or may be kept.
 * @param {AbortSignal} signal
 */
async function untilNextLook(signal) {
  const end = Date.now() + UNTIL_NEXT_LOOK * (0.75 + 0.5 * Math.random());
  while (Date.now() < end && !tabs.mayKeep()) await sleep(200, signal);
}

/**
 * Waits until the tab is seen.
 * @param {AbortSignal} signal
 * @returns {Promise<void>}
 */
function visible(signal) {
  if (!document.hidden) return Promise.resolve();
  return new Promise((resolve) => {
    const seen = () => {
      if (document.hidden && !signal.aborted) return;
      document.removeEventListener("visibilitychange", seen);
      resolve();
    };
    document.addEventListener("visibilitychange", seen);
    signal.addEventListener("abort", seen);
  });
}

/**
 * Reads the events of a stream until it ends; true if its last event was the last of all.
 * @param {ReadableStream<Uint8Array>} body
 * @param {(() => void) | undefined} came is called when something has come
 * @param {(event: {id: string, kind: string, data: any}) => void} received
 */
async function read(body, came, received) {
  const reader = body.pipeThrough(/** @type {any} */ (new TextDecoderStream())).getReader();
  let rest = "";
  let done = false;
  let since = performance.now();
  for (;;) {
    const piece = await reader.read();
    if (piece.done) return done;
    came?.();
    rest += piece.value;
    for (let end = rest.indexOf("\n\n"); end >= 0; end = rest.indexOf("\n\n")) {
      const event = parse(rest.slice(0, end));
      rest = rest.slice(end + 2);
      if (!event) continue;
      received(event);
      done = event.kind === "done";
      // a long history comes at once, and the page must stay alive
      if (performance.now() - since > 30) {
        await new Promise((resolve) => setTimeout(resolve));
        since = performance.now();
      }
    }
  }
}

/**
 * @param {string} text of an event
 * @returns {{id: string, kind: string, data: any} | null} null for a comment
 */
function parse(text) {
  let [id, kind, data] = ["", "message", ""];
  for (const line of text.split("\n")) {
    if (line.startsWith("id: ")) id = line.slice(4);
    else if (line.startsWith("event: ")) kind = line.slice(7);
    else if (line.startsWith("data: ")) data += line.slice(6);
  }
  return data ? { id, kind, data: JSON.parse(data) } : null;
}
