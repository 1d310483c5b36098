"""What lasts before the first step is shown: in logs as plain lines, on terminals in a line that is rewritten, by one
rank, on standard error.
"""

import io
import re
import shutil
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from cli_scenes import CUBE, CUBE_OFF, FALL
from cli_scenes import pdvol as pdvol_command
from commands import SAFETY
from pdvol import Body, NeoHookean, Scene, cli
from pdvol.meshes import Outline
from pdvol.meshing.build import build_levels
from pdvol.runs import stage_lines
from pdvol.runs.stage_lines import StageLines
from pdvol.stages import Stage, reported_to, say, stage


class Kept:
    """A reporter that keeps the stages that have ended."""

    def __init__(self):
        self.ended: list[Stage] = []
        self.begin, self.end = lambda one: None, self.ended.append


def test_stages_nest_and_their_parts_add_up():
    kept = Kept()
    with reported_to(kept):
        with stage("preparing"):
            for _ in range(2):
                with stage("compiling"):
                    time.sleep(0.02)
            say("two forms")
        with pytest.raises(ValueError), stage("checking"):
            raise ValueError
    first, second = kept.ended
    found = first.name, first.detail, list(first.parts), first.failed
    assert found == ("preparing", "two forms", ["compiling"], False)
    assert 0.04 <= first.parts["compiling"] <= first.seconds
    assert (second.name, second.failed) == ("checking", True)
    with stage("nobody looks"):
        say("nothing")
    assert len(kept.ended) == 2


def test_a_log_gets_a_line_for_what_took_long_and_none_for_the_rest(monkeypatch):
    monkeypatch.setattr(stage_lines, "SHOWN_SECONDS", 0.1)
    log = io.StringIO()
    with reported_to(StageLines(log)):
        with stage("quick"):
            pass
        with stage("slow"), stage("its part"):
            time.sleep(0.15)
        with pytest.raises(KeyError), stage("ended by an error, which has its own line"):
            time.sleep(0.15)
            raise KeyError
    assert re.fullmatch(r"slow: 0\.\d s \(its part 0\.\d s\)\n", log.getvalue())


def test_a_log_is_not_silent_while_a_stage_lasts(monkeypatch):
    monkeypatch.setattr(stage_lines, "LONG_SECONDS", 0.1)
    monkeypatch.setattr(stage_lines, "_REWRITTEN_EVERY", 0.02)
    log, other = io.StringIO(), io.StringIO()
    with reported_to(StageLines(log)), stage("meshing"):
        say("try 3")
        time.sleep(0.6)
    lines = log.getvalue().splitlines()
    assert lines and set(lines) == {"meshing (try 3), 0 s so far"} or "meshing (try 3), 1 s so far" in lines
    assert len(lines) <= 3, "after 0.1, 0.2 and 0.4 s: each after twice the time"
    monkeypatch.setattr(stage_lines, "SHOWN_SECONDS", 0.0)
    with reported_to(StageLines(other, rank=lambda: 1)), stage("meshing"):
        pass
    assert other.getvalue() == "", "other ranks are silent"
    until = time.monotonic() + 30.0
    while any(thread.name == "pdvol-stages" for thread in threading.enumerate()):
        assert time.monotonic() < until, "the thread that watches ends"
        time.sleep(0.01)


def test_a_terminal_shows_a_line_that_is_rewritten_and_cleared(monkeypatch):
    monkeypatch.setattr(stage_lines, "FIRST_SIGN", 0.05)
    monkeypatch.setattr(stage_lines, "_REWRITTEN_EVERY", 0.03)
    monkeypatch.setenv("COLUMNS", "30")
    terminal = io.StringIO()
    monkeypatch.setattr(terminal, "isatty", lambda: True, raising=False)
    with reported_to(StageLines(terminal)):
        with stage("instantaneous"):
            pass
        with stage("meshing a body with a long name"):
            say("try 1")
            time.sleep(0.4)
    shown = terminal.getvalue().split("\r\x1b[K")
    assert len([text for text in shown if text.startswith("meshing a body")]) >= 3
    assert max(len(text) for text in shown) < 30, "a line that wraps could not be rewritten"
    assert shown[-1] == "" and "instantaneous" not in terminal.getvalue() and "\n" not in terminal.getvalue()


def test_meshing_says_what_it_does_and_how_often_it_tried(tmp_path):
    kept = Kept()
    corners = Outline(np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]))
    scene = Scene(bodies=(Body(corners, NeoHookean(1e5), vertices=(30, 80), name="plate"),), dt=0.01, steps=1)
    with reported_to(kept):
        meshes = build_levels(scene, cache=tmp_path)
    ended = {one.name: one for one in kept.ended}
    for level, mesh in enumerate(meshes):
        detail = ended[f"meshing body 'plate', level {level}"].detail
        assert re.fullmatch(rf"{len(mesh.points)} vertices, (1 try|\d tries)", detail)
    kept.ended.clear()
    with reported_to(kept):
        build_levels(scene, cache=tmp_path)
    assert not any("meshing" in one.name for one in kept.ended), "they come from the cache"


# ---- commands


