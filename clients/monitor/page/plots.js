// Strip plots on canvas: as many points as there are pixels, drawn fifteen times a second.

import { fit, ink, make, number, onLook, ratioOf, setText } from "./look.js";
import { Series } from "./rings.js";

export const LONGEST_S = 300;
const EVERY_MS = 66;
const APART_MS = 24;
const GAP_MS = 600;
const CAPACITY = Math.ceil((LONGEST_S * 1000) / APART_MS) + 16;
const MARGIN = { left: 44, right: 6, top: 8, bottom: 16 };

/** One strip. lines: [{ label, color, digits }]; least: the smallest half or whole range that is shown. */
class Strip {
  constructor(parent, { title, unit, lines, least, symmetric }) {
    this.unit = unit;
    this.least = least;
    this.symmetric = symmetric;
    this.lines = lines.map((line) => ({ ...line, series: new Series(CAPACITY, APART_MS) }));
    const figure = make("figure", "strip");
    const caption = make("figcaption");
    caption.append(make("b", "", title));
    for (const line of this.lines) {
      const key = make("span", "key");
      key.style.setProperty("--key", `var(--${line.color})`);
      line.value = make("span", "value", "–"); // not an output: what changes ten times a second is not to be read out
      key.append(line.label, " ", line.value);
      caption.append(key);
    }
    this.canvas = make("canvas");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `${title} over time`);
    figure.append(caption, this.canvas);
    parent.append(figure);
    this.context = this.canvas.getContext("2d", { alpha: true });
    this.low = 0;
    this.high = 0;
    this.labels = ["", "", ""];
  }

  draw(nowMs, windowMs) {
    fit(this.canvas);
    const { context, canvas } = this;
    const ratio = ratioOf(canvas);
    const left = MARGIN.left * ratio;
    const right = canvas.width - MARGIN.right * ratio;
    const top = MARGIN.top * ratio;
    const bottom = canvas.height - MARGIN.bottom * ratio;
    if (right <= left || bottom <= top) return;
    this.#range(nowMs - windowMs);
    context.clearRect(0, 0, canvas.width, canvas.height);
    this.#axes(left, right, top, bottom, ratio, windowMs);
    const perMs = (right - left) / windowMs;
    const perUnit = (bottom - top) / (this.high - this.low);
    context.save();
    context.beginPath();
    context.rect(left, top - ratio, right - left, bottom - top + 2 * ratio);
    context.clip();
    context.lineWidth = 1.6 * ratio;
    context.lineJoin = "round";
    for (const line of this.lines) {
      context.strokeStyle = ink[line.color];
      this.#trace(line.series, nowMs, windowMs, right, bottom, perMs, perUnit);
    }
    context.restore();
    for (const line of this.lines) setText(line.value, number(line.series.last, line.digits, this.unit === "°" ? "°" : ` ${this.unit}`));
  }

  /** Draws newest to oldest; samples in one column of pixels become one stroke from their lowest to their highest. */
  #trace(series, nowMs, windowMs, right, bottom, perMs, perUnit) {
    const { context } = this;
    const { t, v, count } = series;
    let column = NaN, lowest = 0, highest = 0, lastMs = NaN, down = false;
    context.beginPath();
    for (let k = 0; k < count; k++) {
      const i = series.at(k);
      const ms = t[i];
      if (nowMs - ms > windowMs) break;
      const value = v[i];
      const gap = !Number.isFinite(value) || lastMs - ms > GAP_MS;
      lastMs = ms;
      const x = Math.round(right - (nowMs - ms) * perMs);
      const y = bottom - (value - this.low) * perUnit;
      if (x === column && !gap) {
        if (y < lowest) lowest = y;
        if (y > highest) highest = y;
        continue;
      }
      if (down) { context.lineTo(column, lowest); context.lineTo(column, highest); }
      down = Number.isFinite(value);
      if (down && (gap || Number.isNaN(column))) context.moveTo(x, y);
      column = down ? x : NaN;
      lowest = highest = y;
    }
    if (down) { context.lineTo(column, lowest); context.lineTo(column, highest); }
    context.stroke();
  }

  #range(sinceMs) {
    let low = Infinity, high = -Infinity;
    for (const { series } of this.lines) {
      for (let k = 0; k < series.count; k++) {
        const i = series.at(k);
        if (series.t[i] < sinceMs) break;
        const value = series.v[i];
        if (value < low) low = value;
        if (value > high) high = value;
      }
    }
    if (this.symmetric) {
      high = nice(Math.max(this.least, Math.abs(low), Math.abs(high)));
      low = -high;
    } else {
      high = nice(Math.max(this.least, high));
      low = low < 0 ? -nice(-low) : 0;
    }
    if (!Number.isFinite(low + high)) { low = this.symmetric ? -this.least : 0; high = this.least; }
    if (low === this.low && high === this.high) return;
    this.low = low;
    this.high = high;
    this.labels = tickLabels(low, high);
  }

  #axes(left, right, top, bottom, ratio, windowMs) {
    const { context } = this;
    context.font = `${11 * ratio}px ${ink.font}`;
    context.fillStyle = ink.muted;
    context.strokeStyle = ink.grid;
    context.lineWidth = ratio;
    context.textBaseline = "middle";
    context.textAlign = "right";
    context.beginPath();
    for (let i = 0; i < 3; i++) {
      const y = Math.round(top + ((bottom - top) * i) / 2) + 0.5;
      context.moveTo(left, y);
      context.lineTo(right, y);
      context.fillText(this.labels[i], left - 6 * ratio, y);
    }
    context.textBaseline = "alphabetic";
    for (let i = 0; i <= 3; i++) {
      const x = Math.round(left + ((right - left) * i) / 3) + 0.5;
      context.moveTo(x, top);
      context.lineTo(x, bottom);
      context.textAlign = i === 0 ? "left" : i === 3 ? "right" : "center";
      context.fillText(timeLabel(windowMs, i), x, bottom + 13 * ratio);
    }
    context.stroke();
  }
}

