// A gamepad in the browser's standard mapping: sticks and triggers move, buttons command.

const DEAD = 0.1;
// Number of a button in the standard mapping: the command that it gives.
const BUTTONS = { 0: "gripper", 1: "undo", 2: "mode", 3: "mark", 8: "end", 9: "pause", 10: "frame", 12: "faster", 13: "slower", 14: "back_to_mark", 15: "give_back" };

/** A deflection without its dead zone: 0 up to `DEAD`, then steadily to 1. */
const axis = (value) => (Math.abs(value) <= DEAD ? 0 : (Math.sign(value) * (Math.abs(value) - DEAD)) / (1 - DEAD));

export class Gamepads {
  /** `on` has command(name, pressed) and found(name or null). */
  constructor(on) {
    this.on = on;
    this.pressed = new Set();
    this.name = null;
    this.blocked = false;
  }

  /** Axes in [-1, 1]; asked for at every frame of the page, since gamepads tell nothing by themselves. */
  axes() {
    const pad = [...(navigator.getGamepads?.() ?? [])].find((p) => p && p.connected && p.mapping === "standard");
    const name = pad?.id ?? null;
    if (name !== this.name) this.on.found((this.name = name));
    if (!pad) return null;
    const [lx, ly, rx, ry] = pad.axes.map(axis);
    const button = (number) => pad.buttons[number]?.value ?? 0;
    const out = {
      ...{ x: -ly, y: -lx, z: -ry, yaw: -rx },
      roll: button(5) - button(4),
      pitch: axis(button(7)) - axis(button(6)),
    };
    const still = Object.values(out).every((value) => value === 0);
    for (const [number, command] of Object.entries(BUTTONS)) {
      const down = Boolean(pad.buttons[number]?.pressed);
      if (down === this.pressed.has(number)) continue;
      if (down) this.pressed.add(number);
      else this.pressed.delete(number);
      if (!this.blocked || !down) this.on.command(command, down);
    }
    if (this.blocked) {
      // After a release the sticks count again once they were in the middle.
      if (still) this.blocked = false;
      return null;
    }
    return out;
  }

  release() {
    this.blocked = this.name !== null;
  }
}
