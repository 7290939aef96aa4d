"""What the page about a pixel says in words, numbers and tables."""

from __future__ import annotations

import html
from collections.abc import Iterator

from reference.plain import Vec
from tracer_docs.ray_tree import Story, TracedRay
from tracer_docs.themes import numbers, shown


def facts(told: Story) -> dict[str, str]:
    """What the role `{pixel}` knows."""
    root, world = told.rays[0], told.world
    assert root.shape is not None
    material = root.shape.material
    lightest = min(ray.node.weight for ray in told.rays)
    return {
        "column": str(told.column),
        "row": str(told.row),
        "shape": root.name,
        "rays": str(len(told.rays)),
        "levels": str(1 + max(ray.node.level for ray in told.rays)),
        "color": numbers(told.color),
        "hex": hex_of(told.color),
        "ambient": f"{world.ambient:g}",
        "cutoff": f"{world.cutoff:g}",
        "k_a": f"{material.absorption:.3g}",
        "k_r": f"{material.reflection:g}",
        "k_t": f"{material.refraction:g}",
        "ior": f"{material.ior:g}",
        "lightest": f"{lightest:.3g}",
        "cut off": str(sum(share.reason == "cut off" for ray in told.rays for share in ray.ended)),
        "disagreement": f"{told.disagreement:.1e}",
        "shapes": str(len({ray.name for ray in told.rays})),
    }


def hex_of(color: Vec) -> str:
    """#rrggbb as an 8-bit picture stores it."""
    return "#" + "".join(f"{int(255 * channel + 0.5):02x}" for channel in shown(color))


def sentence_about(ray: TracedRay) -> str:
    """Where a ray comes from, how far it goes, what it meets, and what becomes of it."""
    node = ray.node
    if ray.parent is None:
        text = f"From the canvas: {node.t:.0f} units to the {ray.name}. Weight 1."
    else:
        start = {
            "reflected": f"Mirrored at the end of ray {ray.parent}",
            "refracted": f"Bent through the surface at the end of ray {ray.parent}",
            "total_reflection": f"Totally reflected at the end of ray {ray.parent}",
        }[node.kind]
        way = f"{node.t:.0f} units to the {ray.name}" if ray.shape else "and out of the room"
        text = f"{start} (share {node.factor:g}): {way}. Weight {node.weight:.3g}."
    for share in ray.ended:
        text += f" Its own {share.kind} ray would weigh {share.weight:.4f}: {share.reason}."
    return text


def arithmetic(told: Story) -> Iterator[str]:
    """Two lines a channel: the numbers put in, and the value."""
    root = told.rays[0]
    node, a = root.node, told.world.ambient
    assert root.shape is not None
    m = root.shape.material
    for k, channel in enumerate(("red", "green", "blue")):
        arriving = "".join(f" + {child.factor:g} × {child.color[k]:.4f}" for child in node.children)
        light = f"{m.diffuse:g} × {node.diffuse_light[k]:.4f} + {m.specular:g} × {node.specular_light[k]:.4f}"
        own = f"{m.absorption:.3g} × ({light})"
        start = f"{channel:<5} = {node.surface_color[k]:.4f} × [ {a:g} + {1 - a:.3g} × ( "
        yield start + own
        yield f"{' ' * (len(start) - 3)}{arriving} ) ] = {node.color[k]:.6f}"


def ray_table(told: Story) -> Iterator[str]:
    """The table as HTML, because of the color samples in it."""
    titles = ("", "ray", "hits", "own color", "ambient", "diffuse", "highlight", "adds to the pixel")
    yield '<div class="table-wrapper"><table class="docutils pixel-rays"><thead><tr>'
    yield "".join(f"<th>{title}</th>" for title in titles) + "</tr></thead><tbody>"
    for ray in told.rays:
        parts = (f"{mean(part):.4f}" for part in (ray.ambient, ray.diffuse, ray.specular))
        cells = (
            str(ray.number),
            html.escape(ray.node.kind.replace("_", " ")),
            html.escape(ray.name),
            sample(ray.node.surface_color) if ray.shape else "",
            *parts,
            sample(ray.contribution) + numbers(ray.contribution),
        )
        yield "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"
    for name, color in (("sum", told.color), ("tracer.render", told.rendered)):
        yield f'<tr class="sum"><td></td><td colspan="6">{name}</td>'
        yield f"<td>{sample(color)}{numbers(color)}</td></tr>"
    yield "</tbody></table></div>"


def mean(color: Vec) -> float:
    """The mean of the channels."""
    return sum(color) / 3


def sample(color: Vec) -> str:
    """A small square of a color."""
    return f'<span class="sample" style="background:{hex_of(color)}"></span>'
