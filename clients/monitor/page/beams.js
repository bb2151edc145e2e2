// What is wrong with single beams: which ones safety leaves out and why, and where the lidar's window is dirty or
// covered. The car says the first as points (footprint, "ignored") and the second in words (status, "window").

export const ECHO = 0, OWN = 1, DIRT = 2, STRAY = 3;
/** Beyond this nothing is taken for dirt (runtime/control/perception/view.py). */
const DIRT_WITHIN_M = 0.9;
const ON_THE_CAR_M = 0.01;
const LASTS_MS = 1000;
const NARROWEST_RAD = 0.02;
const SENTENCE = /^(\d+) beams around (-?\d+) deg ((are dirty|see nothing|see the car itself).*)/;
const KINDS = { "are dirty": "dirty", "see nothing": "covered", "see the car itself": "own" };

export class Beams {
  /** Why each beam of the newest scan is left out; ECHO where it is not. */
  why = new Uint8Array(0);
  /** Sectors of the window that the car complains about: { kind, from, to }, bearings in radians, left positive. */
  sectors = [];
  #seenMs = -Infinity;
  #words = "";

  /** Takes the points that safety leaves out, in base_link; lidar: where that is in base_link. */
  takeIgnored(markers, scan, lidar, nowMs) {
    const ignored = markers.find("ignored"), car = markers.find("car");
    if (!ignored || !scan.n) return;
    if (this.why.length === scan.n) this.why.fill(ECHO);
    else this.why = new Uint8Array(scan.n);
    this.#seenMs = nowMs;
    for (let i = 0; i < ignored.n; i++) {
      const x = ignored.xy[2 * i], y = ignored.xy[2 * i + 1];
      const bearing = Math.atan2(y - lidar.y, x - lidar.x), beam = Math.round((bearing - scan.angleMin) / scan.step);
      if (beam < 0 || beam >= scan.n) continue;
      if (Math.hypot(x - lidar.x, y - lidar.y) >= DIRT_WITHIN_M) this.why[beam] = STRAY;
      else this.why[beam] = isOnCar(car, x, y) || this.#isOwn(bearing) ? OWN : DIRT;
    }
  }

  #isOwn(bearing) { return this.sectors.some(({ kind, from, to }) => kind === "own" && from <= bearing && bearing <= to); }

  /** Takes the car's sentences about its window; stepRad: between two beams. */
  takeWindow(sentences, stepRad) {
    const words = sentences.join();
    if (words === this.#words || !stepRad) return false;
    this.#words = words;
    this.sectors = [];
    for (const sentence of sentences) {
      const found = SENTENCE.exec(sentence);
      if (!found) continue;
      const middle = (found[2] * Math.PI) / 180;
      const half = Math.max(NARROWEST_RAD, Math.abs(found[1] * stepRad) / 2);
      this.sectors.push({ kind: KINDS[found[4]], from: middle - half, to: middle + half });
    }
    return true;
  }

  /** What was said too long ago says nothing about this scan. */
  expire(nowMs, n) {
    if (this.why.length !== n) this.why = new Uint8Array(n);
    else if (nowMs - this.#seenMs > LASTS_MS) this.why.fill(ECHO);
  }

  count(why) {
    let sum = 0;
    for (const one of this.why) sum += one === why;
    return sum;
  }
}

/** Says each complaint once, with all places where it holds. */
export function windowWords(sentences) {
  const places = new Map(), others = [];
  for (const sentence of sentences) {
    const found = SENTENCE.exec(sentence);
    if (!found) { others.push(sentence); continue; }
    places.set(found[3], [...places.get(found[3]) ?? [], `${found[1]} at ${found[2].replace("-", "−")}°`]);
  }
  return [...others, ...[...places].map(([complaint, where]) => `beams ${complaint} (${where.join(", ")})`)].join("; ");
}

function isOnCar(car, x, y) {
  if (!car?.n) return false;
  let front = -Infinity, rear = Infinity, side = 0;
  for (let i = 0; i < car.n; i++) {
    front = Math.max(front, car.xy[2 * i]);
    rear = Math.min(rear, car.xy[2 * i]);
    side = Math.max(side, Math.abs(car.xy[2 * i + 1]));
  }
  return x <= front + ON_THE_CAR_M && x >= rear - ON_THE_CAR_M && Math.abs(y) <= side + ON_THE_CAR_M;
}
