// Time series of fixed size: what is older than the longest plot is overwritten, so memory stays flat for days.

/** capacity: samples kept. apartMs: samples that come faster are left out. */
export class Series {
  constructor(capacity, apartMs) {
    this.t = new Float64Array(capacity);
    this.v = new Float32Array(capacity);
    this.capacity = capacity;
    this.apartMs = apartMs;
    this.next = 0;
    this.count = 0;
    this.lastMs = -Infinity;
  }

  push(ms, value) {
    if (ms - this.lastMs < this.apartMs) return;
    this.lastMs = ms;
    this.t[this.next] = ms;
    this.v[this.next] = value;
    this.next = (this.next + 1) % this.capacity;
    if (this.count < this.capacity) this.count++;
  }

  /** Takes samples of any age, times ascending, in among its own. */
  merge(times, values) {
    const all = times.map((ms, i) => [ms, values[i]]);
    for (let k = this.count - 1; k >= 0; k--) { const i = this.at(k); all.push([this.t[i], this.v[i]]); }
    all.sort((a, b) => a[0] - b[0]);
    this.clear();
    for (const [ms, value] of all.slice(-this.capacity)) this.push(ms, value);
  }

  /** Index of the k-th newest sample, 0 is the newest. */
  at(k) { return (this.next - 1 - k + 2 * this.capacity) % this.capacity; }

  get last() { return this.count ? this.v[this.at(0)] : NaN; }

  clear() { this.count = this.next = 0; this.lastMs = -Infinity; }
}
