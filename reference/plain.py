"""The whole model once more in plain scalar Python: the version to read first, and the judge of the fast one.

Every formula names the section of the document it comes from. Conventions: right-handed, y up, angles in
degrees, directions of unit length, colors in [0, 1], pixel (i, j) = (column, row) from the top left. N is the
outward normal, g the geometric normal facing the ray, n the shading normal facing the ray.

    world = load(table, base_dir)     `table` is a scene file as a dict
    picture = render(world)           picture.color, .depth, .coverage, .counts

From the top down: records, the picture, the camera, one ray and its tree, light and shadow, intersection,
shapes, textures, lights, depth of field, random numbers, color, loading.
"""

from __future__ import annotations

import math
import struct
import sys
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np  # holds the finished picture, does no arithmetic
from numpy.typing import NDArray

from reference.plain_files import BUILTIN_MESHES, read_mesh, read_picture
from reference.plain_polygons import MeshFile, cut_polygons

EPSILON = sys.float_info.epsilon
BLANK = -1.0  # the depth of a ray that hits nothing
GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))
GOLDEN_FRACTION = (math.sqrt(5) - 1) / 2
DRAW_ATTEMPTS = 64
LARGE_WINDOW = 4096  # pixels of a window above which draws are made by distance
DEPTH_OF_FIELD_STREAM, LIGHT_JITTER_STREAM = 1, 2


# ---- Three numbers: a point, a direction or a color --------------------------------------------


class Vec(NamedTuple):
    """A tuple that adds and scales like a vector (so tuple's own + and * are given up)."""

    x: float
    y: float
    z: float

    def __add__(self, q: Vec) -> Vec:  # type: ignore[override]
        return Vec(self.x + q.x, self.y + q.y, self.z + q.z)

    def __sub__(self, q: Vec) -> Vec:
        return Vec(self.x - q.x, self.y - q.y, self.z - q.z)

    def __rmul__(self, k: float) -> Vec:  # type: ignore[override]
        return Vec(k * self.x, k * self.y, k * self.z)

    def __truediv__(self, k: float) -> Vec:
        return Vec(self.x / k, self.y / k, self.z / k)

    def __neg__(self) -> Vec:
        return Vec(-self.x, -self.y, -self.z)


BLACK = Vec(0.0, 0.0, 0.0)
WHITE = Vec(1.0, 1.0, 1.0)


def vec(values: Iterable[float]) -> Vec:
    """Any three numbers."""
    return Vec(*(float(value) for value in values))


def dot(p: Vec, q: Vec) -> float:
    """p . q."""
    return p.x * q.x + p.y * q.y + p.z * q.z


def cross(p: Vec, q: Vec) -> Vec:
    """p x q."""
    return Vec(p.y * q.z - p.z * q.y, p.z * q.x - p.x * q.z, p.x * q.y - p.y * q.x)


def norm(p: Vec) -> float:
    """|p|."""
    return math.hypot(*p)


def unit(p: Vec) -> Vec:
    """p / |p|; (0, 0, 0) stays."""
    return p / norm(p) if p != BLACK else p


def componentwise(p: Vec, q: Vec) -> Vec:
    """The products of the components."""
    return Vec(p.x * q.x, p.y * q.y, p.z * q.z)


def largest(*points: Vec) -> float:
    """The largest |coordinate|."""
    return max(abs(x) for point in points for x in point)


# ---- Records -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Material:
    """What a surface does with light (section 1); the defaults are those of a shape without a material."""

    ior: float = 1.0
    reflection: float = 0.0  # k_r
    refraction: float = 0.0  # k_t
    diffuse: float = 1.0  # m
    specular: float = 0.0  # h
    shininess: float = 1.0  # s

    @property
    def absorption(self) -> float:
        """k_a: absorbed + reflected + refracted = 1 (section 2)."""
        return max(0.0, 1 - self.reflection - self.refraction)


@dataclass(frozen=True)
class Shape:
    """A geometry and its looks; `frame` is set where the texture moves with the shape (section 6)."""

    name: str
    geometry: Geometry
    material: Material
    texture: Texture
    frame: Transform | None


@dataclass(frozen=True)
class DepthOfField:
    """The settings of section 8."""

    focus: float  # negative: off
    samples: int
    depth_range: float
    seed: int


@dataclass(frozen=True)
class Camera:
    """Eye and canvas (section 7)."""

    center: Vec  # K
    forward: Vec  # f
    right: Vec  # X
    down: Vec  # Y
    distance: float  # dis, from the eye to K
    width: int
    height: int
    pixel_size: float  # s
    pixel_offset: float
    supersample: int
    depth_of_field: DepthOfField | None = None

    @property
    def eye(self) -> Vec:
        """e = K - dis f."""
        return self.center - self.distance * self.forward


@dataclass(frozen=True)
class World:
    """A scene ready to be rendered. Colors are working values: decoded when `linear` (section 9)."""

    camera: Camera
    shapes: Sequence[Shape]
    lights: Sequence[Light]
    ambient: float  # a
    background: Vec
    cutoff: float
    max_depth: int
    secondary_background: bool
    reflect_totally: bool  # tir = "reflect"
    transparent_shadows: bool
    diffuse_reflection: bool  # diffuse_term = "reflection"
    linear: bool
    seed: int
    extent: float  # the largest |coordinate| of the finite shapes


@dataclass(frozen=True)
class LightSample:
    """One shining point of a light; `share` is its part of all weights (section 2), `part` of its light."""

    position: Vec
    share: float
    color: Vec
    light: int
    part: float


@dataclass
class Walk:
    """What all rays of one sub-ray's tree have in common: the lights as they stand for it, the counts."""

    world: World
    lights: Sequence[LightSample]
    counts: dict[str, int]


@dataclass(frozen=True)
class Start:
    """What a secondary ray knows about the surface it leaves; see the rules under "Intersection"."""

    shape: int
    primitive: int
    side: Vec  # the geometric normal on the side to which the ray leaves
    view: Vec  # back along the path, to where the surface was seen from
    bound: float  # nearer than this to a plane, rounding hides on which side the origin lies


@dataclass(frozen=True)
class Ray:
    """o + t d; `start` is None for a ray that leaves no surface."""

    o: Vec
    d: Vec
    start: Start | None = None


@dataclass(frozen=True)
class Hit:
    """Where a ray meets a surface; `normal` is N, geometric and outward."""

    t: float
    shape: int
    primitive: int
    position: Vec
    normal: Vec


@dataclass(frozen=True)
class Surface:
    """A hit as its ray sees it."""

    hit: Hit
    facing: Vec  # g
    shading: Vec  # n
    entering: bool
    material: Material
    color: Vec  # C


@dataclass(frozen=True)
class Node:
    """One ray of a pixel's tree; `color` is what it brings, in working values. The tree adds up (section 2):

    color = C (a + (1-a) (k_a (m D + h H) + the sum of factor * color over the children)).
    """

    kind: str  # primary, reflected, refracted or total_reflection
    level: int
    weight: float  # the product of the factors on the way (section 3)
    factor: float  # the k of the surface it comes from
    origin: Vec
    direction: Vec
    color: Vec
    t: float = math.inf
    shape: int = -1
    primitive: int = -1
    surface_color: Vec = BLACK  # C
    diffuse_light: Vec = BLACK  # D
    specular_light: Vec = BLACK  # H
    children: Sequence[Node] = ()
    surface: Surface | None = None
    arriving: Sequence[float] = ()  # share of each light that arrives


class PathVertex(NamedTuple):
    """A vertex of a specular chain; `direction` leaves it, None where total reflection ends the chain."""

    position: Vec
    direction: Vec | None
    shape: int
    primitive: int


