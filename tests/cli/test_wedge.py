"""`pdvol wedge` and `pdvol pick`, through the command line."""

import json
import os
import shlex
import shutil
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import runs
from cli_scenes import FALL, pdvol, states, write
from commands import PDVOL, SAFETY
from pdvol.runs.scene_file import load_shot
from pdvol.store.reader import open_run
from pdvol.studio.draw.sheet import shared_camera, sheet_grid
from pdvol.studio.wedge import farm
from pdvol.studio.wedge.results import tiles
from pdvol.studio.wedge.wedge import Wedge, ordered

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
    """A wedge of the falling square; half of it would begin below the floor."""
    folder = tmp_path_factory.mktemp("wedge")
    assert pdvol("wedge", scene_in(folder), "-o", folder / "w", *WORDS, "--jobs", 2) == 0
    return folder


def stored(folder):
    return json.loads((folder / "wedge.json").read_text())


def states_of(wedge):
    return {run.name: states(run, 0) for run in sorted((wedge / "runs").iterdir()) if run.is_dir()}


def test_each_variation_is_a_run_as_any_other(folder, tmp_path):
    wedge = stored(folder / "w")
    assert [entry["name"] for entry in wedge["variations"]] == NAMES
    assert [entry["number"] for entry in wedge["variations"]] == [0, 1, 2, 3]
    assert wedge["vary"] == ["height=0.02,-1", "mu=0.1:0.3:2"]
    for entry in wedge["variations"][:2]:
        run = open_run(folder / "w" / "runs" / entry["name"])
        assert entry["state"] == "done" and run.levels[0].steps == STEPS + 1 and len(run.levels) == 1
        assert entry["scores"] == {"right": run.levels[0].positions(STEPS)[:, 0].mean()}
    words = ("--set", "height=0.02", "--set", "mu=0.1", "--steps", STEPS, "--no-picture")
    assert pdvol("preview", folder / "fall.py", *words, "--out", tmp_path / "p") == 0
    assert states(tmp_path / "p", 0) == states(folder / "w" / "runs" / NAMES[0], 0)


def test_a_failed_variation_has_its_reason_and_is_not_the_end(folder):
    for entry in stored(folder / "w")["variations"][2:]:
        assert entry["state"] == "failed" and "floor" in entry["reason"] and "\n" not in entry["reason"]
        assert entry["scores"] == {"right": None} and entry["cluster"] == -1


@pytest.mark.slow
def test_the_film_shows_all_variations_and_failed_ones_with_their_reason(folder, tmp_path, capsys):
    imageio = pytest.importorskip("imageio.v2")
    shutil.copytree(folder, tmp_path / "copy")
    words = (tmp_path / "copy/fall.py", "-o", tmp_path / "copy/w", *WORDS)
    assert pdvol("wedge", *words, "--film") == 0
    assert "sheet.mp4" in capsys.readouterr().err
    assert not (tmp_path / "copy/w/sheet.png").exists()
    with imageio.get_reader(tmp_path / "copy/w/sheet.mp4") as film:
        frames = [np.asarray(frame)[..., :3].astype(int) for frame in film]
    assert len(frames) == 5  # 0.12 s at 30 frames a second at most, both ends included
    assert pdvol("wedge", *[word for word in words if word != "--no-picture"]) == 0
    wedge = Wedge(load_shot(tmp_path / "copy/fall.py", None, STEPS), tmp_path / "copy/w")
    with wedge.taken():
        entries = ordered(wedge.entries, "right")
    shown = tiles(entries, wedge.runs(entries))
    moves = [entry["number"] < 2 for entry in entries]
    assert [tile.note.startswith("failed: ") and "floor" in tile.note for tile in shown] == [not m for m in moves]
    layout = sheet_grid(shown, shared_camera(shown).aspect, None)
    with Image.open(tmp_path / "copy/w/sheet.png") as picture:
        sheet = np.asarray(picture.convert("RGB"), dtype=int)
    scale = np.array(frames[0].shape[:2]) / sheet.shape[:2]
    for place, moved in enumerate(moves):
        x, y = layout.corner(place)
        width, height = layout.picture
        top, bottom = (np.array([y, y + height]) * scale[0]).astype(int)
        left, right = (np.array([x, x + width]) * scale[1]).astype(int)
        first, last = (frame[top:bottom, left:right] for frame in (frames[0], frames[-1]))
        assert (abs(first - last).max() > 60) == moved, "bodies move, and reasons stay"
        assert (sheet[y : y + height, x : x + width].sum(axis=2) < 350).sum() > 300, "a body's outline, or a reason"


