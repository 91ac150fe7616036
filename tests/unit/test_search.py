"""Searches: what is searched, what is found, and how one goes on after a stop."""

import csv
from dataclasses import dataclass, field

import pytest
import yaml
from hydra.core.utils import JobReturn, JobStatus

optuna = pytest.importorskip("optuna")

from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution  # noqa: E402

from stereo_occ.errors import UserError  # noqa: E402
from stereo_occ.search.config import SearchConfig  # noqa: E402
from stereo_occ.search.space import search_space  # noqa: E402
from stereo_occ.search.sweep import sweep  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore::optuna.exceptions.ExperimentalWarning")


def test_what_is_searched_and_what_is_fixed():
    space, fixed = search_space(
        [
            "optimizer.lr=tag(log,interval(1e-4,1e-2))",
            "queries.surface=interval(0,0.5)",
            "model.groups=int(interval(2,8))",
            "seed=range(0,7,2)",
            "model=stereo,mono",
            "steps=100",
            "steps=200",
            "points=64",
            "points=128,256",
            "queries.box=0.5,0.6",
            "queries.box=0.7",
        ]
    )
    assert space == {
        "optimizer.lr": FloatDistribution(1e-4, 1e-2, log=True),
        "queries.surface": FloatDistribution(0, 0.5),
        "model.groups": IntDistribution(2, 8),
        "seed": IntDistribution(0, 6, step=2),
        "model": CategoricalDistribution(["stereo", "mono"]),
        "points": CategoricalDistribution(["128", "256"]),
    }
    assert fixed == ["steps=200", "queries.box=0.7"]


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["steps=3"], "hydra.sweeper.params: names nothing to search"),
        (["optimizer.lr=interval(2,1)"], r"optimizer.lr=interval\(2,1\): no range to search"),
        (["seed=range(3,3)"], r"seed=range\(3,3\): no range to search"),
    ],
)
def test_no_space(overrides, message):
    with pytest.raises(UserError, match=message):
        search_space(overrides)


class Stopped(BaseException):
    """As Ctrl-C does."""


@dataclass
class Launcher:
    """Runs jobs whose result is highest at x = 0.3; ends the process before a job if it is told to."""

    stop_before: int | None = None
    fails: dict = field(default_factory=dict)
    launched: list = field(default_factory=list)

    def launch(self, jobs, initial_job_idx):
        results = []
        for number, overrides in enumerate(jobs, initial_job_idx):
            if number == self.stop_before:
                self.stop_before = None
                raise Stopped
            self.launched.append((number, overrides))
            settings = dict(override.split("=") for override in overrides)
            value = self.fails.get(number, 1 - (float(settings["x"]) - 0.3) ** 2)
            failed = isinstance(value, Exception)
            results.append(JobReturn(status=JobStatus.FAILED if failed else JobStatus.COMPLETED))
            results[-1].return_value = value
        return results


def run(folder, launcher, arguments=("x=interval(0,1)", "steps=7"), **settings):
    config = SearchConfig(
        **{"n_trials": 9, "n_jobs": 1, "n_startup_trials": 3, "seed": 0}
        | {"storage": f"sqlite:///{folder}/trials.db"}
        | settings
    )
    sweep(config, arguments, launcher, folder)
    return rows(folder)


def rows(folder):
    with (folder / "trials.csv").open() as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder, launcher = tmp_path_factory.mktemp("whole"), Launcher()
    run(folder, launcher)
    return folder, launcher


