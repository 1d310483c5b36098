"""From scenes to level meshes: sizes, placement, regions, what is kept and what is refused."""

import re
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from hostile_files import shifted, together
from pdvol import meshes
from pdvol.errors import InputError, IntersectionError, InvertedCellError, MeshError
from pdvol.meshes import Outline, Solid, Surface
from pdvol.meshing import build
from pdvol.meshing import tetrahedralise as tetrahedra
from pdvol.meshing.build import build_levels, read_obstacle
from pdvol.meshing.cache import fetch
from pdvol.meshing.cpu_budget import ProcessStopped
from pdvol.meshing.edge_length import SizedMesh, UnreachableCount, mesh_of_target_size
from pdvol.meshing.remesh import Unsuited
from pdvol.scene import Body, NeoHookean, Placement, Rigid, Scene
from shapes import grid, solid

CROSSED = np.array([[0.0, 0], [1, 1], [1, 0], [0, 1]])
TETRAHEDRON = np.vstack([np.zeros(3), np.eye(3)]), np.arange(4)[None]

SOFT = NeoHookean(2e5)


def scene(*bodies):
    return Scene(bodies=bodies, dt=0.01, steps=1)


def disc_body(**settings):
    return Body(shape=meshes.disc(1.0, 100), material=SOFT, vertices=(40, 120), **settings)


def strip(n=8):
    """A 2D solid: a strip of 2n triangles along x, the left half region 1, the right half region 2."""
    mesh = grid(np.linspace(0.0, 1.0, n + 1), [0.0, 0.3])
    regions = np.where(mesh.points[mesh.cells].mean(axis=1)[:, 0] < 0.5, 1, 2)
    return Solid(mesh.points, mesh.cells.astype(np.int32), regions.astype(np.int32))


def test_two_bodies_in_one_level_mesh(tmp_path):
    apart = Placement(translate=(5.0, 1.0), angle=0.3, scale=2.0)
    levels = build_levels(scene(disc_body(name="a"), disc_body(name="b", placement=apart)), cache=tmp_path)
    for mesh, target in zip(levels, (40, 120), strict=True):
        half = len(mesh.points) // 2
        assert half == pytest.approx(target, rel=0.25) and mesh.volumes.min() > 0.0
        assert mesh.cells.dtype == np.int64 and mesh.bodies.dtype == np.int32
        assert np.array_equal(mesh.point_bodies, np.repeat([0, 1], half))
        assert np.array_equal(mesh.points[half:], apart(mesh.points[:half])), "one mesh, placed twice"
    assert len(list(tmp_path.glob("*.npz"))) == 2, "built once"


def test_the_cache_is_used_mended_and_not_needed(tmp_path, monkeypatch):
    calls, mesher = [], build.triangulate
    monkeypatch.setattr(build, "triangulate", lambda *a: calls.append(a) or mesher(*a))
    fresh = build_levels(scene(disc_body()), cache=tmp_path)
    again = build_levels(scene(disc_body(placement=Placement(angle=1.0))), cache=tmp_path)
    assert len(calls) == 2, "a placement does not matter to the cache"
    assert np.array_equal(again[0].cells, fresh[0].cells) and not list(tmp_path.glob("*.partial"))
    for kept in tmp_path.glob("*-0.npz"):
        kept.write_bytes(kept.read_bytes()[:200])
    assert np.array_equal(build_levels(scene(disc_body()), cache=tmp_path)[0].points, fresh[0].points)
    assert len(calls) == 3, "only the damaged one"
    build_levels(scene(replace(disc_body(), vertices=(40, 121))), count=1, cache=tmp_path)
    assert len(calls) == 4, "other targets, other hierarchy"
    (tmp_path / "file").touch()
    (alone,) = build_levels(scene(disc_body()), count=1, cache=tmp_path / "file" / "meshes")
    assert np.array_equal(alone.points, fresh[0].points)
    with pytest.raises(InputError, match="at least one level"):
        build_levels(scene(disc_body()), count=0, cache=tmp_path)


