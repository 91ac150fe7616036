"""Every file in ``conf/`` composes, passes the checks, and says what it is meant to."""

from itertools import product
from pathlib import Path

import pytest
import torch
import yaml
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import OmegaConf
from samples import PAPER_COUNTS

from stereo_occ.checkpoint import plain
from stereo_occ.checks.evaluation import check_evaluation
from stereo_occ.checks.pairs import check_pairs, check_rendering
from stereo_occ.checks.training import check_training
from stereo_occ.cli import compose_config
from stereo_occ.errors import UserError
from stereo_occ.paths import conf_dir
from stereo_occ.problems import find_problems
from stereo_occ.saved_config import training_config

PROGRAMS = ("train", "render", "evaluate")
FILES = sorted(path.relative_to(conf_dir()).with_suffix("") for path in conf_dir().rglob("*.yaml"))
OURS = [file for file in FILES if file.parts[0] != "hydra"]  # presets of Hydra's own groups have its schemas
CHOICES = [(str(file.parent), file.name) for file in OURS if file.parent != Path()]
MODELS = [option for group, option in CHOICES if group == "model"]
SCALES = [option for group, option in CHOICES if group == "scale"]
SWEEPS = {
    file.stem: content["hydra"]["sweeper"]["params"]
    for file in sorted((conf_dir() / "experiment").glob("*.yaml"))
    if "hydra" in (content := yaml.safe_load(file.read_text())) and "optuna" not in file.read_text()
}


def defaults_of(file):
    return yaml.safe_load((conf_dir() / f"{file}.yaml").read_text()).get("defaults", [])


def groups_of(program):
    """The groups that a program's file and the files it includes let one choose."""
    groups = set()
    for entry in defaults_of(program):
        if isinstance(entry, dict):
            groups |= {name for name in entry if not name.startswith("override")}
        elif entry != "_self_" and not entry.startswith("base_"):
            groups |= groups_of(entry)
    return groups


def parts_of(model):
    """The groups of a model's parts, those of the model that it varies included."""
    parts = set()
    for entry in defaults_of(f"model/{model}"):
        if isinstance(entry, dict):
            parts |= {f"model/{name.removeprefix('override ')}" for name in entry}
        elif entry in MODELS:
            parts |= parts_of(entry)
    return parts


@pytest.fixture
def needed(tmp_path, monkeypatch):
    """What a choice needs beside itself, and a machine with a GPU."""
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    (tmp_path / "best.ckpt").touch()
    return {
        "augmentation=full": ["augmentation.roll_deg=0"],  # for models that read the cameras
        "data=meshes": [f"data.root={tmp_path}"],
        "data=shapenet": [f"data.root={tmp_path}"],
        "evaluate": [f"checkpoint={tmp_path / 'best.ckpt'}"],
    }


def problems(program, overrides):
    """Of those of this machine, which may lack optional packages, none."""
    check = {"train": check_training, "render": check_rendering, "evaluate": check_evaluation}[program]
    found = find_problems(program, overrides, check)
    return [line for line in found if "pip install 'stereo-occ[" not in line]


def test_every_group_of_conf_belongs_to_a_program():
    reachable = set().union(*(groups_of(program) for program in PROGRAMS), *(parts_of(m) for m in MODELS))
    assert {group for group, _ in CHOICES} == reachable


def rows(program):
    """Command lines that together name every choice of a program, one of each group at a time."""
    groups = sorted(groups_of(program) - {"baseline"})
    options = {group: [option for g, option in CHOICES if g == group] for group in groups}
    return [
        [f"{group}={choices[row]}" for group, choices in options.items() if row < len(choices)]
        for row in range(max(map(len, options.values())))
    ]


BASELINES = [("evaluate", [f"baseline={option}"]) for group, option in CHOICES if group == "baseline"]


@pytest.mark.parametrize(("program", "choices"), [(p, row) for p in PROGRAMS for row in rows(p)] + BASELINES)
def test_every_choice_of_every_program(needed, program, choices):
    more = [override for choice in choices for override in needed.get(choice, [])]
    assert problems(program, [*choices, *more, *needed.get(program, [])]) == []


@pytest.mark.parametrize(
    ("group", "option"), [(group, option) for group, option in CHOICES if group.startswith("model/")]
)
def test_every_part_composes_with_every_model_that_has_it_and_fits_one(group, option):
    owners = [model for model in MODELS if group in parts_of(model)]
    found = [problems("train", [f"model={model}", f"{group}={option}"]) for model in owners]
    assert [] in found
    assert not any("unknown" in problem for job in found for problem in job)


@pytest.mark.parametrize(("model", "scale"), list(product(MODELS, SCALES)))
def test_every_model_at_every_scale(model, scale):
    assert problems("train", [f"model={model}", f"scale={scale}"]) == []


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("schedule", ["paper", "frequent"])
def test_validation_schedules_end_with_the_last_step(scale, schedule):
    cfg = compose_config("train", [f"scale={scale}", f"validation={schedule}", "scheduler=cosine"])
    assert cfg.steps % cfg.validation.interval == 0
    assert 1 <= cfg.scheduler.warmup < cfg.steps


@pytest.mark.parametrize(
    "file", [f for f in OURS if f.parent.parts[:1] not in {(), ("experiment",), ("debug",)}]
)
def test_every_group_file_is_checked_against_its_schema(file):
    first, *_, last = defaults_of(file)
    assert first.startswith("base_") or file.with_name(first) in OURS  # a variant of one that is checked
    assert last == "_self_"


