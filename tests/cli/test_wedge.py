"""`pdvol wedge` and `pdvol pick`, through the command line."""

import io
import json
import os
import shlex
import shutil
import signal
import subprocess
import time
from contextlib import redirect_stderr

import pytest

import runs
from cli_scenes import FALL, pdvol, states, write
from commands import PDVOL, SAFETY, children
from pdvol.store.reader import open_run

SCORES = """

def right(run):
    return run.levels[-1].positions(run.info["steps"])[:, 0].mean()


def near(run):
    return -abs(run.levels[-1].positions(run.info["steps"])[:, 1].mean() - 0.54)


def broken(run):
    return run.levels[7]
"""
STEPS = 6
WORDS = ("--steps", STEPS, "--vary", "height=0.02,-1", "--vary", "mu=0.1:0.3:2", "--score", "right", "--no-picture")
NAMES = ["height-0.02_mu-0.1", "height-0.02_mu-0.3", "height--1_mu-0.1", "height--1_mu-0.3"]


def scene_in(folder):
    return write(folder / "fall.py", FALL + SCORES)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A wedge of the falling square; half of it would begin below the floor. Its lines have the time left."""
    folder = tmp_path_factory.mktemp("wedge")
    with redirect_stderr(io.StringIO()) as said:
        assert pdvol("wedge", scene_in(folder), "-o", folder / "w", *WORDS, "--jobs", 2) == 0
    first, *lines = said.getvalue().splitlines()
    assert first == "4 runs, 2 at a time"
    assert [line.endswith(" s left") for line in lines[:4]] == [True, True, True, False], lines
    return folder


def stored(folder):
    return json.loads((folder / "wedge.json").read_text())


def states_of(wedge):
    return {run.parent.name: states(run.parent, 0) for run in sorted(wedge.glob("*/run.json"))}


def test_each_variation_is_a_run_as_any_other(folder, tmp_path):
    wedge = stored(folder / "w")
    assert [entry["name"] for entry in wedge["variations"]] == NAMES
    assert [entry["number"] for entry in wedge["variations"]] == [0, 1, 2, 3]
    assert wedge["vary"] == ["height=0.02,-1", "mu=0.1:0.3:2"]
    for entry in wedge["variations"][:2]:
        run = open_run(folder / "w" / str(entry["number"]))
        assert entry["state"] == "done" and run.levels[0].steps == STEPS + 1 and len(run.levels) == 1
        assert entry["scores"] == {"right": run.levels[0].positions(STEPS)[:, 0].mean()}
    for entry in wedge["variations"][2:]:
        assert entry["state"] == "failed" and "floor" in entry["reason"] and "\n" not in entry["reason"]
        assert entry["scores"] == {"right": None} and entry["cluster"] == -1
    words = ("--set", "height=0.02", "--set", "mu=0.1", "--steps", STEPS, "--no-picture")
    assert pdvol("preview", folder / "fall.py", *words, "--out", tmp_path / "p") == 0
    assert states(tmp_path / "p", 0) == states(folder / "w" / "0", 0)


def test_the_same_command_goes_on_and_more_values_are_added(folder, tmp_path, capsys):
    shutil.copytree(folder, tmp_path / "copy")
    copy, before = tmp_path / "copy", {p: p.stat().st_mtime_ns for p in (tmp_path / "copy").glob("w/*/levels/*/*")}
    assert before
    capsys.readouterr()
    assert pdvol("wedge", copy / "fall.py", "-o", copy / "w", *WORDS, "--jobs", 1) == 0
    assert {p: p.stat().st_mtime_ns for p in copy.glob("w/*/levels/*/*")} == before
    head, *rows, last = capsys.readouterr().out.splitlines()
    assert head.split() == ["number", "height", "mu", "right", "cluster", "state"] and "failed: " in last
    scores = [entry["scores"]["right"] for entry in stored(copy / "w")["variations"][:2]]
    assert [int(row.split()[0]) for row in rows[:2]] == sorted((0, 1), key=lambda number: -scores[number])
    again, first = stored(copy / "w"), stored(folder / "w")
    for entry, its in zip(again["variations"], first["variations"], strict=True):
        assert {**entry, "seconds": 0, "cluster": 0} == {**its, "seconds": 0, "cluster": 0}
    more = ("--steps", STEPS, "--vary", "mu=0.2,0.1", "--set", "height=0.02", "--score", "right", "--no-picture")
    for sort in ("mu", "number"):
        assert pdvol("wedge", copy / "fall.py", "-o", copy / "w", *more, "--sort", sort, "--jobs", 1) == 0
        shown = [int(line.split()[0]) for line in capsys.readouterr().out.splitlines()[1:]]
        entries = {entry["number"]: entry for entry in stored(copy / "w")["variations"]}
        keys = [float(entries[number]["changes"]["mu"]) if sort == "mu" else number for number in shown]
        assert len(keys) == 6 and keys == sorted(keys)


def test_printed_lines_give_the_same_states_and_are_collected(folder, tmp_path, capsys):
    words = ("wedge", folder / "fall.py", "-o", tmp_path / "w", *WORDS, "--executor", "print")
    capsys.readouterr()
    assert pdvol(*words) == 0
    output = capsys.readouterr()
    lines = output.out.splitlines()
    assert len(lines) == 4 and "4 of 4 runs are missing" in output.err
    codes = [pdvol(*shlex.split(line)[1:]) for line in lines]
    assert codes == [0, 0, 2, 2] and all(line.startswith("pdvol run ") for line in lines)
    capsys.readouterr()
    assert pdvol(*words) == 0
    output = capsys.readouterr()
    assert [shlex.split(line)[1:] for line in output.out.splitlines()] == [shlex.split(line)[1:] for line in lines[2:]]
    assert states_of(tmp_path / "w") == states_of(folder / "w")
    assert [entry["state"] for entry in stored(tmp_path / "w")["variations"]] == ["done", "done", "waiting", "waiting"]
    assert pdvol(*words, "--score", "broken") == 2
    assert "score 'broken': IndexError" in capsys.readouterr().err


def wait_for(level, process):
    """Until step 10 is stored."""
    deadline = time.monotonic() + SAFETY
    while runs.count(level) <= 10 and time.monotonic() < deadline and process.poll() is None:
        time.sleep(0.01)
    assert runs.count(level) > 10 and process.poll() is None


def test_a_killed_worker_and_a_killed_wedge_cost_nothing_but_time(tmp_path):
    scene_in(tmp_path)
    words = ("--steps", 60, "--vary", "mu=0.1,0.2,0.3", "--jobs", 1, "--no-picture")
    command = [*PDVOL, "wedge", tmp_path / "fall.py", "-o", tmp_path / "w", *map(str, words)]

    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        wait_for(tmp_path / "w/0/levels/0", process)
        for child in children(process.pid):
            os.kill(child, signal.SIGKILL)
        wait_for(tmp_path / "w/1/levels/0", process)
        assert stored(tmp_path / "w")["variations"][0]["state"] == "done", "the killed job was run again"
        process.kill()
    kept = {p: p.stat().st_mtime_ns for p in (tmp_path / "w/0/levels/0").iterdir()}
    assert pdvol("wedge", tmp_path / "fall.py", "-o", tmp_path / "w", *words) == 0
    assert {p: p.stat().st_mtime_ns for p in (tmp_path / "w/0/levels/0").iterdir()} == kept
    assert [entry["state"] for entry in stored(tmp_path / "w")["variations"]] == ["done"] * 3
    for number, name in enumerate(("0.1", "0.2")):
        alone = ("--set", f"mu={name}", "--steps", 60, "--no-picture", "--out", tmp_path / name)
        assert pdvol("preview", tmp_path / "fall.py", *alone) == 0
        assert states(tmp_path / "w" / str(number), 0) == states(tmp_path / name, 0)


def test_a_search_finds_and_goes_on_with_what_is_stored(tmp_path, capsys):
    scene = scene_in(tmp_path)
    words = ("--steps", 3, "--vary", "height=0.02:0.4", "--runs", 20, "--no-picture", "--seek", "near")
    assert pdvol("wedge", scene, "-o", tmp_path / "w", *words) == 0
    assert "best: number" in capsys.readouterr().err
    wedge = stored(tmp_path / "w")
    scores = [entry["scores"]["near"] for entry in wedge["variations"]]
    assert wedge["best"]["score"] == max(scores) == scores[wedge["best"]["number"]] and wedge["best"]["runs"] == 20
    assert max(scores) > -0.01 and max(scores) > max(scores[:6])
    before = {p: p.stat().st_mtime_ns for p in (tmp_path / "w").glob("*/levels/0/*")}
    assert pdvol("wedge", scene, "-o", tmp_path / "w", *words) == 0
    assert " left" not in capsys.readouterr().err, "all are stored"
    assert {p: p.stat().st_mtime_ns for p in (tmp_path / "w").glob("*/levels/0/*")} == before
    assert stored(tmp_path / "w")["best"] == wedge["best"]
    assert pdvol("pick", tmp_path / "w", "best", "-o", tmp_path / "best", "--no-picture") == 0


def test_a_picked_variation_is_refined_as_a_run_of_its_settings(folder, tmp_path, capsys):
    words = ("pick", folder / "w", 1, "--refine", "-o", tmp_path / "picked", "--no-picture")
    assert pdvol(*words) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("level 0, 9 vertices: as chosen; right ") and "level 1, 25 vertices: ends" in lines[1]
    assert "from level 0" in lines[1] and ("right" in lines[1].split("degrees")[1])
    settings = ("--set", "height=0.02", "--set", "mu=0.3", "--steps", STEPS, "--no-picture")
    assert pdvol("run", folder / "fall.py", *settings, "--out", tmp_path / "alone") == 0
    for level in (0, 1):
        assert states(tmp_path / "picked", level) == states(tmp_path / "alone", level)
    assert pdvol(*words) == 0, "it goes on with the run that is there"
    assert len(open_run(folder / "w" / "1").levels) == 1, "the wedge is as before"
    assert pdvol("pick", folder / "w", 0, "-o", tmp_path / "picked") == 2
    assert "another run" in capsys.readouterr().err


def test_a_refined_variation_of_a_wedge_of_0_3_is_scored_on_level_0(folder, tmp_path, capsys):
    """Runs of 0.3 were in runs/NAME. They are read there, and refined in place."""
    shutil.copytree(folder, tmp_path / "copy")
    wedge = tmp_path / "copy" / "w"
    old = stored(wedge) | {"format": 1}
    (wedge / "wedge.json").write_text(json.dumps(old))
    for number in (0, 1):
        shutil.copytree(wedge / str(number), wedge / "runs" / NAMES[number])
        shutil.rmtree(wedge / str(number))
    assert pdvol("refine", wedge / "runs" / NAMES[1], "--to", 1, "--no-picture", "--no-xdmf") == 0
    assert pdvol("wedge", tmp_path / "copy/fall.py", "-o", wedge, *WORDS, "--jobs", 1) == 0
    again = stored(wedge)
    assert again["format"] == 2 and not (wedge / "0").exists()
    assert [entry["scores"] for entry in again["variations"]] == [entry["scores"] for entry in old["variations"]]
    assert pdvol("pick", wedge, 0, "-o", tmp_path / "picked", "--no-picture") == 0
    assert states(tmp_path / "picked", 0) == states(folder / "w" / "0", 0)


PICK, WEDGE = ("pick", "w"), ("wedge", "fall.py")
TWO, RANGE = ("--vary", "mu=1,2"), ("--vary", "mu=0:1")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((*PICK, "7"), "has no variation 7"),
        ((*PICK, "2"), "variation 2 of"),
        ((*PICK, "best"), "holds no search"),
        ((*PICK, "1", "--to", "1"), "add --refine"),
        ((*WEDGE, "--vary", "colour=1,2"), "no parameter 'colour'"),
        ((*WEDGE, *TWO, "--score", "beauty"), "there is no beauty"),
        ((*WEDGE, *TWO, "--score", 'upright("squid")'), "fall: there is no body 'squid'; there are square"),
        ((*WEDGE, *RANGE, "--seek", '-meets("square", "flor")'), "nothing is called 'flor'; there are square, floor"),
        ((*WEDGE, *TWO, "--score", 'lands_in("square", (0, 0, 0), (1, 1, 1))'), "3 coordinates in a 2D scene"),
        ((*WEDGE, *TWO, "--runs", "5"), "bounds of --seek"),
        ((*WEDGE, *TWO, "--seek", "right"), "needs ranges"),
        ((*WEDGE, *RANGE, "--seek", "right", "--executor", "print"), "needs its runs at once"),
        ((*WEDGE, *RANGE, "--seek", "right", "--sample", "3"), "chooses its own"),
        ((*WEDGE, *RANGE, "--seek", "right", "--budget", "0"), "above zero"),
        ((*WEDGE, *RANGE, "--sample", "x"), "not a whole number"),
    ],
)
def test_mistakes_are_said_in_one_line(folder, tmp_path, capsys, words, message):
    command, place, *rest = words
    assert pdvol(command, folder / place, *rest, "-o", tmp_path / "out", "--no-picture") == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1
    assert not (tmp_path / "out").exists() if words[0] == "pick" else not (tmp_path / "out" / "0").exists()


def test_another_scene_and_a_full_folder_are_refused(folder, tmp_path, capsys):
    scene = write(tmp_path / "fall.py", FALL.replace("dt=0.02", "dt=0.01"))
    assert pdvol("wedge", scene, "-o", folder / "w", *WORDS[:-3], "--no-picture") == 2
    assert "another scene" in capsys.readouterr().err
    assert pdvol("wedge", folder / "fall.py", "-o", tmp_path, *WORDS) == 2
    assert "not empty" in capsys.readouterr().err