const timeLabels = new Map();

function timeLabel(windowMs, third) {
  const key = windowMs * 4 + third;
  let label = timeLabels.get(key);
  if (label === undefined) {
    const seconds = Math.round((windowMs / 1000) * (1 - third / 3));
    label = third === 3 ? "now" : seconds >= 100 ? `−${Math.floor(seconds / 60)}:${String(seconds % 60).padStart(2, "0")}${third ? "" : " min"}` : `−${seconds} s`;
    timeLabels.set(key, label);
  }
  return label;
}

/** Top, middle and bottom with as many digits as the most exact of them needs, so that no label is a rounded one. */
export function tickLabels(low, high) {
  const ticks = [high, (high + low) / 2, low];
  const exact = (value, digits) => Math.abs(Number(value.toFixed(digits)) - value) < 1e-9 * Math.max(1, Math.abs(value));
  let digits = 0;
  while (digits < 6 && !ticks.every((tick) => exact(tick, digits))) digits++;
  return ticks.map((tick) => (tick === 0 ? 0 : tick).toFixed(digits).replace("-", "−"));
}

/** Rounds up to 1, 2 or 5 times a power of ten. */
function nice(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  for (const step of [1, 2, 2.5, 5]) if (value <= step * power * 1.0001) return step * power;
  return 10 * power;
}

export class Plots {
  windowMs = 30000;
  #drawnMs = -Infinity;

  constructor(parent) {
    const a = "line-a", b = "line-b", c = "line-c";
    this.error = new Strip(parent, {
      title: "Distance error", unit: "m", least: 0.1, symmetric: true, lines: [{ label: "error", color: a, digits: 3 }],
    });
    this.speed = new Strip(parent, {
      title: "Speed", unit: "m/s", least: 0.5, symmetric: false,
      lines: [
        { label: "asked", color: c, digits: 2 }, { label: "sent", color: b, digits: 2 },
        { label: "driven", color: a, digits: 2 },
      ],
    });
    this.steering = new Strip(parent, {
      title: "Steering, left is up", unit: "°", least: 5, symmetric: true, lines: [{ label: "sent", color: a, digits: 1 }],
    });
    this.latency = new Strip(parent, {
      title: "Latency", unit: "ms", least: 5, symmetric: false,
      lines: [
        { label: "scan to motor p99", color: a, digits: 1 }, { label: "round trip", color: b, digits: 1 },
      ],
    });
    this.strips = [this.error, this.speed, this.steering, this.latency];
    onLook(() => { this.#drawnMs = -Infinity; });
  }

  push(strip, line, ms, value) { strip.lines[line].series.push(ms, value); }

  pushSteering(ms, rad) { this.push(this.steering, 0, ms, rad * 180 / Math.PI); }

  /** Adds what the server kept of the minutes before, in among what is here already. lines: { name: { age_ms, value } }. */
  fill(lines, nowMs) {
    const places = {
      error: [this.error, 0, 1], asked: [this.speed, 0, 1], sent: [this.speed, 1, 1], driven: [this.speed, 2, 1],
      steering: [this.steering, 0, 180 / Math.PI], latency: [this.latency, 0, 1], round_trip: [this.latency, 1, 1],
    };
    for (const [name, [strip, line, factor]] of Object.entries(places)) {
      const { age_ms: ages = [], value: values = [] } = lines[name] ?? {};
      strip.lines[line].series.merge(ages.map((age) => nowMs - age), values.map((value) => (value === null ? NaN : value * factor)));
    }
  }

  clear() { for (const strip of this.strips) for (const line of strip.lines) line.series.clear(); }

  get samples() {
    return this.strips.reduce((sum, strip) => sum + strip.lines.reduce((n, line) => n + line.series.count, 0), 0);
  }

  draw(nowMs) {
    if (nowMs - this.#drawnMs < EVERY_MS) return;
    this.#drawnMs = nowMs;
    for (const strip of this.strips) strip.draw(nowMs, this.windowMs);
  }
}
