"""A replayed ray as text: a block for each vertex, a column for each side."""

from __future__ import annotations

import math

import tracer
from reference.comparison.decisions import ELSEWHERE
from reference.comparison.replay import DEEPEST, MOST, Vertex
from reference.comparison.replay_sides import SIDES, Side
from tracer.lights import AreaLight

WIDTH = 24
"""Characters of a column: a double takes up to 24."""

LETTERS = {"R": "mirrored", "T": "refracted"}


def replay_text(scene: tracer.Scene, vertices: list[Vertex], origin: list[float], way: list[float]) -> str:
    """All vertices, with a line that says where a side hits something else than the others."""
    blocks = [f"{scene.name}: ray {_numbers(origin)} -> {_numbers(way)}"]
    reached = {vertex.events for vertex in vertices}
    blocks += [_block(scene, vertex, reached) for vertex in vertices]
    if len(vertices) >= MOST or any(len(vertex.events) >= DEEPEST - 1 for vertex in vertices):
        blocks.append(f"shown are at most {MOST} vertices and {DEEPEST} along a chain")
    return "\n\n".join(blocks)


def color_text(colors: list[list[float]]) -> str:
    """The color of a pixel by all sides; the plain version stands in for extended precision."""
    lines = ["color of the pixel, one ray", _line("", [*SIDES[:-1], "plain version"])]
    for channel, name in enumerate(("red", "green", "blue")):
        lines.append(_line(name, [_number(color[channel]) for color in colors]))
    return "\n".join(lines)


def _block(scene: tracer.Scene, vertex: Vertex, reached: set[str]) -> str:
    """One vertex; of its directions those that lead to another one."""
    way = ", then ".join(LETTERS[letter] for letter in vertex.events) or "the first"
    lines = [f"vertex {vertex.events or '-'}: {way}; weight {vertex.weight:g}"]
    lines.append(_line("", list(SIDES)))
    sides = [vertex.sides[name] for name in SIDES]
    lines.append(_line("hits", [_hit(scene, side) for side in sides]))
    if all(side.shape < 0 for side in sides):
        return "\n".join(lines)
    lines.append(_line("distance", [_number(side.t) for side in sides]))
    leads = [word for letter, word in LETTERS.items() if vertex.events + letter in reached]
    for name in ("position", *leads):
        for axis, letter in enumerate("xyz"):
            lines.append(_line(f"{name} {letter}", [_number(getattr(side, name)[axis]) for side in sides]))
    for number, light in enumerate(scene.lights):
        label = f"light {light.name or number}"
        samples = light.samples if isinstance(light, AreaLight) else 1
        seen = [str(side.seen[number]) if side.seen else "" for side in sides]
        lines.append(_line(label, [f"{n} of {samples}" if n else "" for n in seen]))
    lines += _remarks(sides)
    return "\n".join(lines)


def _remarks(sides: list[Side]) -> list[str]:
    """What does not agree, in words."""
    found = []
    if len({(side.shape, side.primitive) for side in sides}) > 1:
        found.append("  the sides hit different things")
    longest = max(side.t for side in sides if side.shape >= 0)
    if any(longest - side.t > ELSEWHERE * longest for side in sides if side.shape >= 0):
        found.append("  the sides hit the same thing at different places")
    if len({tuple(side.seen) for side in sides}) > 1:
        found.append("  the sides see different lights")
    return found


def _hit(scene: tracer.Scene, side: Side) -> str:
    if side.shape < 0:
        return "nothing"
    name = scene.shapes[side.shape].name or f"shape {side.shape}"
    text = name if side.primitive == 0 else f"{name}, {side.primitive}"
    return text if len(text) <= WIDTH else text[: WIDTH - 3] + "..."


def _line(label: str, cells: list[str]) -> str:
    return f"  {label[:16]:<18}" + "".join(f"{cell:<{WIDTH + 2}}" for cell in cells).rstrip()


def _number(value: float) -> str:
    return "-" if math.isnan(value) else repr(value)


def _numbers(values: list[float]) -> str:
    return "[" + ", ".join(map(repr, values)) + "]"
