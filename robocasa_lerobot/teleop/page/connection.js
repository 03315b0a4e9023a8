// The WebSocket: messages as objects, frames with their pictures, and a new try when the line is lost.

const RETRY_MS = [500, 1000, 2000, 4000];

export class Connection {
  /** `on` has functions: open(), closed(reason, again), frame(header, pictures) -> promise, and message(object). */
  constructor(on) {
    this.on = on;
    this.tries = 0;
    this.ended = false; // the session is over: no further try
    this.socket = null;
    this.connect();
  }

  connect() {
    const token = new URLSearchParams(location.search).get("t") ?? "";
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/ws?t=${encodeURIComponent(token)}`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.tries = 0;
      this.on.open();
    };
    socket.onmessage = (event) => {
      if (typeof event.data === "string") this.on.message(JSON.parse(event.data));
      else this.frame(event.data);
    };
    socket.onclose = (event) => {
      const refused = event.code === 1008 || event.code === 1009;
      this.on.closed(event.reason, !refused);
      if (refused || this.ended) return;
      setTimeout(() => this.connect(), RETRY_MS[Math.min(this.tries++, RETRY_MS.length - 1)]);
    };
    this.socket = socket;
  }

  async frame(buffer) {
    const length = new DataView(buffer).getUint32(0);
    const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
    let start = 4 + length;
    const pictures = header.pictures.map((picture) => {
      const blob = new Blob([new Uint8Array(buffer, start, picture.bytes)], { type: "image/jpeg" });
      start += picture.bytes;
      return { camera: picture.camera, blob };
    });
    try {
      await this.on.frame(header, pictures);
    } finally {
      this.send({ type: "ack", frame: header.id });
    }
  }

  send(message) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }
}
