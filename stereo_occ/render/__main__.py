"""``python -m stereo_occ.render``: write the shards that a configuration asks for."""

import logging

from omegaconf import DictConfig, OmegaConf

from stereo_occ.checks import check_pairs
from stereo_occ.cli import entry_point
from stereo_occ.config import RenderConfig
from stereo_occ.data.prepare import prepare
from stereo_occ.quiet import quiet_libraries

logger = logging.getLogger(__name__)


@entry_point("render", check_pairs)
def main(cfg: DictConfig) -> None:
    """Render what is missing and say where it is."""
    quiet_libraries()
    typed = OmegaConf.to_object(cfg)
    assert isinstance(typed, RenderConfig)
    prepared = prepare(typed, typed.progress)
    for file in prepared.skipped:
        logger.warning("skipped %s: %s", file.path, file.reason)
    logger.info("%d objects in %s", len(prepared.paths), prepared.folder)


if __name__ == "__main__":
    main()