def test_the_same_command_goes_on_and_more_values_are_added(folder, tmp_path, capsys):
    shutil.copytree(folder, tmp_path / "copy")
    copy, before = tmp_path / "copy", {p: p.stat().st_mtime_ns for p in (tmp_path / "copy").glob("w/runs/*/levels/*/*")}
    assert before
    capsys.readouterr()
    assert pdvol("wedge", copy / "fall.py", "-o", copy / "w", *WORDS, "--jobs", 1) == 0
    assert {p: p.stat().st_mtime_ns for p in copy.glob("w/runs/*/levels/*/*")} == before
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


@pytest.fixture
def cluster(tmp_path):
    """Two workers of dask, in processes of their own."""
    distributed = pytest.importorskip("distributed")
    words = {"host": "127.0.0.1", "dashboard_address": None, "local_directory": tmp_path / "dask"}
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, **words) as cluster:
        yield cluster


def test_workers_of_dask_give_the_same_states(folder, tmp_path, cluster, monkeypatch):
    """One that is done, one that fails; and what they cannot start has its reason."""
    words = ["mu=0.1" if word == "mu=0.1:0.3:2" else word for word in WORDS]
    words = ("wedge", folder / "fall.py", "-o", tmp_path / "w", *words)
    assert pdvol(*words, "--executor", f"dask={cluster.scheduler_address}") == 0
    alike = {entry["name"]: entry for entry in stored(folder / "w")["variations"] if entry["name"].endswith("_mu-0.1")}
    others = states_of(folder / "w")
    assert states_of(tmp_path / "w") == {name: others[name] for name in alike if name in others}
    for entry, its in zip(stored(tmp_path / "w")["variations"], alike.values(), strict=True):
        assert [entry[key] for key in ("name", "state", "reason", "scores")] == [
            its[key] for key in ("name", "state", "reason", "scores")
        ]

    def nothing_there(words, log):
        raise FileNotFoundError(f"No such file: {log}")

    monkeypatch.setattr(farm, "carry_out", nothing_there)
    words = ("wedge", folder / "fall.py", "-o", tmp_path / "none", "--steps", 2, "--vary", "mu=0.1", "--no-picture")
    assert pdvol(*words, "--executor", f"dask={cluster.scheduler_address}") == 0
    (entry,) = stored(tmp_path / "none")["variations"]
    assert entry["state"] == "failed" and "could not start it: No such file: " in entry["reason"]


