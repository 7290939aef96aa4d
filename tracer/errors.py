"""The errors that a user can meet; each carries one sentence and knows its exit code."""

from __future__ import annotations


class TracerError(Exception):
    """Base of all errors of this package; its text is one sentence for the user."""

    exit_code = 2


class SceneError(TracerError, ValueError):
    """Bad input: the text names the file and the key, what was found and what is allowed."""


class UsageError(TracerError, ValueError):
    """A bad argument of a command or of a public function."""


class OutputError(TracerError, OSError):
    """A result cannot be written where the user wants it."""


class MachineError(TracerError, RuntimeError):
    """The machine lacks something (LLVM, a GPU, memory); the text says which step helps."""

    exit_code = 3
