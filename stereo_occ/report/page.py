"""The HTML page: everything inside one file, which asks for nothing else."""

import gzip
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from stereo_occ import __version__
from stereo_occ.report.content import Content
from stereo_occ.report.figures import svg
from stereo_occ.report.gallery import data_uri, title_of
from stereo_occ.report.tables import PUBLISHED, headline

HERE = Path(__file__).parent

MODEL_VIEWER = HERE / "model_viewer" / "model-viewer.min.js.gz"


def html(content: Content) -> str:
    """The page."""
    environment = Environment(
        loader=FileSystemLoader(HERE),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals |= {"data_uri": data_uri, "title_of": title_of, "headline": headline}
    return environment.get_template("page.html.j2").render(
        content=content,
        plots={name: Markup(svg(figure, name)) for name, figure in content.plots.items()},
        published=PUBLISHED,
        facts=content.focus.facts,
        runs=run_facts(content),
        style=Markup((HERE / "page.css").read_text()),
        script=Markup((HERE / "page.js").read_text()),
        viewer=Markup(model_viewer()),
        version=__version__,
    )


def model_viewer() -> str:
    """model-viewer's script, without the address of its source map."""
    text = gzip.decompress(MODEL_VIEWER.read_bytes()).decode()
    return text.rpartition("//# sourceMappingURL=")[0]


def run_facts(content: Content) -> list[dict[str, Any]]:
    """One evaluation per row: what its number came from."""
    return [
        {
            "model": model.label,
            "color": color,
            "folder": str(folder),
            "seed": "" if seed is None else seed,
            "step": "" if facts.get("step") is None else facts["step"],
            "parameters": f"{facts['parameters'] / 1e6:.1f} M" if facts.get("parameters") else "",
            "threshold": f"{facts['threshold']:.2f}",
            "commit": f"{(facts.get('commit') or 'unknown')[:10]}{'+' if facts.get('dirty') else ''}",
            "failures": ", ".join(f"{count} {name}" for name, count in facts["failures"].items()) or "none",
        }
        for model, color in content.models
        for folder, seed, facts in zip(
            model.folders, model.evaluations.seeds, model.evaluations.facts, strict=True
        )
    ]
