// The STOP button, Space and Esc: stops the car that is shown, or all cars. A STOP without a link is sent late.

import { $, announce, setData, setText } from "../look.js";

const OWED_MS = 15000; // a STOP is sent late rather than never
const SENDING_MS = 300;
const OLD_MS = 500;

export class StopButton {
  /** Whether STOP is for all cars. */
  all = false;
  #askedMs = -Infinity;
  #owedMs = -Infinity; // a STOP that found no link
  #owed = "stop";

  constructor({ link, fleet, device, timings }) {
    Object.assign(this, { link, fleet, device, timings });
    $("stop").addEventListener("pointerdown", (event) => { if (event.button === 0) this.stop(); });
    $("stop").addEventListener("click", (event) => { if (event.detail === 0) this.stop(); }); // Enter, or an assistive device
    window.addEventListener("keydown", (event) => this.#takeKey(event), { capture: true });
    window.addEventListener("keyup", (event) => { if (event.code === "Space") event.preventDefault(); }, { capture: true });
  }

  stop(kind = this.all ? "stop_all" : "stop") {
    this.#askedMs = performance.now();
    this.timings.stopped(this.#askedMs);
    if (!this.link.say({ t: kind })) {
      this.#owedMs = this.#askedMs;
      this.#owed = kind;
      announce("STOP NOT SENT: there is no link to the car; it will be sent as soon as the link is back", "bad");
    }
    this.show(this.#askedMs);
  }

  /** Sends the STOP that found no link. Called when the link is back. */
  sendOwed() {
    const owed = performance.now() - this.#owedMs < OWED_MS;
    this.#owedMs = -Infinity;
    if (!owed) return;
    this.stop(this.#owed);
    announce("the link is back: STOP is sent", "good");
  }

  show(nowMs) {
    if (this.#owedMs > -Infinity && nowMs - this.#owedMs > OWED_MS) {
      this.#owedMs = -Infinity;
      announce("STOP WAS NOT SENT: the link did not come back in time; stop the car another way", "bad");
    }
    const state = this.#state(nowMs);
    setData($("stop"), "state", state);
    setText($("stop-note"), this.#note(state, nowMs));
  }

  #state(nowMs) {
    const { pilot, beat } = this.link.newest;
    const asked = nowMs - this.#askedMs < SENDING_MS;
    if (this.all) return asked && this.fleet.stop.state === "ready" ? "pending" : this.fleet.stop.state;
    if (beat.latched) return "latched";
    return asked || pilot.value?.stop_pending ? "pending" : "ready";
  }

  #note(state, nowMs) {
    if (!this.link.open) return this.#owedMs > -Infinity ? "no link! sent when it is back" : "no link!";
    if (this.all) return this.fleet.stop.words || this.device.stopKeys;
    if (this.link.ageMs("beat", nowMs) > OLD_MS) return "the car is not heard";
    return { latched: "e-stop: the car is held", pending: "sending…", ready: this.device.stopKeys }[state];
  }

  #takeKey(event) {
    if (event.code !== "Space" && event.key !== "Escape") return;
    event.preventDefault(); // Space never presses a button on this page; Enter does
    event.stopPropagation();
    if (!event.repeat) this.stop();
  }
}
