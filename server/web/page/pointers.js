/** Where the values of a JSON text stand, by their JSON Pointers. */

/**
 * @typedef {{start: number, end: number}} Range of a value in a text
 */

/**
 * The places of all values, up to so many; a text that is not JSON gives what was read before the fault.
 * @param {string} text
 * @param {number} [most]
 * @returns {Map<string, Range>}
 */
export function places(text, most = 20_000) {
  /** @type {Map<string, Range>} */
  const found = new Map();
  let at = 0;
  const blank = () => {
    while (/\s/.test(text[at] ?? "")) at += 1;
  };
  const string = () => {
    const start = at;
    at += 1;
    while (at < text.length && text[at] !== '"') at += text[at] === "\\" ? 2 : 1;
    at += 1;
    return text.slice(start, at);
  };
  const fail = () => {
    throw new SyntaxError(`unexpected text at ${at}`);
  };
  /** @param {string} pointer */
  const value = (pointer) => {
    blank();
    const start = at;
    const first = text[at];
    if (first === "{" || first === "[") {
      at += 1;
      blank();
      for (let n = 0; text[at] !== (first === "{" ? "}" : "]"); n += 1) {
        if (at >= text.length) fail();
        if (n > 0) {
          if (text[at] !== ",") fail();
          at += 1;
          blank();
        }
        let token = String(n);
        if (first === "{") {
          if (text[at] !== '"') fail();
          token = JSON.parse(string());
          blank();
          if (text[at] !== ":") fail();
          at += 1;
        }
        value(`${pointer}/${token.replaceAll("~", "~0").replaceAll("/", "~1")}`);
        blank();
      }
      at += 1;
    } else if (first === '"') {
      string();
    } else {
      const scalar = /^[-+.\w]+/.exec(text.slice(at, at + 60))?.[0];
      if (!scalar) fail();
      at += scalar?.length ?? 0;
    }
    if (found.size < most) found.set(pointer, { start, end: at });
  };
  try {
    value("");
  } catch {
    // what was read before is of use
  }
  return found;
}

/**
 * The place that a pointer means, or that of what it would be in.
 * @param {Map<string, Range>} all
 * @param {string} pointer
 */
export function nearest(all, pointer) {
  for (let path = pointer; ; path = path.slice(0, path.lastIndexOf("/"))) {
    const range = all.get(path);
    if (range || !path) return range;
  }
}

/**
 * The number of the line of a place, from 1.
 * @param {string} text
 * @param {number} at
 */
export const lineOf = (text, at) => text.slice(0, at).split("\n").length;

/**
 * A problem as text: short lists in one line, everything else indented.
 * @param {unknown} value
 */
export function pretty(value) {
  const text = JSON.stringify(value, null, 2);
  // lists of numbers, and small objects, in one line
  return text
    .replace(/\[\n\s+([^[\]{}]*?)\n\s+\]/g, (_, inside) => `[${inside.replace(/\s*\n\s*/g, " ")}]`)
    .replace(/\{\n\s+([^[\]{}]{1,90}?)\n\s+\}/g, (_, inside) => `{ ${inside.replace(/\s*\n\s*/g, " ")} }`);
}
