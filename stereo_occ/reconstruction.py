"""From a model's occupancy function to a mesh."""

from collections.abc import Callable
from math import log

import numpy as np
import torch
from numpy.typing import NDArray
from trimesh import Trimesh

from stereo_occ.decision import Decision, DecisionRule
from stereo_occ.meshing import SampledField, sample_field
from stereo_occ.models.base import OccupancyModel, StereoViews
from stereo_occ.models.sampling import cell_centers

#: Along each side of the cube, of the points that tell a pair's threshold.
CELLS = 24

#: Occupancy logits ``(N,)`` of points ``(N, 3)`` of the cube ``[-0.5, 0.5]^3``.
Occupancy = Callable[[NDArray[np.float32]], NDArray[np.float32]]


def reconstruct(model: OccupancyModel, views: StereoViews, decision: Decision, resolution: int) -> Trimesh:
    """The surface that the model sees in one stereo pair (``B = 1``), rig frame, metres.

    Args:
        decision: where the surface is.
        resolution: cells along each side of the cube ``[-0.5, 0.5]^3``.

    Returns:
        A closed mesh, empty if nothing is occupied.
    """
    was_training = model.training
    model.eval()
    occupancy = occupancy_of(model, views)
    mesh = sample_cube(occupancy, threshold_of(decision, occupancy), resolution).surface()
    model.train(was_training)
    return mesh


def occupancy_of(model: OccupancyModel, views: StereoViews) -> Occupancy:
    """What a model in eval mode says of one pair (``B = 1``)."""
    device = next(model.parameters()).device
    with torch.inference_mode():
        code = model.encode(views)

    def logits(points_N3: NDArray[np.float32]) -> NDArray[np.float32]:
        with torch.inference_mode():
            points_BN3 = torch.as_tensor(points_N3, dtype=torch.float32, device=device)[None]
            return np.asarray(model.decode_all(code, points_BN3)[0].float().cpu().numpy())

    return logits


def threshold_of(decision: Decision, occupancy: Occupancy) -> float:
    """The occupancy probability at the surface of one pair."""
    if decision.rule is DecisionRule.fixed:
        return decision.threshold
    logits_N = occupancy(cell_centers(CELLS).numpy())
    return float(decision.thresholds(torch.from_numpy(logits_N)[None]))


def sample_cube(occupancy: Occupancy, threshold: float, resolution: int) -> SampledField:
    """The cube ``[-0.5, 0.5]^3`` sampled around the surface of that occupancy probability."""
    half_3 = np.full(3, 0.5)
    return sample_field(occupancy, -half_3, half_3, resolution, log(threshold / (1 - threshold)))


def expected_iou(field: SampledField) -> float:
    """What IoU the answer can expect if the probabilities are right: between sums over the samples.

    Those inside are all in the union, and in the intersection with their probability; those outside are in the union
    with theirs. 0 if nothing is inside.
    """
    probability = 1 / (1 + np.exp(-field.values_CCC.astype(np.float64).clip(-50, 50)))
    inside = field.values_CCC > field.level
    if not inside.any():
        return 0.0
    return float(probability[inside].sum() / (inside.sum() + probability[~inside].sum()))
