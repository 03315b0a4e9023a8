// What is held on all devices becomes one `input` message; nothing moves a robot whose picture is old.

const REPEAT_MS = 80; // while anything is held; the server forgets after 250 ms
const ZERO = { x: 0, y: 0, z: 0, roll: 0, pitch: 0, yaw: 0, base_x: 0, base_y: 0, base_yaw: 0 };
const clip = (value) => Math.max(-1, Math.min(1, value));

export class Operator {
  /** `sources`: device name -> object with axes() and release(); `send(message)`. */
  constructor(sources, send) {
    this.sources = sources;
    this.send = send;
    this.frame = 0;
    this.mode = "arm";
    this.active = false; // this client drives, and the phase takes inputs
    this.locked = ""; // why nothing is let through
    this.drag = null; // {camera, left, up}
    this.depth = null; // {camera, sign, until}
    this.last = "";
    this.sent = 0;
    this.moving = false;
  }

  /** Let go of everything, at once. */
  release() {
    this.drag = this.depth = null;
    for (const source of Object.values(this.sources)) source.release();
    this.update();
  }

  /** Lock with a reason in words, or unlock with "". */
  lock(reason) {
    if (reason === this.locked) return;
    this.locked = reason;
    if (reason) this.release();
  }

  leadPicture(camera, motion) {
    this.drag = motion && { camera, ...motion };
    this.update();
  }

  turnWheel(camera, sign, seconds) {
    const now = performance.now();
    const begun = this.depth?.sign === sign ? Math.max(now, this.depth.until) : now;
    this.depth = { camera, sign, until: Math.min(begun + seconds * 1000, now + 1000) };
    this.update();
  }

  gripper(state) {
    if (!this.active || this.locked) return;
    this.say(this.gather(), { gripper: state }); // with what is held, so that a motion does not stumble
  }

  say({ axes, camera }, more = {}) {
    const frame = camera ? { motion_frame: "camera", motion_camera: camera } : {};
    this.send({ type: "input", frame: this.frame, device: this.device ?? "keyboard", ...this.message(axes), ...frame, ...more });
  }

  /** Called at every frame of the page and at every change. */
  update() {
    const now = performance.now();
    if (this.depth && now > this.depth.until) this.depth = null;
    const held = this.gather();
    const { axes, device, camera } = held;
    const moving = Object.values(axes).some((value) => value !== 0);
    if (moving) this.device = device;
    const said = JSON.stringify([axes, camera, this.mode]);
    const due = moving && now - this.sent > REPEAT_MS;
    if (said === this.last && !due) return;
    if (!moving && !this.moving) return;
    if (moving && (!this.active || this.locked)) return;
    this.last = said;
    this.sent = now;
    this.moving = moving;
    this.say(held);
  }

  gather() {
    const total = { ...ZERO };
    let device = null;
    for (const [name, source] of Object.entries(this.sources)) {
      const axes = source.axes();
      if (!axes) continue;
      for (const [axis, value] of Object.entries(axes)) {
        if (value) [total[axis], device] = [clip(total[axis] + value), name];
      }
    }
    if (this.locked) return { axes: ZERO }; // commands of a gamepad have been heard all the same
    const camera = this.drag?.camera ?? this.depth?.camera;
    if (camera) {
      // A picture leads by itself: what is dragged counts in its plane, the wheel into it.
      const axes = { ...ZERO, x: this.depth?.sign ?? 0, y: clip(this.drag?.left ?? 0), z: clip(this.drag?.up ?? 0) };
      return { axes, device: "mouse", camera };
    }
    return { axes: total, device };
  }

  message(axes) {
    const hand = [axes.x, axes.y, axes.z, axes.roll, axes.pitch, axes.yaw];
    if (this.mode === "base") {
      // Dragging steers as a car: up is forward, sideways turns.
      const base = this.drag || this.depth ? [axes.z, 0, axes.y] : [axes.x, axes.y, axes.yaw];
      return { arm: [0, 0, 0, 0, 0, 0], base, torso: this.drag || this.depth ? axes.x : axes.z };
    }
    return { arm: hand, base: [axes.base_x, axes.base_y, axes.base_yaw], torso: 0 };
  }
}
