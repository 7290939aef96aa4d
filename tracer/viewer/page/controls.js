// The controls of the scene: a slider with a number for each number, a swatch for each color.

import { element } from "./element.js";

const STEPS = 1000;
const OPEN = new Set(["Scene", "Lights"]);

export class Controls {
  #link;
  #place = document.getElementById("controls");
  #widgets = new Map(); // by name: whether it is held, and how it shows a value
  #pending = new Map();

  constructor(link) {
    this.#link = link;
    this.all = []; // as the tracer describes them
  }

  build(controls) {
    const open = new Set([...this.#place.querySelectorAll("details[open]")].map((group) => group.dataset.group));
    const first = this.#place.childElementCount === 0;
    this.all = controls;
    this.#place.replaceChildren();
    this.#widgets.clear();
    const groups = new Map();
    let heading = null;
    for (const control of controls) {
      if (!groups.has(control.group)) {
        const group = element("details", { open: (first ? OPEN : open).has(control.group) }, element("summary", { textContent: control.group }));
        group.dataset.group = control.group;
        groups.set(control.group, group);
        this.#place.append(group);
        heading = "";
      }
      const group = groups.get(control.group);
      if (control.heading !== heading) {
        heading = control.heading;
        group.append(element("h3", { textContent: heading }));
      }
      const inputs = control.kind === "color" ? this.#swatch(control) : this.#slider(control);
      for (const input of inputs) input.setAttribute("aria-label", `${control.heading} ${control.label}`.trim());
      group.append(element("div", { className: `control ${control.kind}` }, element("span", { textContent: control.label }), ...inputs));
    }
  }

  show(values) {
    for (const [name, value] of Object.entries(values)) {
      const widget = this.#widgets.get(name);
      if (!widget || value === null || String(value) === widget.value) continue;
      widget.value = String(value);
      widget.show(value, this.#pending.has(name));
    }
  }

  #slider(control) {
    const { name } = control;
    const range = element("input", { type: "range", min: 0, max: STEPS, step: 1 });
    const number = element("input", { type: "number", step: "any" });
    range.dataset.control = number.dataset.number = name;
    range.addEventListener("pointerdown", () => this.#link.gesture());
    range.addEventListener("keydown", () => this.#link.gesture());
    range.addEventListener("input", () => {
      const value = fromStep(control, Number(range.value));
      number.value = shown(value);
      this.#soon("set", { name, value });
    });
    number.addEventListener("change", () => {
      this.#link.gesture();
      this.#soon("set", { name, value: Number(number.value) });
    });
    this.#widgets.set(name, {
      value: "",
      show: (value, held) => {
        if (!range.matches(":active") && !held) range.value = toStep(control, value);
        if (document.activeElement !== number) number.value = shown(value);
      },
    });
    return [range, number];
  }

  // The field of the browser knows 8 bits a channel; the scene keeps its own numbers until that is used.
  #swatch({ name }) {
    const field = element("input", { type: "color" });
    const code = element("output");
    field.dataset.color = name;
    field.addEventListener("click", () => this.#link.gesture());
    field.addEventListener("input", () => this.#soon("paint", { name, color: (code.value = field.value) }));
    this.#widgets.set(name, {
      value: "",
      show: (color, held) => {
        if (!held) field.value = code.value = hex(color);
        field.title = `sRGB ${color.map(shown).join(", ")}`;
      },
    });
    return [field, code];
  }

  // One message for each picture of the screen, with the last value of each control.
  #soon(kind, values) {
    if (this.#pending.size === 0) {
      requestAnimationFrame(() => {
        for (const [what, last] of this.#pending.values()) this.#link.change(what, last);
        this.#pending.clear();
      });
    }
    this.#pending.set(values.name, [kind, values]);
    this.#widgets.get(values.name).value = ""; // whatever comes of it is shown
  }
}

const toStep = ({ low, high, logarithmic }, value) =>
  STEPS * (logarithmic ? Math.log(Math.max(value, low) / low) / Math.log(high / low) : (value - low) / (high - low));

const fromStep = ({ low, high, logarithmic }, step) => {
  if (step === 0) return low;
  if (step === STEPS) return high;
  return logarithmic ? low * (high / low) ** (step / STEPS) : low + ((high - low) * step) / STEPS;
};

const shown = (value) => String(Number(value.toPrecision(4)));

const hex = (color) => `#${color.map((part) => Math.round(255 * part).toString(16).padStart(2, "0")).join("")}`;
