"""``python -m stereo_occ.report runs=[DIR,...] output=report.html``: one page about several evaluations."""

import logging
from pathlib import Path

from omegaconf import DictConfig, ListConfig, OmegaConf

from stereo_occ.cli import entry_point
from stereo_occ.compare import MOST_DRAWS
from stereo_occ.quiet import quiet_libraries
from stereo_occ.report.config import ReportConfig
from stereo_occ.report.content import read_content
from stereo_occ.report.markdown import write_markdown
from stereo_occ.report.page import html
from stereo_occ.writing import in_the_way, write_whole

logger = logging.getLogger(__name__)


def check_report(cfg: DictConfig) -> list[str]:
    """Problems of a configuration, its folders unread."""
    problems = []
    if not patterns(cfg):
        problems.append("runs=[]: names no folder; give those of evaluations: runs=[DIR,DIR]")
    if Path(cfg.output).suffix != ".html":
        problems.append(f"output={cfg.output}: must end in .html")
    page = Path(cfg.output)
    problems += in_the_way(cfg.output, (page, page.with_suffix(".md")), kind="report")
    if not 1 <= cfg.draws <= MOST_DRAWS:
        problems.append(f"draws={cfg.draws}: must be from 1 to {MOST_DRAWS}")
    return problems


def patterns(cfg: DictConfig) -> list[str]:
    """Of ``runs``, one or several."""
    runs = cfg.runs
    return [str(run) for run in runs] if isinstance(runs, ListConfig) else [str(runs)]


def report(cfg: DictConfig) -> Path:
    """Write the page, its Markdown version and the figures; the path of the page.

    Raises:
        UserError: for anything that the user can put right.
    """
    quiet_libraries()
    settings = OmegaConf.to_object(cfg)
    assert isinstance(settings, ReportConfig)
    output = Path(settings.output)
    content = read_content(settings, patterns(cfg))
    write_whole(output, html(content).encode())
    write_markdown(content, output.with_suffix(".md"))
    for note in content.notes:
        logger.warning("%s", note)
    return output


@entry_point("report", check_report)
def main(cfg: DictConfig) -> None:
    """Write the report and say where it is."""
    output = report(cfg)
    megabytes = output.stat().st_size / 1e6
    logger.info("%s (%.1f MB), and %s", output, megabytes, output.with_suffix(".md").name)


if __name__ == "__main__":
    main()