@dataclass(frozen=True)
class Picture:
    """Display-referred color (h, w, 3), depth (h, w), share of sub-rays that hit (h, w), and the counts."""

    color: NDArray[np.float64]
    depth: NDArray[np.float64]
    coverage: NDArray[np.float64]
    counts: dict[str, int]


Box = tuple[int, int, int, int]  # x0, y0, x1, y1 in pixels, ends exclusive


# ---- The picture (sections 7 to 9) -------------------------------------------------------------


def render(
    world: World,
    scale: float = 1.0,
    supersample: int | None = None,
    crop: Box | None = None,
    seed: int | None = None,
) -> Picture:
    """The picture, or the part `crop` of it; `seed` stands in for all seeds of the scene.

    With depth of field the first pass, and so `counts`, is the whole picture's even for a crop.
    """
    if seed is not None:
        world = reseeded(world, seed)
    camera = scaled(world.camera, scale)
    n = supersample or camera.supersample
    whole = (0, 0, camera.width, camera.height)
    lens = camera.depth_of_field
    if lens and lens.focus > 0:
        picture = blurred(camera, lens, scale, first_pass(world, camera, n, whole), crop or whole)
    else:
        picture = first_pass(world, camera, n, crop or whole)
    for row in picture.color:
        row[:] = [displayed(world, vec(color)) for color in row]
    return picture


def first_pass(world: World, camera: Camera, n: int, box: Box) -> Picture:
    """The pixels of `box` in working values, before the filter and the encoding."""
    x0, y0, x1, y1 = box
    size = (y1 - y0, x1 - x0)
    picture = Picture(np.zeros((*size, 3)), np.zeros(size), np.zeros(size), new_counts())
    for row, j in enumerate(range(y0, y1)):
        for column, i in enumerate(range(x0, x1)):
            color, depth, coverage = trace_pixel(world, camera, n, i, j, picture.counts)
            picture.color[row, column] = color
            picture.depth[row, column] = depth
            picture.coverage[row, column] = coverage
    return picture


def trace_pixel(
    world: World, camera: Camera, n: int, i: int, j: int, counts: dict[str, int]
) -> tuple[Vec, float, float]:
    """Mean color of the n^2 sub-rays, depth of the nearest (-1 if none hits), share that hits (section 7)."""
    nodes = [trace_sub_ray(world, camera, n, i, j, a, b, counts) for b in range(n) for a in range(n)]
    depths = [node.t for node in nodes if node.t < math.inf]
    color = sum((node.color for node in nodes), BLACK) / len(nodes)
    return color, min(depths, default=BLANK), len(depths) / len(nodes)


def trace_sub_ray(
    world: World, camera: Camera, n: int, i: int, j: int, a: int, b: int, counts: dict[str, int]
) -> Node:
    """The tree of sub-ray (a, b) of n^2, under the lights as its pixel and number jitter them."""
    lights = light_samples(world, pixel=j * camera.width + i, sub_ray=b * n + a)
    return trace(Walk(world, lights, counts), camera_ray(camera, i, j, a, b, n))


def shade_pixel(
    world: World, i: int, j: int, scale: float = 1.0, supersample: int | None = None
) -> tuple[Vec, float]:
    """Display-referred color and depth of one pixel, before depth of field."""
    camera = scaled(world.camera, scale)
    color, depth, _ = trace_pixel(world, camera, supersample or camera.supersample, i, j, new_counts())
    return displayed(world, color), depth


def ray_tree(
    world: World, i: int, j: int, a: int = 0, b: int = 0, n: int | None = None, scale: float = 1.0
) -> Node:
    """The tree of sub-ray (a, b) of pixel (i, j)."""
    camera = scaled(world.camera, scale)
    return trace_sub_ray(world, camera, n or camera.supersample, i, j, a, b, new_counts())


def new_counts() -> dict[str, int]:
    """Rays by kind, and how paths ended."""
    rays = ("primary", "shadow", "reflected", "refracted", "total_reflection")
    ends = ("ended_by_cutoff", "ended_by_depth", "total_internal", "deepest_level")
    return dict.fromkeys((*rays, *ends), 0)


def reseeded(world: World, seed: int) -> World:
    """The world with one seed for everything random."""
    lens = world.camera.depth_of_field
    camera = replace(world.camera, depth_of_field=replace(lens, seed=seed)) if lens else world.camera
    return replace(world, camera=camera, seed=seed)


# ---- Camera (section 7) ------------------------------------------------------------------------


def primary_ray(
    world: World, i: int, j: int, a: int = 0, b: int = 0, n: int | None = None, scale: float = 1.0
) -> Ray:
    """Sub-ray (a, b) of n^2 of pixel (i, j)."""
    camera = scaled(world.camera, scale)
    return camera_ray(camera, i, j, a, b, n or camera.supersample)


def camera_ray(camera: Camera, i: int, j: int, a: int, b: int, n: int) -> Ray:
    """The ray that starts on the canvas at P, away from the eye: o = P, d = (P-e)/|P-e|."""
    delta = camera.pixel_offset
    on_canvas = canvas_offset(camera, i + (a + delta) / n, j + (b + delta) / n)
    return Ray(camera.center + on_canvas, unit(eye_offset(camera, on_canvas)))


def canvas_offset(camera: Camera, x: float, y: float) -> Vec:
    """P - K, from P = P0 + x s X + y s Y and P0 = K - w/2 s X - h/2 s Y; x, y in pixels."""
    s = camera.pixel_size
    return (x - camera.width / 2) * s * camera.right + (y - camera.height / 2) * s * camera.down


def eye_offset(camera: Camera, on_canvas: Vec) -> Vec:
    """P - e = dis f + (P - K), formed from the offsets: nothing cancels, however small dis is."""
    return camera.distance * camera.forward + on_canvas


def scaled(camera: Camera, scale: float) -> Camera:
    """The same view in other pixels: w' = max(1, round(w S)), s' = s w/w', K fixed."""
    width, height = (max(1, round(size * scale)) for size in (camera.width, camera.height))
    pixel_size = camera.pixel_size * camera.width / width
    return replace(camera, width=width, height=height, pixel_size=pixel_size)


def move(camera: Camera, m: Vec) -> Camera:
    """e and K += m."""
    return replace(camera, center=camera.center + m)


def x_rotate(camera: Camera, degrees: float) -> Camera:
    """Eye and canvas about K, positive to the left: f' = cos f - sin X, X' = cos X + sin f."""
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    f, x = camera.forward, camera.right
    return replace(camera, forward=cos * f - sin * x, right=cos * x + sin * f)


def y_rotate(camera: Camera, degrees: float) -> Camera:
    """Eye and canvas about K, positive upwards: f' = cos f - sin Y, Y' = cos Y + sin f."""
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    f, y = camera.forward, camera.down
    return replace(camera, forward=cos * f - sin * y, down=cos * y + sin * f)


# ---- One ray and its tree (sections 2 and 3) ---------------------------------------------------


def trace(
    walk: Walk, ray: Ray, kind: str = "primary", level: int = 0, weight: float = 1.0, factor: float = 1.0
) -> Node:
    """I(ray): follow a ray, shade what it hits, trace its children."""
    world = walk.world
    walk.counts[kind] += 1
    walk.counts["deepest_level"] = max(walk.counts["deepest_level"], level)
    hit = first_hit(world, ray)
    if hit is None:
        color = world.background if level == 0 or world.secondary_background else BLACK
        return Node(kind, level, weight, factor, ray.o, ray.d, color)
    surface = surface_at(world, ray, hit)
    diffuse, specular, arriving = light_terms(walk, ray, surface)
    children = trace_children(walk, ray, surface, level, weight)
    color = shade(world.ambient, surface, diffuse, specular, children)
    seen = (hit.t, hit.shape, hit.primitive, surface.color, diffuse, specular, children, surface, arriving)
    return Node(kind, level, weight, factor, ray.o, ray.d, color, *seen)


