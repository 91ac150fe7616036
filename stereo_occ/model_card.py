"""The page that goes with exported weights: what they are, from what, how good and what not."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from stereo_occ.run_folder import OVERRIDES


def model_card(
    name: str, description: Mapping[str, Any], parameters: int, size: int, command: str | None
) -> str:
    """Markdown, from the training's configuration and the metrics of an evaluation.

    Args:
        name: of the weights.
        description: what is in their JSON file.
        parameters: of the model.
        size: of the weights' file, bytes.
        command: that trained it, where it is known.
    """
    config = description["config"]
    data, categories = config["data"], config["categories"]["names"]
    lines = [
        f"# {name}",
        "",
        f"`model.name={config['model']['name']}`, {parameters / 1e6:.1f} M parameters, {size / 1e6:.1f} MB, "
        f"images of {data['image_side']} pixels, decision threshold {description['threshold']:.3g}{_rule(config)}.",
        "",
        "## Use",
        "```",
        f"python -m stereo_occ.reconstruct left=L.png right=R.png rig=rig.yaml checkpoint={name} output=mug.glb",
        "```",
        "",
        "## Training",
        f"{description['step']} of {config['steps']} steps on {', '.join(categories)} of `data={data['name']}` with "
        f"`rig.kind={config['rig'].get('kind', 'toed_in')}`, `placement.kind={config['placement']['kind']}`; "
        f"rendered pictures alone, {data['views']} pairs of each object. The whole configuration is in `{name}.json`.",
        *(["```", command, "```"] if command else []),
        "",
        "## Metrics",
        *_table(description.get("metrics") or {}),
        "",
        "## Limits",
        "- Trained on the categories named above alone: anything else comes out as something like them.",
        "- Trained on rendered pictures: photographs differ in light, material, background and sensor.",
        "- What neither camera sees is a guess from the shapes of the training.",
        *_rig_limits(config),
        "",
    ]
    return "\n".join(lines)


def training_command(folder: Path) -> str | None:
    """The command of a run, from the overrides that are noted in its folder."""
    places = (folder / OVERRIDES, folder / ".hydra" / "overrides.yaml")  # formerly
    notes = next((place for place in places if place.is_file()), None)
    if notes is None:
        return None
    words = [line.removeprefix("- ").strip() for line in notes.read_text(encoding="utf-8").splitlines()]
    return " ".join(["python -m stereo_occ.train", *(word for word in words if word not in ("[]", ""))])


def _rule(config: Mapping[str, Any]) -> str:
    rule = config["validation"].get("decision", "fixed")
    return "" if rule == "fixed" else f" ({rule})"


def _table(metrics: Mapping[str, Any]) -> list[str]:
    """A row per metric: its mean over categories, and each of them."""
    values = {
        tuple(key.split("/")[1:]): value
        for key, value in metrics.items()
        if "/" in key and isinstance(value, int | float)
    }
    names = list(dict.fromkeys(name for name, *_ in values))
    categories = list(dict.fromkeys(rest[0] for _, *rest in values if rest and rest[0] != "all"))
    if not names:
        return ["Not evaluated."]
    cells = [[values.get(key) for key in ((name,), *((name, c) for c in categories))] for name in names]
    rows = [
        " | ".join([f"| `{name}`", *("" if value is None else f"{value:.4g}" for value in row)]) + " |"
        for name, row in zip(names, cells, strict=True)
    ]
    return [" | ".join(["| metric", "mean", *categories]) + " |", "|---" * (2 + len(categories)) + "|", *rows]


def _rig_limits(config: Mapping[str, Any]) -> list[str]:
    rig = config["rig"]
    if rig.get("kind") == "rectified":
        low, high = rig["distance"]
        return [
            f"- Baselines of {rig['baseline'][0]} to {rig['baseline'][1]} m, objects {low} to {high} m away, "
            f"{rig['diagonal'][0]} to {rig['diagonal'][1]} m large."
        ]
    return ["- Needs cameras that look at one point, arranged as in training; the object is there."]
