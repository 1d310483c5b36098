"""`repair` unites what crosses, keeps what was given, says what changed, and refuses what it cannot mend."""

import re

import igl
import numpy as np
import pytest

from cli_scenes import pdvol
from hostile_files import obj, shifted, together
from pdvol.errors import MeshError
from pdvol.geometry.closed_surfaces import enclosed_volume
from pdvol.meshes import Surface, ball, box
from pdvol.meshing.repair import repair
from pdvol.meshing.verdict import judge
from pdvol.meshing.weld import weld_open

BALL, ROUND = ball(1.0, 3), ball(1.0, 2)
CUBE = box()
TURN = np.linalg.qr(np.array([[2.0, 0.3, -0.7], [0.1, 1.0, 0.9], [0.5, -0.4, 1.5]]))[0]
"""A rotation (or a reflection, which turns triangles alike)."""


def bar(length, at, turned=False, side=0.3, turn=((1, 0, 0), (0, 1, 0), (0, 0, 1))):
    """A box along x, turned by a matrix and moved."""
    points = CUBE.vertices * (length, side, side)
    return points @ np.asarray(turn).T + np.asarray(at), CUBE.triangles[:, ::-1] if turned else CUBE.triangles


def mended(points, triangles, hole=1.0, envelope=1e-3):
    return repair(Surface(points, np.asarray(triangles, dtype=np.int32)), 1e-8, hole, envelope, "thing")