def shade(a: float, surface: Surface, diffuse: Vec, specular: Vec, children: Sequence[Node]) -> Vec:
    """I = C (a + (1-a) (k_a (m D + h H) + k_r I(reflected) + k_t I(refracted))) (section 2)."""
    material = surface.material
    own_light = material.diffuse * diffuse + material.specular * specular
    arriving = sum((child.factor * child.color for child in children), BLACK)
    return componentwise(surface.color, a * WHITE + (1 - a) * (material.absorption * own_light + arriving))


def trace_children(walk: Walk, ray: Ray, surface: Surface, level: int, weight: float) -> list[Node]:
    """The secondary rays that pass the cut-off, w k > cutoff - 1e-6, and the depth limit (section 3)."""
    world, nodes = walk.world, []
    for kind, factor, direction, side in secondary_rays(walk, ray, surface):
        if weight * factor <= world.cutoff - 1e-6:
            walk.counts["ended_by_cutoff"] += 1
        elif level + 1 > world.max_depth:
            walk.counts["ended_by_depth"] += 1
        else:
            child = leave(world, ray, surface.hit, direction, side)
            nodes.append(trace(walk, child, kind, level + 1, weight * factor, factor))
    return nodes


def secondary_rays(walk: Walk, ray: Ray, surface: Surface) -> Iterator[tuple[str, float, Vec, Vec]]:
    """(kind, factor k, direction, side to which it leaves) for each share with k > 0 (section 3)."""
    material = surface.material
    mirrored = reflect(ray.d, surface.shading)
    if material.reflection > 0:
        yield "reflected", material.reflection, mirrored, surface.facing
    if material.refraction > 0:
        refracted = refract(ray.d, surface.shading, surface.entering, material.ior)
        if refracted is not None:
            yield "refracted", material.refraction, refracted, -surface.facing
        else:
            walk.counts["total_internal"] += 1
            if walk.world.reflect_totally:
                yield "total_reflection", material.refraction, mirrored, surface.facing


def reflect(d: Vec, n: Vec) -> Vec:
    """r = d + 2 c n, c = -n.d (section 3); made unit again, so that rounding does not grow along a path."""
    return unit(d - 2 * dot(n, d) * n)


def refract(d: Vec, n: Vec, entering: bool, ior: float) -> Vec | None:
    """t = eta d + (eta c - sqrt(k)) n, k = 1 - eta^2 (1-c^2); None for k < 0, total reflection."""
    if ior == 1:
        return d  # straight through, exactly
    eta = 1 / ior if entering else ior
    c = -dot(n, d)
    k = 1 - eta**2 * (1 - c**2)
    return unit(eta * d + (eta * c - math.sqrt(k)) * n) if k >= 0 else None


def surface_at(world: World, ray: Ray, hit: Hit) -> Surface:
    """Sides, normals and own color. The geometric normal alone decides the side: entering when d.N < 0."""
    shape = world.shapes[hit.shape]
    entering = dot(ray.d, hit.normal) < 0
    facing = shading = hit.normal if entering else -hit.normal
    if isinstance(shape.geometry, Mesh) and shape.geometry.corner_normals:
        smooth = shape.geometry.smooth_normal(hit.position, hit.primitive)
        smooth = smooth if entering else -smooth
        shading = smooth if smooth != BLACK and dot(smooth, ray.d) <= 0 else facing
    point = shape.frame.inverse(hit.position) if shape.frame else hit.position
    return Surface(hit, facing, shading, entering, shape.material, shape.texture.color_at(point))


def trace_path(
    world: World, origin: Sequence[float], direction: Sequence[float], events: str
) -> list[PathVertex]:
    """One specular chain: R mirrors, T refracts, whatever the shares of the material are."""
    ray = Ray(vec(origin), unit(vec(direction)))
    vertices: list[PathVertex] = []
    for event in events:
        hit = first_hit(world, ray)
        if hit is None:
            break
        surface = surface_at(world, ray, hit)
        onward: Vec | None = reflect(ray.d, surface.shading)
        if event == "T":
            onward = refract(ray.d, surface.shading, surface.entering, surface.material.ior)
        vertices.append(PathVertex(hit.position, onward, hit.shape, hit.primitive))
        if onward is None:
            break
        ray = leave(world, ray, hit, onward, surface.facing if event == "R" else -surface.facing)
    return vertices


# ---- Light and shadow (sections 2 and 4) -------------------------------------------------------


def light_terms(walk: Walk, ray: Ray, surface: Surface) -> tuple[Vec, Vec, list[float]]:
    """D = sum w V max(0, n.l) and H = sum w V [n.l > 0] max(0, r.v)^s (section 2); V of each light."""
    world, p, n, v = walk.world, surface.hit.position, surface.shading, -ray.d
    diffuse, specular, shares = BLACK, BLACK, [0.0] * len(world.lights)
    for light in walk.lights:
        distance = norm(light.position - p)
        if light.share == 0 or distance == 0:
            continue
        to_light = (light.position - p) / distance  # l
        lambert = dot(n, to_light)
        if lambert <= 0 or dot(surface.facing, to_light) <= 0:
            continue
        walk.counts["shadow"] += 1
        shadow_ray = leave(world, ray, surface.hit, to_light, surface.facing)
        seen = visibility(world, shadow_ray, light.position)
        shares[light.light] += light.part * seen
        arriving = light.share * seen * light.color
        highlight = max(0.0, dot(2 * lambert * n - to_light, v))  # r.v
        diffuse += (highlight if world.diffuse_reflection else lambert) * arriving
        specular += highlight**surface.material.shininess * arriving
    return diffuse, specular, shares


def visibility(world: World, ray: Ray, light: Vec) -> float:
    """V (section 4): 0 when anything lies strictly between; with transparent shadows the product of k_t."""
    blockers = blocking(world, ray, light)
    if not world.transparent_shadows:
        return 1.0 if next(blockers, None) is None else 0.0
    share, previous = 1.0, None
    for hit in sorted(blockers, key=lambda hit: hit.t):
        if previous is None or not same_crossing(world, ray, previous, hit):
            share *= world.shapes[hit.shape].material.refraction
        previous = hit
    return share


def blocking(world: World, ray: Ray, light: Vec) -> Iterator[Hit]:
    """The hits strictly between the ray's origin and the light.

    A surface on which the light lies is not between. There t may fall short of the distance by rounding, so
    what counts is whether the light lies off the tangent plane of the hit.
    """
    distance, bound = norm(light - ray.o), rounding_bound(world, ray.o, light)
    for crossing in crossings(world, ray):
        if crossing[0] < distance:
            hit = hit_at(world, ray, crossing)
            if abs(dot(hit.normal, light - hit.position)) > bound:
                yield hit


def same_crossing(world: World, ray: Ray, first: Hit, second: Hit) -> bool:
    """Whether one surface is crossed once, on an edge that two triangles of a mesh share."""
    approaches = dot(first.normal, ray.d), dot(second.normal, ray.d)
    apart = (second.t - first.t) * abs(approaches[1])
    bound = rounding_bound(world, ray.o, second.position)
    return first.shape == second.shape and approaches[0] * approaches[1] > 0 and apart <= bound


