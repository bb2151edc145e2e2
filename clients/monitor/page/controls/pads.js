// Gamepads: two layouts, and when a pad last said anything. A pad that is asleep keeps its last state for ever, so the
// age of its last event goes with every command.

const STANDARD = { manual: 4, autonomy: 5, estop: 1, reset: 9, take_over: 3, speed: 1, steering: 2 };
/** Logitech F710 in D mode: 0 X, 1 A, 2 B, 3 Y; axes as they come, hat last. */
const D_MODE = { manual: 4, autonomy: 5, estop: 2, reset: 9, take_over: 3, speed: 1, steering: 2 };
const BUTTONS = ["manual", "autonomy", "estop", "reset", "take_over"];
const D_MODE_IDS = [/c219/i, /cordless rumblepad 2/i];

export class Pads {
  /** What the first usable pad holds now. */
  held = [];
  speed = 0;
  steering = 0;
  name = "";
  trouble = "";
  ageMs = 0;
  #eventMs = -Infinity;
  #stamp = NaN;
  #print = NaN;

  poll(nowMs) {
    const pads = navigator.getGamepads ? navigator.getGamepads() : [];
    let pad = null, layout = null;
    this.trouble = "";
    for (const candidate of pads) {
      if (!candidate?.connected) continue;
      layout = layoutOf(candidate);
      if (layout) { pad = candidate; break; }
      this.trouble = `${candidate.id}: an unknown layout, not used`;
    }
    this.held.length = 0;
    if (!pad) {
      this.name = "";
      this.speed = this.steering = 0;
      this.#stamp = NaN;
      return;
    }
    this.name = pad.id;
    for (const button of BUTTONS) if (pad.buttons[layout[button]]?.pressed) this.held.push(button);
    this.speed = clamp(-pad.axes[layout.speed]);
    this.steering = clamp(-pad.axes[layout.steering]);
    const print = fingerprint(pad);
    if (pad.timestamp !== this.#stamp || print !== this.#print) this.#eventMs = nowMs;
    this.#stamp = pad.timestamp;
    this.#print = print;
    this.ageMs = Math.max(0, Math.round(nowMs - this.#eventMs));
  }
}

function layoutOf(pad) {
  if (pad.mapping === "standard") return STANDARD;
  return D_MODE_IDS.some((id) => id.test(pad.id)) && pad.axes.length >= 4 && pad.buttons.length >= 10 ? D_MODE : null;
}

function fingerprint(pad) {
  let sum = 0;
  for (let i = 0; i < pad.axes.length; i++) sum = sum * 31 + pad.axes[i];
  for (let i = 0; i < pad.buttons.length; i++) sum = sum * 31 + pad.buttons[i].value;
  return sum;
}

/** A deflection, -1 to 1; 0 for no number. */
export function clamp(value) { return Number.isFinite(value) ? Math.max(-1, Math.min(1, value)) : 0; }
