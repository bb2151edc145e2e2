// The STOP button, Space and Esc: stops the car that is shown, or all cars. A STOP is owed until a car has confirmed it:
// the link may be gone, or hang, and is then sent again as soon as there is one.

import { $, announce, setData, setText } from "../look.js";

const OWED_MS = 15000; // a STOP is sent late rather than never
const OLD_MS = 500;

export class StopButton {
  /** Whether STOP is for all cars. */
  all = false;
  #owedMs = -Infinity; // when the STOP was asked for that is not confirmed
  #owed = "stop";

  constructor({ link, fleet, device, timings }) {
    Object.assign(this, { link, fleet, device, timings });
    $("stop").addEventListener("pointerdown", (event) => { if (event.button === 0) this.stop(); });
    $("stop").addEventListener("click", (event) => { if (event.detail === 0) this.stop(); }); // Enter, or an assistive device
    window.addEventListener("keydown", (event) => this.#takeKey(event), { capture: true });
    window.addEventListener("keyup", (event) => { if (event.code === "Space") event.preventDefault(); }, { capture: true });
  }

  stop(kind = this.all ? "stop_all" : "stop") {
    this.#owedMs = performance.now();
    this.#owed = kind;
    this.timings.stopped(this.#owedMs);
    if (!this.link.say({ t: kind })) {
      announce("STOP NOT SENT: there is no link to the car; it will be sent as soon as the link is back", "bad");
    }
    this.show(this.#owedMs);
  }

  /** Sends the STOP that is not confirmed. Called when the link is back. */
  sendOwed() {
    const owed = performance.now() - this.#owedMs < OWED_MS;
    this.#owedMs = -Infinity;
    if (!owed) return;
    this.stop(this.#owed);
    announce("the link is back: STOP is sent", "good");
  }

  show(nowMs) {
    if (this.#isConfirmed()) this.#owedMs = -Infinity;
    if (this.#isOwed && nowMs - this.#owedMs > OWED_MS) {
      this.#owedMs = -Infinity;
      announce("STOP IS NOT CONFIRMED: stop the car another way", "bad");
    }
    const state = this.#state();
    setData($("stop"), "state", state);
    setText($("stop-note"), this.#note(state, nowMs));
  }

  #state() {
    const { pilot, beat } = this.link.newest;
    if (this.all) return this.#isOwed && this.fleet.stop.state === "ready" ? "pending" : this.fleet.stop.state;
    if (beat.latched) return "latched";
    return this.#isOwed || pilot.value?.stop_pending ? "pending" : "ready";
  }

  get #isOwed() { return this.#owedMs > -Infinity; }

  /** Whether a car, or all, have stopped since; where a recording is played there is none. */
  #isConfirmed() {
    const { newest, seenMs } = this.link;
    if (newest.monitor.value?.recording) return true;
    if (this.#owed === "stop_all") return seenMs.fleet > this.#owedMs && this.fleet.stop.state === "latched";
    return seenMs.beat > this.#owedMs && newest.beat.latched;
  }

  #note(state, nowMs) {
    if (!this.link.open) return this.#isOwed ? "no link! sent when it is back" : "no link!";
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
