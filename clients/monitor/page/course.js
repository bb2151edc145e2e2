// What the car races on, drawn under its scan: walls of the map, the race line, and where the best lap was by now.

import { ink, make, onLook, setHidden } from "./look.js";

const LOCATED_MS = 1000;
const LONGEST_CARRY_S = 0.2;
const SHADES = 12;
const LAP_BEGINS_S = 0.5;
const LONGEST_TRACE = 6000;

export class Course {
  /** Poses of the best lap that was seen from its beginning, { t, x, y, yaw }: t in seconds since then. */
  best = [];
  #link;
  #walls = null; // a canvas with a pixel for each cell
  #wallsStamp = 0;
  #strokes = []; // the line in pieces of one colour
  #strokesStamp = 0;
  #pose = null;
  #rates = null;
  #trace = [];
  #beganS = NaN;
  #shown = {};

  constructor(link) {
    this.#link = link;
    onLook(() => { this.#wallsStamp = 0; });
  }

  forget() {
    for (const topic of ["pose", "map", "line"]) this.#link.forget(topic);
    this.best = [];
    this.#trace = [];
    this.#pose = this.#rates = null;
    this.#beganS = NaN;
  }

  takePose({ stamp, x, y, yaw }) {
    const last = this.#pose, dt = last ? stamp - last.stamp : 0;
    this.#rates = dt > 0 && dt < LONGEST_CARRY_S
      ? { x: (x - last.x) / dt, y: (y - last.y) / dt, yaw: turn(yaw - last.yaw) / dt } : null;
    this.#pose = { stamp, x, y, yaw };
  }

  /** Keeps the trace of the lap, and of the best one. */
  takeStatus({ stamp_s: atS, x_m: x, y_m: y, yaw_rad: yaw, race }) {
    if (!Number.isFinite(race?.began_s)) { this.#beganS = NaN; return; }
    if (race.began_s !== this.#beganS) {
      const isBest = race.time_s === race.best_s && Math.abs(this.#beganS + race.time_s - race.began_s) < 0.01;
      if (isBest && this.#trace[0]?.t < LAP_BEGINS_S) this.best = this.#trace;
      this.#beganS = race.began_s;
      this.#trace = [];
    }
    if (Number.isFinite(x) && this.#trace.length < LONGEST_TRACE) this.#trace.push({ t: atS - race.began_s, x, y, yaw });
  }

  /** Draws what is known by a pose, null while the car is not located. x0, y0: the car; scale: pixels for a metre. */
  draw(context, pose, x0, y0, scale, ratio, nowMs) {
    const { map, line } = this.#link.newest;
    const hasMap = pose && this.#knows("map"), hasLine = pose && this.#knows("line");
    const ghost = hasLine ? this.#ghost(nowMs) : null;
    this.#legend({ map: hasMap, race: hasLine, ghost });
    if (!pose) return;
    if (hasMap) {
      place(context, pose, map, map.cell, x0, y0, scale);
      context.imageSmoothingEnabled = false;
      context.drawImage(this.#drawnWalls(map), 0, 0);
    }
    place(context, pose, { x: 0, y: 0, yaw: 0 }, 1, x0, y0, scale);
    if (hasLine) this.#drawLine(context, line, (3 * ratio) / scale);
    if (ghost) drawGhost(context, ghost, (2 * ratio) / scale);
    context.setTransform(1, 0, 0, 1, 0, 0);
  }

  isLocated(nowMs) { return this.#pose !== null && this.#link.ageMs("pose", nowMs) < LOCATED_MS; }

  /** The pose at the time of the scan that is drawn: it is told at other times, and at 6 m/s a scan is 15 cm. */
  poseAt(stamp, nowMs) {
    const pose = this.#pose, rates = this.#rates;
    if (!this.isLocated(nowMs)) return null;
    const dt = stamp - pose.stamp;
    if (!rates || Math.abs(dt) > LONGEST_CARRY_S) return pose;
    return { x: pose.x + rates.x * dt, y: pose.y + rates.y * dt, yaw: pose.yaw + rates.yaw * dt };
  }

  #knows(topic) { return Number.isFinite(this.#link.seenMs[topic]); }

  #legend(shown) {
    for (const [name, is] of Object.entries(shown)) {
      if (this.#shown[name] === Boolean(is)) continue;
      this.#shown[name] = Boolean(is);
      setHidden(document.querySelector(`.legend .${name}`), !is);
    }
  }

  #drawnWalls(map) {
    if (this.#wallsStamp === map.stamp) return this.#walls;
    const canvas = this.#walls = make("canvas"), { width, height, cells } = map;
    canvas.width = width;
    canvas.height = height;
    const context = canvas.getContext("2d");
    context.fillStyle = ink.faint;
    for (let i = 0; i < cells.length; i++) if (cells[i] > 50) context.fillRect(i % width, Math.floor(i / width), 1, 1);
    this.#wallsStamp = map.stamp;
    return canvas;
  }

  #drawLine(context, line, width) {
    if (this.#strokesStamp !== line.stamp) {
      this.#strokes = strokesOf(line);
      this.#strokesStamp = line.stamp;
    }
    context.lineWidth = width;
    for (const { color, way } of this.#strokes) {
      context.strokeStyle = color;
      context.stroke(way);
    }
  }

  /** Where the best lap was at this time after its beginning; null before it is known, and after its end. */
  #ghost(nowMs) {
    const lastT = this.#trace.at(-1)?.t;
    if (!this.best.length || lastT === undefined) return null;
    const t = lastT + this.#link.ageMs("status", nowMs) / 1000;
    const after = this.best.findIndex((one) => one.t > t);
    if (after < 1) return null;
    const a = this.best[after - 1], b = this.best[after], share = (t - a.t) / (b.t - a.t);
    return { x: a.x + share * (b.x - a.x), y: a.y + share * (b.y - a.y), yaw: a.yaw + share * turn(b.yaw - a.yaw) };
  }
}

/** Has a context draw in a frame of the map: `frame` is its origin there, `unit` its unit in metres. */
function place(context, pose, frame, unit, x0, y0, scale) {
  const cos = Math.cos(pose.yaw), sin = Math.sin(pose.yaw), dx = frame.x - pose.x, dy = frame.y - pose.y;
  const ahead = (cos * dx + sin * dy) * scale, left = (cos * dy - sin * dx) * scale;
  const c = Math.cos(frame.yaw - pose.yaw) * unit * scale, s = Math.sin(frame.yaw - pose.yaw) * unit * scale;
  context.setTransform(-s, -c, -c, s, x0 - left, y0 - ahead);
}

/** Returns the line in pieces of equal colour: red is its slowest, blue its fastest. */
function strokesOf({ n, xy, speed }) {
  const some = speed.subarray(0, Math.max(n - 1, 0));
  const low = some.reduce((a, b) => Math.min(a, b), Infinity), high = some.reduce((a, b) => Math.max(a, b), 0);
  const strokes = [];
  for (let i = 0; i < n - 1; i++) {
    const shade = Math.min(SHADES - 1, Math.floor((SHADES * (speed[i] - low)) / Math.max(high - low, 0.1)));
    if (strokes.at(-1)?.shade !== shade) {
      strokes.push({ shade, color: `hsl(${(220 * shade) / (SHADES - 1)} 75% 46%)`, way: new Path2D() });
      strokes.at(-1).way.moveTo(xy[2 * i], xy[2 * i + 1]);
    }
    strokes.at(-1).way.lineTo(xy[2 * i + 2], xy[2 * i + 3]);
  }
  return strokes;
}

function drawGhost(context, { x, y, yaw }, width) {
  context.translate(x, y);
  context.rotate(yaw);
  context.strokeStyle = ink.text;
  context.lineWidth = width;
  context.setLineDash([2 * width, 1.5 * width]);
  context.strokeRect(-0.13, -0.15, 0.55, 0.3);
  context.setLineDash([]);
}

function turn(angle) { return Math.atan2(Math.sin(angle), Math.cos(angle)); }
