"""What makes an evaluated model: seeds of one model have the same settings."""

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

from stereo_occ.checkpoint import plain
from stereo_occ.errors import UserError
from stereo_occ.flat import flat
from stereo_occ.saved_config import training_config

Settings = dict[str, Any]

#: Settings of a training that do not make another model, by the start of their dotted name.
SAME_MODEL = (
    "seed",
    "paths.",
    "workers",
    "progress",
    "resume",
    "logger.",
    "trainer.accelerator",
    "trainer.devices",
    "trainer.nodes",
    "trainer.threads",
    "trainer.workers",
    "validation.checkpoint_interval",
    "validation.keep_all",
    "scale.",  # only fills in others
)


def model_settings(facts: Mapping[str, Any]) -> Settings:
    """What makes an evaluated model, by dotted key; seeds of one model have the same."""
    predictor, trained = facts.get("predictor") or {}, facts.get("trained")
    if "baseline" in predictor:
        return flat(predictor["baseline"], "baseline.")
    control = flat(facts.get("control") or {"name": "none", "degrees": 0.0}, "control.")
    if trained is None:
        return {"parameters": facts.get("parameters"), "step": facts.get("step")} | control
    config = trained["config"]
    with suppress(UserError):
        config = plain(training_config(config))  # with the values that newer keys have by default
    settings = {key: value for key, value in flat(config).items() if not key.startswith(SAME_MODEL)}
    under = {key: settings.pop(key) for key in list(settings) if key.startswith("control.")}
    trained_under = {} if under == control else {f"trained_under_{key}": under[key] for key in under}
    return settings | control | trained_under
