// The picture of the drive pad: a cross at rest, a knob under the finger.

import { $, fit, ink, onLook, ratioOf } from "../look.js";

export class DrivePad {
  #context = $("touch").getContext("2d");
  #drawn = "";

  constructor(hands) {
    this.hands = hands;
    $("touch").addEventListener("pointermove", () => { if (hands.touch.id !== null) this.draw(); });
    onLook(() => { this.#drawn = ""; });
  }

  /** Draws it if anything is other than before. */
  draw() {
    const canvas = $("touch");
    const { hands } = this, { touch } = hands;
    const state = `${hands.engaged} ${touch.id !== null} ${touch.speed} ${touch.steering} ${canvas.clientWidth} ${canvas.clientHeight} ${ink.text}`;
    if (state === this.#drawn && !fit(canvas)) return;
    this.#drawn = state;
    fit(canvas);
    const ratio = ratioOf(canvas), context = this.#context, { width, height } = canvas;
    const reach = (Math.min(width, height) / 2) * 0.8;
    const active = hands.engaged && touch.id !== null;
    const x = active ? touch.x0 * ratio : width / 2, y = active ? touch.y0 * ratio : height / 2;
    context.clearRect(0, 0, width, height);
    context.strokeStyle = hands.engaged ? ink.muted : ink.faint;
    context.lineWidth = 1.5 * ratio;
    context.beginPath();
    context.arc(x, y, reach, 0, 2 * Math.PI);
    context.moveTo(x - reach, y);
    context.lineTo(x + reach, y);
    context.moveTo(x, y - reach);
    context.lineTo(x, y + reach);
    context.stroke();
    const knobX = x - touch.steering * reach, knobY = y - touch.speed * reach;
    context.fillStyle = active ? ink.go : hands.engaged ? ink.car : ink.faint;
    context.beginPath();
    context.arc(knobX, knobY, 17 * ratio, 0, 2 * Math.PI);
    context.fill();
  }
}
