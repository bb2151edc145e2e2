// Everything else that answers "why is it (not) moving": devices, window, battery, faults, operator, link.

import { windowWords } from "./beams.js";
import { $, age, announce, make, number, setData, setHidden, setText } from "./look.js";
import { because } from "./mux.js";

export const START = "Start one: make sim here, or wallride run on the car.";

const STATE_MOODS = { driving: "good", "waiting for device": "bad", "e-stopped": "bad", "fault (latched)": "bad" };
const POSE_MOODS = { located: "good", ambiguous: "warn", lost: "bad" };
const LOW_CELL_V = 3.4;
const EMPTY_CELL_V = 3.2;
const CELL_V = [[18, 6], [13.5, 4], [9.2, 3], [0, 2]];
const PLAYED = "A recording is played here; nothing drives.";

export class Condition {
  /** onBound: called when safety binds the operator from now on. */
  constructor(link, device, onBound) {
    this.link = link;
    this.device = device;
    $("bind").addEventListener("click", () => this.#bind(onBound));
  }

  showStatus(status) {
    this.#device("lidar", status.lidar);
    this.#device("motor", status.motor);
    const window = status.window ?? [];
    this.#line("window", window.length ? "warn" : "good", window.length ? windowWords(window) : "none");
    setHidden($("line-pose"), !status.pose?.map);
    if (status.pose?.map) this.#line("pose", POSE_MOODS[status.pose.whereabouts] ?? "plain", poseWords(status.pose));
    setHidden($("line-race"), !status.pose?.race);
    if (status.pose?.race) this.#line("race", "plain", raceWords(status.pose.race));
    this.#line("own-parts", "plain", ownPartsWords(status.own_parts?.patches ?? []));
    this.#line("fault", status.fault ? "bad" : "good", status.fault || "none");
    this.#battery(status.battery);
    this.#line("computer", status.computer?.trouble ? "bad" : "plain", computerWords(status.computer ?? {}));
    this.#operator(status.operator, status.overruled, status.voices);
    const gates = Object.entries(status.gates ?? {}).filter(([, reason]) => reason);
    this.#line("gates", gates.length ? "warn" : "good", gates.length ? gates.map(([name, reason]) => `${name}: ${reason}`).join("; ") : "all open");
    this.#line("software", "plain", `wallride ${status.version ?? "?"}, up ${age((status.up_s ?? 0) * 1000)}`);
    this.#line("recording", recordingMood(status.recording), recordingWords(status.recording));
    const { state = status.state, reason, measure, clears } = status.condition ?? {};
    const isPlayed = this.link.newest.monitor.value?.recording;
    setData($("state"), "state", isPlayed ? "recording" : String(state ?? ""));
    setText($("state"), isPlayed ? "recording" : state ?? "–");
    this.#line("clears", STATE_MOODS[state] ?? "warn", clears ? `${because(reason, measure)}; cleared by: ${this.device.clears(state, clears)}` : state ?? "unknown");
    const output = status.output;
    this.#overruled(status.overruled);
    const why = output ? `${output.winner}: ${because(output.reason, output.measure)}` : "nothing has been decided yet";
    setText($("why"), isPlayed ? `${PLAYED} Then: ${why}` : why);
  }

  /** Says when safety would stop the human whom it does not bind, and offers to let it. */
  #overruled(overruled) {
    setHidden($("overruled"), !overruled);
    if (overruled) setText($("overruled-words"), `Safety says “${overruled.reason}”. It does not bind you.`);
  }

