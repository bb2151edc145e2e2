// What this device has to drive with, in words: keys, a gamepad, or fingers only.

const FINGERS = matchMedia("(hover: none) and (pointer: coarse)");
const BUTTONS = { autonomy: ["Autonomy", "P", "RB"], reset: ["Reset", "R", "Start"], take_over: ["Take over", "T", "Y"] };
const SECONDS = { autonomy: "hold", reset: "hold 1 s", take_over: "hold 1 s" };

export class Device {
  keys = !FINGERS.matches;
  padWords = "";
  #pad = "";

  /** Looks again; returns whether anything is other than before. */
  look(pads) {
    const before = `${this.keys} ${this.#pad} ${this.padWords}`;
    this.keys = !FINGERS.matches;
    this.#pad = pads.name;
    this.padWords = pads.name ? `Gamepad: ${pads.name}` : pads.trouble || (this.keys ? "No gamepad (press one of its buttons)" : "");
    return before !== `${this.keys} ${this.#pad} ${this.padWords}`;
  }

  get stopKeys() { return [this.keys ? "Space or Esc" : "", this.#pad ? "B" : ""].filter(Boolean).join(", "); }

  /** What stands under a button that is held. */
  hold(what) {
    const [, key, button] = BUTTONS[what];
    return [SECONDS[what], this.keys ? key : "", this.#pad ? button : ""].filter(Boolean).join(" · ");
  }

  /** Puts this device's names into a sentence of the server (clients/monitor/driving.py). */
  named(sentence) { return sentence.replaceAll(/\{(\w+)\}/g, (_, what) => this.#name(what)); }

  /** What ends a state of the car (runtime/arbitration/driving_state.py), by what this device has; `words` elsewhere. */
  clears(state, words) {
    const [drive, autonomy] = [this.#name("manual"), this.#name("autonomy")];
    switch (state) {
      case "disarmed": return `an operator: switch Drive on, then hold ${drive} to drive, or ${autonomy} to permit autonomy`;
      case "armed": return `a speed: ${this.#ways.join(" or ")}, or hold ${autonomy} to permit autonomy`;
      case "e-stopped": return `switch Drive on, release everything, then hold ${this.#name("reset")} for 1 s, and release it; ${words.split("; ").at(-1)}`;
      default: return words;
    }
  }

  get #ways() { return ["pull the drive pad", this.keys ? "hold an arrow key" : "", this.#pad ? "push the stick" : ""].filter(Boolean); }

  #name(what) {
    if (what === "manual") return ["the drive pad", this.keys ? "an arrow key" : "", this.#pad ? "LB" : ""].filter(Boolean).join(" or ");
    const [word, key, button] = BUTTONS[what] ?? [what, "", ""];
    const also = [this.keys ? key : "", this.#pad ? button : ""].filter(Boolean).join(", ");
    return also ? `${word} (${also})` : word;
  }
}
