"""What the cameras do to the light, in numbers."""

from dataclasses import fields, replace
from math import pi

import numpy as np
import pytest

from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import toed_in_rig
from stereo_occ.pictures import LOOK
from stereo_occ.render.appearance import GAMMA
from stereo_occ.render.sensor import SensorConfig, photograph
from stereo_occ.render.stereo import StereoImages

SIDE = 64
RIG = toed_in_rig(1.0, pi / 16, pi / 3, SIDE)


def grey(value=128):
    return StereoImages(
        np.full((2, SIDE, SIDE, 3), value, np.uint8),
        np.zeros((2, SIDE, SIDE), np.uint8),
        np.zeros((2, SIDE, SIDE), np.float32),
    )


def taken(images, masked=False, seed=0, **ranges):
    config = SensorConfig(**{name: [float(value)] * 2 for name, value in ranges.items()})
    return photograph(images, RIG, config, LOOK, masked, np.random.default_rng(seed))


def light(rgb):
    return (np.asarray(rgb, float) / 255) ** GAMMA


def test_ideal_cameras_change_nothing():
    images = replace(
        grey(), rgb_2HW3=np.random.default_rng(0).integers(256, size=(2, SIDE, SIDE, 3), dtype=np.uint8)
    )
    assert photograph(images, RIG, SensorConfig(), LOOK, False, np.random.default_rng(0)) is images.rgb_2HW3
    barely = taken(images, exposure=1e-9)
    assert np.abs(barely.astype(int) - images.rgb_2HW3).max() <= 1


def test_a_stop_doubles_the_light():
    assert light(taken(grey(), exposure=1)).mean() == pytest.approx(2 * light(128), rel=0.01)
    assert light(taken(grey(), exposure=-1)).mean() == pytest.approx(light(128) / 2, rel=0.02)


def test_exposure_differs_between_the_cameras():
    left, right = light(taken(grey(), exposure_difference=0.5)).mean(axis=(1, 2, 3))
    assert right / left == pytest.approx(2**0.5, rel=0.02)


def test_white_balance_moves_red_against_blue():
    red, green, blue = light(taken(grey(), white_balance=0.5))[0].mean(axis=(0, 1))
    assert red / blue == pytest.approx(2**0.5, rel=0.02)
    assert green == pytest.approx(light(128), rel=0.01)


def test_noise_has_the_spread_asked_for():
    read = light(taken(grey(), read_noise=0.02))
    assert read.std() == pytest.approx(0.02, rel=0.05)
    shot = light(taken(grey(), shot_noise=0.05))
    assert shot.std() == pytest.approx(0.05 * light(128) ** 0.5, rel=0.05)
    assert abs(np.corrcoef(read[0].ravel(), read[1].ravel())[0, 1]) < 0.05


def test_blur_spreads_a_point_and_keeps_its_light():
    images = grey(0)
    images.rgb_2HW3[:, 32, 32] = 255
    picture = light(taken(images, blur=1.5))[0, :, :, 0]
    rows = np.arange(SIDE) - 32
    assert picture.sum() == pytest.approx(1, rel=0.1)  # 8 bits
    variance = (picture.sum(axis=1) * rows**2).sum() / picture.sum()
    assert variance == pytest.approx(1.5**2, rel=0.15)


def test_motion_draws_a_line():
    images = grey(0)
    images.rgb_2HW3[:, 32, 32] = 255
    picture = light(taken(images, motion=6.0, seed=3))[0, :, :, 0]
    v, u = np.nonzero(picture > 0.02)
    assert 4 <= np.hypot(np.ptp(u), np.ptp(v)) <= 8
    assert picture.sum() == pytest.approx(1, rel=0.1)


def test_light_falls_off_with_the_fourth_power_of_the_cosine():
    picture = light(taken(grey(), vignetting=1))[0, :, :, 0] / light(128)
    angle = np.arctan(np.hypot(31.5, 31.5) / RIG.left.K[0, 0])
    assert picture[0, 0] == pytest.approx(np.cos(angle) ** 4, rel=0.03)
    assert picture[32, 32] == pytest.approx(1, rel=0.02)


def test_compression_keeps_the_picture():
    images = grey()
    images.rgb_2HW3[:] = (np.add.outer(np.arange(SIDE) ** 2, 50 * np.arange(SIDE)) // 30)[..., None]
    picture = taken(images, jpeg=40)
    assert picture.shape == images.rgb_2HW3.shape
    assert 0 < np.abs(picture.astype(int) - images.rgb_2HW3).mean() < 4


def test_the_mask_lays_the_object_over_the_background():
    images = grey(60)
    images.mask_2HW[:, :32] = 255
    images.mask_2HW[:, 32] = 51
    picture = taken(images, masked=True, read_noise=0.05)
    assert (picture[:, 33:] == LOOK.background_3).all()
    assert picture[:, :32].std() > 1
    assert picture[:, 32].mean() < 100


def test_the_same_generator_gives_the_same_picture():
    drawn = {"blur": 0.5, "read_noise": 0.01, "jpeg": 20}
    np.testing.assert_array_equal(taken(grey(), **drawn), taken(grey(), **drawn))


@pytest.mark.parametrize("name", [field.name for field in fields(SensorConfig)])
def test_wrong_ranges_are_refused_by_name(name):
    for wrong in ([1.0, 0.5], [1e3, 1e3]):
        config = SensorConfig(**{name: wrong})
        with pytest.raises(UserError, match=rf"sensor\.{name}"):
            photograph(grey(), RIG, config, LOOK, False, np.random.default_rng(0))
