// The button that begins and ends a recording on the car.

import { $, announce, setData, setText } from "../look.js";

export class RecordButton {
  #link;
  #on = false;

  constructor(link) {
    this.#link = link;
    $("record").addEventListener("click", () => this.#ask(!this.#on));
  }

  /** state: of the car's status: whether it records, plain or as `on`. */
  show(state) {
    this.#on = typeof state === "object" ? Boolean(state?.on) : Boolean(state);
    setData($("record"), "on", String(this.#on));
    setText($("record-word"), this.#on ? "Recording" : "Record");
    $("record").setAttribute("aria-pressed", String(this.#on));
  }

  async #ask(on) {
    try {
      const answer = await this.#link.ask("record", { on });
      this.show(answer);
      announce(answer.words ?? (on ? "recording" : "recording ended"), answer.on === on ? "good" : "bad");
    } catch (error) {
      announce(error.message, "bad");
    }
  }
}
