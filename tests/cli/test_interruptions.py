"""Interruptions of a run: SIGKILL at any instant, a full disk, a read-only folder, a second process, and a scene that
has changed meanwhile.
"""

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import meshio
import numpy as np
import pytest

from cli_scenes import CUBE_OFF, FALL, SQUARE, pdvol, pdvol_on_ranks, write
from commands import SAFETY
from killing import HELPERS, PressesCtrlC
from on_ranks import results_on
from pdvol import open_run
from pdvol.runs import mending, mesh_hierarchy, preflight, runner, shape_check
from pdvol.runs.runner import Execution, run_scene
from pdvol.runs.scene_file import load_shot
from pdvol.studio.draw import picture

RUN = f"""
import sys
sys.path.insert(0, {HELPERS!r})
from killing import FileOperations
from pdvol.runs.runner import run_scene
from pdvol.runs.scene_file import load_shot
operations = FileOperations(sys.argv[1], int(sys.argv[2]))
run_scene(load_shot("clutter.py"), sys.argv[1], resume=True)
print(operations.count)
"""
CLUTTER = (
    SQUARE
    + '''

def scene(steps=12, sizes=(3, 6)):
    """Two squares and a stone: surfaces in contact, friction, and a level above the first."""
    place = lambda x, y, angle: Placement(translate=(x, y), angle=angle, scale=0.5)
    shape, soft = tuple(square(n) for n in sizes), NeoHookean(3e4)
    stone = Rigid(Outline(np.array([(0.6, 0.1), (0.9, 0.1), (0.75, 0.35)])), name="stone")
    return Scene(
        bodies=tuple(Body(shape, soft, name=f"square {i}", velocity=(0.2 - 0.4 * i, -0.5), placement=place(*at))
                     for i, at in enumerate([(0.0, 0.03, 0.02), (0.1, 0.6, 0.3)])),
        obstacles=(Plane((0.0, 0.0), (0.0, 1.0)), stone),
        loads=(Gravity((0.0, -9.81)),),
        contact=(Barrier(Relative(3e-3)), Friction(0.3)),
        dt=0.02, steps=steps)
'''
)
CLUTTER = CLUTTER.replace("from pdvol import Barrier", "from pdvol import Relative, Barrier")


def kept(run: Path) -> dict:
    """Everything of a run that must not depend on interruptions: states as bytes, and the log without what differs from
    time to time.
    """
    lines = [json.loads(line) for line in (run / "log.jsonl").read_text().splitlines()]
    log = [{key: value for key, value in line.items() if key not in ("seconds", "peak_memory_mb")} for line in lines]
    files = [path for path in (run / "levels").rglob("*") if path.suffix in (".bin", ".npy", ".npz")]
    return {"log": log, **{str(path.relative_to(run)): path.read_bytes() for path in sorted(files)}}


# ---- kills


@pytest.fixture(scope="module")
def clutter(tmp_path_factory):
    """A scene file, and its run that nothing interrupted with the number of its file operations."""
    folder = tmp_path_factory.mktemp("clutter")
    write(folder / "clutter.py", CLUTTER)
    done = simulated(folder, "whole")
    assert done.returncode == 0, done.stderr
    whole = open_run(folder / "whole")
    assert [level.steps for level in whole.levels] == [13, 13] and max(r["contacts"] for r in whole.levels[1].log) > 3
    return folder, int(done.stdout)


def simulated(folder: Path, out: str, deadly: int = 0) -> subprocess.CompletedProcess:
    """A process that simulates, or goes on, until it is killed before the file operation of number `deadly`, if any."""
    return subprocess.run(
        [sys.executable, "-c", RUN, out, str(deadly)], cwd=folder, capture_output=True, text=True, timeout=SAFETY
    )


