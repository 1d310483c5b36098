"""`pdvol.run` of a scene in memory: the run it gives, levels, refinement, temporary folders, progress, messages."""

import gc
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import small

import pdvol
from killing import HELPERS
from on_ranks import results_on
from pdvol import ConvergenceError, InputError
from pdvol.cli import run as command_line
from pdvol.runs.march import levels_asked
from pdvol.runs.scene_file import IN_MEMORY

FOLDERS = [str(Path(small.__file__).parent), HELPERS]


def test_a_run_is_what_open_run_gives(tmp_path):
    run = pdvol.run(small.scene(), tmp_path / "run")
    assert type(run) is type(pdvol.open_run(tmp_path / "run"))
    assert [level.steps for level in run.levels] == [5, 5]
    assert run.info["scene"] == "square" and run.info["scene_file"] == "" and run.info["state"] == "done"
    assert repr(run) == f"Run({str(tmp_path / 'run')!r}, vertices=[9, 25], done)"
    assert repr(run.levels[1]) == "RunLevel(1, vertices=25, cells=32, steps=5, done)"
    assert repr(run.levels[1].mesh) == "LevelMesh(points=(25, 2), cells=(32, 3), bodies=1)"
    assert (tmp_path / "run" / "level_1.xdmf").exists()


def test_a_temporary_run_lives_as_long_as_its_object():
    run = pdvol.run(small.scene(), levels=0, steps=2)
    folder, level = run.path, run.levels[0]
    assert len(run.levels) == 1 and level.steps == 3
    del run
    gc.collect()
    assert level.positions(2).shape == (9, 2)  # a level keeps its run
    del level
    gc.collect()
    assert not folder.exists()


def test_a_temporary_run_goes_with_the_process():
    program = f"import sys; sys.path[:0] = {FOLDERS!r}; import pdvol, small\n"
    program += "run = pdvol.run(small.scene(), levels=0, steps=1); print(run.path)"
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
    assert ended.returncode == 0, ended.stderr
    assert ended.stderr == "" and not Path(ended.stdout.strip()).exists()


def test_ways_to_name_levels():
    for levels in (1, (0, 1), [0, 1], range(2), "0:1", ":1", "1", np.int64(1)):
        assert levels_asked(levels) == (0, 1)
    assert levels_asked(None) == levels_asked("0:") == (0, None)
    run = pdvol.run(small.scene(3), method="direct", prolongation="phong", levels="0:1", steps=1)
    assert (run.info["method"], run.info["prolongation"], len(run.levels)) == ("direct", "phong", 2)


def test_progress_on_a_stream_with_stages(capsys, monkeypatch):
    monkeypatch.setattr("pdvol.runs.stage_lines.SHOWN_SECONDS", 0.0)
    pdvol.run(small.scene(), steps=2, progress=True)
    out, err = capsys.readouterr()
    lines = [line for line in err.splitlines() if line.startswith("level ")]
    said = ("  step 1/2  ", "  step 2/2  ", ": 0.04 s of ")
    assert [line[:19] for line in lines] == [f"level {level}{words}" for level in (0, 1) for words in said]
    assert "\npreparing level 0: " in err and out == ""
    pdvol.run(small.scene(), steps=1)
    pdvol.run(small.scene(), steps=1, progress=False)
    assert capsys.readouterr() == ("", "")


def test_progress_as_a_function():
    seen = []
    pdvol.run(small.scene(), steps=2, progress=seen.append)
    assert [(record["level"], record["step"]) for record in seen] == [(0, 1), (0, 2), (1, 1), (1, 2)]
    assert all(record["newton_iterations"] > 0 and record["seconds"]["total"] > 0.0 for record in seen)