  async #bind(onBound) {
    try {
      await this.link.ask("param/set", { values: { "safety.binds_teleop": true } });
      announce("Safety binds you from now on (safety.binds_teleop).", "good");
      onBound();
    } catch (error) {
      announce(error.message, "bad");
    }
  }

  /** Runs even when nothing arrives: ages grow by themselves. */
  showAges(monitor, nowMs) {
    const { link } = this;
    const beatMs = link.ageMs("beat", nowMs);
    const pages = link.open ? "" : "no link to the monitor";
    const toCar = Number.isFinite(monitor?.round_trip_s) ? monitor.round_trip_s * 1000 : NaN;
    const away = monitor && !monitor.here;
    const words = pages || (monitor?.problem ? "no car" : monitor?.link_problem ? "no link to the car" : away ? "the car is away" : "");
    const fresh = link.open && beatMs < 500;
    if (link.open && monitor?.recording && !words) {
      this.#sayPlayed();
      setText($("round-trip"), "–");
      return;
    }
    if (!fresh) this.#sayWhatIsMissing(pages, monitor, away);
    setData($("link"), "mood", words || !fresh ? "bad" : beatMs > 200 ? "warn" : "good");
    setText($("link-age"), words || (Number.isFinite(beatMs) ? `heard ${age(beatMs)} ago` : "not heard"));
    setText($("round-trip"), fresh ? number(toCar + link.roundTripMs, 1, " ms") : "–");
  }

  /** A recording has no heartbeat, and its state is of the time of its drive. */
  #sayPlayed() {
    if (!this.link.newest.status.value) {
      setData($("state"), "state", "recording");
      setText($("state"), "recording");
      setText($("why"), PLAYED);
    }
    setData($("link"), "mood", "good");
    setText($("link-age"), "recording");
  }

  /** Instead of a state that is old: what is not there, and what to start. */
  #sayWhatIsMissing(pages, monitor, away) {
    const why = pages ? this.link.goodbye || `${pages}: is wallride monitor still running?`
      : monitor?.problem || (away ? `${monitor.watching || "The car"} is not there. ${START}` : monitor?.link_problem || "");
    if (!why) return;
    setData($("state"), "state", "no car");
    setText($("state"), !pages ? "no car" : this.link.goodbye ? "ended" : "no link");
    setText($("why"), why);
  }

  #device(name, device) {
    if (!device) return;
    const mood = device.link === "ready" ? "good" : device.link === "starting" ? "warn" : "bad";
    const troubles = Object.entries(device.counts ?? {}).filter(([, times]) => times).map(([what, times]) => `${times} ${what.replaceAll("_", " ")}`);
    const words = [device.link, device.message].filter(Boolean).join(": ");
    this.#line(name, mood, words + (troubles.length ? `; ${mood === "good" ? "recovered since the start" : "since the start"}: ${troubles.join(", ")}` : ""));
  }

  #battery(battery) {
    const volts = battery?.voltage_v;
    const cells = battery?.cells ?? (Number.isFinite(volts) ? CELL_V.find(([least]) => volts > least)?.[1] ?? 2 : 0);
    const each = volts / cells;
    const mood = battery?.trouble ? "bad" : !cells ? "plain" : each < EMPTY_CELL_V ? "bad" : each < LOW_CELL_V ? "warn" : "good";
    setData($("battery"), "mood", mood);
    setText($("battery-volts"), number(volts, 1, " V"));
    this.#line("battery-line", mood, battery ? `${number(volts, 2)} V (${number(each, 2)} V a cell), ${number(battery.current_a, 1)} A${batteryWords(battery)}` : "unknown");
  }

  #operator(operator, overruled, voices) {
    if (!operator) { this.#line("operator", "plain", "no operator's side"); return; }
    const stops = [...new Set(Object.values(operator.e_stop ?? {}))];
    const lost = operator.standing === "operator lost";
    const page = this.link.newest.pilot.value?.whose;
    const name = operator.operator && (page === "this page" || page === "another page") ? `${operator.operator} on ${page}` : operator.operator;
    const parts = [
      lost ? `not operated, ${operator.operator || this.link.newest.beat.operatorName || "the operator"} was lost` : name || "not operated",
      lost || operator.standing === "nobody" ? "" : operator.standing,
      lost && /lost/.test(operator.reason) ? "" : operator.reason, ...stops,
      name && !lost && !bindsHuman(voices) ? "not bound by safety" : "",
      Number.isFinite(operator.round_trip_s) ? `round trip ${(operator.round_trip_s * 1000).toFixed(0)} ms` : "",
      operator.permit?.startsWith("permit ") ? operator.permit : operator.permit ? `permit: ${operator.permit}` : "",
    ];
    const mood = stops.length || lost || overruled ? "bad" : operator.reason ? "warn" : "good";
    const told = parts.filter(Boolean);
    this.#line("operator", mood, told.filter((part) => !told.some((other) => other !== part && other.endsWith(part))).join(", "));
  }

  #line(name, mood, words) {
    const line = $(`line-${name}`);
    setData(line, "mood", mood);
    setText(line.lastElementChild, words);
  }
}

