// The rays of a pixel: lines over the picture, as thick as they weigh, and rows with their weights and shapes.

const SVG = "http://www.w3.org/2000/svg";
const NAMES = { primary: "primary", reflected: "mirrored", refracted: "refracted", total_reflection: "total reflection" };

export class Lens {
  #lines = document.getElementById("rays");
  #rows = document.getElementById("branches");
  #section = document.getElementById("tree");

  constructor(link) {
    link.on("tree", (tree) => this.#show(tree));
    document.getElementById("close-tree").addEventListener("click", () => this.clear());
  }

  clear() {
    this.#section.hidden = true;
    this.#lines.replaceChildren();
    this.#rows.replaceChildren();
  }

  #show({ x, y, rays }) {
    this.clear();
    this.#section.hidden = false;
    document.getElementById("pixel").textContent = `${x}, ${y}`;
    for (const ray of rays) {
      const line = this.#line(ray);
      const row = this.#row(ray);
      if (line) {
        this.#lines.append(line);
        row.addEventListener("pointerenter", () => line.classList.add("pointed"));
        row.addEventListener("pointerleave", () => line.classList.remove("pointed"));
      }
      this.#rows.append(row, ...ray.ended.map((end) => this.#end(end, ray.level + 1)));
    }
  }

  #line({ ray, weight, line }) {
    if (!line) return null;
    const made = document.createElementNS(SVG, "line");
    const [[x1, y1], [x2, y2]] = line;
    const numbers = { x1, y1, x2, y2, "stroke-width": 1.2 + 3 * weight, "stroke-opacity": 0.55 + 0.45 * weight };
    for (const [name, value] of Object.entries(numbers)) made.setAttribute(name, value);
    made.classList.add(ray);
    return made;
  }

  #row({ ray, level, weight, shape, adds }) {
    const row = this.#text(level, ray, `${weight.toFixed(3)} ${NAMES[ray]} → ${shape ?? "nothing"}`);
    const swatch = document.createElement("span");
    swatch.className = "swatch";
    swatch.title = `adds ${adds.map((part) => part.toFixed(3)).join(", ")}`;
    swatch.style.background = `rgb(${adds.map((part) => Math.round(255 * Math.min(1, part))).join(" ")})`;
    row.append(swatch);
    return row;
  }

  #end({ ray, weight, reason }, level) {
    const row = this.#text(level, ray, `${weight.toFixed(3)} ${NAMES[ray]}: ${reason}`);
    row.classList.add("ended");
    return row;
  }

  #text(level, ray, text) {
    const row = document.createElement("li");
    row.style.paddingLeft = `${4 + 12 * level}px`;
    const mark = document.createElement("span");
    mark.classList.add("mark", ray);
    row.append(mark, text);
    return row;
  }
}
