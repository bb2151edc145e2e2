// What is held down: drive pad, buttons, keys, gamepad. Hold-to-drive throughout. Says all of it forty times a second
// while this page drives, and at once when it changes. What it cannot know (a cancelled touch, a lost focus) it calls
// neither held nor released: the car stops, and wants a release (see clients/monitor/driving.py).

import { Pads, clamp } from "./pads.js";

const EVERY_MS = 25;
/** Chromium holds all timers back for 0.1 s when a finger comes down, so that pages answer it quickly: just when the
 *  car wants to hear from us. Frames, finger movements and heartbeats remind us too, if the last word is this old. */
const REMIND_MS = 15;
const DROP_FOR_MS = 150;
const KEY_STEERING_PER_S = 2.5;
const KEY_WAYS = {
  ArrowUp: "up", KeyW: "up", ArrowDown: "down", KeyS: "down", ArrowLeft: "left", KeyA: "left", ArrowRight: "right", KeyD: "right",
};
const KEY_BUTTONS = { KeyP: "autonomy", KeyR: "reset", KeyT: "take_over" };
const PAD_REACH = 0.8;

/** Calls back: onStop() for the pad's stop button, onChange() when `engaged` changed without a click. */
export class Hands {
  engaged = false;
  share = 0.5;
  pads = new Pads();
  /** For the picture of the drive pad. */
  touch = { id: null, speed: 0, steering: 0, x0: 0, y0: 0 };
  #link;
  #keys = new Set();
  #buttons = new Map();
  #keySteering = 0;
  #dropUntilMs = -Infinity;
  #lastMs = performance.now();
  #padStopped = false;
  #message = { t: "hands", car_session: 0, beat: 0, held: [], speed: 0, steering: 0, pad: false, age_ms: 0, share: 1 };

