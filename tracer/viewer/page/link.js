// The connection to the tracer: messages as JSON, pictures as a JSON header and a JPEG.

export class Link {
  #socket = null;
  #handlers = {};
  #gesture = 0;
  #sent = new Set(); // stamps of changes that no picture has shown yet
  stamp = 0; // of the last change that was sent

  constructor() {
    this.#open();
  }

  on(kind, handler) {
    this.#handlers[kind] = handler;
  }

  // A new gesture: what is sent from now on is undone as one step.
  gesture() {
    this.#gesture += 1;
  }

  change(kind, values = {}) {
    this.stamp = performance.now();
    this.#sent.add(this.stamp);
    this.send({ kind, ...values, stamp: this.stamp, gesture: this.#gesture });
  }

  // Whether this page sent that change, and not another one; what came before it is forgotten.
  sent(stamp) {
    if (!this.#sent.has(stamp)) return false;
    for (const older of this.#sent) if (older <= stamp) this.#sent.delete(older);
    return true;
  }

  send(message) {
    if (this.#socket.readyState === WebSocket.OPEN) this.#socket.send(JSON.stringify(message));
  }

  #open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/talk`);
    socket.binaryType = "arraybuffer";
    socket.onmessage = ({ data }) => {
      if (typeof data === "string") {
        const { kind, ...values } = JSON.parse(data);
        this.#handlers[kind]?.(values);
      } else {
        const length = new DataView(data).getUint32(0, true);
        const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
        this.#handlers.frame?.(header, new Uint8Array(data, 4 + length));
      }
    };
    socket.onclose = () => {
      this.#handlers.closed?.();
      this.#handlers.notice?.({ text: "the tracer has ended; this page waits for it" });
      setTimeout(() => this.#open(), 2000);
    };
    this.#socket = socket;
  }
}
