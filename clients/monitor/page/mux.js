// The mux as the lab's report draws it: voices in their order on the left, the one that decides lit, the output right.

import { $, age, make, number, setData, setHidden, setText } from "./look.js";

const SAYS_NO = 0;
const WORDS = {
  "e-stop": "Emergency stop", battery: "Battery", teleop: "Teleop", safety: "Safety", permit: "Permit", navigation: "Navigation",
};

class Voice {
  constructor(name) {
    this.row = make("li", "voice");
    this.name = make("b", "", WORDS[name] ?? name);
    this.age = make("span", "age");
    this.wish = make("span", "wish");
    this.reason = make("span", "reason");
    this.turn = make("span", "turn");
    this.row.append(this.name, this.age, this.wish, this.reason, this.turn);
  }

  show(voice, isWinner, isDriver) {
    const live = voice.live === true;
    setData(this.row, "tone", toneOf(voice));
    setData(this.row, "steers", String(live && !voice.caps));
    setData(this.row, "state", isWinner ? "winner" : isDriver ? "driver" : live ? "live" : "silent");
    setText(this.age, voice.age_s === null || voice.age_s === undefined ? "" : age(voice.age_s * 1000));
    setText(this.wish, live ? wish(voice) : "");
    setText(this.turn, live && !voice.caps ? angle(voice.steering_rad) : "");
    setText(this.reason, live ? because(voice.reason, voice.measure) : "silent");
  }
}

function toneOf(voice) {
  if (!voice.caps) return "go";
  return voice.speed_mps === SAYS_NO ? "stop" : "slow";
}

function wish(voice) {
  if (!voice.caps) return `${number(voice.speed_mps, 2)} m/s`;
  if (voice.speed_mps === null) return "no limit";
  return voice.speed_mps === SAYS_NO ? "stop" : `≤ ${number(voice.speed_mps, 2)} m/s`;
}

/** A reason with the number behind it and its unit, as runtime/telemetry/screen_words.py writes it. */
export function because(reason, measure) {
  if (!Number.isFinite(measure)) return reason ?? "";
  if (reason.startsWith("the scan is")) return `${reason}, ${measure.toFixed(2)} s`;
  return Math.abs(measure) < 0.005 ? reason : `${reason}, ${measure.toFixed(2)} m free`;
}

export function angle(rad) {
  if (!Number.isFinite(rad)) return "";
  const degrees = Math.abs(rad * 180 / Math.PI);
  return degrees < 0.5 ? "straight" : `${degrees.toFixed(0)}° ${rad > 0 ? "left" : "right"}`;
}

export class MuxView {
  #voices = new Map();
  #list = $("voices");

  show(status, decision) {
    const output = status.output;
    const winner = decision?.winner ?? output?.winner ?? "";
    const driver = decision?.driver ?? output?.driver ?? "";
    for (const [name, voice] of Object.entries(status.voices ?? {})) {
      let view = this.#voices.get(name);
      if (!view) {
        view = new Voice(name);
        this.#voices.set(name, view);
        this.#list.append(view.row);
      }
      view.show(voice, name === winner, name === driver);
    }
    this.#showOutput(output, decision ?? output);
  }

  #showOutput(output, said) {
    setHidden($("output-none"), Boolean(output));
    if (!output) return;
    const stands = Math.abs(output.speed_mps) < 0.005;
    setData($("output"), "state", !output.delivered || (stands && output.winner !== output.driver) ? "stop" : stands ? "stand" : said.winner === said.driver ? "go" : "slow");
    setText($("output-speed"), number(output.speed_mps, 2));
    setText($("output-steering"), angle(output.steering_rad));
    setText($("output-winner"), WORDS[said.winner] ?? "no decision");
    setText($("output-reason"), because(said.reason, said.measure));
    setText($("output-note"), output.delivered ? "" : "not delivered: no motor takes it");
  }
}
