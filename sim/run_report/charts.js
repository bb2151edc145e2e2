// Plots of a run over time and their ruler; the page's data and view. No network, no libraries.

const data = JSON.parse(document.getElementById("data").textContent);
const LEFT = 52, RIGHT = 14, TOP = 20, BOTTOM = 30, HEIGHT = 230, TICKS = 6;
const MIN_SPAN_S = 0.5, STEP_S = 1, MIN_TICK_S = 0.02, GROUP_SHIFT = 13, MAX_CM = 8191, TRAIL_S = 8;
const TOGETHER_S = 2e-3; // messages of one decision differ by less
const total = Math.max(0.1, ...data.runs.map((run) => run.duration));
const view = { now: 0, from: 0, until: total, playing: false, speed: 1, around: 6 };

const make = (tag, name, ...inside) => {
  const element = document.createElement(tag);
  if (name) element.className = name;
  element.append(...inside);
  return element;
};
const drawn = (tag, attributes, text) => {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text !== undefined) element.textContent = text;
  return element;
};
const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
const floats = (text) => new Float32Array(bytes(text));
const known = (value) => value !== undefined && Number.isFinite(value);

/** Index of the newest time that is not after `at`, -1 before the first. */
function newest(times, at) {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= at + TOGETHER_S) low = middle + 1; else high = middle;
  }
  return low - 1;
}

// -- charts over time ------------------------------------------------------------------------------------------------

class Chart {
  constructor(svg, told) {
    this.svg = svg;
    this.unit = told.unit;
    this.marks = told.marks;
    this.band = told.band;
    this.lines = told.lines.map((line) => ({ ...line, t: floats(line.t), v: floats(line.v) }));
    this.cursor = drawn("path", { class: "cursor" });
    this.values = drawn("text", { class: "values", y: 12 });
    svg.classList.add("live");
    svg.addEventListener("pointerdown", (event) => this.#drag(event));
    svg.addEventListener("wheel", (event) => {
      if (!event.ctrlKey) return; // the page scrolls
      event.preventDefault();
      zoom(event.deltaY < 0 ? 0.7 : 1 / 0.7, this.time(event));
    }, { passive: false });
    svg.addEventListener("dblclick", () => show(0, total));
  }

  time(event) {
    const box = this.svg.getBoundingClientRect();
    const share = (((event.clientX - box.left) / box.width) * this.width - LEFT) / (this.width - LEFT - RIGHT);
    return view.from + Math.min(Math.max(share, 0), 1) * (view.until - view.from);
  }

  #drag(event) {
    const move = (moved) => go(this.time(moved));
    const end = () => {
      this.svg.removeEventListener("pointermove", move);
      for (const name of ["pointerup", "pointercancel"]) this.svg.removeEventListener(name, end);
    };
    this.svg.setPointerCapture(event.pointerId);
    this.svg.addEventListener("pointermove", move);
    for (const name of ["pointerup", "pointercancel"]) this.svg.addEventListener(name, end);
    play(false);
    move(event);
  }

