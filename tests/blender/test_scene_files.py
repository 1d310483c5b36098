"""What Blender's extension writes is an ordinary scene file: pdvol reads it as it is, and simulates what it says."""

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pdvol
from blender.shot.description import Mesh, Pull, ShotError
from blender.shot.files import read_pc2, write_obj, write_pc2, write_weights
from blender.shot.names import plain_names
from blender.shot.scene_text import open_shapes, parameters, scene_text, write_shot
from blender_shots import STEPS, mesh_of, places, two_bodies
from pdvol import meshes
from pdvol.meshing.surface_files import parse_obj
from pdvol.runs.scene_file import load_shot, scene_parameters

EXTENSION = Path(__file__).resolve().parents[2] / "blender"


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """The shot of two bodies, written, read and simulated by pdvol; its folder and the run."""
    folder = tmp_path_factory.mktemp("blender")
    write_shot(two_bodies(), places(folder))
    shot = load_shot(places(folder).scene)
    return folder, shot, pdvol.run(shot.scene, folder / "run")


def test_the_scene_is_what_was_described_and_can_be_varied(simulated):
    folder, shot, _ = simulated
    scene = shot.scene
    assert [body.name for body in scene.bodies] == ["bar", "ball"]
    assert scene.dt == pytest.approx(1 / 48) and scene.steps == 6
    assert [type(o).__name__ for o in scene.obstacles] == ["Plane", "Deforming"]
    assert scene.obstacles[0].point == (0.0, 0.0, -0.5)
    assert scene.loads[0].acceleration == (0.0, 0.0, -9.81)
    bar, ball = scene.bodies
    assert (bar.material.young, ball.material.young, ball.velocity) == (1e4, 1e6, (0.0, 0.0, -1.0))
    assert bar.regions[0].material.young == 1e6
    assert (len(bar.render_meshes), len(ball.render_meshes)) == (1, 2)
    file = places(folder).scene
    assert list(scene_parameters(file)) == list(parameters(two_bodies()))
    changed = load_shot(file, {"ball_speed_x": 2.0, "friction": 0.7, "bar_young": 5e3}).scene
    assert changed.bodies[1].velocity == (2.0, 0.0, -1.0) and changed.bodies[0].material.young == 5e3
    assert next(c for c in changed.contact if isinstance(c, pdvol.Friction)).mu == 0.7


def test_a_body_is_pulled_in_some_frames(tmp_path):
    shot = two_bodies()
    way = shot.bodies[1].shape.points[0] + np.array([[0.0, 0.0, 0.0], [0.0, 0.25, 0.5]])
    pulled = replace(shot.bodies[1], pull=Pull(way[0], 1, way))
    write_shot(replace(shot, bodies=(shot.bodies[0], pulled)), places(tmp_path))
    (pull,) = load_shot(places(tmp_path).scene).scene.pulls
    assert pull.body == "ball" and pull.acts(1 / 24, 2 / 24) and not pull.acts(0.0, 1 / 24)
    np.testing.assert_allclose([pull.where, *pull.points], way[[0, 0, 1]], atol=1e-8)


def test_pins_follow_the_animation_and_obstacles_theirs(simulated):
    """On both levels, to the single precision of the caches."""
    _, _, run = simulated
    for level in run.levels:
        held = (level.mesh.point_bodies == 0) & (level.rest[:, 0] < -0.4999)
        assert held.sum() >= 4
        assert level.positions(6)[held] == pytest.approx(level.rest[held] + [0.0, 0.0, 0.1], abs=1e-6)
        assert level.placed(run.obstacles, 6)[1].vertices(6)[:, 2].max() == pytest.approx(0.125 - 0.1, abs=1e-6)


def test_what_follows_has_blenders_vertices_in_their_order(simulated, tmp_path):
    folder, _, run = simulated
    shot = two_bodies()
    ball = shot.bodies[1]
    from pdvol.studio.export.exports import export_run

    export_run(run.path, "pc2", tmp_path, [1], 24.0, crossings=False)
    seen, rendered = (read_pc2(tmp_path / "level_1" / name) for name in ("ball_render.pc2", "ball_render_1.pc2"))
    assert seen[0] == pytest.approx(ball.shape.points, abs=1e-6)
    assert rendered[0] == pytest.approx(ball.rendered.points, abs=1e-6)
    assert len(seen) == shot.frames + 1
    fall = seen[-1][:, 2].mean() - seen[0][:, 2].mean()
    assert fall == pytest.approx(-1.0 * 3 / 24 - 0.5 * 9.81 * (3 / 24) ** 2, abs=0.02)


def test_the_file_moves_with_its_folder_and_is_written_again_only_where_it_changes(tmp_path):
    shot, at = two_bodies(), places(tmp_path / "here")
    write_shot(shot, at)
    stamps = {p: p.stat().st_mtime_ns for p in at.meshes.iterdir()}
    written = "bar.obj bar.pc2 bar_held_end.txt bar_stiff_end.txt ball.obj ball_render.obj plate.obj plate.pc2"
    assert {p.name for p in stamps} == set(written.split())
    write_shot(replace(shot, friction=0.1), at)
    kept = {p: p.stat().st_mtime_ns for p in at.meshes.iterdir() if p.suffix != ".pc2"}
    assert kept == {p: stamp for p, stamp in stamps.items() if p.suffix != ".pc2"}
    (tmp_path / "here").rename(tmp_path / "there")
    moved = load_shot(places(tmp_path / "there").scene)
    assert str(moved.scene.bodies[0].shape).startswith(str(tmp_path / "there"))


