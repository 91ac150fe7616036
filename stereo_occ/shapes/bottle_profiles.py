"""Outer profiles of bottles: body, shoulder and neck by kind. The top of the neck is at height 1."""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from stereo_occ.shapes import curves
from stereo_occ.shapes.curves import Points

Range = tuple[float, float]


@dataclass(frozen=True)
class Form:
    """The ranges one kind of bottle is drawn from.

    Attributes:
        width: of the body over the height.
        neck: radius of the neck over that of the body.
        body: height at which the shoulder starts.
        shoulder: height of the shoulder; the neck takes the rest.
        ribbed: how often the body has ribs or a recessed label.
    """

    width: Range
    neck: Range
    body: Range
    shoulder: Range
    ribbed: float


FORMS = {
    "wine": Form(width=(0.22, 0.31), neck=(0.34, 0.46), body=(0.42, 0.66), shoulder=(0.1, 0.28), ribbed=0.0),
    "soda": Form(width=(0.24, 0.38), neck=(0.32, 0.48), body=(0.5, 0.7), shoulder=(0.18, 0.28), ribbed=0.5),
    "flask": Form(width=(0.4, 0.72), neck=(0.22, 0.4), body=(0.6, 0.8), shoulder=(0.05, 0.15), ribbed=0.1),
    "jar": Form(width=(0.45, 0.95), neck=(0.7, 0.96), body=(0.74, 0.88), shoulder=(0.03, 0.08), ribbed=0.15),
    "jug": Form(width=(0.42, 0.7), neck=(0.2, 0.4), body=(0.56, 0.72), shoulder=(0.14, 0.24), ribbed=0.3),
    "spray": Form(width=(0.34, 0.55), neck=(0.24, 0.4), body=(0.6, 0.77), shoulder=(0.1, 0.2), ribbed=0.3),
    "squeeze": Form(width=(0.28, 0.5), neck=(0.4, 0.8), body=(0.66, 0.84), shoulder=(0.04, 0.13), ribbed=0.2),
}


@dataclass(frozen=True)
class Silhouette:
    """The outer profile of one bottle.

    Attributes:
        profile_N2: (radius, height) from the base edge to the top of the neck.
        radius: the widest.
        neck_radius: at the top.
        shoulder: height at which the shoulder starts.
        neck: height at which the neck starts.
    """

    profile_N2: Points
    radius: float
    neck_radius: float
    shoulder: float
    neck: float


def silhouette(rng: Generator, kind: str) -> Silhouette:
    """A random outer profile of a kind of :data:`FORMS`."""
    form = FORMS[kind]
    radius = rng.uniform(*form.width) / 2
    shoulder = rng.uniform(*form.body)
    neck = min(shoulder + rng.uniform(*form.shoulder), 0.94)
    neck_radius = radius * rng.uniform(*form.neck)
    body_N2 = _body(rng, kind, radius, shoulder)
    if rng.random() < form.ribbed:
        body_N2 = _ribbed(rng, body_N2, radius)
    shoulder_N2 = _shoulder(rng, body_N2[-1, 0], shoulder, neck_radius, neck)
    top_radius = neck_radius * rng.uniform(0.85, 1.0)
    profile_N2 = np.concatenate([body_N2, shoulder_N2[1:], [[top_radius, 1.0]]])
    return Silhouette(profile_N2, float(profile_N2[:, 0].max()), top_radius, shoulder, neck)


def _body(rng: Generator, kind: str, radius: float, top: float) -> Points:
    """From the base edge to the shoulder: straight, tapered either way, waisted or bellied."""
    odds = (0.8, 0.2, 0.0, 0.0) if kind == "wine" else (0.4, 0.25, 0.2, 0.15)
    style = str(rng.choice(("straight", "tapered", "waisted", "bellied"), p=odds))
    at = rng.uniform(0.35, 0.65) * top
    if style == "straight":
        return curves.monotone([0, top], [radius, radius], 40)
    if style == "tapered":
        low, high = (rng.uniform(0.8, 0.97), 1.0) if rng.random() < 0.6 else (1.0, rng.uniform(0.75, 0.97))
        return curves.monotone([0, top], [radius * low, radius * high], 40)
    if style == "waisted":
        waist = rng.uniform(0.78, 0.93)
        low = rng.uniform(0.92, 1.0)
        return curves.monotone(
            [0, 0.45 * at, at, top], [0.97 * radius * low, radius * low, radius * waist, radius], 40
        )
    ends = rng.uniform(0.8, 0.95, 2)
    return curves.monotone([0, at, top], [radius * ends[0], radius, radius * ends[1]], 40)


def _ribbed(rng: Generator, body_N2: Points, radius: float) -> Points:
    """The body with grooves around it, or with one wide recess for a label."""
    share = body_N2[:, 1] / body_N2[-1, 1]
    low, high = rng.uniform(0.1, 0.35), rng.uniform(0.6, 0.92)
    at = np.clip((share - low) / (high - low), 0, 1)
    if rng.random() < 0.5:
        groove = 0.5 - 0.5 * np.cos(2 * np.pi * int(rng.integers(2, 6)) * at)
        depth = rng.uniform(0.03, 0.07)
    else:
        groove = np.clip(np.minimum(at, 1 - at) * 20, 0, 1)
        depth = rng.uniform(0.02, 0.05)
    return np.stack([body_N2[:, 0] - depth * radius * groove, body_N2[:, 1]], axis=1)


def _shoulder(rng: Generator, low_radius: float, low: float, high_radius: float, high: float) -> Points:
    """From the body to the neck: a flowing curve, a round dome or a cone."""
    style = str(rng.choice(("flowing", "dome", "cone"), p=(0.5, 0.3, 0.2)))
    rise = high - low
    if style == "flowing":
        leave, arrive = rng.uniform(0.3, 0.85), rng.uniform(0.2, 0.7)
        control = [[low_radius, low], [low_radius, low + leave * rise]]
        return curves.bezier([*control, [high_radius, high - arrive * rise], [high_radius, high]], 24)
    if style == "dome":
        inner = high_radius + 0.45 * (low_radius - high_radius)
        return curves.bezier(
            [[low_radius, low], [low_radius, low + 0.55 * rise], [inner, high], [high_radius, high]], 20
        )
    return np.array([[low_radius, low], [high_radius, high]])
