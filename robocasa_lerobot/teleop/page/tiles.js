// The camera pictures: drawn as they come; dragging in one moves the hand in its plane, in the free one it orbits.

import { make } from "./dom.js";

const NAMES = {
  robot0_agentview_left: "left",
  robot0_agentview_right: "right",
  robot0_eye_in_hand: "wrist",
  free: "around",
};
const CLICK_PX = 5; // less than that is a click, not a drag
const FULL_PX = 90; // pointer this far from where it went down: full speed
const NOTCH_S = 0.18; // how long one notch of the wheel moves the hand
const QUIET_MS = 400; // a click that only brought the window back, or that was meant for "Go on", is not meant for the robot

export class Tiles {
  /** `on` has drag(camera, {left, up} or null), depth(camera, sign), orbit(dx, dy), zoom(factor), point(camera, u, v). */
  constructor(holder, on) {
    this.holder = holder;
    this.on = on;
    this.tiles = new Map();
    this.newest = new Map();
    this.quietFrom = -QUIET_MS;
    addEventListener("focus", () => this.quiet());
  }

  /** Clicks of the next moment ask for nothing. */
  quiet() {
    this.quietFrom = performance.now();
  }

  setUp(cameras) {
    const large = this.holder.dataset.large; // from before the line was lost
    this.holder.dataset.large = "";
    this.holder.classList.remove("one-large");
    this.holder.replaceChildren();
    this.tiles.clear();
    this.newest.clear();
    for (const camera of cameras) {
      const canvas = make("canvas", { width: 256, height: 256 });
      const label = make("span", { class: "tile-name" }, NAMES[camera] ?? camera.replace(/^robot0_/, "").replaceAll("_", " "));
      const large = make("button", { type: "button", class: "tile-large", "aria-label": `Enlarge the ${label.textContent} picture` });
      const ring = make("span", { class: "ring", hidden: true }, make("i"));
      const tile = make("figure", { class: "tile" }, canvas, label, large, ring);
      tile.dataset.camera = camera;
      large.addEventListener("click", () => this.enlarge(camera));
      this.holder.append(tile);
      this.tiles.set(camera, { tile, canvas, context: canvas.getContext("2d", { alpha: false }), ring });
      this.listen(camera, canvas, ring);
    }
    this.holder.dataset.count = String(cameras.length);
    if (this.tiles.has(large)) this.enlarge(large);
  }

  enlarge(camera) {
    const already = this.holder.dataset.large === camera;
    this.holder.dataset.large = already ? "" : camera;
    for (const [name, { tile }] of this.tiles) tile.classList.toggle("large", name === camera && !already);
    this.holder.classList.toggle("one-large", !already);
  }

  async draw(id, pictures) {
    await Promise.all(
      pictures.map(async ({ camera, blob }) => {
        const tile = this.tiles.get(camera);
        if (!tile) return;
        const bitmap = await createImageBitmap(blob);
        // Decoding is not in order: an older picture never covers a newer one.
        if (id >= (this.newest.get(camera) ?? 0)) {
          this.newest.set(camera, id);
          if (tile.canvas.width !== bitmap.width) [tile.canvas.width, tile.canvas.height] = [bitmap.width, bitmap.height];
          tile.context.drawImage(bitmap, 0, 0);
        }
        bitmap.close();
      }),
    );
  }

  /** The tile from which the frame of motion comes carries a sign. */
  lead(camera) {
    for (const [name, { tile }] of this.tiles) tile.classList.toggle("lead", name === camera);
  }

  /** What is dragged goes its own way, with the camera that it is meant in. */
  axes() {
    return null;
  }

  /** End the drag: the pointer counts again once it goes down anew. */
  release() {
    this.drop?.();
  }

  listen(camera, canvas, ring) {
    let start = null;
    let moved = false;
    const end = () => {
      if (!start) return;
      start = null;
      ring.hidden = true;
      if (moved && camera !== "free") this.on.drag(camera, null);
      if (this.drop === end) this.drop = null;
    };
    canvas.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      start = { x: event.clientX, y: event.clientY, px: event.clientX, py: event.clientY };
      start.idle = performance.now() - this.quietFrom < QUIET_MS;
      moved = false;
      this.drop = end;
      canvas.setPointerCapture(event.pointerId);
      event.preventDefault();
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!start) return;
      if (event.buttons === 0) return end(); // it was let go where nobody heard of it
      const [dx, dy] = [event.clientX - start.x, event.clientY - start.y];
      if (!moved && Math.hypot(dx, dy) < CLICK_PX) return;
      moved = true;
      if (camera === "free") {
        this.on.orbit(event.clientX - start.px, event.clientY - start.py);
        [start.px, start.py] = [event.clientX, event.clientY];
        return;
      }
      const scale = Math.min(1, FULL_PX / Math.hypot(dx, dy)) / FULL_PX;
      this.on.drag(camera, { left: -dx * scale, up: -dy * scale });
      const box = canvas.getBoundingClientRect();
      ring.hidden = false;
      ring.style.left = `${start.x - box.left}px`;
      ring.style.top = `${start.y - box.top}px`;
      ring.firstChild.style.transform = `translate(${dx * scale * 40}px, ${dy * scale * 40}px)`;
    });
    canvas.addEventListener("pointerup", (event) => {
      if (start && !moved && !start.idle) {
        const box = canvas.getBoundingClientRect();
        const share = (at, size) => Math.min(1, Math.max(0, at / size)); // it may be let go beside the picture
        this.on.point(camera, share(event.clientX - box.left, box.width), share(event.clientY - box.top, box.height));
      }
      end();
    });
    for (const name of ["pointercancel", "lostpointercapture"]) canvas.addEventListener(name, end);
    canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        if (camera === "free") this.on.zoom(event.deltaY > 0 ? 1.12 : 1 / 1.12);
        else this.on.depth(camera, event.deltaY > 0 ? -1 : 1, NOTCH_S);
      },
      { passive: false },
    );
  }
}
