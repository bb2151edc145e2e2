// The live parameters: what takes effect now, as sliders; undo, save, and the car's own words when it refuses.
// What is shown is what the car answered, never what was typed.

import { $, announce, make, setHidden, setText, withdraw } from "./look.js";

const SET_EVERY_MS = 200;
const REFRESH_MS = 10000;
const OPEN_FIRST = ["wall_follow"];
const STEPS = 200;
const QUANTITIES = { m: "distance", s: "time", "m/s": "speed", rad: "angle" };
const UNIT_ENDING = /_(m|s|ms|mps|mps2|rad|radps|hz|a|v)$/;

export class Settings {
  #link;
  #rows = new Map();
  #undo = [];
  #unsaved = [];
  #onCar;

  /** onCar(values): told what the car's geometry is. */
  constructor(link, onCar) {
    this.#link = link;
    this.#onCar = onCar;
    $("settings").addEventListener("toggle", () => { if ($("settings").open) this.refresh(); });
    $("settings-filter").addEventListener("input", () => this.#filter());
    $("settings-undo").addEventListener("click", () => this.#undoLast());
    $("settings-save").addEventListener("click", () => this.#save());
    setInterval(() => { if ($("settings").open && !document.hidden) this.refresh(); }, REFRESH_MS);
  }

  /** Another car: nothing of the last one holds. */
  forget() {
    this.#rows.clear();
    this.#undo.length = 0;
    this.#unsaved = [];
    $("settings-list").replaceChildren();
    this.#showButtons();
  }

  /** Asks the car anew; the answer also tells where its lidar is. */
  async refresh() {
    try {
      const { parameters, unsaved } = await this.#link.ask("param/list");
      this.#unsaved = unsaved ?? this.#unsaved;
      this.#showButtons();
      this.#onCar(Object.fromEntries(parameters.filter(({ name }) => name.startsWith("car.")).map(({ name, value }) => [name, value])));
      if (!$("settings").open) return; // a hundred hidden rows would take a tenth of a second
      this.#show(parameters.filter(({ takes_effect: when, type }) => when !== "restart" && type !== "text" && type !== "list"));
      setText($("settings-trouble"), "");
    } catch (error) {
      if ($("settings").open) setText($("settings-trouble"), error.message);
    }
  }

  #show(parameters) {
    const names = new Set(parameters.map(({ name }) => name));
    if ([...this.#rows.keys()].some((name) => !names.has(name)) || parameters.some(({ name }) => !this.#rows.has(name))) this.#build(parameters);
    for (const parameter of parameters) this.#rows.get(parameter.name).take(parameter.value);
  }

  #build(parameters) {
    this.#rows.clear();
    const groups = new Map();
    const titles = titlesOf(parameters);
    for (const parameter of parameters) {
      const group = groupOf(parameter);
      if (!groups.has(group)) {
        const details = make("details", "group");
        details.open = OPEN_FIRST.includes(group);
        details.append(make("summary", "", group));
        groups.set(group, details);
      }
      const row = new Row(parameter, titles.get(parameter.name), (value) => this.#set(parameter.name, value));
      this.#rows.set(parameter.name, row);
      groups.get(group).append(row.element);
    }
    $("settings-list").replaceChildren(...groups.values());
    this.#filter();
  }

  /** Resolves to what the car has now, undefined when it refused. */
  async #set(name, value, undone) {
    let has;
    try {
      const { changed, unsaved } = await this.#link.ask("param/set", { values: undone ?? { [name]: value } });
      if (!undone && changed.length) this.#remember(name, changed);
      this.#unsaved = unsaved;
      has = changed.find((change) => change.name === name)?.new ?? await this.#read(name);
      this.#rows.get(name)?.settle(has);
      withdraw("bad");
      if (changed.some((change) => change.name !== name)) this.refresh();
    } catch (error) {
      this.#rows.get(name)?.refuse(error.message);
      announce(error.message, "bad");
    }
    this.#showButtons();
    return has;
  }

  async #read(name) { return (await this.#readAll([name]))[name]; }

  async #readAll(names) { return (await this.#link.ask("param/get", { names })).values; }

  /** One drag of a slider is one step to undo, and so is a method with the settings that it changed. */
  #remember(name, changed) {
    const last = this.#undo.at(-1);
    const nowMs = performance.now();
    const valuesOf = (which) => Object.fromEntries(changed.filter((one) => one[which] !== null).map((one) => [one.name, one[which]]));
    if (last && last.name === name && nowMs - last.ms < 1000) Object.assign(last, { ms: nowMs, set: valuesOf("new") });
    else this.#undo.push({ name, had: valuesOf("old"), set: valuesOf("new"), ms: nowMs });
    if (this.#undo.length > 100) this.#undo.shift();
  }

  async #undoLast() {
    const last = this.#undo.at(-1);
    if (!last) return;
    if (await this.#isChangedSince(last)) {
      this.#undo.splice(this.#undo.indexOf(last), 1);
      this.#showButtons();
      announce(`${last.name} was changed since, and is left as it is`, "bad");
      return;
    }
    const has = await this.#set(last.name, last.had[last.name], last.had);
    if (has === undefined) return; // refused: it can be tried again, for example when the car stands
    this.#undo.splice(this.#undo.indexOf(last), 1);
    this.#showButtons();
    announce(`${last.name} is ${has} again`);
  }

  /** Whether another program, or a later step, has set what a step set: that is not undone with it. */
  async #isChangedSince({ set }) {
    try {
      const now = await this.#readAll(Object.keys(set));
      return Object.entries(set).some(([name, value]) => now[name] !== value);
    } catch {
      return true; // a law that was exchanged took its settings with it
    }
  }

  async #save() {
    try {
      const { saved, file } = await this.#link.ask("param/save");
      this.#unsaved = this.#unsaved.filter((name) => !saved.includes(name));
      announce(saved.length ? `saved to ${file}: ${saved.join(", ")}` : "nothing to save", "good");
    } catch (error) {
      announce(error.message, "bad");
    }
    this.#showButtons();
  }

