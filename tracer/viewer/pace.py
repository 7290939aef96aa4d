"""How large a picture may be for the next frame to come in time."""

from __future__ import annotations

LADDER = (1.0, 0.8, 0.65, 0.5, 0.4, 0.3, 0.2)
"""Sizes of drafts against the full picture. They are few because each is recorded once (`tracer.replay`);
all of them share their kernels."""

TARGET = 1 / 20
"""Seconds from one frame to the next while something moves."""

HEADROOM = 0.85
"""Share of the target within which a larger size must come before it is taken: no swinging to and fro."""

NO_GAIN = 0.9
"""Share of a size's time above which the next smaller one is not worth its blur: what frames cost there does
not depend on their size."""

WEIGHT = 0.3
"""Of a new measurement against those before it."""

MEMORY = 100
"""Frames after which a measurement of another size is forgotten."""


class Pace:
    """Measures what frames cost, and says at which scale the next one is to be made."""

    def __init__(self, target: float = TARGET) -> None:
        self._target = target
        self._step = 0
        self._frames = 0
        self._seconds: dict[int, tuple[float, int]] = {}  # by step: the mean, and at which frame it was taken

    @property
    def scale(self) -> float:
        """Of the next draft."""
        return LADDER[self._step]

    def took(self, scale: float, seconds: float) -> None:
        """A draft of that scale took so long, until the page had shown it."""
        step = LADDER.index(scale)
        self._frames += 1
        before = self._known(step)
        now = seconds if before is None else before + WEIGHT * (seconds - before)
        self._seconds[step] = now, self._frames
        if step != self._step:
            return
        larger, smaller = self._known(step - 1), self._known(step + 1)
        if step > 0 and now * (LADDER[step - 1] / scale) ** 2 < HEADROOM * self._target:
            self._go(step - 1)
        elif step > 0 and larger is not None and now > NO_GAIN * larger:
            self._step = step - 1
        elif now > self._target and (smaller is None or smaller < NO_GAIN * now) and step + 1 < len(LADDER):
            self._go(step + 1)

    def _known(self, step: int) -> float | None:
        seconds, frame = self._seconds.get(step, (0.0, -MEMORY))
        return seconds if self._frames - frame < MEMORY else None

    def _go(self, step: int) -> None:
        """To another size, which is measured anew."""
        self._step = step
        self._seconds.pop(step, None)
