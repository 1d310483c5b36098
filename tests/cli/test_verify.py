"""The checker of stored runs finds planted crossings, vertices below a plane and inverted cells, and nothing else."""

import subprocess
import sys

import numpy as np
import pytest

import runs
from pdvol import cli, meshes
from pdvol.measure import meeting, verify
from pdvol.store.writer import RunWriter
from shapes import box, together


def two_blocks(dim, gap=0.25):
    away = np.eye(dim)[0] * (1.0 + gap)
    return together(box(dim, 3), box(dim, 3, away, away + 1.0))


def store(path, dim, states, obstacles=(), mesh=None):
    mesh = two_blocks(dim) if mesh is None else mesh
    writer = RunWriter.create(path, {"dt": 0.01, "steps": len(states) - 1}, [mesh], ["a", "b"])
    runs.write_obstacles(writer.path, list(obstacles))
    for step, state in enumerate(states):
        writer.write_state(0, step, state)
    writer.set_level_state(0, "done")
    writer.close()
    return path


def floor(dim, height=-0.5, **more):
    return {"name": "floor", "kind": "plane", "point": height * np.eye(dim)[1], "normal": np.eye(dim)[1] * 3.0, **more}


def rock(dim, *centre):
    shape = meshes.disc(0.2, 24) if dim == 2 else meshes.ball(0.2, 1)
    if dim == 3:
        return {"name": "rock", "kind": "mesh", "vertices": shape.vertices + centre, "faces": shape.triangles}
    edges = np.column_stack([np.arange(24), np.roll(np.arange(24), -1)])
    return {"name": "rock", "kind": "polyline", "vertices": shape.points + centre[:2], "edges": edges}


def moved(dim, by, body=1, axis=0):
    mesh = two_blocks(dim)
    x = mesh.points.copy()
    x[mesh.point_bodies == body, axis] += by
    return x


@pytest.mark.parametrize("dim", [2, 3])
def test_a_sound_run(tmp_path, dim, capsys):
    # Flat, coplanar faces a hair apart, a turned copy far from the origin, an obstacle a hair beside.
    x = two_blocks(dim).points
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(dim, dim)))[0]
    turn[:, 0] *= np.linalg.det(turn)
    states = [x, moved(dim, -0.25 + 1e-12), x + 10.0 * np.eye(dim)[1], (x - 0.5) @ turn.T + 50.0]
    path = store(tmp_path / "run", dim, states, [floor(dim), rock(dim, 0.5, -0.21, 0.5)])
    assert verify.verify_run(path) == []
    assert cli.run(["verify", str(path)]) == 0
    assert "level 0: 4 states, smallest plane gap 0.5 m, smallest det F 1, 0 intersections" in capsys.readouterr().out


@pytest.mark.parametrize("dim", [2, 3])
def test_what_is_planted_is_found(tmp_path, dim, capsys):
    x = two_blocks(dim).points
    low = x.copy()
    low[0, 1] = -0.5 - 1e-13
    inverted, (one, *_, last) = x.copy(), two_blocks(dim).cells[4]
    inverted[one] += 1.5 * (x[last] - x[one])
    raised = moved(dim, 0.3, body=0, axis=1) - 0.45 * np.eye(dim)[1]
    states = [x, low, moved(dim, -0.3), moved(dim, -0.25), inverted, raised]
    path = store(tmp_path / "run", dim, states, [floor(dim), rock(dim, -0.21, 0.5, 0.5)])
    printed = verify.verify_run(path)
    assert all(line.startswith("level 0 step ") for line in printed)
    of = [" | ".join(line for line in printed if line.startswith(f"level 0 step {step}:")) for step in range(6)]
    assert of[0] == ""
    assert "1 vertices not above plane 'floor', the worst 0" in of[1] and "intersections" not in of[1]
    assert "intersections: vertex" in of[2] and "inverted" not in of[2]
    assert "intersections: vertex" in of[3]  # touching exactly
    assert "inverted or flat cells" in of[4] and "not above" not in of[4]
    assert of[5] == ""
    assert cli.run(["verify", str(path)]) == 1
    assert "smallest det F -" in capsys.readouterr().out


@pytest.mark.parametrize("dim", [2, 3])
def test_obstacles(tmp_path, dim):
    x = two_blocks(dim).points
    still = rock(dim, 0.5, -0.21, 0.5)
    moving = {**rock(dim, 1.125, 1.3, 0.5)}
    moving["positions"] = np.stack([moving["vertices"], moving["vertices"] - 0.2 * np.eye(dim)[1]])
    moving["name"] = "hammer"
    states = [x, x, x - 0.02 * np.eye(dim)[1]]
    printed = verify.verify_run(store(tmp_path / "run", dim, states, [still, moving]))
    assert not any("step 0" in line for line in printed)
    assert any("step 1" in line and "obstacle 1" in line and "obstacle 0" not in line for line in printed)
    assert any("step 2" in line and "obstacle 0" in line for line in printed)
    sinking = floor(dim)
    sinking["point"] = np.stack([sinking["point"], sinking["point"] + 0.6 * np.eye(dim)[1]])
    sinking["normal"] = np.stack([sinking["normal"]] * 2)
    (line,) = verify.verify_run(store(tmp_path / "rising", dim, [x, x], [sinking]))
    assert line.startswith("level 0 step 1:") and "not above plane" in line


