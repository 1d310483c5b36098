"""`pdvol check` reports correct values, names and draws every defect, and writes files only on request."""

import json
import re
import time
from pathlib import Path

import meshio
import numpy as np
import pytest

from cli_scenes import CUBE_OFF, FALL, SQUARE, pdvol, write
from hostile_files import BALL, CUBE, mesh, obj, off, shifted, tets, together
from pdvol.runs import preflight
from pdvol.runs.runner import run_scene
from pdvol.runs.scene_file import load_shot

TWO = (
    SQUARE
    + '''

def scene(apart=1.005, young=2e4, dhat=0.01, velocity=(0.0, 0.0), dt=0.02, slope=0.0):
    """Two squares beside each other, the right one with a stone of its own inside it where slope asks for one."""
    return Scene(
        bodies=(Body((square(2), square(3)), NeoHookean(2e4), name="left"),
                Body((square(1), square(2)), NeoHookean(young), name="right", velocity=velocity,
                     placement=Placement((apart, 0.001)))),
        obstacles=(Plane((0.0, -0.5), (slope, 1.0), name="floor"),),
        contact=(Barrier(dhat=dhat),), dt=dt, steps=3)
'''
)


@pytest.fixture
def check(tmp_path, capfd, monkeypatch):
    """Runs `pdvol check` in an empty folder; (code, lines, findings)."""
    monkeypatch.chdir(tmp_path)

    def check_(text, *words):
        write(tmp_path / "s.py", text)
        capfd.readouterr()
        code = pdvol("check", "s.py", "--json", "found.json", "--measure", 0, *words)
        out, err = capfd.readouterr()
        assert err == ""
        return code, out.splitlines(), json.loads((tmp_path / "found.json").read_text())

    return check_


def test_a_sound_scene(check):
    code, lines, found = check(TWO)
    assert code == 0 and lines[-1].startswith("sound") and found["sound"]
    assert found["defects"] == [] and found["notes"] != []
    assert [(e["vertices"], e["cells"], e["surface_vertices"]) for e in found["levels"]] == [(13, 10, 12), (25, 26, 20)]
    for entry, shortest in zip(found["levels"], (0.5, 1 / 3), strict=True):
        assert entry["volume"] == pytest.approx(2.0) and entry["shortest_edge"] == pytest.approx(shortest)
        assert entry["smallest_cell"] == pytest.approx(shortest**2 / 2)
        # Between x = 1 and x = 1.005, at half a dhat.
        gap = entry["smallest_gap"]
        assert gap["distance"] == pytest.approx(0.005) and gap["dhats"] == pytest.approx(0.5)
        printed = gap["one"] + gap["other"]
        assert "body 'left'" in printed and "body 'right'" in printed
        assert entry["near_pairs"] > 0
        # Half of a square: 4 sqrt(3) (s^2 / 2) / (4 s^2) = sqrt(3) / 2.
        assert len(entry["worst_cells"]) == 5 and entry["worst_cells"][0]["quality"] == pytest.approx(np.sqrt(3) / 2)
    assert any("push at once" in note for note in found["notes"])


def test_each_level_of_a_thin_body_is_noted_where_it_is_one_cell_thick(check):
    mats = "tuple(meshes.brick((1.0, 1.0, 0.1), (4, 4, n)) for n in (1, 1, 2))"
    body = f"Body({mats}, NeoHookean(1e5), name='mat')"
    _, lines, found = check(f"from pdvol import *\ndef scene():\n    return Scene(({body},), 0.01, 1)\n")
    assert [line for line in lines if "thinnest part: " in line] == [
        f"  cells through the thinnest part: {cells} of mat (0.1 m)" for cells in (1, 1, 2)
    ]
    noted = [note for note in found["notes"] if "one cell lies through the thinnest part of mat" in note]
    assert [note.split(":")[1].strip() for note in noted] == ["level 0", "level 1"]


def test_gaps_to_planes_speed_and_stiffness_are_noted(check):
    words = ("--set", "velocity=(30.0, 40.0)", "--set", "young=2e10", "--set", "apart=1.5", "--set", "dhat=0.1")
    _, lines, found = check(TWO, *words)
    gap = found["levels"][0]["smallest_gap"]
    assert gap["distance"] == pytest.approx(0.5, abs=2e-3) and not found["levels"][0]["near_pairs"]
    assert {gap["one"][:6], gap["other"][:6]} <= {"vertex", "plane ", "edge ("}
    for entry, shortest in zip(found["levels"], (0.5, 1 / 3), strict=True):
        assert entry["speed"] == pytest.approx(50.0)
        assert entry["edges_per_step"] == pytest.approx(50.0 * 0.02 / shortest)
    assert sum("crosses" in note and "shortest edges per step" in note for note in found["notes"]) == 2
    assert found["stiffness_ratio"] == pytest.approx(1e6) and any("linear=direct" in note for note in found["notes"])
    assert "stiffness ratio of the materials: 1e+06" in lines


