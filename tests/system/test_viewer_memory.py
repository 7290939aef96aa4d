"""The viewer keeps nothing of what was shown, however long one wanders about."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

STRETCHES, ACTIONS = 3, 150
MOST = 2.0
"""MiB that all stretches but the first may add: 7 KiB an action."""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not say how large a process is")
def test_random_interaction_leaks_nothing(repository: Path) -> None:
    """Measured when kernels, recordings and free memory were given back, so that a few KiB a picture show."""
    run = subprocess.run(
        [sys.executable, "-m", "tests.system.wandering", str(STRETCHES), str(ACTIONS)],
        cwd=repository,
        env={**os.environ, "PYTHONPATH": str(repository)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert run.returncode == 0, run.stderr
    memory = [float(line) for line in run.stdout.split()]
    assert len(memory) == STRETCHES
    assert memory[-1] - memory[0] < MOST, memory
