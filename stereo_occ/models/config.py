"""Schemas of the models: every setting, its type and its meaning. The values are in ``conf/model/``."""

from dataclasses import dataclass

from hydra.core.config_store import ConfigStore
from omegaconf import MISSING


@dataclass
class EncoderConfig:
    """An image encoder."""

    name: str = MISSING


@dataclass
class DilatedResNetConfig(EncoderConfig):
    """Dilated ResNet with three stages at strides 4, 8 and 16."""

    name: str = "dilated_resnet"
    channels: int = MISSING  # of the features merged back to stride 4
    widths: list[int] = MISSING  # channels of each stage
    blocks: list[int] = MISSING  # residual blocks of each stage
    dilations: list[int] = MISSING  # of the last stage's blocks, repeated


@dataclass
class ResNet18Config(EncoderConfig):
    """torchvision's ResNet-18."""

    name: str = "resnet18"
    weights: str | None = MISSING  # IMAGENET1K_V1, or null to start from scratch


@dataclass
class LightConfig(EncoderConfig):
    """Small residual U-Net."""

    name: str = "light"
    channels: int = MISSING  # of the merged features
    widths: list[int] = MISSING  # channels of the stages at strides 2, 4, 8, ...
    blocks: list[int] = MISSING  # residual blocks of each stage


@dataclass
class TimmConfig(EncoderConfig):
    """A backbone of the timm package."""

    name: str = "timm"
    channels: int = MISSING  # of the merged features
    backbone: str = MISSING  # name in timm.list_models()
    pretrained: bool = MISSING  # start from timm's weights


@dataclass
class CostVolumeConfig:
    """A cost volume."""

    name: str = MISSING


@dataclass
class CorrelationConfig(CostVolumeConfig):
    """Channel-wise products."""

    name: str = "correlation"
    disparities: int | None = (
        MISSING  # feature cells 0 .. disparities - 1; null: what the rig's calibration allows
    )


@dataclass
class SignedCorrelationConfig(CostVolumeConfig):
    """Channel-wise products over the disparities that the rig's calibration allows."""

    name: str = "correlation_signed"


@dataclass
class GroupwiseConfig(CostVolumeConfig):
    """Products averaged over groups of channels."""

    name: str = "groupwise"
    disparities: int | None = MISSING  # as for correlation
    groups: int = MISSING


@dataclass
class ConcatConfig(CostVolumeConfig):
    """Left features beside shifted right features."""

    name: str = "concat"
    disparities: int | None = MISSING  # as for correlation


@dataclass
class PlaneSweepConfig(CostVolumeConfig):
    """Channel-wise products on planes of depth, with the cameras given."""

    name: str = "plane_sweep"
    planes: int = MISSING


@dataclass
class DecoderConfig:
    """An occupancy decoder."""

    name: str = MISSING


@dataclass
class ONetConfig(DecoderConfig):
    """Residual blocks with conditional batch norm."""

    name: str = "onet"
    hidden: int = MISSING
    blocks: int = MISSING


@dataclass
class StereoConfig:
    """Cost volume of both images."""

    name: str = "stereo"
    feature_stride: int = MISSING  # of the matched features, in image pixels
    width: int = (
        MISSING  # channels at the end of the 2D blocks that summarise the cost volume; they begin with 4 x
    )
    code_size: int = MISSING
    encoder: EncoderConfig = MISSING
    cost_volume: CostVolumeConfig = MISSING
    decoder: DecoderConfig = MISSING


@dataclass
class MonoConfig:
    """Left image only."""

    name: str = "mono"
    code_size: int = MISSING
    encoder: EncoderConfig = MISSING
    decoder: DecoderConfig = MISSING


@dataclass
class PixelStereoConfig:
    """Every query point looked up in both images with the cameras given."""

    name: str = "pixel_stereo"
    feature_stride: int = MISSING  # of the sampled features, in image pixels
    views: str = MISSING  # both; left: that view alone with the same parameters, for comparison
    groups: int = MISSING  # of channels, for the correlation
    frequencies: int = MISSING  # of the positional encoding
    code_size: int = MISSING  # of the code for the whole pair
    hidden: int = MISSING  # channels of the decoder
    blocks: int = MISSING  # residual blocks of the decoder
    encoder: EncoderConfig = MISSING


@dataclass
class PlaneSweepStereoConfig(PixelStereoConfig):
    """The same, with a volume over the cube completed by a 3D U-Net."""

    name: str = "plane_sweep_stereo"
    grid: int = MISSING  # cells per side of the volume
    around: str = "cube"  # or object: a coarse volume finds the object, and the grid lies around it
    widths: list[int] = MISSING  # channels of the U-Net's levels, the finest first
    surface_channels: int | None = None  # that tell points how far behind the seen surface they are


SCHEMAS: dict[str, tuple[type, ...]] = {
    "model": (StereoConfig, MonoConfig, PixelStereoConfig, PlaneSweepStereoConfig),
    "model/encoder": (DilatedResNetConfig, ResNet18Config, LightConfig, TimmConfig),
    "model/cost_volume": (
        CorrelationConfig,
        SignedCorrelationConfig,
        GroupwiseConfig,
        ConcatConfig,
        PlaneSweepConfig,
    ),
    "model/decoder": (ONetConfig,),
}


def register_schemas(store: ConfigStore) -> None:
    """Store each schema as ``base_<name>`` in its group; the YAML file of that name lists it first."""
    for group, schemas in SCHEMAS.items():
        for schema in schemas:
            store.store(group=group, name=f"base_{schema().name}", node=schema)
