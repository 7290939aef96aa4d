// The panel: sliders of the scene, the document's choices, the camera's moves. The tracer says what there is.

const STEPS = 1000;
const OPEN = new Set(["Scene", "Lights"]);

const element = (tag, properties = {}, ...children) => {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
};

const tell = (text) => (document.getElementById("notice").textContent = text);

export class Panel {
  #link;
  #sliders = new Map();
  #pending = new Map();

  constructor(link) {
    this.#link = link;
    this.camera = "";
    this.revision = -1; // of the values on display
    this.controls = []; // as the tracer describes them
    this.heard = 0; // stamp of the last change that they include
    this.#buttons();
    link.on("panel", (panel) => this.#build(panel));
    link.on("values", (values) => this.#show(values));
  }

  onresolution = () => {};

  #buttons() {
    const link = this.#link;
    const on = (selector, action) => document.querySelectorAll(selector).forEach((button) => button.addEventListener("click", () => action(button)));
    const number = (id) => Number(document.getElementById(id).value) || 0;
    on("[data-rotate]", (button) => {
      const [x, y] = button.dataset.rotate.split(" ").map(Number);
      link.gesture();
      link.change("rotate", { x_rotate: x * number("degrees"), y_rotate: y * number("degrees") });
    });
    on("[data-move]", (button) => {
      link.gesture();
      link.change("move", { by: button.dataset.move.split(" ").map((step) => step * number("units")) });
    });
    on("[data-save]", (button) => {
      const what = button.dataset.save;
      tell("saving …");
      link.send(what === "scene" ? { kind: "save_scene" } : { kind: "save_still", suffix: what });
    });
    on("#reset", () => this.#step("reset"));
    on("#undo", () => this.#step("undo"));
    on("#copy", () => this.#copy());
    document.getElementById("focus").addEventListener("change", ({ target }) => this.#step("focus", { value: target.checked }));
    document.getElementById("layer").addEventListener("change", ({ target }) => this.#step("show", { layer: target.value }));
    document.addEventListener("keydown", (event) => {
      if (event.target.matches("input:not([type=range]), select, textarea")) return;
      if (event.key === "z") this.#step("undo");
      if (event.key === "r" && !event.ctrlKey && !event.metaKey) this.#step("reset");
    });
  }

  async #copy() {
    if (navigator.clipboard) {
      await navigator.clipboard.writeText(this.camera);
      tell("copied");
    } else {
      // Browsers keep the clipboard from pages of other machines that come without encryption.
      getSelection().selectAllChildren(document.getElementById("toml"));
      tell("the text is selected; copy it with Ctrl-C");
    }
  }

  #step(kind, values = {}) {
    this.#link.gesture();
    this.#link.change(kind, values);
  }

  #build({ scene, resolution, controls, choices, layers, comparison }) {
    document.getElementById("scene").textContent = scene;
    document.title = `${scene} · tracer view`;
    document.getElementById("compare").hidden = !comparison;
    document.getElementById("layer").replaceChildren(...layers.map(([value, text]) => element("option", { value, textContent: text })));
    this.onresolution(...resolution);
    this.controls = controls;
    this.#choices(choices);
    this.#controls(controls);
  }

  #choices(choices) {
    const section = document.getElementById("choices");
    section.hidden = choices.length === 0;
    section.querySelectorAll(".choice").forEach((row) => row.remove());
    for (const { name, label, answers } of choices) {
      const radios = answers.map((answer, number) => {
        const radio = element("input", { type: "radio", name: `choice-${name}`, value: String(number) });
        radio.addEventListener("change", () => this.#step("choose", { name, value: number === 1 }));
        return element("label", {}, radio, ` ${answer}`);
      });
      section.append(element("div", { className: "choice" }, element("span", { textContent: label }), ...radios));
    }
  }

  #controls(controls) {
    const place = document.getElementById("controls");
    const open = new Set([...place.querySelectorAll("details[open]")].map((group) => group.dataset.group));
    const first = place.childElementCount === 0;
    place.replaceChildren();
    this.#sliders.clear();
    const groups = new Map();
    let heading = null;
    for (const control of controls) {
      if (!groups.has(control.group)) {
        const group = element("details", { open: first ? OPEN.has(control.group) : open.has(control.group) }, element("summary", { textContent: control.group }));
        group.dataset.group = control.group;
        groups.set(control.group, group);
        place.append(group);
        heading = "";
      }
      const group = groups.get(control.group);
      if (control.heading !== heading) {
        heading = control.heading;
        group.append(element("h3", { textContent: heading }));
      }
      group.append(this.#control(control));
    }
  }

  #control(control) {
    const range = element("input", { type: "range", min: 0, max: STEPS, step: 1 });
    const number = element("input", { type: "number", step: "any" });
    range.dataset.control = number.dataset.number = control.name;
    range.setAttribute("aria-label", `${control.heading} ${control.label}`);
    number.setAttribute("aria-label", `${control.heading} ${control.label}`);
    range.addEventListener("pointerdown", () => this.#link.gesture());
    range.addEventListener("keydown", () => this.#link.gesture());
    range.addEventListener("input", () => {
      const value = fromStep(control, Number(range.value));
      number.value = shown(value);
      this.#soon(control.name, value);
    });
    number.addEventListener("change", () => {
      this.#link.gesture();
      this.#soon(control.name, Number(number.value));
    });
    this.#sliders.set(control.name, { control, range, number, value: NaN });
    return element("div", { className: "control" }, element("span", { textContent: control.label }), range, number);
  }

  // One message for each picture of the screen, with the last value of each slider.
  #soon(name, value) {
    if (this.#pending.size === 0) {
      requestAnimationFrame(() => {
        for (const [control, last] of this.#pending) this.#link.change("set", { name: control, value: last });
        this.#pending.clear();
      });
    }
    this.#pending.set(name, value);
    this.#sliders.get(name).value = NaN; // whatever comes of it is shown
  }

  #show({ values, choices, layer, camera, focus, undo, revision, heard }) {
    for (const [name, value] of Object.entries(values)) {
      const slider = this.#sliders.get(name);
      if (!slider || value === null || value === slider.value) continue;
      slider.value = value;
      const { control, range, number } = slider;
      if (!range.matches(":active") && !this.#pending.has(name)) range.value = toStep(control, value);
      if (document.activeElement !== number) number.value = shown(value);
    }
    for (const [name, value] of Object.entries(choices)) {
      const radio = document.querySelector(`input[name="choice-${name}"][value="${Number(value)}"]`);
      if (radio) radio.checked = true;
    }
    document.getElementById("layer").value = layer;
    document.getElementById("focus").checked = focus;
    document.getElementById("undo").disabled = undo === 0;
    if (camera !== this.camera) document.getElementById("toml").textContent = this.camera = camera;
    this.revision = revision;
    this.heard = heard;
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
