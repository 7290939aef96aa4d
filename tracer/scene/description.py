"""The scene: the hub that everything else is a function of (document, head and sections 2, 3 and 9).

A `Scene` is validated when it is made and when a key is assigned; what was changed in place below it
(`scene.shapes.append(...)`) is validated by `check`, which compilation and saving call.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

import tomli_w
from pydantic import BeforeValidator, Field, PrivateAttr, TypeAdapter, ValidationError, model_validator
from typing_extensions import Self

from tracer.camera import Camera
from tracer.errors import SceneError
from tracer.lights import LIGHT_KINDS, LightRecord
from tracer.material import Material
from tracer.messages import Refusal, sentence
from tracer.records import PLAIN, Color, Flag, Fraction, Name, Record, Seed, refuse_flag, union_of
from tracer.scene.animation import Track
from tracer.scene.checks import check_lights, check_one_shape, check_shapes
from tracer.scene.files import locate, moved, records_with_files
from tracer.scene.keyed import check_tracks, scene_at
from tracer.shapes import SHAPE_KINDS, ShapeRecord
from tracer.textures import TEXTURE_KINDS, TextureRecord
from tracer.validation import validation_sentence

if TYPE_CHECKING:
    AnyLight: TypeAlias = LightRecord
    AnyShape: TypeAlias = ShapeRecord
    AnyTexture: TypeAlias = TextureRecord
else:
    AnyLight = union_of(LIGHT_KINDS)
    AnyShape = union_of(SHAPE_KINDS)
    AnyTexture = union_of(TEXTURE_KINDS)


class Scene(Record):
    """A whole scene: options, camera, lights, textures, materials, shapes and animation.

    Shape numbers in results are positions in `shapes`. Scenes are equal when all their keys are, wherever
    they come from.
    """

    version: Annotated[Literal[1], BeforeValidator(refuse_flag)] = Field(
        default=1, description="version of this format"
    )
    literal: Flag = Field(
        default=False,
        description="follow the document's letter: texture index truncate, pixel_offset 0, pictures flip_v; "
        "a value that the scene states itself wins",
    )
    ambient: Fraction = Field(default=0.2, description="share a that needs no light (overreflect)")
    background: Color = Field(
        default=(0.0, 0.0, 0.0), description="what a primary ray sees that hits nothing"
    )
    cutoff: Annotated[float, Field(strict=True, ge=0.001, le=1), PLAIN] = Field(
        default=0.05, description="least weight of a ray that is traced"
    )
    max_depth: Annotated[int, Field(strict=True, ge=0, le=1024), PLAIN] = Field(
        default=64, description="deepest level of a ray that is traced; primary rays are level 0"
    )
    seed: Seed = Field(default=0, description="seed of the lights' jitter")
    secondary_background: Flag = Field(default=False, description="secondary rays see the background too")
    tir: Literal["drop", "reflect"] = Field(
        default="drop", description="the refracted share at total internal reflection: dropped, or mirrored"
    )
    transparent_shadows: Flag = Field(
        default=False, description="refracting surfaces let the share k_t of light through"
    )
    diffuse_term: Literal["lambert", "reflection"] = Field(
        default="lambert", description="the diffuse term: n·l, or r·v (the other reading of the document)"
    )
    color_space: Literal["display", "linear"] = Field(
        default="display",
        description="shade with display values as they are (the document), or with linear values",
    )
    camera: Camera = Field(
        default_factory=lambda: Camera(), description="eye and canvas (default 640 × 480, distance 800)"
    )
    lights: list[AnyLight] = Field(default_factory=list, description="the lights")
    textures: dict[Name, AnyTexture] = Field(default_factory=dict, description="textures by name")
    materials: dict[Name, Material] = Field(default_factory=dict, description="materials by name")
    shapes: list[AnyShape] = Field(default_factory=list, description="the shapes")
    animation: list[Track] = Field(default_factory=list, description="numbers keyed over time")

    _name: str = PrivateAttr("scene")
    _label: str = PrivateAttr("scene")
    _base_dir: Path | None = PrivateAttr(None)
    _allow_outside: bool = PrivateAttr(False)

    # ---- where it comes from ----

    @property
    def name(self) -> str:
        """The scene file's name without its ending, or "scene"."""
        return self._name

    @property
    def base_dir(self) -> Path:
        """The folder that file names are relative to; the working directory for a scene built in code."""
        return Path.cwd() if self._base_dir is None else self._base_dir

    @property
    def allow_outside(self) -> bool:
        """Whether files may come from anywhere."""
        return self._allow_outside

    def come_from(
        self,
        *,
        name: str = "scene",
        label: str = "scene",
        base_dir: Path | None = None,
        allow_outside: bool = False,
    ) -> Self:
        """Say where this scene comes from; `label` is what messages call it. Returns the scene."""
        self._name, self._label, self._base_dir, self._allow_outside = name, label, base_dir, allow_outside
        return self

    def resolve(self, file: str) -> Path:
        """The existing file that a name in this scene means; raises `SceneError`."""
        try:
            return locate(file, self.base_dir, self.allow_outside)
        except Refusal as refusal:
            raise SceneError(f"{self._label}: the file {refusal}") from None

    # ---- building and checking ----

    def add_light(self, light: AnyLight | Mapping[str, Any]) -> None:
        """Append a light (the document's `addlight`)."""
        self.lights = [*self.lights, self._entry(light, "lights")]

    def add_shape(self, shape: AnyShape | Mapping[str, Any]) -> None:
        """Append a shape (the document's `addobj`); its material and texture must be there already."""
        entry: ShapeRecord = self._entry(shape, "shapes")
        number = len(self.shapes)
        try:
            check_one_shape(number, entry, self)
        except Refusal as refusal:
            path = ("shapes", entry.name or number, *refusal.path[2:])
            raise SceneError(sentence(self._label, path, str(refusal))) from None
        self.shapes.append(entry)

    def _entry(self, entry: Any, key: str) -> Any:
        data = {key: [entry]}
        try:
            return _ENTRIES[key].validate_python(entry)
        except ValidationError:
            pass
        try:
            Scene.model_validate(data)
        except ValidationError as error:
            raise SceneError(validation_sentence(error, Scene, data, self._label)) from None
        raise AssertionError("an entry that is no light or shape passed as one")

    def check(self) -> None:
        """Validate again, with what was changed in place, and look for the files; raises `SceneError`."""
        data = {key: getattr(self, key) for key in self.model_fields_set | {"camera", *_CONTAINERS}}
        try:
            checked = Scene.model_validate(data)
        except ValidationError as error:
            raise SceneError(validation_sentence(error, Scene, data, self._label)) from None
        for key in _CONTAINERS:
            self.__dict__[key] = getattr(checked, key)
        self.check_files()

    def check_files(self) -> None:
        """Raise `SceneError` for the first file that is missing or may not be used."""
        for record, path in records_with_files(self):
            try:
                locate(record.file, self.base_dir, self.allow_outside)
            except Refusal as refusal:
                raise SceneError(sentence(self._label, path, str(refusal))) from None

    @model_validator(mode="after")
    def _cross_check(self) -> Self:
        check_lights(self.lights)
        check_shapes(self)
        check_tracks(self)
        return self

    def at(self, frame: float) -> Scene:
        """The scene as `animation` has it at a frame, itself without animation; raises `SceneError`."""
        try:
            return scene_at(self, frame)
        except Refusal as refusal:
            raise SceneError(sentence(self._label, refusal.path, str(refusal))) from None

    # ---- saving ----

    def save(self, path: str | Path) -> None:
        """Write a TOML file that loads as this scene again; raises `OutputError`.

        File names are rewritten to be relative to the new file's folder. Files that then lie outside it (and
        outside the assets folder) need `allow_outside` when the new file is loaded.
        """
        from tracer.film.atomic import atomic_write

        target = Path(path)
        twin = copy.deepcopy(self)
        for record, _ in records_with_files(twin):
            record.file = moved(record.file, self.base_dir, target.parent)
        with atomic_write(target) as temporary:
            temporary.write_text(tomli_w.dumps(twin.to_dict()), encoding="utf-8", newline="\n")

    def __eq__(self, other: object) -> bool:
        return self.__dict__ == other.__dict__ if isinstance(other, Scene) else NotImplemented


_CONTAINERS = ("lights", "textures", "materials", "shapes", "animation")
_ENTRIES: dict[str, TypeAdapter[Any]] = {"lights": TypeAdapter(AnyLight), "shapes": TypeAdapter(AnyShape)}