def visible(world: World, point: Sequence[float], target: Sequence[float]) -> bool:
    """Whether nothing lies strictly between two points; hits nearer than 1e-9 S to an end do not count."""
    p, q = vec(point), vec(target)
    distance, margin = norm(q - p), 1e-9 * max(world.extent, largest(p, q))
    return distance == 0 or not any(
        margin <= t <= distance - margin for t, _, _ in crossings(world, Ray(p, unit(q - p)))
    )


# ---- Intersection (section 5) ------------------------------------------------------------------
#
# A secondary ray must not hit the surface it leaves, and must not miss the wall that stands next to it. No
# epsilon does both, so a ray knows what it leaves (`Start`), and two rules follow.
#
# 1. What it leaves. A plane or a triangle cannot be hit again. On a sphere the root at the origin is zero,
#    the other, -2 d.(o-c), a hit only when the ray travels inside, and that is known from the kind of ray
#    (`Start.side`) and not from a rounded product.
#
# 2. What it touches. Where a flat surface B passes within the bound 8 eps S of the origin, the sign of the
#    origin's height above B is rounding noise. (S: the largest |coordinate| of the finite shapes and of both
#    ends of the ray that arrived.) What decides there is how the surface A that the ray leaves stands to B:
#    - A lies in B's plane (the other half of a quad, a face on a floor): the ray leaves both; no hit.
#    - B is a triangle with no corner above A on the side to which the ray leaves (a flat or convex edge): the
#      ray stays in the half space above A; no hit.
#    - Otherwise B stands up from A, a concave crease. The origin lies on the side of B on which A lies; where
#      A reaches to both sides (an endless plane, a triangle that pierces B), on the side from which A was
#      seen, for the ray that arrived did not cross B. B is hit when the ray runs from that side to the other
#      and the point lies in B, at t = 0 where rounding has put the origin past B. So no contact is lost, and
#      no ray that runs away from B is stopped.
#    A path that turns at t = 0 has not moved; it keeps the direction from which the crease was seen.


def intersect(
    world: World, origin: Sequence[float], direction: Sequence[float], t_max: float = math.inf
) -> Hit | None:
    """The first hit with 0 < t <= t_max; the direction may have any length, t is a distance."""
    hit = first_hit(world, Ray(vec(origin), unit(vec(direction))))
    return hit if hit and hit.t <= t_max else None


def first_hit(world: World, ray: Ray) -> Hit | None:
    """The smallest t wins; equal t: the lower shape, then the lower primitive, as tuples compare."""
    nearest = min(crossings(world, ray), default=None)
    return hit_at(world, ray, nearest) if nearest else None


def crossings(world: World, ray: Ray) -> Iterator[tuple[float, int, int]]:
    """(t, shape, primitive) of every surface on the ray, in no order of t."""
    for number, shape in enumerate(world.shapes):
        left = ray.start.primitive if ray.start and ray.start.shape == number else None
        for t, primitive in shape.geometry.crossings(world, ray, left):
            yield t, number, primitive


def hit_at(world: World, ray: Ray, crossing: tuple[float, int, int]) -> Hit:
    """The hit of a crossing; its position is put back onto the surface, off which it was rounded."""
    t, shape, primitive = crossing
    position, normal = world.shapes[shape].geometry.settle(ray.o + t * ray.d, primitive)
    return Hit(t, shape, primitive, position, normal)


def leave(world: World, ray: Ray, hit: Hit, direction: Vec, side: Vec) -> Ray:
    """The ray that leaves, to `side`, the surface that `ray` hit."""
    if dot(direction, side) < 0 and isinstance(world.shapes[hit.shape].geometry, Mesh):
        side = -side  # a smooth normal may send a ray through the facet; it is traced as it is
    bound = rounding_bound(world, ray.o, hit.position)
    view = ray.start.view if ray.start and hit.t <= ray.start.bound else -ray.d
    return Ray(hit.position, direction, Start(hit.shape, hit.primitive, side, view, bound))


def rounding_bound(world: World, *points: Vec) -> float:
    """8 eps S."""
    return 8 * EPSILON * max(world.extent, largest(*points))


def contact(world: World, ray: Ray, start: Start, normal: Vec, height: float) -> float | None:
    """Rule 2: t at which a ray meets a plane that its origin touches (at a height of mere noise), or None."""
    low, high = world.shapes[start.shape].geometry.heights(ray.o, normal, start.primitive)
    if -start.bound <= low and high <= start.bound:
        return None
    one_sided = low >= -start.bound or high <= start.bound
    origin_side = low + high if one_sided else dot(normal, start.view)
    approach = dot(normal, ray.d)
    return max(0.0, -height / approach) if origin_side * approach < 0 else None


# ---- Shapes (section 5) ------------------------------------------------------------------------
#
# Each answers three questions. crossings: (t, primitive) of all crossings with t > 0, where `left` is the
# primitive that the ray leaves. settle: the surface point next to a point, and N there. heights: how far a
# primitive that holds `origin` reaches below and above it along a direction.


@dataclass(frozen=True)
class Plane:
    """normal . x + d = 0, endless."""

    normal: Vec
    d: float
    extent = 0.0  # does not count among the finite shapes

    def crossings(self, world: World, ray: Ray, left: int | None) -> Iterator[tuple[float, int]]:
        """t = -(N.o + d) / N.d."""
        height, approach = dot(self.normal, ray.o) + self.d, dot(self.normal, ray.d)
        if left is not None:
            return
        if ray.start and abs(height) <= ray.start.bound:
            t = contact(world, ray, ray.start, self.normal, height)
            if t is not None:
                yield t, 0
        elif height * approach < 0:
            yield -height / approach, 0

    def settle(self, point: Vec, primitive: int) -> tuple[Vec, Vec]:
        """Drop the point onto the plane."""
        return point - (dot(self.normal, point) + self.d) * self.normal, self.normal

    def heights(self, origin: Vec, direction: Vec, primitive: int) -> tuple[float, float]:
        """Endless both ways, unless the plane is normal to the direction."""
        parallel = norm(cross(self.normal, direction)) <= 8 * EPSILON
        return (0.0, 0.0) if parallel else (-math.inf, math.inf)


@dataclass(frozen=True)
class Sphere:
    """All points at `radius` from `center`."""

    center: Vec
    radius: float

    @property
    def extent(self) -> float:
        """The largest |coordinate|."""
        return largest(self.center) + self.radius

    def crossings(self, world: World, ray: Ray, left: int | None) -> Iterator[tuple[float, int]]:
        """The positive roots of |o + t d - c|^2 = r^2."""
        oc = ray.o - self.center
        if left is None:
            roots = self.roots(oc, ray.d)
        else:  # rule 1
            inside = ray.start is not None and dot(ray.start.side, oc) < 0
            roots = (-2 * dot(ray.d, oc),) if inside else ()
        yield from ((t, 0) for t in roots if t > 0)

    def roots(self, oc: Vec, d: Vec) -> tuple[float, ...]:
        """Both roots; the part of o - c across the ray gives the discriminant without loss of digits."""
        b = dot(d, oc)
        across = oc - b * d
        discriminant = self.radius**2 - dot(across, across)
        if discriminant < 0:
            return ()
        q = -b - math.copysign(math.sqrt(discriminant), b)
        return (q, (dot(oc, oc) - self.radius**2) / q) if q != 0 else ()

    def settle(self, point: Vec, primitive: int) -> tuple[Vec, Vec]:
        """Move the point along the radius."""
        outward = unit(point - self.center)
        return self.center + self.radius * outward, outward

    def heights(self, origin: Vec, direction: Vec, primitive: int) -> tuple[float, float]:
        """The height of the center, one radius less and more."""
        middle = dot(direction, self.center - origin)
        return middle - self.radius, middle + self.radius


