// The moment that all plots show: the scan and the decision at that time, the controls of zoom and playback.

// -- one run at one moment -------------------------------------------------------------------------------------------

class Moment {
  constructor(told, parent, lines) {
    this.told = told;
    this.lines = lines;
    this.path = { t: floats(told.path.t), x: floats(told.path.x), y: floats(told.path.y), yaw: floats(told.path.yaw) };
    const scans = told.scans;
    this.scans = { ...scans, t: floats(scans.t), pose: floats(scans.pose), beams: new Uint16Array(bytes(scans.beams)) };
    this.times = told.decisions.map((decision) => decision[0]);
    const name = told.tag ? `${told.tag} ${told.name}` : told.name;
    this.canvas = make("canvas");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `${name}: the scan from above, forward up`);
    const list = make("dl");
    this.fields = {};
    const fields = ["decided by", "why", "speed", "steering", "error"];
    for (const field of told.laps.length ? [...fields, "lap"] : fields) {
      this.fields[field] = make("dd", "", "–");
      list.append(make("dt", "", field), this.fields[field]);
    }
    const box = make("div", "scene");
    if (told.tag) box.append(make("h3", "", name));
    box.append(this.canvas, list);
    parent.append(box);
    this.context = this.canvas.getContext("2d");
  }

  show() {
    this.#draw();
    const decision = this.told.decisions[newest(this.times, view.now)];
    const set = (field, text) => { if (this.fields[field].textContent !== text) this.fields[field].textContent = text; };
    set("decided by", decision ? decision[1] : "–");
    set("why", decision ? decision[2] + (decision[6] ? "" : " (not delivered)") : "no decision yet");
    const at = (name) => { const line = this.lines[name]; return line && line.v[newest(line.t, view.now)]; };
    const speed = [["driven", at("driven")], ["sent", at("sent")], ["wished", at("wished")]];
    set("speed", speed.filter(([, value]) => known(value)).map(([word, value]) => `${word} ${rounded(value, 2)}`).join(", ") + " m/s");
    const steering = at("steering");
    set("steering", !known(steering) ? "–" : Math.abs(steering) < 0.5 ? "straight" : `${Math.abs(steering).toFixed(0)}° ${steering > 0 ? "left" : "right"}`);
    const error = at("error");
    set("error", known(error) ? `${rounded(error, 3)} m` : this.told.races ? "not on the line" : "no wall");
    const laps = this.told.laps, done = newest(laps, view.now) + 1;
    if (laps.length) set("lap", done < laps.length ? `${done + 1} of ${laps.length}` : `${done} complete`);
  }

  #draw() {
    const { canvas, context, scans, told } = this;
    const ratio = window.devicePixelRatio || 1;
    const wide = Math.round(canvas.clientWidth * ratio), tall = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== wide || canvas.height !== tall) [canvas.width, canvas.height] = [wide, tall];
    context.clearRect(0, 0, wide, tall);
    if (!wide || !tall) return;
    const gain = Math.min(wide, tall) / (2 * view.around);
    const at = newest(this.path.t, view.now), here = Math.max(at, 0);
    const [x0, y0, yaw] = [this.path.x[here] || 0, this.path.y[here] || 0, this.path.yaw[here] || 0];
    const cos = Math.cos(yaw), sin = Math.sin(yaw);
    const place = (x, y) => { // odometry's metres to pixels: the car in the middle, forward up
      const ahead = cos * (x - x0) + sin * (y - y0), left = -sin * (x - x0) + cos * (y - y0);
      return [wide / 2 - left * gain, tall * 0.6 - ahead * gain];
    };
    this.#rings(gain, wide, tall, ratio);
    context.strokeStyle = ink.s1;
    context.lineWidth = 1.5 * ratio;
    context.beginPath();
    for (let i = Math.max(0, newest(this.path.t, view.now - TRAIL_S)); i <= at; i++) context.lineTo(...place(this.path.x[i], this.path.y[i]));
    context.stroke();
    const scan = newest(scans.t, view.now);
    if (scan >= 0) {
      const [sx, sy, turned] = scans.pose.subarray(3 * scan, 3 * scan + 3);
      context.fillStyle = ink.soft;
      const dot = 2.2 * ratio;
      for (let i = 0; i < scans.groups; i++) {
        const packed = scans.beams[scan * scans.groups + i], range = (packed & MAX_CM) / 100;
        if (!range) continue;
        const bearing = scans.from + (i * scans.group + (packed >> GROUP_SHIFT)) * scans.step;
        const ahead = told.car[3] + range * Math.cos(bearing), left = told.car[4] + range * Math.sin(bearing);
        const [px, py] = place(sx + Math.cos(turned) * ahead - Math.sin(turned) * left, sy + Math.sin(turned) * ahead + Math.cos(turned) * left);
        context.fillRect(px - dot / 2, py - dot / 2, dot, dot);
      }
    }
    const [front, rear, half] = told.car;
    context.fillStyle = ink.s1;
    context.fillRect(wide / 2 - half * gain, tall * 0.6 - front * gain, 2 * half * gain, (front + rear) * gain);
  }

  #rings(gain, wide, tall, ratio) {
    const { context } = this;
    context.strokeStyle = ink.line;
    context.fillStyle = ink.soft;
    context.lineWidth = ratio;
    context.font = `${11 * ratio}px system-ui, sans-serif`;
    const step = view.around > 8 ? 5 : view.around > 3 ? 2 : 1;
    for (let radius = step; radius < 2 * view.around; radius += step) {
      context.beginPath();
      context.arc(wide / 2, tall * 0.6, radius * gain, 0, 2 * Math.PI);
      context.stroke();
      context.fillText(`${radius} m`, wide / 2 + 4 * ratio, tall * 0.6 - radius * gain - 3 * ratio);
    }
  }
}

