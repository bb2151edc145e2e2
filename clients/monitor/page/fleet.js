// All cars on one page: a row for each, the e-stop for all of them, and the race. A click opens the car's own page.

import { $, age, make, number, setData, setHidden, setText } from "./look.js";

const OLD_MS = 1000;
const BAD_STATES = /^(e-stop|no |fault|waiting)/;
const COLUMNS = [
  ["position", "Place"], ["car", "Car"], ["state", "State"], ["speed", "Speed"], ["error", "Mean error"],
  ["battery", "Battery"], ["link", "Link"], ["laps", "Laps"], ["last", "Last lap"], ["best", "Best lap"], ["gap", "Gap"],
  ["why", "Why"],
];

export class Fleet {
  /** open(name): shows a car's own page. */
  constructor(link, open) {
    this.link = link;
    this.open = open;
    this.rows = new Map();
    $("fleet-head").replaceChildren(...COLUMNS.map(([name, title]) => {
      const cell = make("th", name, title);
      cell.scope = "col";
      cell.setAttribute("role", "columnheader");
      return cell;
    }));
  }

  get isFresh() { return this.link.open && this.link.ageMs("fleet") < OLD_MS; }

  /** Returns the e-stop's state and what to say of it. */
  get stop() {
    const { cars = [], stop } = this.link.newest.fleet.value ?? {};
    if (!this.isFresh) return { state: "ready", words: "the monitor is not heard" };
    if (stop?.late.length) return { state: "pending", words: `${stop.sending ? "sending… not yet" : "NOT CONFIRMED"}: ${stop.late.join(", ")}` };
    if (stop?.latched && stop.age_s < 5) return { state: "latched", words: `${stop.latched} of ${stop.latched} have stopped` };
    return { state: "ready", words: cars.length ? "" : "no car" };
  }

  show({ cars, problems }) {
    const ordered = [...cars].sort((one, other) => place(one) - place(other) || one.car.localeCompare(other.car));
    const keys = ordered.map((car) => `${car.car} ${car.session} ${car.trouble}`);
    for (const [key, row] of this.rows) if (!keys.includes(key)) { row.element.remove(); this.rows.delete(key); }
    ordered.forEach((car, k) => {
      let row = this.rows.get(keys[k]);
      if (!row) this.rows.set(keys[k], row = this.#row(car.car));
      this.#fill(row, car);
      const list = $("fleet-rows");
      if (list.children[k] !== row.element) list.insertBefore(row.element, list.children[k] ?? null);
    });
    setText($("fleet-problems"), problems.join("; "));
    setText($("fleet-none"), cars.length ? "" : "No car is there.");
  }

  /** What is old looks old. */
  showAges() {
    setData($("fleet"), "old", String(!this.isFresh));
    setText($("fleet").querySelector(".old"), this.isFresh ? "" : `${age(this.link.ageMs("fleet"))} old`);
  }

  #row(name) {
    const element = make("tr");
    element.setAttribute("role", "row");
    const cells = Object.fromEntries(COLUMNS.map(([column, title]) => {
      const cell = make("td", column);
      cell.setAttribute("role", "cell");
      cell.dataset.title = title;
      return [column, cell];
    }));
    const button = make("button", "", name);
    button.type = "button";
    button.setAttribute("aria-label", `Open ${name}`);
    cells.car.append(button);
    cells.state.append(make("strong", "pill"));
    element.append(...Object.values(cells));
    element.addEventListener("click", () => this.open(name));
    return { element, cells };
  }

  #fill({ element, cells }, car) {
    const race = car.race;
    setData(element, "old", String(car.old));
    setText(cells.position, race && race.laps ? String(race.position) : "–");
    const pill = cells.state.firstChild;
    const state = car.old ? (car.age_s === null ? "silent" : "not heard") : car.state || "–";
    setText(pill, state);
    setData(pill, "mood", car.old || BAD_STATES.test(state) ? "bad" : /^(driving|limited)/.test(state) ? "good" : "plain");
    setText(cells.speed, number(car.speed_mps, 2, " m/s"));
    setText(cells.error, number(car.error_m === null ? NaN : car.error_m * 100, 1, " cm"));
    setText(cells.battery, number(car.battery_v, 1, " V") + (car.battery_trouble ? " ▲" : ""));
    setData(cells.battery, "mood", car.battery_trouble ? "bad" : "plain");
    setText(cells.link, linkWords(car));
    setData(cells.link, "mood", car.old || car.slow ? "bad" : "plain");
    setText(cells.laps, race ? `${race.laps}${race.unseen ? "~" : ""}` : "–");
    setText(cells.last, number(race?.last_s, 2, " s"));
    setText(cells.best, number(race?.best_s, 2, " s"));
    setText(cells.gap, gapWords(race));
    setText(cells.why, [car.trouble, car.battery_trouble, car.why, race?.laps && !car.old ? race.note : ""].filter(Boolean).join("; "));
  }
}

function place(car) { return car.race?.laps ? car.race.position : Infinity; }

function linkWords(car) {
  if (car.age_s === null) return "says nothing";
  const takes = Number.isFinite(car.round_trip_s) ? `, round trip ${age(car.round_trip_s * 1000)}` : "";
  return `${car.slow ? "LINK SLOW " : ""}heard ${age(car.age_s * 1000)} ago${takes}`;
}

function gapWords(race) {
  if (!race) return "–";
  if (race.laps_down) return `+${race.laps_down} lap${race.laps_down > 1 ? "s" : ""}`;
  if (race.position === 1 && race.laps) return "first";
  return race.gap_s === null ? "–" : `+${race.gap_s.toFixed(2)} s`;
}