function computerWords({ temperature_c: warm, zone, trouble }) {
  if (zone === undefined) return "not watched by this car";
  const warmth = Number.isFinite(warm) ? `${number(warm, 0)} °C (${zone})` : "no temperature sensor here";
  return `${warmth}; ${trouble || "no throttling reported"}`;
}

function batteryWords({ sag_v: sag, trouble }) {
  return (Number.isFinite(sag) ? `, at least ${number(sag, 1)} V under load` : "") + (trouble ? `; ${trouble}` : "");
}

/** Whether safety limits a human, too: the voices come in the mux's order. */
export function bindsHuman(voices) {
  const names = Object.keys(voices ?? {});
  return names.indexOf("safety") < names.indexOf("teleop");
}

/** The recorder says in a sentence how it stands; what is lost, it says in capitals or by name. */
function recordingMood(recording) {
  if (/^NOT recording|too slow/.test(recording?.words ?? "")) return "bad";
  return recording?.on ? "good" : "plain";
}

function recordingWords(recording) {
  if (!recording?.words) return "unknown";
  const file = recording.on ? recording.file?.split("/").at(-1) : "";
  return file ? `${recording.words} (${file}, ${number(recording.written_mb, 1, " MB")})` : recording.words;
}

/** Lists the cars. */
export function showCars(select, cars, watching) {
  const names = watching && !cars.includes(watching) ? [...cars, watching] : cars;
  const before = [...select.options].map((option) => option.value).join();
  if (before !== names.join()) select.replaceChildren(...names.map((name) => make("option", "", name)));
  if (watching && select.value !== watching) select.value = watching;
  setHidden(select, names.length === 0);
}

function poseWords(pose) {
  if (pose.whereabouts === "ambiguous") return `on ${pose.map}: these places look alike: ${pose.alike.map(([x, y]) => `x ${number(x, 1)} m, y ${number(y, 1)} m`).join("; ")}`;
  if (pose.whereabouts !== "located") return `on ${pose.map}: ${pose.whereabouts === "lost" ? "lost, it is looked for everywhere" : "being looked for"}`;
  const fits = pose.fits === null ? "" : `, ${number(100 * pose.fits, 0)} % of the beams fit`;
  return `on ${pose.map}: x ${number(pose.x_m, 2)} m, y ${number(pose.y_m, 2)} m, ${number((180 / Math.PI) * pose.yaw_rad, 0)}°, known to ${number(100 * pose.std_m, 0)} cm${fits}`;
}

function raceWords({ laps, time_s: last, best_s: best, rms_m: rms, p99_m: p99, began_s: began, speed_share: share }) {
  const speed = `at ${number(100 * share, 0)} % of the line's speed`;
  const now = Number.isFinite(began) ? `lap ${laps + 1}, ${speed}` : `not on the line yet; lap ${laps + 1} will be ${speed}`;
  return laps ? `${now}; the last one ${number(last, 2)} s, the best ${number(best, 2)} s; ${number(100 * rms, 1)} cm from the line (rms), ${number(100 * p99, 0)} cm in 99 % of it` : now;
}

function ownPartsWords(patches) {
  return patches.length ? patches.map((part) => `${part.bearing_deg}° at ${part.range_m} m`).join(", ") : "none known";
}
