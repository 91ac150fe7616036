"""Run folders: one process in each, and none left where nothing was done."""

import pytest

from stereo_occ.errors import UserError
from stereo_occ.run_folder import claimed, remove_traces


def test_a_folder_is_one_processs_until_it_ends(tmp_path):
    with claimed(tmp_path):
        refused = pytest.raises(UserError, match=r"^hydra\.run\.dir=.*: another process is running in this")
        with refused, claimed(tmp_path):
            pass
        with claimed(tmp_path / "absent"):
            pass
    with claimed(tmp_path):
        pass


def test_the_working_directory_is_everybodys(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with claimed(tmp_path), claimed(tmp_path):
        pass


def test_what_holds_results_is_no_trace(tmp_path):
    for name in ("bare", "full"):
        (tmp_path / name / ".hydra").mkdir(parents=True)
    (tmp_path / "full" / "metrics.json").touch()
    for name in ("bare", "full"):
        remove_traces(tmp_path / name)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["full"]
