"""A run as `tracer bench` asks for it: what is measured by whom, and which files are written."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from reference.bench.frames import Check, Terms
from reference.bench.peers import hints
from reference.bench.plan import FULL, QUICK, TITLES, Result, Set, Step, steps_of
from reference.bench.records import PEERS, Benchmark, Build, Group, Point, Rate, Series
from reference.bench.report import page_of, summary_of
from reference.bench.scenes import Workshop
from reference.report.destination import Destination
from reference.report.header import COMMAND, machine_facts
from tracer.backends import thread_count
from tracer.errors import MachineError
from tracer.film.atomic import atomic_write

Progress = Callable[[float, float, Step], None]
"""(weight of what is done, of all, the step that ended)."""


@dataclass(frozen=True)
class Request:
    """What is to be measured; `repeat` and `pixels`: None: as the set says; `command`: the line that repeats
    the run."""

    full: bool
    scenes: tuple[str, ...]
    only: tuple[str, ...]
    threads: int
    repeat: int | None
    pixels: int | None
    command: str

    def chosen(self) -> Set:
        """The set, with what is asked for in its place."""
        chosen = FULL if self.full else QUICK
        if self.scenes:
            chosen = replace(chosen, scenes=self.scenes)
        if self.pixels is not None:
            sizes = tuple(size for size in chosen.sizes if size <= self.pixels) or (self.pixels,)
            chosen = replace(
                chosen,
                pixels=self.pixels,
                curve_pixels=min(self.pixels, chosen.curve_pixels),
                query_pixels=min(self.pixels, chosen.query_pixels),
                sizes=sizes,
            )
        return chosen if self.repeat is None else replace(chosen, repeat=self.repeat)

    @property
    def parts(self) -> tuple[str, ...]:
        """With scenes named and no part, only those scenes are measured."""
        return self.only or (("scenes",) if self.scenes else ())


class Files(Destination):
    """Where a benchmark goes."""

    def write(self, benchmark: Benchmark) -> list[str]:
        """Writes all files and returns their names."""
        numbers = json.dumps(to_dict(benchmark), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        texts = {self.page: page_of(benchmark), self.twin: numbers}
        texts |= {self.json: numbers} if self.json else {}
        texts |= {self.summary: summary_of(benchmark)} if self.summary else {}
        for file, text in texts.items():
            with atomic_write(file) as temporary:
                temporary.write_text(text, encoding="utf-8")
        return list(texts)


def run(request: Request, progress: Progress, check: Check) -> Benchmark:
    """Measures; raises `UsageError`, `SceneError`, `MachineError`."""
    missing = hints()
    chosen = request.chosen()
    peers = [peer for peer in PEERS if peer not in missing]
    terms = Terms(peers, request.threads, chosen.repeat, chosen.budget, check)
    with tempfile.TemporaryDirectory(prefix="tracer-bench-") as folder:
        steps = steps_of(chosen, request.parts, terms, Workshop(Path(folder)))
        results: list[tuple[Step, Result]] = []
        with thread_count(request.threads):
            for step in steps:
                results.append((step, _result(step, check)))
                progress(sum(done.weight for done, _ in results), sum(each.weight for each in steps), step)
                check()
    return _gathered(request, chosen, results, [*missing.values(), *_left_out(request)])


def _result(step: Step, check: Check) -> Result:
    """What a step finds. Ctrl-C reaches the processes of other renderers, too: that they fail is then no
    error."""
    try:
        return step.run()
    except MachineError:
        check()
        raise


def _gathered(
    request: Request, chosen: Set, results: Sequence[tuple[Step, Result]], notes: list[str]
) -> Benchmark:
    groups = []
    for part, (title, axis) in TITLES.items():
        points = tuple(found for step, found in results if step.part == part and isinstance(found, Point))
        if points:
            groups.append(Group(part, title, axis, points))
    lists = [found for _, found in results if isinstance(found, list)]
    entries: list[Any] = [entry for found in lists for entry in found]
    facts = machine_facts() | {
        "threads": str(request.threads),
        "rounds": f"{chosen.repeat}, and {chosen.budget:g} s a renderer and picture at most",
        COMMAND: request.command,
    }
    return Benchmark(
        facts,
        tuple(groups),
        tuple(entry for entry in entries if isinstance(entry, Rate)),
        tuple(entry for entry in entries if isinstance(entry, Build)),
        notes,
    )


def _left_out(request: Request) -> list[str]:
    if request.full:
        return []
    return ["This is the short set; the option --full measures everything, and takes its time."]


def to_dict(value: Any) -> Any:
    """Records as JSON has them: series with median and minimum, NaN as null."""
    if isinstance(value, Series):
        return to_dict(value.to_dict())
    if hasattr(value, "__dataclass_fields__"):
        return {name: to_dict(getattr(value, name)) for name in value.__dataclass_fields__}
    if isinstance(value, dict):
        return {key: to_dict(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_dict(entry) for entry in value]
    return None if isinstance(value, float) and value != value else value
