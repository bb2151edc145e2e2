// The map of a lap: made of the car's newest recording, shown with its verdict, and raced along (clients/monitor/lap_mapper.py).

import { $, announce, make, setData, setHidden, setText } from "../look.js";

const SAID_KINDS = { good: "good", saved: "good", refused: "bad", failed: "bad" };
const ALTS = { map: "The map of the lap, with its path and the places at which it closes", line: "The race line, coloured by its speed" };

export class LapMap {
  #link;
  #stage = "none";
  #sense = { sense: "", closed: false };
  #wasClosed = true; // a lap that was closed before this page came is told by the row alone
  #words = "";
  #pictures = "";
  #asked = 0; // number of the map for whose line the speed is filled in

  constructor(link) {
    this.#link = link;
    for (const word of ["begin", "cancel"]) $(`lap-map-${word}`).addEventListener("click", () => this.#say({ do: word }));
    $("lap-map-race").addEventListener("click", () => this.#race());
    link.on("gone", () => { this.#stage = "none"; $("lap-map-begin").disabled = $("lap-map-race").disabled = true; });
  }

  /** now: the fields of clients/monitor/lap_map.py. */
  show(now) {
    const stage = now.is_refused ? "refused" : now.stage; // a good map along which the car does not race
    setData($("lap-map"), "stage", stage);
    $("lap-map-begin").disabled = now.busy;
    setText($("lap-map-begin"), now.number ? "Make it again" : "Make the map");
    setHidden($("lap-map-cancel"), !now.busy);
    setHidden($("lap-map-race"), !now.can_be_raced);
    setHidden($("lap-map-speed"), !now.can_be_raced);
    if (now.number !== this.#asked && now.can_be_raced) {
      $("lap-map-speed").firstElementChild.value = now.fastest_mps.toFixed(1); // a new line: as fast as it is
      this.#asked = now.number;
    }
    $("lap-map-race").disabled = now.busy;
    setText($("lap-map-lines"), now.lines);
    this.#sense = now;
    this.showSense();
    if (now.closed && !this.#wasClosed && !$("line-lap").hidden) announce(now.sense, "good");
    this.#wasClosed = now.closed;
    this.#showWords(now.words);
    this.#showPictures(now);
    if (stage !== this.#stage && this.#stage !== "none" && SAID_KINDS[stage]) announce(now.words[0], SAID_KINDS[stage]);
    this.#stage = stage;
  }

  /** How the lap that is driven stands: for who drives it, outside of the folded panel too. */
  showSense() {
    const { sense, closed } = this.#sense;
    const races = Boolean(this.#link.newest.status.value?.pose?.map);
    setHidden($("line-lap"), !sense || races);
    setData($("line-lap"), "mood", closed ? "good" : "plain");
    setText($("line-lap").lastElementChild, sense);
    setText($("lap-map-sense"), races ? "" : sense);
  }

  #race() {
    const speed = $("lap-map-speed").firstElementChild;
    if (speed.reportValidity()) this.#say({ do: "race", speed_mps: speed.valueAsNumber });
  }

  #say(words) {
    if (!this.#link.say({ t: "map_lap", ...words })) announce("There is no link to the monitor.", "bad");
  }

  #showWords(words) {
    const said = words.join("\n");
    if (said === this.#words) return;
    this.#words = said;
    $("lap-map-words").replaceChildren(...words.map((sentence) => make("li", "", sentence)));
  }

  #showPictures({ pictures, number }) {
    const shown = `${number} ${pictures}`;
    if (shown === this.#pictures) return;
    this.#pictures = shown;
    $("lap-map-pictures").replaceChildren(...pictures.map((name) => {
      const picture = make("img");
      picture.alt = ALTS[name] ?? name;
      picture.src = `lap-map/${name}.png${location.search}&number=${number}`;
      return picture;
    }));
  }
}
