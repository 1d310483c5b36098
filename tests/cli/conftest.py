"""What tests of several commands begin with: a scene file, and one finished run of it."""

import pytest

from cli_scenes import FALL, pdvol, write


@pytest.fixture(scope="session")
def folder(tmp_path_factory, final_pictures):
    """A folder with the scene file and one finished run of it."""
    folder = tmp_path_factory.mktemp("runs")
    write(folder / "fall.py", FALL)
    with final_pictures():
        assert pdvol("run", folder / "fall.py", "--out", folder / "whole") == 0
    return folder


@pytest.fixture
def scene(folder):
    return folder / "fall.py"


@pytest.fixture
def whole(folder):
    return folder / "whole"
