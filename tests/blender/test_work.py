"""pdvol at work for Blender's extension: processes that end with whoever began them, progress, caches, and sessions."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest

from blender.shot.description import ShotError
from blender.shot.files import read_pc2
from blender.shot.scene_text import write_shot
from blender.work import commands
from blender.work.play import Played, make_caches, played_frames, to_object, write_objects
from blender.work.process import Process, with_settings
from blender.work.progress import RunProgress
from blender.work.session import Ended, Frames, Session, Task, forget_run
from blender.work.stored import findings, stored_levels, stored_settings, variations
from blender_shots import places, two_bodies
from commands import SAFETY
from pdvol.cli import parse
from pdvol.errors import MeshError
from pdvol.meshing.validate import check_manifold

PDVOL = [sys.executable, "-m", "pdvol"]
CHILDREN = """
import subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
print(child.pid, flush=True)
{ignored}
time.sleep(600)
"""
IGNORES = "import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN)"


def until(holds, what: str, seconds: float = SAFETY) -> None:
    """Wait for something."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, what
        time.sleep(0.02)


def gone(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return True


# ---- processes


def test_a_process_says_what_it_prints_and_how_it_ends(tmp_path):
    process = Process(
        [sys.executable, "-c", "import sys; print('one'); print('pdvol: no'); sys.exit(2)"], tmp_path / "l"
    )
    assert process.wait(SAFETY) == 2 and process.code == 2
    assert process.lines() == ["one", "pdvol: no"] and process.reason() == "no"
    again = Process([sys.executable, "-c", "print('two')"], tmp_path / "l")
    assert again.wait(SAFETY) == 0 and again.lines() == ["two"]
    missing = Process([str(tmp_path / "none")], tmp_path / "l")
    assert missing.wait(SAFETY) == 127 and missing.reason().startswith("cannot run")


@pytest.mark.parametrize("ignored", ["", IGNORES], ids=["obeys", "ignores the request"])
def test_a_cancelled_process_leaves_nothing_behind(tmp_path, ignored):
    process = Process([sys.executable, "-c", CHILDREN.format(ignored=ignored)], tmp_path / "log")
    until(lambda: process.lines(), "it has not begun")
    child = int(process.lines()[0])
    parent = psutil.Process(child).ppid()
    process.cancel()
    assert process.code is not None
    until(lambda: gone(child) and gone(parent), "something was left behind")


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM], ids=["killed", "ended"])
def test_a_process_ends_with_a_blender_that_crashes(tmp_path, number):
    """Blender is a process here that begins one as the extension does, and is killed."""
    program = (
        f"import sys, time; sys.path.insert(0, {str(Path(__file__).resolve().parents[2])!r});"
        "from pathlib import Path; from blender.work.process import Process;"
        f"p = Process([sys.executable, '-c', {CHILDREN.format(ignored='')!r}], Path({str(tmp_path / 'log')!r}));"
        "time.sleep(600)"
    )
    blender = subprocess.Popen([sys.executable, "-c", program])
    log = tmp_path / "log"
    until(lambda: log.exists() and log.read_text().strip(), "it has not begun")
    child = int(log.read_text())
    parent = psutil.Process(child).ppid()
    os.kill(blender.pid, number)
    blender.wait(SAFETY)
    until(lambda: gone(child) and gone(parent), "something was left behind")


# ---- progress


