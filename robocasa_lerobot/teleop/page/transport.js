// Time: pause, undo, marks, the end of an episode, its review, and what becomes of it.

import { $, choice, chosen, make, show, text } from "./dom.js";
import { hold } from "./touch.js";

const REPEAT_MS = 80;
const UNDO_SPEED = 2; // times real time
const SPEEDS = [1, 4];

export class Transport {
  constructor(send) {
    this.send = send;
    this.head = null;
    this.undoing = null;
    this.reviewUndo = false; // its button is held
    this.stopped = false; // time stands for a dialog
    const click = (id, action) =>
      $(id).addEventListener("click", (event) => {
        // A click must not leave Space and Enter on the button; a dialog gives the keys back to what had them before it.
        if (event.detail) event.currentTarget.blur();
        action();
      });
    click("pause", () => this.pause());
    hold($("undo"), (on) => this.undo(on));
    hold($("review-undo"), (on) => this.undo((this.reviewUndo = on)));
    click("mark", () => send({ type: "mark" }));
    click("back-to-mark", () => send({ type: "back_to_mark" }));
    click("end", () => send({ type: "end" }));
    click("stop-assist", () => send({ type: "stop" }));
    for (const id of ["finish", "redo", "review-redo"]) click(id, () => this.leave(id.replace("review-", "")));
    for (const id of ["discard", "review-discard"]) click(id, () => this.open($("discard-dialog")));
    click("veil-button", () => send({ type: "resume" }));
    click("save", () => send({ type: "save", trim: $("trim").checked }));
    click("continue", () => send({ type: "continue" }));
    click("play", () => {
      const review = this.head?.review;
      const again = review && !review.playing && this.head.step >= review.steps - 1;
      send({ type: "review", play: !review?.playing, ...(again ? { seek: 0 } : {}) });
    });
    choice($("review-speed"), SPEEDS.map((speed) => [speed, `${speed}×`]), (speed) => send({ type: "review", speed }));
    $("seek").addEventListener("input", () => send({ type: "review", play: false, seek: Number($("seek").value) }));
    $("discard-dialog").addEventListener("close", () => {
      if ($("discard-dialog").returnValue !== "ok") return this.goOn();
      const reason = $("reason-text").value.trim() || $("reason").value;
      send({ type: "discard", reason });
      $("reason-text").value = "";
    });
    $("leave-dialog").addEventListener("close", () => {
      if ($("leave-dialog").returnValue === "ok") send({ type: this.leaving });
      else this.goOn();
    });
  }

  /** Ask in a dialog. While it has the keys nobody can drive, so time stands until it is closed. */
  open(dialog) {
    this.stopped = this.head?.phase === "running";
    if (this.stopped) this.send({ type: "pause" });
    dialog.returnValue = ""; // Escape leaves what the button said the time before
    dialog.showModal();
  }

  /** After a dialog in which nothing was chosen: as before it. */
  goOn() {
    if (this.stopped) this.send({ type: "resume" });
  }

  /** `redo` or `finish`, which lose the running episode: asked for once more where there is anything of it. */
  leave(type) {
    if (!this.head?.step && !this.head?.review) return this.send({ type });
    this.leaving = type;
    text($("leave-title"), type === "redo" ? "Do this kitchen again" : "Finish the session");
    text($("leave-ok"), type === "redo" ? "Redo" : "Finish");
    this.open($("leave-dialog"));
  }

  setUp(hello) {
    $("reason").replaceChildren(...hello.discard_reasons.map((reason) => make("option", {}, reason)));
  }

  pause() {
    this.send({ type: this.head?.phase === "paused" ? "resume" : "pause" });
  }

  undo(on) {
    if (on === Boolean(this.undoing)) return;
    clearInterval(this.undoing);
    this.undoing = null;
    if (on) {
      const say = () => this.send({ type: "rewind", on: true, speed: UNDO_SPEED });
      say();
      this.undoing = setInterval(say, REPEAT_MS);
    } else this.send({ type: "rewind", on: false });
  }

  frame(head) {
    this.head = head;
    const { phase, review } = head;
    // A button that is hidden is let go: the one that is held stays where it is.
    const ended = phase === "review" || phase === "saving" || (phase === "rewinding" && this.reviewUndo);
    show($("drive-bar"), !ended && phase !== "done");
    show($("review-bar"), ended);
    text($("pause"), phase === "paused" ? "Go on" : "Pause");
    $("pause").disabled = !["running", "paused"].includes(phase) || !head.mine;
    for (const id of ["undo", "mark", "back-to-mark", "end"]) $(id).disabled = !["running", "paused", "rewinding"].includes(phase) || !head.mine;
    for (const id of ["redo", "discard", "finish"]) $(id).disabled = !head.mine || phase === "loading";
    show($("stop-assist"), Boolean(head.assisted));
    text($("stop-assist"), head.assisted?.planning ? "Stop planning" : "Stop helping");
    if (review) this.review(head, review);
    this.track(head);
  }

  review(head, review) {
    text($("play"), review.playing ? "Pause" : "Play");
    chosen($("review-speed"), review.speed);
    const seek = $("seek");
    if (Number(seek.max) !== review.steps - 1) seek.max = String(Math.max(1, review.steps - 1));
    if (document.activeElement !== seek || review.playing) seek.value = String(head.step);
    show($("trim").parentElement, review.idle_head > 0);
    text($("trim-text"), `leave out ${review.idle_head} idle steps at the start`);
    const saving = head.phase === "saving";
    $("save").disabled = saving || !review.success || !head.mine;
    text($("review-note"), review.success ? "" : "The goal does not hold at the end.");
    $("continue").disabled = saving || review.success || !head.mine;
    for (const id of ["play", "review-undo", "review-redo", "review-discard"]) $(id).disabled = saving || !head.mine;
  }

  track(head) {
    const all = head.review ? head.review.steps : head.horizon;
    const share = Math.min(1, head.step / Math.max(1, all));
    $("track-fill").style.width = `${(100 * share).toFixed(2)}%`;
    const marks = JSON.stringify([head.review ? [] : head.marks, all]);
    if (marks === this.marks) return;
    this.marks = marks;
    for (const old of $("track").querySelectorAll("b")) old.remove();
    for (const step of head.review ? [] : head.marks.filter((at) => at > 0)) {
      const mark = make("b");
      mark.style.left = `${(100 * step) / Math.max(1, all)}%`;
      $("track").append(mark);
    }
  }
}
