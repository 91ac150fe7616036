"""Handles of mugs and jugs: a tube swept along a curve from an upper to a lower point of the wall."""

from dataclasses import dataclass

import numpy as np
from manifold3d import Manifold
from numpy.random import Generator

from stereo_occ.shapes import curves, solids
from stereo_occ.shapes.curves import Points

HANDLES = ("C", "D", "ear", "square")
SECTIONS = ("round", "oval", "flat")


@dataclass(frozen=True)
class Handle:
    """What a handle is to be; lengths are in units of the object.

    Attributes:
        kind: one of :data:`HANDLES`.
        section: one of :data:`SECTIONS`.
        top: height of its upper end.
        bottom: height of its lower end.
        clearance: the widest gap between it and the wall.
        thickness: of the tube in the plane of the handle.
    """

    kind: str
    section: str
    top: float
    bottom: float
    clearance: float
    thickness: float


def handle_tube(rng: Generator, handle: Handle, profile_N2: Points, depth: float) -> Manifold:
    """The handle of a vessel with an outer profile, both ends ``depth`` inside it."""
    height, radius = profile_N2[:, 1], profile_N2[:, 0]
    top, bottom = (np.array([np.interp(y, height, radius), y]) for y in (handle.top, handle.bottom))
    between = (height > handle.bottom) & (height < handle.top)
    chord = np.interp(height, [bottom[1], top[1]], [bottom[0], top[0]])
    bulge = max(0.0, float((radius - chord)[between].max(initial=0.0)))
    path_N2 = _path(rng, handle, top, bottom, handle.clearance + handle.thickness / 2 + bulge)
    inward = np.array([[-depth, 0.0]])
    path_N2 = curves.resampled(np.concatenate([path_N2[:1] + inward, path_N2, path_N2[-1:] + inward]), 38)

    half = min(handle.thickness / 2, 0.8 * curves.smallest_bend(path_N2[4:-4]))
    exponent, width = {
        "round": (2.0, 1.0),
        "oval": (rng.uniform(2.0, 2.6), rng.uniform(1.25, 1.7)),
        "flat": (rng.uniform(3.0, 6.0), rng.uniform(1.6, 2.6)),
    }[handle.section]
    at = np.linspace(0, 1, len(path_N2))
    flare, sharpness = rng.uniform(0.0, 0.5), rng.uniform(0.08, 0.16)
    ends = 1 + flare * (np.exp(-((at / sharpness) ** 2)) + np.exp(-(((1 - at) / sharpness) ** 2)))
    waist = 1 - rng.uniform(0.0, 0.2) * np.sin(np.pi * at) ** 2
    across = np.minimum(half * width, 0.7 * min(top[0], bottom[0]))
    return solids.sweep(path_N2, np.stack([half * np.ones_like(at), across * ends * waist], axis=1), exponent)


def _path(rng: Generator, handle: Handle, top: Points, bottom: Points, reach: float) -> Points:
    """The centre line from the wall at ``top`` to the wall at ``bottom``."""
    span = top[1] - bottom[1]
    out = np.array([1.0, 0.0])
    up = np.array([0.0, 1.0])
    if handle.kind == "C":
        push = reach / 0.75
        drop = rng.uniform(-0.05, 0.1) * span
        return curves.bezier([top, top + push * out + drop * up, bottom + push * out - drop * up, bottom], 48)
    if handle.kind == "ear":
        rise, lower = rng.uniform(0.05, 0.35) * span, rng.uniform(0.35, 0.75)
        push = reach / (0.375 * (1 + lower) + 0.06)
        tail = rng.uniform(-0.05, 0.2) * span
        control = [top, top + push * out + rise * up, bottom + lower * push * out + tail * up, bottom]
        return curves.bezier(control, 48)
    rise = rng.uniform(-0.06, 0.1) * span
    sink = rng.uniform(-0.06, 0.12) * span
    lower = rng.uniform(0.75, 1.05)
    corners = [top, top + reach * out + rise * up, bottom + lower * reach * out + sink * up, bottom]
    share = rng.uniform(0.38, 0.48) if handle.kind == "D" else rng.uniform(0.16, 0.26)
    return curves.filleted(corners, max(share * span, 1.3 * handle.thickness))
