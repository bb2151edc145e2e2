// The top view: the car stands still and looks up, the world moves. Frame base_link: x forward (up), y left.

import { Beams, DIRT, ECHO, OWN, STRAY } from "./beams.js";
import { Course } from "./course.js";
import { fit, ink, onLook, ratioOf } from "./look.js";

const SCALES = [15, 22, 32, 46, 64, 90, 130, 190];
const TRAIL = 600;
const TRAIL_STEP_M = 0.05;
const CAR_UP_SHARE = 0.7;
const SILENT_AT_M = 0.55;
const SECTORS = { dirty: "masked", covered: "stop", own: "muted" };
const LINES = {
  wall: ["wall", 3, []],
  ball: ["ball", 2.5, [7, 5]],
  "left edge": [null, 2, []],
  "right edge": [null, 2, []],
  end: [null, 2, []],
  "the beam that stops": ["stop", 2.5, []],
};

export class Scene {
  dirty = true;
  /** Where the lidar is in base_link [m]; told by the car's settings. */
  lidar = { x: 0.27, y: 0 };
  beams = new Beams();
  course;
  #canvas;
  #context;
  #link;
  #zoom = 5;
  #cos = new Float32Array(0);
  #sin = new Float32Array(0);
  #angleMin = NaN;
  #step = NaN;
  #trail = new Float64Array(2 * TRAIL);
  #trailNext = 0;
  #trailCount = 0;
  #trailOnMap = false;

  constructor(canvas, link) {
    this.#canvas = canvas;
    this.#context = canvas.getContext("2d", { alpha: true });
    this.#link = link;
    this.course = new Course(link);
    onLook(() => { this.dirty = true; });
    new ResizeObserver(() => { this.dirty = true; }).observe(canvas);
    canvas.addEventListener("wheel", (event) => { event.preventDefault(); this.zoom(event.deltaY < 0 ? 1 : -1); }, { passive: false });
  }

  zoom(by) {
    this.#zoom = Math.max(0, Math.min(SCALES.length - 1, this.#zoom + by));
    this.dirty = true;
  }

  /** Forgets where the car was, and on which map. */
  forgetWay() {
    this.#trailCount = 0;
    this.course.forget();
  }

