"""Appearances are drawn from their ranges, and wrong ranges are refused."""

import numpy as np
import pytest
from omegaconf import OmegaConf

from stereo_occ.cli import compose_config
from stereo_occ.errors import UserError
from stereo_occ.render.appearance import GAMMA, MAX_LIGHTS, draw_appearance


def appearance_configs(*overrides):
    cfg = OmegaConf.to_object(compose_config("render", list(overrides)))
    return cfg.lights, cfg.material, cfg.background


def test_same_generator_state_gives_the_same_appearance():
    configs = appearance_configs("lights=random", "material=varied", "background=uniform")
    first, second = (draw_appearance(*configs, np.random.default_rng(3)) for _ in range(2))
    for name, value in vars(first).items():
        np.testing.assert_array_equal(value, getattr(second, name))


def test_lights_are_unit_vectors_and_at_most_what_the_shader_takes():
    configs = appearance_configs("lights=random")
    for seed in range(50):
        drawn = draw_appearance(*configs, np.random.default_rng(seed))
        assert 1 <= len(drawn.light_from_L3) <= MAX_LIGHTS
        np.testing.assert_allclose(np.linalg.norm(drawn.light_from_L3, axis=1), 1)


def test_azimuth_and_elevation_mean_what_they_say():
    lights, material, background = appearance_configs()
    lights.count = [1, 1]
    source = next(iter(lights.sources.values()))
    for azimuth, elevation, direction in ((0, 0, [0, 0, 1]), (90, 0, [1, 0, 0]), (0, 90, [0, 1, 0])):
        source.azimuth_deg, source.elevation_deg = [azimuth, azimuth], [elevation, elevation]
        drawn = draw_appearance(lights, material, background, np.random.default_rng(0))
        np.testing.assert_allclose(drawn.light_from_L3[0], direction, atol=1e-12)


def test_the_papers_setting_is_fixed_light_on_white():
    drawn = [draw_appearance(*appearance_configs(), np.random.default_rng(seed)) for seed in range(5)]
    for other in drawn[1:]:
        np.testing.assert_array_equal(other.light_from_L3, drawn[0].light_from_L3)
        assert (other.background_3 == 255).all()


@pytest.mark.parametrize("material", ["plain", "varied"])
@pytest.mark.parametrize("background", ["white", "uniform"])
def test_object_and_background_differ(material, background):
    configs = appearance_configs(f"material={material}", f"background={background}")
    for seed in range(100):
        drawn = draw_appearance(*configs, np.random.default_rng(seed))
        distance = np.linalg.norm(drawn.background_3 / 255 - drawn.base_color_3 ** (1 / GAMMA))
        assert distance > 0.15


@pytest.mark.parametrize(
    ("key", "value"),
    [("hue", [0.5, 0.2]), ("saturation", [-0.1, 0.5]), ("value", [0.2]), ("roughness", [0, 2])],
)
def test_wrong_ranges_are_refused_by_name(key, value):
    lights, material, background = appearance_configs()
    setattr(material, key, value)
    with pytest.raises(UserError, match=f"material.{key}"):
        draw_appearance(lights, material, background, np.random.default_rng(0))
