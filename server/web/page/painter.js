/**
 * Draws the elements of a body, by WebGL2, and without it, more slowly, on a plain canvas. This runs in a worker: where there is no
 * graphics processor a large body takes long, and the page answers meanwhile.
 */

// a module, whose types others may import
export {};

/** The arrays of a view of which elements are drawn. @typedef {Record<"positions" | "quads" | "triangles" | "outline", any>} Body */

/**
 * What is seen of a body, and how; colours are red, green and blue from 0 to 1.
 * @typedef {object} Scene
 * @property {number} width of the canvas, in pixels of the page
 * @property {number} height
 * @property {number} ratio how many pixels of the screen a pixel of the page has
 * @property {number[]} center the place in the plane that is in the middle
 * @property {number} zoom how many pixels of the page a length has
 * @property {number} scale of the displacements
 * @property {[number, number]} range of the values that have different colours
 * @property {number[][]} ramp the colours of these values
 * @property {boolean} edges whether sides of elements are drawn
 * @property {Record<"panel" | "body" | "edge" | "text", number[]>} colors of the page
 */

/**
 * A message to the worker: another body with a canvas for it, what it has at its corners, or what is to be seen.
 * @typedef {{canvas: OffscreenCanvas, body: Body, smooth: boolean} | {moved: Float32Array | null} | {values: Float32Array | null} | {scene: Scene}} Message
 */

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

/** The number of elements that are drawn without WebGL. */
const MOST_PLAIN = 30_000;

/** @type {WebGlPainter | PlainPainter | undefined} */
let painter;
/** @type {Scene | undefined} */
let scene;
let due = false;

addEventListener("message", ({ data }) => {
  const message = /** @type {Message} */ (data);
  if ("canvas" in message) {
    painter?.close();
    const gl = message.canvas.getContext("webgl2", { antialias: message.smooth });
    painter = gl ? new WebGlPainter(gl, message.body) : new PlainPainter(message.canvas, message.body);
    scene = undefined;
  } else if ("moved" in message) painter?.setMoved(message.moved);
  else if ("values" in message) painter?.setValues(message.values);
  else scene = message.scene;
  if (due) return;
  due = true;
  requestAnimationFrame(() => {
    due = false;
    if (scene) painter?.paint(scene);
  });
});

/** The triangles of a body: those of quadrilaterals in two. */
function trianglesOf(/** @type {Body} */ { quads, triangles: own }) {
  const all = new Uint32Array((quads.length / 4) * 6 + own.length);
  let at = 0;
  for (let n = 0; n < quads.length; n += 4) {
    for (const corner of [0, 1, 2, 0, 2, 3]) all[at++] = quads[n + corner] ?? 0;
  }
  for (let n = 0; n < own.length; n += 1) all[at++] = own[n] ?? 0;
  return all;
}