def test_what_a_shot_lacks_its_file_does_not_name(tmp_path):
    full = two_bodies()
    ball = replace(full.bodies[1], rendered=None, velocity=(0.0, 0.0, 0.0))
    shot = replace(full, bodies=(ball,), obstacles=(), ground=None, gravity=None, friction=0.0)
    text = scene_text(shot, places(tmp_path))
    nodes = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ImportFrom)]
    imported = next(node for node in nodes if node.module == "pdvol")
    assert [alias.name for alias in imported.names] == ["Barrier", "Body", "NeoHookean", "RenderMesh", "Scene"]
    write_shot(shot, places(tmp_path))
    scene = load_shot(places(tmp_path).scene).scene
    assert (scene.obstacles, scene.loads, scene.supports, len(scene.contact)) == ((), (), (), 1)
    write_shot(full, places(tmp_path))
    write_shot(shot, places(tmp_path))
    assert [p.name for p in places(tmp_path).meshes.iterdir()] == ["ball.obj"]


def test_a_repaired_body_is_simulated_by_its_closed_copy(tmp_path):
    shot = two_bodies()
    repaired = replace(shot.bodies[1], repair=True, hole=2.5)
    text = scene_text(replace(shot, bodies=(shot.bodies[0], repaired)), places(tmp_path))
    assert 'MESHES / "ball_closed.obj",' in text and 'RenderMesh(MESHES / "ball.obj")' in text
    shot, at = replace(shot, bodies=(repaired,)), places(tmp_path)
    write_shot(shot, at)
    pair = at.meshes / "ball.obj", at.meshes / "ball_closed.obj"
    assert open_shapes(shot, at.meshes) == [(*pair, 2.5)]
    pair[1].write_text("closed")
    write_shot(replace(shot, friction=0.2), at)
    assert open_shapes(shot, at.meshes) == [] and pair[1].exists()  # the mesh is as it was
    moved = replace(repaired, shape=mesh_of(meshes.ball(0.2, 2), (0.0, 0.0, 0.5)))
    write_shot(replace(shot, bodies=(moved,)), at)
    assert open_shapes(shot, at.meshes) == [(*pair, 2.5)]


def test_mistakes_are_one_line(tmp_path):
    shot = two_bodies()
    with pytest.raises(ShotError, match="there is no soft body"):
        write_shot(replace(shot, bodies=()), places(tmp_path))
    other = replace(shot.bodies[1], vertices=(60,))
    with pytest.raises(ShotError, match="'Ball.001' has 1 levels and 'the bar' has 2"):
        write_shot(replace(shot, bodies=(shot.bodies[0], other)), places(tmp_path))
    assert not places(tmp_path).scene.exists()


def test_names_are_plain_different_and_none_of_pdvols_own():
    labels = ["Cube", "cube", "Cube.001", "Würfel 2", "3", "", "ground", "x" * 90, "Cube_render", "class"]
    names = plain_names(labels)
    assert len({name.lower() for name in names}) == len(labels)
    assert names[:3] == ["Cube", "cube_2", "Cube_001"] and names[4:7] == ["_3", "body", "ground_2"]
    assert names[8] == "Cube_render_mesh" and all(name.isidentifier() for name in names[:9])
    from pdvol.studio.export.parts import plain_names as pdvols

    assert pdvols(names) == names


def test_meshes_keep_polygons_and_caches_their_rate(tmp_path):
    square = Mesh(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1e-7]]), np.array([4]), np.arange(4))
    write_obj(tmp_path / "square.obj", square)
    read = parse_obj(tmp_path / "square.obj")
    assert read.faces == [[0, 1, 2, 3]] and np.array_equal(read.points, square.points)
    assert not square.closed and mesh_of(meshes.box((1, 1, 1))).closed
    frames = np.random.default_rng(0).normal(size=(5, 4, 3))
    write_pc2(tmp_path / "x.pc2", frames, 1.0 / STEPS)
    cache = pdvol.PointCache(tmp_path / "x.pc2", fps=24.0)
    from pdvol.meshing.point_caches import read_frames

    assert read_frames(cache).times == pytest.approx(np.arange(5) / 48)
    assert read_pc2(tmp_path / "x.pc2") == pytest.approx(frames, abs=1e-6)
    (tmp_path / "x.pc2").write_bytes((tmp_path / "x.pc2").read_bytes()[:-4])
    with pytest.raises(ValueError, match="truncated"):
        read_pc2(tmp_path / "x.pc2")
    weights = np.array([0.1, 1.0 / 3.0, float(np.float32(0.7)), 0.0, 1.0])
    write_weights(tmp_path / "weights.txt", weights)
    assert np.loadtxt(tmp_path / "weights.txt").tolist() == weights.tolist(), "all digits"


def test_only_the_addon_folder_imports_bpy_and_nothing_imports_pdvol():
    for path in sorted(EXTENSION.rglob("*.py")):
        taken = set()
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                taken |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                taken.add(str(node.module).split(".")[0])
        assert "pdvol" not in taken, path
        assert "bpy" not in taken or path.parent.name == "addon", path