@dataclass(frozen=True)
class Mesh:
    """Triangles as vertex numbers, counterclockwise from outside; flat without `corner_normals`."""

    vertices: Sequence[Vec]
    triangles: Sequence[tuple[int, int, int]]
    normals: Sequence[Vec]  # (0, 0, 0) marks a triangle that is never hit: degenerate, or a repetition
    corner_normals: Sequence[tuple[Vec, Vec, Vec]] | None
    low: Vec
    high: Vec

    @property
    def extent(self) -> float:
        """The largest |coordinate|."""
        return largest(self.low, self.high)

    def corners(self, primitive: int) -> tuple[Vec, Vec, Vec]:
        """The positions of a triangle's corners."""
        a, b, c = self.triangles[primitive]
        return self.vertices[a], self.vertices[b], self.vertices[c]

    def crossings(self, world: World, ray: Ray, left: int | None) -> Iterator[tuple[float, int]]:
        """Behind the bounding box (the document's), every triangle is tried."""
        if not self.box_hit(ray):
            return
        sheared = shear(ray, self.vertices)
        for primitive, (a, b, c) in enumerate(self.triangles):
            normal = self.normals[primitive]
            if normal == BLACK or primitive == left:
                continue
            height = dot(normal, ray.o - self.vertices[a])
            if ray.start and abs(height) <= ray.start.bound:
                t = triangle_contact(world, ray, ray.start, self.corners(primitive), normal, height)
            else:
                t = triangle_crossing(sheared[a], sheared[b], sheared[c])
            if t is not None:
                yield t, primitive

    def box_hit(self, ray: Ray) -> bool:
        """Whether the ray meets the bounding box, which is widened by much more than rounding."""
        near, far = 0.0, math.inf
        pad = 1e-9 * largest(self.low, self.high, ray.o)
        for o, d, low, high in zip(ray.o, ray.d, self.low, self.high, strict=True):
            below, above = low - pad - o, high + pad - o
            if d != 0:
                near, far = max(near, min(below / d, above / d)), min(far, max(below / d, above / d))
            elif below > 0 or above < 0:
                return False
        return near <= far

    def settle(self, point: Vec, primitive: int) -> tuple[Vec, Vec]:
        """Drop the point onto the triangle's plane."""
        normal = self.normals[primitive]
        return point - dot(normal, point - self.corners(primitive)[0]) * normal, normal

    def heights(self, origin: Vec, direction: Vec, primitive: int) -> tuple[float, float]:
        """The heights of the lowest and the highest corner."""
        heights = [dot(direction, corner - origin) for corner in self.corners(primitive)]
        return min(heights), max(heights)

    def smooth_normal(self, point: Vec, primitive: int) -> Vec:
        """The corner normals weighted by barycentrics; (0, 0, 0) where they cancel."""
        assert self.corner_normals is not None
        a, b, c = (corner - point for corner in self.corners(primitive))
        normal_a, normal_b, normal_c = self.corner_normals[primitive]
        areas = (dot(self.normals[primitive], cross(*edge)) for edge in ((b, c), (c, a), (a, b)))
        weight_a, weight_b, weight_c = areas
        return unit(weight_a * normal_a + weight_b * normal_b + weight_c * normal_c)


def shear(ray: Ray, points: Sequence[Vec]) -> list[Vec]:
    """Points in the frame in which the ray is the z axis and z is t (Woop, Benthin, Wald 2013)."""
    o, d = ray.o, ray.d
    z = max(range(3), key=lambda axis: abs(d[axis]))
    x, y = (z + 1) % 3, (z + 2) % 3
    slope_x, slope_y = d[x] / d[z], d[y] / d[z]
    sheared = []
    for point in points:
        depth = point[z] - o[z]
        sheared.append(
            Vec(point[x] - o[x] - slope_x * depth, point[y] - o[y] - slope_y * depth, depth / d[z])
        )
    return sheared


def triangle_crossing(a: Vec, b: Vec, c: Vec) -> float | None:
    """t of the ray along z through sheared corners, or None.

    Watertight: the difference of two rounded products has the true sign or is zero, the two triangles at an
    edge get the same number with opposite signs, and zero counts as inside for both.
    """
    u = c.x * b.y - c.y * b.x
    v = a.x * c.y - a.y * c.x
    w = b.x * a.y - b.y * a.x
    if min(u, v, w) < 0 < max(u, v, w) or u + v + w == 0:
        return None
    t = (u * a.z + v * b.z + w * c.z) / (u + v + w)
    return t if t > 0 else None


def triangle_contact(
    world: World, ray: Ray, start: Start, corners: tuple[Vec, Vec, Vec], normal: Vec, height: float
) -> float | None:
    """Rule 2 for a triangle: it must rise above the surface left, and hold the point of contact."""
    if all(dot(start.side, corner - ray.o) <= start.bound for corner in corners):
        return None
    t = contact(world, ray, start, normal, height)
    if t is None:
        return None
    point = ray.o + t * ray.d
    edges = zip(corners, (*corners[1:], corners[0]), strict=True)
    inside = all(dot(unit(cross(normal, q - p)), point - p) >= -start.bound for p, q in edges)
    return t if inside else None


Geometry = Plane | Sphere | Mesh


# ---- Textures (section 6) ----------------------------------------------------------------------


@dataclass(frozen=True)
class Solid:
    """One color."""

    color: Vec

    def color_at(self, p: Vec) -> Vec:
        """C."""
        return self.color


@dataclass(frozen=True)
class Stripes:
    """n colors in turn along x + y + z."""

    colors: Sequence[Vec]
    interval: float
    truncate: bool

    def color_at(self, p: Vec) -> Vec:
        """F((x+y+z)/interval) mod n."""
        return self.colors[cell((p.x + p.y + p.z) / self.interval, self.truncate) % len(self.colors)]


@dataclass(frozen=True)
class Checker:
    """Two colors in cubic cells."""

    colors: Sequence[Vec]
    interval: float
    truncate: bool

    def color_at(self, p: Vec) -> Vec:
        """(F(x/I) + F(y/I) + F(z/I)) mod 2."""
        return self.colors[sum(cell(x / self.interval, self.truncate) for x in p) % 2]


@dataclass(frozen=True)
class PictureTexture:
    """A picture (display values, row 0 on top) that tiles the (u, v) plane, one texel a unit."""

    uv: Callable[[Vec], tuple[float, float]]
    texels: NDArray[np.float64]
    decode: Callable[[Vec], Vec]
    truncate: bool
    flip_v: bool
    bilinear: bool

    def color_at(self, p: Vec) -> Vec:
        """The nearest texel, or a mean of four whose centers lie at k + 1/2."""
        u, v = self.uv(p)
        if not self.bilinear:
            return self.texel(cell(u, self.truncate), cell(v, self.truncate))
        i, j = math.floor(u - 0.5), math.floor(v - 0.5)
        s, t = u - 0.5 - i, v - 0.5 - j
        lower = (1 - s) * self.texel(i, j) + s * self.texel(i + 1, j)
        upper = (1 - s) * self.texel(i, j + 1) + s * self.texel(i + 1, j + 1)
        return (1 - t) * lower + t * upper

    def texel(self, column: int, row: int) -> Vec:
        """Tiled; rows count upwards from the file's last, unless `flip_v`."""
        height, width = self.texels.shape[:2]
        file_row = row % height if self.flip_v else height - 1 - row % height
        return self.decode(vec(self.texels[file_row, column % width]))


Texture = Solid | Stripes | Checker | PictureTexture


