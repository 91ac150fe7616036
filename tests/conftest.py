"""What holds for every test."""

import os

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
