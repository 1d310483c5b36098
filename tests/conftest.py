"""What tests of several folders share: made-up runs, written once, that runs end without a picture and stages, and that
linear algebra has one thread.
"""

import os

os.environ["OMP_NUM_THREADS"] = "1"  # before numpy is loaded: each core has a worker, and more threads only wait
# PETSc's handlers end a worker that crashes without a word; pytest's print where it was
os.environ["PETSC_OPTIONS"] = f"{os.environ.get('PETSC_OPTIONS', '')} -no_signal_handler".strip()

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

import pdvol.compat  # noqa: F401  # before a test imports dolfinx: its wheel needs that

# isort: split
import on_ranks
import runs
from browser import Tab, chromium


def pytest_xdist_auto_num_workers() -> int:
    """One more than cores: many tests wait for processes, deadlines and pages."""
    return len(os.sched_getaffinity(0)) + 1


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files with tests on ranks come first: one worker takes them all, so ranks are started once."""
    on_several = {item.path for item in items if "mpi" in item.keywords}
    items.sort(key=lambda item: item.path not in on_several)


@pytest.fixture(scope="session", autouse=True)
def final_pictures():
    """`pdvol run` ends with a picture, and `pdvol metrics` with curves, which take longer than the runs of most tests:
    in this process they are drawn only within `with final_pictures():`. Pictures that are asked for in another way are
    drawn as ever.
    """
    from pdvol.studio.draw import picture, plots

    render, plot_metrics, drawn = picture.render, plots.plot_metrics, []

    def render_if_wanted(run, path, *choices, **named):
        return render(run, path, *choices, **named) if choices or named or drawn else path

    def plot_if_wanted(path, runs):
        return plot_metrics(path, runs) if drawn else path

    @contextmanager
    def wanted() -> Iterator[None]:
        drawn.append(True)
        yield
        drawn.pop()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(picture, "render", render_if_wanted)
        patch.setattr(plots, "plot_metrics", plot_if_wanted)
        yield wanted


@pytest.fixture(scope="session", autouse=True)
def quiet_stages():
    """Commands in this process show no stages: what they print does not depend on how busy the machine is. Tests of
    stages set `SHOWN_SECONDS` themselves.
    """
    from pdvol.runs import stage_lines

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stage_lines, "SHOWN_SECONDS", float("inf"))
        yield


@pytest.fixture(scope="session", autouse=True)
def compiled_code():
    """Compiled code is kept where it always is, also while a test has a cache folder of its own."""
    from pdvol.compiled import cache_folder

    cache_folder()


@pytest.fixture(scope="session", autouse=True)
def own_state(tmp_path_factory):
    """Which scenes have run is kept apart from the developer's own list."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        yield


@pytest.fixture(scope="session", autouse=True)
def waiting_ranks():
    """Ranks that wait for calls end with the session."""
    yield
    on_ranks.end_all()


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


@pytest.fixture
def tab() -> Iterator[Tab]:
    """An empty page of 1000 x 700 pixels in a headless browser of its own; the test is skipped where there is none."""
    with chromium() as opened:
        yield opened
