"""Words of mesh files that are text: lines, numbers, and how a message shows them."""

from __future__ import annotations

from tracer.messages import LONGEST_SHOWN


def lines_of(text: str) -> list[str]:
    """The lines of a text of any system.

    Not `splitlines`: that also ends a line at a form feed and at separators that may stand in a comment.
    """
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def three_floats(words: list[str]) -> list[float]:
    """The three numbers after a keyword; `ValueError` says what is there instead."""
    if len(words) < 4:
        raise ValueError(f"`{words[0]}` needs three numbers")
    try:
        return [_number(word) for word in words[1:4]]
    except ValueError:
        raise ValueError(f"`{short(' '.join(words[:4]))}` is not three numbers") from None


def short(text: str) -> str:
    """A text as messages repeat it."""
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}…"


def _number(word: str) -> float:
    if "_" in word:  # which Python allows between digits
        raise ValueError
    return float(word)
