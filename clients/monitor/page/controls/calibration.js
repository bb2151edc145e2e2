// Calibration: begins it, holds each step by the drive pad, shows what was found (clients/monitor/calibration.py).

import { $, make, number, setHidden, setText } from "../look.js";

const HELD_STAGES = ["taking", "hold", "driving"];
const STEP_STAGES = ["connecting", "ready", ...HELD_STAGES];

export class Calibration {
  #link;
  #hands;
  #now = { stage: "none" };
  #rows = "";

  constructor(link, hands) {
    this.#link = link;
    this.#hands = hands;
    $("calibration-wish").addEventListener("submit", (event) => { event.preventDefault(); this.#begin(); });
    $("calibration-drive").addEventListener("click", () => this.#drive());
    for (const word of ["skip", "discard"]) $(`calibration-${word}`).addEventListener("click", () => this.#say({ do: word }));
    $("calibration-accept").addEventListener("click", () => this.#say({ do: "accept", names: this.#accepted() }));
    $("calibration-rows").addEventListener("change", () => this.#showEnd());
    link.on("gone", () => this.show({ stage: "none" }));
  }

  show(now) {
    const drove = this.#isHeld();
    this.#now = now;
    if (drove && !this.#isHeld()) this.#hands.engage(false); // a step has ended: its hold is not for driving
    setHidden($("calibration-wish"), STEP_STAGES.includes(now.stage) || now.stage === "measured");
    setHidden($("calibration-step"), !STEP_STAGES.includes(now.stage));
    setText($("calibration-title"), now.stage === "connecting" ? "Asking the car for its settings" : now.title ?? "");
    setText($("calibration-before"), now.before ?? "");
    setText($("calibration-next"), this.#next());
    setText($("calibration-words"), now.words ?? "");
    for (const id of ["calibration-drive", "calibration-skip"]) $(id).disabled = now.stage !== "ready";
    this.#showFound(now.found ?? []);
    const notes = now.notes ?? [];
    if ($("calibration-notes").childElementCount !== notes.length) $("calibration-notes").replaceChildren(...notes.map((note) => make("li", "", note)));
    this.#showEnd();
  }

  #begin() {
    const steps = [...document.querySelectorAll('#calibration-wish [name="step"]:checked')].map((box) => box.value);
    const wheelbase = $("calibration-wheelbase").valueAsNumber;
    if (!steps.length) { setText($("calibration-words"), "Choose what to measure."); return; }
    this.#say({ do: "begin", steps, wheelbase_m: Number.isFinite(wheelbase) ? wheelbase : null });
  }

  /** The step is driven under the page's hands: from here on they are its deadman, not a wish to drive. */
  #drive() {
    $("calibration-drive").disabled = true; // a second click would end it
    this.#hands.engage(false);
    this.#say({ do: "drive" });
    this.#hands.engage(true);
  }

  #say(order) {
    if (!this.#link.say({ t: "calibrate", ...order })) setText($("calibration-words"), "There is no link to the monitor.");
  }

  #isHeld() { return HELD_STAGES.includes(this.#now.stage); }

  #next() {
    const { stage, driven } = this.#now;
    if (stage === "ready") return "The car moves by itself once you have pressed Drive and hold the drive pad, an arrow key or LB. Let go to stop it.";
    if (stage === "taking") return "Asking the car for the hand: it gives it with its e-stop off and no other operator.";
    if (stage === "hold") return "Release everything, then hold the drive pad, an arrow key or LB.";
    if (!driven) return "";
    return `Driving: ${number(driven.speed_mps, 2)} m/s asked, ${number(driven.reported_mps, 2)} m/s reported,`
      + ` ${number(driven.steering_rad, 2)} rad; ${driven.scans} scans and ${driven.reports} reports of the motor taken.`;
  }

  #showFound(found) {
    const rows = JSON.stringify(found);
    if (rows === this.#rows) return;
    this.#rows = rows;
    setHidden($("calibration-found"), !found.length);
    $("calibration-rows").replaceChildren(...found.map(rowOf));
  }

  #showEnd() {
    const { stage, file, found = [] } = this.#now;
    setHidden($("calibration-end"), stage !== "measured");
    if (stage !== "measured") return;
    const accepted = this.#accepted();
    const changes = found.some((one) => one.changes);
    setText($("calibration-file"), !changes ? "No setting has another value than before."
      : file ? `The values go into ${file}, each with its value before in a comment.`
        : "Put these lines into the car's settings file (/etc/wallride/car.toml), each under its section, and restart the car:");
    setText($("calibration-lines"), changes && !file ? linesOf(found.filter((one) => accepted.includes(one.name))) : "");
    setHidden($("calibration-accept"), !file || !changes);
    $("calibration-accept").disabled = !accepted.length;
    setText($("calibration-accept"), accepted.length === 1 ? "Write 1 value" : `Write ${accepted.length} values`);
    setText($("calibration-discard"), file && changes ? "Discard" : "Done");
  }

  #accepted() { return [...document.querySelectorAll("#calibration-rows input:checked")].map((box) => box.value); }
}

function rowOf({ name, old, new: value, words, changes }) {
  const row = make("tr");
  const choice = make("td");
  if (changes) {
    const box = make("input");
    box.type = "checkbox";
    box.value = name;
    box.checked = true;
    box.setAttribute("aria-label", `accept ${name}`);
    choice.append(box);
  }
  const setting = make("td");
  setting.append(make("code", "", name));
  row.append(choice, setting, make("td", "", String(old)), make("td", "", changes ? String(value) : "as before"), make("td", "", words));
  return row;
}

/** The accepted values as they stand in a settings file. */
function linesOf(found) {
  const sections = new Map();
  for (const { name, new: value } of found) {
    const dot = name.lastIndexOf(".");
    const section = name.slice(0, dot);
    sections.set(section, [...(sections.get(section) ?? []), `${name.slice(dot + 1)} = ${value}`]);
  }
  return [...sections].map(([section, lines]) => [`[${section}]`, ...lines].join("\n")).join("\n\n");
}
