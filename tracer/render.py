"""Renders a scene: bands of pixels through the loop, then the filters (document, sections 7 to 9)."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from functools import partial
from typing import Literal

import numpy as np

from tracer.adaptive import Adaptive
from tracer.backends import exact_arithmetic, find_backend, thread_count
from tracer.color import encode_srgb
from tracer.film.counts import by_name
from tracer.film.depth_of_field import depth_of_field, rectangle_needed
from tracer.film.film import Film
from tracer.film.result import Result
from tracer.film.work_file import WorkFile
from tracer.passes import Passes, PassInterrupted, Progress
from tracer.scene import Scene
from tracer.scene.contents import snapshot
from tracer.settings import RAYS_PER_BAND, Settings, with_seed
from tracer.tiles import Rectangle
from tracer.version import __version__


class RenderInterrupted(KeyboardInterrupt):
    """Ctrl-C during a render; `partial` holds the bands that were finished, the rest is blank."""

    def __init__(self, partial: Result) -> None:
        super().__init__("interrupted")
        self.partial = partial


def render(
    scene: Scene,
    precision: str = "single",
    backend: str = "auto",
    supersample: int | Literal["adaptive"] | None = None,
    aovs: Sequence[str] = ("depth",),
    *,
    scale: float = 1.0,
    resolution: tuple[int, int] | None = None,
    crop: Rectangle | None = None,
    threads: int | None = None,
    seed: int | None = None,
    rays_per_band: int = RAYS_PER_BAND,
    memory: int | None = None,
    progress: Progress | None = None,
    work: WorkFile | None = None,
    count_hits: bool = False,
    threshold: float | None = None,
    animated: bool = False,
) -> Result:
    """Renders a scene.

    Args:
        scene: from `tracer.load` or built in code.
        precision: "single" or "double".
        backend: "auto" (CUDA where there is a GPU, else LLVM), "llvm" or "cuda".
        supersample: n for n x n rays a pixel, 1 to 64; None: as the scene says; "adaptive": one ray, and all
            n x n only of pixels that differ from a neighbor, n as the scene says, or 3 where that is 1.
        aovs: names of layers, or "all"; `docs/layers.md` has the list.
        scale: size of the picture against the scene's resolution; the framing stays.
        resolution: (width, height) in pixels instead; the vertical extent of the canvas stays.
        crop: (x0, y0, x1, y1) in pixels of the full picture, end exclusive.
        threads: CPU threads (LLVM); None: all cores.
        seed: of jitter and depth of field; None: as the scene says.
        rays_per_band: primary rays of one launch at most; no picture depends on it.
        memory: bytes that the process may take, by an estimate made before the first ray: launches are made
            as small as necessary; None: all that the machine has.
        progress: called at first and after every launch with (finished pixels, all pixels, rays of this run).
        work: where finished bands are kept, and found again after an interruption; the caller removes it
            when the result is saved. Pictures of less than a second keep nothing.
        count_hits: count for each shape the rays, of all kinds but shadow rays, that meet it, as
            `stats["hits"]`, in the order of the shapes. It takes a kernel of its own; no pixel depends on it.
        threshold: of an adaptive picture: pixels whose display values, or coverage, differ by so much or more
            are refined; 0 (all of them, the bytes of the full grid) to 1; None: 0.015.
        animated: for each frame of an animation: the first one compiles the kernels of all, also those for
            which it has no use itself. No pixel depends on it.

    Returns: `color` (h, w, 3) float32 (float64 in double precision), display-referred and not clamped;
        `depth` (h, w), distance from the canvas along the ray, -1 blank; `alpha`, `z`, `aovs`, `stats`.

    Raises: `UsageError` and `SceneError` for bad input, `MachineError` when the machine lacks the backend
        or the memory,
        `OutputError` when the work file cannot be written, `RenderInterrupted` on Ctrl-C.
    """
    settings = Settings(
        precision,
        backend,
        supersample,
        aovs,
        scale,
        resolution,
        crop,
        threads,
        seed,
        rays_per_band,
        memory,
        count_hits,
        threshold,
        animated,
    ).checked()
    types = find_backend(settings.backend, settings.precision)
    with exact_arithmetic(), thread_count(settings.threads):
        passes = Passes(with_seed(scene, settings.seed), settings, types, progress, work)
        try:
            return _result(passes, _finished(passes))
        except PassInterrupted as interrupted:
            raise RenderInterrupted(_result(passes, interrupted.film)) from None


def _finished(passes: Passes) -> Film:
    """The film of the picture, filtered and display-referred."""
    trace = Adaptive(passes).over if passes.settings.adaptive else passes.over
    film = trace(passes.rectangle)
    scene, canvas, settings = passes.scene, passes.canvas, passes.scene.camera.depth_of_field
    if settings is not None and settings.focus >= 0:
        # a crop's first pass is widened to what the filter reads
        wide = rectangle_needed(film.rectangle, film.depth, settings, canvas)
        source = film if wide == film.rectangle else trace(wide)
        with passes.phases.phase("filter"):
            given = source.color, source.depth, source.rectangle
            film.color = depth_of_field(passes.backend, *given, film.rectangle, settings, canvas)
    if scene.color_space == "linear":
        with passes.phases.phase("filter"):
            film.color = np.asarray(encode_srgb(film.color), passes.backend.dtype)
    return film


def _result(passes: Passes, film: Film) -> Result:
    scene, backend = passes.scene, passes.backend
    layers = {"depth": film.depth} if "depth" in passes.settings.aovs else {}
    return Result(
        color=film.color,
        depth=film.depth,
        alpha=film.alpha,
        z=film.z,
        aovs=layers | {name: film.arrays[name] for name in passes.layers if name in film.arrays},
        stats={
            **by_name(film.counts),
            **({"threshold": passes.settings.threshold} if passes.settings.adaptive else {}),
            "seconds": dict(passes.phases.seconds),
            "pixels": int(film.depth.size),
            "supersample": passes.n,
            "backend": backend.name,
            "precision": backend.precision,
        },
        kernels=dict(passes.phases.kernels),
        scene_name=scene.name,
        hash_of=partial(scene_hash, snapshot(scene)),
        version=__version__,
        backend=backend.name,
        precision=backend.precision,
        seed=scene.seed,
        crop=film.rectangle,
        resolution=(passes.canvas.width, passes.canvas.height),
        background=scene.background,
        color_space=scene.color_space,
    )


def scene_hash(scene: Scene) -> str:
    """SHA-256 of the scene's keys: equal scenes have equal hashes wherever they come from."""
    return hashlib.sha256(json.dumps(scene.to_dict(), sort_keys=True).encode()).hexdigest()
