"""Mistakes and refusals as one line, wherever they happened."""

import errno
import os
import signal

import pytest
from torch.utils.data import DataLoader, Dataset

from stereo_occ.errors import UserError
from stereo_occ.system_errors import one_line

MISTAKE = "mug_0001.h5: cannot read the shard (truncated); delete it and render again"


class Broken(Dataset):
    def __len__(self):
        return 2

    def __getitem__(self, index):
        try:
            raise OSError("truncated")
        except OSError as error:
            raise UserError(MISTAKE) from error


@pytest.mark.parametrize("workers", [0, 1])
def test_a_mistake_found_by_a_loader_is_one_line(workers):
    """torch puts a traceback before what its processes raise."""
    with pytest.raises(UserError) as raised:
        list(DataLoader(Broken(), num_workers=workers))
    assert one_line(raised.value) == MISTAKE


class Killed(Broken):
    def __getitem__(self, index):
        os.kill(os.getpid(), signal.SIGKILL)


def test_a_loader_that_is_killed_is_one_line():
    with pytest.raises(RuntimeError) as raised:
        list(DataLoader(Killed(), num_workers=1))
    line = one_line(raised.value)
    assert line.startswith("a process that loads data has died (DataLoader worker (pid")
    assert "trainer.workers" in line
    assert "\n" not in line


def test_what_the_system_refuses_says_what_to_do():
    full = OSError(errno.ENOSPC, "No space left on device", "last.ckpt")
    assert one_line(full) == "last.ckpt: No space left on device; free some disk space"


def test_other_errors_are_raised_again():
    error = KeyError("a bug")
    with pytest.raises(KeyError) as raised:
        one_line(error)
    assert raised.value is error
