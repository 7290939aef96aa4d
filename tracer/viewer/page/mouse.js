// Mouse, touch and keys over the picture: orbit, pan, dolly, and a click for the rays of a pixel.

const DEGREES = 180; // of an orbit across the height of the picture
const CLICK = 4; // pixels within which a press is a click
const WHEEL_PAUSE = 400; // milliseconds after which the wheel begins a gesture of its own
const KEYS = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export function listen(picture, link) {
  const canvas = picture.canvas;
  const down = new Map(); // place of every finger or button, by pointer
  let drag = null;
  let spread = 0; // pixels between two fingers
  let moved = [0, 0];
  let waiting = false;
  let wheeled = 0;

  const grab = () => {
    link.gesture();
    link.send({ kind: "grab" });
  };

  // One message for each picture of the screen, however often the mouse reports.
  const flush = () => {
    waiting = false;
    const [right, below] = moved;
    moved = [0, 0];
    if (!drag || (right === 0 && below === 0)) return;
    if (drag.pans) link.change("pan", { right, down: below });
    else link.change("orbit", { left: -DEGREES * right, up: -DEGREES * below });
  };

  // Two fingers: nearer by as much as they part.
  const pinch = () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      const now = apart(down);
      if (now > 0 && spread > 0 && now !== spread) link.change("dolly", { share: 1 - spread / now });
      spread = now;
    });
  };

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    down.set(event.pointerId, [event.clientX, event.clientY]);
    if (down.size > 1) {
      drag = null;
      spread = apart(down);
      grab();
      return;
    }
    drag = { pans: event.button === 2 || event.shiftKey, from: [event.clientX, event.clientY], far: false, last: picture.place(event) };
    moved = [0, 0];
  });
  canvas.addEventListener("pointermove", (event) => {
    if (down.has(event.pointerId)) down.set(event.pointerId, [event.clientX, event.clientY]);
    if (down.size > 1) pinch();
    if (!drag) return;
    if (!drag.far) {
      if (Math.hypot(event.clientX - drag.from[0], event.clientY - drag.from[1]) < CLICK) return;
      drag.far = true;
      grab();
    }
    const [x, y] = picture.place(event);
    const box = canvas.getBoundingClientRect();
    moved = [moved[0] + ((x - drag.last[0]) * box.width) / box.height, moved[1] + y - drag.last[1]];
    drag.last = [x, y];
    if (!waiting) {
      waiting = true;
      requestAnimationFrame(flush);
    }
  });
  canvas.addEventListener("pointerup", (event) => {
    down.delete(event.pointerId);
    flush();
    const [x, y] = picture.place(event);
    const inside = x >= 0 && x <= 1 && y >= 0 && y <= 1;
    if (drag && !drag.far && event.button === 0 && inside) link.send({ kind: "look", x, y });
    drag = null;
  });
  canvas.addEventListener("pointercancel", (event) => {
    down.delete(event.pointerId);
    drag = null;
  });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      if (performance.now() - wheeled > WHEEL_PAUSE) grab();
      wheeled = performance.now();
      link.change("dolly", { share: 1 - Math.exp(Math.max(-1, Math.min(1, event.deltaY / 500))) });
    },
    { passive: false },
  );
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key in KEYS) {
      grab();
      const [left, up] = KEYS[event.key];
      if (event.shiftKey) link.change("pan", { right: -left / 20, down: up / 20 });
      else link.change("orbit", { left: 5 * left, up: 5 * up });
    } else if (event.key === "+" || event.key === "-") {
      grab();
      link.change("dolly", { share: event.key === "+" ? 0.1 : -0.1 });
    } else if (event.key === "Enter") link.send({ kind: "look", x: 0.5, y: 0.5 });
    else return;
    event.preventDefault();
  });
}

function apart(down) {
  if (down.size < 2) return 0;
  const [[x, y], [u, v]] = down.values();
  return Math.hypot(x - u, y - v);
}
