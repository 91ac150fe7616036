"""``python -m stereo_occ.reconstruct``: a mesh in metres from one's own calibrated pair."""

import io
import json
import logging
from pathlib import Path

import torch
from omegaconf import DictConfig, ListConfig, OmegaConf
from PIL import Image

from stereo_occ import __version__
from stereo_occ.cli import entry_point
from stereo_occ.cores import beyond_cores
from stereo_occ.inference_config import Frame, ReconstructConfig
from stereo_occ.mesh_output import FORMATS, write_mesh
from stereo_occ.quiet import quiet_libraries
from stereo_occ.reconstructor import Reconstruction, Reconstructor, SurfaceOptions
from stereo_occ.writing import in_the_way, write_whole

logger = logging.getLogger(__name__)


def check_reconstruction(cfg: DictConfig) -> list[str]:
    """Problems of a configuration, its files unread."""
    given = [(key, cfg[key]) for key in ("left", "right", "left_mask", "right_mask") if cfg[key] is not None]
    given += [("rig", path) for path in calibration_files(cfg)]
    problems = [f"{key}={path}: no such file" for key, path in given if not Path(path).is_file()]
    if not problems:
        problems = in_the_way(cfg.output, outputs(cfg), [(key, Path(path)) for key, path in given])
    if Path(cfg.output).suffix.lower() not in FORMATS:
        problems.append(f"output={cfg.output}: must end in one of {', '.join(FORMATS)}")
    if cfg.threshold is not None and not 0 < cfg.threshold < 1:
        problems.append(f"threshold={cfg.threshold}: must be a probability above 0 and below 1")
    if not 8 <= cfg.resolution <= 512:
        problems.append(f"resolution={cfg.resolution}: must be 8 to 512 cells")
    if not 0 <= cfg.steps <= 20:
        problems.append(f"steps={cfg.steps}: must be 0 to 20")
    if cfg.simplify is not None and not 0 < cfg.simplify < 1:
        problems.append(f"simplify={cfg.simplify}: must be metres above 0, such as 0.0005")
    if cfg.threads is not None:
        problems += beyond_cores("threads", cfg.threads)
        if cfg.threads < 1:
            problems.append(f"threads={cfg.threads}: must be at least 1")
    return problems


def outputs(cfg: DictConfig) -> list[Path]:
    """The files that come out, first the mesh."""
    mesh = Path(cfg.output)
    return [mesh, mesh.with_suffix(".json"), *([preview_path(mesh)] if cfg.preview else [])]


def calibration_files(cfg: DictConfig) -> list[str]:
    """Of ``rig=``, one or several."""
    given = cfg.calibration
    return [str(path) for path in given] if isinstance(given, ListConfig) else [str(given)]


def reconstruct_pair(cfg: DictConfig) -> Reconstruction:
    """Reconstruct and write the mesh, its JSON file and the preview.

    Raises:
        UserError: for anything that the user can put right; nothing is written then.
    """
    quiet_libraries()
    settings = OmegaConf.to_object(cfg)
    assert isinstance(settings, ReconstructConfig)
    if settings.threads:
        torch.set_num_threads(settings.threads)
    reconstructor = Reconstructor.from_checkpoint(
        settings.checkpoint, settings.backend.value, settings.threads
    )
    result = reconstructor(
        settings.left,
        settings.right,
        calibration_files(cfg),
        boxes=(settings.left_box, settings.right_box),
        masks=(settings.left_mask, settings.right_mask),
        find=settings.find and settings.find.value,
        center=settings.center,
        size=settings.size,
        unit=settings.unit,
        rectified=settings.rectified,
        mirror=settings.mirror,
        surface=SurfaceOptions(
            settings.threshold, settings.resolution, settings.steps, settings.simplify, settings.color
        ),
    )
    write_result(result, settings)
    return result


def write_result(result: Reconstruction, settings: ReconstructConfig) -> None:
    """The preview and the JSON file first, so that a mesh that is there has both beside it."""
    output = Path(settings.output)
    if settings.preview:
        png = io.BytesIO()
        Image.fromarray(result.preview()).save(png, "PNG")
        write_whole(preview_path(output), png.getvalue())
    mesh = result.mesh if settings.frame is Frame.left else result.mesh_in_rig()
    description = {
        "stereo_occ": __version__,
        "checkpoint": settings.checkpoint,
        "frame": settings.frame.value,
        **result.description(mesh),
    }
    write_whole(output.with_suffix(".json"), (json.dumps(description, indent=2) + "\n").encode())
    write_mesh(mesh, output)


def preview_path(output: Path) -> Path:
    """Where the preview of a mesh goes."""
    return output.with_name(f"{output.stem}_preview.png")


@entry_point("reconstruct", check_reconstruction, aliases={"rig": "calibration"})
def main(cfg: DictConfig) -> None:
    """Reconstruct and print what came out."""
    result = reconstruct_pair(cfg)
    x, y, z = result.mesh.bounds.mean(axis=0)
    logger.info(
        "%s: %.0f cm3, centre %.3f right, %.3f down, %.3f m forward of the left camera, confidence %.2f",
        cfg.output, 1e6 * result.mesh.volume, x, y, z, result.confidence,
    )  # fmt: skip
    for doubt in result.doubts:
        logger.warning("%s", doubt)
    logger.info("seconds: %s", ", ".join(f"{name} {value:.2f}" for name, value in result.seconds.items()))


if __name__ == "__main__":
    main()
