"""A scene file cut into its tables, so that a tutorial can show and add them one after the other."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from tracer.scene.toml_files import parse_toml

HEADER = re.compile(r'\[\[?(?P<key>(?:[\w-]+|"[^"]*")(?:\.(?:[\w-]+|"[^"]*"))*)\]\]?\s*(?:#.*)?')
PATTERN = re.compile(r"(?P<key>[^()]+?)(?:\((?P<kind>\w+)\))?")


@dataclass(frozen=True)
class Table:
    """One table of the file: `key` such as "shapes.red ball", its lines as in the file, what they say.

    Without a name the key is "shapes.3"; the keys above all tables are the table "options".
    """

    key: str
    text: str
    values: dict[str, Any]

    @property
    def needs(self) -> tuple[str, ...]:
        """The keys of the tables that this one names: a shape's material, texture and mesh."""
        named = (("material", "materials"), ("texture", "textures"), ("of", "shapes"))
        return tuple(f"{room}.{self.values[key]}" for key, room in named if key in self.values)


def read_tables(path: Path) -> list[Table]:
    """The tables in the order of the file; the comment that opens the file belongs to none."""
    lines = path.read_text(encoding="utf-8").splitlines()
    while lines and lines[0].startswith("#"):
        del lines[0]
    blocks: list[list[str]] = [[]]
    for line in lines:
        if HEADER.fullmatch(line):
            comment: list[str] = []
            while blocks[-1] and blocks[-1][-1].startswith("#"):
                comment.insert(0, blocks[-1].pop())
            blocks.append(comment)
        blocks[-1].append(line)
    counts: Counter[str] = Counter()
    return [_table("\n".join(block).strip("\n"), path.name, counts) for block in blocks if any(block)]


def _table(text: str, label: str, counts: Counter[str]) -> Table:
    values: Any = parse_toml(text, label)
    header = next((found for line in text.splitlines() if (found := HEADER.fullmatch(line))), None)
    if header is None:
        return Table("options", text, values)
    keys = [key.strip('"') for key in re.findall(r'[\w-]+|"[^"]*"', header["key"])]
    for key in keys:
        values = values[key]
    if isinstance(values, list):
        (values,) = values
        number = counts[keys[0]]
        counts[keys[0]] += 1
        keys.append(values.get("name", str(number)))
    return Table(".".join(keys), text, values)


class Growing:
    """A scene that grows table by table; at every moment it is the file with some tables left out."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.tables = read_tables(path)
        self.present: set[str] = set()

    def add(self, patterns: Sequence[str]) -> list[Table]:
        """The tables that are new: those that match, and those that they name, in the order of the file.

        A pattern is a key with * and ?, and may end with a kind: "lights.*(point)". LookupError where one
        finds nothing new, so that a tutorial cannot lose its subject.
        """
        new: set[str] = set()
        for pattern in patterns:
            found = {table.key for table in self.tables if _matches(table, pattern)} - self.present - new
            if not found:
                raise LookupError(f"{self.path.name}: {pattern!r} adds no table")
            new |= found
        known = {table.key: table for table in self.tables}
        waiting = list(new)
        while waiting:
            needs = [key for key in known[waiting.pop()].needs if key not in new | self.present]
            new.update(needs)
            waiting += needs
        self.present |= new
        return [table for table in self.tables if table.key in new]

    @property
    def missing(self) -> list[str]:
        """The keys of the tables that are not there yet."""
        return [table.key for table in self.tables if table.key not in self.present]

    @property
    def text(self) -> str:
        """The scene as it is now, as TOML."""
        return "\n\n".join(table.text for table in self.tables if table.key in self.present) + "\n"


def _matches(table: Table, pattern: str) -> bool:
    parts = PATTERN.fullmatch(pattern)
    if parts is None:
        raise LookupError(f"{pattern!r} is no pattern; allowed: KEY or KEY(KIND)")
    kind = parts["kind"]
    return fnmatchcase(table.key, parts["key"]) and kind in (None, table.values.get("kind"))


def value_at(tables: Sequence[Table], path: str) -> Any:
    """The value of "shapes.red ball.radius", or "options.ambient"; LookupError where there is none."""
    key, _, name = path.rpartition(".")
    for table in tables:
        if table.key == key and name in table.values:
            return table.values[name]
    raise LookupError(f"the scene has no {path!r}")