def test_of_several_that_need_a_mesh_at_once_one_builds_it(tmp_path):
    built = []

    def make():
        built.append(time.monotonic())
        time.sleep(0.3)
        return {"points": np.arange(3.0)}

    with pytest.raises(ValueError, match="no mesh"):  # who fails leaves it to the next one
        fetch(tmp_path, "key", lambda: int("no mesh"))
    assert list(tmp_path.iterdir()) == []
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda _: fetch(tmp_path, "key", make)["points"].tolist(), range(4)))
    assert len(built) == 1 and found == [[0.0, 1.0, 2.0]] * 4
    assert [path.name for path in tmp_path.iterdir()] == ["key.npz"]


def test_regions_are_carried_over(tmp_path):
    body = Body(shape=strip(), material=SOFT, vertices=(60, 240))
    for mesh in build_levels(scene(body), cache=tmp_path):
        x = mesh.points[mesh.cells].mean(axis=1)[:, 0]
        clear = abs(x - 0.5) > 1e-9
        assert np.array_equal(mesh.regions[clear], np.where(x < 0.5, 1, 2)[clear])
        assert mesh.volumes.sum() == pytest.approx(0.3, rel=1e-6)


def test_a_list_of_meshes_is_taken_as_it_is_or_meshed(tmp_path):
    listed, aside = (strip(4), strip(9)), Placement(translate=(1.0, 0.0))
    levels = build_levels(scene(Body(shape=listed, material=SOFT, placement=aside)), cache=tmp_path)
    for mesh, taken in zip(levels, listed, strict=True):
        assert np.array_equal(mesh.points, taken.vertices + [1.0, 0.0])
        assert np.array_equal(mesh.cells, taken.cells) and np.array_equal(mesh.regions, taken.regions)
    assert not list(tmp_path.iterdir())
    body = Body(shape=(strip(4), meshes.disc(1.0, 64), meshes.disc(1.0, 64)), material=SOFT, vertices=(10, 60, 200))
    levels = build_levels(scene(body), cache=tmp_path)
    assert np.array_equal(levels[0].points, strip(4).vertices), "a volume mesh is taken as it is"
    for mesh, asked in zip(levels[1:], (60, 200), strict=True):
        assert len(mesh.points) == pytest.approx(asked, rel=0.25)
        assert mesh.volumes.sum() == pytest.approx(np.pi, rel=0.05)


def test_bad_shapes_name_the_body_and_leave_nothing(tmp_path):
    cube, bad = meshes.box(), strip(4)
    bad.cells[2] = bad.cells[2, ::-1]
    odd = lambda shape, *vertices: Body(shape=shape, material=SOFT, vertices=vertices, name="odd")
    for bodies, error, match in (
        (lambda: (odd(tmp_path / "none.obj", 50),), InputError, "no such file"),
        (lambda: (odd(Surface(cube.vertices, cube.triangles[1:]), 50),), MeshError, "body 'odd': the surface is open"),
        (lambda: (odd(Outline(CROSSED), 50),), IntersectionError, "body 'odd': segments"),
        (lambda: (odd(Surface(cube.vertices * np.nan, cube.triangles), 50),), MeshError, "body 'odd': .*NaN"),
        (lambda: (odd((strip(4), meshes.disc())),), MeshError, r"body 'odd', level 1: .*volume meshes"),
        (lambda: (odd((bad,)),), InvertedCellError, r"level 0: cells 2 are inverted"),
        (lambda: (odd((strip(4), meshes.disc()), 9, 9, 9),), InputError, "3 vertex targets for a list of 2 meshes"),
        (lambda: [Body((solid(d, 1),), SOFT, name=f"{d}") for d in (2, 3)], InputError, "all be 2D or all 3D"),
    ):
        with pytest.raises(error, match=match) as caught:
            build_levels(scene(*bodies()), cache=tmp_path / "cache")
        assert "\n" not in str(caught.value)
    assert not (tmp_path / "cache").exists()