@pytest.fixture
def shot(tmp_path, monkeypatch):
    """A scene file of a cube, without stored meshes."""
    (tmp_path / "cube.off").write_text(CUBE_OFF)
    (tmp_path / "shot.py").write_text(CUBE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def stage_names(text: str) -> list[str]:
    """The stages among a log's lines."""
    return re.findall(r"^(\w+ing [^:\n]*): (?:\d+ min )?[\d.]+ s(?: \(.*\))?$", text, re.MULTILINE)


def test_a_run_with_a_cold_cache_says_what_it_does_and_a_quick_one_nothing(shot, monkeypatch, capfd):
    def run(*words, shown=0.0):
        monkeypatch.setattr(stage_lines, "SHOWN_SECONDS", shown)
        assert pdvol_command(*words) == 0
        return capfd.readouterr()

    first, second = (run("check", "shot.py", "--measure", 0, "--json", "found.json") for _ in range(2))
    assert first.out == second.out and stage_names(first.out) == [], "the output is the same whatever lasts"
    assert {"checking level 1", "meshing body 'cube', level 1"} <= set(stage_names(first.err))
    assert not any("meshing" in name for name in stage_names(second.err))
    shutil.rmtree("cache")
    words = ("run", "shot.py", "--no-picture", "--no-xdmf", "--out")
    text, log = run(*words, "a")
    assert text == ""
    names = stage_names(log)
    expected = ["reading body 'cube'", "checking body 'cube'"]
    expected += ["checking level 0", "checking level 1", "preparing level 0", "preparing level 1"]
    assert [name for name in names if name in expected] == expected
    meshing = [name for name in names if name.startswith("meshing")]
    assert sorted(meshing) == [f"meshing body 'cube', level {level}" for level in (0, 1)]
    assert names.index(meshing[1]) < names.index("checking level 0")
    assert log.index("preparing level 0") < log.index("level 0  step 1/2") < log.index("preparing level 1")
    warm = run(*words, "b", shown=60.0).err
    assert stage_names(warm) == [] and len(warm.splitlines()) == 2 * 3 + 2, (
        "steps and their pace, where the files are, and the animation"
    )


# ---- commands on stored runs


@pytest.fixture
def all_stages(monkeypatch):
    """Stages leave a line however short they are."""
    monkeypatch.setattr(stage_lines, "SHOWN_SECONDS", 0.0)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["export", "RUN", "--format", "xdmf", "-o", "out"], r"exporting xdmf: .*\(level 1, step (\d+) of \1"),
        (["export", "RUN", "--format", "pc2", "-o", "out"], r"exporting pc2: .*\(level_1/.*, frame (\d+) of \1"),
        (["verify", "RUN"], r"verifying .*: .* s \(level 1, step (\d+) of \1\)"),
        (["metrics", "RUN"], r"measuring level 1 of .*drift from level 0, step (\d+) of \1[;)]"),
    ],
)
def test_commands_say_level_and_step_and_print_what_they_print(
    words, said, small_run, tmp_path, monkeypatch, capsys, all_stages
):
    monkeypatch.chdir(tmp_path)

    def printed():
        assert cli.run([str(small_run) if word == "RUN" else word for word in words]) == 0
        return capsys.readouterr()

    loud = printed()
    assert re.search(rf"^{said}", loud.err, re.MULTILINE) and stage_names(loud.out) == [], loud.err
    stage_lines.SHOWN_SECONDS = float("inf")
    quiet = printed()
    assert quiet.out == loud.out and quiet.err == ""


def test_loading_has_a_stage(tmp_path):
    """In a process of its own: MPI is loaded while the stage is shown."""
    (tmp_path / "fall.py").write_text(FALL)
    program = "import pdvol.runs.stage_lines as s; s.SHOWN_SECONDS = s.FIRST_SIGN = 0.0; import pdvol; pdvol.main()"
    words = ["preview", "fall.py", "--steps", "1", "--no-picture", "--no-xdmf", "--out", "a"]
    done = subprocess.run(
        [sys.executable, "-c", program, *words], cwd=tmp_path, capture_output=True, text=True, timeout=SAFETY
    )
    assert done.returncode == 0, done.stderr
    assert stage_names(done.stderr)[:2] == ["loading the solver", "loading fall.py"] and done.stdout == ""


@pytest.mark.parametrize(
    ("words", "stages"),
    [
        (["check", "fall.py", "--measure", "0"], ["loading the solver", "loading fall.py"]),
        (["info", "fall.py"], ["loading fall.py"]),
        (["live", "fall.py", "--port", "70000"], ["loading fall.py"]),
        (["live", "fall.py", "--host", "300.1.1.1"], ["loading fall.py", "loading the page"]),
        (["pick", "none", "1"], ["loading the solver"]),
    ],
)
def test_other_commands_say_what_they_load(words, stages, tmp_path, monkeypatch, capsys, all_stages):
    (tmp_path / "fall.py").write_text(FALL)
    monkeypatch.chdir(tmp_path)
    cli.run(words)
    shown = capsys.readouterr()
    assert stage_names(shown.err)[: len(stages)] == stages and stage_names(shown.out) == []