def cell(q: float, truncate: bool) -> int:
    """F(q) = floor(q + eps), or the document's |q + sign(q) eps towards zero|; eps = 1e-6 max(1, |q|)."""
    eps = 1e-6 * max(1.0, abs(q))
    return abs(math.trunc(q + math.copysign(eps, q))) if truncate else math.floor(q + eps)


# ---- Lights (section 4) ------------------------------------------------------------------------


@dataclass(frozen=True)
class Light:
    """A point, or an area as a set of `samples` points in the frame u, v."""

    kind: str
    center: Vec
    share: float  # w / sum of all w (section 2)
    color: Vec
    samples: int = 1
    jitter: bool = False
    u: Vec = BLACK
    v: Vec = BLACK
    radius: float = 0.0
    size: tuple[float, float] = (0.0, 0.0)

    def point(self, k: int, u0: float, u1: float) -> Vec:
        """Sample k of n; the fractions u0, u1 shift the pattern modulo its domain."""
        fraction, turn = (k + 0.5) / self.samples, 2 * math.pi * u0
        if self.kind == "ring":
            return self.on_circle(self.radius, 2 * math.pi * fraction + turn)
        if self.kind == "disk":
            return self.on_circle(self.radius * math.sqrt((fraction + u1) % 1), k * GOLDEN_ANGLE + turn)
        if self.kind == "sphere":
            angle, q = k * GOLDEN_ANGLE + turn, 1 - 2 * fraction
            rho = math.sqrt(1 - q * q)
            return self.center + self.radius * Vec(rho * math.cos(angle), q, rho * math.sin(angle))
        if self.kind == "rectangle":
            across = ((fraction + u0) % 1 - 0.5) * self.size[0]
            along = (((k + 0.5) * GOLDEN_FRACTION % 1 + u1) % 1 - 0.5) * self.size[1]
            return self.center + across * self.u + along * self.v
        return self.center

    def on_circle(self, radius: float, angle: float) -> Vec:
        """center + radius (cos u + sin v)."""
        return self.center + radius * (math.cos(angle) * self.u + math.sin(angle) * self.v)


def light_samples(world: World, pixel: int, sub_ray: int) -> list[LightSample]:
    """All shining points as one sub-ray sees them; each has its light's share / n."""
    samples = []
    for number, light in enumerate(world.lights):
        u0 = u1 = 0.0
        if light.jitter:
            words = philox((pixel, sub_ray, number, 0), (world.seed % 2**32, LIGHT_JITTER_STREAM))
            u0, u1 = as_fraction(words[0]), as_fraction(words[1])
        points = (light.point(k, u0, u1) for k in range(light.samples))
        part = 1 / light.samples
        samples += [LightSample(point, light.share * part, light.color, number, part) for point in points]
    return samples


# ---- Depth of field (section 8) ----------------------------------------------------------------


def blurred(camera: Camera, lens: DepthOfField, scale: float, whole: Picture, box: Box) -> Picture:
    """The part `box` of the whole first pass, after the filter."""
    x0, y0, x1, y1 = box
    part = (slice(y0, y1), slice(x0, x1))
    color = whole.color[part].copy()
    by_distance = sorted_by_distance(camera, whole)
    for j in range(y0, y1):
        for i in range(x0, x1):
            if whole.depth[j, i] != BLANK:
                color[j - y0, i - x0] = blurred_pixel(camera, lens, scale, whole, by_distance, i, j)
    return Picture(color, whole.depth[part], whole.coverage[part], whole.counts)


def sorted_by_distance(camera: Camera, whole: Picture) -> list[tuple[float, int, int]]:
    """(distance from the eye, row, column) of the pixels that are not blank, the nearest first."""
    return sorted(
        (eye_distance(camera, i, j, float(depth)), j, i)
        for (j, i), depth in np.ndenumerate(whole.depth)
        if depth != BLANK
    )


def blurred_pixel(
    camera: Camera,
    lens: DepthOfField,
    scale: float,
    whole: Picture,
    by_distance: Sequence[tuple[float, int, int]],
    i: int,
    j: int,
) -> Vec:
    """The mean of `samples` draws, by differences to the own color: in focus it stays exactly the same."""
    x = float(whole.depth[j, i])
    size = max(x / lens.focus, lens.focus / x) * scale  # f(x) S
    reach = math.ceil(min(size, camera.width + camera.height)) - 1  # |di| < f S, strictly
    columns = range(max(0, i - reach), min(camera.width, i + reach + 1))
    rows = range(max(0, j - reach), min(camera.height, j + reach + 1))
    own_distance = eye_distance(camera, i, j, x)

    def admissible(column: int, row: int) -> bool:
        depth = float(whole.depth[row, column])
        apart = abs(eye_distance(camera, column, row, depth) - own_distance)
        return depth != BLANK and apart < lens.depth_range

    similar = None
    if len(columns) * len(rows) > LARGE_WINDOW:
        begin = bisect_right(by_distance, -lens.depth_range, key=lambda pixel: pixel[0] - own_distance)
        end = bisect_left(by_distance, lens.depth_range, key=lambda pixel: pixel[0] - own_distance)
        if end - begin < len(columns) * len(rows):
            similar = [(column, row) for _, row, column in by_distance[begin:end]]
    own, difference = vec(whole.color[j, i]), BLACK
    for k in range(lens.samples):
        column, row = draw(j * camera.width + i, k, lens.seed, columns, rows, admissible, similar)
        difference += vec(whole.color[row, column]) - own
    return own + difference / lens.samples


def eye_distance(camera: Camera, i: int, j: int, depth: float) -> float:
    """depth + |P-e|, P the pixel's center."""
    return depth + norm(eye_offset(camera, canvas_offset(camera, i + 0.5, j + 0.5)))


def draw(
    pixel: int,
    k: int,
    seed: int,
    columns: range,
    rows: range,
    admissible: Callable[[int, int], bool],
    similar: Sequence[tuple[int, int]] | None = None,
) -> tuple[int, int]:
    """Draw k, uniform over the admissible pixels of the window; after 64 misses by an exact choice.

    It guesses in the window, or (in a large one) among the `similar` pixels, those of similar distance, if
    they are fewer.
    """
    key = (seed % 2**32, DEPTH_OF_FIELD_STREAM)
    for attempt in range(DRAW_ATTEMPTS):
        words = philox((pixel, k, attempt, 0), key)
        if similar is None:
            column, row = columns[choice(words[0], len(columns))], rows[choice(words[1], len(rows))]
        else:
            column, row = similar[choice(words[0], len(similar))]
        if column in columns and row in rows and admissible(column, row):
            return column, row
    pixels = [(column, row) for row in rows for column in columns] if similar is None else similar
    candidates = [at for at in pixels if at[0] in columns and at[1] in rows and admissible(*at)]
    return candidates[choice(philox((pixel, k, DRAW_ATTEMPTS, 0), key)[0], len(candidates))]


# ---- Random numbers ----------------------------------------------------------------------------


def philox(counter: tuple[int, int, int, int], key: tuple[int, int]) -> tuple[int, int, int, int]:
    """Four random 32-bit words: Philox-4x32-10 of Salmon et al., "Parallel random numbers" (SC 2011)."""
    (c0, c1, c2, c3), (k0, k1) = counter, key
    for _ in range(10):
        high0, low0 = divmod(0xD2511F53 * c0, 2**32)
        high1, low1 = divmod(0xCD9E8D57 * c2, 2**32)
        c0, c1, c2, c3 = high1 ^ c1 ^ k0, low1, high0 ^ c3 ^ k1, low0
        k0, k1 = (k0 + 0x9E3779B9) % 2**32, (k1 + 0xBB67AE85) % 2**32
    return c0, c1, c2, c3


