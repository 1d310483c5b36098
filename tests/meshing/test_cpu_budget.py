"""All work on a command's meshes shares one budget of processor time, and ends with one line where it is used up;
meshers in processes of their own may end early.
"""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from cli_scenes import pdvol
from pdvol import meshes
from pdvol.errors import MeshError
from pdvol.meshing import cpu_budget, tetrahedralise
from pdvol.meshing.child_process import Child
from pdvol.meshing.cpu_budget import BudgetSpent, ProcessStopped, Watch, check_budget
from pdvol.meshing.edge_length import MAX_ATTEMPTS, SizedMesh, mesh_of_target_size
from pdvol.processes import processor_use


def endless(*_given) -> None:
    while True:
        pass


def pause(seconds: float) -> np.ndarray:
    time.sleep(seconds)
    return np.arange(3)


def crash() -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def burn(seconds: float) -> None:
    """Use so much processor time [s] in this process."""
    end = time.process_time() + seconds
    while time.process_time() < end:
        sum(range(1000))


@pytest.fixture(scope="module")
def large_file(tmp_path_factory):
    """A ball whose reading takes longer than 0.2 s."""
    ball, path = meshes.ball(1.0, 6), tmp_path_factory.mktemp("large") / "ball.obj"
    with path.open("w") as file:
        np.savetxt(file, ball.vertices, "v %.9f %.9f %.9f")
        np.savetxt(file, ball.triangles + 1, "f %d %d %d")
    return path


def test_a_mesher_ends_with_the_budget_of_its_command():
    before = time.process_time()
    said = "^[^\n]*not done within the 0.5 s of processor time[^\n]*$"
    with pytest.raises(BudgetSpent, match=said), cpu_budget.cpu_budget(seconds=0.5), Child() as child:
        child.call("mesher", endless, cpu_seconds=60.0)
    assert time.process_time() - before < 0.5, "it was the child's time"


def test_this_process_and_calls_that_have_ended_count():
    with cpu_budget.cpu_budget(seconds=0.4):
        check_budget("mesh")
        with cpu_budget.cpu_budget(seconds=100.0):  # belongs to the outer one
            burn(0.5)
            with pytest.raises(BudgetSpent, match="^mesh: not done within the 0.4 s"):
                check_budget("mesh")
    check_budget("mesh")  # no budget is in force
    with cpu_budget.cpu_budget(seconds=0.4):
        subprocess.run([sys.executable, "-c", "import time\nwhile time.process_time() < 0.5: pass"], check=True)
        check_budget("mesh")  # a child of another kind
        with pytest.raises(BudgetSpent), Child() as child:
            child.call("mesher", burn, 0.5, cpu_seconds=60.0)
            check_budget("mesh")


def test_a_process_that_waits_is_told_from_one_that_works():
    with subprocess.Popen([sys.executable, "-c", "while True: pass"]) as busy:
        time.sleep(0.5)
        used = processor_use(busy.pid)[0]
        Watch(busy.pid).check("mesher")
        busy.kill()
    assert used > 0.0 and processor_use(busy.pid) == (0.0, False), "it is no longer there"


@pytest.mark.parametrize("command", ["check", "hierarchy", "repair"])
def test_every_command_on_a_mesh_has_a_budget(tmp_path, monkeypatch, large_file, capfd, command):
    monkeypatch.setattr(cpu_budget, "INPUT_SECONDS", 0.2)
    monkeypatch.setattr(cpu_budget, "SECONDS_PER_VERTEX", 0.0)
    more = {"check": (), "hierarchy": ("--levels", "100,300", "-o", "out"), "repair": ("-o", "out.obj")}
    monkeypatch.chdir(tmp_path)
    assert pdvol(command, large_file, *more[command]) == 2
    lines = [line for line in "".join(capfd.readouterr()).splitlines() if "not done within the 0.2 s of" in line]
    assert len(lines) == 1 and not list(tmp_path.iterdir()), lines


def test_a_child_takes_the_lower_one_of_its_limits():
    """A user may not raise the hard limit of a parent: the child has what is left of it, not a failure."""
    program = """
import os, resource, sys
from pdvol.processes import limit_processor_time
resource.setrlimit(resource.RLIMIT_CPU, (20, 21))
if os.geteuid() == 0:
    os.setuid(65534)
for seconds in (60, 5):
    limit_processor_time(seconds)
    print(*resource.getrlimit(resource.RLIMIT_CPU))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split("\n") == ["21 21", "6 21", ""]


def test_a_mesher_may_wait_and_its_end_is_named():
    with Child() as child:
        assert child.call("mesher", pause, 1.3, cpu_seconds=1.0).tolist() == [0, 1, 2]
        with pytest.raises(ProcessStopped, match="mesher used up its 1 s of processor time"):
            child.call("mesher", endless, cpu_seconds=1.0)
    with Child() as child, pytest.raises(MeshError, match=r"mesher crashed \(SIGSEGV\)") as caught:
        child.call("mesher", crash, cpu_seconds=5.0)
    assert not isinstance(caught.value, ProcessStopped), "it may be called again with another edge length"


@pytest.mark.parametrize(
    ("error", "calls", "said"),
    [
        (ProcessStopped("fTetWild used up its 31 s"), 1, "no mesh of about 50 vertices: fTetWild used up"),
        (MeshError("fTetWild crashed (SIGSEGV)"), MAX_ATTEMPTS, "no valid mesh of about 50 .*fTetWild crashed"),
    ],
)
def test_a_mesher_that_ends_early_is_called_again_only_after_a_crash(monkeypatch, error, calls, said):
    """With another edge length, which it may well take; its time is not spent twice."""
    lengths = []

    def end(vertices, triangles, edge_length, *_limits):
        lengths.append(edge_length)
        raise error

    monkeypatch.setattr(tetrahedralise, "ftetwild", end)
    with pytest.raises(MeshError, match=said) as caught:
        tetrahedralise.tetrahedralise(meshes.box(), 50)
    assert len(lengths) == len(set(lengths)) == calls and "\n" not in str(caught.value)


@pytest.mark.parametrize(("fine", "coarse"), [(3000, 100), (1800, 100), (3000, 600), (1800, 1800), (3000, 3000)])
def test_a_search_ends_never_repeats_a_scale_and_takes_the_closest(fine, coarse):
    scales = []

    def make(scale, failures):
        scales.append(scale)
        points = np.zeros((fine if scale < 0.5 else coarse, 3))
        return SizedMesh(points, np.zeros((0, 4), dtype=np.int64), points)

    closest = 1800 if fine == 1800 else 600
    if fine == 3000 and coarse != 600:
        with pytest.raises(MeshError, match="1000 vertices cannot be had, the closest mesh has"):
            mesh_of_target_size(make, 1000, "steps", 1.0, 3)
    else:
        assert len(mesh_of_target_size(make, 1000, "steps", 1.0, 3).points) == closest
    assert len(scales) == len(set(scales)) == {1800: 3, 3000: 2}.get(coarse, MAX_ATTEMPTS)
