// What a simulated car meets: obstacles, floor, lidar. Shown only where a simulator answers; a real car never does.

import { $, announce, make, setHidden, setText } from "./look.js";

export class Simulator {
  #link;
  #names = "";

  constructor(link) { this.#link = link; }

  /** Another car, or another start of it: until a simulator answers there is none. */
  forget() { setHidden($("simulator"), true); }

  /** Asks whether there is a simulator; silence is an answer. */
  async refresh() {
    try {
      this.#show(await this.#link.ask("simulator"));
    } catch {
      this.forget();
    }
  }

  async #do(name) {
    try {
      this.#show(await this.#link.ask("simulator", { do: name }));
    } catch (error) {
      announce(error.message, "bad");
    }
  }

  #show({ actions, conditions }) {
    setHidden($("simulator"), false);
    setText($("simulator-conditions"), Object.entries(conditions).map(([what, value]) => `${what} ${value}`).join(" · "));
    const names = actions.map(({ name }) => name).join();
    if (names === this.#names) return;
    this.#names = names;
    $("simulator-actions").replaceChildren(...actions.map(({ name, words }) => {
      const button = make("button", "", words);
      button.type = "button";
      button.dataset.action = name;
      button.addEventListener("click", () => this.#do(name));
      return button;
    }));
  }
}
