/** Curves over one axis, drawn by uPlot: with the colours of the page, a keyboard, and a table of the values beside it. */

import uPlot from "./vendor/uplot-1.6.32/dist/uPlot.esm.js";
import { number, powerOfTen } from "./format.js";

/** A drawing of uPlot, which has no types here. @typedef {any} Plot */

/**
 * @typedef {object} Curve
 * @property {string} label
 * @property {string} color the name of a custom property, such as --curve-1
 * @property {number} [width]
 * @property {number[]} [dash]
 * @property {boolean} [points] whether its values are marked
 * @property {ArrayLike<number>} x increasing
 * @property {ArrayLike<number | null>} y
 */

/** @typedef {{from: number, to: number, color: string}} Shade an interval of x with a background */

/**
 * @typedef {object} Options
 * @property {string} label what the chart shows, for those who hear it
 * @property {string} x the name of the horizontal axis
 * @property {string} y the name of the vertical axis
 * @property {number} [height]
 * @property {boolean} [whole] whether the horizontal axis counts something
 * @property {boolean} [log] whether the vertical axis is logarithmic
 * @property {boolean} [robust] whether the vertical axis leaves out a few values that are far beyond all others
 * @property {(place: number | null) => void} [read] is told which of the common x the pointer or the keyboard is at
 * @property {[number, number]} [first] the part of the horizontal axis that is shown at first
 * @property {string} [sync] charts with the same word move their pointers together
 */