  /** Takes where the car is: by its odometry, and while it is located on a map by its pose there. */
  takePlace({ x, y }, onMap, nowMs) {
    if (!onMap && this.course.isLocated(nowMs)) return;
    if (onMap !== this.#trailOnMap) this.#trailCount = 0;
    this.#trailOnMap = onMap;
    const last = 2 * ((this.#trailNext + TRAIL - 1) % TRAIL);
    const step = this.#trailCount ? Math.hypot(x - this.#trail[last], y - this.#trail[last + 1]) : Infinity;
    if (step < TRAIL_STEP_M) return;
    if (Number.isFinite(step) && step > 2) this.#trailCount = 0; // the car restarted: its odometry begins anew
    this.#trail[2 * this.#trailNext] = x;
    this.#trail[2 * this.#trailNext + 1] = y;
    this.#trailNext = (this.#trailNext + 1) % TRAIL;
    this.#trailCount = Math.min(TRAIL, this.#trailCount + 1);
  }

  takeFootprint(markers, nowMs) { this.beams.takeIgnored(markers, this.#link.newest.scan, this.lidar, nowMs); }

  takeWindow(sentences) {
    if (this.beams.takeWindow(sentences, this.#link.newest.scan.step)) this.dirty = true;
  }

  draw(nowMs) {
    const canvas = this.#canvas, context = this.#context;
    fit(canvas);
    const ratio = ratioOf(canvas);
    const scale = SCALES[this.#zoom] * ratio * Math.min(1, Math.max(0.6, canvas.clientWidth / 620));
    const originX = canvas.width / 2;
    const originY = canvas.height * CAR_UP_SHARE;
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, canvas.width, canvas.height);
    this.#grid(originX, originY, scale, ratio);
    const { scan, wall, footprint, odom } = this.#link.newest, pose = this.course.poseAt(scan.stamp, nowMs);
    this.#way(this.#trailOnMap ? pose : odom, originX, originY, scale, ratio);
    this.course.draw(context, pose, originX, originY, scale, ratio, nowMs);
    if (this.#link.ageMs("footprint", nowMs) < 5000) this.#sweep(footprint, originX, originY, scale);
    if (scan.n) this.#points(scan, nowMs, originX, originY, scale, ratio);
    this.#sectors(originX, originY, scale, ratio);
    if (this.#link.ageMs("wall", nowMs) < 5000) this.#markers(wall, originX, originY, scale, ratio);
    if (this.#link.ageMs("footprint", nowMs) < 5000) this.#markers(footprint, originX, originY, scale, ratio);
    this.#car(footprint, originX, originY, scale, ratio);
    if (scan.n) this.#leftOut(scan, originX, originY, scale, ratio);
    this.dirty = false;
  }

  #grid(x0, y0, scale, ratio) {
    const context = this.#context, { width, height } = this.#canvas;
    const every = scale / ratio < 25 ? 5 : scale / ratio < 40 ? 2 : 1;
    context.strokeStyle = ink.grid;
    context.fillStyle = ink.muted;
    context.lineWidth = ratio;
    context.font = `${11 * ratio}px ${ink.font}`;
    context.textAlign = "left";
    context.textBaseline = "bottom";
    const farthest = Math.hypot(Math.max(x0, width - x0), Math.max(y0, height - y0)) / scale;
    context.beginPath();
    context.moveTo(x0 + 0.5, 0);
    context.lineTo(x0 + 0.5, height);
    for (let r = every; r < farthest; r += every) {
      context.moveTo(x0 + r * scale, y0);
      context.arc(x0, y0, r * scale, 0, 2 * Math.PI);
      if (y0 - r * scale > 14 * ratio) context.fillText(metres(r), x0 + 4 * ratio, y0 - r * scale - ratio);
    }
    context.stroke();
  }

  #way(place, x0, y0, scale, ratio) {
    if (this.#trailCount < 2 || !place) return;
    const context = this.#context;
    const cos = Math.cos(place.yaw), sin = Math.sin(place.yaw);
    context.strokeStyle = ink.faint;
    context.lineWidth = 2 * ratio;
    context.beginPath();
    for (let k = 0; k < this.#trailCount; k++) {
      const i = 2 * ((this.#trailNext - 1 - k + 2 * TRAIL) % TRAIL);
      const dx = this.#trail[i] - place.x, dy = this.#trail[i + 1] - place.y;
      const x = x0 - (cos * dy - sin * dx) * scale, y = y0 - (cos * dx + sin * dy) * scale;
      if (k) context.lineTo(x, y);
      else context.moveTo(x, y);
    }
    context.stroke();
  }

  /** Distances as squares, stray ones small and pale, beams without an echo as ticks around the car. */
  #points(scan, nowMs, x0, y0, scale, ratio) {
    this.#tabulate(scan);
    this.beams.expire(nowMs, scan.n);
    const lidarX = x0 - this.lidar.y * scale, lidarY = y0 - this.lidar.x * scale;
    this.#squares(scan, ECHO, ink.point, 2.6 * ratio, lidarX, lidarY, scale);
    this.#squares(scan, STRAY, ink.silent, 2 * ratio, lidarX, lidarY, scale);
    const context = this.#context, inner = SILENT_AT_M * scale, outer = inner + 7 * ratio;
    context.strokeStyle = ink.silent;
    context.lineWidth = ratio;
    context.beginPath();
    for (let i = 0; i < scan.n; i++) {
      if (scan.ranges[i] < scan.rangeMax) continue;
      context.moveTo(lidarX - this.#sin[i] * inner, lidarY - this.#cos[i] * inner);
      context.lineTo(lidarX - this.#sin[i] * outer, lidarY - this.#cos[i] * outer);
    }
    context.stroke();
  }

  #squares(scan, kind, color, size, lidarX, lidarY, scale) {
    const context = this.#context, { ranges, rangeMax } = scan, { why } = this.beams, half = size / 2;
    context.fillStyle = color;
    for (let i = 0; i < scan.n; i++) {
      const r = ranges[i];
      if (why[i] !== kind || !(r < rangeMax)) continue;
      context.fillRect(lidarX - this.#sin[i] * r * scale - half, lidarY - this.#cos[i] * r * scale - half, size, size);
    }
  }

  /** On top of the car, because they lie there: dirt as crosses, the car's own parts as hollow squares. */
  #leftOut(scan, x0, y0, scale, ratio) {
    const context = this.#context, { ranges, rangeMax } = scan, { why } = this.beams;
    const lidarX = x0 - this.lidar.y * scale, lidarY = y0 - this.lidar.x * scale, arm = 3.4 * ratio;
    context.lineWidth = 1.4 * ratio;
    for (let kind = OWN; kind <= DIRT; kind++) {
      context.strokeStyle = kind === OWN ? ink.muted : ink.masked;
      context.beginPath();
      for (let i = 0; i < scan.n; i++) {
        const r = ranges[i];
        if (why[i] !== kind || !(r < rangeMax)) continue;
        const x = lidarX - this.#sin[i] * r * scale, y = lidarY - this.#cos[i] * r * scale;
        if (kind === OWN) { context.rect(x - arm / 2, y - arm / 2, arm, arm); continue; }
        context.moveTo(x - arm, y - arm);
        context.lineTo(x + arm, y + arm);
        context.moveTo(x + arm, y - arm);
        context.lineTo(x - arm, y + arm);
      }
      context.stroke();
    }
  }

  /** Shows where the window is dirty or covered as bands around the lidar: the beams themselves may end inside the car. */
  #sectors(x0, y0, scale, ratio) {
    const context = this.#context, lidarX = x0 - this.lidar.y * scale, lidarY = y0 - this.lidar.x * scale;
    const radius = SILENT_AT_M * scale - 5 * ratio;
    for (const { kind, from, to } of this.beams.sectors) {
      const start = -Math.PI / 2 - to, end = -Math.PI / 2 - from;
      context.strokeStyle = context.fillStyle = ink[SECTORS[kind]];
      context.globalAlpha = 0.2;
      context.beginPath();
      context.moveTo(lidarX, lidarY);
      context.arc(lidarX, lidarY, radius, start, end);
      context.fill();
      context.globalAlpha = 1;
      context.lineWidth = (kind === "own" ? 3 : 7) * ratio;
      context.beginPath();
      context.arc(lidarX, lidarY, radius, start, end);
      context.stroke();
    }
  }

  /** Fills the strip that the car is about to sweep. */
  #sweep(footprint, x0, y0, scale) {
    const left = footprint.find("left edge"), right = footprint.find("right edge");
    if (!left || !right || !left.n) return;
    const context = this.#context;
    context.fillStyle = ink[this.sweepInk];
    context.globalAlpha = 0.16;
    context.beginPath();
    for (let i = 0; i < left.n; i++) context.lineTo(x0 - left.xy[2 * i + 1] * scale, y0 - left.xy[2 * i] * scale);
    for (let i = right.n - 1; i >= 0; i--) context.lineTo(x0 - right.xy[2 * i + 1] * scale, y0 - right.xy[2 * i] * scale);
    context.closePath();
    context.fill();
    context.globalAlpha = 1;
  }

  /** The colour of the way: free, slowed, or stopped by safety. */
  get sweepInk() {
    const output = this.#link.newest.status.value?.output;
    if (output?.winner !== "safety") return "go";
    return output.speed_mps ? "slow" : "stop";
  }

  #markers(markers, x0, y0, scale, ratio) {
    const context = this.#context;
    for (let k = 0; k < markers.count; k++) {
      const { name, n, xy } = markers.items[k];
      const style = LINES[name];
      if (style && n) {
        context.strokeStyle = ink[style[0] ?? this.sweepInk];
        context.lineWidth = style[1] * ratio;
        context.setLineDash(ratio === 1 ? style[2] : style[2].map((part) => part * ratio));
        context.beginPath();
        for (let i = 0; i < n; i++) context.lineTo(x0 - xy[2 * i + 1] * scale, y0 - xy[2 * i] * scale);
        context.stroke();
      } else if (name === "what stops" && n) {
        context.strokeStyle = ink.stop;
        context.lineWidth = 3 * ratio;
        context.setLineDash([]);
        context.beginPath();
        context.arc(x0 - xy[1] * scale, y0 - xy[0] * scale, 8 * ratio, 0, 2 * Math.PI);
        context.stroke();
      }
    }
    context.setLineDash([]);
  }

  #car(footprint, x0, y0, scale, ratio) {
    const context = this.#context;
    const outline = footprint.find("car");
    context.fillStyle = ink.panel;
    context.strokeStyle = ink.car;
    context.lineWidth = 2.5 * ratio;
    context.lineJoin = "round";
    context.beginPath();
    if (outline?.n) for (let i = 0; i < outline.n; i++) context.lineTo(x0 - outline.xy[2 * i + 1] * scale, y0 - outline.xy[2 * i] * scale);
    else context.rect(x0 - 0.15 * scale, y0 - 0.42 * scale, 0.3 * scale, 0.55 * scale);
    context.closePath();
    context.fill();
    context.stroke();
    const nose = (this.lidar.x + 0.06) * scale, steering = this.#link.newest.output.steering || 0;
    context.lineWidth = 3 * ratio;
    context.beginPath();
    for (const side of [-1, 1]) { // the front wheels show where it steers; 0.33 m is the usual wheelbase
      const x = x0 + side * 0.11 * scale, y = y0 - 0.3 * scale, dx = Math.sin(steering) * 0.05 * scale, dy = Math.cos(steering) * 0.05 * scale;
      context.moveTo(x + dx, y + dy);
      context.lineTo(x - dx, y - dy);
    }
    context.moveTo(x0 - 0.03 * scale, y0 - nose + 0.05 * scale);
    context.lineTo(x0, y0 - nose);
    context.lineTo(x0 + 0.03 * scale, y0 - nose + 0.05 * scale);
    context.stroke();
  }

  /** Makes the tables of sines for a lidar's geometry, once. */
  #tabulate(scan) {
    if (scan.angleMin === this.#angleMin && scan.step === this.#step && this.#cos.length === scan.n) return;
    this.#angleMin = scan.angleMin;
    this.#step = scan.step;
    this.#cos = new Float32Array(scan.n);
    this.#sin = new Float32Array(scan.n);
    for (let i = 0; i < scan.n; i++) {
      this.#cos[i] = Math.cos(scan.angleMin + i * scan.step);
      this.#sin[i] = Math.sin(scan.angleMin + i * scan.step);
    }
  }
}

const metresTexts = [];

function metres(r) { return metresTexts[r] ?? (metresTexts[r] = `${r} m`); }
