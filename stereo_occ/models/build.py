"""From plain settings to a model. Names are looked up in the tables below; nothing is imported by name."""

import inspect
from collections.abc import Callable, Mapping
from difflib import get_close_matches
from functools import partial
from typing import Any, TypeVar

import torch
from torch import nn

from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import StereoRig
from stereo_occ.models.base import OccupancyModel
from stereo_occ.models.cost_volumes import (
    Concat,
    Correlation,
    CostVolume,
    Groupwise,
    PlaneSweep,
    calibrated,
    one_sided,
)
from stereo_occ.models.decoders import ONet
from stereo_occ.models.encoders import DilatedResNet, ImageEncoder, ResNet18
from stereo_occ.models.light import LightEncoder
from stereo_occ.models.mono import MonoModel
from stereo_occ.models.pixel_stereo import PixelStereoModel
from stereo_occ.models.plane_sweep import PlaneSweepStereoModel
from stereo_occ.models.stereo import StereoModel
from stereo_occ.models.timm_encoder import TimmEncoder

T = TypeVar("T")
Config = Mapping[str, Any]

ENCODERS: dict[str, type[ImageEncoder]] = {
    "dilated_resnet": DilatedResNet,
    "resnet18": ResNet18,
    "light": LightEncoder,
    "timm": TimmEncoder,
}
COST_VOLUMES: dict[str, Callable[..., CostVolume]] = {
    "correlation": Correlation,
    "correlation_signed": Correlation,
    "groupwise": Groupwise,
    "concat": Concat,
    "plane_sweep": PlaneSweep,
}
DECODERS: dict[str, Callable[..., ONet]] = {"onet": ONet}


def build_model(config: Config, rig: StereoRig, load_weights: bool = True) -> OccupancyModel:
    """The model that ``config``, a ``model`` node as a plain nested mapping, describes.

    Args:
        config: names and settings, complete.
        rig: cameras and image size the model is for.
        load_weights: fetch pretrained weights where the settings ask for them; False if a state dict follows.

    Raises:
        UserError: on unknown names, missing or unknown settings, parts that do not fit, or an image size that
            the encoder cannot take.
    """
    return channels_last(_lookup(MODELS, config, "model")(config, rig, load_weights))


def of_one_rig(config: Config) -> bool:
    """Whether the slices of the model's cost volume are the disparities that its rig can have."""
    volume = config.get("cost_volume") or {}
    constructor = COST_VOLUMES.get(volume.get("name", ""))
    takes_disparities = constructor is not None and "disparities" in _keywords(constructor)
    return takes_disparities and volume.get("disparities") is None


def channels_last(model: OccupancyModel) -> OccupancyModel:
    """Lay out the weights of 2D and 3D convolutions channels-last, which runs faster."""
    for module in model.modules():
        if isinstance(module, nn.Conv2d):
            module.to(memory_format=torch.channels_last)
        elif isinstance(module, nn.Conv3d):
            module.to(memory_format=torch.channels_last_3d)
    return model


def _stereo(config: Config, rig: StereoRig, load_weights: bool) -> StereoModel:
    _check_settings(
        config, {"feature_stride", "width", "code_size", "encoder", "cost_volume", "decoder"}, "model"
    )
    encoder = _encoder(config["encoder"], rig, config["feature_stride"], load_weights)
    volume_config = dict(config["cost_volume"])
    count = volume_config.pop("disparities", None)
    disparities = calibrated(rig, encoder.stride) if count is None else one_sided(count)
    cost_volume = _part(
        COST_VOLUMES, volume_config, "model.cost_volume", encoder.channels, disparities=disparities
    )
    decoder = _part(DECODERS, config["decoder"], "model.decoder", config["code_size"])
    return StereoModel(encoder, cost_volume, decoder, width=config["width"], code_size=config["code_size"])


def _mono(config: Config, rig: StereoRig, load_weights: bool) -> MonoModel:
    _check_settings(config, {"code_size", "encoder", "decoder"}, "model")
    encoder = _encoder(config["encoder"], rig, None, load_weights)
    decoder = _part(DECODERS, config["decoder"], "model.decoder", config["code_size"])
    return MonoModel(encoder, decoder, config["code_size"])


def _calibrated(
    model: type[PixelStereoModel], config: Config, rig: StereoRig, load_weights: bool
) -> PixelStereoModel:
    settings = _keywords(model)
    _check_settings(config, {"feature_stride", "encoder"} | settings, "model", _optional(model))
    encoder = _encoder(config["encoder"], rig, config["feature_stride"], load_weights)
    return model(encoder, **{name: config[name] for name in settings & config.keys()})


MODELS: dict[str, Callable[[Config, StereoRig, bool], OccupancyModel]] = {
    "stereo": _stereo,
    "mono": _mono,
    "pixel_stereo": partial(_calibrated, PixelStereoModel),
    "plane_sweep_stereo": partial(_calibrated, PlaneSweepStereoModel),
}


def _encoder(config: Config, rig: StereoRig, stride: int | None, load_weights: bool) -> ImageEncoder:
    given = {"stride": stride, "load_weights": load_weights}
    encoder = _part(ENCODERS, config, "model.encoder", **given)
    for camera in rig.cameras:
        if camera.width % encoder.image_multiple or camera.height % encoder.image_multiple:
            raise UserError(
                f"data.image_side: model.encoder={config['name']} takes multiples of "
                f"{encoder.image_multiple} pixels, got {camera.width} x {camera.height}"
            )
    return encoder


def _part(
    known: Mapping[str, Callable[..., T]], config: Config, key: str, *positional: Any, **given: Any
) -> T:
    """Construct the named part from its settings and, of what is ``given``, what it takes."""
    constructor = _lookup(known, config, key)
    keywords = _keywords(constructor)
    _check_settings(config, keywords - given.keys(), key)
    settings = {name: value for name, value in config.items() if name != "name"}
    return constructor(*positional, **settings, **{name: given[name] for name in keywords & given.keys()})


def _keywords(constructor: Callable[..., Any]) -> set[str]:
    parameters = inspect.signature(constructor).parameters.values()
    return {parameter.name for parameter in parameters if parameter.kind is parameter.KEYWORD_ONLY}


def _lookup(known: Mapping[str, T], config: Config, key: str) -> T:
    name = str(config.get("name"))
    if name not in known:
        near = get_close_matches(name, known, n=1)
        hint = f"; did you mean {near[0]}?" if near else "; docs/extend.md tells how to add one"
        raise UserError(f"{key}: unknown {name!r}; known are {', '.join(known)}{hint}")
    return known[name]


def _optional(constructor: Callable[..., Any]) -> set[str]:
    """Settings that came later than the first checkpoints, which lack them."""
    parameters = inspect.signature(constructor).parameters.values()
    return {parameter.name for parameter in parameters if parameter.default is not parameter.empty}


def _check_settings(
    config: Config, expected: set[str], key: str, optional: set[str] | frozenset[str] = frozenset()
) -> None:
    unknown, missing = config.keys() - expected - {"name"}, expected - config.keys() - optional
    if unknown or missing:
        problem = f"has no setting {min(unknown)}" if unknown else f"lacks the setting {min(missing)}"
        raise UserError(f"{key}={config['name']}: {problem}; it takes {', '.join(sorted(expected))}")
    for name, value in config.items():
        numbers = value if isinstance(value, list) else [value]
        if any(type(number) is int and number < 1 for number in numbers):
            raise UserError(f"{key}.{name}: must be at least 1, got {value}")
