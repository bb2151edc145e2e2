// Colours for canvases, taken from the stylesheet so that there is one truth for dark, light and high contrast; and
// small ways of touching the document only when something changed.

export const ink = {};
const NAMES = [
  "text", "muted", "faint", "grid", "panel", "point", "masked", "silent", "wall", "ball", "go", "slow", "stop", "car",
  "line-a", "line-b", "line-c",
];
const listeners = [];

function read() {
  const style = getComputedStyle(document.documentElement);
  for (const name of NAMES) ink[name] = style.getPropertyValue(`--${name}`).trim();
  ink.font = style.getPropertyValue("--canvas-font").trim();
  for (const listener of listeners) listener();
}

/** Calls back whenever the colours have changed. */
export function onLook(listener) { listeners.push(listener); }

for (const query of ["(prefers-color-scheme: dark)", "(prefers-contrast: more)"]) {
  matchMedia(query).addEventListener("change", read);
}
read();

export const $ = (id) => document.getElementById(id);

export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function setData(element, name, value) {
  if (element.dataset[name] !== value) element.dataset[name] = value;
}

export function setHidden(element, hidden) {
  if (element.hidden !== hidden) element.hidden = hidden;
}

export function make(tag, className = "", text = "") {
  const element = document.createElement(tag);
  if (className) element.className = className;
  if (text) element.textContent = text;
  return element;
}

/** Makes a canvas as sharp as the screen; returns whether its size changed. */
export function fit(canvas) {
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const width = Math.round(canvas.clientWidth * ratio);
  const height = Math.round(canvas.clientHeight * ratio);
  if (canvas.width === width && canvas.height === height) return false;
  canvas.width = width;
  canvas.height = height;
  return true;
}

export function ratioOf(canvas) { return canvas.clientWidth ? canvas.width / canvas.clientWidth : 1; }

/** Says something that the eye may miss, for screen readers too. */
export function announce(text, kind = "info") {
  const box = $("notice");
  setData(box, "kind", kind);
  box.textContent = text;
  clearTimeout(announce.timer);
  announce.timer = setTimeout(() => { box.textContent = ""; }, 6000);
}

/** Takes a notice of a kind back, because what it says does not hold any more. */
export function withdraw(kind) {
  const box = $("notice");
  if (box.dataset.kind === kind) box.textContent = "";
}

export function age(ms) {
  if (!Number.isFinite(ms)) return "never";
  if (ms < 1000) return `${Math.max(0, Math.round(ms))} ms`;
  return ms < 60000 ? `${(ms / 1000).toFixed(1)} s` : `${Math.round(ms / 60000)} min`;
}

export function number(value, digits, unit = "") {
  if (!Number.isFinite(value)) return "–";
  const text = value.toFixed(digits);
  return `${Number(text) === 0 ? text.replace("-", "") : text.replace("-", "−")}${unit}`; // never "-0.00"
}
