"""The files that an evaluation leaves: ``per_object.csv``, example meshes and pictures.

``per_object.csv`` has one row per object-view: ``category``, ``object_id``, ``view``, ``failure`` (``NaN``, ``empty
mesh`` or ``no solid``; empty where there is none), then every metric of ``docs/metrics.md``, empty where it does not
apply.
"""

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from PIL import Image

from stereo_occ.data.dataset import EvaluationPairs
from stereo_occ.data.examples import examples
from stereo_occ.pictures import comparison
from stereo_occ.predictors import ObjectView, Predictor
from stereo_occ.writing import whole_file


def write_csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Rows with the same keys as a CSV file, whole or not at all; None is an empty cell."""
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, rows[0])
    writer.writeheader()
    writer.writerows(rows)
    with whole_file(path) as file:
        file.write(text.getvalue().encode())


def write_examples(
    folder: Path, predictor: Predictor, dataset: EvaluationPairs, count: int, resolution: int
) -> None:
    """Meshes as GLB and pictures as PNG, left | right | predicted | true, of ``count`` objects of each category."""
    shards = {(shard.category, shard.object_id): shard for shard in dataset.shards}
    for example in examples(dataset, count):
        views = example.batch.views
        view = ObjectView(shards[example.id.category, example.id.object_id], example.id.view)
        predicted = predictor.mesh(view, views, resolution)
        name = f"{example.id.category}/{example.id.object_id}_view{example.id.view}"
        for kind, mesh in (("predicted", predicted), ("true", example.true)):
            path = folder / "meshes" / f"{name}_{kind}.glb"
            path.unlink(missing_ok=True)  # of a former evaluation
            if len(mesh.faces):
                with whole_file(path) as file:
                    mesh.export(file, file_type="glb")
        strip = comparison(views.left_BCHW[0], views.right_BCHW[0], predicted, example.true, view.rig)
        with whole_file(folder / "pictures" / f"{name}.png") as file:
            Image.fromarray(strip).save(file, "PNG")
