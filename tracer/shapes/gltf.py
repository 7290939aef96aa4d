"""Reads the triangles of a glTF or GLB file, in the order of nodes, primitives and indices.

Own code, because trimesh turns the order of sibling nodes round, leaves out the mesh of a node that also
carries a camera, and reads zeros where an accessor is sparse or compressed. Vertices are placed by their
nodes in double precision. Materials, points and lines are skipped.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tracer.errors import SceneError
from tracer.messages import show
from tracer.shapes.gltf_file import GltfFile, entries, table
from tracer.shapes.gltf_nodes import IDENTITY, Matrix, applied, cofactors, determinant, node_matrix, product
from tracer.shapes.polygons import PolygonSoup, triangle_sizes

Primitive = tuple[np.ndarray, np.ndarray | None, np.ndarray]
"""Vertices (n, 3), normals (n, 3) or None, faces (m, 3)."""

MOST_TRIANGLES = 50_000_000
"""Triangles of a file: nodes may repeat a mesh, so that a small file can hold any number."""

_HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_", "KHR_mesh_quantization")


def read_gltf(path: Path) -> PolygonSoup:
    """The triangles of a glTF or GLB file; `SceneError` says what is wrong with it."""
    try:
        file = GltfFile(path)
        return replace(_Reader(file).soup(), other_files=tuple(file.other_files))
    except OSError as error:
        raise SceneError(f"{path}: cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise SceneError(f"{path}: is damaged or no glTF file ({error})") from None


class _Reader:
    """Collects what the nodes of a file's scene place."""

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._meshes = dict[int, list[Primitive]]()
        for name in entries(file.tree, "extensionsRequired", "the file"):
            if not str(name).startswith(_HARMLESS):
                raise ValueError(f"it requires {show(name)}; allowed: files without it")

    def soup(self) -> PolygonSoup:
        """The triangles of all nodes."""
        vertices, normals, faces = [np.zeros((0, 3))], [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)]
        placed = triangles = 0
        complete = True
        for number, node, matrix in self._nodes():
            for points, its_normals, its_faces in self._primitives(number, node, matrix):
                triangles += len(its_faces)
                if triangles > MOST_TRIANGLES:
                    raise ValueError(f"it has too many triangles; allowed: {MOST_TRIANGLES}")
                vertices.append(points)
                faces.append(its_faces + placed)
                placed += len(points)
                complete = complete and its_normals is not None
                normals += [its_normals] if its_normals is not None else []
        corners, all_normals = np.concatenate(faces).reshape(-1), np.concatenate(normals)
        soup = PolygonSoup(np.concatenate(vertices), all_normals, corners, triangle_sizes(corners), corners)
        return soup if complete else replace(soup, normals=np.zeros((0, 3)))

    def _nodes(self) -> Iterator[tuple[int, dict[str, Any], Matrix]]:
        """Number, table and place of the scene's nodes, each before its children, in the file's order."""
        waiting = [(number, IDENTITY, "the nodes of the scene") for number in reversed(self._roots())]
        seen = set[int]()
        while waiting:
            number, above, of = waiting.pop()
            node = self._file.entry("nodes", number, f"an entry of {of}")
            if number in seen:
                raise ValueError(f"node {number} stands in two places of the tree")
            seen.add(number)
            matrix = product(above, node_matrix(node, f"`nodes.{number}`"))
            yield number, node, matrix
            of = f"`nodes.{number}.children`"
            waiting += [(child, matrix, of) for child in reversed(entries(node, "children", of))]

    def _roots(self) -> list[Any]:
        """The nodes at the top of the scene; in a file without scenes those that are no children."""
        tree = self._file.tree
        if "scenes" in tree:
            scene = tree.get("scene", 0)
            return entries(self._file.entry("scenes", scene, "`scene`"), "nodes", f"`scenes.{scene}`")
        numbers = range(len(entries(tree, "nodes", "the file")))
        nodes = [self._file.entry("nodes", number, "a node") for number in numbers]
        children = {show(child) for node in nodes for child in entries(node, "children", "a node")}
        return [number for number in numbers if show(number) not in children]

    def _primitives(self, number: int, node: dict[str, Any], matrix: Matrix) -> Iterator[Primitive]:
        """Vertices, normals (None: it has none) and faces of each primitive of a node's mesh, placed."""
        if "mesh" not in node:
            return
        if "skin" in node or any(weight != 0 for weight in entries(node, "weights", f"`nodes.{number}`")):
            raise ValueError(f"`nodes.{number}` has a skin or weights; allowed: meshes that nothing bends")
        mesh = node["mesh"]
        if type(mesh) is not int or mesh not in self._meshes:
            self._meshes[mesh] = list(self._read(mesh, f"`nodes.{number}.mesh`"))
        mirrors = determinant(matrix) < 0
        for points, normals, faces in self._meshes[mesh]:
            placed = applied(matrix, points)
            with np.errstate(over="ignore"):
                sound = np.isfinite(placed.astype(np.float32)).all(axis=1)
            if not sound.all():
                what = f"vertex {np.argmin(sound)} of a primitive of `nodes.{number}`, counted from 0,"
                raise ValueError(f"{what} is not finite or leaves the range of single precision")
            turned = None if normals is None else applied(cofactors(matrix, mirrors), normals)
            yield placed, turned, faces[:, [0, 2, 1]] if mirrors else faces

    def _read(self, number: Any, of: str) -> Iterator[Primitive]:
        """Vertices, normals and faces of each primitive of a mesh that has triangles."""
        mesh = self._file.entry("meshes", number, of)
        if any(weight != 0 for weight in entries(mesh, "weights", f"`meshes.{number}`")):
            raise ValueError(f"`meshes.{number}.weights` is not zero; allowed: meshes that nothing bends")
        for place, primitive in enumerate(entries(mesh, "primitives", f"`meshes.{number}`")):
            what = f"`meshes.{number}.primitives.{place}`"
            if not isinstance(primitive, dict):
                raise ValueError(f"{what} is {show(primitive)}; allowed: a table")
            mode = primitive.get("mode", 4)
            if type(mode) is not int or not 0 <= mode <= 6:
                raise ValueError(f"`mode` of {what} is {show(mode)}; allowed: 0 to 6")
            if mode < 4:  # points and lines
                continue
            attributes = table(primitive, "attributes", what)
            points = self._file.numbers(attributes.get("POSITION"), "VEC3", f"`POSITION` of {what}")
            normals = None
            if "NORMAL" in attributes:
                normals = self._file.numbers(attributes["NORMAL"], "VEC3", f"`NORMAL` of {what}")
                if len(normals) != len(points) or not np.isfinite(normals).all():
                    raise ValueError(f"{what} has no finite normal at each of its {len(points)} vertices")
            yield points, normals, _faces(self._corners(primitive, len(points), what), mode, what)

    def _corners(self, primitive: dict[str, Any], count: int, what: str) -> np.ndarray:
        """(k,) the vertex numbers of a primitive, in order."""
        if "indices" not in primitive:
            return np.arange(count)
        corners = self._file.numbers(primitive["indices"], "SCALAR", f"`indices` of {what}")
        if corners.dtype.kind != "u":
            raise ValueError(f"`indices` of {what} are no whole numbers from 0")
        if len(corners) and corners.max() >= count:
            raise ValueError(f"{what} names vertex {corners.max()}, counted from 0; it has {count}")
        return corners.astype(np.int64)


def _faces(corners: np.ndarray, mode: int, what: str) -> np.ndarray:
    """(m, 3) from the corners of triangles (mode 4), a strip (5) or a fan (6)."""
    if mode == 4:
        if len(corners) % 3:
            raise ValueError(f"{what} has {len(corners)} corners; allowed: a multiple of three")
        return corners.reshape(-1, 3)
    k = np.arange(max(len(corners) - 2, 0))
    if mode == 5:  # every other triangle is wound the other way round
        return corners[np.stack([k, k + 1 + k % 2, k + 2 - k % 2], axis=1)]
    return corners[np.stack([k + 1, k + 2, 0 * k], axis=1)]
