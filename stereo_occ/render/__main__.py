"""``python -m stereo_occ.render``: write the shards that a configuration asks for."""

import logging
from pathlib import Path

from omegaconf import DictConfig, OmegaConf

from stereo_occ.checks import check_rendering
from stereo_occ.cli import entry_point
from stereo_occ.config import RenderConfig
from stereo_occ.data.config import MeshFilesConfig
from stereo_occ.data.prepare import prepare
from stereo_occ.quality_report import write_quality_report
from stereo_occ.quiet import quiet_libraries

logger = logging.getLogger(__name__)


@entry_point("render", check_rendering)
def main(cfg: DictConfig) -> None:
    """Render what is missing and say where it is."""
    quiet_libraries()
    typed = OmegaConf.to_object(cfg)
    assert isinstance(typed, RenderConfig)
    prepared = prepare(typed, typed.progress, typed.subset)
    for file in prepared.skipped:
        logger.warning("left out %s: %s", file.path, file.reason)
    if isinstance(typed.data, MeshFilesConfig):
        write_quality_report(prepared.folder, prepared.records, Path(typed.data.root), typed.progress)
        logger.info("what became of each mesh: %s", prepared.folder / "quality.png")
    logger.info("%d objects in %s", len(prepared.paths), prepared.folder)


if __name__ == "__main__":
    main()
