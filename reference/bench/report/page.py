"""The page of a run: one HTML file with everything in it, in the look of the cross-validation's report."""

from __future__ import annotations

from pathlib import Path

from reference.bench.records import PEERS, Benchmark, Group
from reference.bench.report import units
from reference.bench.report.headline import headline_of
from reference.bench.report.plots import draw_quotients, draw_rates, draw_ratios, draw_times
from reference.bench.report.rates import rate_pairs
from reference.bench.report.scaling import scaling_of, title_of
from reference.report import look, svg
from reference.report.header import COMMAND

TEMPLATES = Path(__file__).resolve().parent / "templates"


def page_of(benchmark: Benchmark) -> str:
    """The text of the page; it loads nothing."""
    environment = look.environment(TEMPLATES)
    for name in ("duration", "ratio", "million", "mebibytes"):
        environment.filters[name] = getattr(units, name)
    pairs = rate_pairs(benchmark)
    with svg.style():
        drawings = {group.name: _drawings(group) for group in benchmark.groups}
        rates = {
            mesh: svg.svg_of(draw_rates(pairs, mesh), f"rates-{number}", f"Rays a second, mesh {mesh}")
            for number, mesh in enumerate(dict.fromkeys(pair.mesh for pair in pairs))
        }
    return environment.get_template("bench.html.j2").render(
        benchmark=benchmark,
        facts={name: value for name, value in benchmark.header.items() if name != COMMAND},
        command=benchmark.header.get(COMMAND, ""),
        headline=headline_of(benchmark),
        peers=PEERS,
        drawings=drawings,
        rates=rates,
        pairs=pairs,
        scaling=scaling_of(benchmark),
        title_of=title_of,
        css=look.css() + (TEMPLATES / "bench.css").read_text(encoding="utf-8"),
        script=look.script(),
    )


def _drawings(group: Group) -> list[str]:
    """Bars of scenes, or two curves."""
    if group.name == "scenes":
        return [
            svg.svg_of(draw_ratios(group, peer), f"plot-{peer}", f"{PEERS[peer]}, time over tracer&#39;s")
            for peer in group.peers
            if peer != "tracer"
        ]
    return [
        svg.svg_of(draw_times(group), f"plot-{group.name}", f"{group.title}: time of a frame"),
        svg.svg_of(draw_quotients(group), f"ratios-{group.name}", f"{group.title}: time over tracer&#39;s"),
    ]