@pytest.mark.parametrize(
    ("reached", "said"),
    [
        ({300: 700, 700: 1500, 1500: None}, "300 vertices cannot be had, the closest mesh has 700; ask for about 1500"),
        ({300: 700, 700: 1500, 1500: 4000}, "the closest mesh has 700, nor about 1500; ask for many more"),
        ({300: 0, 600: 0, 1200: None}, r"of about 300 vertices came out \(crossed\); ask for about 1200 instead"),
        ({300: -1, 600: None}, "no mesh of about 300 vertices: used up its 31 s; ask for about 600 instead"),
        ({300: 0, 600: 9000, 9000: None}, "ask for about 9000 instead, and for no fewer on finer levels"),
        ({300: 0, 600: 0, 1200: 0}, r"of about 300 vertices came out \(crossed\), nor about 1200; ask for many more"),
    ],
)
def test_a_number_that_is_named_has_been_tried(tmp_path, monkeypatch, reached, said):
    """As many vertices as the mesher gives instead, or twice as many where nothing valid comes out, until it gives what
    it is asked for; the advice works if taken.
    """

    def unsuited(*_):
        raise Unsuited("round")

    def mesher(surface, target, name, volume, flat):
        def make(scale, failures):
            if reached[target] in (0, -1):
                raise MeshError("crossed") if reached[target] == 0 else ProcessStopped("used up its 31 s")
            points = np.zeros((reached[target] or target, 3))
            return SizedMesh(points, TETRAHEDRON[1], points)

        mesh_of_target_size(make, target, name, 1.0, 3)
        return SizedMesh(*TETRAHEDRON, TETRAHEDRON[0])

    monkeypatch.setattr(build, "remesh", unsuited)
    monkeypatch.setattr(build, "tetrahedralise", mesher)
    body = Body(meshes.ball(0.5, 2), NeoHookean(1e5), (300, 5000), name="boot")
    scene = Scene((body,), dt=0.01, steps=0)
    reached[5000] = None
    with pytest.raises(MeshError, match=said) as caught:
        build_levels(scene, cache=tmp_path)
    assert "body 'boot', level 0" in str(caught.value)
    named = re.search(r"ask for about (\d+) instead", str(caught.value))
    if named:
        targets = (int(named[1]), max(int(named[1]), 5000))
        assert len(build_levels(replace(scene, bodies=(replace(body, vertices=targets),)), cache=tmp_path)) == 2


def test_parts_that_need_more_vertices_speak_of_the_whole_body(monkeypatch):
    """Eight parts share what a body asks for; the number to ask for is the body's again."""
    surface = Surface(*together(*(shifted(meshes.ball(0.3, 2), (k, 0.0, 0.0)) for k in range(8))))

    def one(unit, target, name, volume, flat):
        if target < 200:
            raise UnreachableCount(f"{name}: {target} vertices cannot be had", target, 200)
        return SizedMesh(*TETRAHEDRON, TETRAHEDRON[0])

    monkeypatch.setattr(tetrahedra, "_unit_mesh", one)
    with pytest.raises(UnreachableCount, match=r"x: 300 vertices .* all parts \(part 1 of 8: 38 vertices") as caught:
        tetrahedra.tetrahedralise(surface, 300, "x")
    assert 8 * 180 < caught.value.closest < 8 * 230
    with pytest.raises(MeshError, match="x: 60 vertices are too few for its 8 parts; ask for 160 or more"):
        tetrahedra.tetrahedralise(surface, 60, "x")
    assert len(tetrahedra.tetrahedralise(surface, caught.value.closest + 80, "x").points) == 8 * 4


def test_obstacles():
    at, spike, cube = Placement(translate=(0.0, -1.0)), meshes.spike(0.4, 1.0), meshes.box()
    points, edges, faces = read_obstacle(Rigid(shape=spike, placement=at))
    assert np.array_equal(points, spike.points + [0.0, -1.0])
    assert edges.tolist() == [[0, 1], [1, 2], [2, 0]] and faces.shape == (0, 3)
    sheet = Surface(cube.vertices, cube.triangles[1:])
    for shape, closed, counts in (
        (spike, False, (3, 2, 0)),
        (meshes.ball(1.0, 1), True, (42, 120, 80)),
        (strip(), True, (18, 18, 0)),
        (sheet, False, (8, 18, 11)),
    ):
        assert tuple(map(len, read_obstacle(Rigid(shape=shape, closed=closed)))) == counts
    with pytest.raises(MeshError, match="obstacle 'tray': the surface is open"):
        read_obstacle(Rigid(shape=sheet, name="tray"))
