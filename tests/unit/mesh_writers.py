"""Writes small mesh files, whole and ugly ones: STL, glTF and GLB from lists of numbers."""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Sequence
from typing import Any

from tracer.shapes.polygons import PolygonSoup

Point = Sequence[float]

CODES = {5120: "b", 5121: "B", 5122: "h", 5123: "H", 5125: "I", 5126: "f"}


def faces_of(soup: PolygonSoup) -> list[list[int]]:
    """The corners of each face, as writers take them."""
    ends = soup.sizes.cumsum().tolist()
    return [soup.corners[end - size : end].tolist() for end, size in zip(ends, soup.sizes, strict=True)]


def stl_ascii(facets: Sequence[Sequence[Point]], name: str = "a") -> str:
    """One solid."""
    lines = [f"solid {name}"]
    for facet in facets:
        corners = "".join(f"  vertex {' '.join(map(repr, corner))}\n" for corner in facet)
        lines.append(f"facet normal 0 0 0\n outer loop\n{corners} endloop\nendfacet")
    return "\n".join([*lines, f"endsolid {name}", ""])


def stl_binary(facets: Sequence[Sequence[Point]], header: bytes = b"", count: int | None = None) -> bytes:
    """Facets with whatever count the header is to say."""
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *(x for c in facet for x in c), 7) for facet in facets)
    return header.ljust(80, b"\0") + struct.pack("<I", len(facets) if count is None else count) + body


class Gltf:
    """A glTF file that grows: `add` packs numbers and gives the number of their accessor."""

    def __init__(self) -> None:
        self.data = b""
        self.tree: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "accessors": [],
            "bufferViews": [],
            "meshes": [],
            "nodes": [],
        }

    def view(self, packed: bytes, **keys: Any) -> int:
        """The number of a new buffer view."""
        self.data += b"\0" * (-len(self.data) % 4)
        self.tree["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(packed), **keys}
        )
        self.data += packed
        return len(self.tree["bufferViews"]) - 1

    def add(self, rows: Sequence[Any], kind: int = 5126, gap: int = 0, **keys: Any) -> int:
        """The number of a new accessor; `gap` bytes stand between rows."""
        vectors = [row if isinstance(row, (list, tuple)) else [row] for row in rows]
        width = len(vectors[0])
        packed = b"".join(struct.pack(f"<{width}{CODES[kind]}", *row) + b"\xff" * gap for row in vectors)
        stride = {"byteStride": struct.calcsize(f"<{width}{CODES[kind]}") + gap} if gap else {}
        accessor = {
            "bufferView": self.view(packed, **stride),
            "componentType": kind,
            "count": len(rows),
            "type": "SCALAR" if width == 1 else f"VEC{width}",
        }
        self.tree["accessors"].append(accessor | keys)
        return len(self.tree["accessors"]) - 1

    def mesh(self, *primitives: dict[str, Any], **node: Any) -> int:
        """A mesh and a node with it; the node's number."""
        self.tree["meshes"].append({"primitives": list(primitives)})
        self.tree["nodes"].append({"mesh": len(self.tree["meshes"]) - 1, **node})
        return len(self.tree["nodes"]) - 1

    def primitive(self, points: Sequence[Point], corners: Sequence[int] | None = None, **keys: Any) -> Any:
        """A primitive of points and, if given, indices of one byte."""
        attributes = {"POSITION": self.add(points)}
        indices = {} if corners is None else {"indices": self.add(corners, 5121)}
        return {"attributes": attributes, **indices, **keys}

    def json(self, uri: str | None = None) -> bytes:
        """A .gltf with its buffer inside, or beside it under a name."""
        inside = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        buffers = [{"byteLength": len(self.data), "uri": uri or inside}]
        return json.dumps(self.tree | {"buffers": buffers}).encode()

    def glb(self) -> bytes:
        """A container of two chunks."""
        text = json.dumps(self.tree | {"buffers": [{"byteLength": len(self.data)}]}).encode()
        text += b" " * (-len(text) % 4)
        data = self.data + b"\0" * (-len(self.data) % 4)
        length = 12 + 8 + len(text) + 8 + len(data)
        head = struct.pack("<4sII", b"glTF", 2, length)
        chunks = (
            struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
        )
        return head + chunks
