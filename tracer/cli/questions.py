"""The six questions of the document's program: asked at a terminal, or answered from a pipe.

They stand in the document's order; an answer is 0 or 1, as there.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import click

from tracer.errors import UsageError
from tracer.messages import show

LONGEST_ANSWER = 64  # bytes; a longer word is not read to its end
_ANSWERS = {b"0": False, b"1": True}


@dataclass(frozen=True)
class Question:
    """One question; `answers` are the words for 0 and 1."""

    key: str
    text: str
    default: bool
    answers: tuple[str, str] = ("no", "yes")

    @property
    def prompt(self) -> str:
        """The question and what may be answered, such as `Add the cube: no <0> or yes <1>?`."""
        no, yes = self.answers
        return f"{self.text}: {no} <0> or {yes} <1>?"


QUESTIONS = (
    Question("trees", "Wallpaper", True, ("fox", "trees")),
    Question("texture_3d", "Use the 3-D texture", True),
    Question("tetrahedron", "Add the tetrahedron", True),
    Question("cube", "Add the cube", True),
    Question("rabbit", "Add the more complex OBJ object, the rabbit", False),
    Question("rotate", "Rotate the camera", False),
)


def choices(given: Mapping[str, bool | None]) -> dict[str, bool]:
    """The choice for each question: the one `given`, else the answer from stdin, else the default.

    Where all are given, stdin is not touched. Raises `UsageError` for a bad answer that nobody can be asked
    again, because it comes from a pipe or a file.
    """
    chosen = {key: value for key, value in given.items() if value is not None}
    missing = [question for question in QUESTIONS if question.key not in chosen]
    answers: dict[str, bool] = {}
    if missing and sys.stdin is not None:  # None: closed, as by `<&-`
        if sys.stdin.isatty():
            answers = dict(_asked(missing))
        else:
            answers = dict(_read(QUESTIONS[: QUESTIONS.index(missing[-1]) + 1]))
    return {question.key: question.default for question in QUESTIONS} | answers | chosen


def _asked(questions: Sequence[Question]) -> Iterator[tuple[str, bool]]:
    """Keys and answers from a terminal; Enter takes the default, the end of input takes all that are left."""
    for question in questions:
        answer = None
        while answer is None:
            line = _line(f"{question.prompt} [{question.default:d}] ")
            if not line:
                return
            word = line.strip()
            answer = _ANSWERS.get(word) if word else question.default
            if answer is None:
                click.echo(f"{_shown(word)} is no answer; allowed: 0, 1 or Enter for the one in []", err=True)
        yield question.key, answer


def _line(prompt: str) -> bytes:
    """A line from the terminal, empty at the end of input; that and Ctrl-C move the cursor to a new line."""
    line = b""
    try:
        click.echo(prompt, nl=False, err=True)
        line = sys.stdin.buffer.readline()
    finally:
        if not line:
            click.echo(err=True)
    return line


def _read(questions: Sequence[Question]) -> Iterator[tuple[str, bool]]:
    """Keys and answers from a pipe or a file, one word each, as far as they go; what follows is ignored."""
    for number, (question, word) in enumerate(zip(questions, _words(), strict=False), 1):
        if word not in _ANSWERS:
            raise UsageError(
                f"stdin: answer {number}, `{question.prompt}`, is {_shown(word)}; allowed: 0 or 1"
            )
        yield question.key, _ANSWERS[word]


def _words() -> Iterator[bytes]:
    """What stdin holds between white space, read as far as it is asked for."""
    word = b""
    while len(word) <= LONGEST_ANSWER:
        try:
            block = os.read(sys.stdin.fileno(), LONGEST_ANSWER)
        except OSError as error:
            raise UsageError(f"stdin: cannot be read: {error.strerror or error}") from error
        if not block:
            break
        *words, word = re.split(rb"\s+", word + block)
        yield from filter(None, words)
    if word:
        yield word


def _shown(word: bytes) -> str:
    return show(word.decode(errors="replace"))
