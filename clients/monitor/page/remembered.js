// A few choices of this browser: the car, the plots' window, the share of the top speed.

const KEY = "wallride.monitor";

/** Keeps these changes; returns all that is kept. */
export function remember(changes) {
  let kept = {};
  try {
    kept = JSON.parse(localStorage.getItem(KEY) ?? "{}");
    if (changes) localStorage.setItem(KEY, JSON.stringify({ ...kept, ...changes }));
  } catch {
    // private windows may refuse; then nothing is remembered
  }
  return { ...kept, ...changes };
}