def choice(word: int, n: int) -> int:
    """floor(word n / 2^32), one of 0 .. n-1."""
    return word * n >> 32


def as_fraction(word: int) -> float:
    """The upper 24 bits as a fraction in [0, 1)."""
    return (word >> 8) * 2.0**-24


# ---- Color (section 9) -------------------------------------------------------------------------


def displayed(world: World, color: Vec) -> Vec:
    """Working values to display-referred values; not clamped."""
    return Vec(*(encode_srgb(c) for c in color)) if world.linear else color


def encode_srgb(x: float) -> float:
    """Linear to display (IEC 61966-2-1)."""
    return 12.92 * x if x <= 0.0031308 else 1.055 * x ** (1 / 2.4) - 0.055


def decode_srgb(x: float) -> float:
    """Display to linear (IEC 61966-2-1)."""
    return x / 12.92 if x <= 0.04045 else ((x + 0.055) / 1.055) ** 2.4


# ---- Loading: a scene file's table (taken to be valid) becomes a world -------------------------


Table = Mapping[str, Any]


def load(scene: Table, base_dir: str | Path = ".") -> World:
    """A world from a scene file as a dict, defaults filled in; file names are relative to `base_dir`."""
    max_depth = scene.get("max_depth", 64)
    sys.setrecursionlimit(max(sys.getrecursionlimit(), 1000 + 4 * max_depth))  # `trace` calls itself
    loader = Loader(scene, Path(base_dir))
    shapes = loader.shapes()
    return World(
        camera=loader.camera(),
        shapes=shapes,
        lights=loader.lights(),
        ambient=float(scene.get("ambient", 0.2)),
        background=loader.color(scene.get("background", BLACK)),
        cutoff=float(scene.get("cutoff", 0.05)),
        max_depth=max_depth,
        secondary_background=scene.get("secondary_background", False),
        reflect_totally=scene.get("tir", "drop") == "reflect",
        transparent_shadows=scene.get("transparent_shadows", False),
        diffuse_reflection=scene.get("diffuse_term", "lambert") == "reflection",
        linear=loader.linear,
        seed=scene.get("seed", 0),
        extent=max((shape.geometry.extent for shape in shapes), default=0.0),
    )


class Loader:
    """Turns the parts of a scene's table into records."""

    def __init__(self, scene: Table, base_dir: Path) -> None:
        """Textures and materials first, because shapes name them."""
        self.scene, self.base_dir = scene, base_dir
        self.literal = scene.get("literal", False)
        self.linear = scene.get("color_space", "display") == "linear"
        self.textures = {name: self.texture(entry) for name, entry in scene.get("textures", {}).items()}
        self.materials = {name: material(entry) for name, entry in scene.get("materials", {}).items()}

    def color(self, value: str | Sequence[float]) -> Vec:
        """A working value from "#rrggbb", "#rgb" or three numbers."""
        if isinstance(value, str):
            digits = value[1:] if len(value) == 7 else "".join(2 * digit for digit in value[1:])
            return self.decode(Vec(*(int(digits[k : k + 2], 16) / 255 for k in (0, 2, 4))))
        return self.decode(vec(value))

    def decode(self, color: Vec) -> Vec:
        """Display-referred to working values (section 9)."""
        return Vec(*(decode_srgb(c) for c in color)) if self.linear else color

    def camera(self) -> Camera:
        """The document's camera in its start pose, moved and turned, or the look-at form (section 7)."""
        entry = self.scene.get("camera", {})
        width, height = entry.get("resolution", (640, 480))
        camera = Camera(
            center=vec(entry.get("position", BLACK)),
            forward=Vec(0.0, 0.0, -1.0),
            right=Vec(1.0, 0.0, 0.0),
            down=Vec(0.0, -1.0, 0.0),
            distance=float(entry.get("distance", 800.0)),
            width=width,
            height=height,
            pixel_size=float(entry.get("pixel_size", 1.0)),
            pixel_offset=float(entry.get("pixel_offset", 0.0 if self.literal else 0.5)),
            supersample=entry.get("supersample", 1),
            depth_of_field=depth_of_field(entry.get("depth_of_field")),
        )
        if "origin" in entry:
            return looking_at(camera, entry)
        x_degrees, y_degrees = entry.get("rotate", (0.0, 0.0))
        return y_rotate(x_rotate(camera, x_degrees), y_degrees)

    def lights(self) -> list[Light]:
        """Lights with their shares w / sum w."""
        entries = self.scene.get("lights", ())
        weights = [float(entry.get("weight", 1.0)) for entry in entries]
        return [self.light(entry, w / sum(weights)) for entry, w in zip(entries, weights, strict=True)]

    def light(self, entry: Table, share: float) -> Light:
        """One light; u = unit(up x normal), v = normal x u (section 4)."""
        kind, color = entry.get("kind", "point"), self.color(entry.get("color", WHITE))
        if kind == "point":
            return Light(kind, vec(entry["position"]), share, color)
        samples, jitter = entry.get("samples", 16), entry.get("jitter", False)
        light = Light(kind, vec(entry["center"]), share, color, samples, jitter)
        if kind == "sphere":
            return replace(light, radius=float(entry["radius"]))
        normal = unit(vec(entry["normal"]))
        upright = math.hypot(normal.x, normal.z) < 1e-6
        u = unit(cross(Vec(0.0, 0.0, 1.0) if upright else Vec(0.0, 1.0, 0.0), normal))
        light = replace(light, u=u, v=cross(normal, u))
        if kind == "rectangle":
            return replace(light, size=(float(entry["size"][0]), float(entry["size"][1])))
        return replace(light, radius=float(entry["radius"]))

    def texture(self, entry: Table) -> Texture:
        """One texture; `literal` changes defaults only (section 6)."""
        truncate = entry.get("index", "truncate" if self.literal else "floor") == "truncate"
        if entry["kind"] == "solid":
            return Solid(self.color(entry["color"]))
        if entry["kind"] in ("stripes", "checker"):
            kind = Stripes if entry["kind"] == "stripes" else Checker
            colors = [self.color(value) for value in entry["colors"]]
            return kind(colors, float(entry.get("interval", 1.0)), truncate)
        return PictureTexture(
            uv=picture_coordinates(entry),
            texels=read_picture(self.base_dir / entry["file"]),
            decode=self.decode,
            truncate=truncate,
            flip_v=entry.get("flip_v", self.literal),
            bilinear=entry.get("filter", "nearest") == "bilinear",
        )

    def shapes(self) -> list[Shape]:
        """Shapes in the order of the scene; instances look up the meshes they name."""
        entries = self.scene.get("shapes", ())
        named = {entry["name"]: entry for entry in entries if "name" in entry}
        return [self.shape(inherited(entry, named)) for entry in entries]

    def shape(self, entry: Table) -> Shape:
        """One shape; white where it has neither texture nor color."""
        to_world, geometry = transform(entry), self.geometry(entry)
        frame = to_world if entry.get("texture_space", "world") == "object" else None
        own = self.textures[entry["texture"]] if "texture" in entry else None
        texture = own or Solid(self.color(entry.get("color", WHITE)))
        its_material = self.materials[entry["material"]] if "material" in entry else Material()
        return Shape(entry.get("name", ""), geometry, its_material, texture, frame)

    def geometry(self, entry: Table) -> Geometry:
        """The geometry, moved into the world."""
        to_world = transform(entry)
        if entry["kind"] == "plane":
            return plane(entry, to_world)
        if entry["kind"] == "sphere":
            center, radius = vec(entry["center"]), float(entry["radius"])
            return Sphere(to_world.point(center), abs(to_world.scale.x) * radius)
        smooth = entry.get("smooth", False)
        if "file" in entry:
            return mesh(read_mesh(self.base_dir / entry["file"]), to_world, smooth)
        if "builtin" in entry:
            return mesh(BUILTIN_MESHES[entry["builtin"]], to_world, smooth)
        return mesh(cut_polygons([vec(v) for v in entry["vertices"]], entry["faces"]), to_world, smooth)