@pytest.mark.parametrize("scale", SCALES)
def test_nothing_is_left_open(scale):
    assert OmegaConf.missing_keys(compose_config("train", [f"scale={scale}"])) == set()


@pytest.mark.parametrize("model", MODELS)
def test_a_configuration_survives_a_checkpoint(model):
    cfg = compose_config("train", [f"model={model}", "placement=free", "logger.tensorboard=false"])
    values = plain(cfg)
    assert values["placement"]["kind"] == "free"
    restored = training_config(values)
    assert plain(restored) == values
    typed = OmegaConf.to_object(restored)
    assert (typed.placement, typed.data) == (
        OmegaConf.to_object(cfg.placement),
        OmegaConf.to_object(cfg.data),
    )


def test_a_checkpoint_of_another_version_is_refused():
    values = plain(compose_config("train"))
    for broken in (
        values | {"colour": "red"},
        values | {"data": {"name": "pointclouds"}},
        values | {"steps": "many"},
        values | {"data": values["data"] | {"viws": 3}},
    ):
        with pytest.raises(UserError, match="written by another version"):
            training_config(broken)


def test_the_papers_numbers():
    cfg = compose_config("train", ["scale=paper"])
    assert (cfg.steps, cfg.validation.interval) == (40_000, 4_000)
    assert cfg.data.counts == PAPER_COUNTS
    assert (cfg.data.views, cfg.data.image_side) == (1000, 224)
    assert list(cfg.data.fractions) == [0.8, 0.1, 0.1]
    assert (cfg.rig.distance, cfg.rig.half_angle_deg) == (1.0, 180 / 16)
    assert list(cfg.categories.names) == ["mug", "bowl", "bottle"]
    assert plain(cfg)["placement"] == {"kind": "paper", "diagonal": [1.0, 1.0], "standing": None}
    assert (cfg.queries.box, cfg.queries.outside, cfg.queries.surface) == (1, 0, 0)


def test_laptop_keeps_the_papers_objects_and_schedule():
    cfg = compose_config("train", ["scale=laptop"])
    assert (cfg.steps, cfg.validation.interval) == (40_000, 4_000)
    assert cfg.data.counts == PAPER_COUNTS


@pytest.mark.parametrize(("steps", "interval", "saves"), [(40_000, 4000, 1000), (20, 2, 1), (3, 1, 1)])
def test_schedules_follow_the_steps_and_are_never_zero(steps, interval, saves):
    cfg = compose_config("train", [f"steps={steps}"])
    assert (cfg.validation.interval, cfg.validation.checkpoint_interval) == (interval, saves)


def test_experiments_change_no_more_than_they_say():
    plain_run, overfit = compose_config("train"), compose_config("train", ["experiment=overfit"])
    changed = {key for key in plain(plain_run) if plain(plain_run)[key] != plain(overfit)[key]}
    assert changed == {"scale", "data", "validation"}


def changed_by(experiment, base=()):
    before, after = (
        plain(compose_config("train", more)) for more in (base, [*base, f"experiment={experiment}"])
    )
    return {key for key in before if before[key] != after[key]}


def test_the_recipe_of_comparisons():
    assert changed_by("recipe") == {"queries", "optimizer", "scheduler", "trainer"}
    cfg = compose_config("train", ["experiment=recipe", "optimizer=adam", "trainer.precision=32-true"])
    assert (cfg.optimizer.name, cfg.trainer.precision) == ("adam", "32-true")


@pytest.mark.parametrize(
    ("experiment", "control"),
    [
        ("right_zeroed", ("right_zeroed", 0)),
        ("left_twice", ("left_twice", 0)),
        ("right_shuffled", ("right_shuffled", 0)),
        ("calibration_off_0.5", ("calibration_off", 0.5)),
        ("calibration_off_1", ("calibration_off", 1)),
        ("calibration_off_2", ("calibration_off", 2)),
    ],
)
def test_twins_are_the_recipe_under_a_control(experiment, control):
    recipe, twin = (compose_config("train", [f"experiment={name}"]) for name in ("recipe", experiment))
    assert (twin.control.name, twin.control.degrees) == control
    assert plain(twin) == plain(recipe) | {"control": plain(twin)["control"]}


@pytest.mark.parametrize("experiment", SWEEPS)
def test_every_job_of_a_sweep(experiment):
    lines = [f"{key}={values}" for key, values in SWEEPS[experiment].items()]
    axes = [
        [f"{sweep.get_key_element()}={value}" for value in sweep.sweep_string_iterator()]
        for sweep in OverridesParser.create().parse_overrides(lines)
    ]
    jobs = [[f"experiment={experiment}", *job] for job in product(*axes)]
    assert len(jobs) > 1
    assert [problem for job in jobs for problem in problems("train", job)] == []


def test_a_checkpoint_from_before_the_training_aids_is_one_without():
    values = plain(compose_config("train"))
    aids = ("control", "augmentation", "auxiliary", "averaging")
    assert plain(training_config({k: v for k, v in values.items() if k not in aids})) == values


def test_inspecting_needs_only_the_folder(tmp_path):
    root = f"data.root={tmp_path}"
    assert find_problems("inspect", [root], check_pairs) == []
    assert find_problems("inspect", ["data=shapenet", root], check_pairs) == []
    assert find_problems("inspect", [], check_pairs) == ["data.root: no value given; add data.root=..."]
    assert find_problems("inspect", [root, "data.time_limit=0"], check_pairs) == [
        "data.time_limit=0.0: must be above 0 seconds"
    ]
