// The page: what comes from the kitchen is shown, what the hands do goes back to it.

import { Connection } from "./connection.js";
import { $, make, show, text, words } from "./dom.js";
import { Gamepads } from "./gamepad.js";
import { Keyboard } from "./keyboard.js";
import { KitchenMap } from "./map.js";
import { Operator } from "./operator.js";
import { Panel } from "./panel.js";
import { Tiles } from "./tiles.js";
import { Touch } from "./touch.js";
import { Transport } from "./transport.js";

const NOTE_MS = 6000;
const ACTIVE = ["ready", "running", "paused"];

const controls = document.querySelector(".transport");
const state = { hello: null, head: null, line: false, drawn: 0, mine: false };
const view = { follow: true, azimuth: 0.6, elevation: -0.5, distance: 2.5 };
const send = (message) => connection.send(message);
const changed = () => operator.update();

const sources = {
  keyboard: new Keyboard({ changed, command }),
  gamepad: new Gamepads({ command, found: (name) => text($("devices"), name ? `Gamepad: ${name}` : "") }),
  touch: new Touch({ changed, command }),
};
const operator = new Operator(sources, send);
const panel = new Panel((settings) => send({ type: "set", ...settings }), (name) => command(name, true));
const transport = new Transport(send);
const map = new KitchenMap($("map"), (target) => send({ type: "drive_to", ...target }));
const tiles = new Tiles($("tiles"), {
  drag: (camera, motion) => operator.leadPicture(camera, motion),
  depth: (camera, sign, seconds) => operator.turnWheel(camera, sign, seconds),
  orbit: (dx, dy) => turn({ azimuth: view.azimuth - dx * 0.01, elevation: view.elevation - dy * 0.01 }),
  zoom: (factor) => turn({ distance: Math.min(8, Math.max(0.6, view.distance * factor)) }),
  point: (camera, u, v) => {
    if (state.head?.mine && ACTIVE.includes(state.head.phase)) send({ type: "reach", camera, u, v, frame: state.head.id });
  },
});
sources.mouse = tiles;
const connection = new Connection({
  open() {
    state.line = true;
    controls.inert = false;
    state.drawn = performance.now();
  },
  closed(reason, again) {
    if (connection.ended) return finished();
    state.line = false;
    state.head = null;
    operator.lock("no line");
    document.body.dataset.phase = "connecting";
    controls.inert = true; // what would be lost is not offered
    text($("role"), "offline");
    if (reason) note({ level: "error", text: reason });
    if (!again) note({ level: "error", text: "The kitchen has closed this page. Load it again to go on." });
  },
  async frame(head, pictures) {
    await tiles.draw(head.id, pictures);
    if (state.head && head.id < state.head.id) return;
    state.drawn = performance.now();
    // An episode begins with a new press, never with what is still held from the one before.
    if (head.phase !== state.head?.phase && ["ready", "review"].includes(head.phase)) operator.release();
    // After going back in time, a key alone goes on.
    head.rewound = head.phase === "paused" && (state.head?.phase === "rewinding" || (state.head?.phase === "paused" && state.head.rewound));
    state.head = head;
    head.mine = state.mine; // whether this page drives; `head.operator` says whether anybody does
    operator.frame = head.id;
    operator.mode = head.mode;
    operator.active = head.mine && ACTIVE.includes(head.phase);
    panel.frame(head);
    transport.frame(head);
    map.draw(head.robot, head.assisted);
    tiles.lead(head.motion_frame === "camera" ? head.motion_camera : "");
    text($("touch").querySelector("[data-do=mode]"), head.mode);
    who(head);
    watch();
  },
  message(message) {
    const act = { hello, scene, note, role, saved, discarded, done }[message.type];
    act?.(message);
  },
});

function hello(message) {
  state.hello = message;
  tiles.setUp(message.cameras);
  panel.setUp(message);
  transport.setUp(message);
  role(message);
}

function scene(message) {
  panel.scene(message);
  map.setUp(message.map);
}

function role(message) {
  state.mine = message.role === "operator";
  if (!state.mine) operator.release();
}

function who(head) {
  const others = head.viewers ? `, ${head.viewers} watching` : "";
  text($("role"), head.mine ? `you drive${others}` : "watching");
  show($("take"), !head.mine && !head.operator);
}

function saved(message) {
  note({ level: "info", text: `Saved: episode ${message.saved} of ${message.wanted}, ${(message.steps / 20).toFixed(1)} s.` });
}

