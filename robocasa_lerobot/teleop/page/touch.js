// Two sticks and four buttons for fingers; a stick is let go by lifting the finger.

import { $ } from "./dom.js";

const DEAD = 0.12;

export class Touch {
  /** `on` has changed(), command(name, pressed). */
  constructor(on) {
    this.on = on;
    this.sticks = { left: [0, 0], right: [0, 0] };
    this.fingers = { left: null, right: null };
    this.turning = false; // the left stick then tips and rolls the hand
    for (const name of ["left", "right"]) this.listen(name, $(`stick-${name}`));
    $("touch-turn").addEventListener("click", () => {
      this.turning = !this.turning;
      $("touch-turn").setAttribute("aria-pressed", String(this.turning));
      $("stick-left").lastElementChild.textContent = this.turning ? "tip, roll" : "move";
    });
    for (const button of document.querySelectorAll("#touch [data-do]")) {
      button.addEventListener("click", () => {
        on.command(button.dataset.do, true);
        on.command(button.dataset.do, false);
      });
    }
    for (const button of document.querySelectorAll("#touch [data-hold]")) hold(button, (down) => on.command(button.dataset.hold, down));
  }

  axes() {
    const [lx, ly] = this.sticks.left;
    const [rx, ry] = this.sticks.right;
    if (this.turning) return { x: 0, y: 0, z: -ry, yaw: -rx, roll: lx, pitch: -ly };
    return { x: -ly, y: -lx, z: -ry, yaw: -rx, roll: 0, pitch: 0 };
  }

  release() {
    for (const name of ["left", "right"]) this.lift(name, $(`stick-${name}`));
  }

  lift(name, element) {
    this.fingers[name] = null;
    this.sticks[name] = [0, 0];
    element.firstElementChild.style.transform = "";
    element.classList.remove("held");
  }

  listen(name, element) {
    const move = (event) => {
      const box = element.getBoundingClientRect();
      const radius = box.width / 2;
      let [x, y] = [(event.clientX - box.left - radius) / radius, (event.clientY - box.top - radius) / radius];
      const length = Math.hypot(x, y);
      if (length > 1) [x, y] = [x / length, y / length];
      element.firstElementChild.style.transform = `translate(${x * radius * 0.6}px, ${y * radius * 0.6}px)`;
      this.sticks[name] = length < DEAD ? [0, 0] : [x, y];
      this.on.changed();
    };
    element.addEventListener("pointerdown", (event) => {
      this.fingers[name] = event.pointerId;
      element.setPointerCapture(event.pointerId);
      element.classList.add("held");
      move(event);
      event.preventDefault();
    });
    element.addEventListener("pointermove", (event) => {
      if (event.pointerId === this.fingers[name]) move(event);
    });
    for (const kind of ["pointerup", "pointercancel", "lostpointercapture"]) {
      element.addEventListener(kind, (event) => {
        if (event.pointerId !== this.fingers[name]) return;
        this.lift(name, element);
        this.on.changed();
      });
    }
  }
}

/** Calls `changed(true)` while a button is held by pointer, Space or Enter, and `changed(false)` once it is let go. */
export function hold(button, changed) {
  let held = false;
  const set = (on) => {
    if (on !== held) changed((held = on));
  };
  button.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    button.setPointerCapture(event.pointerId);
    set(true);
  });
  for (const kind of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) button.addEventListener(kind, () => set(false));
  button.addEventListener("keydown", (event) => {
    if (event.code === "Space" || event.code === "Enter") set(true);
  });
  button.addEventListener("keyup", () => set(false));
  button.addEventListener("contextmenu", (event) => event.preventDefault());
}
