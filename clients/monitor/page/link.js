// The way to the server: one WebSocket that comes back by itself. Takes bundles apart (clients/monitor/outbox.py) and
// acknowledges them; a hidden page does not, so that nothing is sent to it.

import { Beat, Drive, Float, Grid, Json, Markers, Odometry, Path, Pose, Scan } from "./cdr.js";

const SOONEST_MS = 200;
const LATEST_MS = 2000;
const PING_MS = 1000;
const DEAD_MS = 3000; // a ping without an answer for so long: the link hangs, and a new one may not
const MOST_QUEUED_BYTES = 4096;
const ANSWER_WITHIN_MS = 12000;

/**
 * Events: hello, gone, news (topic), trouble (reason), history (lines). `newest[topic]` holds the decoded message; topics
 * that the server has beside these are JSON.
 */
export class Link {
  newest = {
    scan: new Scan(), wall: new Markers(), footprint: new Markers(), odom: new Odometry(), output: new Drive(),
    distance_error: new Float(), status: new Json(), decision: new Json(), beat: new Beat(), pilot: new Json(),
    pose: new Pose(), map: new Grid(), line: new Path(),
    monitor: new Json(), fleet: new Json(), calibration: new Json(), lap_map: new Json(),
  };
  /** When what we have of a topic left the car, on this page's clock [ms]; as well as one can know without clocks. */
  seenMs = {};
  open = false;
  /** The server's last words, "" while there is a link and after one that broke without a word. */
  goodbye = "";
  roundTripMs = NaN;
  bundles = 0;
  broken = 0;
  #topics = [];
  #fromCar = [];
  #socket = null;
  #waitMs = SOONEST_MS;
  #unacknowledged = 0;
  #pingMs = Infinity; // when the oldest ping left that has no answer
  #questions = new Map();
  #question = 0;
  #handlers = { hello: [], gone: [], news: [], trouble: [], history: [] };

  constructor() {
    for (const topic of Object.keys(this.newest)) this.forget(topic);
    document.addEventListener("visibilitychange", () => { if (!document.hidden) this.#acknowledge(); });
    setInterval(() => this.#ping(performance.now()), PING_MS);
  }

  on(event, handler) { this.#handlers[event].push(handler); }

  connect() {
    const address = new URL("ws", location.href);
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    address.search = location.search;
    address.hash = "";
    const socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    socket.onmessage = (event) => {
      if (socket !== this.#socket) return;
      if (typeof event.data === "string") this.#takeText(JSON.parse(event.data));
      else this.#takeBundle(event.data);
    };
    socket.onclose = (event) => this.#gone(socket, event.reason);
    this.#socket = socket;
  }

  /** Sends a message; returns whether it left. What cannot leave now is dropped: late words are worse than none. */
  say(message) {
    const socket = this.#socket;
    if (!this.open || socket.readyState !== WebSocket.OPEN) return false;
    if (socket.bufferedAmount > MOST_QUEUED_BYTES && message.t !== "stop" && message.t !== "stop_all" && message.t !== "leave") return false;
    socket.send(JSON.stringify(message));
    return true;
  }

  /** Puts a question to the car; resolves to its answer, rejects with an Error that has the reason in words. */
  ask(what, question = {}) {
    return new Promise((resolve, reject) => {
      const id = ++this.#question;
      const timer = setTimeout(() => this.#answered(id, { refused: "no answer came" }), ANSWER_WITHIN_MS);
      this.#questions.set(id, { resolve, reject, timer });
      if (!this.say({ t: "ask", id, what, question })) this.#answered(id, { refused: "there is no link" });
    });
  }

  ageMs(topic, nowMs = performance.now()) { return nowMs - this.seenMs[topic]; }

  forget(topic) { this.seenMs[topic] = -Infinity; }

  forgetCar() { for (const topic of this.#fromCar) this.forget(topic); }

  #emit(event, detail) { for (const handler of this.#handlers[event]) handler(detail); }

  #takeText(message) {
    if (message.t === "pong") {
      this.roundTripMs = performance.now() - message.at;
      this.#pingMs = Infinity;
    }
    else if (message.t === "answer") this.#answered(message.id, message);
    else if (message.t === "history") this.#emit("history", message);
    else if (message.t === "trouble") this.#emit("trouble", message.reason);
    else if (message.t === "hello") {
      this.#topics = message.topics;
      this.#fromCar = message.from_car;
      for (const topic of this.#topics) this.newest[topic] ??= new Json();
      this.open = true;
      this.goodbye = "";
      this.#waitMs = SOONEST_MS;
      this.#emit("hello", message);
    }
  }

  #takeBundle(buffer) {
    const view = new DataView(buffer);
    const number = view.getUint32(0, true);
    if (number) {
      this.#unacknowledged = number;
      if (!document.hidden) this.#acknowledge();
    }
    this.bundles++;
    const nowMs = performance.now();
    for (let at = 4; at + 8 <= buffer.byteLength;) {
      const topic = this.#topics[view.getUint8(at)];
      const ageMs = view.getUint16(at + 2, true);
      const length = view.getUint32(at + 4, true);
      this.#takeRecord(topic, view, at + 8, length, nowMs - ageMs);
      at += 8 + length + (-length & 3);
    }
  }

  #takeRecord(topic, view, start, length, leftMs) {
    const message = this.newest[topic];
    if (!message) return;
    try {
      message.read(view, start, length);
    } catch {
      this.broken++;
      return;
    }
    this.seenMs[topic] = leftMs;
    this.#emit("news", topic);
  }

  #ping(nowMs) {
    if (this.open && nowMs - this.#pingMs > DEAD_MS) {
      const dead = this.#socket;
      dead.close();
      this.#gone(dead, "");
    } else if (this.say({ t: "ping", at: nowMs })) this.#pingMs = Math.min(this.#pingMs, nowMs);
  }

  #acknowledge() {
    if (this.#unacknowledged && this.say({ t: "ack", n: this.#unacknowledged })) this.#unacknowledged = 0;
  }

  #answered(id, message) {
    const waiting = this.#questions.get(id);
    if (!waiting) return;
    this.#questions.delete(id);
    clearTimeout(waiting.timer);
    if (message.refused !== undefined) waiting.reject(new Error(message.refused));
    else waiting.resolve(message.answer);
  }

  #gone(socket, reason) {
    if (socket !== this.#socket) return;
    this.#socket = null;
    this.#pingMs = Infinity;
    const wasOpen = this.open;
    if (wasOpen) this.goodbye = reason;
    this.open = false;
    this.roundTripMs = NaN;
    this.#unacknowledged = 0;
    for (const id of [...this.#questions.keys()]) this.#answered(id, { refused: "the link to the monitor broke" });
    if (wasOpen) this.#emit("gone");
    else if (location.search) this.#askWhy();
    setTimeout(() => this.connect(), this.#waitMs);
    this.#waitMs = Math.min(LATEST_MS, this.#waitMs * 1.5);
  }
  /** A browser does not say why a WebSocket was refused; the page's own address does. */
  async #askWhy() {
    const answer = await fetch(location.href, { method: "HEAD", cache: "no-store" }).catch(() => null);
    if (answer?.status === 403) this.#emit("trouble", "this address is not valid any more: open the one that wallride monitor prints now");
  }
}
