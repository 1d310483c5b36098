"""Ranks that pdvol starts by itself: how many, what they say, and what happens when one of them is killed."""

import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import runs
from cli_scenes import BOUNCE, pdvol, pdvol_on_ranks, states
from commands import SAFETY, WITHOUT_PICTURE
from on_ranks import lives, results_on
from pdvol import open_run
from pdvol.runs import launcher

pytestmark = [pytest.mark.mpi, pytest.mark.skipif(launcher.launcher() is None, reason="there is no mpirun")]
ENDED = 10.0  # seconds within which all have to end after one rank was killed


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    file = tmp_path_factory.mktemp("scenes") / "bounce.py"
    file.write_text(BOUNCE)
    return file


@pytest.fixture(scope="module")
def on_one(scene, tmp_path_factory):
    out = tmp_path_factory.mktemp("runs") / "one"
    assert pdvol("run", scene, "--out", out, "--no-picture") == 0
    return open_run(out)


def ranks_of(run):
    """The number of ranks of each stored step, by level."""
    return [[record["ranks"] for record in level.log] for level in run.levels]


@pytest.fixture(scope="module")
def level_0_on_two(scene, tmp_path_factory):
    out = tmp_path_factory.mktemp("runs") / "two"
    assert pdvol("run", scene, "--ranks", 2, "--no-picture", "--out", out, "--levels", "0:0") == 0
    return out


def test_levels_on_two_ranks_are_those_on_one(scene, on_one, level_0_on_two, tmp_path, capfd):
    """Within the solver's tolerance; side by side to the last bit of those one after the other, although dolfinx's own
    partition differs from process to process. A level that has ended on two ranks is refined on one.
    """
    out = shutil.copytree(level_0_on_two, tmp_path / "two")
    assert pdvol("refine", out, "--to", 1, "--ranks", 1, "--no-picture") == 0
    words = ["run", scene, "--ranks", 2, "--no-picture", "--wavefront"]
    capfd.readouterr()
    assert pdvol(*words, "--out", tmp_path / "beside") == 0
    said = capfd.readouterr().err
    assert all(f"level {k}: 2 ranks" in said and f"level {k}  step 8/8" in said for k in (0, 1))
    two, beside = open_run(out), open_run(tmp_path / "beside")
    assert ranks_of(two) == [[2] * 8, [1] * 8] and ranks_of(beside) == [[2] * 8, [2] * 8]
    for level, one in zip(two.levels, on_one.levels, strict=True):
        np.testing.assert_allclose(level.positions(8), one.positions(8), atol=1e-5)
    for step in range(9):
        np.testing.assert_array_equal(two.levels[0].positions(step), beside.levels[0].positions(step))
    assert (out / "level_1.xdmf").is_file()