def test_obstacles_that_no_body_reaches_are_noted(check):
    """A rock inside another, one below the floor; not one that crosses another, nor one in a hollow obstacle."""
    rocks = "".join(
        f"Rigid(Outline({size} * (np.array([(0, 0), (1, 0), (1, 1), (0, 1.0)]) - 0.5) + {at}), name='{name}'{more}), "
        for name, size, at, more in (
            ("big", 1.0, (0.0, 3.0), ""),
            ("small", 0.2, (0.1, 3.0), ""),
            ("low", 0.2, (0.0, -1.0), ""),
            ("across", 0.4, (0.5, 3.0), ""),
            ("room", 20.0, (5.0, 5.0), ", closed=False"),
        )
    )
    _, _, found = check(TWO.replace("obstacles=(", f"obstacles=({rocks}"))
    assert [note for note in found["notes"] if "no body can reach" in note] == [
        "note: obstacle 'small' lies inside obstacle 'big' at t = 0, where no body can reach it",
        "note: obstacle 'low' lies inside plane 'floor' at t = 0, where no body can reach it",
    ]


def test_every_crossing_is_named_and_drawn(check, tmp_path):
    text = TWO.replace("(0.0, -0.5)", "(0.0, 0.1)")
    code, lines, found = check(text, "--set", "apart=0.9", "-o", "drawn")
    assert code == 2 and lines[-1].startswith("not sound") and not found["sound"]
    for level in range(2):
        printed = [line for line in lines if line.startswith(f"defect at level {level}: ")]
        assert (
            len(printed) == 2 and "plane 'floor'" in printed[0] and "crosses" in printed[1] and "edge (" in printed[1]
        )
        drawn = meshio.read(tmp_path / "drawn" / f"defects_{level}.vtu")
        below = np.concatenate(
            [drawn.points[b.data[d == 1].ravel()] for b, d in zip(drawn.cells, drawn.cell_data["defect"], strict=True)]
        )
        assert len(below) and (below[:, 1] <= 0.1).all() and {b.type for b in drawn.cells} == {"vertex", "line"}
        crossing = next(drawn.points[b.data] for b in drawn.cells if b.type == "line")
        assert len(crossing) % 2 == 0
        assert ((crossing[..., 0].min(axis=1) <= 1.0) & (crossing[..., 0].max(axis=1) >= 0.9)).all()
        whole = meshio.read(tmp_path / "drawn" / f"level_{level}.vtu")
        assert set(np.unique(whole.point_data["defect"])) == {0, 1, 2}
        low = whole.points[:, 1] <= 0.1
        assert (whole.point_data["defect"][low] > 0).all()
        assert len(whole.cell_data["quality"][0]) == found["levels"][level]["cells"]
    names = "defects_0.vtu defects_1.vtu level_0.vtu level_1.vtu".split()
    assert sorted(p.name for p in (tmp_path / "drawn").iterdir()) == names


def test_meshes(tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "cube.off", CUBE_OFF)
    write(tmp_path / "open.off", CUBE_OFF.replace("8 12 0", "8 11 0").rsplit("3 3 4 7\n", 1)[0])
    x = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (0.3, 0.3, -0.01)])
    meshio.Mesh(x, [("tetra", np.array([(0, 1, 2, 3), (0, 2, 1, 4)]))]).write("solid.vtu")
    assert pdvol("check", "cube.off", "solid.vtu", "open.off", "--json", "found.json") == 2
    found = json.loads((tmp_path / "found.json").read_text())
    assert all(entry["message"] for entry in found["files"])
    assert [entry["sound"] for entry in found["files"]] == [True, True, False] and not found["sound"]
    assert len(list(tmp_path.iterdir())) == 4, "nothing else is written unasked"
    assert "worst cells (mean ratio) 1 (" in capfd.readouterr().out
    assert pdvol("check", "cube.off", "-o", "drawn") == 0
    assert not (tmp_path / "drawn").exists(), "nothing crosses"


CROSSING_SHAPES = {
    "surface": (together(shifted(BALL, 0.0), shifted(BALL, (1.1, 0.2, 0.1))), "ball.obj", ["line", "triangle"]),
    "touching boxes": (together(shifted(CUBE, 0.0), shifted(CUBE, (1.0, 0.3, 0.4))), "b.off", ["line", "triangle"]),
    "a shell inside": (together(shifted(BALL, 0.0), shifted(BALL, 0.0, size=0.5)), "inner.obj", ["triangle"]),
    "volume mesh": (together(tets(), tets(0.37)), "solid.mesh", ["line", "triangle"]),
}


