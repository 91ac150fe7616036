"""Groups of variations compose, and none changes what another one draws."""

import numpy as np
import pytest
from omegaconf import OmegaConf

from stereo_occ.cli import compose_config
from stereo_occ.data import prepare
from stereo_occ.data.pairs import render_views
from stereo_occ.render.stereo import StereoRenderer
from stereo_occ.shapes.procedural import procedural_shape


def pairs_of(*overrides):
    return OmegaConf.to_object(compose_config("render", ["data.image_side=32", "data.views=3", *overrides]))


@pytest.fixture(scope="module")
def views(egl):
    renderer, shape = StereoRenderer(), procedural_shape("mug", 0, 3)
    return lambda *overrides: render_views(shape, pairs_of(*overrides), [0, 1], renderer)


@pytest.mark.parametrize(
    "change",
    ["texture=procedural", "background=clutter", "background=masked", "sensor=noisy", "lights=random"],
)
def test_looks_leave_geometry_alone(views, change):
    plain, changed = views("placement=free"), views("placement=free", change)
    np.testing.assert_array_equal(plain.rig_from_object, changed.rig_from_object)
    assert (plain.mask == changed.mask).mean() > 0.999


def test_a_variation_does_not_change_what_another_one_draws(views):
    """With the sensor's noise alone on top, the object's own pixels differ by little."""
    both = views("texture=procedural", "background=clutter")
    for more in ("sensor.read_noise=[0.002,0.002]", "background.clutter.gap=[0.5,2]"):
        other = views("texture=procedural", "background=clutter", more)
        inside = both.mask == 255
        assert np.abs(both.rgb.astype(int) - other.rgb)[inside].mean() < 4
    textured = views("texture=procedural")
    assert np.abs(both.rgb.astype(int) - textured.rgb)[both.mask == 255].max() <= 2


def test_masked_pictures_are_the_papers(views):
    np.testing.assert_array_equal(views("background=masked").rgb, views().rgb)
    np.testing.assert_array_equal(views("background=clutter", "background.masked=1").rgb[0, :, 0, 0], 255)


def test_a_share_of_the_pairs_is_masked(views):
    cluttered, some, masked = (
        views("background=clutter", f"background.masked={share}", "data.views=8").rgb for share in (0, 0.5, 1)
    )
    like_cluttered = (some == cluttered).all(axis=(1, 2, 3, 4))
    like_masked = (some == masked).all(axis=(1, 2, 3, 4))
    assert (like_cluttered ^ like_masked).all()
    assert like_cluttered.any()
    assert like_masked.any()


def test_everything_composes(views):
    drawn = views(
        "rig=rectified", "placement=free", "texture=procedural", "background=clutter", "sensor=noisy",
        "material=glossy", "lights=random",
    )  # fmt: skip
    assert drawn.unit is not None
    assert ((drawn.unit > 0.05) & (drawn.unit < 0.6)).all()
    assert (drawn.mask.reshape(6, -1).max(axis=1) == 255).all()
    assert drawn.rgb.reshape(6, -1).std(axis=1).min() > 5


def test_the_papers_rig_has_no_units(views):
    assert views().unit is None


@pytest.mark.parametrize(
    ("scale", "name"), [("smoke", "8e1a6bf3a4"), ("laptop", "ddadf4f320"), ("paper", "aec06de6aa")]
)
def test_data_sets_of_the_papers_setting_keep_their_names(scale, name):
    pairs = OmegaConf.to_object(compose_config("render", [f"scale={scale}"]))
    assert prepare._folder_name(pairs).endswith(f"px_{name}")


def test_the_data_set_of_the_shipped_weights_keeps_its_name():
    pairs = OmegaConf.to_object(compose_config("train", ["experiment=field"]))
    assert prepare._folder_name(pairs) == "procedural_96px_dfc10a9d17"


def test_every_variation_has_a_data_set_of_its_own():
    changes = [
        "texture=own", "texture=procedural", "sensor=noisy", "sensor.blur=[0,1]", "background=clutter",
        "background=masked", "material=glossy", "rig=randomised", "rig=rectified", "placement=table", "placement=free",
    ]  # fmt: skip
    names = {prepare._folder_name(pairs_of(change)) for change in changes} | {
        prepare._folder_name(pairs_of())
    }
    assert len(names) == len(changes) + 1