/** The sides of the elements of a body, as pairs of corners; inner ones twice. */
function sidesOf(/** @type {Body} */ { quads, triangles }) {
  /** @type {number[]} */
  const all = [];
  for (const [ids, corners] of /** @type {[Uint32Array, number][]} */ ([[quads, 4], [triangles, 3]])) {
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
  /**
   * @param {WebGL2RenderingContext} gl
   * @param {Body} body
   */
  constructor(gl, body) {
    this.gl = gl;
    this.body = body;
    /** Whether its corners have values. */
    this.coloured = false;
    this.isMoved = false;
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
    this.attribute("position", body.positions, 2);
    this.attribute("moved", null, 2);
    this.attribute("value", null, 1);
    this.elements("triangles", trianglesOf(body));
    this.elements("outline", body.outline);
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

  /** @param {Float32Array | null} moved */
  setMoved(moved) {
    this.attribute("moved", moved, 2);
    this.isMoved = moved !== null;
  }

  /** @param {Float32Array | null} values */
  setValues(values) {
    this.attribute("value", values, 1);
    this.coloured = values !== null;
  }

  /** @param {Scene} scene */
  paint(scene) {
    const { gl, program } = this;
    const uniform = (/** @type {string} */ name) => gl.getUniformLocation(program, name);
    const { width, height, center, zoom, range, ramp, colors } = scene;
    resize(gl.canvas, scene);
    gl.viewport(0, 0, gl.canvas.width, gl.canvas.height);
    const [r = 1, g = 1, b = 1] = colors.panel;
    gl.clearColor(r, g, b, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.uniform1f(uniform("scale"), this.isMoved ? scene.scale : 0);
    gl.uniform2f(uniform("center"), center[0] ?? 0, center[1] ?? 0);
    gl.uniform2f(uniform("zoom"), (2 * zoom) / width, (2 * zoom) / height);
    gl.uniform2f(uniform("range"), range[0], range[1]);
    gl.uniform3fv(uniform("ramp"), ramp.flat());
    gl.uniform1i(uniform("stops"), ramp.length);
    const layer = (/** @type {"triangles" | "sides" | "outline"} */ name, /** @type {number} */ mode, /** @type {number[]} */ color, /** @type {boolean} */ coloured) => {
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.buffers[name] ?? null);
      gl.uniform4f(uniform("plain"), color[0] ?? 0, color[1] ?? 0, color[2] ?? 0, color[3] ?? 1);
      gl.uniform1i(uniform("coloured"), coloured ? 1 : 0);
      gl.drawElements(mode, this.counts[name], gl.UNSIGNED_INT, 0);
    };
    layer("triangles", gl.TRIANGLES, colors.body, this.coloured);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    if (scene.edges) {
      if (this.counts.sides < 0) this.elements("sides", sidesOf(this.body));
      layer("sides", gl.LINES, [...colors.edge, this.coloured ? 0.35 : 0.75], false);
    }
    layer("outline", gl.LINES, [...colors.text, 0.9], false);
    gl.disable(gl.BLEND);
  }
}

/**
 * Gives the canvas the size of a scene.
 * @param {{width: number, height: number}} canvas
 * @param {Scene} scene
 */
function resize(canvas, { width, height, ratio }) {
  const [wide, high] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== wide || canvas.height !== high) Object.assign(canvas, { width: wide, height: high });
}

/** Draws on a plain canvas, where there is no WebGL2. */
class PlainPainter {
  /** @type {Float32Array | null} */
  moved = null;
  /** @type {Float32Array | null} */
  values = null;

  /**
   * @param {OffscreenCanvas} canvas
   * @param {Body} body
   */
  constructor(canvas, body) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.body = body;
    this.triangles = trianglesOf(body);
  }

  close() {}

  /** @param {Float32Array | null} moved */
  setMoved(moved) {
    this.moved = moved;
  }

  /** @param {Float32Array | null} values */
  setValues(values) {
    this.values = values;
  }

  /** @param {Scene} scene */
  paint(scene) {
    const { context, triangles, moved, values } = this;
    if (!context) return;
    const { width, height, ratio, center, zoom, scale, range, ramp, colors } = scene;
    resize(this.canvas, scene);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    const { positions, outline } = this.body;
    const at = (/** @type {number} */ corner, /** @type {number} */ k) => positions[2 * corner + k] + (moved ? scale * (moved[2 * corner + k] ?? 0) : 0) - (center[k] ?? 0);
    const lineTo = (/** @type {number} */ corner) => context.lineTo(width / 2 + at(corner, 0) * zoom, height / 2 - at(corner, 1) * zoom);
    const count = Math.min(triangles.length, 6 * MOST_PLAIN);
    for (let n = 0; n < count; n += 3) {
      const [a = 0, b = 0, c = 0] = [triangles[n], triangles[n + 1], triangles[n + 2]];
      const mean = values ? ((values[a] ?? 0) + (values[b] ?? 0) + (values[c] ?? 0)) / 3 : NaN;
      context.fillStyle = word(Number.isFinite(mean) ? mixed(ramp, (mean - range[0]) / (range[1] - range[0] || 1)) : colors.body);
      context.beginPath();
      for (const corner of [a, b, c]) lineTo(corner);
      context.fill();
    }
    context.strokeStyle = word(colors.text);
    for (let n = 0; n + 1 < outline.length; n += 2) {
      context.beginPath();
      lineTo(outline[n]);
      lineTo(outline[n + 1]);
      context.stroke();
    }
  }
}

/** A colour in the words of a canvas. */
const word = (/** @type {number[]} */ color) => `rgb(${color.map((part) => Math.round(255 * part)).join(" ")})`;

/**
 * The colour of a part of a ramp.
 * @param {number[][]} ramp
 * @param {number} part from 0 to 1; others are taken for the nearer of the two
 */
function mixed(ramp, part) {
  const t = Math.max(0, Math.min(1, part)) * (ramp.length - 1);
  const [low, high] = [ramp[Math.floor(t)] ?? [], ramp[Math.min(ramp.length - 1, Math.floor(t) + 1)] ?? []];
  return low.map((value, k) => value + (t % 1) * ((high[k] ?? 0) - value));
}