function discarded(message) {
  note({ level: "info", text: message.reason === "redo" ? "The same kitchen again." : `Not kept: ${message.reason}.` });
}

function done(message) {
  connection.ended = true;
  state.path = message.path;
  note({ level: "info", text: message.path ? `${message.saved} episodes are in ${message.path}.` : "No episode was saved." });
}

function finished() {
  document.body.dataset.phase = "done";
  state.head = { ...state.head, phase: "done", path: state.path };
  operator.lock("done");
  text($("role"), "finished");
  panel.veil(state.head);
  transport.frame(state.head);
}

function note({ level, text: said }) {
  const line = make("p", { class: level }, said);
  $("notes").append(line);
  while ($("notes").childElementCount > 4) $("notes").firstElementChild.remove();
  setTimeout(() => line.remove(), NOTE_MS);
}

function turn(changes) {
  Object.assign(view, changes);
  view.azimuth = Math.atan2(Math.sin(view.azimuth), Math.cos(view.azimuth));
  view.elevation = Math.min(-0.05, Math.max(-1.5, view.elevation));
  send({ type: "view", ...view });
}

/** What a key, a button of a gamepad or a touch button asks for. */
function command(name, pressed) {
  const { head, hello: known } = state;
  if (name === "undo") return transport.undo(pressed);
  if (!pressed || !head || !known) return undefined;
  const next = (values, value) => values[(values.indexOf(value) + 1) % values.length];
  const step = (by) => known.speeds[Math.min(known.speeds.length - 1, Math.max(0, known.speeds.indexOf(head.speed) + by))];
  const speeds = { slow: 0, medium: 1, fast: 2 };
  if (name in speeds) return send({ type: "set", speed: known.speeds[speeds[name]] });
  const commands = {
    gripper: () => operator.gripper(head.gripper === "closed" ? "open" : "closed"),
    mode: () => send({ type: "set", mode: head.mode === "arm" ? "base" : "arm" }),
    frame: () => send({ type: "set", motion_frame: next(known.motion_frames, head.motion_frame) }),
    faster: () => send({ type: "set", speed: step(1) }),
    slower: () => send({ type: "set", speed: step(-1) }),
    pause: () => transport.pause(),
    stop: () => head.assisted && send({ type: "stop" }),
    end: () => (head.phase === "review" ? undefined : send({ type: "end" })),
  };
  const act = commands[name];
  return act ? act() : send({ type: name }); // mark, back_to_mark, take_over, give_back are messages themselves
}

/** Late pictures lock the hands: nobody drives by what they cannot see. */
function watch() {
  if (document.body.dataset.phase === "done") return;
  const late = state.line && state.head?.phase === "running" ? performance.now() - state.drawn : 0;
  const age = late > (state.hello?.stale_ms ?? 500) ? late / 1000 : 0;
  const stale = state.head?.phase === "paused" && state.head.pause === "stale";
  operator.lock(!state.line ? "no line" : age || stale ? "stale" : "");
  document.body.dataset.locked = operator.locked;
  $("dot").dataset.state = !state.line ? "off" : age || stale ? "late" : "on";
  const offered = !$("veil-button").hidden;
  panel.veil(state.head, { age, line: state.line });
  // Whoever clicks it twice hits the picture behind it.
  if (offered && $("veil-button").hidden && state.head?.phase === "running") tiles.quiet();
}

function lostFocus() {
  operator.release();
  transport.undo(false);
  send({ type: "focus", on: false });
}

addEventListener("blur", lostFocus);
addEventListener("focus", () => send({ type: "focus", on: true }));
document.addEventListener("visibilitychange", () => document.hidden && lostFocus());
addEventListener("pagehide", lostFocus);
// Words that were selected would be dragged by the browser, which then has the mouse and ends every gesture.
addEventListener("dragstart", (event) => event.preventDefault());
for (const [id, type] of [["policy-start", "start"], ["take-over", "take_over"], ["give-back", "give_back"], ["take", "take"]]) {
  $(id).addEventListener("click", () => send({ type }));
}
document.addEventListener("click", (event) => {
  // A button that was clicked gives the keys back to the robot; one that was pressed by a key keeps them.
  if (event.detail && event.target instanceof Element) event.target.closest("button, summary")?.blur();
});

(function tick() {
  operator.update();
  watch();
  requestAnimationFrame(tick);
})();
