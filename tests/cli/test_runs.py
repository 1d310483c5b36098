"""The commands on a scene of a few triangles, and the files that each of them leaves."""

import json
import subprocess
import sys

import meshio
import numpy as np
import pytest

from cli_scenes import CUBE_OFF, DROP, pdvol, pdvol_on_ranks, write
from commands import SAFETY
from on_ranks import results_on
from pdvol import open_run
from pdvol.commands import simulation
from pdvol.measure.verify import verify_run

STEPS = 10
LOGGED = set(
    "level step time newton_iterations linear_iterations hessians backtracks step_cap contacts min_gap energy"
    " gradient_norm reason seconds peak_memory_mb".split()
)
ENERGIES = {"inertia", "elastic", "load", "barrier", "friction"}
SECONDS = {"total", "assembly", "contact", "ccd", "linear", "other"}


def png_size(path):
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    return int.from_bytes(data[16:20]), int.from_bytes(data[20:24])


# ---- run


def test_what_a_run_leaves(whole):
    run = open_run(whole)
    info = run.info
    assert info["state"] == "done" and info["steps"] == STEPS and info["method"] == "progressive" and info["dt"] == 0.02
    assert [level["vertices"] for level in info["levels"]] == [9, 25]
    assert {"numpy", "python", "pdvol"} <= set(info["versions"])
    assert [level.steps for level in run.levels] == [STEPS + 1] * 2 and verify_run(whole) == []
    width, height = png_size(whole / "picture.png")
    assert width > height / 3 > 30 and not list(whole.rglob("*.tmp*"))
    records = [json.loads(line) for line in (whole / "log.jsonl").read_text().splitlines()]
    assert [(r["level"], r["step"]) for r in records] == [(k, n) for k in range(2) for n in range(1, STEPS + 1)]
    for record in records:
        assert LOGGED <= set(record) and ENERGIES <= set(record["energy"]) and SECONDS <= set(record["seconds"])
        assert record["time"] == pytest.approx(0.02 * record["step"]) and record["newton_iterations"] > 0
        parts = sum(seconds for name, seconds in record["seconds"].items() if name not in ("total", "cpu"))
        assert parts == pytest.approx(record["seconds"]["total"], rel=0.05, abs=2e-3)
    assert max(r["contacts"] for r in records) > 0, "the square must have reached the floor"
    assert min(r["min_gap"] for r in records if r["min_gap"] is not None) > 0


@pytest.mark.parametrize("flat", [True, False], ids=["2d", "3d"])
def test_a_process_draws_pictures(final_pictures, tmp_path, monkeypatch, scene, flat):
    monkeypatch.setattr(simulation, "cores", lambda: 2)
    file = scene if flat else write(tmp_path / "drop.py", DROP)
    out, pictures = tmp_path / "run", []
    for _ in range(2):
        with final_pictures():
            assert pdvol("preview", file, "--steps", 1, "--no-xdmf", "--out", out) == 0
        pictures.append((out / "picture.png").read_bytes())
        (out / "picture.png").unlink()
        assert simulation._painter(flat).alive == (len(pictures) == 1)
        simulation._painter(flat).stop()
    assert pictures[0] == pictures[1]


