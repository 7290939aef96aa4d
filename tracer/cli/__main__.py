"""`python -m tracer.cli` is the command `tracer`."""

from __future__ import annotations

from tracer.cli import main

main()
