// The laps along the race line that this page has seen, newest first: their times and those of their sectors.

import { $, make, number, setHidden } from "./look.js";

const MOST_SHOWN = 10;

export class Laps {
  #laps = []; // { lap, times }: of the lap and of its sectors [s]

  /** Another car: nothing of the last one holds. */
  forget() {
    if (!this.#laps.length) return;
    this.#laps = [];
    this.#show();
  }

  /** race: of the car's status; undefined where no line is driven. */
  take(race) {
    if (!race || race.laps < this.#lastLap) this.forget(); // the latter: the car has begun anew
    if (!race?.laps || race.laps === this.#lastLap) return;
    this.#laps.push({ lap: race.laps, times: [race.time_s, ...(race.sectors_s ?? [])] });
    this.#show();
  }

  get #lastLap() { return this.#laps.at(-1)?.lap ?? 0; }

  #show() {
    const columns = this.#laps.at(-1)?.times.length ?? 0;
    const best = Array.from({ length: columns }, (_, k) => Math.min(...this.#laps.map(({ times }) => times[k] ?? Infinity)));
    setHidden($("laps"), !columns);
    $("lap-rows").replaceChildren(...this.#laps.slice(-MOST_SHOWN).reverse().map(({ lap, times }) => {
      const row = make("tr"), head = make("th", "", String(lap));
      head.scope = "row";
      row.append(head, ...best.map((least, k) => make("td", times[k] === least ? "best" : "", number(times[k], 2, " s"))));
      return row;
    }));
  }
}
