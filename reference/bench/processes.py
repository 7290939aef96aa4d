"""One peer in processes of their own, with an empty kernel cache and with a filled one: what a first picture
costs, and memory."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import reference
import tracer
from reference.bench.povray import PovrayProgram
from reference.bench.records import Process
from tracer.errors import MachineError

ROOT = Path(reference.__file__).resolve().parents[1]


def process_of(peer: str, scene: tracer.Scene, folder: Path, threads: int) -> Process:
    """Starts them, waits for them; raises `MachineError` where one fails."""
    if peer == "povray":
        run, none = PovrayProgram(scene, folder, threads).run(watched=True), float("nan")
        return Process(peer, run.whole, none, none, run.whole, none, run.peak)
    scene.save(folder / "scene.toml")
    cold, warm = (_start(peer, folder, threads) for _ in range(2))
    return Process(
        peer, cold["first"], warm["first"], cold["later"], cold["process"], warm["process"], cold["peak"]
    )


def _start(peer: str, folder: Path, threads: int) -> dict[str, float]:
    """What a process says of itself; its kernels stay in the folder."""
    file = folder / "scene.toml"
    path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(
        [sys.executable, "-m", "reference.bench.once", peer, str(file), str(threads), repr(time.time())],
        env={**os.environ, "DRJIT_CACHE_DIR": str(folder / "kernels"), "PYTHONPATH": path},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
    )
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["it said nothing"])[-1]
        raise MachineError(f"the process of {peer} ended with code {done.returncode}: {last}")
    said: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return said
