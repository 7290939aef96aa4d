"""`--stats`: where the time went, rays by kind, hits by shape, how paths ended, kernels and memory; as text
and as JSON."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from tracer.cli import STARTED
from tracer.film.atomic import atomic_write
from tracer.film.counts import counts_in
from tracer.film.result import Result
from tracer.scene import Scene

MOST_SHAPES = 8
"""That the text names; the file has them all."""


def seconds_since_start() -> float:
    """Seconds since this process started (Linux), elsewhere since the package `tracer.cli` was imported."""
    try:
        with open("/proc/self/stat", encoding="ascii", errors="replace") as file:
            ticks = int(file.read().rpartition(")")[2].split()[19])  # field 22 of proc(5): starttime
        return time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, AttributeError):
        return time.perf_counter() - STARTED


def peak_memory() -> int | None:
    """The most memory this process held so far, in bytes; None where the system does not say (Windows)."""
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def picture_statistics(result: Result, scene: Scene, seconds: Mapping[str, float]) -> dict[str, Any]:
    """All that is told of one picture, ready for JSON; `seconds` by phase, in the order in which they
    passed."""
    settings = [name for name in ("supersample", "threshold", "backend", "precision") if name in result.stats]
    return {
        "scene": result.scene_name,
        "scene_hash": result.scene_hash,
        "tracer": result.version,
        "resolution": list(result.resolution or ()),
        "crop": list(result.crop or ()),
        **{name: result.stats[name] for name in settings},
        **counts_with_names(counts_in(result.stats), scene),
        "seconds": dict(seconds),
        "kernels": result.kernels,
        "peak_memory": peak_memory(),
    }


def counts_with_names(counts: dict[str, Any], scene: Scene) -> dict[str, Any]:
    """Counts, `hits` as a list of tables; null where a part of the work was done without counting them."""
    hits = counts.get("hits")
    return counts | {
        "hits": hits
        and [
            {"shape": number, "kind": shape.kind, "name": shape.name, "hits": count}
            for number, (shape, count) in enumerate(zip(scene.shapes, hits, strict=True))
        ]
    }


def save_statistics(statistics: Mapping[str, Any], file: str | os.PathLike[str]) -> None:
    """Writes them as JSON; raises `OutputError`."""
    with atomic_write(file) as temporary:
        temporary.write_text(json.dumps(statistics, indent=2) + "\n", encoding="utf-8")


def format_statistics(statistics: Mapping[str, Any]) -> str:
    """The report on one picture."""
    kernels = statistics["kernels"]
    rows = [
        ("seconds", _listed(f"{phase} {value:.2f}" for phase, value in statistics["seconds"].items())),
        *count_rows(statistics),
        (
            "kernels",
            f"{kernels['compiled']} compiled, {kernels['from_disk']} read from the disk cache, "
            f"{kernels['reused']} reused",
        ),
        ("peak memory", in_mebibytes(statistics["peak_memory"])),
    ]
    return as_table(rows)


def count_rows(statistics: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The rows of a report that say what was counted."""
    rays = statistics["rays"]
    kinds = _listed(f"{kind.replace('_', ' ')} {count}" for kind, count in rays.items())
    refined = (
        [("refined", f"{statistics['refined_pixels']} pixels")] if "refined_pixels" in statistics else []
    )
    return [
        *refined,
        ("rays", f"{sum(rays.values())}: {kinds}"),
        ("hits", _most_hit(statistics["hits"])),
        ("deepest level", str(statistics["deepest_level"])),
        (
            "paths ended",
            f"by weight {statistics['ended_by_cutoff']}, by depth {statistics['ended_by_depth']}",
        ),
    ]


def _most_hit(hits: Sequence[Mapping[str, Any]] | None) -> str:
    if hits is None:
        return "unknown: a part of the work was done without --stats"
    order = sorted(hits, key=lambda shape: -shape["hits"])
    shown = [f"{shape['name'] or 'shape {}'.format(shape['shape'])} {shape['hits']}" for shape in order]
    rest = len(shown) - MOST_SHAPES
    return _listed([*shown[:MOST_SHAPES], *([f"and {rest} more"] if rest > 0 else [])]) or "none"


def as_table(rows: Iterable[tuple[str, str]]) -> str:
    """Rows of a name and its value."""
    return "\n".join(f"{name:<14}{value}" for name, value in rows)


def in_mebibytes(size: int | None) -> str:
    """A size in words."""
    return "unknown" if size is None else f"{size / 2**20:.0f} MiB"


def _listed(parts: Iterable[str]) -> str:
    return ", ".join(parts)