  /** Draw everything anew for the span that is shown. */
  draw() {
    this.width = Math.max(300, Math.round(this.svg.parentElement.clientWidth || 860));
    this.svg.setAttribute("viewBox", `0 0 ${this.width} ${HEIGHT}`);
    const [low, high] = this.#limits();
    const across = (this.width - LEFT - RIGHT) / (view.until - view.from);
    const down = (HEIGHT - TOP - BOTTOM) / (high - low);
    this.x = (time) => LEFT + (time - view.from) * across;
    const y = (value) => HEIGHT - BOTTOM - (value - low) * down;
    const parts = [...this.#grid(low, high, y)];
    const inside = drawn("svg", { x: LEFT, y: 0, width: this.width - LEFT - RIGHT, height: HEIGHT });
    const moved = drawn("g", { transform: `translate(${-LEFT} 0)` });
    inside.append(moved);
    if (this.band) {
      const [from, until] = this.band.map((value) => Math.min(Math.max(y(value), TOP), HEIGHT - BOTTOM));
      moved.append(drawn("rect", { class: "band", x: LEFT, y: until, width: this.width, height: from - until }));
    }
    for (const [time, text] of this.marks) {
      if (time < view.from || time > view.until) continue;
      moved.append(drawn("path", { class: "mark", d: `M${this.x(time).toFixed(1)} ${TOP}V${HEIGHT - BOTTOM}` }));
      moved.append(drawn("text", { class: "marked", x: this.x(time) + 3, y: HEIGHT - BOTTOM - 4 }, text));
    }
    for (const line of this.lines) moved.append(drawn("path", { class: `line ${line.style}`, d: this.#trace(line, y) }));
    this.svg.replaceChildren(...parts, inside, this.cursor, this.values);
    this.values.setAttribute("x", this.width - RIGHT);
    this.move();
  }

  move() {
    const x = this.x(view.now);
    const seen = view.now >= view.from - 1e-6 && view.now <= view.until + 1e-6;
    this.cursor.setAttribute("d", seen ? `M${x.toFixed(1)} ${TOP - 4}V${HEIGHT - BOTTOM}` : "");
    const told = this.width < 450 && this.lines.length > 3 ? this.lines.filter((line) => !line.style.includes("faint")) : this.lines;
    const words = told.map((line) => {
      const value = line.v[newest(line.t, view.now)];
      const digits = this.unit === "m/s" || this.unit === "m" ? 2 : 1;
      const number = known(value) ? `${rounded(value, digits)}${this.unit === "°" ? "" : " "}${this.unit}` : "–";
      return line.short ? `${line.short} ${number}` : number;
    });
    this.values.textContent = words.join("   ");
  }

  #limits() {
    let low = Infinity, high = -Infinity;
    for (const { t, v } of this.lines) {
      for (let i = Math.max(0, newest(t, view.from)); i < t.length && t[i] <= view.until; i++) {
        if (!Number.isFinite(v[i])) continue;
        if (v[i] < low) low = v[i];
        if (v[i] > high) high = v[i];
      }
    }
    if (!Number.isFinite(low)) return [-1, 1];
    if (this.band) { low = Math.min(low, this.band[0]); high = Math.max(high, this.band[1]); }
    const margin = 0.06 * (high - low) || 0.5;
    return [low - margin, high + margin];
  }

  *#grid(low, high, y) {
    const bottom = HEIGHT - BOTTOM, right = this.width - RIGHT;
    for (const value of ticks(low, high)) {
      yield drawn("path", { class: "grid", d: `M${LEFT} ${y(value).toFixed(1)}H${right}` });
      yield drawn("text", { class: "row", x: LEFT - 6, y: y(value) + 3.5 }, plain(value));
    }
    yield drawn("text", { class: "row", x: LEFT - 6, y: 11 }, this.unit);
    for (const value of ticks(view.from, view.until, this.width < 500 ? 4 : TICKS)) {
      yield drawn("path", { class: "axis", d: `M${this.x(value).toFixed(1)} ${bottom}v4` });
      yield drawn("text", { class: "col", x: this.x(value), y: bottom + 17 }, plain(value));
    }
    yield drawn("path", { class: "axis", d: `M${LEFT} ${bottom}H${right}` });
    yield drawn("text", { class: "row", x: right, y: HEIGHT - 1 }, "s");
  }

  /** Of many points in one column of pixels only first, lowest, highest and last are drawn. */
  #trace({ t, v }, y) {
    const out = [];
    let column = NaN, low = 0, high = 0, last = 0, pen = false;
    const flush = () => {
      if (Number.isNaN(column)) return;
      out.push(`${pen ? "L" : "M"}${column} ${low.toFixed(1)}`);
      pen = true;
      if (high !== low) out.push(`L${column} ${high.toFixed(1)}`);
      if (last !== high) out.push(`L${column} ${last.toFixed(1)}`);
      column = NaN;
    };
    const begin = Math.max(0, newest(t, view.from));
    for (let i = begin; i < t.length; i++) {
      if (!Number.isFinite(v[i])) { flush(); pen = false; continue; }
      const x = Math.round(this.x(t[i])), at = y(v[i]);
      if (x !== column) { flush(); column = x; low = high = at; }
      low = Math.min(low, at); high = Math.max(high, at); last = at;
      if (t[i] > view.until) break;
    }
    flush();
    return out.join("");
  }
}

function ticks(low, high, most = TICKS) {
  const rough = Math.max(high - low, 1e-9) / most, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 2.5, 5, 10].map((nice) => nice * power).find((nice) => nice >= rough * 0.999);
  const found = [];
  for (let at = Math.ceil(low / step - 1e-9); at <= Math.floor(high / step + 1e-9); at++) found.push(at * step);
  return found;
}

const plain = (value) => String(Number(value.toPrecision(6)) || 0);
const rounded = (value, digits) => {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? (0).toFixed(digits) : text.replace("-", "−");
};

