// Keys by their place on the keyboard (`event.code`), in presets that can be changed key by key.

import { $, make, settings } from "./dom.js";

/** Motions: which axis of arm or base a held key moves, and which way. In base mode the first column counts. */
const MOTIONS = {
  forward: ["forward", "x", 1],
  back: ["back", "x", -1],
  left: ["left", "y", 1],
  right: ["right", "y", -1],
  up: ["up", "z", 1],
  down: ["down", "z", -1],
  yaw_left: ["turn left", "yaw", 1],
  yaw_right: ["turn right", "yaw", -1],
  pitch_up: ["tip up", "pitch", -1],
  pitch_down: ["tip down", "pitch", 1],
  roll_left: ["roll left", "roll", -1],
  roll_right: ["roll right", "roll", 1],
  drive_forward: ["base forward", "base_x", 1],
  drive_back: ["base back", "base_x", -1],
  drive_left: ["base left", "base_y", 1],
  drive_right: ["base right", "base_y", -1],
  drive_turn_left: ["base turn left", "base_yaw", 1],
  drive_turn_right: ["base turn right", "base_yaw", -1],
};
const COMMANDS = {
  gripper: "open or close",
  mode: "arm or base",
  frame: "axes of",
  slow: "speed 25 %",
  medium: "speed 50 %",
  fast: "speed 100 %",
  undo: "undo (hold)",
  mark: "mark",
  back_to_mark: "back to mark",
  pause: "pause",
  end: "end, review",
  stop: "stop help",
  take_over: "take over",
  give_back: "give back",
};
const SHARED = {
  slow: "Digit1",
  medium: "Digit2",
  fast: "Digit3",
  undo: "Backspace",
  mark: "KeyM",
  back_to_mark: "KeyN",
  stop: "Escape",
  drive_forward: "KeyI",
  drive_back: "KeyK",
  drive_left: "KeyJ",
  drive_right: "KeyL",
  drive_turn_left: "KeyU",
};
const GAMEPAD =
  "Left stick: move. Right stick: up and turn. Bumpers: roll. Triggers: tip. A gripper, B undo (hold), X arm or base, " +
  "Y mark. Cross up and down: speed, left: back to mark, right: give back. Start pause, Back end, left stick pressed: axes.";
const ARROWS = ["ArrowUp", "ArrowDown", "ArrowLeft", "ArrowRight"];
export const PRESETS = {
  wasd: {
    label: "WASD",
    keys: {
      ...SHARED,
      ...{ forward: "KeyW", back: "KeyS", left: "KeyA", right: "KeyD", up: "KeyR", down: "KeyF" },
      ...{ yaw_left: "KeyQ", yaw_right: "KeyE", pitch_up: "ArrowUp", pitch_down: "ArrowDown" },
      ...{ roll_left: "ArrowLeft", roll_right: "ArrowRight", drive_turn_right: "KeyO" },
      ...{ gripper: "KeyG", mode: "KeyB", frame: "KeyV", pause: "Space", end: "Enter" },
      ...{ take_over: "KeyT", give_back: "KeyP" },
    },
  },
  robocasa: {
    label: "RoboCasa",
    keys: {
      ...SHARED,
      ...{ forward: "ArrowUp", back: "ArrowDown", left: "ArrowLeft", right: "ArrowRight", up: "Semicolon", down: "Period" },
      ...{ yaw_left: "KeyO", yaw_right: "KeyP", pitch_up: "KeyY", pitch_down: "KeyH" },
      ...{ roll_left: "KeyE", roll_right: "KeyR", drive_turn_right: "Quote" },
      ...{ gripper: "Space", mode: "KeyB", frame: "KeyV", pause: "KeyX", end: "Enter" },
      ...{ take_over: "KeyT", give_back: "KeyG" },
    },
  },
};
const SIGNS = {
  ...{ ArrowUp: "↑", ArrowDown: "↓", ArrowLeft: "←", ArrowRight: "→", Space: "Space", Backspace: "⌫", Escape: "Esc" },
  ...{ Semicolon: ";", Period: ".", Comma: ",", Quote: "'", Slash: "/", BracketLeft: "[", BracketRight: "]", Enter: "Enter" },
};
const sign = (code) => SIGNS[code] ?? code?.replace(/^(Key|Digit)/, "") ?? "–";

