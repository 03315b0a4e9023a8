// What the frames say, in words and numbers: goal, settings, gauges, policy, and the veil over the pictures.

import { $, choice, chosen, make, settings, show, text, words } from "./dom.js";

const FRAMES = { base: "robot", camera: "picture", gripper: "gripper" };
const PAUSES = {
  asked: ["Paused", "Nothing moves until you go on."],
  rewound: ["Gone back", "Press a key to go on from here."],
  focus: ["Paused", "The page was left, so everything was let go."],
  stale: ["Pictures are late", "No picture was drawn for half a second, so the robot stands."],
  disconnected: ["Paused", "The line was lost, so the robot stands."],
};
const ready = (touch) => (touch ? "Move a stick to begin." : "Nothing counts before your first key.");

export class Panel {
  /** `set(settings)` sends them; `command(name)` is what keys would do. */
  constructor(set, command) {
    this.set = set;
    this.hello = null;
    this.shown = settings.get("goal", true);
    $("goal-toggle").addEventListener("click", () => {
      this.shown = !this.shown;
      settings.set("goal", this.shown);
      this.goalShown();
    });
    $("gripper").addEventListener("click", () => command("gripper"));
    this.goalShown();
  }

  setUp(hello) {
    this.hello = hello;
    text($("task"), `${words(hello.task.replace(/([a-z])([A-Z])/g, "$1 $2"))} · ${hello.split}`);
    choice($("mode"), hello.modes.map((mode) => [mode, mode]), (mode) => this.set({ mode }));
    choice($("motion-frame"), hello.motion_frames.map((name) => [name, FRAMES[name] ?? name]), (name) => this.set({ motion_frame: name }));
    choice($("speed"), hello.speeds.map((speed) => [speed, `${Math.round(speed * 100)} %`]), (speed) => this.set({ speed }));
    show($("policy-card"), Boolean(hello.policy));
    text($("policy-name"), hello.policy ?? "");
    show($("goal-card"), !hello.hide_goal);
    if (hello.free_view && !$("free-view")) {
      $("map-hint").before(make("a", { id: "free-view", href: hello.free_view, target: "_blank", rel: "noopener" }, "free 3-D view"));
    }
    this.wanted(hello.wanted);
  }

  wanted(count) {
    text($("wanted"), count);
    const few = count <= 40;
    $("pips").replaceChildren(...(few ? Array.from({ length: count }, () => make("i")) : [make("b")]));
  }

  scene(scene) {
    text($("instruction"), scene.instruction);
    document.title = scene.instruction;
    $("terms").replaceChildren(
      ...scene.terms.map((name) => {
        const item = make("li", {}, make("i", { "aria-hidden": "true" }), make("span", {}, words(name)), make("span", { class: "sr" }));
        item.dataset.term = name;
        return item;
      }),
    );
  }

  goalShown() {
    show($("terms"), this.shown);
    text($("goal-toggle"), this.shown ? "hide" : "show");
    $("goal-toggle").setAttribute("aria-expanded", String(this.shown));
  }

  frame(head) {
    const body = document.body.dataset;
    if (body.phase !== head.phase) body.phase = head.phase;
    chosen($("mode"), head.mode);
    chosen($("motion-frame"), head.motion_frame);
    chosen($("speed"), head.speed);
    const closed = head.gripper === "closed";
    text($("gripper"), head.gripper);
    $("gripper").setAttribute("aria-pressed", String(closed));
    for (const item of $("terms").children) {
      const on = Boolean(head.terms[item.dataset.term]);
      item.classList.toggle("on", on);
      text(item.lastElementChild, on ? "holds" : "does not hold yet");
    }
    $("goal-card").classList.toggle("reached", Boolean(head.success));
    this.episodes(head);
    this.gauges(head);
    this.policy(head.policy, head.phase);
  }