def test_a_search_finds_the_best_place(whole):
    folder, launcher = whole
    table = rows(folder)
    assert [(int(row["trial"]), row["state"]) for row in table] == [(n, "complete") for n in range(9)]
    assert all(overrides[0] == "steps=7" for _, overrides in launcher.launched)
    best = yaml.safe_load((folder / "best.yaml").read_text())
    assert best["val/iou"] == max(1 - (float(row["x"]) - 0.3) ** 2 for row in table)
    assert best["overrides"] == [f"x={table[best['trial']]['x']}"]
    assert abs(float(table[best["trial"]]["x"]) - 0.3) < 0.1
    assert (folder / "trials.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("stop", [0, 3, 7])
def test_a_stopped_search_goes_on_as_if_it_had_not_been(whole, tmp_path, stop):
    launcher = Launcher(stop_before=stop)
    with pytest.raises(Stopped):
        run(tmp_path, launcher)
    assert len(launcher.launched) == stop
    table = run(tmp_path, launcher)
    assert launcher.launched == whole[1].launched
    assert [row["x"] for row in table] == [row["x"] for row in rows(whole[0])]


def test_a_search_can_be_made_longer(whole, tmp_path):
    launcher = Launcher()
    run(tmp_path, launcher, n_trials=5)
    run(tmp_path, launcher, n_trials=5)
    assert len(launcher.launched) == 5
    run(tmp_path, launcher)
    assert launcher.launched == whole[1].launched


def test_several_trials_at_once(tmp_path):
    launcher = Launcher()
    table = run(tmp_path, launcher, n_jobs=5)
    assert [number for number, _ in launcher.launched] == list(range(9))
    assert len({row["x"] for row in table}) == 9


def test_another_search_in_the_same_place_is_refused(whole):
    folder, _ = whole
    for arguments in (("x=interval(0,2)", "steps=7"), ("x=interval(0,1)", "steps=8")):
        with pytest.raises(
            UserError, match=r"holds a search of other settings; choose another hydra.sweep.dir"
        ):
            run(folder, Launcher(), arguments)
    run(folder, Launcher(), ("x=interval(0,1)", "steps=7", "trainer.threads=1", "progress=false"))


def test_trials_that_fail_are_counted_and_never_the_best(tmp_path):
    wrong = UserError("seed=3: unlucky")
    launcher = Launcher(fails={0: None, 2: float("nan"), 3: wrong})
    with pytest.raises(UserError, match="unlucky"):
        run(tmp_path, launcher, n_trials=6)
    table = rows(tmp_path)
    assert [row["state"] for row in table] == ["fail", "complete", "fail", "fail", "complete", "complete"]
    assert yaml.safe_load((tmp_path / "best.yaml").read_text())["trial"] in (1, 4, 5)


def test_a_job_that_a_machine_ended_is_run_again(whole, tmp_path):
    launcher = Launcher(fails={2: OSError("preempted")})
    with pytest.raises(OSError, match="preempted"):
        run(tmp_path, launcher)
    launcher.fails.clear()
    run(tmp_path, launcher)
    assert [number for number, _ in launcher.launched] == [0, 1, 2, 2, *range(3, 9)]
    assert launcher.launched[3:] == whole[1].launched[2:]


def test_a_number_out_of_range_is_one_line(tmp_path):
    with pytest.raises(UserError, match=r"hydra.sweeper.n_jobs=0: must be at least 1"):
        run(tmp_path, Launcher(), n_jobs=0)


@pytest.mark.parametrize(
    ("storage", "reason"),
    [
        ("nonsense", "Could not parse SQLAlchemy URL"),
        ("foo://bar", "Can't load plugin"),
        ("oracle://user@nowhere/db", "Failed to import DB access module"),
        ("sqlite:///{folder}", "unable to open database file"),
        ("sqlite:///{folder}/notes.txt", "file is not a database"),
        ("sqlite:///{folder}/notes.txt/trials.db", "File exists|Not a directory"),
    ],
)
def test_a_data_base_that_cannot_be_opened_is_one_line(tmp_path, storage, reason):
    (tmp_path / "notes.txt").write_text("no data base")
    address = storage.format(folder=tmp_path)
    with pytest.raises(
        UserError, match=rf"^hydra\.sweeper\.storage={address}: .*({reason}).*; say "
    ) as refused:
        run(tmp_path, Launcher(), storage=address)
    assert len(str(refused.value).splitlines()) == 1
    assert (tmp_path / "notes.txt").read_text() == "no data base"


def test_a_large_seed_is_one(tmp_path):
    assert len(run(tmp_path, Launcher(), n_trials=1, seed=2**32 - 1)) == 1