def material(entry: Table) -> Material:
    """A material, numbers as floats."""
    return Material(**{key: float(value) for key, value in entry.items()})


def depth_of_field(entry: Table | None) -> DepthOfField | None:
    """30 draws and a tenth of the focus, unless the scene says otherwise (section 8)."""
    if entry is None:
        return None
    focus = float(entry["focus"])
    depth_range = float(entry.get("depth_range", 0.1 * focus))
    return DepthOfField(focus, entry.get("samples", 30), depth_range, entry.get("seed", 0))


def looking_at(camera: Camera, entry: Table) -> Camera:
    """f = unit(target - origin), X = unit(f x up), Y = f x X, s = 2 distance tan(fov/2) / h (section 7)."""
    origin = vec(entry["origin"])
    to_target = vec(entry["target"]) - origin
    forward = unit(to_target)
    right = unit(cross(forward, vec(entry.get("up", (0.0, 1.0, 0.0)))))
    distance = float(entry.get("distance", 1e-3 * norm(to_target)))
    return replace(
        camera,
        center=origin + distance * forward,
        forward=forward,
        right=right,
        down=cross(forward, right),
        distance=distance,
        pixel_size=2 * distance * math.tan(math.radians(entry["fov"]) / 2) / camera.height,
    )


def picture_coordinates(entry: Table) -> Callable[[Vec], tuple[float, float]]:
    """(u, v) = two coordinates for an image, M p + offset for an affine image (section 6)."""
    if entry["kind"] == "image":
        first, second = {"xy": (0, 1), "yz": (1, 2), "xz": (0, 2)}[entry.get("direction", "xy")]
        return lambda p: (p[first], p[second])
    row_u, row_v = vec(entry["matrix"][0]), vec(entry["matrix"][1])
    offset_u, offset_v = entry.get("offset", (0.0, 0.0))
    return lambda p: (dot(row_u, p) + offset_u, dot(row_v, p) + offset_v)


@dataclass(frozen=True)
class Transform:
    """x -> R (scale x) + translation with R = R_z R_y R_x, about the origin (section 5)."""

    scale: Vec
    rows: tuple[Vec, Vec, Vec]  # of R
    translation: Vec

    def turn(self, p: Vec) -> Vec:
        """R p."""
        return Vec(*(dot(row, p) for row in self.rows))

    def point(self, p: Vec) -> Vec:
        """From the shape's own space to the world."""
        return self.turn(componentwise(self.scale, p)) + self.translation

    def inverse(self, p: Vec) -> Vec:
        """From the world to the shape's own space."""
        offset, (row_x, row_y, row_z) = p - self.translation, self.rows
        return self.unscaled(offset.x * row_x + offset.y * row_y + offset.z * row_z)

    def normal(self, n: Vec) -> Vec:
        """A normal goes by the inverse transpose: R (n / scale)."""
        return unit(self.turn(self.unscaled(n)))

    def unscaled(self, p: Vec) -> Vec:
        """p / scale, component by component."""
        return Vec(p.x / self.scale.x, p.y / self.scale.y, p.z / self.scale.z)


def transform(entry: Table) -> Transform:
    """Scale (a number or three), rotate (degrees, about x, then y, then z), translate."""
    scale = entry.get("scale", 1.0)
    angles = [math.radians(degrees) for degrees in entry.get("rotate", BLACK)]
    (cx, cy, cz), (sx, sy, sz) = [math.cos(a) for a in angles], [math.sin(a) for a in angles]
    rows = (
        Vec(cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx),
        Vec(sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx),
        Vec(-sy, cy * sx, cy * cx),
    )
    scales = vec((scale, scale, scale) if isinstance(scale, (int, float)) else scale)
    return Transform(scales, rows, vec(entry.get("translate", BLACK)))


def plane(entry: Table, to_world: Transform) -> Plane:
    """(a, b, c, d) normalized, or n = u x v / |u x v|, d = -n.p; then n turned, d scaled and moved along."""
    if "coefficients" in entry:
        a, b, c, d = (float(x) for x in entry["coefficients"])
        n, d = unit(Vec(a, b, c)), d / norm(Vec(a, b, c))
    else:
        n = unit(cross(vec(entry["u"]), vec(entry["v"])))
        d = -dot(n, vec(entry["point"]))
    turned = to_world.turn(n)
    return Plane(turned, to_world.scale.x * d - dot(turned, to_world.translation))


def inherited(entry: Table, named: Mapping[str, Table]) -> Table:
    """An instance with the mesh it names, and with that mesh's looks where it does not state its own."""
    if entry["kind"] != "instance":
        return entry
    looks = () if "texture" in entry or "color" in entry else ("texture", "color")
    shared = ("file", "vertices", "faces", "builtin", "material", "smooth", "texture_space", *looks)
    source = inherited(named[entry["of"]], named)
    return {**{key: source[key] for key in shared if key in source}, **entry, "kind": "mesh"}


def mesh(source: MeshFile, to_world: Transform, smooth: bool) -> Mesh:
    """Vertices are rounded to single precision as read and once more after the move.

    A mesh that the transform mirrors is wound the other way round, so that its normals stay outward.
    A triangle with the corners of an earlier one is never hit.
    """
    vertices = [single(to_world.point(single(vec(vertex)))) for vertex in source.vertices]
    mirrored = to_world.scale.x * to_world.scale.y * to_world.scale.z < 0
    triangles = [(a, c, b) if mirrored else (a, b, c) for a, b, c in source.triangles]
    areas = [cross(vertices[b] - vertices[a], vertices[c] - vertices[a]) for a, b, c in triangles]
    corner_normals = None
    if smooth and source.corner_normals:
        moved = [[to_world.normal(vec(n)) for n in normals] for normals in source.corner_normals]
        corner_normals = [(a, c, b) if mirrored else (a, b, c) for a, b, c in moved]
    elif smooth:
        numbers = source.places or range(len(vertices))
        shared = [(numbers[a], numbers[b], numbers[c]) for a, b, c in triangles]
        corner_normals = area_weighted(len(vertices), shared, areas)
    first: dict[frozenset[Vec], int] = {}
    same = [first.setdefault(frozenset(vertices[k] for k in t), n) for n, t in enumerate(triangles)]
    normals = [unit(area) if same[n] == n else BLACK for n, area in enumerate(areas)]
    low, high = (Vec(*(pick(axis) for axis in zip(*vertices, strict=True))) for pick in (min, max))
    return Mesh(vertices, triangles, normals, corner_normals, low, high)


def area_weighted(
    count: int, triangles: Sequence[tuple[int, int, int]], areas: Sequence[Vec]
) -> list[tuple[Vec, Vec, Vec]]:
    """Corner normals: at each vertex number the sum of (b-a) x (c-a) over its triangles."""
    sums = [BLACK] * count
    for triangle, area in zip(triangles, areas, strict=True):
        for vertex in triangle:
            sums[vertex] += area
    return [(unit(sums[a]), unit(sums[b]), unit(sums[c])) for a, b, c in triangles]


def single(p: Vec) -> Vec:
    """The nearest single-precision numbers."""
    return Vec(*struct.unpack("3f", struct.pack("3f", *p)))
