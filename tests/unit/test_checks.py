"""What a well-typed configuration can still get wrong: each problem names the key, its value and a way out."""

import os

import pytest
import torch
import yaml
from omegaconf import OmegaConf
from samples import single_line

from stereo_occ.checks.evaluation import check_evaluation
from stereo_occ.checks.pairs import check_pairs, check_rendering
from stereo_occ.checks.training import check_training
from stereo_occ.cli import compose_config
from stereo_occ.problems import find_problems


@pytest.fixture(scope="module")
def valid():
    return compose_config("train")


@pytest.fixture
def four_cores(monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 4)


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        ("steps=0", "steps=0: must be at least 1"),
        ("steps=-1", "steps=-1: must be at least 1"),
        ("seed=-1", "seed=-1: must be at least 0"),
        ("data.seed=-1", "data.seed=-1: must be at least 0"),
        ("batch_size=0", "batch_size=0: must be at least 1"),
        ("workers=-1", "workers=-1: must be at least 0"),
        ("optimizer.lr=0", "optimizer.lr=0.0: must be above 0"),
        ("init=nowhere", "init=nowhere: no such file, nor the name of shipped weights (field, paper_rig)"),
        ("optimizer.name=sgd", "optimizer.name=sgd: unknown; known: adam, adamw"),
        ("optimizer.betas=[0.9]", "optimizer.betas=[0.9]: must be two numbers in [0, 1)"),
        ("scheduler.name=cosin", "scheduler.name=cosin: unknown; did you mean cosine?"),
        ("scheduler.final=2", "scheduler.final=2.0: must be a share"),
        ("categories.names=[mgu]", "categories.names=mgu: unknown; did you mean mug?"),
        (
            "categories.names=[mug,mug]",
            "categories.names=['mug', 'mug']: names a category twice; name each once",
        ),
        ("categories.names=[]", "categories.names=[]: names no category"),
        ("+data.counts.cup=3", "data.counts.cup: unknown category; known: bottle, bowl, mug"),
        ("data.counts.mug=0", "data.counts.mug=0: must be at least 1; or leave mug out"),
        ("data.counts.mug=2", "data.counts.mug: 2 are too few to divide"),
        ("data.fractions=[0.5,0.5]", "data.fractions=[0.5, 0.5]: must be three shares"),
        ("data.fractions=[0.7,0.1,0.1]", "data.fractions=[0.7, 0.1, 0.1]: must be three shares"),
        ("data.fractions=[1,0,0]", "data.fractions=[1.0, 0.0, 0.0]: training needs"),
        ("data.split=view data.views=2 validation.views=1", "data.views: 2 are too few to divide"),
        (
            "data.split=view data.fractions=[0.5,0.5,0] data.views=2 validation.views=2",
            "validation.views=2: data.split=view leaves fewer of data.views=2",
        ),
        (
            "scheduler.warmup=100000",
            "scheduler.warmup=100000: is longer than steps=40000, so the learning rate would never be",
        ),
        (
            "data.split=view data.views=20",
            "validation.views=4: data.split=view leaves fewer of data.views=20",
        ),
        (
            "data.image_side=50",
            "data.image_side: model.encoder=dilated_resnet takes multiples of 16 pixels, got 50",
        ),
        ("data.views=3", "validation.views=4: there are only data.views=3"),
        ("points=200000", "points=200000: there are only data.pool_size=100000"),
        ("validation.points=200000", "validation.points=200000: there are only data.pool_size=100000"),
        ("validation.interval=7", "steps=40000: is not a multiple of validation.interval=7"),
        ("validation.checkpoint_interval=0", "validation.checkpoint_interval=0: must be at least 1"),
        ("placement.diagonal=[0.5]", "placement.diagonal=[0.5]: must be [low, high]"),
        ("placement.diagonal=[0.9,0.5]", "placement.diagonal=[0.9, 0.5]: must be [low, high]"),
        ("placement.diagonal=[0.5,2]", "placement.diagonal=[0.5, 2.0]: must be [low, high]"),
        ("rig.fov_deg=180", "rig.fov_deg=180.0: must be 1 to 170"),
        ("rig.half_angle_deg=-3", "rig.half_angle_deg=-3.0: must be 0.01 to 89"),
        ("rig.distance=0", "rig.distance=0.0: must be 0.1 to 100"),
        ("rig.distance=1.0e+300", "rig.distance=1e+300: must be 0.1 to 100"),
        ("rig.fov_deg=179.9", "rig.fov_deg=179.9: must be 1 to 170"),
        ("data.pool_size=99999999", "data.pool_size=99999999: must be at most 10000000"),
        ("logger.mesh_resolution=100000", "logger.mesh_resolution=100000: must be at most 512"),
        ("lights.count=[2,9]", "lights.count: must be [low, high]"),
        ("material.hue=[0,2]", "material.hue: must be [low, high]"),
        ("background.masked=2", "background.masked=2.0: is a share of the view pairs"),
        ("background.low=[0,0]", "background.low=[0.0, 0.0]: must be three values"),
        ("queries.box=2", "queries=[2.0, 0.0, 0.0]: box, outside and surface must be shares"),
        ("trainer.precision=16", "trainer.precision=16: unknown; known: 16-mixed, 32-true, auto, bf16-mixed"),
        ("trainer.accelerator=cup", "trainer.accelerator=cup: unknown; did you mean cpu"),
        ("trainer.devices=0", "trainer.devices=0: must be at least 1"),
        ("trainer.devices=3", "batch_size=16: must be a multiple of the 3 processes"),
        ("trainer.nodes=2", "trainer.nodes=2: processes on several machines"),
        ("trainer.threads=0", "trainer.threads=0: must be at least 1"),
        (
            "trainer.threads=100000",
            "trainer.threads=100000: must be at most 64, 16 for each core; this machine has 4",
        ),
        ("trainer.workers=100000", "trainer.workers=100000: must be at most 64"),
        ("workers=100000", "workers=100000: must be at most 64"),
        ("trainer.devices=65 batch_size=65", "trainer.devices=65: must be at most 64"),
        (
            "trainer.precision=16-mixed",
            "trainer.precision=16-mixed: processors have no half precision; say auto",
        ),
        ("trainer.gradient_clip=-1", "trainer.gradient_clip=-1.0: must be above 0"),
        ("logger.mesh_resolution=0", "logger.mesh_resolution=0: must be at least 1"),
        ("model.encoder.name=foo", "model.encoder: unknown 'foo'"),
        ("model.decoder.hidden=0", "model.decoder.hidden: must be at least 1, got 0"),
        ("augmentation.blur=-1", "augmentation.blur=-1.0: must be between 0 and 8"),
        ("augmentation.mirror=2", "augmentation.mirror=2.0: must be between 0 and 1"),
        (
            "augmentation.roll_deg=5",
            "augmentation.roll_deg=5.0: model=stereo has no way to know how its cameras have rolled; "
            "say augmentation.roll_deg=0",
        ),
        ("auxiliary.depth=-1", "auxiliary.depth=-1.0: must be at least 0"),
        ("averaging.decay=1", "averaging.decay=1.0: must be at least 0 and below 1, or null"),
        ("control.name=left_twic", "control.name=left_twic: unknown; did you mean left_twice"),
        ("control.name=calibration_off", "control.degrees=0.0: must be above 0 and at most 180"),
        ("control.degrees=2", "control.degrees=2.0: control=none turns no camera; leave it at 0"),
    ],
)
def test_a_problem_of_a_training(valid, four_cores, overrides, expected):
    cfg = valid.copy()
    for override in overrides.split():
        key, _, value = override.partition("=")
        OmegaConf.update(cfg, key.lstrip("+"), yaml.safe_load(value), force_add=key.startswith("+"))
    (problem,) = check_training(cfg)
    assert problem.startswith(expected)
    assert single_line(problem)


