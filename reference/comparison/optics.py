"""Mirror and refraction by Mitsuba's own materials: conductor and dielectric, one lobe each."""

from __future__ import annotations

from typing import Any

import numpy as np

from reference.mitsuba_variant import mitsuba

Array = np.ndarray


def mirrored(d: Array, outward: Array) -> Array:
    """(n, 3) directions that a mirror sends rays of unit direction d to, at unit normals; all numbers are
    rounded to single precision."""
    mi = mitsuba()
    bsdf = mi.load_dict({"type": "twosided", "bsdf": {"type": "conductor"}})
    return _sample(mi, bsdf, mi.BSDFFlags.DeltaReflection, d, outward)[0]


def refracted(d: Array, outward: Array, ior: Array) -> tuple[Array, Array]:
    """(n, 3) refracted directions, and (n,) masks of total reflection, where they mean nothing.

    With the lobe of transmission alone Mitsuba gives the weight 0 under total reflection.
    """
    mi = mitsuba()
    way, total = np.zeros(d.shape), np.zeros(len(d), bool)
    for value in np.unique(ior):
        bsdf = mi.load_dict({"type": "dielectric", "int_ior": float(value), "ext_ior": 1.0})
        k = np.flatnonzero(ior == value)
        way[k], weight = _sample(mi, bsdf, mi.BSDFFlags.DeltaTransmission, d[k], outward[k])
        total[k] = weight == 0
    return way, total


def _sample(mi: Any, bsdf: Any, lobe: Any, d: Array, outward: Array) -> tuple[Array, Array]:
    """Directions (n, 3) and weights (n,) of one lobe."""
    import drjit as dr

    if not len(d):
        return np.zeros((0, 3)), np.zeros(0)
    normal, way = (
        mi.Vector3f(*(mi.Float(np.ascontiguousarray(c, np.float32)) for c in v.T)) for v in (outward, d)
    )
    si = dr.zeros(mi.SurfaceInteraction3f, len(d))
    si.n = mi.Normal3f(normal)
    si.sh_frame = mi.Frame3f(normal)
    si.wi = si.to_local(-way)
    context = mi.BSDFContext()
    context.type_mask = int(lobe)
    sample, weight = bsdf.sample(context, si, 0.5, mi.Point2f(0.5), True)
    out, weight = si.to_world(sample.wo), dr.max(weight)
    return out.numpy().T.astype(np.float64), np.broadcast_to(weight.numpy(), len(d))
