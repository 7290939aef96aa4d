"""What a user may do on the page of the viewer: drag, slide, and wander about at random."""

from __future__ import annotations

import random
from collections.abc import Callable
from typing import Any

AT_REST = "() => window.viewer?.picture?.header?.final"

DRAG = """() => {
  const box = viewer.picture.canvas.getBoundingClientRect();
  number += 1;
  viewer.picture.canvas.dispatchEvent(new PointerEvent("pointermove", {
    clientX: box.x + box.width / 2 + 150 * Math.sin(number / 60),
    clientY: box.y + box.height / 2 + 20 * Math.sin(number / 45),
  }));
}"""
"""Orbits, to and fro, once the button is down."""

SLIDE = """() => {
  const sliders = document.querySelectorAll("[data-control]");
  const range = sliders[Math.floor(number / 40) % sliders.length];
  range.value = Math.abs(number % 40 - 20) * 50;
  range.dispatchEvent(new Event("input"));
  number += 1;
}"""
"""Moves every slider to its end and back, one after the other."""


def grip(page: Any) -> None:
    """Presses the button over the middle of the picture."""
    box = page.locator("#picture").bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()


CHANGE = "([kind, values]) => viewer.link.change(kind, values)"
SET = """([which, share]) => {
  const { controls } = viewer.panel; // other choices have other ones
  const { name, kind, low, high } = controls[Math.floor(which * controls.length)];
  if (kind === "number") viewer.link.change("set", { name, value: low + share * (high - low) });
  const color = `#${Math.floor(share * 2 ** 24).toString(16).padStart(6, "0")}`;
  if (kind === "color") viewer.link.change("paint", { name, color });
}"""
CUTOFFS = (0.05, 0.03, 0.011)


def wander(page: Any, seed: int) -> Callable[[], None]:
    """Whatever a user may do, at random, but for saving."""
    chance = random.Random(seed)
    layers = page.locator("#layer option").evaluate_all("options => options.map(({value}) => value)")
    choices = page.locator("#choices input[value='0']").evaluate_all("radios => radios.map(({name}) => name)")
    choices = [name.removeprefix("choice-") for name in choices]

    def step() -> None:
        kind = chance.randrange(1000)
        if kind < 400:
            angles = {"left": chance.uniform(-5, 5), "up": chance.uniform(-2, 2)}
            page.evaluate(CHANGE, ["orbit", angles])
        elif kind < 830:
            page.evaluate(SET, [chance.random(), chance.random()])
        elif kind < 850:
            page.evaluate(CHANGE, ["set", {"name": "cutoff", "value": chance.choice(CUTOFFS)}])
        elif kind < 900:
            place = {"kind": "look", "x": chance.random(), "y": chance.random()}
            page.evaluate("(place) => viewer.link.send(place)", place)
        elif kind < 925:
            page.evaluate(CHANGE, ["show", {"layer": chance.choice(layers)}])
        elif kind < 945 and choices:
            answer = {"name": chance.choice(choices), "value": chance.random() < 0.5}
            page.evaluate(CHANGE, ["choose", answer])
        elif kind < 950:
            page.evaluate(CHANGE, ["focus", {"value": chance.random() < 0.3}])
        elif kind < 985:
            page.evaluate("() => viewer.link.gesture()")
            page.evaluate(CHANGE, [chance.choice(("undo", "undo", "reset")), {}])
        elif kind < 987:
            page.evaluate("() => viewer.link.send({ kind: 'compare' })")
        elif kind < 990:
            page.set_viewport_size({"width": chance.randint(400, 1400), "height": chance.randint(400, 900)})
        else:
            page.wait_for_timeout(1500)  # the picture is sharpened
        page.evaluate("() => document.getElementById('comparison').close()")

    return step
