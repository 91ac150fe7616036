"""``python -m stereo_occ.inspect``: read and repair the meshes of a data set, and say what became of each."""

import logging
from collections import Counter
from pathlib import Path

from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, OmegaConf

from stereo_occ.checks.pairs import check_pairs
from stereo_occ.cli import entry_point
from stereo_occ.config import InspectConfig
from stereo_occ.data.config import MeshFilesConfig
from stereo_occ.data.objects import list_objects
from stereo_occ.errors import UserError
from stereo_occ.quality_report import write_quality_report
from stereo_occ.quiet import quiet_libraries
from stereo_occ.shapes.layouts import LAYOUT

logger = logging.getLogger(__name__)


@entry_point("inspect", check_pairs)
def main(cfg: DictConfig) -> None:
    """Write ``quality.csv`` and ``quality.png`` into Hydra's run folder."""
    quiet_libraries()
    pairs = OmegaConf.to_object(cfg)
    assert isinstance(pairs, InspectConfig)
    if not isinstance(pairs.data, MeshFilesConfig):
        raise UserError(f"data={pairs.data.name}: has no mesh files; say data=meshes or data=shapenet")
    objects = list_objects(pairs, pairs.progress)
    for file in objects.skipped:
        logger.warning("left out %s: %s", file.path, file.reason)
    if not objects.records:
        raise UserError(
            f"data.root={pairs.data.root}: holds no mesh of {', '.join(pairs.categories.names)}; lay it out as {LAYOUT}"
        )
    folder = Path(HydraConfig.get().runtime.output_dir)
    write_quality_report(folder, objects.records, Path(pairs.data.root), pairs.progress)
    for status, count in Counter(record.outcome.status for record in objects.records).items():
        logger.info("%d %s", count, status)
    logger.info("what became of each mesh: %s and quality.csv", folder / "quality.png")


if __name__ == "__main__":
    main()