  episodes(head) {
    text($("saved"), head.saved);
    const pips = $("pips");
    if (pips.childElementCount === 1 && pips.firstElementChild.tagName === "B") {
      pips.firstElementChild.style.width = `${(100 * head.saved) / Math.max(1, head.wanted)}%`;
    } else [...pips.children].forEach((pip, index) => pip.classList.toggle("on", index < head.saved));
    const discarded = head.discarded ? `, ${head.discarded} discarded` : "";
    const label = `${head.saved} of ${head.wanted} episodes saved${discarded}`;
    if (pips.title !== label) pips.title = label;
  }

  gauges(head) {
    text($("g-step"), `${head.step} / ${head.horizon}`);
    text($("g-time"), `${head.time.toFixed(1)} s`);
    const slow = head.real_time !== null && head.real_time < 0.9;
    text($("g-real"), head.real_time === null ? "–" : `× ${head.real_time.toFixed(2)}${slow ? ", slower than life" : ""}`);
    $("g-real").classList.toggle("bad", slow);
    text($("g-age"), head.age_ms === null ? "–" : `${Math.round(head.age_ms)} ms`);
    $("g-age").classList.toggle("bad", head.age_ms !== null && head.age_ms > 250);
    text($("g-cost"), head.step_ms === null ? "–" : `${Math.round(head.step_ms)} ms`);
    text($("g-hand"), head.robot ? head.robot.hand.map((value) => value.toFixed(2)).join("  ") : "–");
    text($("g-input"), head.input ?? "–");
    text($("g-undos"), head.undos);
  }

  policy(policy, phase) {
    if (!policy) return;
    const state = $("policy-state");
    text(state, policy.state.toLowerCase());
    state.dataset.state = policy.state;
    text($("interventions"), policy.interventions === 1 ? "1 intervention" : `${policy.interventions} interventions`);
    $("policy-start").disabled = phase !== "ready";
    $("take-over").disabled = policy.state === "CORRECTING" || phase === "ready";
    $("give-back").disabled = policy.state === "AUTONOMOUS" || phase === "ready";
  }

  /** The veil over the pictures; `age` in seconds of the newest picture where it is too old, `line` where none comes. */
  veil(head, { age = 0, line = true } = {}) {
    let [title, words, button] = ["", "", null];
    if (!line) [title, words] = ["No line to the kitchen", "Trying again…"];
    else if (!head || head.phase === "loading") [title, words] = ["Building the kitchen…", ""];
    else if (age && head.assisted?.planning) title = "Looking for a way…";
    else if (age) [title, words] = ["Pictures are late", `The newest is ${age.toFixed(1)} s old, so the robot stands.`];
    else if (head.phase === "saving") title = "Saving…";
    else if (head.phase === "done") [title, words] = ["Done", `${head.saved} of ${head.wanted} episodes are saved${head.path ? ` in ${head.path}` : ""}. You can close this page.`];
    else if (!head.mine && head.phase === "running") title = "";
    else if (head.phase === "paused") [title, words, button] = [...(PAUSES[head.rewound ? "rewound" : head.pause] ?? PAUSES.asked), "Go on"];
    else if (head.phase === "ready") [title, words] = ["Ready", head.policy ? "Start the policy, or move the robot yourself." : ready(matchMedia("(pointer: coarse)").matches)];
    else if (head.phase === "rewinding") [title, words] = ["Going back", "Let go to go on from here."];
    // While pictures are still late, time would stop again at once.
    const stale = head?.phase === "paused" && head.pause === "stale";
    const waits = stale && head.late;
    if (waits) words = "The robot stands. You can go on as soon as they come in time.";
    show($("veil"), Boolean(title));
    $("veil").classList.toggle("light", ["ready", "paused", "rewinding"].includes(head?.phase) && line && !age);
    $("veil").classList.toggle("warning", Boolean(age) || stale);
    text($("veil-title"), title);
    text($("veil-text"), words);
    show($("veil-button"), Boolean(button) && head.mine && !waits);
    text($("veil-button"), button ?? "");
  }
}