def test_preview_and_the_default_folder(tmp_path, scene, whole, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert pdvol("preview", scene, "--steps", 4) == 0
    (out,) = (tmp_path / "runs").iterdir()
    assert out.name == "fall_preview"
    run = open_run(out)
    assert len(run.levels) == 1
    np.testing.assert_array_equal(run.levels[0].positions(4), open_run(whole).levels[0].positions(4))


def test_a_scene_file_run_by_python(tmp_path, scene, whole):
    # What demos end with, here without `if __name__ == "__main__":`: the file's own command line.
    file = write(tmp_path / "shot.py", scene.read_text() + "\n\npdvol.main(scene)\n")
    words = [sys.executable, file, "--steps", "2", "--no-picture", "--out", tmp_path / "run"]
    ended = subprocess.run(words, capture_output=True, text=True, timeout=SAFETY)
    assert ended.returncode == 0, ended.stderr
    assert "Traceback" not in ended.stderr and "states, log.jsonl" in ended.stderr
    one, other = (open_run(path).levels[1].positions(2) for path in (tmp_path / "run", whole))
    np.testing.assert_array_equal(one, other)


# ---- info, check, hierarchy, render


def test_info(whole, scene, capsys):
    assert pdvol("info", whole) == 0
    out = capsys.readouterr().out
    assert "method progressive" in out and "level 0: done, 9 vertices, 10 steps" in out and "levels 0 -> 1:" in out
    assert pdvol("info", scene, "--set", "mu=0.7") == 0
    out = capsys.readouterr().out
    said = ("body 'square': NeoHookean, young 20000 Pa", "friction: mu 0.7", "obstacle: Plane(", "name='floor'")
    assert all(part in out for part in said)
    assert "10 steps of 0.02 s" in out and "integrator" not in out
    assert pdvol("info", scene, "--set", "integrator=implicit_euler") == 0
    assert capsys.readouterr().out.splitlines().count("integrator: implicit_euler") == 1, "not the default"


def test_info_draws_bindings(whole, tmp_path, capsys):
    before = set(whole.rglob("*"))
    assert pdvol("info", whole, "--pictures", tmp_path / "pictures") == 0
    assert "levels 0 -> 1:" in capsys.readouterr().out
    assert [p.name for p in (tmp_path / "pictures").iterdir()] == ["binding_1.png"]
    assert set(whole.rglob("*")) == before


def test_check(scene, tmp_path, capsys):
    assert pdvol("check", scene, "--measure", 0) == 0
    out = capsys.readouterr().out
    assert "level 0: 9 vertices, 8 cells" in out and "level 1: 25 vertices, 32 cells" in out
    assert "sound" in out.splitlines()[-1]
    assert pdvol("check", scene, "--measure", 0, "--set", "height=-0.5") == 2
    assert "not sound" in capsys.readouterr().out
    write(tmp_path / "cube.off", CUBE_OFF)
    assert pdvol("check", tmp_path / "cube.off") == 0
    assert "from (0, 0, 0) to (1, 1, 1) m, surface of 8 vertices, 12 triangles, sound" in capsys.readouterr().out


def test_hierarchy(tmp_path, capsys):
    from pdvol import meshes

    ball = meshes.ball(1.0, 2)
    rows = [" ".join(map(str, row)) for row in (*ball.vertices.tolist(), *([3, *t] for t in ball.triangles.tolist()))]
    write(tmp_path / "ball.off", "\n".join(["OFF", f"{len(ball.vertices)} {len(ball.triangles)} 0", *rows, ""]))
    assert pdvol("hierarchy", tmp_path / "ball.off", "--levels", "60,150", "-o", tmp_path / "out") == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(":")[0] for line in lines] == ["level 0", "level 1", "levels 0 -> 1"]
    for line in lines[:2]:
        assert "Hausdorff" in line and line.endswith(" of the input's, 1 shell, genus 0")
    coarse, fine = (meshio.read(tmp_path / "out" / f"level_{level}.vtu") for level in range(2))
    assert abs(len(coarse.points) - 60) <= 15 and abs(len(fine.points) - 150) <= 38
    homes = next(iter(fine.point_data.values()))
    assert homes.shape == (len(fine.points),) and homes.min() >= 0 and homes.max() < len(coarse.cells[0].data)
    width, height = png_size(tmp_path / "out" / "binding_1.png")
    assert width > height > 300 and not (tmp_path / "out" / "binding_0.png").exists()
    for words in ("bound inside", "4 weights a vertex", "largest |weight|", "||P||_F", "sqrt m", "||P||_2"):
        assert words in lines[2]
    words = ("--levels", "60,150", "-o", tmp_path / "smooth", "--prolongation", "biharmonic")
    assert pdvol("hierarchy", tmp_path / "ball.off", *words) == 0
    assert float(capsys.readouterr().out.split(" weights a vertex")[0].split()[-1]) > 10


def test_render(whole, tmp_path, capsys):
    assert pdvol("render", whole, "-o", tmp_path / "both.png") == 0
    assert capsys.readouterr().out.strip() == str(tmp_path / "both.png")
    assert pdvol("render", whole, "-o", tmp_path / "one.png", "--levels", "1") == 0
    (width, height), (one_width, one_height) = png_size(tmp_path / "both.png"), png_size(tmp_path / "one.png")
    assert height / width > 1.5 * one_height / one_width  # half the rows


# ---- ranks


@pytest.mark.mpi
def test_two_ranks_refuse_in_one_line(tmp_path, scene):
    (ended,) = results_on((2,), pdvol_on_ranks, "run", scene, "--out", tmp_path / "bad", "--set", "height=-0.5")
    assert ended["code"] == 2
    (line,) = [line for line in str(ended["said"]).splitlines() if not line.startswith("loading ")]  # on a busy machine
    assert line.startswith("pdvol: level 0")
    assert not (tmp_path / "bad").exists()
