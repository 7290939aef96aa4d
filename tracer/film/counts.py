"""What a picture took, in whole numbers: rays by kind, how paths ended, what was hit.

They are the same for any number of threads, any size of bands and any number of interruptions, so files may
hold them. Counts are dicts of numbers, of lists of numbers, and of such dicts.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

RAYS = ("primary", "shadow", "reflected", "refracted", "total_reflection")
"""Kinds of rays."""

COUNTS = (
    "rays",
    "total_internal",
    "ended_by_cutoff",
    "ended_by_depth",
    "deepest_level",
    "hits",
    "refined_pixels",
)
"""What of `Result.stats` are counts; `hits`, a number a shape, only where they were asked for,
`refined_pixels` only in adaptive pictures."""

_LARGEST = "deepest_level"


def together(some: Mapping[str, Any], more: Mapping[str, Any]) -> dict[str, Any]:
    """The counts of two parts of a picture, or of two pictures, as one; what either lacks is not known."""
    return {name: _sum(name, some[name], more[name]) for name in some if name in more}


def _sum(name: str, some: Any, more: Any) -> Any:
    if isinstance(some, Mapping):
        return together(some, more)
    if isinstance(some, list):
        return [a + b for a, b in zip(some, more, strict=True)]
    return max(some, more) if name == _LARGEST else some + more


def number_of_rays(counts: Mapping[str, int]) -> int:
    """Rays of all kinds."""
    return sum(counts[kind] for kind in RAYS)


def by_name(counts: Mapping[str, Any]) -> dict[str, Any]:
    """Counts as `Result.stats` has them, rays by kind in a dict of their own."""
    others = {name: count for name, count in counts.items() if name not in RAYS}
    return {"rays": {kind: counts[kind] for kind in RAYS}} | others


def counts_in(stats: Mapping[str, Any]) -> dict[str, Any]:
    """What of `Result.stats` are counts."""
    return {name: stats[name] for name in COUNTS if name in stats}


def header_of(stats: Mapping[str, Any]) -> dict[str, str | int]:
    """Counts as attributes of a file, `hitsPerShape` as text."""
    found = {f"rays{kind.title().replace('_', '')}": count for kind, count in stats.get("rays", {}).items()}
    names = {
        "deepest_level": "deepestLevel",
        "ended_by_cutoff": "pathsEndedByWeight",
        "ended_by_depth": "pathsEndedByDepth",
        "refined_pixels": "refinedPixels",
    }
    found |= {attribute: stats[name] for name, attribute in names.items() if name in stats}
    hits = {"hitsPerShape": " ".join(map(str, stats["hits"]))} if "hits" in stats else {}
    return found | hits