@pytest.mark.parametrize(
    "message, wrong",
    [
        ("takes a pdvol.Scene, not str", {"scene": "drop.py"}),
        ("out = 5 must be the path of a folder", {"out": 5}),
        ("levels 0:2 do not exist; the scene has levels 0:1", {"levels": 2}),
        ("levels 1:0 do not exist", {"levels": (1, 0)}),
        ("levels = 'fine' cannot be read", {"levels": "fine"}),
        ("levels = (0, 1, 2) cannot be read", {"levels": (0, 1, 2)}),
        ("levels = True cannot be read", {"levels": True}),
        ("levels = 0.5 cannot be read", {"levels": 0.5}),
        ("must be levels in a row", {"levels": range(0, 4, 2)}),
        ("level 1 is refined from level 0, and", {"levels": (1, 1)}),
        ("unknown method 'fast'; choose one of progressive", {"method": "fast"}),
        ("unknown prolongation 3; choose one of barycentric", {"prolongation": 3}),
        ("steps = 2.5 is not a whole number", {"steps": 2.5}),
        ("progress = 'yes' must be True, None or a function", {"progress": "yes"}),
        ("needs a weight above zero, as in Penalty(weight=0.1)", {"method": "tracks"}),
        ("resume needs the folder of a stored run", {"resume": True}),
    ],
)
def test_bad_arguments_are_refused_in_one_line(message, wrong):
    with pytest.raises(InputError) as caught:
        pdvol.run(**{"scene": small.scene(), **wrong})
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_a_folder_with_a_run_is_left_alone(tmp_path, capsys):
    pdvol.run(small.scene(), tmp_path / "run", levels=0, steps=1)
    with pytest.raises(InputError, match="already holds a run; go on with it by --resume .resume=True."):
        pdvol.run(small.scene(), tmp_path / "run")
    with pytest.raises(InputError, match=r"another scene \(scene.bodies\[0\].material.young: 10000.0 -> 20000.0\)"):
        pdvol.run(small.scene(young=2e4), tmp_path / "run", resume=True)
    assert command_line(["refine", str(tmp_path / "run"), "--to", "1"]) == 2
    assert capsys.readouterr().err == f"pdvol: {tmp_path / 'run'}: {IN_MEMORY}\n"


def test_a_scene_file_takes_over_and_is_kept(tmp_path):
    """A scene file that makes the same scene can continue a run from memory. The run keeps the name of the file when
    the scene from memory continues it later.
    """
    pdvol.run(small.scene(), tmp_path / "run", levels=0, steps=1)
    file = tmp_path / "square.py"
    file.write_text(f"import sys; sys.path[:0] = {FOLDERS!r}\nfrom small import scene\n")
    assert command_line(["run", str(file), "--steps", "1", "--out", str(tmp_path / "run"), "--resume"]) == 0
    stored = lambda: json.loads((tmp_path / "run" / "run.json").read_text())["scene_file"]
    assert stored() == str(file)
    assert len(pdvol.run(small.scene(), tmp_path / "run", resume=True, steps=2).levels) == 2
    assert stored() == str(file)
    pdvol.run(small.scene(3), tmp_path / "run", resume=True, steps=2)  # the file does not make this level
    assert stored() == ""


def test_finished_steps_of_a_run_that_fails_are_kept():
    pulled = pdvol.Scene(
        bodies=small.scene().bodies,
        supports=(pdvol.Support(lambda X: X[:, 1] > 0.9, motion=late_pull),),
        dt=0.02,
        steps=6,
        solver=pdvol.Solver(max_iterations=1, max_halvings=0),
    )
    with pytest.raises(ConvergenceError) as caught:
        pdvol.run(pulled, levels=0)
    (note,) = caught.value.__notes__
    assert note.startswith("finished steps are kept until this process ends: pdvol.open_run('")
    run = pdvol.open_run(note.split("'")[1])
    assert 1 < run.levels[0].steps < 7 and run.info["state"] == "failed"


def late_pull(X, t):
    """Still for two steps, then a pull that one Newton iteration cannot follow."""
    return X + [0.0, 40.0 * max(0.0, t - 0.04)]


def run_twice(comm, out):
    with pytest.raises(InputError, match="several ranks need a run folder"):
        pdvol.run(small.scene())
    seen = []
    run = pdvol.run(small.scene(), out, steps=2, progress=seen.append)
    assert [level.steps for level in run.levels] == [3, 3]
    return {"seen": comm.gather(len(seen))}


@pytest.mark.mpi
def test_on_two_ranks(tmp_path):
    (found,) = results_on((2,), run_twice, tmp_path / "run")
    assert found["seen"].tolist() == [4, 0]
