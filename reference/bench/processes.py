"""One peer in a process of its own with an empty kernel cache: what a first picture costs, and memory."""

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
    """Starts it, waits for it; raises `MachineError` where it fails."""
    if peer == "povray":
        run = PovrayProgram(scene, folder, threads).run(watched=True)
        return Process(peer, run.whole, float("nan"), run.whole, run.peak)
    file = folder / "scene.toml"
    scene.save(file)
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
    return Process(peer, **json.loads(done.stdout.splitlines()[-1]))
