// The panel with which a person drives: the Drive switch, the buttons that are held, the share of the top speed.

import { DrivePad } from "./drive_pad.js";
import { $, setData, setText } from "../look.js";
import { remember } from "../remembered.js";

const SMALL = matchMedia("(max-width: 760px)");
/** What the buttons hold, by their ids. */
export const HELD = { autonomy: "autonomy", reset: "reset", "take-over": "take_over" };

export class Driving {
  #topSpeed = 1.5;
  #wakeLock = null;

  constructor(hands, share = 0.5) {
    this.hands = hands;
    this.pad = new DrivePad(hands);
    hands.steerWith($("touch"));
    for (const [id, what] of Object.entries(HELD)) hands.holdWith($(id), what);
    $("drive").addEventListener("click", () => hands.engage(!hands.engaged));
    $("share").addEventListener("input", () => this.#showShare());
    hands.share = share;
    $("share").value = String(share);
  }

  /** The car's top speed [m/s] is known: the share of it may be chosen. */
  takeTopSpeed(speed) {
    this.#topSpeed = speed;
    $("share").disabled = false;
    this.#showShare();
  }

  show() {
    const on = this.hands.engaged;
    $("drive").setAttribute("aria-checked", String(on));
    setText($("drive-word"), on ? "on" : "off");
    setData($("driving"), "on", String(on));
    setData(document.body, "driving", String(on));
    for (const id of Object.keys(HELD)) $(id).disabled = !on;
    this.#keepAwake(on);
    this.pad.draw();
    if (on && SMALL.matches) scrollTo(0, 0); // everything that a driver needs is up there now
  }

  #showShare() {
    this.hands.share = $("share").valueAsNumber;
    remember({ share: this.hands.share });
    const words = `${(this.hands.share * this.#topSpeed).toFixed(2)} m/s`;
    setText($("share-value"), words);
    $("share").setAttribute("aria-valuetext", words);
  }

  async #keepAwake(on) {
    if (!navigator.wakeLock) return;
    try {
      if (on) this.#wakeLock ??= await navigator.wakeLock.request("screen");
      else { await this.#wakeLock?.release(); this.#wakeLock = null; }
    } catch {
      this.#wakeLock = null; // refused, for example on a low battery: the screen may go dark, and then the car stops
    }
  }
}