@pytest.mark.slow
def test_a_killed_worker_of_dask_costs_nothing_but_time(tmp_path, cluster):
    words = ("--steps", 200, "--vary", "mu=0.1,0.2,0.3", "--no-picture")
    command = [*PDVOL, "wedge", scene_in(tmp_path), "-o", tmp_path / "w", *map(str, words)]
    command += ["--executor", f"dask={cluster.scheduler_address}"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        wait_for(tmp_path / "w/runs/mu-0.1/levels/0", process)
        (hurt,) = [
            worker.pid
            for worker in cluster.workers.values()
            for child in children(worker.pid)
            if str(tmp_path / "w/runs/mu-0.1") in Path(f"/proc/{child}/cmdline").read_text().split("\0")
        ]
        os.kill(hurt, signal.SIGKILL)
        assert runs.count(tmp_path / "w/runs/mu-0.1/levels/0") <= 200, "it was killed in mid-task"
        assert process.wait(SAFETY) == 0
    assert [entry["state"] for entry in stored(tmp_path / "w")["variations"]] == ["done"] * 3
    assert pdvol("wedge", tmp_path / "fall.py", "-o", tmp_path / "local", *words, "--jobs", 1) == 0
    assert runs.count(tmp_path / "local/runs/mu-0.1/levels/0") == 201
    assert states_of(tmp_path / "w") == states_of(tmp_path / "local")


def children(process):
    return [
        int(pid) for task in Path(f"/proc/{process}/task").iterdir() for pid in (task / "children").read_text().split()
    ]


def wait_for(level, process):
    """Until step 10 is stored."""
    deadline = time.monotonic() + SAFETY
    while runs.count(level) <= 10 and time.monotonic() < deadline and process.poll() is None:
        time.sleep(0.01)
    assert runs.count(level) > 10 and process.poll() is None


def test_a_killed_worker_and_a_killed_wedge_cost_nothing_but_time(tmp_path):
    scene_in(tmp_path)
    words = ("--steps", 200, "--vary", "mu=0.1,0.2,0.3", "--jobs", 1, "--no-picture")
    command = [*PDVOL, "wedge", tmp_path / "fall.py", "-o", tmp_path / "w", *map(str, words)]

    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        wait_for(tmp_path / "w/runs/mu-0.1/levels/0", process)
        for child in children(process.pid):
            os.kill(child, signal.SIGKILL)
        wait_for(tmp_path / "w/runs/mu-0.2/levels/0", process)
        assert stored(tmp_path / "w")["variations"][0]["state"] == "done", "the killed job was run again"
        process.kill()
    kept = {p: p.stat().st_mtime_ns for p in (tmp_path / "w/runs/mu-0.1/levels/0").iterdir()}
    assert pdvol("wedge", tmp_path / "fall.py", "-o", tmp_path / "w", *words) == 0
    assert {p: p.stat().st_mtime_ns for p in (tmp_path / "w/runs/mu-0.1/levels/0").iterdir()} == kept
    assert [entry["state"] for entry in stored(tmp_path / "w")["variations"]] == ["done"] * 3
    for name in ("0.1", "0.2"):
        alone = ("--set", f"mu={name}", "--steps", 200, "--no-picture", "--out", tmp_path / name)
        assert pdvol("preview", tmp_path / "fall.py", *alone) == 0
        assert states(tmp_path / "w/runs" / f"mu-{name}", 0) == states(tmp_path / name, 0)


def test_a_search_finds_and_goes_on_with_what_is_stored(tmp_path, capsys):
    scene = scene_in(tmp_path)
    words = ("--steps", 3, "--vary", "height=0.02:0.4", "--runs", 30, "--no-picture", "--seek", "near")
    assert pdvol("wedge", scene, "-o", tmp_path / "w", *words) == 0
    assert "best: number" in capsys.readouterr().err
    wedge = stored(tmp_path / "w")
    scores = [entry["scores"]["near"] for entry in wedge["variations"]]
    assert wedge["best"]["score"] == max(scores) == scores[wedge["best"]["number"]] and wedge["best"]["runs"] == 30
    assert max(scores) > -0.01 and max(scores) > max(scores[:6])
    before = {p: p.stat().st_mtime_ns for p in (tmp_path / "w/runs").glob("*/levels/0/*")}
    assert pdvol("wedge", scene, "-o", tmp_path / "w", *words) == 0
    assert {p: p.stat().st_mtime_ns for p in (tmp_path / "w/runs").glob("*/levels/0/*")} == before
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
    assert len(open_run(folder / "w" / "runs" / NAMES[1]).levels) == 1, "the wedge is as before"
    assert pdvol("pick", folder / "w", 0, "-o", tmp_path / "picked") == 2
    assert "another run" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("7",), "has no variation 7"),
        (("2",), "variation 2 of"),
        (("two",), "not the number"),
        (("best",), "holds no search"),
        (("1", "--to", "1"), "add --refine"),
    ],
)
def test_what_cannot_be_picked_is_said_in_one_line(folder, tmp_path, capsys, words, message):
    assert pdvol("pick", folder / "w", *words, "-o", tmp_path / "out") == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1 and not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--vary", "colour=1,2"), "no parameter 'colour'"),
        (("--vary", "mu=0:1"), "mu=0:1:9"),
        ((), "say what differs"),
        (("--vary", "mu=1,2", "--executor", "cloud"), "choose local, dask"),
        (("--vary", "mu=1,2", "--executor", "dask=tcp://127.0.0.1:9"), "no scheduler answers"),
        (("--vary", "mu=1,2", "--score", "beauty"), "there is no beauty"),
        (("--vary", "mu=1,2", "--jobs", "0"), "at least 1"),
        (("--vary", "mu=1,2", "--runs", "5"), "bounds of --seek"),
        (("--vary", "mu=1,2", "--seek", "right"), "needs ranges"),
        (("--vary", "mu=0:1", "--seek", "right", "--executor", "print"), "needs its runs at once"),
        (("--vary", "mu=0:1", "--seek", "right", "--sample", "3"), "chooses its own"),
        (("--vary", "mu=0:1", "--seek", "right", "--budget", "0"), "above zero"),
        (("--vary", "mu=0:1", "--sample", "x"), "not a whole number"),
    ],
)
def test_a_wedge_that_cannot_be_made_is_said_in_one_line(tmp_path, capsys, monkeypatch, words, message):
    monkeypatch.setattr("pdvol.studio.wedge.farm.CONNECT", 0.5)
    scene = scene_in(tmp_path)
    assert pdvol("wedge", scene, "-o", tmp_path / "w", *words, "--no-picture") == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1 and not (tmp_path / "w" / "runs").exists()


def test_another_scene_and_a_full_folder_are_refused(folder, tmp_path, capsys):
    scene = write(tmp_path / "fall.py", FALL.replace("dt=0.02", "dt=0.01"))
    assert pdvol("wedge", scene, "-o", folder / "w", *WORDS[:-3], "--no-picture") == 2
    assert "another scene" in capsys.readouterr().err
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").write_text("mine")
    assert pdvol("wedge", folder / "fall.py", "-o", tmp_path / "full", *WORDS) == 2
    assert "not empty" in capsys.readouterr().err
