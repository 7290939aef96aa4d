"""The most memory that a process held.

What `getrusage` says of a new process begins with the size of the one that started it, which can be larger;
the high-water mark of the system begins with the program itself.
"""

from __future__ import annotations

import re
from pathlib import Path


def high_water(process: int | str = "self") -> float:
    """MiB up to now; NaN where the system does not say, or the process is over."""
    try:
        said = Path(f"/proc/{process}/status").read_text("utf-8")
    except OSError:
        return float("nan")
    found = re.search(r"^VmHWM:\s+(\d+) kB", said, re.MULTILINE)
    return int(found[1]) / 1024 if found else float("nan")
