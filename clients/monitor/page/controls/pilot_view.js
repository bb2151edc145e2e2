// What the drive panel says: who operates, what to do next, in the names of what this device has.

import { HELD } from "./driving.js";
import { START } from "../condition.js";
import { $, setData, setHidden, setText } from "../look.js";

const GONE_MS = 5000; // a car that was not heard for so long, and is not announced any more, has ended

export class PilotView {
  #announced = "";

  constructor(link, hands, device) {
    this.link = link;
    this.hands = hands;
    this.device = device;
  }

  show(pilot) {
    const { link, hands, device } = this;
    setData($("driving"), "mood", hands.engaged ? pilot.mood : "off");
    const { beat } = link.newest;
    const idle = beat.latched ? `E-stop: the car is held. Switch Drive on, then ${device.named("hold {reset}")} for 1 s.` : this.#operatedBy(beat, pilot.whose);
    const missing = pilot.stop_pending ? "" : this.#whatIsMissing();
    setText($("pilot-state"), missing ? "no car" : hands.engaged || pilot.stop_pending ? pilot.state : "watching");
    setText($("pilot-next"), missing || (hands.engaged || pilot.stop_pending ? device.named(pilot.next) : idle));
    setData(document.body, "other", String(Boolean(beat.present && pilot.whose && pilot.whose !== "this page")));
    if (this.#announced !== (this.#announced = $("pilot-state").textContent)) setText($("pilot-said"), this.#announced);
    $("driving").style.setProperty("--progress", String(pilot.progress ?? 0));
    for (const [id, what] of Object.entries(HELD)) setData($(id), "held", String(hands.isHeld(what)));
    if (device.look(hands.pads)) this.showDevice();
  }

  /** Nothing more comes from the server: what it said last of driving, and of ages, does not hold any more. */
  showNone() {
    const { link } = this;
    setData($("driving"), "mood", "off");
    setText($("pilot-state"), link.goodbye ? "ended" : "no link");
    setText($("pilot-next"), link.goodbye || `${link.open ? "The monitor is not heard" : "No link to the monitor"}: this page does not drive.`);
  }

  /** What to do where a car ended or its link is gone, "" while there is one. */
  #whatIsMissing() {
    const { link } = this;
    const monitor = link.newest.monitor.value;
    if (monitor?.recording) return "A recording is played here: there is no car to drive.";
    if (link.ageMs("beat") < GONE_MS || !monitor || (monitor.here && !monitor.problem)) return "";
    return `No car to drive: it ended, or its link is gone. ${START}`;
  }

  #operatedBy(beat, whose) {
    const who = beat.operatorName || "an operator";
    if (this.link.ageMs("beat") > GONE_MS) return "No car to drive.";
    if (beat.lost) return `Not operated: ${who} was lost. Switch Drive on to take control.`;
    if (!beat.present) return "Not operated. Switch Drive on to take control.";
    return whose === "another page" ? `${who} operates, on another page.` : `${who} operates.`;
  }

  /** Names what this device has: keys, a gamepad, or fingers. */
  showDevice() {
    const { device } = this;
    for (const [id, what] of Object.entries(HELD)) setText($(id).querySelector("small"), device.hold(what));
    setText($("pad-name"), device.padWords);
    setHidden($("pad-name"), !device.padWords);
    setText($("drive-keys"), device.keys ? " Arrow keys or W A S D drive while held." : " Hold the pad and pull to drive.");
    $("touch").setAttribute("aria-label", device.keys
      ? "Drive pad: hold and pull to drive, let go to stop. With the keyboard: hold the arrow keys or W A S D."
      : "Drive pad: hold and pull to drive, let go to stop.");
  }
}
