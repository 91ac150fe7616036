"""Which evaluations are seeds of one model, and what to call it: from what the files say, not from folders' names."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stereo_occ.compare import check_alike, check_seeds
from stereo_occ.errors import UserError
from stereo_occ.evaluation_rows import Evaluations, read_evaluations, read_facts
from stereo_occ.model_settings import Settings, model_settings
from stereo_occ.report.facts import check_shown
from stereo_occ.shapes.shape import CATEGORIES

#: Controls that leave a model two views of one object.
SHOW_THE_PAIR = {"none", "calibration_off"}

#: How many differing settings a label names.
MOST_NAMED = 3


@dataclass(frozen=True, eq=False)
class Model:
    """Evaluations of one model from one or several training seeds.

    Attributes:
        label: name that no other model of the report has.
        settings: what makes it this model, by dotted key.
        uses_pair: whether it is shown two views and looks at both.
    """

    label: str
    settings: Settings
    evaluations: Evaluations
    uses_pair: bool

    @property
    def facts(self) -> dict[str, Any]:
        """Of the first seed."""
        return self.evaluations.facts[0]

    @property
    def folders(self) -> list[Path]:
        """One per seed."""
        return self.evaluations.folders

    @property
    def is_network(self) -> bool:
        """Whether it was trained, and is no baseline."""
        return "baseline.name" not in self.settings

    def mean(self, metric: str) -> float:
        """Mean of category means, over the seeds."""
        return float(np.mean([facts["metrics"][f"test/{metric}"] for facts in self.evaluations.facts]))


def read_models(folders: Sequence[Path]) -> list[Model]:
    """The models of these evaluations, in the order in which they first come.

    Raises:
        UserError: a folder is none of an evaluation, its files are damaged, two are of one training, or they were not
            measured on the same test set in the same way.
    """
    groups: dict[str, list[Path]] = {}
    settings: dict[str, Settings] = {}
    for folder in dict.fromkeys(folders):
        of_model = model_settings(read_facts(folder))
        name = repr(sorted(of_model.items()))
        groups.setdefault(name, []).append(folder)
        settings[name] = of_model
    labels = labels_of(list(settings.values()))
    models = [
        Model(label, settings[name], read_evaluations(label, in_group), _uses_pair(settings[name]))
        for label, (name, in_group) in zip(labels, groups.items(), strict=True)
    ]
    for model in models:
        check_seeds(model.evaluations)
        check_alike(models[0].evaluations, model.evaluations)
        for facts, folder in zip(model.evaluations.facts, model.folders, strict=True):
            _check_same_test_set(models[0], facts, folder)
            check_shown(facts, model.evaluations.categories, folder / "metrics.json")
    return models


def in_order(categories: Iterable[str]) -> list[str]:
    """Each category once, in the order of the paper."""
    known = {name: index for index, name in enumerate(CATEGORIES)}
    return sorted(set(categories), key=lambda name: (known.get(name, len(known)), name))


def labels_of(models: Sequence[Settings]) -> list[str]:
    """A name for each: its kind, and what it differs in from others of that kind."""
    kinds = [_kind(settings) for settings in models]
    labels: list[str] = []
    for kind, settings in zip(kinds, models, strict=True):
        others = [
            other for other_kind, other in zip(kinds, models, strict=True) if other_kind == kind
        ]  # itself among them
        keys = sorted(
            {key for other in others for key in other}, key=lambda key: ("control." not in key, key)
        )
        differing = [key for key in keys if any(other.get(key) != settings.get(key) for other in others)]
        named = [
            _named(key, settings[key]) for key in differing if settings.get(key) not in (None, "none", 0)
        ]
        parts = named[:MOST_NAMED] + (["..."] if len(named) > MOST_NAMED else [])
        label = ", ".join([kind, *parts])
        same = sum(given == label or given.startswith(f"{label} (") for given in labels)
        labels.append(f"{label} ({same + 1})" if same else label)
    return labels


def _kind(settings: Settings) -> str:
    if "baseline.name" in settings:
        return str(settings["baseline.name"])
    if "model.name" in settings:
        return str(settings["model.name"])
    return f"network of {(settings['parameters'] or 0) / 1e6:.1f} M parameters"


def _named(key: str, value: Any) -> str:
    return f"{key.removesuffix('.name').rpartition('.')[2]}={value}"


def _uses_pair(settings: Settings) -> bool:
    controls = {settings.get(name, "none") for name in ("control.name", "trained_under_control.name")}
    return (
        settings.get("model.name", "mono") != "mono"
        and settings.get("model.views") != "left"
        and controls <= SHOW_THE_PAIR
    )


def _check_same_test_set(first: Model, facts: Mapping[str, Any], folder: Path) -> None:
    """The same objects, split alike, from renders of one configuration."""
    expected = first.facts
    splits = [(of.get("split") or {}).get("hash") for of in (expected, facts)]
    data = [Path(str(of.get("data"))).name for of in (expected, facts)]
    if None not in splits and splits[0] != splits[1]:
        raise UserError(
            f"runs: {first.folders[0]} and {folder} have other training or test objects (split {splits[0]} and "
            f"{splits[1]}); a report is of one test set"
        )
    if data[0] != data[1]:
        raise UserError(
            f"runs: {first.folders[0]} and {folder} saw other renders, so other poses ({data[0]} and {data[1]}); "
            f"a report is of one test set"
        )