  constructor(link, { onStop, onChange }) {
    this.#link = link;
    this.onStop = onStop;
    this.onChange = onChange;
    setInterval(() => this.tick(), EVERY_MS);
    window.addEventListener("blur", () => this.drop());
    window.addEventListener("keydown", (event) => this.#keyDown(event));
    window.addEventListener("keyup", (event) => this.#keyUp(event));
    document.addEventListener("visibilitychange", () => { if (document.hidden) this.abandon(); });
    window.addEventListener("pagehide", () => this.abandon());
    document.addEventListener("freeze", () => this.abandon());
    window.addEventListener("gamepaddisconnected", () => { if (this.#message.pad) this.drop(); });
    link.on("gone", () => this.#letGo());
    link.on("news", (topic) => { if (topic === "beat") this.#remind(); });
  }

  /** Takes or gives back control, deliberately. */
  engage(on) {
    if (on === this.engaged || (on && !this.#link.open)) return;
    this.#forgetHeld();
    this.engaged = on;
    if (on) this.tick();
    else this.#link.say({ t: "leave", deliberate: true });
    this.onChange();
  }

  /** The page is being hidden or closed: stop, and do not pretend that this was a wish. */
  abandon() {
    if (!this.engaged) return;
    this.#link.say({ t: "leave", deliberate: false });
    this.#letGo();
  }

  /** We no longer know what is held. */
  drop() {
    if (!this.engaged || !this.#anythingHeld()) return;
    this.#forgetHeld();
    this.#dropUntilMs = performance.now() + DROP_FOR_MS;
    this.tick();
  }

  /** Lets a surface be the drive pad: where it is touched is its middle. */
  steerWith(surface) {
    const { touch } = this;
    surface.addEventListener("pointerdown", (event) => {
      if (!this.engaged || event.button !== 0 || touch.id !== null) return;
      event.preventDefault();
      surface.setPointerCapture(event.pointerId);
      touch.id = event.pointerId;
      const box = surface.getBoundingClientRect();
      touch.x0 = event.clientX - box.left;
      touch.y0 = event.clientY - box.top;
      touch.speed = touch.steering = 0;
      this.tick();
      requestAnimationFrame(() => this.#everyFrame());
    });
    surface.addEventListener("pointermove", (event) => {
      if (event.pointerId !== touch.id) return;
      const box = surface.getBoundingClientRect();
      const reach = (Math.min(box.width, box.height) / 2) * PAD_REACH;
      touch.speed = clamp(-(event.clientY - box.top - touch.y0) / reach);
      touch.steering = clamp(-(event.clientX - box.left - touch.x0) / reach);
      this.#remind();
    });
    surface.addEventListener("pointerup", (event) => {
      if (event.pointerId !== touch.id) return;
      this.#forgetTouch();
      this.tick();
    });
    for (const name of ["pointercancel", "lostpointercapture"]) {
      surface.addEventListener(name, (event) => { if (event.pointerId === touch.id) this.drop(); });
    }
    surface.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  /** Lets a button hold something for as long as it is pressed, by pointer or with Enter. */
  holdWith(button, what) {
    const down = (event) => {
      if (!this.engaged || button.disabled) return;
      event.preventDefault();
      button.focus({ preventScroll: true });
      if (event.pointerId !== undefined) button.setPointerCapture(event.pointerId);
      this.#buttons.set(button, what);
      this.tick();
    };
    const up = () => { if (this.#buttons.delete(button)) this.tick(); };
    button.addEventListener("pointerdown", (event) => { if (event.button === 0) down(event); });
    button.addEventListener("pointerup", up);
    for (const name of ["pointercancel", "lostpointercapture"]) {
      button.addEventListener(name, () => { if (this.#buttons.has(button)) this.drop(); });
    }
    button.addEventListener("keydown", (event) => { if (event.key === "Enter" && !event.repeat) down(event); });
    button.addEventListener("keyup", (event) => { if (event.key === "Enter") up(); });
    button.addEventListener("blur", () => { if (this.#buttons.has(button)) this.drop(); });
    button.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  isHeld(what) { return this.engaged && this.#message.held.includes(what); }

  tick() {
    const nowMs = performance.now();
    const seconds = Math.min(0.1, (nowMs - this.#lastMs) / 1000);
    this.#lastMs = nowMs;
    this.pads.poll(nowMs);
    const padStops = this.pads.held.includes("estop");
    if (padStops && !this.#padStopped) this.onStop();
    this.#padStopped = padStops;
    if (!this.engaged) return;
    if (nowMs < this.#dropUntilMs) { this.#link.say({ t: "drop" }); return; }
    this.#collect(seconds);
    this.#link.say(this.#message);
  }

  #remind() { if (this.engaged && performance.now() - this.#lastMs > REMIND_MS) this.tick(); }

  #everyFrame() {
    this.#remind();
    if (this.engaged && this.touch.id !== null) requestAnimationFrame(() => this.#everyFrame());
  }

  #collect(seconds) {
    const message = this.#message, { beat } = this.#link.newest;
    message.car_session = beat.carSession;
    message.beat = beat.number;
    message.share = this.share;
    message.held.length = 0;
    const pad = message.pad = this.pads.held.length > 0;
    message.age_ms = pad ? this.pads.ageMs : 0;
    for (const what of pad ? this.pads.held : this.#buttons.values()) if (!message.held.includes(what)) message.held.push(what);
    const keys = this.#fromKeys(seconds);
    if (pad) {
      message.speed = this.pads.speed;
      message.steering = this.pads.steering;
    } else if (this.touch.id !== null) {
      message.held.push("manual");
      message.speed = this.touch.speed;
      message.steering = this.touch.steering;
    } else if (keys) {
      message.held.push("manual");
      message.speed = keys.speed;
      message.steering = keys.steering;
    } else {
      message.speed = message.steering = 0;
    }
  }

  #keysWish = { speed: 0, steering: 0, fresh: true };

  /** Arrow keys: the first message after a press is centred, as the deadman demands; steering moves gradually. */
  #fromKeys(seconds) {
    const wish = this.#keysWish;
    if (!this.#keys.size) {
      wish.speed = wish.steering = this.#keySteering = 0;
      wish.fresh = true;
      return null;
    }
    if (wish.fresh) {
      wish.fresh = false;
      return wish;
    }
    const target = Number(this.#keys.has("left")) - Number(this.#keys.has("right"));
    const step = KEY_STEERING_PER_S * seconds;
    this.#keySteering += Math.max(-step, Math.min(step, target - this.#keySteering));
    wish.speed = Number(this.#keys.has("up")) - Number(this.#keys.has("down"));
    wish.steering = clamp(this.#keySteering);
    return wish;
  }

  #keyDown(event) {
    if (!this.engaged || writes(event.target)) return;
    if (event.metaKey || event.ctrlKey || event.altKey) { this.drop(); return; } // releases may get lost now
    const way = KEY_WAYS[event.code];
    const what = KEY_BUTTONS[event.code];
    if (!way && !what) return;
    event.preventDefault();
    if (event.repeat) return;
    if (way) this.#keys.add(way);
    else this.#buttons.set(event.code, what);
    this.tick();
  }

  #keyUp(event) {
    const way = KEY_WAYS[event.code];
    const had = way ? this.#keys.delete(way) : this.#buttons.delete(event.code);
    if (had) this.tick();
  }

  #anythingHeld() {
    return this.touch.id !== null || this.#keys.size > 0 || this.#buttons.size > 0 || this.pads.held.length > 0;
  }

  #letGo() {
    const was = this.engaged;
    this.engaged = false;
    this.#forgetHeld();
    if (was) this.onChange();
  }

  #forgetTouch() { this.touch.id = null; this.touch.speed = this.touch.steering = 0; }

  #forgetHeld() {
    this.#forgetTouch();
    this.#keys.clear();
    this.#buttons.clear();
    this.#message.held.length = 0;
  }
}

/** Whether an element takes letters; a slider that was touched must not take the driving keys. */
function writes(target) {
  return target instanceof Element && target.closest('input:not([type="range"], [type="checkbox"]), select, textarea') !== null;
}
