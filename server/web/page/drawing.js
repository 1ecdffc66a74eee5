/**
 * A body in the plane with what is around it: elements coloured by a field, deformed by its displacements, with boundaries,
 * supports and obstacles. The elements are drawn by a worker (painter.js), all else here on a canvas above.
 */

import { number } from "./format.js";

/** @typedef {import("./api.js").View} View */

/** The colours of a field from its least to its greatest value (red, green and blue from 0 to 1). */
const RAMP = [
  [0.15, 0.27, 0.42],
  [0.18, 0.49, 0.56],
  [0.46, 0.72, 0.5],
  [0.91, 0.85, 0.45],
  [0.97, 0.55, 0.25],
  [0.8, 0.17, 0.13],
];
/** The same of a field with both signs, with zero in the middle. */
const SIGNED = [
  [0.1, 0.25, 0.55],
  [0.35, 0.6, 0.85],
  [0.93, 0.93, 0.92],
  [0.93, 0.6, 0.4],
  [0.65, 0.12, 0.12],
];

/** The number of elements up to which their sides are drawn at first. */
const FEW = 6000;

const css = (/** @type {string} */ name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/**
 * A colour of the page as numbers from 0 to 1.
 * @param {string} name of a custom property
 */
function rgb(name) {
  const short = css(name).replace("#", "");
  const text = short.length === 3 ? short.replace(/./g, "$&$&") : short;
  return [0, 2, 4].map((at) => parseInt(text.slice(at, at + 2), 16) / 255);
}

export class Drawing {
  /** @type {View | null} */
  view = null;
  /** @type {Float32Array | null} */
  moved = null;
  /** @type {Float32Array | null} */
  values = null;
  /** @type {[number, number]} */
  range = [0, 1];
  signed = false;
  scale = 1;
  edges = true;
  /** Whether obstacles, supports and loads are drawn. */
  around = true;
  /** The middle of what is seen, and how many pixels a length has. */
  center = [0, 0];
  zoom = 1;
  /** @type {string | null} */
  pointed = null;
  due = 0;

  /**
   * @param {HTMLElement} root
   * @param {{label: string, value?: () => string, read?: (text: string) => void, picked?: (boundary: string) => void}} options
   */
  constructor(root, options) {
    this.root = root;
    this.options = options;
    root.classList.add("drawing");
    root.tabIndex = 0;
    root.setAttribute("role", "img");
    root.setAttribute("aria-label", `${options.label}. Plus and minus zoom, the arrow keys move, 0 shows all.`);
    this.canvas = document.createElement("canvas");
    this.over = document.createElement("canvas");
    root.replaceChildren(this.canvas, this.over);
    this.painter = new Worker(new URL("./painter.js", import.meta.url), { type: "module" });
    this.painter.addEventListener("error", () => options.read?.("The body cannot be drawn. Load the page again."));
    this.listen();
  }

  listen() {
    const { root } = this;
    this.stop = new AbortController();
    const { signal } = this.stop;
    root.addEventListener("wheel", (event) => this.wheel(event), { signal, passive: false });
    root.addEventListener("pointerdown", (event) => this.drag(event), { signal });
    root.addEventListener("pointermove", (event) => this.point(event), { signal });
    root.addEventListener("dblclick", () => this.showAll(), { signal });
    root.addEventListener("keydown", (event) => this.key(event), { signal });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw(), { signal });
    this.resized = new ResizeObserver(() => this.draw());
    this.resized.observe(root);
  }

  close() {
    this.stop?.abort();
    this.resized?.disconnect();
    this.painter.terminate();
  }

  /**
   * Shows a body.
   * @param {View} view
   */
  setBody(view) {
    this.view = view;
    const few = view.head.elements <= FEW;
    this.edges = few;
    this.moved = null;
    this.values = null;
    // whether lines are smooth is a property of the canvas; those of many elements are not, and take half the time
    const canvas = document.createElement("canvas");
    this.canvas.replaceWith(canvas);
    this.canvas = canvas;
    const { positions, quads, triangles, outline } = view.arrays;
    const offscreen = canvas.transferControlToOffscreen();
    this.paint({ canvas: offscreen, body: { positions, quads, triangles, outline }, smooth: few }, [offscreen]);
    this.showAll();
  }

  /**
   * Tells the worker something.
   * @param {import("./painter.js").Message} message
   * @param {Transferable[]} [given]
   */
  paint(message, given = []) {
    this.painter.postMessage(message, given);
  }

  /** The colours of the field. */
  ramp() {
    return this.signed ? SIGNED : RAMP;
  }

  /** @param {Float32Array | null} moved the displacement of each corner */
  setMoved(moved) {
    this.moved = moved;
    this.paint({ moved });
    this.draw();
  }

  /**
   * @param {Float32Array | null} values at the corners
   * @param {[number, number]} range that is shown
   * @param {boolean} [evenly] whether a range with both signs is made as wide on both sides of 0
   */
  setValues(values, range, evenly = true) {
    this.values = values;
    this.range = range;
    this.signed = evenly && range[0] < 0 && range[1] > 0;
    if (this.signed) {
      const most = Math.max(-range[0], range[1]);
      this.range = [-most, most];
    }
    this.paint({ values });
    this.draw();
  }

  /** The place of a corner as it is drawn. */
  place(/** @type {number} */ corner) {
    const positions = /** @type {Float32Array} */ (this.view?.arrays.positions);
    const moved = (/** @type {number} */ k) => (this.moved ? this.scale * (this.moved[2 * corner + k] ?? 0) : 0);
    return [(positions[2 * corner] ?? 0) + moved(0), (positions[2 * corner + 1] ?? 0) + moved(1)];
  }

  /** Shows the whole body. */
  showAll() {
    const positions = this.view?.arrays.positions;
    if (!positions?.length) return;
    this.fit(bounds(positions));
  }

  /**
   * Shows a part of the plane.
   * @param {number[]} box least x, least y, greatest x, greatest y
   */
  fit([left = 0, bottom = 0, right = 1, top = 1]) {
    const [width, height] = [this.root.clientWidth || 600, this.root.clientHeight || 400];
    this.center = [(left + right) / 2, (bottom + top) / 2];
    const size = Math.max(right - left, top - bottom, 1e-300);
    this.zoom = 0.86 * Math.min(width / Math.max(right - left, 1e-3 * size), height / Math.max(top - bottom, 1e-3 * size));
    this.draw();
  }

  /** The place in the plane of a point of the screen. */
  toPlane(/** @type {number} */ x, /** @type {number} */ y) {
    const { clientWidth: width, clientHeight: height } = this.root;
    return [(this.center[0] ?? 0) + (x - width / 2) / this.zoom, (this.center[1] ?? 0) - (y - height / 2) / this.zoom];
  }

  /** The point of the screen of a place in the plane. */
  toScreen(/** @type {number} */ x, /** @type {number} */ y) {
    const { clientWidth: width, clientHeight: height } = this.root;
    return [width / 2 + (x - (this.center[0] ?? 0)) * this.zoom, height / 2 - (y - (this.center[1] ?? 0)) * this.zoom];
  }

  /** @param {WheelEvent} event */
  wheel(event) {
    // a page that is scrolled past must not be caught
    if (!event.ctrlKey && document.activeElement !== this.root) return;
    event.preventDefault();
    const box = this.root.getBoundingClientRect();
    this.zoomAt(Math.exp(-event.deltaY / 400), event.clientX - box.left, event.clientY - box.top);
  }

  zoomAt(/** @type {number} */ factor, /** @type {number} */ x, /** @type {number} */ y) {
    const [px = 0, py = 0] = this.toPlane(x, y);
    this.zoom *= factor;
    const [qx = 0, qy = 0] = this.toPlane(x, y);
    this.center = [(this.center[0] ?? 0) + px - qx, (this.center[1] ?? 0) + py - qy];
    this.draw();
  }

  /** @param {PointerEvent} event */
  drag(event) {
    if (event.button !== 0) return;
    this.root.focus({ preventScroll: true });
    const start = [event.clientX, event.clientY];
    const from = [...this.center];
    let far = false;
    const stop = new AbortController();
    const move = (/** @type {PointerEvent} */ now) => {
      const [dx, dy] = [now.clientX - (start[0] ?? 0), now.clientY - (start[1] ?? 0)];
      far ||= Math.hypot(dx, dy) > 4;
      if (!far) return;
      this.center = [(from[0] ?? 0) - dx / this.zoom, (from[1] ?? 0) + dy / this.zoom];
      this.draw();
    };
    const end = () => {
      stop.abort();
      if (!far && this.pointed) this.options.picked?.(this.pointed);
    };
    addEventListener("pointermove", move, { signal: stop.signal });
    addEventListener("pointerup", end, { signal: stop.signal });
    addEventListener("pointercancel", end, { signal: stop.signal });
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const { clientWidth: width, clientHeight: height } = this.root;
    const step = 40 / this.zoom;
    const moves = /** @type {Record<string, [number, number]>} */ ({ ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] });
    const move = moves[event.key];
    if (move) this.center = [(this.center[0] ?? 0) + move[0], (this.center[1] ?? 0) + move[1]];
    else if (event.key === "+") this.zoomAt(1.25, width / 2, height / 2);
    else if (event.key === "-") this.zoomAt(0.8, width / 2, height / 2);
    else if (event.key === "0") this.showAll();
    else return;
    event.preventDefault();
    this.draw();
  }

  /** @param {PointerEvent} event */
  point(event) {
    if (!this.view || event.buttons) return;
    const box = this.root.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    const boundary = this.boundaryAt(x, y);
    if (boundary !== this.pointed) {
      this.pointed = boundary;
      this.root.classList.toggle("pointing", boundary !== null);
      this.drawOver();
    }
    const [px = 0, py = 0] = this.toPlane(x, y);
    const told = [`x = ${number(px)}, y = ${number(py)}`];
    const inside = this.values || this.moved ? this.elementAt(px, py) : null;
    const at = (/** @type {Float32Array} */ values, size = 1, place = 0) => (inside ?? []).reduce((sum, [corner, weight]) => sum + weight * (values[size * corner + place] ?? NaN), 0);
    if (inside && this.values) told.push(`${this.options.value?.() ?? "value"} = ${number(at(this.values))}`);
    if (inside && this.moved) told.push(`u = (${number(at(this.moved, 2, 0), 4)}, ${number(at(this.moved, 2, 1), 4)})`);
    if (boundary) told.push(`boundary ${boundary}`);
    this.options.read?.(told.join(" · "));
  }

  /**
   * The corners of the triangle, or of the half of a quadrilateral, around a place, each with its weight there.
   * @param {number} x
   * @param {number} y
   * @returns {[number, number][] | null}
   */
  elementAt(x, y) {
    const { quads, triangles } = this.view?.arrays ?? {};
    const within = (/** @type {number} */ a, /** @type {number} */ b, /** @type {number} */ c) => {
      const [ax = 0, ay = 0] = this.place(a);
      const [bx = 0, by = 0] = this.place(b);
      const [cx = 0, cy = 0] = this.place(c);
      const area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
      if (area === 0) return null;
      const [v, w] = [((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / area, ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / area];
      return v >= 0 && w >= 0 && v + w <= 1 ? /** @type {[number, number][]} */ ([[a, 1 - v - w], [b, v], [c, w]]) : null;
    };
    for (let n = 0; quads && n < quads.length; n += 4) {
      const [a, b, c, d] = [quads[n] ?? 0, quads[n + 1] ?? 0, quads[n + 2] ?? 0, quads[n + 3] ?? 0];
      const found = within(a, b, c) ?? within(a, c, d);
      if (found) return found;
    }
    for (let n = 0; triangles && n < triangles.length; n += 3) {
      const found = within(triangles[n] ?? 0, triangles[n + 1] ?? 0, triangles[n + 2] ?? 0);
      if (found) return found;
    }
    return null;
  }

  /** The name of the boundary next to a point of the screen. */
  boundaryAt(/** @type {number} */ x, /** @type {number} */ y) {
    let [best, found] = [8, /** @type {string | null} */ (null)];
    for (const { name, points } of this.lines("boundaries")) {
      for (let n = 0; n + 3 < points.length; n += 4) {
        const [ax = 0, ay = 0] = this.toScreen(points[n] ?? 0, points[n + 1] ?? 0);
        const [bx = 0, by = 0] = this.toScreen(points[n + 2] ?? 0, points[n + 3] ?? 0);
        const length = Math.max((bx - ax) ** 2 + (by - ay) ** 2, 1e-9);
        const t = Math.max(0, Math.min(1, ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length));
        const far = Math.hypot(ax + t * (bx - ax) - x, ay + t * (by - ay) - y);
        if (far < best) [best, found] = [far, name];
      }
    }
    return found;
  }

  /**
   * Named lines of the view, with their points.
   * @param {"boundaries" | "obstacles"} what
   * @returns {{name: string, points: Float32Array}[]}
   */
  lines(what) {
    const all = /** @type {Float32Array | undefined} */ (this.view?.arrays[`${what}_points`]);
    if (!all) return [];
    return this.view?.head[what].map((/** @type {any} */ { name, first, count }) => ({ name, points: all.subarray(2 * first, 2 * (first + count)) }));
  }

  draw() {
    if (this.due) return;
    this.due = requestAnimationFrame(() => {
      this.due = 0;
      this.drawNow();
    });
  }

  drawNow() {
    const ratio = devicePixelRatio || 1;
    const { clientWidth: width, clientHeight: height } = this.root;
    if (!width || !height || !this.view) return;
    const [wide, high] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (this.over.width !== wide || this.over.height !== high) Object.assign(this.over, { width: wide, height: high });
    const { center, zoom, scale, range, edges } = this;
    const colors = { panel: rgb("--panel"), body: rgb("--body"), edge: rgb("--edge"), text: rgb("--text") };
    this.paint({ scene: { width, height, ratio, center, zoom, scale, range, ramp: this.ramp(), edges, colors } });
    this.drawOver();
  }

  drawOver() {
    const context = this.over.getContext("2d");
    if (!context || !this.view) return;
    const ratio = devicePixelRatio || 1;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, this.over.width, this.over.height);
    if (this.around) {
      this.drawSupports(context);
      this.drawObstacles(context);
    }
    this.drawPointed(context);
    if (this.values) this.drawLegend(context);
  }

  /** @param {CanvasRenderingContext2D} context */
  drawObstacles(context) {
    // where the obstacle ended is known at the true scale only
    if (this.moved && this.scale !== 1) return;
    context.fillStyle = css("--obstacle");
    context.strokeStyle = css("--text");
    context.lineWidth = 1.5;
    for (const { points } of this.lines("obstacles")) {
      /** @type {number[][]} */
      const screen = [];
      for (let n = 0; n + 1 < points.length; n += 2) {
        const [x = 0, y = 0] = this.toScreen(points[n] ?? 0, points[n + 1] ?? 0);
        const [[bx = 0, by = 0] = [], [ax = 0, ay = 0] = []] = [screen[screen.length - 1] ?? [], screen[screen.length - 2] ?? []];
        // points that face a curved body may come back on their line
        const back = screen.length > 1 && (x - bx) * (bx - ax) + (y - by) * (by - ay) < -0.5 * Math.hypot(x - bx, y - by) * Math.hypot(bx - ax, by - ay);
        if (!back && !(screen.length && x === bx && y === by)) screen.push([x, y]);
      }
      if (screen.length < 2) continue;
      const outward = screen.map((_, n) => {
        const [ax = 0, ay = 0] = screen[Math.max(0, n - 1)] ?? [];
        const [bx = 0, by = 0] = screen[Math.min(screen.length - 1, n + 1)] ?? [];
        const length = Math.hypot(bx - ax, by - ay) || 1;
        return [(by - ay) / length, -(bx - ax) / length];
      });
      context.beginPath();
      screen.forEach(([x = 0, y = 0]) => context.lineTo(x, y));
      for (let n = screen.length - 1; n >= 0; n -= 1) {
        context.lineTo((screen[n]?.[0] ?? 0) + 14 * (outward[n]?.[0] ?? 0), (screen[n]?.[1] ?? 0) + 14 * (outward[n]?.[1] ?? 0));
      }
      context.globalAlpha = 0.75;
      context.fill();
      context.globalAlpha = 1;
      context.beginPath();
      screen.forEach(([x = 0, y = 0]) => context.lineTo(x, y));
      context.stroke();
    }
  }

  /** @param {CanvasRenderingContext2D} context */
  drawSupports(context) {
    const named = new Map(this.lines("boundaries").map(({ name, points }) => [name, points]));
    context.strokeStyle = css("--text");
    context.fillStyle = css("--panel");
    context.lineWidth = 1;
    for (const support of this.view?.head.supports ?? []) {
      const points = named.get(support.boundary);
      if (!points) continue;
      const both = (support.x && support.y) || (support.normal && support.tangent);
      let since = Infinity;
      for (let n = 0; n + 3 < points.length; n += 4) {
        const [ax = 0, ay = 0] = this.toScreen(points[n] ?? 0, points[n + 1] ?? 0);
        const [bx = 0, by = 0] = this.toScreen(points[n + 2] ?? 0, points[n + 3] ?? 0);
        const length = Math.hypot(bx - ax, by - ay);
        for (let at = 0; at <= length; at += 26) {
          since += Math.min(26, length);
          if (since < 26) continue;
          since = 0;
          const t = length ? at / length : 0;
          const out = [(by - ay) / (length || 1), -(bx - ax) / (length || 1)];
          mark(context, ax + t * (bx - ax), ay + t * (by - ay), out, both ? "fixed" : support.springs ? "spring" : "roller");
        }
      }
    }
  }

  /** @param {CanvasRenderingContext2D} context */
  drawPointed(context) {
    const line = this.lines("boundaries").find(({ name }) => name === this.pointed);
    if (!line || !this.pointed) return;
    context.strokeStyle = css("--curve-2");
    context.lineWidth = 4;
    context.beginPath();
    for (let n = 0; n + 3 < line.points.length; n += 4) {
      const [ax = 0, ay = 0] = this.toScreen(line.points[n] ?? 0, line.points[n + 1] ?? 0);
      const [bx = 0, by = 0] = this.toScreen(line.points[n + 2] ?? 0, line.points[n + 3] ?? 0);
      context.moveTo(ax, ay);
      context.lineTo(bx, by);
    }
    context.stroke();
  }

  /** @param {CanvasRenderingContext2D} context */
  drawLegend(context) {
    const width = this.root.clientWidth;
    const height = Math.min(180, this.root.clientHeight - 40);
    const [left, top] = [width - 26, 16];
    const ramp = this.ramp();
    const gradient = context.createLinearGradient(0, top + height, 0, top);
    ramp.forEach((color, n) => gradient.addColorStop(n / (ramp.length - 1), `rgb(${color.map((part) => Math.round(255 * part)).join(" ")})`));
    context.fillStyle = gradient;
    context.fillRect(left, top, 14, height);
    context.fillStyle = css("--text");
    context.font = '12px system-ui, "DejaVu Sans", sans-serif';
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const part of [0, 0.5, 1]) {
      const value = this.range[0] + part * (this.range[1] - this.range[0]);
      const text = number(value, 4);
      const [x, y] = [left - 5, top + height * (1 - part)];
      context.lineWidth = 3;
      context.strokeStyle = css("--panel");
      context.strokeText(text, x, y);
      context.fillText(text, x, y);
    }
  }
}

