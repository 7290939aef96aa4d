"""What a user may do on the page of the viewer: drag, slide, and wander about at random."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from itertools import product
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
LAYERS = ("color", "rays", "shape")
CHOICES = ("cube", "rabbit")
CUTOFFS = (0.05, 0.03, 0.011)


def visit(page: Any, choices: Sequence[str]) -> None:
    """Shows everything once that has kernels of its own and that `wander` goes to: they stay in memory."""
    for answers in product((False, True), repeat=len(choices)):
        for name, value in zip(choices, answers, strict=True):
            page.evaluate(CHANGE, ["choose", {"name": name, "value": value}])
        page.evaluate("() => { viewer.lens.clear(); viewer.link.send({ kind: 'look', x: 0.5, y: 0.5 }); }")
        page.locator("#tree").wait_for(timeout=120_000)
        for layer, cutoff in product(LAYERS, CUTOFFS):
            page.evaluate(CHANGE, ["show", {"layer": layer}])
            page.evaluate(CHANGE, ["set", {"name": "cutoff", "value": cutoff}])
            page.wait_for_timeout(100)
            page.wait_for_function(AT_REST, timeout=120_000)


def wander(page: Any, choices: Sequence[str], seed: int) -> Callable[[], None]:
    """Whatever a user may do, at random."""
    chance = random.Random(seed)

    def step() -> None:
        kind = chance.randrange(100)
        if kind < 40:
            angles = {"left": chance.uniform(-5, 5), "up": chance.uniform(-2, 2)}
            page.evaluate(CHANGE, ["orbit", angles])
        elif kind < 85:
            page.evaluate(SET, [chance.random(), chance.random()])
        elif kind < 90:
            place = {"kind": "look", "x": chance.random(), "y": chance.random()}
            page.evaluate("(place) => viewer.link.send(place)", place)
        elif kind < 93:
            page.evaluate(CHANGE, ["show", {"layer": chance.choice(LAYERS)}])
        elif kind < 96 and choices:
            answer = {"name": chance.choice(choices), "value": chance.random() < 0.5}
            page.evaluate(CHANGE, ["choose", answer])
        elif kind < 99:
            page.evaluate("() => viewer.link.gesture()")
            page.evaluate(CHANGE, [chance.choice(("undo", "undo", "reset")), {}])
        else:
            page.wait_for_timeout(1500)  # the picture is sharpened

    return step