def slope(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def ball_at(at, size, turned=False):
    return shifted(ROUND, at, turned, size)


LEG = {"side": 1.0, "turn": slope(1.57)}
CROSSING = {
    # name: parts, number of shells of the result
    "a slanting limb": ((ball_at(0.0, 1.0), bar(1.2, (0.9, 0.7, 0.1), turn=slope(0.7))), 1),
    "a limb that faces inward": ((ball_at(0.0, 1.0), bar(1.0, (1.2, 0.0, 0.0), turned=True)), 1),
    "a bar through a body": ((ball_at(0.0, 1.0), bar(3.0, (0.0, 0.1, 0.05))), 1),
    "legs": ((bar(2.0, (-1.5, 0, 0), **LEG), bar(2.0, (1.5, 0, 0), **LEG), bar(3.0, (0, 0.1, 0.1))), 1),
    "a wall through the hull": ((shifted(CUBE, 0.0), bar(0.02, (0.5, 0.0, 0.0), side=0.6)), 1),
    "a cavity and a limb": ((ball_at(0.0, 1.0), ball_at(0.0, 0.4, True), bar(1.0, (1.2, 0.0, 0.0))), 2),
    "a rod in a cavity": ((ball_at(0.0, 2.0), ball_at(0.0, 1.0, True), bar(1.0, (1.2, 0, 0), side=0.2)), 2),
    "two bubbles": ((ball_at(0.0, 2.0), ball_at((0.4, 0, 0), 0.7), ball_at((-0.4, 0.1, 0), 0.7)), 2),
    "touching sides": ((shifted(CUBE, 0.0), shifted(CUBE, (1.0, 0.25, 0.3))), 1),
    "the same side": ((shifted(CUBE, 0.0), shifted(CUBE, (1.0, 0.0, 0.0))), 1),
    "a block in a corner": ((shifted(CUBE, 0.0, size=2.0), shifted(CUBE, (0.5, 0.5, 0.5))), 1),
}


def solid_at(parts, name, queries):
    """Whether points lie in the solid that is meant, by the winding number of each part alone."""
    around = [np.abs(igl.winding_number(*map(np.ascontiguousarray, part), queries)) > 0.5 for part in parts]
    if "a cavity" in name:
        return around[0] & ~around[1] | around[2]
    if name == "two bubbles":
        return around[0] & ~around[1] & ~around[2]
    return np.any(around, axis=0)


@pytest.mark.parametrize(
    ("name", "rotated"), [*((name, False) for name in CROSSING), ("a cavity and a limb", True), ("the same side", True)]
)
def test_shells_that_cross_are_united(name, rotated):
    """The result holds exactly the points that the parts hold, found by each part alone; its box is theirs."""
    parts, count = CROSSING[name]
    matrix = TURN if rotated else np.eye(3)
    points, triangles = together(*parts)
    given = np.round(points @ matrix.T, 6) if rotated else points, triangles  # as a file in text has them
    result, done = mended(*given)
    judge(result, name)
    size = np.linalg.norm(np.ptp(given[0], axis=0))
    low, high = given[0].min(axis=0), given[0].max(axis=0)
    assert np.abs(result.vertices.min(axis=0) - low).max() < 1e-3 * size
    assert np.abs(result.vertices.max(axis=0) - high).max() < 1e-3 * size
    queries = np.random.default_rng(0).uniform(low, high, (4000, 3))
    near = np.sqrt(igl.point_mesh_squared_distance(queries, result.vertices, result.triangles.astype(np.int64))[0])
    queries = queries[near > 2e-3 * size]
    inside = igl.winding_number(result.vertices, result.triangles.astype(np.int64), queries) > 0.5
    assert (inside == solid_at([(p @ matrix.T, t) for p, t in parts], name, queries)).all()
    assert len(np.unique(igl.connected_components(igl.adjacency_matrix(result.triangles.astype(np.int64)))[1])) == count
    assert any(line.startswith("united") for line in done)
    assert re.search(f"compared with the input: shells {len(parts)} -> {count}", done[-1])
    if name == "a slanting limb":  # far from the limb the ball has its own vertices
        assert set(map(tuple, ROUND.vertices[ROUND.vertices[:, 0] < 0.0])) <= set(map(tuple, result.vertices))


def test_a_shell_wholly_inside_becomes_a_cavity_and_the_next_one_a_body():
    nested = together(*(shifted(BALL, 0.0, size=size) for size in (1.0, 0.7, 0.4)))
    result, done = mended(*nested)
    assert done[0] == "1 shells turned inside out" and re.search(r"volume 5.84\d+ m\^3 -> 2.99\d+ m\^3", done[-1])
    assert np.array_equal(result.vertices, nested[0])


@pytest.mark.parametrize(("at", "volume"), [((0.0, 0.0, 0.3), 1 - 0.064), ((0.3, 0.3, 0.0), 1 - 0.064)])
def test_a_cavity_that_is_flush_with_the_hull_becomes_a_pocket(at, volume):
    """At a face, or along an edge: its lid, which has nothing on either side, goes."""
    result, done = mended(*together(shifted(CUBE, 0.0), bar(0.4, at, True, 0.4)))
    judge(result, "pocket")
    assert done[0].startswith("united: 24 triangles became") and "shells 2 -> 1" in done[-1]
    assert enclosed_volume(result.vertices, result.triangles) == pytest.approx(volume, rel=1e-12)


def test_prisms_that_meet_along_an_edge_become_two_shells():
    """A bow-tie whose lobes share their inner edge, all facing outward."""
    outline = np.array([[0, 0], [1, -1], [1, 1], [-1, 1], [-1, -1.0]])
    points = np.vstack([np.column_stack([outline, np.full(5, z)]) for z in (0.0, 1.0)])
    lobes = np.array([(0, 1, 2), (0, 3, 4)])
    edges = np.vstack([np.column_stack([lobe, np.roll(lobe, -1)]) for lobe in lobes])
    sides = [t for a, b in edges for t in ((a, b, b + 5), (a, b + 5, a + 5))]
    result, done = mended(points, np.vstack([lobes[:, ::-1], lobes + 5, sides]))
    judge(result, "prisms")
    assert done[0] == "4 vertices made of those in which parts met" and "shells 1 -> 2" in done[-1]
    assert enclosed_volume(result.vertices, result.triangles) == pytest.approx(2.0, rel=2e-3)


def test_triangles_that_meet_at_a_corner_alone_are_not_welded():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [-1, 0, 0], [0, -1, 0]], dtype=float)
    surface = Surface(points, np.arange(6, dtype=np.int32).reshape(2, 3))
    assert weld_open(surface) == (surface, [])


