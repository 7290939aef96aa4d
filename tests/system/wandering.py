"""A viewer without a browser, wandered about at random; prints the resident memory (MiB) after each stretch.

python -m tests.system.wandering STRETCHES ACTIONS
"""

from __future__ import annotations

import gc
import os
import random
import sys
import threading

from scripts.viewer.processes import megabytes_of
from tracer.cli.view import _source
from tracer.viewer.controls import Slider
from tracer.viewer.frames import Frame
from tracer.viewer.lens import looked_at
from tracer.viewer.memory import KernelBound, give_back
from tracer.viewer.renderer import Renderer
from tracer.viewer.session import Session

SIZE = (96, 72)
PATIENCE = 60


class Wanderer:
    """Does what a user may do, and waits each time for the first picture that shows it."""

    def __init__(self, seed: int) -> None:
        self.session = Session(_source("classic", (), False, SIZE))
        self.chance = random.Random(seed)
        self.shown = -1
        self.news = threading.Condition()
        self.renderer = Renderer(self.session, self.publish, sys.exit, lambda: True, "llvm")
        self.renderer.start()

    def publish(self, frame: Frame) -> None:
        with self.news:
            self.shown = frame.revision
            self.news.notify_all()

    def step(self) -> None:
        chance, session = self.chance, self.session
        kind = chance.randrange(20)
        if kind < 8:
            session.orbit(chance.uniform(-5, 5), chance.uniform(-2, 2), gesture=1)
        elif kind < 16:
            control = chance.choice(session.controls)
            if isinstance(control, Slider):
                session.set(control.name, chance.uniform(control.low, control.high), gesture=2)
            else:
                session.paint(control.name, f"#{chance.randrange(1 << 24):06x}", gesture=2)
        elif kind == 16:
            session.show(chance.choice(("color", "rays")))
        elif kind == 17:
            session.choose("cube", chance.random() < 0.5)
        elif kind == 18:
            session.undo()
        else:
            scene, x, y = session.view.scene, chance.randrange(SIZE[0]), chance.randrange(SIZE[1])
            self.renderer.do(lambda: looked_at(scene, x, y, "llvm")).result(timeout=PATIENCE)
        with self.news:
            assert self.news.wait_for(lambda: self.shown == session.view.revision, PATIENCE)

    def memory(self) -> float:
        """MiB, when all that may be dropped is dropped."""
        gc.collect()
        for task in (KernelBound(most=-1).keep, give_back):
            self.renderer.do(task).result(timeout=PATIENCE)
        return megabytes_of(os.getpid())


def main() -> None:
    """Wanders."""
    stretches, actions = map(int, sys.argv[1:])
    wanderer = Wanderer(seed=1)
    for _ in range(stretches):
        for _ in range(actions):
            wanderer.step()
        print(f"{wanderer.memory():.1f}", flush=True)
    wanderer.renderer.stop()


if __name__ == "__main__":
    main()