def test_parts_that_do_not_fit_each_other():
    overrides = ["model/cost_volume=groupwise", "model.cost_volume.groups=7"]
    (problem,) = find_problems("train", overrides, check_training)
    assert problem == "model.cost_volume.groups: must divide the encoder's 16 channels, got 7"


def test_a_gpu_that_is_not_there(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    (problem,) = find_problems("train", ["trainer=gpu"], check_training)
    assert problem == "trainer.accelerator=gpu: PyTorch sees no GPU here; say trainer=cpu"


@pytest.mark.parametrize("steps", [5, 12, 45, 12345])
def test_the_advice_on_the_schedule_helps(steps):
    """Half of it would not: another number of steps moves the interval that is derived from it."""
    found = find_problems("train", [f"steps={steps}"], check_training)
    for problem in found:
        advice = problem.rpartition("; say ")[2].split()
        assert find_problems("train", advice, check_training) == []
    assert bool(found) == (steps > 12)


def test_every_problem_is_reported_at_once():
    overrides = ["steps=0", "optimizer.lr=-1", "categories.names=[cup]", "rig.fov_deg=0", "batch_size=0"]
    found = find_problems("train", overrides, check_training)
    assert [problem.partition("=")[0] for problem in found] == [
        "categories.names",
        "rig.fov_deg",
        "steps",
        "batch_size",
        "optimizer.lr",
    ]


@pytest.mark.parametrize(
    ("model", "volume"),
    [
        (["model=stereo_signed"], "correlation_signed"),
        (["model=stereo", "model/cost_volume=concat", "model.cost_volume.disparities=null"], "concat"),
    ],
)
def test_the_disparities_of_one_rig_are_not_those_of_many(model, volume):
    (problem,) = find_problems("train", [*model, "rig=randomised"], check_training)
    assert problem.startswith(
        f"model.cost_volume.name={volume}: has the disparities of one rig, and rig.kind="
    )
    advised = [problem.rpartition("; say ")[2].partition(",")[0]]
    assert find_problems("train", ["model=stereo", *advised, "rig=randomised"], check_training) == []


@pytest.mark.parametrize(
    "overrides",
    [
        ["model=stereo", "model/cost_volume=plane_sweep"],  # about the left camera, whatever its roll
        ["model=plane_sweep_stereo", "rig=rectified", "placement=table"],
    ],
)
def test_pictures_are_not_rolled_where_the_labels_would_not_follow(overrides):
    (problem,) = find_problems("train", [*overrides, "augmentation=full"], check_training)
    assert problem.startswith("augmentation.roll_deg=10.0: ")
    unrolled = [*overrides, "augmentation=full", "augmentation.roll_deg=0"]
    assert find_problems("train", unrolled, check_training) == []


def test_places_in_a_map_need_an_image_of_whole_cells():
    resnet = ["model/encoder=resnet18_scratch", "scale.image_side=66"]
    (problem,) = find_problems("train", ["model=pixel_stereo", *resnet], check_training)
    assert problem.startswith("data.image_side: model.encoder=resnet18 takes multiples of 4 pixels, got 66")
    assert find_problems("train", ["model=mono_scratch", "scale.image_side=66"], check_training) == []


def test_a_mesh_folder_must_exist(tmp_path):
    overrides = ["data=meshes", f"data.root={tmp_path / 'nowhere'}"]
    for program, check in (("train", check_training), ("render", check_pairs)):
        (problem,) = find_problems(program, overrides, check)
        assert problem.startswith(f"data.root={tmp_path / 'nowhere'}: no such folder")
    assert find_problems("render", ["data=meshes", f"data.root={tmp_path}"], check_pairs) == []


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (["slice.of=4", "slice.index=5"], ["slice.index=5: must be 1 to slice.of=4"]),
        (["slice.index=0"], ["slice.index=0: must be 1 to slice.of=1"]),
        (["slice.of=0"], ["slice.of=0: must be at least 1"]),
        (["slice.of=3", "slice.index=1,2,3,4"], ["slice.index=4: must be 1 to slice.of=3"]),
        (["slice.of=3", "slice.index=range(1,4)"], []),
    ],
)
def test_slices_are_counted_from_one(overrides, expected):
    assert find_problems("render", overrides, check_rendering) == expected


