"""The parts of a glTF file: its JSON, alone or in a GLB container, and the numbers that accessors name.

Khronos Group, glTF 2.0 Specification, 2021. Nothing is believed: every length is compared with the bytes that
are there before anything is reserved for it.
"""

from __future__ import annotations

import binascii
import json
from base64 import b64decode
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import unquote

import numpy as np

from tracer.messages import show

GLTF_SUFFIXES = (".gltf", ".glb")

_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_LARGEST = 2**53  # numbers beyond are no numbers of anything in a file


class GltfFile:
    """An opened glTF file; every method raises `ValueError` for what is not as the specification wants it."""

    def __init__(self, path: Path) -> None:
        data = path.read_bytes()
        text, self._binary = _chunks(data) if data[:4] == b"glTF" else (data, None)
        self.tree = _parse(text)
        self._folder, self._buffers = path.parent, dict[int, bytes]()
        self.other_files: list[Path] = []  # those read so far
        version = show(table(self.tree, "asset", "the file").get("version"))
        if not version.startswith('"2.'):
            raise ValueError(f"`asset.version` is {version}; allowed: 2.0")

    def entry(self, name: str, number: Any, of: str) -> dict[str, Any]:
        """Entry `number` of a list at the top of the file; `of` says where the number stands."""
        entries = self.tree.get(name, [])
        if not isinstance(entries, list) or type(number) is not int or not 0 <= number < len(entries):
            count = len(entries) if isinstance(entries, list) else 0
            raise ValueError(f"{of} is {show(number)}; the file has {count} `{name}`")
        if not isinstance(entries[number], dict):
            raise ValueError(f"`{name}.{number}` is no table")
        found: dict[str, Any] = entries[number]
        return found

    def numbers(self, number: Any, columns: str, of: str) -> np.ndarray:
        """The numbers of an accessor, (n,) or (n, columns): whole ones as they are, others as floats, whole
        ones that are marked as normalized too."""
        accessor, what = self.entry("accessors", number, of), f"`accessors.{number}`"
        if accessor.get("type") != columns:
            raise ValueError(f"{what} has the type {show(accessor.get('type'))}; allowed here: {columns}")
        kind, count = self._kind(accessor, what), whole(accessor, "count", what)
        if "bufferView" not in accessor:
            raise ValueError(f"{what} has no `bufferView`")
        values = self._rows(accessor, kind, _COLUMNS[columns], count, what).copy()
        if "sparse" in accessor:
            self._replace(values, table(accessor, "sparse", what), kind, what)
        if accessor.get("normalized") is True and kind.kind != "f":
            values = np.maximum(values / np.float64(np.iinfo(kind).max), -1.0)
        return values[:, 0] if columns == "SCALAR" else values

    def _kind(self, accessor: dict[str, Any], what: str) -> np.dtype[Any]:
        kind = accessor.get("componentType")
        if type(kind) is not int or kind not in _TYPES:
            allowed = ", ".join(map(str, _TYPES))
            raise ValueError(f"`componentType` of {what} is {show(kind)}; allowed: {allowed}")
        return np.dtype(_TYPES[kind])

    def _rows(
        self, owner: dict[str, Any], kind: np.dtype[Any], columns: int, count: int, what: str
    ) -> np.ndarray:
        """(count, columns) of the buffer view that an accessor or a part of a sparse one names."""
        view = self.entry("bufferViews", owner.get("bufferView"), f"`bufferView` of {what}")
        its_name = f"`bufferViews.{owner['bufferView']}`"
        data = self._buffer(view.get("buffer"), its_name)
        start, length = whole(view, "byteOffset", its_name, 0), whole(view, "byteLength", its_name)
        if start + length > len(data):
            raise ValueError(f"{its_name} ends at byte {start + length} of a buffer of {len(data)}")
        width, offset = kind.itemsize * columns, whole(owner, "byteOffset", what, 0)
        stride = whole(view, "byteStride", its_name, width)
        if stride < width:
            raise ValueError(f"{its_name} has a `byteStride` of {stride}; allowed: {width} at least")
        if count == 0:
            return np.zeros((0, columns), kind)
        end = offset + (count - 1) * stride + width
        if end > length:
            raise ValueError(f"{what} needs {end} bytes; {its_name} has {length}")
        shape, strides = (count, columns), (stride, kind.itemsize)
        return np.ndarray(shape, kind, data, start + offset, strides)

    def _replace(self, values: np.ndarray, sparse: dict[str, Any], kind: np.dtype[Any], what: str) -> None:
        """Puts in the values of a sparse accessor."""
        where, count = table(sparse, "indices", what), whole(sparse, "count", what)
        which = self._rows(where, self._kind(where, what), 1, count, what)[:, 0].astype(np.int64)
        if count and not 0 <= which.min() <= which.max() < len(values):
            raise ValueError(f"{what} replaces a value that it does not have")
        values[which] = self._rows(table(sparse, "values", what), kind, values.shape[1], count, what)

    def _buffer(self, number: Any, of: str) -> bytes:
        buffer, what = self.entry("buffers", number, f"`buffer` of {of}"), f"`buffers.{number}`"
        if number not in self._buffers:
            length = whole(buffer, "byteLength", what)
            inside = number == 0 and self._binary is not None and "uri" not in buffer
            data = self._binary or b"" if inside else self._fetch(buffer.get("uri"), what)
            if len(data) < length:
                raise ValueError(f"{what} has {len(data)} bytes; {length} are announced")
            self._buffers[number] = data[:length]
        return self._buffers[number]

    def buffer_files(self) -> list[Path]:
        """The files that hold its buffers, whether or not they are needed."""
        buffers = entries(self.tree, "buffers", "the file")
        uris = [buffer.get("uri") for buffer in buffers if isinstance(buffer, dict)]
        return [
            self._folder / unquote(uri)
            for uri in uris
            if isinstance(uri, str) and not uri.startswith("data:")
        ]

    def _fetch(self, uri: Any, what: str) -> bytes:
        """The bytes that a URI names: in itself, or in a file beside this one."""
        if not isinstance(uri, str):
            raise ValueError(f"{what} has no `uri`")
        if uri.startswith("data:"):
            head, _, text = uri.partition(",")
            if not head.endswith(";base64"):
                raise ValueError(f"`uri` of {what} is {show(uri)}; allowed: base64")
            try:
                return b64decode(text, validate=True)
            except binascii.Error as error:
                raise ValueError(f"`uri` of {what} is no base64 ({error})") from None
        name = unquote(uri)
        if name.startswith("/") or ".." in PurePosixPath(name).parts or any(c in name for c in ":\\\0"):
            raise ValueError(f"`uri` of {what} is {show(uri)}; allowed: a file in the folder of this one")
        self.other_files.append(self._folder / name)
        try:
            return self.other_files[-1].read_bytes()
        except OSError as error:
            problem = f"is {show(uri)}, which cannot be read ({error.strerror})"
            raise ValueError(f"`uri` of {what} {problem}") from None


