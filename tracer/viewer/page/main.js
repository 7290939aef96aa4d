// The page: each part has a file of its own.

import { tell } from "./element.js";
import { Lens } from "./lens.js";
import { Link } from "./link.js";
import { listen } from "./mouse.js";
import { Panel } from "./panel.js";
import { Picture } from "./picture.js";

const link = new Link();
const picture = new Picture(link);
const panel = new Panel(link);
const lens = new Lens(link);
const compare = document.getElementById("compare");

listen(picture, link);
panel.onresolution = (width, height) => picture.shaped(width, height);
link.on("closed", () => picture.forget());
link.on("notice", ({ text }) => {
  tell(text, "problem");
  compare.disabled = false;
});
link.on("saved", ({ file }) => tell(`saved ${file}`));

compare.addEventListener("click", () => {
  compare.disabled = true;
  tell("Mitsuba is rendering …");
  link.send({ kind: "compare" });
});
link.on("compared", ({ ours, theirs, difference, enlarged, largest, rms, visible, pixels }) => {
  compare.disabled = false;
  tell("");
  Object.entries({ ours, theirs, difference }).forEach(([id, url]) => (document.getElementById(id).src = url));
  document.getElementById("verdict").textContent =
    `difference × ${enlarged}: largest ${largest.toPrecision(2)}, RMS ${rms.toPrecision(2)}; ` +
    `${visible} of ${pixels} pixels differ in 8 bits`;
  document.getElementById("comparison").showModal();
});

// What the tests and the measurements read.
window.viewer = { picture, panel, link, lens };