const css = (/** @type {string} */ name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** Puts the stylesheet of uPlot into the page, once. */
function addStylesheet() {
  const href = new URL("./vendor/uplot-1.6.32/dist/uPlot.min.css", import.meta.url).href;
  if ([...document.styleSheets].some((sheet) => sheet.href === href)) return;
  const link = document.createElement("link");
  Object.assign(link, { rel: "stylesheet", href });
  document.head.append(link);
}

/**
 * The curves on all their x together; a curve has null where it has no value.
 * @param {Curve[]} curves
 * @returns {{x: number[], y: (number | null)[][]}}
 */
export function aligned(curves) {
  const first = curves[0];
  if (first && curves.every((curve) => curve.x === first.x)) {
    return { x: Array.from(first.x), y: curves.map((curve) => Array.from(curve.y)) };
  }
  const all = new Set();
  for (const curve of curves) for (let n = 0; n < curve.x.length; n += 1) all.add(curve.x[n]);
  const x = /** @type {number[]} */ ([...all]).sort((a, b) => a - b);
  const place = new Map(x.map((value, n) => [value, n]));
  const y = curves.map((curve) => {
    const values = /** @type {(number | null)[]} */ (new Array(x.length).fill(null));
    for (let n = 0; n < curve.x.length; n += 1) {
      values[/** @type {number} */ (place.get(/** @type {number} */ (curve.x[n])))] = curve.y[n] ?? null;
    }
    return values;
  });
  return { x, y };
}

/**
 * A range that leaves out what is far beyond nearly all values.
 * @param {(number | null)[][]} all
 * @param {ArrayLike<number>} [x] where the values are
 * @returns {{range: [number, number], cut: boolean}}
 */
export function robustRange(all, x) {
  // a value counts by the part of the axis that it stands for: where a mesh is fine there are many
  /** @type {[number, number][]} */
  const weighed = [];
  for (const values of all) {
    values.forEach((value, n) => {
      if (value === null || !Number.isFinite(value)) return;
      const from = x ? (x[Math.max(0, n - 1)] ?? 0) : 0;
      const to = x ? (x[Math.min(values.length - 1, n + 1)] ?? 0) : 1;
      weighed.push([value, to - from]);
    });
  }
  weighed.sort((a, b) => a[0] - b[0]);
  if (!weighed.length) return { range: [0, 1], cut: false };
  const total = weighed.reduce((sum, [, weight]) => sum + weight, 0);
  const at = (/** @type {number} */ part) => {
    let sum = 0;
    for (const [value, weight] of weighed) {
      sum += weight;
      if (sum >= part * total) return value;
    }
    return weighed[weighed.length - 1]?.[0] ?? 0;
  };
  const [least, most] = [weighed[0]?.[0] ?? 0, weighed[weighed.length - 1]?.[0] ?? 0];
  let [low, high] = [at(0.02), at(0.98)];
  const room = 1.5 * Math.max(high - low, 1e-300);
  low = least < low - room ? low - 0.35 * (high - low) : least;
  high = most > high + room ? high + 0.35 * (high - low) : most;
  const margin = 0.06 * (high - low || Math.abs(high) || 1);
  return { range: [Math.min(low, 0) - margin, Math.max(high, 0) + margin], cut: least < low || most > high };
}

/** The distances between marks on an axis that counts something. */
const COUNTS = [1, 10, 100, 1000, 10_000, 100_000, 1e6].flatMap((power) => [power, 2 * power, 5 * power]);

export class Chart {
  /** @type {Plot | null} */
  plot = null;
  /** @type {Curve[]} */
  curves = [];
  /** @type {Shade[]} */
  shades = [];
  /** @type {{x: number[], y: (number | null)[][]}} */
  data = { x: [], y: [] };
  /** Whether a person has chosen a part of the axis. */
  zoomed = false;
  at = -1;

  /**
   * @param {HTMLElement} root
   * @param {Options} options
   */
  constructor(root, options) {
    addStylesheet();
    this.root = root;
    this.options = options;
    root.classList.add("chart");
    root.tabIndex = 0;
    root.setAttribute("role", "group");
    root.setAttribute("aria-label", `${options.label}. The arrow keys step from value to value.`);
    this.onKey = (/** @type {KeyboardEvent} */ event) => this.key(event);
    root.addEventListener("keydown", this.onKey);
    this.resized = new ResizeObserver(() => this.resize());
    this.resized.observe(root);
    this.theme = matchMedia("(prefers-color-scheme: dark)");
    this.onTheme = () => this.plot?.redraw(false, true);
    this.theme.addEventListener("change", this.onTheme);
  }

  close() {
    this.root.removeEventListener("keydown", this.onKey);
    this.resized.disconnect();
    this.theme.removeEventListener("change", this.onTheme);
    this.plot?.destroy();
    this.plot = null;
  }

  /**
   * Shows these curves; what was zoomed stays zoomed.
   * @param {Curve[]} curves
   * @param {Shade[]} [shades]
   */
  set(curves, shades = []) {
    const log = this.options.log;
    const shown = log
      ? curves.map((curve) => ({
          ...curve,
          y: Array.from(curve.y, (value) => (value !== null && value > 0 ? Math.log10(value) : null)),
        }))
      : curves;
    const same = this.plot && curves.length === this.curves.length && curves.every((curve, n) => curve.label === this.curves[n]?.label && curve.color === this.curves[n]?.color);
    this.curves = curves;
    this.shades = shades;
    this.data = aligned(shown);
    if (!same) this.make();
    else this.plot?.setData(this.uplotData(), !this.zoomed);
    if (same && this.zoomed) this.plot?.redraw(false, false);
  }

  /** @returns {any} */
  uplotData() {
    return [this.data.x, ...this.data.y];
  }

  resize() {
    const width = Math.floor(this.root.clientWidth);
    if (width > 0 && this.plot && this.plot.width !== width) {
      this.plot.setSize({ width, height: this.options.height ?? 240 });
    }
  }

  make() {
    this.plot?.destroy();
    const { log, robust, whole, x, y } = this.options;
    const axis = {
      stroke: () => css("--quiet"),
      grid: { stroke: () => css("--line"), width: 1 },
      ticks: { stroke: () => css("--line"), width: 1 },
      font: '12px system-ui, "DejaVu Sans", sans-serif',
      labelFont: '12px system-ui, "DejaVu Sans", sans-serif',
    };
    const range = (/** @type {any} */ _plot, /** @type {number} */ least, /** @type {number} */ most) => {
      if (robust) return robustRange(this.data.y, this.data.x).range;
      if (least === null || most === null) return [0, 1];
      if (log) return [Math.floor(least), Math.max(Math.ceil(most), Math.floor(least) + 1)];
      const margin = 0.08 * (most - least || Math.abs(most) || 1);
      return [least - margin, most + margin];
    };
    this.plot = new (/** @type {any} */ (uPlot))(
      /** @type {any} */ ({
        width: Math.max(200, Math.floor(this.root.clientWidth)),
        height: this.options.height ?? 240,
        legend: { show: false },
        cursor: {
          drag: { x: true, y: false },
          points: { size: 8, fill: (/** @type {Plot} */ _plot, /** @type {number} */ n) => css(this.curves[n - 1]?.color ?? "--text") },
          ...(this.options.sync ? { sync: { key: this.options.sync } } : {}),
        },
        scales: { x: { time: false }, y: { range } },
        axes: [
          { ...axis, ...(whole ? { incrs: COUNTS } : {}), label: x, labelSize: 22, size: 34, values: (/** @type {any} */ _p, /** @type {number[]} */ ticks) => ticks.map((tick) => number(tick, 6)) },
          {
            ...axis,
            label: y,
            labelSize: 20,
            size: 62,
            ...(log
              ? {
                  splits: (/** @type {any} */ _p, /** @type {any} */ _a, /** @type {number} */ low, /** @type {number} */ high) => powers(low, high),
                  values: (/** @type {any} */ _p, /** @type {number[]} */ ticks) => ticks.map((tick) => (tick === 0 ? "1" : powerOfTen(tick))),
                }
              : { values: (/** @type {any} */ _p, /** @type {number[]} */ ticks) => ticks.map((tick) => number(tick, 6)) }),
          },
        ],
        series: [
          {},
          ...this.curves.map((curve) => ({
            label: curve.label,
            stroke: () => css(curve.color),
            width: curve.width ?? 1.8,
            dash: curve.dash,
            spanGaps: true,
            points: { show: Boolean(curve.points), size: 5, stroke: () => css(curve.color), fill: () => css("--panel") },
          })),
        ],
        hooks: {
          drawClear: [(/** @type {Plot} */ plot) => this.drawShades(plot)],
          draw: [(/** @type {Plot} */ plot) => this.drawCut(plot)],
          setSelect: [
            (/** @type {Plot} */ plot) => {
              this.zoomed = plot.select.width > 0 || this.zoomed;
            },
          ],
          setCursor: [
            (/** @type {Plot} */ plot) => {
              this.at = plot.cursor.idx ?? -1;
              this.options.read?.(plot.cursor.idx ?? null);
            },
          ],
        },
      }),
      this.uplotData(),
      this.root,
    );
    const { first } = this.options;
    if (first) {
      this.plot.setScale("x", { min: first[0], max: first[1] });
      this.zoomed = true;
    }
    this.plot.over.addEventListener("dblclick", () => {
      this.zoomed = false;
    });
  }

  /** @param {Plot} plot */
  drawShades(plot) {
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    for (const { from, to, color } of this.shades) {
      const [left, right] = [plot.valToPos(from, "x", true), plot.valToPos(to, "x", true)];
      ctx.fillStyle = css(color);
      ctx.fillRect(left, bbox.top, Math.max(right - left, 1), bbox.height);
    }
    ctx.restore();
  }

  /**
   * Marks values beyond the vertical axis by triangles at its ends.
   * @param {Plot} plot
   */
  drawCut(plot) {
    if (!this.options.robust) return;
    const { ctx, bbox } = plot;
    const { min = 0, max = 0 } = /** @type {any} */ (plot.scales.y);
    const [left, right] = [plot.scales.x?.min ?? 0, plot.scales.x?.max ?? 0];
    ctx.save();
    this.data.y.forEach((values, n) => {
      ctx.fillStyle = css(this.curves[n]?.color ?? "--text");
      let before = -Infinity;
      values.forEach((value, place) => {
        const x = this.data.x[place] ?? 0;
        if (value === null || (value <= max && value >= min) || x < left || x > right) return;
        const at = plot.valToPos(x, "x", true);
        if (at - before < 12) return;
        before = at;
        const up = value > max;
        const edge = up ? bbox.top + 2 : bbox.top + bbox.height - 2;
        const size = up ? 9 : -9;
        ctx.beginPath();
        ctx.moveTo(at, edge);
        ctx.lineTo(at - 6, edge + size);
        ctx.lineTo(at + 6, edge + size);
        ctx.fill();
      });
    });
    ctx.restore();
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const last = this.data.x.length - 1;
    const step = event.shiftKey ? Math.max(1, Math.round(last / 20)) : 1;
    if (!this.plot || last < 0) return;
    const { min = -Infinity, max = Infinity } = this.plot.scales.x;
    // those that are seen, where a part is shown
    const first = this.data.x.findIndex((x) => x >= min);
    const final = this.data.x.findLastIndex((x) => x <= max);
    const to = { ArrowRight: this.at < first ? first : this.at + step, ArrowLeft: this.at < 0 ? final : this.at - step, Home: first, End: final }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    const place = Math.max(first, Math.min(final, to));
    const value = this.data.y.map((values) => values[place]).find((found) => found !== null && found !== undefined) ?? 0;
    this.plot.setCursor({
      left: this.plot.valToPos(this.data.x[place] ?? 0, "x"),
      top: Math.max(0, Math.min(this.plot.over.clientHeight - 1, this.plot.valToPos(value, "y"))),
    });
  }
}

/**
 * Whole powers of ten on a logarithmic axis, at most seven of them.
 * @param {number} low
 * @param {number} high
 */
function powers(low, high) {
  const step = Math.max(1, Math.ceil((high - low) / 7));
  const ticks = [];
  for (let tick = Math.ceil(low / step) * step; tick <= high; tick += step) ticks.push(tick);
  return ticks;
}

/**
 * Fewer rows from which the same curve is drawn: of each of many parts those with the least and the greatest value.
 * @template T
 * @param {T[]} rows
 * @param {(row: T) => number} value
 * @param {number} [most]
 * @returns {T[]}
 */
export function thinned(rows, value, most = 1500) {
  if (rows.length <= most) return rows;
  const size = Math.ceil((2 * rows.length) / most);
  /** @type {T[]} */
  const kept = [];
  for (let start = 0; start < rows.length; start += size) {
    const part = rows.slice(start, start + size);
    let [low, high] = [0, 0];
    part.forEach((row, n) => {
      if (value(row) < value(/** @type {T} */ (part[low]))) low = n;
      if (value(row) > value(/** @type {T} */ (part[high]))) high = n;
    });
    for (const place of [...new Set([0, low, high, part.length - 1])].sort((a, b) => a - b)) kept.push(/** @type {T} */ (part[place]));
  }
  return kept;
}
