// The kitchen from above, with the robot's place, heading and hand; a click asks it to drive there.

const ROBOT_M = { front: 0.35, back: 0.35, side: 0.28 }; // about the mobile base

export class KitchenMap {
  constructor(canvas, drive) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.image = null;
    this.where = null;
    this.target = null;
    this.key = "";
    canvas.addEventListener("click", (event) => {
      if (!this.where) return;
      const box = canvas.getBoundingClientRect();
      const u = ((event.clientX - box.left) / box.width) * this.where.width;
      const v = ((event.clientY - box.top) / box.height) * this.where.height;
      this.target = { x: this.where.left + u * this.where.metres_per_pixel, y: this.where.top - v * this.where.metres_per_pixel };
      drive(this.target);
    });
  }

  setUp(where) {
    this.where = where ?? null;
    this.image = this.target = null;
    this.key = "";
    if (!where) return;
    [this.canvas.width, this.canvas.height] = [where.width, where.height];
    const image = new Image();
    image.onload = () => {
      this.image = image;
      this.key = "";
    };
    image.src = where.url;
  }

  draw(robot, assisted) {
    if (!this.where || !robot) return;
    if (!assisted) this.target = null;
    const key = JSON.stringify([robot, this.target, Boolean(this.image)]);
    if (key === this.key) return;
    this.key = key;
    const { context, canvas } = this;
    const scale = 1 / this.where.metres_per_pixel;
    const spot = (x, y) => [(x - this.where.left) * scale, (this.where.top - y) * scale];
    context.clearRect(0, 0, canvas.width, canvas.height);
    if (this.image) context.drawImage(this.image, 0, 0, canvas.width, canvas.height);
    const [u, v] = spot(robot.x, robot.y);
    const line = Math.max(2, canvas.width / 160);
    if (this.target) {
      const [a, b] = spot(this.target.x, this.target.y);
      context.setLineDash([3 * line, 2 * line]);
      context.strokeStyle = "#2f7cf6";
      context.lineWidth = line;
      context.beginPath();
      context.moveTo(u, v);
      context.lineTo(a, b);
      context.stroke();
      context.setLineDash([]);
      context.beginPath();
      context.arc(a, b, 4 * line, 0, 2 * Math.PI);
      context.stroke();
    }
    context.save();
    context.translate(u, v);
    context.rotate(-robot.yaw);
    context.beginPath();
    context.roundRect(-ROBOT_M.back * scale, -ROBOT_M.side * scale, (ROBOT_M.front + ROBOT_M.back) * scale, 2 * ROBOT_M.side * scale, 0.12 * scale);
    context.fillStyle = "rgba(47, 124, 246, 0.85)";
    context.fill();
    context.strokeStyle = "white";
    context.lineWidth = line;
    context.stroke();
    context.beginPath();
    context.moveTo(0.05 * scale, -0.13 * scale);
    context.lineTo(0.26 * scale, 0);
    context.lineTo(0.05 * scale, 0.13 * scale);
    context.stroke();
    context.restore();
    const [h, k] = spot(robot.hand[0], robot.hand[1]);
    context.beginPath();
    context.arc(h, k, 2.6 * line, 0, 2 * Math.PI);
    context.fillStyle = "#ff9d2e";
    context.fill();
    context.stroke();
  }
}