@pytest.mark.parametrize("case", CROSSING_SHAPES)
def test_all_crossings_of_shapes_are_drawn(tmp_path, capfd, case):
    """Of a mesh file as it is, of a scene as its placement has it; every line crosses the triangle of its number."""
    (points, cells), name, kinds = CROSSING_SHAPES[case]
    (tmp_path / name).write_bytes({".obj": obj, ".off": off, ".mesh": mesh}[Path(name).suffix](points, cells))
    (tmp_path / "cube.off").write_text(CUBE_OFF)
    shape = repr(str(tmp_path / name))
    shape, targets = (f"({shape},)", "()") if name.endswith("mesh") else (shape, "(300,)")
    write(
        tmp_path / "scene.py",
        f"""
import pdvol
def scene():
    place = pdvol.Placement((5.0, 0.0, 0.0))
    return pdvol.Scene((pdvol.Body({shape}, pdvol.NeoHookean(1e5), {targets}, placement=place),), dt=0.01, steps=1)
""",
    )
    for files, number, shift in ((("cube.off", name), 2, 0.0), (("scene.py",), 1, 5.0)):
        out = tmp_path / f"drawn{number}"
        assert pdvol("check", *(tmp_path / file for file in files), "-o", out) == 2
        said = re.search(r"\((\d+) crossings\)", capfd.readouterr().out)
        drawn = meshio.read(out / "defects.vtu")
        assert [path.name for path in out.iterdir()] == ["defects.vtu"]
        assert [block.type for block in drawn.cells] == kinds
        assert all((numbers == number).all() for numbers in drawn.cell_data["defect"])
        corners = [drawn.points[block.data] - (shift, 0.0, 0.0) for block in drawn.cells]
        low, high = points.min(axis=0) - 1e-9, points.max(axis=0) + 1e-9
        assert all(((low <= block) & (block <= high)).all() for block in corners)
        if said:
            assert [len(block) for block in corners] == [int(said[1])] * 2
            overlap = corners[0].min(axis=1) <= corners[1].max(axis=1) + 1e-9
            assert (overlap & (corners[0].max(axis=1) >= corners[1].min(axis=1) - 1e-9)).all(), "boxes of each pair"


# ---- costs


def test_the_estimate_is_within_a_factor_of_three(tmp_path, monkeypatch):
    """Levels of 81 to 1,681 vertices of a square that falls on a plane, measured on level 0 alone, beside what a run
    takes.
    """
    monkeypatch.setattr(time, "perf_counter", time.process_time)  # other programs on the machine do not count
    write(tmp_path / "fall.py", FALL)
    shot = load_shot(tmp_path / "fall.py", {"sizes": (8, 20, 40), "steps": 20})
    found = preflight.check_scene(shot.scene, 5.0)
    run_scene(shot, tmp_path / "run", method="direct")
    records = [json.loads(line) for line in (tmp_path / "run" / "log.jsonl").read_text().splitlines()]
    for entry in found["levels"]:
        taken = sum(r["seconds"]["total"] for r in records if r["level"] == entry["level"])
        assert taken / 3 < entry["seconds"] < 3 * taken, (entry["level"], entry["seconds"], taken)
        memory = max(r["peak_memory_mb"] for r in records if r["level"] == entry["level"])
        assert memory / 3 < entry["memory_mb"] < 3 * memory
    assert found["measured"]["steps"] == 20 and found["measured"]["newton_iterations"] > 1


def test_measuring_ends_in_time_and_says_what_cannot_go_on(tmp_path, monkeypatch):
    found = lambda seconds, **changed: preflight.check_scene(load_shot(tmp_path / "fall.py", changed).scene, seconds)
    write(tmp_path / "fall.py", FALL)
    long = found(0.2, sizes=(8, 9), steps=100_000)
    assert 0 < long["measured"]["steps"] < 100_000
    assert long["levels"][1]["seconds"] == pytest.approx(100_000 * long["levels"][1]["seconds_per_step"])
    assert "measured" not in found(0.0)
    stopped = found(5.0, max_iterations=1, max_halvings=0)
    assert [line[:22] for line in stopped["defects"]] == ["defect: level 0, step "] and not stopped["sound"]
    monkeypatch.setattr(preflight, "LONGEST_STEP", -1.0)
    monkeypatch.setattr("pdvol.integrate.long_step.SHOWN_AFTER", -1.0)
    late = found(5.0)
    assert "measured" not in late and "note: step 1 of level 0 takes more than -1 s" in late["notes"][0]
