"""Finding an object in a photograph with torchvision's detector, whose weights no test fetches."""

import numpy as np
import pytest
import torch
from torchvision.models.detection import fasterrcnn_mobilenet_v3_large_fpn

from stereo_occ.errors import UserError
from stereo_occ.inference_config import Findable
from stereo_occ.photographs import detect
from stereo_occ.photographs.photo import Photo

PHOTO = Photo(np.random.default_rng(0).integers(256, size=(60, 80, 3), dtype=np.uint8))
PHOTO.rgb_HW3.flags.writeable = False  # as Pillow gives them
FILE = "fasterrcnn_mobilenet_v3_large_fpn-fb6a3cc7.pth"


@pytest.fixture(autouse=True)
def no_detector_of_before():
    detect._detector.cache_clear()
    yield
    detect._detector.cache_clear()


def seen(monkeypatch, *found):
    """What the detector says: box, COCO's name, score."""
    categories = detect.WEIGHTS.meta["categories"]
    boxes, names, scores = zip(*found, strict=True) if found else ((), (), ())
    said = (
        torch.tensor(boxes).reshape(-1, 4),
        torch.tensor([categories.index(name) for name in names]),
        torch.tensor(scores),
    )
    monkeypatch.setattr(detect, "detections", lambda photo: said)


def test_the_likeliest_of_the_kind_is_taken_and_pixels_have_their_middle_at_whole_numbers(monkeypatch):
    seen(
        monkeypatch,
        ([0.0, 0, 9, 9], "bottle", 0.99),
        ([10.0, 20, 30, 40], "cup", 0.8),
        ([50.0, 20, 70, 40], "cup", 0.6),
    )
    found = detect.detected(PHOTO, "mug", "left")
    assert vars(found.box) == {"left": 9.5, "top": 19.5, "right": 29.5, "bottom": 39.5}
    assert found.how == "detected with 0.80"


@pytest.mark.parametrize("found", [[], [([1.0, 2, 3, 4], "bottle", 0.9)], [([1.0, 2, 3, 4], "bowl", 0.4)]])
def test_none_or_an_unlikely_one_asks_for_a_box(monkeypatch, found):
    seen(monkeypatch, *found)
    with pytest.raises(UserError, match=r"find=bowl: none is found in the left image; give left_box="):
        detect.detected(PHOTO, "bowl", "left")


def test_a_detector_that_is_not_there_names_the_file_and_the_way_out(torch_cache):
    with pytest.raises(
        UserError, match=r"^find: .* cannot be fetched .*put the file there, or give left_box="
    ) as raised:
        detect.detected(PHOTO, "mug", "left")
    assert str(torch_cache / FILE) in str(raised.value)
    assert "\n" not in str(raised.value)


def test_the_network_gets_the_photograph_in_0_to_1(monkeypatch):
    given = []

    def network(images):
        given.extend(images)
        return [
            {
                "boxes": torch.tensor([[1.0, 2, 3, 4]]),
                "labels": torch.tensor([47]),
                "scores": torch.tensor([0.7]),
            }
        ]

    monkeypatch.setattr(detect, "_detector", lambda: network)
    assert vars(detect.detected(PHOTO, "mug", "left").box) == {
        "left": 0.5,
        "top": 1.5,
        "right": 2.5,
        "bottom": 3.5,
    }
    np.testing.assert_allclose(given[0].permute(1, 2, 0), PHOTO.rgb_HW3 / 255, atol=1e-6)


def test_weights_in_torchs_cache_are_read(torch_cache):
    """As they are published: frozen norms have no number of batches."""
    network = fasterrcnn_mobilenet_v3_large_fpn(weights=None, weights_backbone=None)
    state = {name: value for name, value in network.state_dict().items() if "num_batches_tracked" not in name}
    torch.save(state, torch_cache / FILE)
    boxes_N4, labels_N, scores_N = detect.detections(PHOTO)
    assert boxes_N4.shape == (len(labels_N), 4)
    assert scores_N.shape == labels_N.shape


@pytest.mark.parametrize("content", [b"", b"<html>\nlog in</html>", b"PK\x03\x04junk", None])
def test_other_files_in_torchs_cache_are_named(torch_cache, content):
    if content is None:
        torch.save({"other": torch.zeros(1)}, torch_cache / FILE)
    else:
        (torch_cache / FILE).write_bytes(content)
    with pytest.raises(
        UserError, match=f"^find: .*{FILE} does not hold .*; delete it, or give left_box="
    ) as raised:
        detect.detected(PHOTO, "mug", "left")
    assert "\n" not in str(raised.value)


def test_what_can_be_found_is_what_the_command_offers():
    assert [choice.value for choice in Findable] == list(detect.NAMES)
    with pytest.raises(UserError, match="find=cup: must be one of mug, bowl, bottle"):
        detect.detected(PHOTO, "cup", "left")
