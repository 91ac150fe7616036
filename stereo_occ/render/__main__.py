"""``python -m stereo_occ.render``: write the shards that a configuration asks for, or check them."""

import logging
import sys
from pathlib import Path

from omegaconf import DictConfig, OmegaConf

from stereo_occ.checks.pairs import check_rendering
from stereo_occ.cli import entry_point
from stereo_occ.config import RenderConfig
from stereo_occ.data.config import MeshFilesConfig
from stereo_occ.data.prepare import locate, prepare
from stereo_occ.data.verify import verify
from stereo_occ.quality_report import write_quality_report
from stereo_occ.quiet import quiet_libraries

logger = logging.getLogger(__name__)


@entry_point("render", check_rendering)
def main(cfg: DictConfig) -> None:
    """Render what is missing and say where it is."""
    quiet_libraries()
    typed = OmegaConf.to_object(cfg)
    assert isinstance(typed, RenderConfig)
    if typed.verify:
        _verify(typed)
        return
    prepared = prepare(typed, typed.progress, typed.subset, typed.slice)
    for file in prepared.skipped:
        logger.warning("left out %s: %s", file.path, file.reason)
    if isinstance(typed.data, MeshFilesConfig) and typed.slice.index == 1:
        write_quality_report(prepared.folder, prepared.records, Path(typed.data.root), typed.progress)
        logger.info("what became of each mesh: %s", prepared.folder / "quality.png")
    logger.info("%d objects in %s", len(prepared.paths), prepared.folder)


def _verify(cfg: RenderConfig) -> None:
    """Say which shards are not as they were written; exit with code 1 if there are any."""
    located = locate(cfg, cfg.progress, cfg.subset, cfg.slice)
    result = verify(located.paths, cfg.progress)
    for path, damage in result.damaged.items():
        sys.stderr.write(f"damaged {path}: {damage}\n")
    for path in result.missing:
        sys.stderr.write(f"missing {path}\n")
    if result.unchecked:
        logger.info("%d shards have no checksum; all in them was read instead", len(result.unchecked))
    if not result.well:
        remedy = "delete the damaged files and render again" if result.damaged else "render again"
        sys.stderr.write(
            f"stereo_occ: of {len(located.paths)} shards {len(result.damaged)} are damaged and {len(result.missing)} "
            f"missing; {remedy}: the same command without verify=true\n"
        )
        raise SystemExit(1)
    logger.info("all %d shards in %s are as they were written", len(located.paths), located.folder)


if __name__ == "__main__":
    main()
