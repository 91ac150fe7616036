"""A training step as the field's reference code writes it: the yardstick of ``benchmarks.training_step``.

fp32, contiguous tensors, the ONet decoder out of 1x1 convolutions over ``(B, C, N)`` with two more convolutions of the
code for each conditional norm, Adam as torch gives it, and samples read from npz files, one for the points of an
object (float32 points, packed labels) and one for each pair, of which a random part of the points is used.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn.functional import relu

from stereo_occ.data.batch import Batch, Queries, ViewId
from stereo_occ.data.shard import Shard
from stereo_occ.models.base import StereoViews


class ConvConditionalNorm(nn.Module):
    """Batch norm over ``(B, C, N)``; gain and bias are 1x1 convolutions of the code."""

    def __init__(self, code_size: int, channels: int) -> None:
        super().__init__()
        self.gain, self.bias = nn.Conv1d(code_size, channels, 1), nn.Conv1d(code_size, channels, 1)
        self.norm = nn.BatchNorm1d(channels, affine=False)

    def forward(self, x_BCN: Tensor, code_BC1: Tensor) -> Tensor:
        """Same shape."""
        normalized_BCN: Tensor = self.gain(code_BC1) * self.norm(x_BCN) + self.bias(code_BC1)
        return normalized_BCN


class ConvBlock(nn.Module):
    """Residual block of the decoder."""

    def __init__(self, code_size: int, channels: int) -> None:
        super().__init__()
        self.norm0, self.norm1 = (ConvConditionalNorm(code_size, channels) for _ in range(2))
        self.fc0, self.fc1 = nn.Conv1d(channels, channels, 1), nn.Conv1d(channels, channels, 1)

    def forward(self, x_BCN: Tensor, code_BC1: Tensor) -> Tensor:
        """Same shape."""
        hidden_BCN = self.fc0(relu(self.norm0(x_BCN, code_BC1)))
        residual_BCN: Tensor = self.fc1(relu(self.norm1(hidden_BCN, code_BC1)))
        return x_BCN + residual_BCN


class ConvONet(nn.Module):
    """The decoder of Mescheder et al. (CVPR 2019) with 1x1 convolutions; the function of :class:`decoders.ONet`."""

    def __init__(self, code_size: int, *, hidden: int, blocks: int) -> None:
        super().__init__()
        self.embed = nn.Conv1d(3, hidden, 1)
        self.blocks = nn.ModuleList(ConvBlock(code_size, hidden) for _ in range(blocks))
        self.norm = ConvConditionalNorm(code_size, hidden)
        self.head = nn.Conv1d(hidden, 1, 1)

    def forward(self, code_BC: Tensor, points_BN3: Tensor) -> Tensor:
        """Code and points to logits ``(B, N)``."""
        code_BC1 = code_BC[..., None]
        x_BCN = self.embed(points_BN3.transpose(1, 2))
        for block in self.blocks:
            x_BCN = block(x_BCN, code_BC1)
        logits_BN: Tensor = self.head(relu(self.norm(x_BCN, code_BC1))).squeeze(1)
        return logits_BN


def export_npz(shards: list[Shard], folder: Path) -> None:
    """Write shards as the npz files described above."""
    for shard in shards:
        target = folder / shard.category / shard.object_id
        target.mkdir(parents=True)
        pool = shard.pool("box")
        points_N3, occupied_N = pool.points_N3, pool.occupied_N
        np.savez(target / "points.npz", points=points_N3, occupancies=np.packbits(occupied_N))
        for view in range(len(shard)):
            K, camera_from_rig = shard.cameras(view)
            np.savez(
                target / f"pair_{view:03d}.npz",
                images=shard.rgb(view),
                K=K,
                camera_from_rig=camera_from_rig,
                rig_from_object=shard.pose(view).rig_from_object,
            )


def npz_batches(folder: Path, batch_size: int, points: int) -> Iterator[Batch]:
    """Random batches from the files, without end."""
    rng = np.random.default_rng(0)
    pairs = sorted(folder.glob("*/*/pair_*.npz"))
    while True:
        samples = [_sample(pairs[i], points, rng) for i in rng.integers(len(pairs), size=batch_size)]
        images, K, camera_from_rig, points_BN3, occupied_BN = (
            torch.stack([torch.from_numpy(sample[field]) for sample in samples]) for field in range(5)
        )
        yield Batch(
            StereoViews(images[:, 0], images[:, 1], K, camera_from_rig),
            {"train": Queries(points_BN3, occupied_BN)},
            [ViewId("", "", 0)] * batch_size,
        )


def _sample(pair: Path, points: int, rng: np.random.Generator) -> tuple[NDArray[Any], ...]:
    with np.load(pair) as file:
        images = file["images"].astype(np.float32).transpose(0, 3, 1, 2) / 255
        K, camera_from_rig = file["K"].astype(np.float32), file["camera_from_rig"].astype(np.float32)
        rig_from_object = file["rig_from_object"]
    with np.load(pair.parent / "points.npz") as file:
        pool_N3, occupied_N = file["points"], np.unpackbits(file["occupancies"])
    chosen = rng.integers(len(pool_N3), size=points)
    points_N3 = pool_N3[chosen] @ rig_from_object[:3, :3].T + rig_from_object[:3, 3]
    return images, K, camera_from_rig, points_N3.astype(np.float32), occupied_N[chosen].astype(np.float32)