  #showButtons() {
    const last = this.#undo.at(-1);
    $("settings-undo").disabled = !last;
    setText($("settings-undo"), last ? `Undo ${last.name.split(".").at(-1)}` : "Undo");
    $("settings-save").disabled = this.#unsaved.length === 0;
    setText($("settings-save"), this.#unsaved.length ? `Save ${this.#unsaved.length} change${this.#unsaved.length > 1 ? "s" : ""}` : "Save");
  }

  #filter() {
    const words = $("settings-filter").value.trim().toLowerCase().split(/\s+/).filter(Boolean);
    let found = 0;
    for (const [name, row] of this.#rows) {
      const shown = words.every((word) => `${name} ${row.text}`.toLowerCase().includes(word));
      setHidden(row.element, !shown);
      found += Number(shown);
    }
    const none = words.length && this.#rows.size && !found;
    setText($("settings-none"), none ? `No setting has “${words.join(" ")}”. Here is what takes effect at once; the rest is in the car's file.` : "");
    for (const group of $("settings-list").children) {
      const shown = [...group.querySelectorAll(".setting")].some((row) => !row.hidden);
      setHidden(group, !shown);
      if (words.length && shown) group.open = true;
    }
  }
}

/** One setting: a slider and a number, a switch, or a choice. */
class Row {
  #parameter;
  #set;
  #inputs = [];
  #sentMs = -Infinity;
  #timer = 0;
  #waiting;
  #busyUntilMs = -Infinity;

