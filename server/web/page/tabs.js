/**
 * Which tabs keep a stream open. Over HTTP/1.1 a browser has six connections to a service, whatever the number of its tabs: with
 * six streams no further tab would load. The tabs that were used last keep theirs; the others ask from time to time. Over
 * HTTP/2 all tabs share one connection, and all keep their streams.
 */

/** The number of tabs that keep a stream. */
const MOST = 3;
/** How often a tab says that it is there, and how long it counts as such without saying so (ms). */
const BEAT = 10_000;
const FORGOTTEN = 25_000;

/** A name for this tab: over plain HTTP there is no `crypto.randomUUID`. */
const own = Math.random().toString(36).slice(2);
/** The other tabs with a stream, by their names: when they were used last, and heard of last (ms). @type {Map<string, {used: number, heard: number}>} */
const others = new Map();
const channel = new BroadcastChannel("signorini-tabs");
let used = Date.now();

class Tabs extends EventTarget {
  /** Whether this tab may keep a stream open; `change` is dispatched when that may have changed. */
  mayKeep() {
    const page = /** @type {PerformanceNavigationTiming | undefined} */ (performance.getEntriesByType("navigation")[0]);
    if (page && !["", "http/1.0", "http/1.1"].includes(page.nextHopProtocol)) return true;
    const there = [...others.values()].filter((other) => other.heard > Date.now() - FORGOTTEN);
    return there.filter((other) => other.used > used).length < MOST;
  }
}

export const tabs = new Tabs();

/** @param {boolean} asks whether the others are to say that they are there */
function tell(asks) {
  if (!document.hidden) channel.postMessage({ name: own, used, asks });
}

/** A person looks at this tab. */
function touched() {
  const late = Date.now() - used > 1000;
  used = Date.now();
  if (late) tell(false);
  if (late) tabs.dispatchEvent(new Event("change"));
}

channel.addEventListener("message", ({ data }) => {
  if (data.gone) others.delete(data.name);
  else others.set(data.name, { used: data.used, heard: Date.now() });
  if (data.asks) tell(false);
  tabs.dispatchEvent(new Event("change"));
});
for (const kind of ["focus", "pointerdown", "keydown", "scroll"]) addEventListener(kind, touched, { capture: true, passive: true });
document.addEventListener("visibilitychange", () => {
  if (document.hidden) channel.postMessage({ name: own, gone: true });
  else touched();
});
addEventListener("pagehide", () => channel.postMessage({ name: own, gone: true }));
setInterval(() => tell(false), BEAT);
tell(true);
