"""What is typed on the command line."""

import subprocess
import sys
from pathlib import Path

import pytest
from samples import single_line

from stereo_occ import cli, evaluate, train
from stereo_occ.advice import nearest
from stereo_occ.cli import compose_config
from stereo_occ.errors import UserError
from stereo_occ.problems import find_problems


def found(*overrides, program="train", **kwargs):
    return find_problems(program, overrides, lambda cfg: [], **kwargs)


MISTAKES = [
    ("steps=abc", "steps=abc: must be a whole number"),
    ("steps=", "steps=: must be a whole number"),
    ("steps=4e3", "steps=4e3: must be a whole number"),
    ("steps=1.5", "steps=1.5: must be a whole number"),
    ("steps=null", "steps=null: must be a whole number"),
    ("steps=1e20", "steps=1e20: must be a whole number"),
    ("optimizer.lr=fast", "optimizer.lr=fast: must be a number"),
    ("progress=maybe", "progress=maybe: must be true or false"),
    ("resume=perhaps", "resume=perhaps: must be one of never, auto"),
    ("placement.kind=fre", "placement.kind=fre: must be one of paper, free"),
    ("categories.names=mug", "categories.names=mug: must be a list such as [mug,bowl,bottle]"),
    ("model.encoder=3", "model.encoder=3: must be given key by key: model.encoder.name=..."),
    ("paths.data=null", "paths.data=null: must be text"),
    ("+steps=3", "+steps=3: the key exists already; write steps=3"),
    ("stesp=3", "stesp: unknown key; did you mean steps?"),
    ("++stesp=3", "stesp: unknown key; did you mean steps?"),
    ("+stesp=3", "stesp: unknown key; did you mean steps?"),
    ("model.encoder.nme=3", "model.encoder.nme: unknown key; did you mean model.encoder.name?"),
    ("lr=0.1", "lr: unknown key; did you mean optimizer.lr?"),
    ("data.rooot=x", "data.rooot: unknown key; known in data: "),
    ("data.counts.cup=1", "data.counts.cup: unknown key; known in data.counts: mug, bowl, bottle"),
    ("hydra.rnu.dir=x", "hydra.rnu.dir: unknown key; did you mean hydra.run?"),
    ("scale=lptop", "scale=lptop: unknown choice; did you mean laptop?"),
    ("scale=null", "scale=null: unknown choice; known: laptop, paper, paper_640k, smoke"),
    ("optimizer=sgd", "optimizer=sgd: unknown choice; known: adam, adamw"),
    ("model/encoder=resnet", "model/encoder=resnet: unknown choice; did you mean"),
    ("steps", "steps: cannot be read; write key=value"),
    ("=3", "=3: cannot be read; write key=value"),
    ("steps==3", "steps==3: cannot be read; write key=value"),
    ("steps=[1,2", "steps=[1,2: cannot be read; write key=value"),
    ("~steps", "~steps: a key cannot be removed"),
    ("~data.seed", "~data.seed: a key cannot be removed"),
]


@pytest.fixture(scope="module")
def reported():
    """All mistakes at once; each is tried for itself."""
    return found(*(override for override, _ in MISTAKES))


def test_every_mistake_is_reported(reported):
    assert len(reported) == len({expected for _, expected in MISTAKES})
    assert all(map(single_line, reported))


@pytest.mark.parametrize(("override", "expected"), MISTAKES)
def test_a_mistake_is_one_line_with_the_key_and_what_to_do(reported, override, expected):
    assert [problem for problem in reported if problem.startswith(expected)], override


def test_values_that_are_missing():
    assert found("data=meshes") == ["data.root: no value given; add data.root=..."]
    assert find_problems("train", ["steps=${nowhere}"], lambda cfg: [cfg.steps][:0]) == [
        "steps=${nowhere}: refers to a key that does not exist"
    ]


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        (
            "seed=${oc.env:NO_SUCH}",
            "cannot be resolved (Environment variable 'NO_SUCH' not found); give a value",
        ),
        ("steps=${divide:1,0}", "cannot be resolved (integer division or modulo by zero); give a value"),
        ("seed=${nosuch:1}", "cannot be resolved (Unsupported interpolation type nosuch); give a value"),
        ("paths.data=${nowhere}", "refers to a key that does not exist"),
        ("hydra.run.dir=${nowhere}", "refers to a key that does not exist"),
        ("seed=4294967296", "must be at most 4294967295"),
        ("steps=100000000000000000000", "must be at most 4294967295"),
        ("scale.counts.mug=100000000000000000000", "must be at most 4294967295"),
    ],
)
def test_a_value_that_is_well_typed_and_yet_none(override, expected):
    assert found(override) == [f"{override}: {expected}"]


