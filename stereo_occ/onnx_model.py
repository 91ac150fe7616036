"""Answers of an exported model through ONNX Runtime."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from omegaconf import OmegaConf

from stereo_occ.config import TrainConfig
from stereo_occ.decision import Decision
from stereo_occ.errors import UserError
from stereo_occ.models.base import POINTS_IN_CACHE, StereoViews
from stereo_occ.onnx_export import INPUTS, onnx_paths
from stereo_occ.packaged import checked_content, find_weights, read_description
from stereo_occ.reconstruction import Occupancy
from stereo_occ.saved_config import training_config


@dataclass(frozen=True, eq=False)
class OnnxModel:
    """Two sessions with what they need to know of the training; as :class:`~stereo_occ.trained.TrainedModel`."""

    encoder: Any
    decoder: Any
    config: TrainConfig
    decision: Decision
    name: str

    def predict(self, views: StereoViews) -> Occupancy:
        """What the model says of one pair (``B = 1``)."""
        given = (views.left_BCHW, views.right_BCHW, views.K_B233, views.camera_from_rig_B244)
        code = run(self.encoder, {name: tensor.numpy() for name, tensor in zip(INPUTS, given, strict=True)})

        def logits(points_N3: NDArray[np.float32]) -> NDArray[np.float32]:
            pieces = [
                run(self.decoder, {"points": points_N3[None, start : start + POINTS_IN_CACHE], **code})
                for start in range(0, len(points_N3), POINTS_IN_CACHE)
            ]
            return np.concatenate([piece["logits"][0] for piece in pieces])

        return logits


def load_onnx(name: str, threads: int | None = None) -> OnnxModel:
    """What ``python -m stereo_occ.export onnx=true`` wrote, by its ``output=`` or the name of shipped weights.

    Args:
        threads: of ONNX Runtime; None: its own choice.

    Raises:
        UserError: the extra onnx is not installed, or files are missing or damaged.
    """
    try:
        import onnxruntime
    except ImportError as error:
        raise UserError("backend=onnx: needs the extra onnx; pip install 'stereo-occ[onnx]'") from error
    found = find_weights(name)
    prefix = Path(name) if found is None else found.with_suffix("")
    paths = onnx_paths(prefix)
    for path in paths:
        if not path.is_file():
            raise UserError(
                f"checkpoint={name}: backend=onnx needs {path}; write it with python -m stereo_occ.export "
                f"checkpoint=... output={prefix} onnx=true"
            )
    description_path = prefix.with_name(f"{prefix.name}.json")
    description = read_description(description_path, description_path)
    options = onnxruntime.SessionOptions()
    if threads:
        options.intra_op_num_threads = threads
    try:
        encoder, decoder = (
            onnxruntime.InferenceSession(
                checked_content(path, path.name.removeprefix(prefix.name), description),
                options,
                providers=["CPUExecutionProvider"],
            )
            for path in paths
        )
        typed = OmegaConf.to_object(training_config(description["config"]))
        threshold = float(description["threshold"])
    except (
        ValueError,
        KeyError,
        TypeError,
        RuntimeError,
        onnxruntime.capi.onnxruntime_pybind11_state.Fail,
    ) as error:
        raise UserError(f"checkpoint={name}: its files are damaged; export it again") from error
    assert isinstance(typed, TrainConfig)
    return OnnxModel(encoder, decoder, typed, Decision(threshold, typed.validation.decision), name)


def run(session: Any, arrays: dict[str, NDArray[np.float32]]) -> dict[str, NDArray[np.float32]]:
    """Outputs by name; inputs that the graph does not use may be given."""
    names = [output.name for output in session.get_outputs()]
    used = {entry.name for entry in session.get_inputs()}
    values = session.run(names, {name: array for name, array in arrays.items() if name in used})
    return dict(zip(names, values, strict=True))