def killed_at_random(folder: Path, operations: int, instants: int, kills: int, seed: int) -> list[str]:
    """Kills runs before random file operations, `kills` times each, and goes on until they are done, all compared with
    the whole one; what the kills left.
    """
    rng, found = np.random.default_rng(seed), []
    expected = kept(folder / "whole")
    for instant in range(instants):
        out, interrupted = folder / f"run{instant}", 0
        while True:
            deadly = int(rng.integers(1, operations // kills)) if interrupted < kills else 0
            done = simulated(folder, out.name, deadly)
            if done.returncode != -signal.SIGKILL:  # the end, or fewer operations were left
                assert done.returncode == 0, done.stderr
                break
            interrupted += 1
            found.append(state_of(out))
        assert kept(out) == expected, f"instant {instant}, killed {interrupted} times"
        assert not [p for p in out.rglob("*") if p.name.endswith(".tmp")]
        shutil.rmtree(out)
    return found


def state_of(out: Path) -> str:
    """How far a killed run had come: usable whatever the instant."""
    if not (out / "run.json").exists():
        return "nothing"
    if json.loads((out / "run.json").read_text())["state"] == "creating":
        return "creating"
    run = open_run(out)
    for level in run.levels:
        for step in range(level.steps):
            assert np.isfinite(level.positions(step)).all()
        xdmf = out / f"level_{level.index}.xdmf"
        if xdmf.exists():
            with meshio.xdmf.TimeSeriesReader(xdmf) as reader:
                reader.read_points_cells()
                assert 1 <= reader.num_steps <= level.steps
                reader.read_data(reader.num_steps - 1)
    return f"level {len([level for level in run.levels if level.steps]) - 1}"


@pytest.mark.parametrize("instants", [1, pytest.param(50, marks=pytest.mark.slow)])
def test_killed_at_random_instants(clutter, instants):
    found = killed_at_random(*clutter, instants, 2, seed=instants)
    assert len(found) >= 2 and (instants == 1 or {"level 0", "level 1"} <= set(found)), found


def test_killed_while_the_folder_is_made(tmp_path):
    write(tmp_path / "fall.py", FALL)
    assert pdvol("run", tmp_path / "fall.py", "--steps", 2, "--out", tmp_path / "whole") == 0
    for more in ((), ("--resume",)):
        out = tmp_path / f"run{len(more)}"
        shutil.copytree(tmp_path / "whole", out)
        info = json.loads((out / "run.json").read_text())
        (out / "run.json").write_text(json.dumps({**info, "state": "creating", "levels": info["levels"][:1]}))
        assert pdvol("run", tmp_path / "fall.py", "--steps", 2, "--out", out, *more) == 0
        assert kept(out) == kept(tmp_path / "whole")


def test_an_interrupted_run_says_so(tmp_path):
    scene, out = write(tmp_path / "fall.py", FALL), tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        run_scene(load_shot(scene), out, how=Execution(progress=PressesCtrlC(2)))
    run = open_run(out)
    assert run.info["state"] == run.levels[0].info["state"] == "interrupted" and run.levels[0].steps == 3
    assert pdvol("run", scene, "--out", out, "--resume") == 0 and open_run(out).info["state"] == "done"


# ---- disks


@pytest.fixture(scope="module")
def fine(tmp_path_factory):
    """A folder with a scene file, and its run on a finer level that nothing interrupted: the words for another one."""
    folder = tmp_path_factory.mktemp("fine")
    words = ["run", write(folder / "fall.py", FALL), "--set", "sizes=(2, 8)", "--no-xdmf"]
    assert pdvol(*words, "--out", folder / "whole") == 0  # compiles what there is to compile
    return words, folder / "whole"


@pytest.mark.parametrize(("limit", "file"), [(1000, "run.json"), (5000, "mesh.npz"), (12_000, "log.jsonl")])
def test_files_that_may_not_grow(tmp_path, fine, capfd, limit, file):
    """As on a full disk: a limit stops one of the files in the middle of a write. All before it is kept."""
    words, whole = fine
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        code = pdvol(*words, "--out", tmp_path / "run")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    err = capfd.readouterr().err
    assert code == 1 and "Traceback" not in err and f"/{file}: " in err.splitlines()[-1]
    assert err.splitlines()[-1].startswith("pdvol: cannot write ") and err.endswith("stored before it is kept\n"), err
    stored = open_run(tmp_path / "run").levels if file == "log.jsonl" else ()  # else there is no step
    for level, its in zip(stored, open_run(whole).levels, strict=False):
        for step in range(level.steps):
            np.testing.assert_array_equal(level.positions(step), its.positions(step))
    assert pdvol(*words, "--out", tmp_path / "run", "--resume") == 0
    assert kept(tmp_path / "run") == kept(whole)


def test_a_folder_without_permission_is_noticed_first(tmp_path, capfd, monkeypatch):
    """Before anything is meshed, read, drawn or measured, as on a disk that is mounted to be read."""
    scene, sound = write(tmp_path / "fall.py", FALL), tmp_path / "sound"
    cube = write(tmp_path / "cube.off", CUBE_OFF)
    assert pdvol("run", scene, "--levels", 0, "--steps", 2, "--out", sound) == 0
    shutil.copytree(sound, tmp_path / "locked" / "run")
    locked, access = tmp_path / "locked", os.access
    monkeypatch.setattr(os, "access", lambda path, mode: locked not in (path, *path.parents) and access(path, mode))
    for module in (runner, preflight, shape_check, mesh_hierarchy, mending):
        for name in ("prepared_levels", "check_scene", "check_meshes", "read_with_notes"):
            monkeypatch.setattr(module, name, None, raising=False)
    monkeypatch.setattr(picture, "composed", None)
    monkeypatch.setattr(runner, "_prepare", None)
    for words in (
        ["run", scene, "--steps", 2, "--out", locked / "run", "--resume"],
        ["refine", locked / "run", "--to", 1],
        ["run", scene, "--out", locked / "other"],
        ["preview", scene, "--out", locked / "other"],
        ["check", scene, "-o", locked / "levels"],
        ["check", cube, "--json", locked / "found.json"],
        ["hierarchy", cube, "--levels", "8,20", "-o", locked / "levels"],
        ["repair", cube, "-o", locked / "mended" / "cube.off"],
        ["render", sound, "-o", locked / "picture.png"],
        ["play", sound, "-o", locked / "player.html"],
        ["export", sound, "--format", "xdmf", "-o", locked / "out"],
        ["metrics", locked / "run"],
    ):
        capfd.readouterr()
        assert pdvol(*words) == 2, words
        err = capfd.readouterr().err.strip()
        assert err.startswith("pdvol: ") and "\n" not in err and "cannot be written" in err, err


# ---- two processes


HOLD = """
import sys
from pdvol.store.writer import RunWriter
with RunWriter.open(sys.argv[1]):
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.mark.mpi
def test_a_second_process_is_refused_and_a_stale_lock_is_not(tmp_path):
    write(tmp_path / "fall.py", FALL)
    assert pdvol("run", tmp_path / "fall.py", "--levels", 0, "--steps", 1, "--out", tmp_path / "run") == 0
    words = ["run", tmp_path / "fall.py", "--steps", 2, "--out", tmp_path / "run", "--resume"]
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path / "run")], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as holder:
        assert holder.stdout.readline() == "held\n"
        before = kept(tmp_path / "run")
        for ended in results_on((1, 2), pdvol_on_ranks, *words):
            said = str(ended["said"])
            assert ended["code"] == 2, said
            (line,) = [line for line in said.splitlines() if not line.startswith("loading ")]  # on a busy machine
            assert "run is being written by another pdvol" in line
        assert kept(tmp_path / "run") == before
        holder.kill()
    assert (tmp_path / "run" / "run.lock").exists()
    (ended,) = results_on((2,), pdvol_on_ranks, *words)
    assert ended["code"] == 0, ended["said"]
    assert [level.steps for level in open_run(tmp_path / "run").levels] == [3, 3]


# ---- a scene that has changed


def test_a_change_of_the_finest_level_keeps_the_coarser_ones(tmp_path, capfd):
    scene, out = write(tmp_path / "fall.py", FALL), tmp_path / "run"
    assert pdvol("run", scene, "--steps", 2, "--out", out) == 0
    coarse = {p: p.stat().st_mtime_ns for p in (out / "levels" / "0").iterdir()}
    again = ["run", scene, "--steps", 2, "--out", out, "--resume", "--set"]
    capfd.readouterr()
    assert pdvol(*again, "sizes=(2, 3)", "--levels", 0) == 2, "level 1 would be lost for nothing"
    assert "levels from 1 on have changed" in capfd.readouterr().err and open_run(out).levels[1].steps == 3
    assert pdvol(*again, "sizes=(2, 3)") == 0
    run = open_run(out)
    assert [len(level.rest) for level in run.levels] == [9, 16] and [level.steps for level in run.levels] == [3, 3]
    assert [len(level.log) for level in run.levels] == [2, 2]
    assert pdvol(*again, "sizes=(2, 3, 5)") == 0  # a level added
    assert [len(level.rest) for level in open_run(out).levels] == [9, 16, 36]
    assert pdvol("run", scene, "--set", "sizes=(2, 3, 5)", "--steps", 2, "--out", tmp_path / "anew") == 0
    assert kept(out) == kept(tmp_path / "anew")
    assert {p: p.stat().st_mtime_ns for p in coarse} == coarse
    assert pdvol("refine", out, "--to", 2) == 0  # the run knows its scene by its new parameters


# ---- damage


SLOWLY = [pytest.param(damage, marks=pytest.mark.slow) for damage in ("deleted", "noise")]


@pytest.mark.parametrize("damage", ["truncated", "log", "exports", *SLOWLY])
def test_a_damaged_run_is_repaired_by_going_on(tmp_path, damage):
    scene, out = write(tmp_path / "fall.py", FALL), tmp_path / "run"
    assert pdvol("run", scene, "--steps", 4, "--out", tmp_path / "whole") == 0
    shutil.copytree(tmp_path / "whole", out)
    file = out / "levels" / "0" / "states.bin"
    begin, data = file.stat().st_size * 2 // 5, file.read_bytes()  # in step 2 of 0 to 4
    if damage == "deleted":
        file.unlink()
    elif damage == "log":
        (out / "log.jsonl").unlink()
    elif damage == "exports":
        for name in ("level_0.h5", "level_1.xdmf"):
            (out / name).write_bytes((out / name).read_bytes()[:500])
    else:
        file.write_bytes(data[:begin] + (b"" if damage == "truncated" else b"noise" * 4 + data[begin + 20 :]))
    assert pdvol("run", scene, "--steps", 4, "--out", out, "--resume") == 0
    repaired, whole = kept(out), kept(tmp_path / "whole")
    if damage == "log":
        repaired["log"] = whole["log"]
    repaired["log"].sort(key=lambda record: (record["level"], record["step"]))  # level 0 was repaired last
    assert repaired == whole
    for level in range(2):
        with meshio.xdmf.TimeSeriesReader(out / f"level_{level}.xdmf") as reader:
            points, _ = reader.read_points_cells()
            _, fields, _ = reader.read_data(4)
        moved = points[:, :2] + fields["displacement"][:, :2]
        np.testing.assert_allclose(moved, open_run(out).levels[level].positions(4), atol=1e-15)