def test_a_number_too_long_to_read():
    override = f"steps={'9' * 5000}"
    (problem,) = found(override)
    assert problem.startswith(f"{override}: cannot be read")


def test_groups_that_are_not_chosen_have_nothing_to_change():
    for override, group in (("control.degrees=3", "control"), ("rig.fov_deg=50", "rig")):
        (problem,) = found("checkpoint=x", override, program="evaluate")
        assert problem.startswith(f"{override}: there is no {group} to change; say {group}=..., one of ")


def test_parts_that_a_model_does_not_have():
    assert found("model=mono", "model/cost_volume=groupwise") == [
        "model/cost_volume=groupwise: model=mono has no cost_volume; leave it out or choose another model"
    ]
    assert found("scale=smoke", "checkpoint=x", program="evaluate")[0].startswith(
        "scale=smoke: evaluate has no group scale; its groups are background, "
    )


@pytest.mark.parametrize(
    "overrides",
    [
        [],
        ["debug=quick", "logger.tensorboard=off", "steps=${scale.views}", "hydra.run.dir=/tmp/a b"],
        ["seed=4294967295", "hydra.run.dir=runs/${hydra:job.name}_${oc.env:HOME}"],
        ["~debug", "experiment=overfit", "++steps=100", "trainer.threads=null", "logger.tensorboard=no"],
        ["model=mono", "model.encoder.weights=null", "paths.data='/data/it is=here, (1)'"],
    ],
)
def test_what_is_right_passes(overrides):
    assert found(*overrides) == []


def test_every_value_of_a_sweep_is_checked():
    assert found("seed=0,x,y", "model=stereo,mno") == [
        "seed=x: must be a whole number",
        "seed=y: must be a whole number",
        "model=mno: unknown choice; did you mean mono?",
    ]
    seen = []
    find_problems("train", ["steps=range(10,40,10)"], lambda cfg: seen.append(cfg.steps) or [])
    assert seen == [10, 20, 30]


def test_a_choice_that_does_not_fit_another_value_of_the_sweep():
    (problem,) = found("model=stereo,mono", "model/cost_volume=groupwise")
    assert problem.startswith("model/cost_volume=groupwise: model=mono has no cost_volume")


def test_a_sweep_without_its_flag():
    (problem,) = found("seed=0,1", multirun=False)
    assert problem == "seed=0,1: gives several values; add -m to run them one after another"


def test_groups_of_ones_own(tmp_path):
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "mine.yaml").write_text("# @package _global_\nsteps: 30\n")
    steps = []
    check = lambda cfg: steps.append(cfg.steps) or []  # noqa: E731
    assert find_problems("train", ["experiment=mine"], check, config_dir=tmp_path) == []
    assert steps == [30]
    assert found("experiment=mine")[0].startswith("experiment=mine: unknown choice; known: ")


def test_advice_on_names():
    assert nearest("mgu", ["mug", "bowl", "bottle"]) == "did you mean mug?"
    assert nearest("xyz", ["mug", "bowl", "bottle"]) == "known: bottle, bowl, mug"


def test_composing_in_code_reports_the_same_problems():
    assert compose_config("train", ["steps=70"]).steps == 70
    with pytest.raises(UserError, match=r"steps=abc: must be a whole number; stesp: unknown key"):
        compose_config("train", ["steps=abc", "stesp=1"])


@pytest.mark.parametrize(
    ("main", "arguments", "lines"),
    [
        (train.main, ["steps=abc"], ["steps=abc: must be a whole number"]),
        (
            train.main,
            ["steps=0", "batch_size=0"],
            ["steps=0: must be at least 1", "batch_size=0: must be at least 1"],
        ),
        (train.main, ["seed=0,1"], ["seed=0,1: gives several values; add -m to run them one after another"]),
        (train.main, ["-m", "seed=0,-1"], ["seed=-1: must be at least 0"]),
        (
            train.main,
            ["--cfg", "job", "rig=papper", "steps=x"],
            ["rig=papper: unknown choice; did you mean paper?", "steps=x: must be a whole number"],
        ),
        (train.main, ["--help", "stesp=1"], ["stesp: unknown key; did you mean steps?"]),
        (train.main, ["--info", "all", "steps=${no}"], ["steps=${no}: refers to a key that does not exist"]),
        (
            train.main,
            ["--config-name", "nope"],
            ["--config-name nope: each program has its own settings; add yours with --config-dir"],
        ),
        (
            train.main,
            ["--cfg", "job", "--config-dir", "nope"],
            ["--config-dir nope: no such folder; give one such as DIR of DIR/experiment/mine.yaml"],
        ),
        (
            evaluate.main,
            ["--cfg", "job", "--resolve", "data=meshes"],
            [
                "--resolve: Interpolation key 'scale.views' not found, which a checkpoint gives; leave --resolve out"
            ],
        ),
        (evaluate.main, [], ["checkpoint: no value given; add checkpoint=... or baseline=..."]),
        (
            evaluate.main,
            ["checkpoint=no.ckpt"],
            ["checkpoint=no.ckpt: no such file; give the path of a .ckpt file of a training run"],
        ),
    ],
)
def test_a_program_stops_before_anything_is_written(tmp_path, monkeypatch, capsys, main, arguments, lines):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["program", *arguments])
    with pytest.raises(SystemExit) as stop:
        main()
    assert stop.value.code == 2
    output = capsys.readouterr()
    assert output.err.splitlines() == [f"stereo_occ: {line}" for line in lines]
    assert output.out == ""
    assert list(tmp_path.iterdir()) == []


