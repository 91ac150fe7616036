"""Open vessels, the bodies of mugs and bowls: a wall of constant thickness that follows an outer profile."""

from dataclasses import dataclass

import numpy as np
from manifold3d import CrossSection, FillRule
from numpy.random import Generator

from stereo_occ.shapes import solids
from stereo_occ.shapes.curves import Points

#: Height up to which the sections of hulls and cavities reach, far above any rim.
OPEN = 3.0


@dataclass(frozen=True)
class Vessel:
    """Lathe sections of one vessel.

    Attributes:
        wall: the vessel itself.
        hull: everything the outer surface encloses, and the space above the rim.
        middle: the same within the middle of the wall, where a handle is cut off.
        floor: height of the lowest point of the cavity.
    """

    wall: CrossSection
    hull: CrossSection
    middle: CrossSection
    floor: float


def wall_fraction(rng: Generator) -> float:
    """Wall thickness over the object's longest side: 1.1 to 5.6 %, two thirds of it between 2 and 4 %."""
    return float(np.clip(rng.lognormal(np.log(0.028), 0.34), 0.0115, 0.056))


def vessel(
    profile_N2: Points,
    thickness: float,
    floor: float,
    base_radius: float,
    cavity_radius: float,
    rim: float,
    level_rim: bool = True,
    foot: CrossSection | None = None,
    lip: CrossSection | None = None,
) -> Vessel:
    """A vessel around an outer profile from the edge of its base to its rim.

    Args:
        profile_N2: (radius, height), heights from 0 to about 1.
        thickness: of the wall, normal to the profile.
        floor: thickness of the floor, not below that of the wall.
        base_radius: rounding of the outer base edge.
        cavity_radius: rounding between floor and wall inside.
        rim: rounding of the rim over the wall thickness, below 0.5.
        level_rim: cut the rim level, else square to the wall.
        foot: section added below and beside the base.
        lip: section added to the rim.
    """
    end = profile_N2[-1]
    along = end - profile_N2[-3]
    along = np.array([0.0, 1.0]) if level_rim else along / np.linalg.norm(along)
    beyond = end + 4 * thickness * along
    above = np.array([max(beyond[0], 2 * thickness), OPEN])
    hull = solids.section_of(np.concatenate([profile_N2, [beyond, above]]))
    hull = solids.rounded(hull, outward=base_radius)
    middle = solids.offset(hull, -thickness / 2)
    cavity = solids.offset(hull, -thickness) ^ solids.rectangle((0, OPEN), (floor, OPEN))
    cavity = solids.rounded(cavity, outward=cavity_radius)
    if foot is not None:
        hull = solids.rounded(hull + foot, inward=0.4 * thickness)
    wall = hull - cavity - _beyond(end, along, thickness)
    if lip is not None:
        wall += lip
    return Vessel(solids.rounded(wall, outward=rim * thickness), hull, middle, cavity.bounds()[1])


def _beyond(end: Points, along: Points, thickness: float) -> CrossSection:
    """What a rim square to ``along`` cuts off: a box beyond the end of the profile, and all far above."""
    across = 2.5 * thickness * np.array([-along[1], along[0]])
    far = end + 6 * thickness * along
    right = CrossSection(
        [np.array([end - across, far - across, far + across, end + across])], FillRule.NonZero
    )
    return right + right.mirror((1, 0)) + solids.rectangle((0, OPEN), (end[1] + 2 * thickness, 2 * OPEN))