  constructor(parameter, title, set) {
    this.#parameter = parameter;
    this.#set = set;
    const { name, description, range, default: usual, takes_effect: when } = parameter;
    const words = [when === "standing" ? "[while standing]" : "", description].filter(Boolean).join(" ");
    const limits = `${range}, default ${usual}`;
    this.text = `${title} ${words} ${limits}`;
    this.element = make("div", "setting");
    const id = `setting-${name}`;
    const label = make("label", "", title);
    label.htmlFor = id;
    const hint = make("p", "hint", words);
    hint.id = `${id}-hint`;
    const limit = make("p", "hint range", limits);
    limit.id = `${id}-range`;
    this.trouble = make("p", "trouble");
    this.trouble.id = `${id}-trouble`;
    this.element.append(label, make("code", "name", name), this.#control(id), hint, limit, this.trouble);
    for (const input of this.#inputs) input.setAttribute("aria-describedby", `${hint.id} ${limit.id} ${this.trouble.id}`);
  }

  /** Shows what the car says, unless a hand is on it. */
  take(value) {
    if (this.#waiting !== undefined || performance.now() < this.#busyUntilMs) return;
    if (value !== this.#parameter.value) setText(this.trouble, "");
    this.#parameter.value = value;
    this.#display(value);
  }

  /** The car took a value, and has this one now; while a newer one waits to be sent, that one stays on show. */
  settle(value) {
    this.#parameter.value = value;
    setText(this.trouble, "");
    if (this.#waiting === undefined) this.#display(value);
  }

  refuse(reason) {
    setText(this.trouble, reason);
    this.#waiting = undefined;
    this.#display(this.#parameter.value);
  }

  #display(value) {
    setHidden(this.back, value === this.#parameter.default);
    for (const input of this.#inputs) {
      if (input.type === "checkbox") input.checked = value;
      else input.value = String(value);
    }
  }

  #control(id) {
    const { type, unit, default: usual } = this.#parameter;
    const box = make("div", "control");
    if (type === "boolean") this.#inputs.push(this.#input("checkbox", () => this.#inputs[0].checked));
    else if (type === "choice") this.#inputs.push(this.#choice());
    else this.#inputs.push(...this.#numbers());
    this.#inputs.at(-1).id = id;
    box.append(...this.#inputs);
    if (unit && unit !== "1") box.append(make("span", "unit", unit));
    const back = this.back = make("button", "quiet", "reset to default");
    back.type = "button";
    back.title = `reset ${this.#parameter.name} to ${usual}`;
    back.setAttribute("aria-label", `reset to default ${usual}: ${this.#parameter.name}`);
    back.addEventListener("click", () => { this.#display(usual); this.#send(usual); });
    box.append(back);
    this.#display(this.#parameter.value);
    return box;
  }

  #numbers() {
    const { lowest, highest, type, default: usual } = this.#parameter;
    const whole = type === "integer";
    const field = this.#input("number", () => field.valueAsNumber);
    field.step = whole ? "1" : "any";
    if (lowest === null || highest === null) return [field];
    // A range of 0 to 50 around 0.3 would be useless: the slider reaches a few times the usual value, the field all of it.
    const most = usual > 0 ? Math.min(highest, Math.max(usual * 4, this.#parameter.value)) : highest;
    const slider = make("input");
    slider.type = "range";
    slider.min = lowest;
    slider.max = most;
    slider.step = whole ? 1 : fine((most - lowest) / STEPS);
    slider.setAttribute("aria-label", this.#parameter.name);
    slider.addEventListener("input", () => { field.value = slider.value; this.#send(slider.valueAsNumber); });
    field.min = lowest;
    field.max = highest;
    return [slider, field];
  }

  #input(type, value) {
    const input = make("input");
    input.type = type;
    input.addEventListener("change", () => {
      const wanted = value();
      if (Number.isNaN(wanted)) this.refuse("not a number");
      else { this.#display(wanted); this.#send(wanted); }
    });
    if (type === "checkbox") input.addEventListener("keydown", (event) => { if (event.key === "Enter") input.click(); }); // Space is STOP
    return input;
  }

  #choice() {
    const select = make("select");
    for (const word of this.#parameter.allowed) select.append(make("option", "", word));
    select.addEventListener("change", () => this.#send(select.value));
    return select;
  }

  /** Sends the newest value, at most five times a second while a slider moves. */
  #send(value) {
    const nowMs = performance.now();
    this.#busyUntilMs = nowMs + 1500;
    this.#waiting = value;
    clearTimeout(this.#timer);
    const wait = Math.max(0, this.#sentMs + SET_EVERY_MS - nowMs);
    this.#timer = setTimeout(() => {
      this.#sentMs = performance.now();
      const wanted = this.#waiting;
      this.#waiting = undefined;
      if (wanted !== undefined) this.#set(wanted);
    }, wait);
  }
}

/** The title of each setting; those of one group that differ in their unit alone say what they measure. */
function titlesOf(parameters) {
  const place = (parameter) => `${groupOf(parameter)}: ${titleOf(parameter)}`;
  const times = new Map();
  for (const parameter of parameters) times.set(place(parameter), (times.get(place(parameter)) ?? 0) + 1);
  return new Map(parameters.map((parameter) => {
    const title = titleOf(parameter), { name, unit } = parameter;
    return [name, times.get(place(parameter)) > 1 ? `${title} ${QUANTITIES[unit] ?? unit}` : title];
  }));
}

function groupOf({ name }) { return name.slice(0, name.lastIndexOf(".")); }

/** What a person calls it: the unit stands beside the value already. */
function titleOf({ name, unit }) {
  const key = name.split(".").at(-1);
  return (unit && unit !== "1" ? key.replace(UNIT_ENDING, "") : key).replaceAll("_", " ");
}

/** Rounds a step down to 1, 2 or 5 times a power of ten, so that sliders stop at numbers that people write. */
function fine(step) {
  const power = 10 ** Math.floor(Math.log10(step));
  const digit = step / power >= 5 ? 5 : step / power >= 2 ? 2 : 1;
  return Number((digit * power).toPrecision(3));
}
