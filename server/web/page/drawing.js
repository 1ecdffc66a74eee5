/**
 * A body in the plane with what is around it: elements coloured by a field, deformed by its displacements, with boundaries,
 * supports and obstacles. Elements are drawn by WebGL2, and without it, more slowly, on a plain canvas.
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

const VERTEX = `#version 300 es
in vec2 position; in vec2 moved; in float value;
uniform float scale; uniform vec2 center; uniform vec2 zoom;
out float v;
void main() { gl_Position = vec4((position + scale * moved - center) * zoom, 0.0, 1.0); v = value; }`;
const FRAGMENT = `#version 300 es
precision highp float;
in float v; uniform vec2 range; uniform vec4 plain; uniform bool coloured; uniform vec3 ramp[6]; uniform int stops;
out vec4 color;
void main() {
  color = plain;
  if (!coloured || !(v >= -1e37 && v <= 1e37)) return;
  float t = clamp((v - range.x) / max(range.y - range.x, 1e-30), 0.0, 1.0) * float(stops - 1);
  int n = min(int(t), stops - 2);
  color = vec4(mix(ramp[n], ramp[n + 1], t - float(n)), 1.0);
}`;

/** The number of elements up to which their sides are drawn at first. */
const FEW = 6000;
/** The number of elements that are drawn without WebGL. */
const MOST_PLAIN = 30_000;

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
    const gl = this.canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
    this.painter = gl ? new WebGlPainter(gl) : new PlainPainter(this.canvas);
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
    this.painter.close();
  }

  /**
   * Shows a body.
   * @param {View} view
   */
  setBody(view) {
    this.view = view;
    this.edges = view.head.elements <= FEW;
    this.moved = null;
    this.values = null;
    this.painter.setBody(view);
    this.showAll();
  }

  /** @param {Float32Array | null} moved the displacement of each corner */
  setMoved(moved) {
    this.moved = moved;
    this.painter.setMoved(moved);
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
    this.painter.setValues(values);
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
    for (const canvas of [this.canvas, this.over]) {
      const [wide, high] = [Math.round(width * ratio), Math.round(height * ratio)];
      if (canvas.width !== wide || canvas.height !== high) Object.assign(canvas, { width: wide, height: high });
    }
    this.painter.paint(this);
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
    const ramp = this.signed ? SIGNED : RAMP;
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

/** The triangles of a view: those of quadrilaterals in two. */
function trianglesOf(/** @type {View} */ { arrays }) {
  const [quads, own] = [arrays.quads ?? [], arrays.triangles ?? []];
  const all = new Uint32Array((quads.length / 4) * 6 + own.length);
  let at = 0;
  for (let n = 0; n < quads.length; n += 4) {
    for (const corner of [0, 1, 2, 0, 2, 3]) all[at++] = quads[n + corner] ?? 0;
  }
  for (let n = 0; n < own.length; n += 1) all[at++] = own[n] ?? 0;
  return all;
}

/** The sides of the elements of a view, as pairs of corners; inner ones twice. */
function sidesOf(/** @type {View} */ { arrays }) {
  /** @type {number[]} */
  const all = [];
  for (const [ids, corners] of /** @type {[Uint32Array, number][]} */ ([[arrays.quads ?? [], 4], [arrays.triangles ?? [], 3]])) {
    for (let n = 0; n < ids.length; n += corners) {
      for (let k = 0; k < corners; k += 1) {
        const [a = 0, b = 0] = [ids[n + k], ids[n + ((k + 1) % corners)]];
        if (a < b) all.push(a, b);
      }
    }
  }
  return new Uint32Array(all);
}

/** Draws by WebGL2. */
class WebGlPainter {
  /** @param {WebGL2RenderingContext} gl */
  constructor(gl) {
    this.gl = gl;
    const program = /** @type {WebGLProgram} */ (gl.createProgram());
    for (const [kind, source] of /** @type {[number, string][]} */ ([[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]])) {
      const shader = /** @type {WebGLShader} */ (gl.createShader(kind));
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    gl.useProgram(program);
    this.program = program;
    this.buffers = Object.fromEntries(["position", "moved", "value", "triangles", "sides", "outline"].map((name) => [name, gl.createBuffer()]));
    this.counts = { triangles: 0, sides: -1, outline: 0 };
  }

  close() {
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }

  /**
   * @param {string} name of an attribute
   * @param {Float32Array | null} values
   * @param {number} size
   */
  attribute(name, values, size) {
    const { gl } = this;
    const place = gl.getAttribLocation(this.program, name);
    if (!values) {
      gl.disableVertexAttribArray(place);
      gl.vertexAttrib2f(place, 0, 0);
      return;
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[name] ?? null);
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, gl.FLOAT, false, 0, 0);
  }

  /**
   * @param {"triangles" | "sides" | "outline"} name
   * @param {Uint32Array} ids
   */
  elements(name, ids) {
    const { gl } = this;
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.buffers[name] ?? null);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, ids, gl.STATIC_DRAW);
    this.counts[name] = ids.length;
  }

  /** @param {View} view */
  setBody(view) {
    this.view = view;
    this.attribute("position", /** @type {Float32Array} */ (view.arrays.positions), 2);
    this.attribute("moved", null, 2);
    this.attribute("value", null, 1);
    this.elements("triangles", trianglesOf(view));
    this.elements("outline", /** @type {Uint32Array} */ (view.arrays.outline));
    this.counts.sides = -1;
  }

  /** @param {Float32Array | null} moved */
  setMoved(moved) {
    this.attribute("moved", moved, 2);
  }

  /** @param {Float32Array | null} values */
  setValues(values) {
    this.attribute("value", values, 1);
  }

  /** @param {Drawing} drawing */
  paint(drawing) {
    const { gl, program } = this;
    const uniform = (/** @type {string} */ name) => gl.getUniformLocation(program, name);
    const { clientWidth: width, clientHeight: height } = drawing.root;
    gl.viewport(0, 0, drawing.canvas.width, drawing.canvas.height);
    const [r = 1, g = 1, b = 1] = rgb("--panel");
    gl.clearColor(r, g, b, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.uniform1f(uniform("scale"), drawing.moved ? drawing.scale : 0);
    gl.uniform2f(uniform("center"), drawing.center[0] ?? 0, drawing.center[1] ?? 0);
    gl.uniform2f(uniform("zoom"), (2 * drawing.zoom) / width, (2 * drawing.zoom) / height);
    gl.uniform2f(uniform("range"), drawing.range[0], drawing.range[1]);
    const ramp = drawing.signed ? SIGNED : RAMP;
    gl.uniform3fv(uniform("ramp"), ramp.flat());
    gl.uniform1i(uniform("stops"), ramp.length);
    const layer = (/** @type {"triangles" | "sides" | "outline"} */ name, /** @type {number} */ mode, /** @type {number[]} */ color, /** @type {boolean} */ coloured) => {
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.buffers[name] ?? null);
      gl.uniform4f(uniform("plain"), color[0] ?? 0, color[1] ?? 0, color[2] ?? 0, color[3] ?? 1);
      gl.uniform1i(uniform("coloured"), coloured ? 1 : 0);
      gl.drawElements(mode, this.counts[name], gl.UNSIGNED_INT, 0);
    };
    layer("triangles", gl.TRIANGLES, rgb("--body"), drawing.values !== null);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    if (drawing.edges && this.view) {
      if (this.counts.sides < 0) this.elements("sides", sidesOf(this.view));
      layer("sides", gl.LINES, [...rgb("--edge"), drawing.values ? 0.35 : 0.75], false);
    }
    layer("outline", gl.LINES, [...rgb("--text"), 0.9], false);
    gl.disable(gl.BLEND);
  }
}

