"""What holds for every test."""

import os
from urllib.error import URLError

import pytest
import torch

from stereo_occ.errors import UserError
from stereo_occ.render.gl import process_renderer


@pytest.fixture(scope="session", autouse=True)
def _one_thread():
    """Other threads gain nothing on models this small, and results do not depend on the machine's cores."""
    os.environ["OMP_NUM_THREADS"] = "1"
    torch.set_num_threads(1)


@pytest.fixture(scope="session")
def egl():
    """Skip the tests that render where OpenGL is not to be had."""
    try:
        process_renderer(8, 8)
    except UserError as error:
        pytest.skip(str(error))


@pytest.fixture
def torch_cache(tmp_path, monkeypatch):
    """An empty torch cache and no network."""

    def no_network(*args: object, **kwargs: object):
        raise URLError("no network")

    monkeypatch.setattr(torch.hub, "download_url_to_file", no_network)
    directory = torch.hub.get_dir()
    torch.hub.set_dir(tmp_path)
    (tmp_path / "checkpoints").mkdir()
    yield tmp_path / "checkpoints"
    torch.hub.set_dir(directory)