export class Keyboard {
  /** `on` has changed() and command(name, pressed). */
  constructor(on) {
    this.on = on;
    this.held = new Set();
    this.waiting = null; // the name that the next key is given to
    this.preset = settings.get("preset", "wasd");
    if (!(this.preset in PRESETS)) this.preset = "wasd";
    this.load();
    addEventListener("keydown", (event) => this.down(event));
    addEventListener("keyup", (event) => this.up(event));
    const select = $("preset");
    select.append(...Object.entries(PRESETS).map(([name, { label }]) => make("option", { value: name }, label)));
    select.value = this.preset;
    select.addEventListener("change", () => {
      this.preset = select.value;
      settings.set("preset", this.preset);
      settings.set("keys", null);
      this.load();
      select.blur();
    });
    this.show();
  }

  load() {
    const changed = settings.get("keys", {}) ?? {};
    this.keys = { ...PRESETS[this.preset].keys, ...changed };
    this.names = new Map(Object.entries(this.keys).map(([name, code]) => [code, name]));
    this.held.clear();
    if ($("keys").childElementCount) this.show();
  }

  /** Axes in [-1, 1] from what is held. */
  axes() {
    const out = { x: 0, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0, base_x: 0, base_y: 0, base_yaw: 0 };
    for (const name of this.held) if (name in MOTIONS) out[MOTIONS[name][1]] += MOTIONS[name][2];
    return out;
  }

  /** Let everything go; keys that are still down count again once they were up. */
  release() {
    const held = [...this.held];
    this.held.clear();
    for (const name of held) {
      if (name in COMMANDS) this.on.command(name, false);
      this.light(name, false);
    }
  }

  down(event) {
    if (this.waiting) return this.assign(event);
    if (event.metaKey && this.held.size) {
      // While the command key of a Mac is down, no other key is said to have gone up.
      this.release();
      this.on.changed();
    }
    const name = this.names.get(event.code);
    if (!name || event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
    const target = event.target instanceof Element ? event.target : document.body;
    if (target.matches("input:not([type=range], [type=checkbox]), select, textarea")) return;
    // A control that has the keys by Tab is worked as anywhere else: Space and Enter press it, arrows choose in it.
    const control = target.closest("button, a, input, summary, [role=radio]");
    const used = ["Space", "Enter", ...(control?.matches("[role=radio], [type=range]") ? ARROWS : [])];
    if (control && used.includes(event.code)) return;
    event.preventDefault();
    if (event.repeat || this.held.has(name)) return;
    this.held.add(name);
    if (name in COMMANDS) this.on.command(name, true);
    else this.on.changed();
    this.light(name, true);
  }

  up(event) {
    const name = this.names.get(event.code);
    if (!name || !this.held.delete(name)) return;
    if (name in COMMANDS) this.on.command(name, false);
    else this.on.changed();
    this.light(name, false);
  }

  light(name, on) {
    $("keys").querySelector(`[data-name="${name}"]`)?.classList.toggle("held", on);
  }

  assign(event) {
    event.preventDefault();
    const name = this.waiting;
    this.waiting = null;
    if (event.code !== "Escape" || name === "stop") {
      const changed = settings.get("keys", {}) ?? {};
      const other = this.names.get(event.code);
      if (other && other !== name) changed[other] = this.keys[name]; // the two change places: no key has two meanings
      changed[name] = event.code;
      settings.set("keys", changed);
      this.load();
    } else this.show();
  }

  show() {
    const entry = (name, label) => {
      const key = make("button", { type: "button", class: "key", "aria-label": `${label}: ${sign(this.keys[name])}, change` }, sign(this.keys[name]));
      key.dataset.name = name;
      key.addEventListener("click", () => {
        this.waiting = name;
        key.textContent = "press…";
        key.classList.add("waiting");
        key.blur();
      });
      return make("div", { class: "key-row" }, key, make("span", {}, label));
    };
    const group = (title, entries, open) =>
      make("details", open ? { open: true } : {}, make("summary", {}, title), make("div", { class: "key-grid" }, ...entries));
    const motions = Object.entries(MOTIONS);
    const open = matchMedia("(min-width: 761px)").matches;
    $("keys").replaceChildren(
      group("Hand (or base)", motions.filter(([n]) => !n.startsWith("drive_")).map(([n, [label]]) => entry(n, label)), open),
      group("Commands", Object.entries(COMMANDS).map(([n, label]) => entry(n, label)), open),
      make("details", {}, make("summary", {}, "Gamepad"), make("p", { class: "quiet pad" }, GAMEPAD)),
      group("Base, in “both”", motions.filter(([n]) => n.startsWith("drive_")).map(([n, [label]]) => entry(n, label)), false),
    );
  }
}
