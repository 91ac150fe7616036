"""One rendered data set and one finished run for all tests."""

import pytest
from runs import Workshop


@pytest.fixture(scope="session")
def workshop(tmp_path_factory):
    return Workshop(tmp_path_factory.mktemp("workshop"))


@pytest.fixture(scope="session")
def run(workshop):
    """The folder of a finished run."""
    return workshop.train(workshop.root / "run")
