"""The page of a run: one HTML file with everything in it, in the look of the cross-validation's report."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from reference.bench.rays import KINDS
from reference.bench.records import PEERS, Benchmark, Group
from reference.bench.report import units
from reference.bench.report.headline import headline_of
from reference.bench.report.plots import draw_curve, draw_rates, draw_ratios
from reference.bench.report.scaling import scaling_of, title_of
from reference.report import look, svg
from reference.report.header import COMMAND

TEMPLATES = Path(__file__).resolve().parent / "templates"


def page_of(benchmark: Benchmark) -> str:
    """The text of the page; it loads nothing."""
    environment = look.environment(TEMPLATES)
    for name in ("duration", "ratio", "million", "mebibytes"):
        environment.filters[name] = getattr(units, name)
    meshes = list(dict.fromkeys(rate.mesh for rate in benchmark.rates))
    with svg.style():
        drawings = {group.name: _drawing(group) for group in benchmark.groups}
        rates = {
            mesh: _svg(draw_rates(benchmark.rates, mesh), f"rates-{number}", f"Rays a second, mesh {mesh}")
            for number, mesh in enumerate(meshes)
        }
    return environment.get_template("bench.html.j2").render(
        benchmark=benchmark,
        facts={name: value for name, value in benchmark.header.items() if name != COMMAND},
        command=benchmark.header.get(COMMAND, ""),
        headline=headline_of(benchmark),
        peers=PEERS,
        kinds=KINDS,
        meshes=meshes,
        drawings=drawings,
        rates=rates,
        scaling=scaling_of(benchmark),
        title_of=title_of,
        css=look.css() + (TEMPLATES / "bench.css").read_text(encoding="utf-8"),
        script=look.script(),
    )


def _drawing(group: Group) -> str:
    figure = draw_ratios(group) if group.name == "scenes" else draw_curve(group)
    return _svg(figure, f"plot-{group.name}", group.title)


def _svg(figure: Figure, name: str, description: str) -> str:
    return svg.svg_of(figure, name, description)