PROGRAM = """
from stereo_occ.cli import entry_point
from stereo_occ.errors import UserError

@entry_point("train", lambda cfg: [])
def main(cfg):
    if cfg.seed == 1:
        raise UserError(f"seed={cfg.seed}: an unlucky number; choose another")
    print("ran", cfg.seed)

main()
"""


def test_what_is_logged_can_go_to_the_console_alone(tmp_path):
    (tmp_path / "program.py").write_text(PROGRAM.replace("print(", "__import__('logging').warning('%s %s', "))
    for logs, files in (("to_file", ["train.log"]), ("stdout", [])):
        run = subprocess.run(
            [sys.executable, "program.py", f"hydra/job_logging={logs}", f"hydra.run.dir={logs}"],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert run.returncode == 0, run.stderr
        assert "ran 0" in run.stdout
        assert [path.name for path in (tmp_path / logs).iterdir()] == files


def test_a_failure_in_a_sweep_is_one_line_and_the_other_jobs_run(tmp_path):
    (tmp_path / "program.py").write_text(PROGRAM)
    run = subprocess.run(
        [sys.executable, "program.py", "-m", "seed=0,1,2"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert run.returncode == 2
    assert run.stderr.splitlines() == ["stereo_occ: seed=1: an unlucky number; choose another"]
    assert [line for line in run.stdout.splitlines() if line.startswith("ran")] == ["ran 0", "ran 2"]
    folders = sorted(path.name for path in Path(tmp_path).glob("outputs/sweeps/*/*") if path.is_dir())
    assert folders == ["0_stereo_seed0", "2_stereo_seed2"]


def test_a_failure_in_another_process_of_a_sweep_ends_it_with_its_line(tmp_path):
    pytest.importorskip("hydra_plugins.hydra_joblib_launcher")
    (tmp_path / "program.py").write_text(PROGRAM)
    run = subprocess.run(
        [sys.executable, "program.py", "-m", "hydra/launcher=joblib", "seed=0,1,2"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert run.returncode == 2, run.stderr
    assert run.stderr.splitlines()[-1] == "stereo_occ: seed=1: an unlucky number; choose another"
    assert "Traceback" not in run.stderr
    assert sorted(line for line in run.stdout.splitlines() if line.startswith("ran")) == ["ran 0", "ran 2"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a file of Linux that is always full")
@pytest.mark.parametrize(
    "program", [PROGRAM.replace("print(", "__import__('logging').getLogger('x').info('%s %s', "), PROGRAM]
)
def test_output_that_cannot_be_written_is_one_line(tmp_path, program):
    (tmp_path / "program.py").write_text(program)
    with Path("/dev/full").open("w") as full:
        run = subprocess.run(
            [sys.executable, "program.py"],
            cwd=tmp_path,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=120,
            check=False,
        )
    assert run.returncode == 2
    assert len(run.stderr.splitlines()) == 1, run.stderr
    assert run.stderr.endswith("No space left on device; free some disk space\n")


def test_a_launcher_that_is_not_installed_is_one_line(monkeypatch, capsys):
    monkeypatch.setitem(cli.LAUNCHERS, "joblib", "no_such_package")
    monkeypatch.setattr(sys, "argv", ["train", "-m", "hydra/launcher=joblib", "seed=0,1"])
    with pytest.raises(SystemExit) as stop:
        train.main()
    assert stop.value.code == 2
    assert capsys.readouterr().err == (
        "stereo_occ: hydra/launcher=joblib: needs the extra cluster; pip install 'stereo-occ[cluster]'\n"
    )


def test_run_folders_can_be_typed_without_quotes():
    """Paths of checkpoints are typed again: = and , would have to be quoted."""
    text = (Path(train.__file__).parents[1] / "conf" / "train.yaml").read_text()
    assert "override_dirname" not in text
