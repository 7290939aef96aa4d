"""How large a picture may be for the next frame to come in time."""

from __future__ import annotations

LADDER = (1.0, 0.8, 0.65, 0.5, 0.4, 0.3, 0.2)
"""Sizes of drafts against the full picture. They are few because each is recorded once (`tracer.replay`);
all of them share their kernels."""

TARGET = 1 / 20
"""Seconds from one frame to the next while something moves."""

HEADROOM = 0.85
"""Share of the target within which a larger size must come before it is taken: no swinging to and fro."""

WEIGHT = 0.3
"""Of a new measurement against those before it."""


class Pace:
    """Measures what frames cost, and says at which scale the next one is to be made."""

    def __init__(self, target: float = TARGET) -> None:
        self._target = target
        self._step = 0
        self._seconds = dict.fromkeys(range(len(LADDER)))  # type: dict[int, float | None]

    @property
    def scale(self) -> float:
        """Of the next draft."""
        return LADDER[self._step]

    def took(self, scale: float, seconds: float) -> None:
        """A draft of a scale took so long, until the page had shown it or the next one could begin."""
        if scale not in LADDER:
            return
        step = LADDER.index(scale)
        before = self._seconds[step]
        now = seconds if before is None else before + WEIGHT * (seconds - before)
        self._seconds[step] = now
        if step != self._step:
            return
        if now > self._target and step + 1 < len(LADDER):
            self._step = step + 1
        elif step > 0 and now * (LADDER[step - 1] / scale) ** 2 < HEADROOM * self._target:
            self._step = step - 1
        else:
            return
        self._seconds[self._step] = None  # what it cost then is no measure for now