def test_changes_beyond_the_envelope_are_refused():
    """A prism whose outline is a figure of eight: one lobe faces inward, and the union would lose it."""
    outline = np.array([[0, 0], [2, 2], [2, 0], [0, 1.0]])
    points = np.vstack([np.column_stack([outline, np.full(4, z)]) for z in (0.0, 1.0)])
    sides = [t for i in range(4) for j in [(i + 1) % 4] for t in ((i, j, j + 4), (i, j + 4, i + 4))]
    triangles = np.array([(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), *sides])
    result, done = mended(points, triangles)
    assert "a union would lose a part, 0." in done[-2] and "--envelope" in done[-2]
    assert len(result.triangles) == len(triangles)


@pytest.mark.parametrize("matrix", [np.eye(3), TURN])
def test_edges_that_one_side_alone_divides_are_divided_on_both(matrix):
    """Two triangles are cut into fans about their middles, with each side in three; six beside them are not."""
    points, triangles = CUBE.vertices, CUBE.triangles
    for corners in CUBE.triangles[[0, 7]]:
        ends = CUBE.vertices[corners]
        after = np.roll(ends, -1, axis=0)
        thirds = np.stack([ends, (2 * ends + after) / 3, (ends + 2 * after) / 3], axis=1).reshape(-1, 3)
        chain = len(points) + np.arange(9)
        fan = np.column_stack([np.full(9, len(points) + 9), chain, np.roll(chain, -1)])
        points, triangles = np.vstack([points, thirds, [ends.mean(axis=0)]]), np.vstack([triangles, fan])
    result, done = mended(np.float32(points @ matrix.T).astype(float), np.delete(triangles, [0, 7], axis=0))
    judge(result, "box")
    assert "6 open edges divided where the other side is" in done and len(result.vertices) == 8 + 2 * 7
    assert abs(enclosed_volume(result.vertices, result.triangles)) == pytest.approx(1.0, rel=1e-6)


def test_vertices_that_are_nearly_one_are_named():
    corners = CUBE.vertices[CUBE.triangles].reshape(-1, 3) + np.random.default_rng(1).uniform(-1e-6, 1e-6, (36, 3))
    apart = corners, np.arange(36).reshape(-1, 3)
    with pytest.raises(MeshError, match="; --weld [23]e-06 joins vertices of open edges that lie near each other$"):
        mended(*apart)
    assert len(repair(Surface(apart[0], apart[1].astype(np.int32)), 3e-6, 1.0, 1e-3, "thing")[0].vertices) == 8


def test_a_cavity_that_meets_its_hull_in_a_vertex_stays_a_cavity():
    top = np.argmax(BALL.vertices[:, 2])
    points, triangles = together(shifted(BALL, 0.0), shifted(BALL, 0.6 * BALL.vertices[top], True, 0.4))
    triangles[triangles == len(BALL.vertices) + top] = top
    result, done = mended(points, triangles)
    judge(result, "cavity")
    assert "shells 1 -> 2" in done[-1] and not any("turned" in line for line in done)
    volume = enclosed_volume(BALL.vertices, BALL.triangles)
    assert enclosed_volume(result.vertices, result.triangles) == pytest.approx((1 - 0.4**3) * volume, rel=1e-2)


def grid(height, n=10):
    x, y = (c.ravel() for c in np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1), indexing="ij"))
    i = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = (k.ravel() for k in (i[:-1, :-1], i[:-1, 1:], i[1:, :-1], i[1:, 1:]))
    return np.column_stack([x, height(x, y), y]), np.vstack([np.column_stack([a, b, c]), np.column_stack([c, b, d])])


FLAT = grid(lambda x, y: 0.0 * x)
SHEETS = {
    "one triangle": (np.eye(3), np.array([[0, 1, 2]])),
    "a grid": FLAT,
    "doubled": together(FLAT, (FLAT[0], FLAT[1][:, ::-1])),
    "two in one": (FLAT[0], np.vstack([FLAT[1], FLAT[1][:, ::-1]])),
    "a wave": grid(lambda x, y: 0.2 * np.sin(4 * x) * np.cos(3 * y)),
    "beside a cube": together(FLAT, shifted(CUBE, (0.0, 2.0, 0.0))),
    "through a cube": together(FLAT, shifted(CUBE, 0.0)),
    "a block without thickness": (CUBE.vertices * (1.0, 1e-13, 1.0), CUBE.triangles),
}


