"""The triangle mesh from a file, from lists, or built in (document, section 5)."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator
from typing_extensions import Self

from tracer.messages import Refusal
from tracer.records import PLAIN, FileName, Flag, Vec3
from tracer.shapes.base import Scale3, ShapeRecord

MESH_SUFFIXES = (".obj", ".ply", ".stl", ".gltf", ".glb")

Index = Annotated[int, Field(strict=True, ge=0), PLAIN]
Face = Annotated[tuple[Index, ...], Field(min_length=3), PLAIN]


class Mesh(ShapeRecord):
    """Triangles; faces with more corners are cut into triangles in order, concave ones too."""

    kind: Literal["mesh"] = Field(default="mesh", description="a triangle mesh")
    file: FileName | None = Field(
        default=None, description="an OBJ, PLY, STL, glTF or GLB file, relative to the scene file"
    )
    vertices: Annotated[tuple[Vec3, ...], Field(min_length=3), PLAIN] | None = Field(
        default=None, description="corner points [x, y, z]; with `faces`"
    )
    faces: Annotated[tuple[Face, ...], Field(min_length=1), PLAIN] | None = Field(
        default=None,
        description="corner numbers of each face, from 0, three or more, counterclockwise from outside",
    )
    builtin: Literal["cube", "tetrahedron"] | None = Field(
        default=None, description="cube: [-1, 1]³; tetrahedron: every other corner of that cube"
    )
    scale: Scale3 = Field(
        default=(1.0, 1.0, 1.0), description="one factor or three (x, y, z), about the origin"
    )
    smooth: Flag = Field(
        default=False, description="interpolate vertex normals: the file's, else area-weighted ones"
    )

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        given = [key for key in ("file", "vertices", "builtin") if getattr(self, key) is not None]
        if self.vertices is None and self.faces is not None and not given:
            raise Refusal("is missing; allowed: `vertices` together with `faces`", "vertices")
        if self.faces is None and self.vertices is not None:
            raise Refusal("is missing; allowed: `vertices` together with `faces`", "faces")
        if self.faces is not None and self.vertices is None:
            given.append("faces")
        if not given:
            raise Refusal("needs one of `file`, `vertices` with `faces`, or `builtin`")
        if len(given) > 1:
            raise Refusal(f"and `{given[1]}` are both given; allowed: one source of the mesh", given[0])
        return self

    @model_validator(mode="after")
    def _faces_exist(self) -> Self:
        count = len(self.vertices or ())
        for number, face in enumerate(self.faces or ()):
            if max(face) >= count:
                raise Refusal(f"names vertex {max(face)}; allowed: 0 to {count - 1}", "faces", number)
        return self

    @model_validator(mode="after")
    def _file_type(self) -> Self:
        if self.file is not None and not self.file.lower().endswith(MESH_SUFFIXES):
            allowed = f"{', '.join(MESH_SUFFIXES[:-1])} or {MESH_SUFFIXES[-1]}"
            raise Refusal(f'is "{self.file}"; allowed: a file that ends in {allowed}', "file")
        return self
