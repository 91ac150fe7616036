"""One object of a data set."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray
from trimesh import Trimesh

CATEGORIES = ("mug", "bowl", "bottle")

#: What is known about an object; plain values that JSON can hold.
Fact = str | float | bool | list[list[float]]

#: Part labels of query points, in the order of their codes in a shard; 0 is a point outside the object.
PARTS = ("outside", "wall", "floor", "neck", "handle")


@dataclass(frozen=True, eq=False)
class Shape:
    """A solid object in the object frame: bounding box centred at the origin, its diagonal 1.

    Attributes:
        category: one of :data:`CATEGORIES`.
        object_id: unique within its data set.
        mesh: watertight, outward winding, positive volume.
        parts: solids that delimit the named parts, in the object frame; an occupied point belongs to the
            first one that contains it, else to the wall. Empty where the parts are not known.
        facts: plain figures about the object (kind, wall thickness, ...) for reports.
        colors: of the vertices ``(V, 3)``, sRGB; None where the object has no colours of its own.
    """

    category: str
    object_id: str
    mesh: Trimesh
    parts: Mapping[str, Trimesh] = field(default_factory=dict)
    facts: Mapping[str, Fact] = field(default_factory=dict)
    colors: NDArray[np.uint8] | None = None

    def normalized(self) -> Self:
        """The same object moved and scaled into the object frame."""
        low, high = self.mesh.bounds
        to_object = np.eye(4)
        to_object[:3, :3] /= np.linalg.norm(high - low)
        to_object[:3, 3] = -(low + high) / 2 / np.linalg.norm(high - low)
        return type(self)(
            self.category,
            self.object_id,
            self.mesh.copy().apply_transform(to_object),
            {name: part.copy().apply_transform(to_object) for name, part in self.parts.items()},
            self.facts,
            self.colors,
        )
