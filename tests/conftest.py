"""Made-up runs that the tests of storing, exporting, drawing and measuring share, written once."""

import pytest
import runs


@pytest.fixture(scope="session")
def flat_run(tmp_path_factory):
    return runs.stored_run(tmp_path_factory.mktemp("stored") / "flat", 2, (60, 200), 6)


@pytest.fixture(scope="session")
def solid_run(tmp_path_factory):
    return runs.stored_run(tmp_path_factory.mktemp("stored") / "solid", 3, (150, 600), 4)


@pytest.fixture
def small_run(tmp_path):
    """A run that a test may damage."""
    return runs.stored_run(tmp_path / "run", 2, (60, 200), 6)
