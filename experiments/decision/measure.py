"""One threshold for all pairs against one for each: the IoU at every candidate of both rules.

    python -m experiments.decision.measure NAME CHECKPOINT SUBSET [OVERRIDES OF EVALUATE...]

Writes ``NAME.json`` beside this file: by rule and threshold, the mean IoU of each category. Choose by validation
objects (SUBSET ``val``), read off what is reached on others.
"""

import json
import sys
from pathlib import Path

from stereo_occ.checkpoint import config_of
from stereo_occ.cli import compose_config
from stereo_occ.decision import DecisionRule
from stereo_occ.evaluation_data import OwnObjects, evaluated_pairs, own_settings
from stereo_occ.metrics.scores import THRESHOLDS, Scores
from stereo_occ.predictors import LearnedPredictor
from stereo_occ.quiet import quiet_libraries
from stereo_occ.trained import read_named, trained_model

HERE = Path(__file__).parent
COLUMNS = {"mug": "iou/mug", "bowl": "iou/bowl", "bottle": "iou/bottle", "macro": "iou"}


def measure(checkpoint: str, subset: str, overrides: list[str]) -> dict[str, dict[str, dict[str, float]]]:
    """IoU by rule, threshold and category."""
    cfg = compose_config("evaluate", [f"checkpoint={checkpoint}", "points=20000", *overrides])
    settings = own_settings(cfg)
    settings.subset = subset
    saved = read_named(checkpoint)
    training = config_of(saved, checkpoint)
    data = evaluated_pairs(cfg, settings, training, OwnObjects.of(cfg, settings, training))
    trained = trained_model(saved, checkpoint)
    predictor = LearnedPredictor(trained.model, trained.decision, "cpu", "bf16-mixed")
    scores = {rule: Scores(rule=rule) for rule in DecisionRule}
    for batch in data.evaluation_loader(subset):
        points = {name: queries.points_BN3 for name, queries in batch.queries.items()}
        logits = predictor.logits([], batch.views, points)
        for of_rule in scores.values():
            of_rule.update(batch, logits)
    found: dict[str, dict[str, dict[str, float]]] = {}
    for rule, of_rule in scores.items():
        for threshold in THRESHOLDS.tolist():
            summary = of_rule.summary(threshold)
            values = {name: round(summary[key], 4) for name, key in COLUMNS.items()}
            found.setdefault(rule.value, {})[f"{threshold:.3f}"] = values
    return found


if __name__ == "__main__":
    name, checkpoint, subset, *overrides = sys.argv[1:]
    quiet_libraries()
    found = measure(checkpoint, subset, overrides)
    (HERE / f"{name}.json").write_text(json.dumps(found, indent=1) + "\n")
