"""The configuration of a training as its checkpoint holds it."""

from typing import Any

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from stereo_occ.config import TrainConfig
from stereo_occ.data.config import DATA_SCHEMAS
from stereo_occ.data.rigs import RIG_SCHEMAS, ToedInRigConfig
from stereo_occ.errors import UserError


def training_config(values: Any) -> DictConfig:
    """The typed training configuration of plain values, as a checkpoint holds them.

    Raises:
        UserError: a key is unknown, a value has the wrong type, or one refers to something outside, such as a variable
            of the environment.
    """
    if _refers(values):
        raise UserError("configuration: holds ${...}, which no training writes; use another checkpoint")
    try:
        kinds = {
            "data": OmegaConf.structured(DATA_SCHEMAS[values["data"]["name"]]),
            "rig": OmegaConf.structured(RIG_SCHEMAS[values["rig"].get("kind", ToedInRigConfig.kind)]),
        }
        cfg = OmegaConf.merge(OmegaConf.structured(TrainConfig), kinds, values)
    except (KeyError, TypeError, AttributeError, ValueError, OmegaConfBaseException) as error:
        reason = " ".join(str(error).split("\n")[:1]) or type(error).__name__
        raise UserError(f"configuration: {reason}; it was written by another version") from error
    assert isinstance(cfg, DictConfig)
    return cfg


def _refers(value: Any) -> bool:
    """Whether plain nested values hold what OmegaConf would look up elsewhere."""
    if isinstance(value, dict):
        return any(_refers(part) for part in (*value, *value.values()))
    if isinstance(value, list | tuple):
        return any(map(_refers, value))
    return isinstance(value, str) and "${" in value