def test_rendering_needs_no_division_into_subsets():
    assert (
        find_problems("render", ["categories=mug", "scale.counts.mug=1", "data.views=1"], check_pairs) == []
    )


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("subset=tset", "subset=tset: unknown; did you mean test"),
        ("views=0", "views=0: must be at least 1"),
        ("points=0", "points=0: must be at least 1"),
        ("mesh_resolution=0", "mesh_resolution=0: must be at least 1"),
        ("mesh_resolution=100000", "mesh_resolution=100000: must be at most 512"),
        ("surface_points=1000000000", "surface_points=1000000000: must be at most 10000000"),
        ("points=1000000000", "points=1000000000: must be at most 10000000"),
        ("examples=-1", "examples=-1: must be at least 0"),
        ("meshes=-1", "meshes=-1: must be at least 0"),
        ("workers=100000", "workers=100000: must be at most 64"),
        ("trainer.threads=100000", "trainer.threads=100000: must be at most 64"),
        ("trainer.precision=16-mixed", "trainer.precision=16-mixed: processors have no half precision"),
        ("training=['scale=smoke']", "training=['scale=smoke']: the checkpoint says what it was trained on"),
        ("control=calibration_off_1 control.degrees=-1", "control.degrees=-1.0: must be above 0"),
        ("checkpoint=nowhere.ckpt", "checkpoint=nowhere.ckpt: no such file; give the path of a .ckpt"),
    ],
)
def test_a_problem_of_an_evaluation(tmp_path, four_cores, override, expected):
    (tmp_path / "best.ckpt").touch()
    overrides = [f"checkpoint={tmp_path / 'best.ckpt'}", *override.split()]
    (problem,) = find_problems("evaluate", overrides, check_evaluation)
    assert problem.startswith(expected)
    assert single_line(problem)


def test_an_evaluation_takes_sizes_from_its_checkpoint(tmp_path):
    """Groups that refer to the scale compose without one: the checkpoint brings it."""
    (tmp_path / "best.ckpt").touch()
    overrides = [
        f"checkpoint={tmp_path / 'best.ckpt'}",
        "data=meshes",
        f"data.root={tmp_path}",
        "placement=free",
    ]
    assert find_problems("evaluate", overrides, check_evaluation) == []


def test_a_problem_of_a_baseline():
    for overrides, expected in (
        (["baseline=sgm", "baseline.block=4"], "baseline.block=4: must be odd"),
        (["baseline=mean_shape", "baseline.cells=0"], "baseline.cells=0: must be at least 1"),
    ):
        (problem,) = find_problems("evaluate", overrides, check_evaluation)
        assert problem.startswith(expected)
    assert find_problems("evaluate", ["baseline=nearest_shape"], check_evaluation) == []