@pytest.mark.parametrize("victim", [pytest.param(0, marks=pytest.mark.slow), 1])
def test_a_killed_rank_ends_all_with_one_line(victim, scene, on_one, tmp_path):
    out = tmp_path / "run"
    words = ["run", str(scene), "--out", str(out), "--levels", "0", "--ranks", "2", "--set", "steps=100000"]
    started = subprocess.Popen([*WITHOUT_PICTURE, *words], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    end = time.monotonic() + SAFETY
    while runs.count(out / "levels" / "0") < 6:
        assert started.poll() is None and time.monotonic() < end
        time.sleep(0.01)
    found = subprocess.run(
        ["pgrep", "-f", f"^{sys.executable} -m pdvol.runs.level_processes {out} "], capture_output=True
    )
    ranks = [int(word) for word in found.stdout.split()]
    assert len(ranks) == 2
    killed = time.monotonic()
    os.kill(ranks[victim], signal.SIGKILL)
    said = started.communicate(timeout=SAFETY)[1].strip().splitlines()
    assert time.monotonic() - killed < ENDED
    assert started.returncode == 1 and not any(map(lives, ranks))
    ended = "one of its ranks was ended by signal 9; finished steps are kept, go on with --resume"
    assert said[-1] == f"pdvol: level 0: {ended}"
    others = ("level 0  step", "level 0: 2 ranks", "starting", "loading", "preparing", "pdvol:")
    assert all(line.startswith(others) for line in said)
    assert open_run(out).levels[0].steps >= 6


def test_a_run_goes_on_with_as_many_ranks_or_others(scene, on_one, level_0_on_two, tmp_path):
    """On as many as before to the last bit, as far as there are cores."""
    out = shutil.copytree(level_0_on_two, tmp_path / "run")
    words = ["run", scene, "--out", out, "--levels", "0", "--no-picture", "--resume"]
    runs.keep_states(out / "levels" / "0", 5)
    assert pdvol(*words) == 0
    assert ranks_of(open_run(out)) == [[2] * 4 + [min(2, launcher.cores())] * 4]
    if launcher.cores() > 1:
        assert states(out, 0) == states(level_0_on_two, 0)
    runs.keep_states(out / "levels" / "0", 5)
    assert pdvol(*words, "--ranks", 1) == 0
    assert ranks_of(open_run(out)) == [[2] * 4 + [1] * 4]
    np.testing.assert_allclose(open_run(out).levels[0].positions(8), on_one.levels[0].positions(8), atol=1e-5)


def test_what_fails_on_ranks_is_one_line(scene, tmp_path, capfd):
    words = ("--ranks", 2, "--levels", "0", "--set", "until=0.035")
    assert pdvol("run", scene, "--out", tmp_path / "run", *words) == 2
    out, err = capfd.readouterr()
    assert out.count("loaded") == 2, "here, and on the first rank"
    said = err.strip().splitlines()
    assert said[-1].startswith("pdvol: ") and "gravity" in said[-1] and "Traceback" not in "".join(said)
    assert open_run(tmp_path / "run").info["state"] == "failed"


def test_a_launcher_that_fails(scene, tmp_path, capfd, monkeypatch):
    broken = tmp_path / "mpirun"
    broken.write_text("#!/bin/sh\necho ------ >&2\necho 'no slots here' >&2\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setattr(launcher, "launcher", lambda: str(broken))
    words = ["run", scene, "--levels", "0", "--no-picture"]
    assert pdvol(*words, "--out", tmp_path / "asked", "--ranks", 2) == 1
    assert "pdvol: level 0: 2 ranks did not start: no slots here" in capfd.readouterr().err
    monkeypatch.setattr(launcher, "VERTICES_A_RANK", 10)
    monkeypatch.setattr(launcher, "VERTICES_OF_TWO", 20)
    monkeypatch.setattr(launcher, "idle_cores", lambda: 2)
    assert pdvol(*words, "--out", tmp_path / "own") == 0
    said = capfd.readouterr().err
    assert "level 0: 2 ranks" in said and "did not start: no slots here; it goes on with one" in said
    assert ranks_of(open_run(tmp_path / "own")) == [[1] * 8]


@pytest.mark.parametrize(
    ("vertices", "wanted", "before", "idle", "expected"),
    [
        (500, None, 0, 16, 1),
        (3 * launcher.VERTICES_A_RANK, None, 0, 16, 3),
        (2 * launcher.VERTICES_A_RANK, None, 0, 16, 1),
        (2 * launcher.VERTICES_A_RANK, None, 2, 16, 2),
        (launcher.VERTICES_OF_TWO, None, 0, 2, 2),
        (launcher.VERTICES_OF_TWO, None, 0, 16, 4),
        (10**6, None, 0, 5, 5),
        (10**6, None, 0, 0, 1),
        (10**6, None, 3, 16, 3),
        (10**6, 1, 3, 16, 1),
        (500, 4, 0, 1, 4),
    ],
)
def test_as_many_ranks_as_pay_and_are_free(vertices, wanted, before, idle, expected, monkeypatch):
    monkeypatch.setattr(launcher, "idle_cores", lambda: max(1, idle))
    monkeypatch.setattr(launcher, "cores", lambda: 16)
    monkeypatch.setattr(launcher, "launcher", lambda: "mpirun")
    assert launcher.chosen_ranks(vertices, wanted, before) == expected
    monkeypatch.setenv("PMIX_RANK", "0")  # a rank starts no ranks
    assert launcher.chosen_ranks(10**6, None) == 1


def test_a_launcher_of_another_mpi_is_not_taken(tmp_path, monkeypatch):
    """Its ranks would be alone, each by itself. Nor is one that does not start."""
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(launcher.sys, "executable", str(tmp_path / "python"))
    for name, said in (("mpirun", "mpirun (Another MPI) 1.0"), ("mpiexec", "".join(launcher.LAUNCHERS.values()))):
        (tmp_path / name).write_text(f"#!/bin/sh\necho '{said}'\n")
        assert launcher.launcher.__wrapped__() is None, "it cannot be executed"
        (tmp_path / name).chmod(0o755)
        assert launcher.launcher.__wrapped__() == (str(tmp_path / name) if name == "mpiexec" else None)


def test_under_mpirun_there_are_ranks_already(scene, tmp_path):
    (done,) = results_on((2,), pdvol_on_ranks, "run", scene, "--out", tmp_path / "run", "--ranks", 2)
    assert done["code"] == 2 and "leave out mpirun" in str(done["said"])


def test_a_busy_core_is_not_idle():
    assert 1 <= launcher.idle_cores() <= launcher.cores()


@pytest.mark.parametrize(
    ("vertices", "steps", "idle", "expected"),
    [
        ((60, 120, 260, 550, 1130), (120,) * 5, 2, True),  # ball_on_spike: 9.2 instead of 11.3 s on two cores
        ((60, 120, 260, 550, 1130), (120,) * 5, 1, False),
        ((60, 120), (20, 20), 2, False),  # over before a process has started
        ((3000, 90_000), (0, 200), 2, False),  # nothing is left of the coarse level
        ((3000, 90_000), (200, 0), 2, False),
        ((90_000,), (200,), 16, False),
    ],
)
def test_levels_are_marched_side_by_side_where_that_pays(vertices, steps, idle, expected, monkeypatch):
    monkeypatch.setattr(launcher, "idle_cores", lambda: idle)
    assert launcher.side_by_side(vertices, steps) == expected
