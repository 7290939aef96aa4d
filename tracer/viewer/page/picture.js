// Draws the pictures as they come, and measures what the user gets: frames a second, and the milliseconds
// from an input to the first picture that shows it.

const WINDOW = 1000; // milliseconds over which frames are counted
const TARGET = 20; // frames a second for which the tracer chooses the size

export class Picture {
  #canvas = document.getElementById("picture");
  #frame = document.getElementById("frame");
  #stage = document.getElementById("stage");
  #context = this.#canvas.getContext("2d", { alpha: false });
  #link;
  #times = [];
  #aspect = 4 / 3;

  constructor(link) {
    this.#link = link;
    this.shown = 0; // frames drawn
    this.latencies = []; // of the last inputs, in milliseconds
    this.drawing = []; // milliseconds that the last frames took to unpack and draw
    this.header = null; // of the frame on the screen
    link.on("frame", (header, jpeg) => this.#draw(header, jpeg));
    new ResizeObserver(() => this.#fit()).observe(this.#stage);
  }

  get canvas() {
    return this.#canvas;
  }

  // The next picture is drawn whatever its number: another tracer counts anew.
  forget() {
    this.header = null;
  }

  shaped(width, height) {
    this.#aspect = width / height;
    this.#fit();
  }

  // The place of a mouse event in shares of the picture.
  place(event) {
    const box = this.#canvas.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  }

  async #draw(header, jpeg) {
    const began = performance.now();
    try {
      const bitmap = await createImageBitmap(new Blob([jpeg], { type: "image/jpeg" }));
      if (!this.header || header.number > this.header.number) this.#put(header, bitmap);
      bitmap.close();
    } finally {
      // In any case: the tracer renders no more while two frames are on their way.
      const now = performance.now();
      this.#link.send({ kind: "ack", frame: header.number, seconds: (now - began) / 1000 });
      this.drawing = [...this.drawing.slice(-499), now - began];
      this.#count(header, now);
    }
  }

  #put(header, bitmap) {
    if (this.#canvas.width !== header.width || this.#canvas.height !== header.height) {
      this.#canvas.width = header.width;
      this.#canvas.height = header.height;
    }
    this.#context.drawImage(bitmap, 0, 0);
    this.header = header;
  }

  #count(header, now) {
    this.shown += 1;
    this.#times = [...this.#times.filter((time) => now - time < WINDOW), now];
    if (this.#link.sent(header.stamp)) {
      this.latencies = [...this.latencies.slice(-499), now - header.stamp];
    }
    document.getElementById("wait").hidden = true;
    const show = (id, text) => (document.getElementById(id).textContent = text);
    show("rate", header.final ? "at rest" : `${this.#times.length} frames/s, wanted: ${TARGET}`);
    show("size", `${header.width} × ${header.height}`);
    show("quality", header.supersample > 1 ? `${header.supersample} × ${header.supersample} rays a pixel` : "1 ray a pixel");
    const milliseconds = (header.seconds.render * 1000).toFixed(0);
    const latency = this.latencies.at(-1);
    show("latency", `${milliseconds} ms to render${latency ? `, ${latency.toFixed(0)} ms from input to picture` : ""}`);
  }

  #fit() {
    const box = this.#stage.getBoundingClientRect();
    const width = Math.max(40, Math.min(box.width - 28, box.height * this.#aspect));
    this.#frame.style.width = `${width}px`;
    this.#frame.style.height = `${width / this.#aspect}px`;
  }
}
