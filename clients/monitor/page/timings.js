// Latency from the measurement to the pixels: window.wallride.timings.

const KEPT = 2048;

export class Timings {
  /** Milliseconds since 1970: when the scan was stamped, when its bytes were here, when the frame with it was done. */
  stampedMs = new Float64Array(KEPT);
  receivedMs = new Float64Array(KEPT);
  drawnMs = new Float64Array(KEPT);
  count = 0;
  stopMs = NaN;
  #pending = -1;
  #channel = new MessageChannel();
  #done = -1;

  constructor() {
    // A message posted while a frame is being made is handled when that frame has been painted.
    this.#channel.port1.onmessage = () => { if (this.#done >= 0) this.drawnMs[this.#done] = now(); };
  }

  received(stampS) {
    const i = this.count++ % KEPT;
    this.stampedMs[i] = stampS * 1000;
    this.receivedMs[i] = now();
    this.drawnMs[i] = NaN;
    this.#pending = i;
  }

  drawn() {
    if (this.#pending < 0) return;
    this.#done = this.#pending;
    this.#pending = -1;
    this.#channel.port2.postMessage(0);
  }

  stopped(ms) { this.stopMs = performance.timeOrigin + ms; }

  /** From the measurement to the pixels, of those scans that were drawn [ms]. */
  latencies() {
    const found = [];
    for (let i = 0; i < Math.min(this.count, KEPT); i++) {
      if (Number.isFinite(this.drawnMs[i])) found.push(this.drawnMs[i] - this.stampedMs[i]);
    }
    return found;
  }

  clear() { this.count = 0; this.#pending = this.#done = -1; this.drawnMs.fill(NaN); }
}

function now() { return performance.timeOrigin + performance.now(); }
