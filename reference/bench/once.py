"""The process that `processes` starts: the first frame of a scene and a later one, then its numbers as JSON.

python -m reference.bench.once PEER SCENE THREADS SECONDS-SINCE-1970
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path


def main(peer: str, file: str, threads: str, started: str) -> None:
    """Prints one line."""
    from tracer.backends import thread_count
    from tracer.scene import load

    scene = load(file, allow_outside=True)
    from reference.bench.memory import high_water
    from reference.bench.peers import MAKERS

    with thread_count(int(threads)):
        before = time.perf_counter()
        runner = MAKERS[peer](scene, Path(file).parent, int(threads))
        runner.frame()
        first, process = time.perf_counter() - before, time.time() - float(started)
        before = time.perf_counter()
        runner.frame()
        later = time.perf_counter() - before
    print(json.dumps({"first": first, "later": later, "process": process, "peak": high_water()}))


if __name__ == "__main__":
    main(*sys.argv[1:])