def test_damaged_and_missing_states(tmp_path, capsys):
    x = two_blocks(2).points
    path = store(tmp_path / "run", 2, [x, x, x])
    runs.put_state(path / "levels" / "0", 1, np.where(x > 2, np.nan, x))
    (line,) = verify.verify_run(path)
    assert line.startswith("level 0 step 1:") and "finite" in line and line.endswith("usable states of level 0: 0, 2")
    sound = store(tmp_path / "sound", 2, [x, x, x])
    (path / "levels" / "0" / "mesh.npz").write_bytes(b"nothing")
    assert cli.run(["verify", str(path), str(sound)]) == 1
    out = capsys.readouterr().out
    assert "  damaged: " in out and "mesh.npz" in out and "level 0: 3 states" in out
    (path / "run.json").write_text("{")
    assert cli.run(["verify", str(path)]) == 1
    runs.keep_states(sound / "levels" / "0", 2)
    assert verify.verify_run(sound) == ["level 0: done, with 2 states of 3"]


def test_every(tmp_path, capsys):
    x = two_blocks(2).points
    path = store(tmp_path / "run", 2, [x, moved(2, -0.3), x, x, moved(2, -0.3), x])
    assert [level.steps for level in verify.check_levels(path, 3)] == [3]  # 0, 3 and the last one, 5
    assert cli.run(["verify", str(path), "--every", "3"]) == 0
    assert cli.run(["verify", str(path), "--every", "2"]) == 1
    assert "level 0: 4 states" in capsys.readouterr().out


def test_it_shares_nothing_with_the_solver():
    program = """
import sys
import pdvol.measure.verify
print(*sorted(name for name in sys.modules if name.startswith("pdvol.")))
print(*sorted({name.partition(".")[0] for name in sys.modules}))
"""
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=100, check=True)
    own, packages = (set(line.split()) for line in ended.stdout.splitlines())
    assert {name for name in own if not name.startswith("pdvol.store")} == {
        "pdvol.errors",
        "pdvol.geometry",
        "pdvol.geometry.level_mesh",
        "pdvol.measure",
        "pdvol.measure.meeting",
        "pdvol.measure.verify",
    }
    assert not packages & {"ipctk", "igl", "dolfinx", "petsc4py", "mpi4py", "scipy"}


def test_random_primitives_against_every_pair():
    rng = np.random.default_rng(1)
    points, facets = rng.random((90, 3)), np.arange(90).reshape(30, 3)
    edges = verify.edges_of(facets)
    expected = {
        (*e, *f)
        for e in edges
        for f in facets
        if not set(e) & set(f) and meeting.segment_meets_triangle(*points[e], *points[f])
    }
    found = meeting.crossing_edges(points, edges, facets, np.ones(90, bool))
    assert len(found) > 50 and set(found) == expected
    points, edges = rng.random((80, 2)), np.arange(80).reshape(40, 2)
    expected = {
        (*a, *b) for i, a in enumerate(edges) for b in edges[i + 1 :] if meeting.segments_meet(*points[a], *points[b])
    }
    found = meeting.crossing_segments(points, edges, np.ones(80, bool))
    assert len(found) > 50 and set(found) == expected


@pytest.mark.parametrize(
    ("p", "q", "meets"),
    [
        ((0.2, 0.2, -1), (0.2, 0.2, 1), True),
        ((0.2, 0.2, 1e-300), (0.2, 0.2, 1), False),
        ((0.2, 0.2, 0), (0.2, 0.2, 1), True),
        ((1, 0, -1), (1, 0, 1), True),
        ((0.5, 0.5, -1), (0.5, 0.5, 1), True),
        ((0.5, 0.5000000000000001, -1), (0.5, 0.5, 1), False),
        ((-1, 0.3, 0), (2, 0.3, 0), True),
        ((0.1, 0.1, 0), (0.2, 0.2, 0), True),
        ((0.6, 0.6, 0), (2, 0, 0), False),
        ((2, 0, 0), (3, 0, 0), False),
    ],
)
def test_edges_and_a_triangle_by_hand(p, q, meets):
    # The triangle (0, 0), (1, 0), (0, 1) in z = 0: through, a hair above, an end on it, through a corner, a side, a
    # hair beside a side, coplanar.
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), p, q], dtype=float)
    assert bool(meeting.crossing_edges(points, np.array([[3, 4]]), np.array([[0, 1, 2]]), np.ones(5, bool))) == meets


def test_boxes_of_very_different_size():
    rng = np.random.default_rng(3)
    low_a, low_b = rng.random((300, 3)), rng.random((40, 3))
    high_a = low_a + 0.02 * rng.random((300, 3))
    high_b = low_b + 10.0 ** rng.uniform(-4, 1, (40, 1)) * rng.random((40, 3))
    expected = {
        (i, j) for i in range(300) for j in range(40) if (low_a[i] <= high_b[j]).all() and (low_b[j] <= high_a[i]).all()
    }
    assert {tuple(pair) for pair in meeting.overlapping_boxes(low_a, high_a, low_b, high_b)} == expected
