"""Where a mug, bowl or bottle is in a photograph, with a detector that torchvision keeps.

Faster R-CNN (Ren et al., NeurIPS 2015) on MobileNetV3, trained on COCO. Its weights (74 MB) are fetched once.
"""

from functools import cache

import numpy as np
import torch
from torch import Tensor, nn
from torchvision.models.detection import (
    FasterRCNN_MobileNet_V3_Large_FPN_Weights,
    fasterrcnn_mobilenet_v3_large_fpn,
)

from stereo_occ.errors import UserError
from stereo_occ.geometry.crop import Box
from stereo_occ.models.pretrained import load_pretrained
from stereo_occ.photographs.locate import Found, outline_of
from stereo_occ.photographs.photo import Photo

WEIGHTS = FasterRCNN_MobileNet_V3_Large_FPN_Weights.COCO_V1

#: What COCO calls them.
NAMES = {"mug": "cup", "bowl": "bowl", "bottle": "bottle"}

#: Scores below which nothing was found.
LEAST = 0.5


def detected(photo: Photo, what: str, name: str) -> Found:
    """The likeliest ``what`` in a photograph: mug, bowl or bottle.

    Args:
        name: of the photograph, for messages.

    Raises:
        UserError: nothing else can be looked for, there is none, or the detector cannot be fetched.
    """
    if what not in NAMES:
        raise UserError(f"find={what}: must be one of {', '.join(NAMES)}")
    boxes_N4, labels_N, scores_N = detections(photo)
    wanted = WEIGHTS.meta["categories"].index(NAMES[what])
    scores_N = torch.where(labels_N == wanted, scores_N, 0.0)
    if not len(scores_N) or scores_N.max() < LEAST:
        raise UserError(
            f"find={what}: none is found in the {name} image; give {name}_box=[left,top,right,bottom]"
        )
    best = int(scores_N.argmax())
    left, top, right, bottom = (boxes_N4[best].numpy().astype(np.float64) - 0.5).tolist()
    return Found(
        outline_of(Box(left, top, right, bottom)), None, f"detected with {float(scores_N[best]):.2f}"
    )


def detections(photo: Photo) -> tuple[Tensor, Tensor, Tensor]:
    """Boxes ``(N, 4)`` from the image's outer edge, COCO's labels ``(N,)`` and scores ``(N,)``, best first."""
    image_CHW = torch.tensor(photo.rgb_HW3).permute(2, 0, 1).float() / 255
    with torch.inference_mode():
        (found,) = _detector()([image_CHW])
    return found["boxes"], found["labels"], found["scores"]


@cache
def _detector() -> nn.Module:
    network: nn.Module = fasterrcnn_mobilenet_v3_large_fpn(weights=None, weights_backbone=None)
    load_pretrained(network, WEIGHTS, "find", "give left_box=[left,top,right,bottom]")
    network.eval()
    return network
