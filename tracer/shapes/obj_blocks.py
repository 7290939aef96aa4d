"""Ordinary lines of OBJ files, read a block at a time with NumPy: ten times as quickly as one by one.

A block is given up where anything in it is not as nearly all files have it: a line that is continued or
indented, a comment behind numbers, a character that is none of a number's. What is given up, and every
error, is for `obj_statements`. So nothing here needs a message, and nothing may pass that is refused there
or read there as other numbers.
"""

from __future__ import annotations

import re

import numpy as np

from tracer.shapes.obj_statements import MOST, Statements

_NEWLINE, _TAB, _SPACE, _HASH, _SLASH = b"\n\t #/"
_CONTINUED = re.compile(rb"\\[^\n!-~]*(?:#|\n|$)")
_IN_POINTS = np.isin(np.arange(256), list(b"0123456789+-.eE \t\n"))
_IN_FACES = np.isin(np.arange(256), list(b"0123456789-/ \t\n"))


class _Unusual(Exception):
    """The block is not for this reader."""


def read_block(block: bytes, first_line: int) -> Statements | None:
    """The statements of whole lines, the first of which has that number; None for a block that must be read
    line by line."""
    if b"\\" in block and _CONTINUED.search(block):
        return None
    try:
        return _Block(block, first_line).statements()
    except _Unusual:
        return None


class _Block:
    """Lines as bytes: `text`, where each line begins, and its length with the newline."""

    def __init__(self, block: bytes, first_line: int) -> None:
        self._first_line = first_line
        text = np.frombuffer(block if block.endswith(b"\n") else block + b"\n", np.uint8)
        ends = np.flatnonzero(text == _NEWLINE) + 1
        self._text, self._lengths = text, np.diff(ends, prepend=0)
        self._starts = ends - self._lengths

    def statements(self) -> Statements:
        """What the lines say."""
        is_vertex, is_normal, is_face = self._kinds()
        vertices, normals = self._points(is_vertex, 1), self._points(is_normal, 2)
        corners, sizes = self._faces(is_face)
        before = np.stack([which.cumsum(dtype=np.int32)[is_face] for which in (is_vertex, is_normal)], axis=1)
        lines = (np.flatnonzero(which) + self._first_line for which in (is_vertex, is_normal, is_face))
        vertex_lines, normal_lines, face_lines = lines
        return Statements(vertices, vertex_lines, normals, normal_lines, corners, sizes, face_lines, before)

    def _kinds(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Masks of the lines that begin with `v`, `vn` and `f`; the others can be passed over."""
        last = len(self._text) - 1
        first, second, third = (self._text[np.minimum(self._starts + k, last)] for k in range(3))
        is_v, is_f, is_vn = first == ord("v"), first == ord("f"), (first == ord("v")) & (second == ord("n"))
        vertex, normal, face = is_v & _blank(second), is_vn & _blank(third), is_f & _blank(second)
        # Otherwise the first word is a longer one, a comment, or the line is empty.
        longer = np.where(is_vn, _of_word(third), np.where(is_v | is_f, _of_word(second), _of_word(first)))
        other = longer | (first == _NEWLINE) | (first == _HASH)
        if not (vertex | normal | face | other).all():
            raise _Unusual
        return vertex, normal, face

    def _lines(self, which: np.ndarray, keyword: int, allowed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The bytes of these lines, with blanks in place of the keyword of that length; where each begins."""
        lengths = self._lengths[which]
        begins = np.cumsum(lengths) - lengths
        place = np.flatnonzero(which)
        if len(place) == place[-1] - place[0] + 1:
            start = self._starts[place[0]]
            text = self._text[start : start + lengths.sum()].copy()
        else:
            text = self._text[np.repeat(which, self._lengths)]
        for k in range(keyword):
            text[begins + k] = _SPACE
        if not allowed[text].all():
            raise _Unusual
        return text, begins

    def _points(self, which: np.ndarray, keyword: int) -> np.ndarray:
        """(n, 3) the first three numbers of each of these lines."""
        if not which.any():
            return np.zeros((0, 3))
        text, begins = self._lines(which, keyword, _IN_POINTS)
        words = _Words(text)
        counts = words.per_line(begins)
        numbers = _numbers(text, np.float64, words.count)
        if counts.min() < 3:
            raise _Unusual
        if counts.max() == 3:
            return numbers.reshape(-1, 3)
        return numbers[(np.cumsum(counts) - counts)[:, None] + np.arange(3)]

    def _faces(self, which: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(c, 2) vertex and normal of all corners, (f,) how many each face has."""
        if not which.any():
            return np.zeros((0, 2), np.int32), np.zeros(0, np.int32)
        text, begins = self._lines(which, 1, _IN_FACES)
        words = _Words(text)
        sizes = words.per_line(begins)
        if sizes.min() < 3:
            raise _Unusual
        return _corners(text, words), sizes


class _Words:
    """The words of a text that begins with a blank: their `count`, and of each byte how many of them have
    begun, its own included."""

    def __init__(self, text: np.ndarray) -> None:
        inside = text > _SPACE
        begins = inside.copy()
        begins[1:] &= ~inside[:-1]
        self._begun = np.cumsum(begins, dtype=np.int32)
        self.count = int(self._begun[-1])

    def of(self, places: np.ndarray) -> np.ndarray:
        """The numbers of the words that hold these bytes."""
        return np.asarray(self._begun[places] - 1)

    def per_line(self, begins: np.ndarray) -> np.ndarray:
        """(n,) words of each line; lines begin with blanks."""
        return np.diff(self._begun[begins], append=np.int32(self.count))


def _corners(text: np.ndarray, words: _Words) -> np.ndarray:
    """(c, 2) the numbers of vertex and normal of words like 7, 7/8, 7//9 and 7/8/9, 0 for no normal; slashes
    become blanks."""
    slashes = np.flatnonzero(text == _SLASH)
    doubled = slashes[text[slashes + 1] == _SLASH]
    text[slashes] = _SPACE
    parts = 1 + np.bincount(words.of(slashes), minlength=words.count)
    numbers_of = parts - np.bincount(words.of(doubled), minlength=words.count)
    numbers = _numbers(text, np.int64, numbers_of.sum())
    ends = np.cumsum(numbers_of)
    has_normal = parts == 3
    vertex, normal = numbers[ends - numbers_of], np.where(has_normal, numbers[ends - 1], 0)
    if parts.max() > 3 or not (vertex.all() and normal[has_normal].all()) or np.abs(numbers).max() >= MOST:
        raise _Unusual
    return np.stack([vertex, normal], axis=1).astype(np.int32)


def _numbers(text: np.ndarray, kind: type, count: int) -> np.ndarray:
    """So many numbers, one for each word of a text: NumPy stops at a word that is not a number as a whole."""
    try:
        found: np.ndarray = np.fromstring(text.tobytes(), kind, sep=" ")
    except (ValueError, DeprecationWarning):  # what it says then, by its version, or nothing
        raise _Unusual from None
    if len(found) != count:
        raise _Unusual
    return found


def _blank(characters: np.ndarray) -> np.ndarray:
    return np.asarray((characters == _SPACE) | (characters == _TAB) | (characters == _NEWLINE))


def _of_word(characters: np.ndarray) -> np.ndarray:
    """Printable ASCII, but for what begins a comment."""
    return np.asarray((characters > _SPACE) & (characters < 127) & (characters != _HASH))