// -- time: cursor, zoom, playback ------------------------------------------------------------------------------------

const ink = {};
function readInk() {
  const style = getComputedStyle(document.documentElement);
  for (const name of ["s1", "soft", "line"]) ink[name] = style.getPropertyValue(`--${name}`).trim();
}

const aside = document.querySelector(".moment");
aside.hidden = false;
document.body.classList.add("live", ...(data.runs.length > 1 ? ["two"] : []));
const charts = [...document.querySelectorAll("svg[data-chart]")].map((svg) => new Chart(svg, data.charts[svg.dataset.chart]));
const lineOf = (name, label, number) => {
  const chart = data.charts[name] && charts.find((one) => one.svg.dataset.chart === name);
  return chart && (label ? chart.lines.find((line) => line.label === label) : chart.lines[number]);
};
const moments = data.runs.map((run, number) => {
  const named = (word) => lineOf("speed", run.tag ? `${run.tag} ${word}` : word);
  const single = (name) => lineOf(name, run.tag ? `${run.tag} ${run.name}` : "", number);
  return new Moment(run, aside, {
    driven: named("driven"), sent: named("sent"), wished: named("wished"), steering: single("steering"), error: single("error"),
  });
});

const button = (text, label, act) => {
  const element = make("button", "", text);
  element.type = "button";
  element.setAttribute("aria-label", label);
  element.title = label;
  element.addEventListener("click", act);
  return element;
};
const playing = button("▶", "Play (space)", () => play(!view.playing));
const clock = make("span", "clock");
const slider = make("input");
Object.assign(slider, { type: "range", min: 0, max: total, step: 0.01, value: 0 });
slider.setAttribute("aria-label", "Time in the run");
slider.addEventListener("input", () => { play(false); go(Number(slider.value)); });
const choice = (label, options, chosen, act) => {
  const select = make("select");
  select.setAttribute("aria-label", label);
  for (const [value, text] of options) select.append(new Option(text, value, value === chosen, value === chosen));
  select.addEventListener("change", () => act(Number(select.value)));
  return select;
};
const bar = make("div", "transport", playing, slider, clock,
  choice("Playback speed", [0.25, 0.5, 1, 2, 5, 10].map((x) => [x, `${x}×`]), 1, (x) => { view.speed = x; }),
  button("−", "Show more time (-)", () => zoom(2)), button("+", "Show less time (+)", () => zoom(0.5)),
  button("all", "Show the whole run (0)", () => show(0, total)),
  choice("How far around the car", [3, 6, 12, 24].map((x) => [x, `${x} m`]), view.around, (x) => { view.around = x; move(); }));
