"""``python -m stereo_occ.export``: a run's weights as files of numbers alone, with a model card; ONNX on demand."""

import json
import logging
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf

from stereo_occ.checkpoint import KEY
from stereo_occ.cli import entry_point
from stereo_occ.errors import UserError
from stereo_occ.inference_config import ExportConfig
from stereo_occ.model_card import model_card, training_command
from stereo_occ.onnx_export import export_onnx
from stereo_occ.packaged import SUFFIX, write_description, write_weights
from stereo_occ.trained import load_trained, read_named, trained_model
from stereo_occ.writing import in_the_way, write_whole

logger = logging.getLogger(__name__)


def check_export(cfg: DictConfig) -> list[str]:
    """Problems of a configuration, its checkpoint unread."""
    if not Path(cfg.output).name or cfg.output.endswith((SUFFIX, ".json", ".md", ".onnx", "/")):
        return [f"output={cfg.output}: must be a path without a suffix, such as my_weights"]
    read = [(key, Path(cfg[key])) for key in ("checkpoint", "metrics") if cfg[key] is not None]
    return in_the_way(cfg.output, outputs(cfg.output), read, "weights")


def outputs(prefix: str) -> tuple[Path, Path, Path]:
    """Weights, description and card of ``OUTPUT``, which may hold dots: v1.2 is no suffix."""
    return Path(prefix + SUFFIX), Path(f"{prefix}.json"), Path(f"{prefix}.md")


def export(cfg: DictConfig) -> list[Path]:
    """Write ``OUTPUT.safetensors``, ``.json``, ``.md`` and, with ``onnx=true``, two ``.onnx`` files.

    Raises:
        UserError: the checkpoint or the metrics cannot be read, or a file cannot be written.
    """
    settings = OmegaConf.to_object(cfg)
    assert isinstance(settings, ExportConfig)
    checkpoint = read_named(settings.checkpoint)
    trained = trained_model(checkpoint, settings.checkpoint)
    again = "metrics" in checkpoint  # exported before: what lies beside them is not of their training
    run, prefix = None if again else Path(settings.checkpoint).parent, Path(settings.output)
    description = {
        "step": trained.step,
        "threshold": trained.decision.threshold,
        "metrics": _metrics(settings.metrics, checkpoint, run),
        "config": checkpoint[KEY]["config"],
    }
    if (objects := checkpoint[KEY].get("objects")) is not None:
        description["objects"] = objects
    weights, _, card = outputs(settings.output)
    state = checkpoint["state_dict"]
    state = {name: state[name] for name in state if name == "threshold" or name.startswith("model.")}
    write_weights(weights, description, state, settings.half)
    parameters = sum(parameter.numel() for parameter in trained.model.parameters())
    command = None if run is None else training_command(run)
    text = model_card(prefix.name, description, parameters, weights.stat().st_size, command)
    write_whole(card, text.encode())
    written = [weights, weights.with_suffix(".json"), card]
    if settings.onnx:
        model = load_trained(
            str(weights)
        ).model  # with the rounding of half precision, as the weights beside it
        graphs = export_onnx(model, trained.config.data.image_side, prefix)
        files = {path.name.removeprefix(prefix.name): path for path in (weights, *graphs)}
        write_description(weights.with_suffix(".json"), description, files)
        written += graphs
    return written


def _metrics(path: str | None, checkpoint: Mapping[str, Any], run: Path | None) -> dict[str, Any]:
    """Of an evaluation's ``metrics.json``; else of the checkpoint's validation, or what exported weights came with."""
    if path is not None:
        return _read(Path(path), lambda content: content["metrics"])
    if run is None:
        return checkpoint["metrics"] or {}
    file, step = run / "metrics.json", checkpoint["global_step"]
    if not file.is_file():
        return {}
    return _read(file, lambda content: next((e for e in content["history"] if e["step"] == step), {}))


def _read(file: Path, part: Callable[[Any], Mapping[str, Any]]) -> dict[str, Any]:
    try:
        return dict(part(json.loads(file.read_text(encoding="utf-8"))))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise UserError(f"metrics={file}: cannot be read; give the metrics.json of an evaluation") from error


@entry_point("export", check_export)
def main(cfg: DictConfig) -> None:
    """Export and say what was written."""
    for path in export(cfg):
        logger.info("%s (%.1f MB)", path, path.stat().st_size / 1e6)


if __name__ == "__main__":
    main()