/**
 * The sign of a support: a triangle, a circle, or a zigzag.
 * @param {CanvasRenderingContext2D} context
 * @param {number} x
 * @param {number} y
 * @param {number[]} out the direction away from the body, on the screen
 * @param {"fixed" | "roller" | "spring"} kind
 */
function mark(context, x, y, [ox = 0, oy = 0], kind) {
  const [px, py] = [-oy, ox];
  context.beginPath();
  if (kind === "roller") {
    context.arc(x + 5 * ox, y + 5 * oy, 4, 0, 2 * Math.PI);
  } else if (kind === "fixed") {
    context.moveTo(x, y);
    context.lineTo(x + 9 * ox + 5 * px, y + 9 * oy + 5 * py);
    context.lineTo(x + 9 * ox - 5 * px, y + 9 * oy - 5 * py);
    context.closePath();
  } else {
    context.moveTo(x, y);
    for (let n = 1; n <= 5; n += 1) {
      const side = n % 2 ? 3 : -3;
      context.lineTo(x + 2.5 * n * ox + side * px, y + 2.5 * n * oy + side * py);
    }
  }
  if (kind !== "spring") context.fill();
  context.stroke();
}

/** The least box around points. */
export function bounds(/** @type {ArrayLike<number>} */ points) {
  const box = [Infinity, Infinity, -Infinity, -Infinity];
  for (let n = 0; n + 1 < points.length; n += 2) {
    for (const k of [0, 1]) {
      const value = points[n + k] ?? 0;
      box[k] = Math.min(box[k] ?? 0, value);
      box[k + 2] = Math.max(box[k + 2] ?? 0, value);
    }
  }
  return box;
}