def table(owner: dict[str, Any], key: str, of: str) -> dict[str, Any]:
    """A table below a key."""
    found = owner.get(key)
    if not isinstance(found, dict):
        raise ValueError(f"`{key}` of {of} is {show(found)}; allowed: a table")
    return found


def entries(owner: dict[str, Any], key: str, of: str) -> list[Any]:
    """A list below a key; empty without it."""
    found = owner.get(key, [])
    if not isinstance(found, list):
        raise ValueError(f"`{key}` of {of} is {show(found)}; allowed: a list")
    return found


def whole(owner: dict[str, Any], key: str, of: str, default: int | None = None) -> int:
    """A whole number from 0 below a key."""
    found = owner.get(key, default)
    if type(found) is not int or not 0 <= found < _LARGEST:
        raise ValueError(f"`{key}` of {of} is {show(found)}; allowed: a whole number from 0")
    return found


def _chunks(data: bytes) -> tuple[bytes, bytes | None]:
    """The JSON and the bytes of a GLB container."""
    if len(data) < 20:
        raise ValueError(f"its header ends after {len(data)} bytes")
    version, length, first = (int.from_bytes(data[k : k + 4], "little") for k in (4, 8, 12))
    if version != 2:
        raise ValueError(f"its container has version {version}; allowed: 2")
    if length > len(data):
        raise ValueError(f"its header says {length} bytes; the file has {len(data)}")
    if data[16:20] != b"JSON" or 20 + first > length:
        raise ValueError("its first chunk is no JSON, or longer than the file")
    at = 20 + first
    second = int.from_bytes(data[at : at + 4], "little")
    if at + 8 > length or data[at + 4 : at + 8] != b"BIN\0":
        return data[20:at], None
    if at + 8 + second > length:
        raise ValueError(f"its second chunk says {second} bytes; {length - at - 8} follow")
    return data[20:at], data[at + 8 : at + 8 + second]


def _parse(text: bytes) -> dict[str, Any]:
    """The JSON as a table."""
    try:
        tree = json.loads(text.decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise ValueError("it is no UTF-8 text and no GLB container") from None
    except json.JSONDecodeError as error:
        raise ValueError(f"line {error.lineno} of its JSON: {error.msg}") from None
    except (RecursionError, ValueError):  # nested too deep; a number of more digits than Python reads
        raise ValueError("its JSON is no glTF") from None
    if not isinstance(tree, dict):
        raise ValueError("its JSON is no table")
    return tree