def test_progress_settings_variations_and_defects_are_read(tmp_path):
    progress = RunProgress(tmp_path)
    assert not progress.look() and progress.line() == "" and stored_levels(tmp_path) == {}
    (tmp_path / "run.json").write_text(json.dumps({"steps": 4, "parameters": {"mu": 0.5}}))
    log = tmp_path / "log.jsonl"
    log.write_text('{"level": 0, "step": 1}\n{"level": 0, "st')
    assert progress.look() and progress.reached == {0: 1} and progress.line() == "level 0, step 1 of 4"
    assert not progress.look()
    with open(log, "a") as file:
        file.write('ep": 2}\n{"level": 1, "step": 1}\nnothing\n')
    assert progress.look() and progress.reached == {0: 2, 1: 1} and progress.fraction(0) == 0.5
    log.write_text('{"level": 0, "step": 1}\n')  # a new preview in the same folder
    assert progress.look() and progress.reached == {0: 1}
    assert stored_settings(tmp_path) == {"mu": "0.5"}
    entries = [
        {"number": 0, "state": "done", "changes": {"mu": "0.1"}},
        {"number": 1, "state": "failed", "changes": {}},
    ]
    (tmp_path / "wedge.json").write_text(json.dumps({"variations": entries}))
    assert variations(tmp_path) == {0: {"mu": "0.1"}} and variations(tmp_path / "none") == {}
    with pytest.raises(MeshError) as refused:
        check_manifold(np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3]]), 4, "box")
    (tmp_path / "check.json").write_text(json.dumps({"defects": [str(refused.value)]}))
    ((line,), notes) = findings(tmp_path / "check.json")
    assert line.endswith("; tick Close holes (sidebar, Object)") and line.startswith("box: the surface is open")
    assert with_settings("a.obj: open; --hole 2.31 closes it") == "a.obj: open; Widest hole 2.31 closes it"
    assert notes == []


def test_command_lines_are_pdvols():
    scene, run = Path("shot.py"), Path("run")
    for words in (
        commands.check(scene, Path("check.json")),
        commands.preview(scene, run),
        commands.refine(run, 2),
        commands.resume(scene, run, 1, {"mu": "0.5"}),
        commands.branch(scene, run, 4, Path("other"), 1),
        commands.wedge(scene, Path("w"), "mu", 0.1, 0.9, 5),
        commands.pick(Path("w"), 3, run),
        commands.export(run, 1, 24.0, Path("out")),
        commands.repair(Path("a.obj"), Path("b.obj"), 2.5),
    ):
        assert parse(words).command == words[0]
    assert parse(commands.wedge(scene, Path("w"), "mu", 0.1, 0.9, 5)).vary == ["mu=0.1:0.9:5"]


# ---- caches


def test_points_of_the_scene_become_an_objects_own():
    """By hand: an object of twice the size that stands at (1, 0, 0), turned by a quarter about z; centimetres."""
    world = np.array([[0, -2, 0, 1], [2, 0, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1]], dtype=float)
    own = np.array([[0.5, 0.0, 0.25]])
    metres = 0.01 * np.array([[1.0, 1.0, 0.5]])  # (1, 0, 0) + 2 turned (0.5, 0, 0.25)
    assert to_object(metres[None], [world.tolist()], 0.01)[0] == pytest.approx(own)
    moved = np.eye(4)
    moved[2, 3] = 3.0
    both = to_object(np.zeros((3, 1, 3)), [np.eye(4).tolist(), moved.tolist()], 1.0)
    assert both[:, 0, 2].tolist() == [0.0, -3.0, -3.0]  # the last matrix holds from then on


# ---- sessions


def run_to_end(session: Session, seconds: float = SAFETY) -> list:
    events: list = []

    def ended() -> bool:
        events.extend(session.tick())
        return not session.busy

    until(ended, f"{session.message} does not end", seconds)
    return events


@pytest.fixture(scope="module")
def previewed(tmp_path_factory):
    """A preview of the shot of two bodies, refined, as buttons set it off; its files, and what sessions said."""
    at = places(tmp_path_factory.mktemp("session"))
    write_shot(two_bodies(), at)
    still = [np.eye(4).tolist()]
    write_objects(at.play(1), [Played("bar", "the bar", 1, 1.0, still), Played("ball", "Ball.001", 2, 1.0, still)])
    session = Session()
    said = []
    for task in (
        Task("Preview", [commands.preview(at.scene, at.run(1))], 1),
        Task("Refine", [commands.refine(at.run(1), 1)], 1),
    ):
        session.start(task, at, PDVOL, 24.0)
        assert session.busy
        said.append(run_to_end(session))
    return at, said


