"""Where the results of a run go, for the commands that write a page: its folder, and files of their own."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from tracer.errors import OutputError
from tracer.film.atomic import check_writable


@dataclass(frozen=True)
class Destination:
    """The page and its twin in the folder `out`; `json`, `summary`: files of their own, if asked for."""

    out: str
    json: str | None = None
    summary: str | None = None

    @property
    def page(self) -> str:
        """The file of the page."""
        return os.path.join(self.out, "index.html")

    @property
    def twin(self) -> str:
        """The file of the same numbers as JSON."""
        return os.path.join(self.out, "index.json")

    def check(self) -> None:
        """Refuses what could not be written, before a long run; makes the folder. Raises `OutputError`."""
        try:
            os.makedirs(self.out, exist_ok=True)
        except OSError as error:
            raise OutputError(f"{self.out}: the folder cannot be made: {error.strerror}") from error
        own = [(file, suffix) for file, suffix in ((self.json, ".json"), (self.summary, ".md")) if file]
        for file, suffix in [(name, Path(name).suffix) for name in (self.page, self.twin)] + own:
            check_writable(file, (suffix,))