bar.setAttribute("role", "toolbar");
bar.setAttribute("aria-label", "Time");
document.querySelector("main").append(bar);

for (const place of document.querySelectorAll("[data-at]")) {
  const link = button(place.textContent, `Go to ${place.textContent}`, () => { play(false); go(Number(place.dataset.at)); });
  link.className = "go";
  place.replaceChildren(link);
}

const laps = [...document.querySelectorAll(".laps")].map((box) => [...box.children]);

/** Of each drawing of several laps, the one at the cursor; before the first the first, behind the last the last. */
function showLaps() {
  for (const parts of laps) {
    const at = Math.max(0, parts.findLastIndex((part) => Number(part.dataset.from) <= view.now));
    parts.forEach((part, number) => { part.hidden = number !== at; });
  }
}

function move() {
  for (const chart of charts) chart.move();
  showLaps();
  for (const moment of moments) moment.show();
  slider.value = view.now;
  const text = `${view.now.toFixed(2)} s`;
  clock.textContent = text;
  slider.setAttribute("aria-valuetext", text);
}

/** Put the cursor at a time; the span that is shown follows it. */
function go(time) {
  view.now = Math.min(Math.max(time, 0), total);
  const span = view.until - view.from;
  if (view.now < view.from || view.now > view.until) show(view.now - span / 4, view.now + (3 * span) / 4);
  else move();
}

function show(from, until) {
  const span = Math.min(Math.max(until - from, MIN_SPAN_S), total);
  view.from = Math.min(Math.max(from, 0), total - span);
  view.until = view.from + span;
  for (const chart of charts) chart.draw();
  move();
}

function zoom(factor, around = view.now) {
  show(around - (around - view.from) * factor, around + (view.until - around) * factor);
}

let last = 0;
function play(on) {
  if (on === view.playing) return;
  view.playing = on;
  playing.textContent = on ? "❚❚" : "▶";
  playing.setAttribute("aria-label", on ? "Pause (space)" : "Play (space)");
  playing.title = on ? "Pause (space)" : "Play (space)";
  if (!on) return;
  if (view.now >= total) go(0);
  last = performance.now();
  requestAnimationFrame(frame);
}

function frame(at) {
  if (!view.playing) return;
  const elapsed = Math.max(0, at - last) / 1000;
  if (elapsed > MIN_TICK_S) {
    last = at;
    go(view.now + elapsed * view.speed);
    if (view.now >= total) play(false);
  }
  requestAnimationFrame(frame);
}

const KEYS = {
  " ": () => play(!view.playing), "+": () => zoom(0.5), "=": () => zoom(0.5), "-": () => zoom(2), 0: () => show(0, total),
  ArrowLeft: (event) => go(view.now - (event.shiftKey ? STEP_S : 0.025)),
  ArrowRight: (event) => go(view.now + (event.shiftKey ? STEP_S : 0.025)),
  Home: () => go(0), End: () => go(total),
};
addEventListener("keydown", (event) => {
  const own = event.target.closest("input, select, summary, pre") || (event.key === " " && event.target.closest("button"));
  if (own || event.ctrlKey || event.metaKey || event.altKey || !KEYS[event.key]) return;
  event.preventDefault();
  KEYS[event.key](event);
});
addEventListener("resize", () => show(view.from, view.until));
addEventListener("beforeprint", () => show(0, total));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { readInk(); move(); });
readInk();
show(0, total);
