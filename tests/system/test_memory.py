"""A big picture needs the memory of its film and one band, whatever the number of rays."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

MEASURE = """
import json, resource, subprocess, sys
done = subprocess.run(sys.argv[1:], capture_output=True, text=True)
peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024
print(json.dumps({"code": done.returncode, "peak": peak, "errors": done.stderr}))
"""


def peak_bytes(folder: Path, *options: str, scene: str = "room") -> int:
    """Largest resident size of a whole `tracer render`."""
    command = [sys.executable, "-m", "tracer.cli", "render", scene, "--quiet", *options]
    run = [sys.executable, "-c", MEASURE, *command, "-o", str(folder / "big.png")]
    report = json.loads(subprocess.run(run, capture_output=True, text=True, check=True).stdout)
    assert report["code"] == 0, report["errors"]
    return int(report["peak"])


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="resource usage of children is a Unix thing")
def test_memory_grows_with_the_film_alone(tmp_path: Path) -> None:
    """24 bytes a pixel of film (color, depth, coverage, z), 3 of the picture, and at most one copy of a layer
    while it is written: 40 bytes a pixel. At that rate 8192 x 8192 pixels stay below 3 GiB.

    More rays a pixel need no more: the bands hold as many rays as before.
    """
    small = peak_bytes(tmp_path, "--resolution", "64", "64")
    side = 3072
    large = peak_bytes(tmp_path, "--resolution", str(side), str(side))
    per_pixel = (large - small) / side**2
    assert per_pixel < 40, f"{per_pixel:.1f} bytes a pixel"
    assert small + 40 * 8192**2 < 3 * 2**30, f"{small / 2**20:.0f} MiB before the first pixel"
    assert peak_bytes(tmp_path, "--resolution", str(side), str(side), "--supersample", "2") < 1.1 * large


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not say how large a process is")
@pytest.mark.parametrize(
    ("scene", "megabytes", "options"),
    [
        ("classic", 700, ("--resolution", "3072", "2048")),
        ("classic", 1000, ("--resolution", "2048", "1024", "--aov", "all")),
        ("option_depth_of_field", 700, ("--resolution", "2048", "1024")),
        ("room", 400, ("--resolution", "16000", "64", "--supersample", "8")),
    ],
)
def test_a_process_stays_within_what_it_may_take(
    scene: str, megabytes: int, options: tuple[str, ...], tmp_path: Path
) -> None:
    limit = ("--memory", f"{megabytes}M")
    assert peak_bytes(tmp_path, *options, *limit, scene=scene) < megabytes << 20


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="resource usage of children is a Unix thing")
def test_launches_are_smaller_where_less_is_allowed(tmp_path: Path) -> None:
    options = ("--resolution", "2048", "1536", "--aov", "all", "--memory")
    assert peak_bytes(tmp_path, *options, "1500M") < 0.8 * peak_bytes(tmp_path, *options, "8G")