def test_a_preview_and_its_refinement_become_caches_for_blender(previewed):
    at, (preview, refine) = previewed
    assert preview[-1] == Ended(preview[-1].task, "", preview[-1].lines) and Frames(1, 0, 4) in preview
    assert isinstance(refine[-1], Ended) and not refine[-1].error and Frames(1, 1, 4) in refine
    assert stored_levels(at.run(1)) == {0: 6, 1: 6}
    assert [played_frames(at, 1, level) for level in (0, 1, 2)] == [4, 4, 0]
    shot = two_bodies()
    for level in (0, 1):
        assert read_pc2(at.caches(1, level) / "ball_render.pc2")[0] == pytest.approx(
            shot.bodies[1].rendered.points, abs=1e-6
        )
    assert not (at.folder / "export").exists()


def test_a_cancelled_preview_keeps_its_steps_and_goes_on(previewed, tmp_path):
    at, session = places(tmp_path), Session()
    write_shot(two_bodies(frames=12), at)
    write_objects(at.play(1), [])
    session.start(Task("Preview", [commands.preview(at.scene, at.run(1))], 1), at, PDVOL, 24.0)

    def begun() -> bool:
        session.tick()
        return session.progress.reached.get(0, 0) >= 2

    until(begun, "no step was stored")
    session.cancel()
    assert not session.busy and session.message == "Preview: cancelled"
    assert 2 <= stored_levels(at.run(1))[0] < 24
    session.start(Task("Resume", [commands.resume(at.scene, at.run(1), 0, {})], 1), at, PDVOL, 24.0)
    assert run_to_end(session)[-1].error == "" and stored_levels(at.run(1)) == {0: 24}
    forget_run(at, 1)
    assert not at.run(1).exists() and at.run_numbers() == []


def test_a_step_that_lasts_says_how_far_it_is(previewed):
    """As pdvol prints it, until the step is stored; a line about a finished step adds nothing to the run's folder."""
    at, session = previewed[0], Session()
    for last, shown in (
        ("level 0  step 6/6  newton 4  0.1 s", "level 1, step 6 of 6"),
        ("level 1  step 7/9  newton 45  gap 1e-04  4.0 s so far",) * 2,
    ):
        program = f"import time; print({last!r}, flush=True); time.sleep(600)"
        session.start(Task("Refine", [["-c", program]], 1), at, [sys.executable], 24.0)
        session._exported = {0: 6, 1: 6}  # nothing is new

        def said(expected=f"Refine: {shown}") -> bool:
            session.tick()
            return session.message == expected

        until(said, f"{session.message}")
        session.cancel()


def test_a_mistake_ends_a_task_in_one_line(tmp_path):
    at, session = places(tmp_path), Session()
    session.start(Task("Check", 2 * [commands.check(at.scene, at.findings)]), at, PDVOL, 24.0)
    (event,) = run_to_end(session)
    assert event.error.startswith("there is no scene file") and "\n" not in event.error
    assert session.message == f"Check: {event.error}"
    assert sum("there is no scene file" in line for line in event.lines) == 1  # the second step was not begun
    write_objects(at.play(1), [Played("bar", "Bar", 1, 1.0, [np.eye(4).tolist()])])
    with pytest.raises(OSError):  # an export of something else
        make_caches(at, at.folder / "export", 1, 0)


def test_pip_gets_a_file_and_never_a_name(tmp_path, monkeypatch):
    """Also where a folder of that name lies in the working folder: pip would take `pdvol[solver]` for a name."""
    with pytest.raises(ShotError, match="give a wheel or a checkout"):
        commands.install_source("", tmp_path)
    wheel = tmp_path / "pdvol-0.3.0-py3-none-any.whl"
    wheel.touch()
    assert commands.install_source(" ", tmp_path) == f"{wheel}[solver]"
    (tmp_path / "pdvol").mkdir()
    monkeypatch.chdir(tmp_path)
    assert commands.install_source("pdvol[solver]", tmp_path) == f"{tmp_path / 'pdvol'}[solver]"
    pinned = "https://example.org/pdvol-0.3.0-py3-none-any.whl#sha256=" + 64 * "0"
    assert commands.install_source(pinned, tmp_path) == pinned
    names = "pdvol-solver pdvol==0.3 pdvol3[solver] --index-url=http://example.org git+x".split()
    for name in (*names, pinned[:50]):
        with pytest.raises(ShotError, match="give a wheel or a checkout"):
            commands.install_source(name, tmp_path)