def test_a_part_of_one_side_is_refused():
    strip = (np.arange(5)[:, None] + np.arange(3)) % 5  # Moebius'
    with pytest.raises(MeshError, match="^thing: a part has one side only, as a Moebius strip"):
        mended(np.random.default_rng(0).random((5, 3)), strip, hole=10.0)


@pytest.mark.parametrize("name", SHEETS)
def test_sheets_are_refused(name):
    with pytest.raises(
        MeshError,
        match=r"^thing: a sheet without thickness.* encloses no volume; (give it|remove it, or give it) thickness$",
    ):
        mended(*SHEETS[name])


def test_crumbs_are_dropped_and_said():
    result, done = mended(*together(shifted(CUBE, 0.0), (FLAT[0] * 0.02 + (0.0, 1.0, 0.0), FLAT[1])))
    assert len(result.triangles) == 12 and done[0] == "1 sheets that enclose nothing dropped, 0.053 % of the area"
    assert "y from -0.5 ... 1 m to -0.5 ... 0.5 m" in done[-1]


def cut(surface, keep):
    points, triangles = surface.vertices, surface.triangles
    return points, triangles[keep(points[triangles].mean(axis=1))]


def bowl(height, top=0.0):
    """A ball open above `height`, and below `-top`."""
    return cut(BALL, lambda c: (c[:, 1] < height) & ((c[:, 1] > -top) if top else True))


def tube(sides=32):
    around = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    ring = np.column_stack([np.cos(around), np.sin(around)]) * 0.5
    i, j = np.arange(sides), (np.arange(sides) + 1) % sides
    points = np.vstack([np.column_stack([ring, np.full(sides, z)]) for z in (-1.0, 1.0)])
    return points, np.vstack([np.column_stack([i, j, j + sides]), np.column_stack([i, j + sides, i + sides])])


OPEN = {
    # name: surface, number of rims that are too wide, volume when they are closed [m^3] and how near that is
    "bowl": (bowl(0.0), "a rim", 2 * np.pi / 3, 0.1),
    "shallow bowl": (bowl(-0.3), "a rim", np.pi * 0.7**2 * (3 - 0.7) / 3, 0.15),
    "tube": (tube(), "2 rims", np.pi / 2, 0.01),
    "bowl with a hole below": (bowl(0.5, 0.9), "a rim", 3.55, 0.05),
    "box without a lid": (cut(CUBE, lambda c: c[:, 1] < 0.49), "a rim", 1.0, 1e-6),
    "bowl inside a ball": (together(shifted(BALL, 0.0, size=2.0), bowl(0.0)), "a rim", 31.3, 0.02),
}


@pytest.mark.parametrize("name", OPEN)
def test_an_opening_stays_open_and_names_what_closes_it(name):
    (points, triangles), rims, volume, near = OPEN[name]
    with pytest.raises(MeshError, match=f"^thing: open along {rims} of up to .* closes (it|them)$") as caught:
        mended(points, triangles)
    hole = float(re.search(r"--hole ([\d.]+) closes", str(caught.value))[1])
    with pytest.raises(MeshError, match="open along"):
        mended(points, triangles, hole=hole - 0.02)
    result, done = mended(points, triangles, hole=hole)
    judge(result, name)
    found = float(re.search(r"volume unknown -> ([\d.]+) m", done[-1])[1])
    assert found == pytest.approx(volume, rel=near)


NOTHING = [
    (np.outer(np.arange(5.0), (1.0, 0, 0)), np.array([[0, 1, 2], [1, 2, 3], [2, 3, 4]])),
    (np.eye(3), np.array([[0, 1, 1]])),
]


@pytest.mark.parametrize("surface", [FLAT, OPEN["bowl"][0], *NOTHING])
def test_a_refusal_is_one_line_and_writes_nothing(tmp_path, capfd, surface):
    (tmp_path / "in.obj").write_bytes(obj(*surface))
    assert pdvol("repair", tmp_path / "in.obj", "-o", tmp_path / "out.obj") == 2
    out, err = capfd.readouterr()
    lines = [line for line in (out + err).splitlines() if line]
    assert len(lines) == 1 and re.match("pdvol: .*(sheet without thickness|open along|nothing is left)", lines[0])
    assert not (tmp_path / "out.obj").exists()