/** Draws on a plain canvas, where there is no WebGL2. */
class PlainPainter {
  /** @type {Float32Array | null} */
  values = null;

  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.context = canvas.getContext("2d");
  }

  close() {}

  /** @param {View} view */
  setBody(view) {
    this.triangles = trianglesOf(view);
    this.view = view;
  }

  setMoved() {}

  /** @param {Float32Array | null} values */
  setValues(values) {
    this.values = values;
  }

  /** @param {Drawing} drawing */
  paint(drawing) {
    const { context, triangles, view } = this;
    if (!context || !triangles || !view) return;
    const ratio = devicePixelRatio || 1;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, drawing.canvas.width, drawing.canvas.height);
    const ramp = drawing.signed ? SIGNED : RAMP;
    const count = Math.min(triangles.length, 6 * MOST_PLAIN);
    const corner = (/** @type {number} */ n) => {
      const [x = 0, y = 0] = drawing.place(triangles[n] ?? 0);
      return drawing.toScreen(x, y);
    };
    for (let n = 0; n < count; n += 3) {
      const values = this.values;
      context.fillStyle = css("--body");
      if (values) {
        const mean = ((values[triangles[n] ?? 0] ?? 0) + (values[triangles[n + 1] ?? 0] ?? 0) + (values[triangles[n + 2] ?? 0] ?? 0)) / 3;
        const t = Math.max(0, Math.min(1, (mean - drawing.range[0]) / (drawing.range[1] - drawing.range[0] || 1))) * (ramp.length - 1);
        const [low, high] = [ramp[Math.floor(t)] ?? [], ramp[Math.min(ramp.length - 1, Math.floor(t) + 1)] ?? []];
        const color = low.map((part, k) => Math.round(255 * (part + (t % 1) * ((high[k] ?? 0) - part))));
        context.fillStyle = `rgb(${color.join(" ")})`;
      }
      context.beginPath();
      for (const k of [0, 1, 2]) {
        const [x = 0, y = 0] = corner(n + k);
        context.lineTo(x, y);
      }
      context.fill();
    }
    context.strokeStyle = css("--text");
    context.beginPath();
    const outline = view.arrays.outline ?? [];
    for (let n = 0; n + 1 < outline.length; n += 2) {
      for (const k of [0, 1]) {
        const [px = 0, py = 0] = drawing.place(outline[n + k] ?? 0);
        const [x = 0, y = 0] = drawing.toScreen(px, py);
        if (k) context.lineTo(x, y);
        else context.moveTo(x, y);
      }
    }
    context.stroke();
  }
}
