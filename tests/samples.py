"""Small solids, shards and runs that several tests share."""

from pathlib import Path

import numpy as np
import torch
import trimesh

from stereo_occ.data.shard import Views
from stereo_occ.data.shard_writing import write_shard
from stereo_occ.geometry.camera import toed_in_rig
from stereo_occ.geometry.pose import Pose
from stereo_occ.geometry.rotations import random_rotations
from stereo_occ.metrics.volumetric import iou_at_thresholds
from stereo_occ.occupancy.pools import box_pool, surface_pool
from stereo_occ.shapes.shape import Shape

#: Objects per category in the paper's data set (section 4).
PAPER_COUNTS = {"mug": 114, "bowl": 174, "bottle": 352}

SIDE = 16  # pixels

POOL = 2000  # points

#: A run of seconds with every part switched on. It has 6 training views: its 12 steps of 4 pairs pass through them
#: 8 times, and most of these data epochs end within a batch.
TINY = [
    "steps=12", "batch_size=4", "points=64", "progress=false", "workers=1",
    "data.image_side=32", "data.views=2", "data.pool_size=2000", "scale.counts={mug:3,bowl:3,bottle:3}",
    "validation.interval=6", "validation.checkpoint_interval=3", "validation.views=2", "validation.points=500",
    "model.width=8", "model.code_size=16", "model.encoder.widths=[8,8,8]", "model.encoder.blocks=[1,1,1]",
    "model.decoder.hidden=16", "model.decoder.blocks=1", "optimizer.lr=0.01",
    "logger.interval=1", "logger.mesh_resolution=8",
]  # fmt: skip


def iou(predicted_BN: torch.Tensor, occupied_BN: torch.Tensor) -> torch.Tensor:
    """IoU ``(B,)`` of yes or no ``(B, N)``, by the package's rule for logits."""
    logits_BN = torch.where(predicted_BN, 9.0, -9.0)
    return iou_at_thresholds(logits_BN, occupied_BN, torch.tensor([0.5]))[:, 0]


def solid(category: str, object_id: str) -> Shape:
    """A box with a hole through it, its proportions drawn from its name; it looks different from every side."""
    rng = np.random.default_rng(list(object_id.encode()))
    outer = trimesh.creation.box(extents=rng.uniform(0.2, 1, 3))
    hole = trimesh.creation.cylinder(radius=0.05, height=3, sections=12)
    return Shape(category, object_id, outer.difference(hole), facts={"kind": "box"}).normalized()


def views_of(count: int, side: int = SIDE, seed: int = 0, scale: float = 1.0) -> Views:
    """Noise for images, random poses at the fixation point, the paper's cameras."""
    rng = np.random.default_rng(seed)
    rig = toed_in_rig(1.0, np.pi / 16, np.pi / 3, side)
    poses = [Pose(rotation_33, scale, np.zeros(3)) for rotation_33 in random_rotations(count, rng)]
    return Views(
        rgb=rng.integers(256, size=(count, 2, side, side, 3), dtype=np.uint8),
        mask=rng.integers(256, size=(count, 2, side, side), dtype=np.uint8),
        depth=rng.uniform(0.5, 1.5, (count, 2, side, side)).astype(np.float16),
        K=np.tile(np.stack([camera.K for camera in rig.cameras]), (count, 1, 1, 1)),
        camera_from_rig=np.tile(
            np.stack([camera.camera_from_rig for camera in rig.cameras]), (count, 1, 1, 1)
        ),
        rig_from_object=np.stack([pose.rig_from_object for pose in poses]),
    )


def pools_of(shape: Shape, points: int = POOL) -> dict:
    """Point pools as the shards of a run have them."""
    rng = np.random.default_rng(0)
    return {"box": box_pool(shape, points, rng), "surface": surface_pool(shape, points, rng)}


def small_shard(
    folder: Path, category: str = "mug", object_id: str = "cup", views: int = 3, **kwargs
) -> Path:
    """Write a shard of :func:`solid` and return its path."""
    shape = solid(category, object_id)
    path = folder / category / f"{object_id}.h5"
    write_shard(path, shape, views_of(views, **kwargs), pools_of(shape))
    return path


def single_line(message: str) -> bool:
    """Whether a message is one line of readable length."""
    return "\n" not in message and len(message) < 300
