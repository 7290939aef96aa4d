// The panel: the controls of the scene, the document's choices, the camera's moves. The tracer says what there is.

import { Controls } from "./controls.js";
import { element, tell } from "./element.js";

export class Panel {
  #link;
  #controls;

  constructor(link) {
    this.#link = link;
    this.#controls = new Controls(link);
    this.camera = "";
    this.revision = -1; // of the values on display
    this.heard = 0; // stamp of the last change that they include
    this.#buttons();
    link.on("panel", (panel) => this.#build(panel));
    link.on("values", (values) => this.#show(values));
  }

  onresolution = () => {};

  // As the tracer describes them.
  get controls() {
    return this.#controls.all;
  }

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
    on("#reload", () => {
      tell("");
      this.#step("reload");
    });
    on("#undo", () => this.#step("undo"));
    on("#copy", () => this.#copy());
    document.getElementById("focus").addEventListener("change", ({ target }) => this.#step("focus", { value: target.checked }));
    document.getElementById("layer").addEventListener("change", ({ target }) => this.#step("show", { layer: target.value }));
    document.addEventListener("keydown", (event) => {
      if (event.target.matches("input[type=number], select, textarea")) return;
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

  #build({ scene, resolution, step, controls, choices, layers, comparison }) {
    document.getElementById("scene").textContent = scene;
    document.title = `${scene} · tracer view`;
    document.getElementById("compare").hidden = !comparison;
    document.getElementById("layer").replaceChildren(...layers.map(([value, text]) => element("option", { value, textContent: text })));
    document.getElementById("units").defaultValue = step; // until another one is typed
    this.onresolution(...resolution);
    this.#choices(choices);
    this.#controls.build(controls);
  }

  #choices(choices) {
    const section = document.getElementById("choices");
    section.hidden = choices.length === 0;
    section.querySelectorAll(".choice").forEach((row) => row.remove());
    for (const { name, label, answers } of choices) {
      const radios = answers.map((answer, number) => {
        const radio = element("input", { type: "radio", name: `choice-${name}`, value: String(number) });
        radio.addEventListener("change", () => this.#step("choose", { name, value: number === 1 }));
        return element("label", {}, radio, answer);
      });
      section.append(element("div", { className: "choice" }, element("span", { textContent: label }), ...radios));
    }
  }

  #show({ values, choices, layer, camera, focus, undo, revision, heard }) {
    this.#controls.show(values);
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
