"""A model as two ONNX graphs: the encoder from a pair to its code, the decoder from code and points to logits.

A code is one tensor or a dataclass of them, nested; the graphs know the tensors alone, by their names. The number of
pairs and of points is free.
"""

import io
import logging
import warnings
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import torch
from torch import Tensor, nn
from torch.export import Dim

from stereo_occ.errors import UserError
from stereo_occ.models.base import OccupancyModel, StereoViews
from stereo_occ.models.pixel_stereo import PixelStereoModel
from stereo_occ.writing import write_whole

#: The first with grid_sample of volumes.
OPSET = 20

INPUTS = ("left", "right", "K", "camera_from_rig")


class Encoder(nn.Module):
    """``encode`` with tensors for dataclasses."""

    def __init__(self, model: OccupancyModel) -> None:
        super().__init__()
        self.model = model

    def forward(
        self, left_BCHW: Tensor, right_BCHW: Tensor, K_B233: Tensor, camera_from_rig_B244: Tensor
    ) -> tuple[Tensor, ...]:
        """The code's tensors, in the order of :func:`code_tensors`."""
        views = StereoViews(left_BCHW, right_BCHW, K_B233, camera_from_rig_B244)
        return tuple(tensor for _, tensor in code_tensors(self.model.encode(views)))


class Decoder(nn.Module):
    """``decode`` with tensors for dataclasses.

    Args:
        code: any code of the model's.
    """

    def __init__(self, model: OccupancyModel, code: Any) -> None:
        super().__init__()
        self.model = model
        self.template = code

    def forward(self, points_BN3: Tensor, *tensors: Tensor) -> Tensor:
        """Logits ``(B, N)``."""
        code = with_tensors(self.template, iter(tensors))
        if isinstance(
            self.model, PixelStereoModel
        ):  # decode divides the points, by a number that is free here
            return self.model.answer(code, points_BN3)
        return self.model.decode(code, points_BN3)


def code_tensors(code: Any, name: str = "code") -> Iterator[tuple[str, Tensor]]:
    """The tensors of a code with their names, in a fixed order; where it has None there is none."""
    if isinstance(code, Tensor):
        yield name, code
    elif code is not None:
        assert is_dataclass(code)
        for part in fields(code):
            yield from code_tensors(getattr(code, part.name), part.name)


def with_tensors(template: Any, tensors: Iterator[Tensor]) -> Any:
    """A code of the same structure with other tensors."""
    if isinstance(template, Tensor):
        return next(tensors)
    if template is None:
        return None
    return type(template)(
        **{part.name: with_tensors(getattr(template, part.name), tensors) for part in fields(template)}
    )


def export_onnx(model: OccupancyModel, side: int, prefix: Path) -> tuple[Path, Path]:
    """Write ``<prefix>_encoder.onnx`` and ``<prefix>_decoder.onnx``.

    Args:
        model: in eval mode.
        side: of the images, pixels.

    Raises:
        UserError: the extra onnx is not installed, or a file cannot be written.
    """
    paths = onnx_paths(prefix)
    two, three = (_example(side, pairs) for pairs in (2, 3))
    encoder = Encoder(model)
    with torch.no_grad():
        code = model.encode(StereoViews(*two))
        named, other = list(code_tensors(code)), encoder(*three)
    batch, points = Dim("batch", max=1024), Dim("points", max=2**22)
    axes = [_grown(tensor, more) for (_, tensor), more in zip(named, other, strict=True)]
    names = [name for name, _ in named]
    tensors = tuple(tensor for _, tensor in named)
    _write(encoder, two, [{0: batch}] * 4, INPUTS, names, paths[0])
    _write(
        Decoder(model, code),
        (torch.rand(2, 5, 3) - 0.5, *tensors),
        ({0: batch, 1: points}, tuple({axis: batch} for axis in axes)),
        ("points", *names),
        ["logits"],
        paths[1],
    )
    return paths


def onnx_paths(prefix: Path) -> tuple[Path, Path]:
    """Of the encoder and the decoder."""
    encoder, decoder = (prefix.with_name(f"{prefix.name}_{part}.onnx") for part in ("encoder", "decoder"))
    return encoder, decoder


def _example(side: int, pairs: int) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    images = torch.rand(2, pairs, 3, side, side, generator=torch.Generator().manual_seed(0))
    K_33 = torch.tensor([[side, 0, side / 2], [0, side, side / 2], [0, 0, 1.0]])
    camera_from_rig_44 = torch.diag(torch.tensor([1.0, -1, -1, 1]))
    camera_from_rig_44[2, 3] = 1.0
    return (
        images[0],
        images[1],
        K_33.expand(pairs, 2, 3, 3).contiguous(),
        camera_from_rig_44.expand(pairs, 2, 4, 4).contiguous(),
    )


def _grown(tensor: Tensor, more: Tensor) -> int:
    """The axis along which the pairs are."""
    (axis,) = (axis for axis, (a, b) in enumerate(zip(tensor.shape, more.shape, strict=True)) if a != b)
    return axis


def _write(
    graph: nn.Module, inputs: Any, shapes: Any, input_names: Any, output_names: list[str], path: Path
) -> None:
    try:
        with warnings.catch_warnings(), patch.object(torch.linalg, "inv", inverse_33):
            warnings.simplefilter("ignore")
            logging.getLogger("onnxscript").setLevel(logging.ERROR)
            traced = torch.export.export(graph.eval(), inputs, dynamic_shapes=shapes, strict=True)
            program = torch.onnx.export(
                traced,
                input_names=list(input_names),
                output_names=output_names,
                opset_version=OPSET,
                dynamo=True,
                verbose=False,
            )
    except ImportError as error:
        raise UserError("onnx=true: needs the extra onnx; pip install 'stereo-occ[onnx]'") from error
    assert program is not None
    content = io.BytesIO()
    program.save(content)  # type: ignore[arg-type]  # onnx writes to files as well
    write_whole(path, content.getvalue())


def inverse_33(A: Tensor) -> Tensor:
    """Of matrices ``(..., 3, 3)``, for which ONNX has no operator: cross products of the rows over the determinant."""
    first, second, third = A.unbind(dim=-2)
    columns = [_cross(second, third), _cross(third, first), _cross(first, second)]
    determinant = (first * columns[0]).sum(dim=-1)
    return torch.stack(columns, dim=-1) / determinant[..., None, None]


def _cross(a: Tensor, b: Tensor) -> Tensor:
    ax, ay, az = a.unbind(dim=-1)
    bx, by, bz = b.unbind(dim=-1)
    return torch.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], dim=-1)
