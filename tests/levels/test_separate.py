"""Bodies that intersect at t = 0 on some level are separated on request. They are moved, shrunk or refined. The change
is reported, and a change beyond the limit is refused.
"""

import numpy as np
import pytest

from pdvol import Outline, open_run
from pdvol.cli import run
from pdvol.errors import IntersectionError
from pdvol.levels.obstacles import placed_obstacles
from pdvol.meshing.build import build_levels
from pdvol.runs.separation import build_apart as build_apart_from
from pdvol.scene import Barrier, Body, NeoHookean, Placement, Plane, Rigid, Scene, Separate
from problems import check_start
from shapes import solid

SOFT = NeoHookean(2e5)


CONTACT = (Barrier(),)


def two_boxes(d, gap, separate, *obstacles, contact=CONTACT):
    """Unit boxes beside each other on two levels, `gap` apart along x."""
    shape = (solid(d, 1), solid(d, 2))
    one, other = Body(shape, SOFT, name="box").instances(
        Placement(), Placement(translate=(1.0 + gap,) + (0.0,) * (d - 1))
    )
    return Scene((one, other), dt=0.01, steps=1, contact=contact, separate=separate, obstacles=obstacles)


def build_apart(scene, count):
    return build_apart_from(scene, count, placed_obstacles(scene.obstacles))


@pytest.mark.parametrize("d", [2, 3])
def test_moved_apart(d):
    """Both move, as little as it takes in steps of a hundredth of their diagonals, the same on both levels."""
    scene = two_boxes(d, -0.1, (Separate("move"),))
    with pytest.raises(IntersectionError):
        check_start(build_levels(scene), scene)
    meshes, report = build_apart(scene, 2)
    check_start(meshes, scene)
    step = 0.01 * np.sqrt(d)
    for mesh in meshes:
        for body, start in ((0, 0.0), (1, 0.9)):
            low = mesh.points[mesh.point_bodies == body].min(axis=0)
            shift = low - np.r_[start, np.zeros(d - 1)]
            np.testing.assert_allclose(shift[1:], 0.0, atol=1e-12)
            assert 0.05 < abs(shift[0]) <= 0.05 + step and np.sign(shift[0]) == (1 if body else -1)
        np.testing.assert_allclose(mesh.volumes.sum(), 2.0)
    assert len(report) == 2 and all("moved by" in line for line in report)
    np.testing.assert_array_equal(build_apart(scene, 1)[0][0].points, meshes[0].points)


def test_shrunk():
    scene = two_boxes(2, -0.1, (Separate("shrink"),))
    meshes, report = build_apart(scene, 2)
    check_start(meshes, scene)
    size = meshes[0].volumes[meshes[0].bodies == 0].sum() ** 0.5
    assert 0.88 - 1e-9 <= size < 0.9
    assert [line.split(" of its")[0] for line in report] == [f"body 'box {k}' shrunk to {size:.3g}" for k in (1, 2)]


def test_limits_and_the_next_remedy():
    with pytest.raises(IntersectionError, match=r"crosses.*after move up to 0.01\)"):
        build_apart(two_boxes(2, -0.3, (Separate("move", 0.01),)), 2)
    _, report = build_apart(two_boxes(2, -0.1, (Separate("move", 0.02), Separate("shrink"))), 2)
    assert sum("moved" in line for line in report) == 2 and sum("shrunk" in line for line in report) == 2


def test_nothing_to_do_nothing_done():
    for scene in (two_boxes(2, 0.1, (Separate(),)), two_boxes(2, -0.1, (Separate(),), contact=())):
        meshes, report = build_apart(scene, 2)
        assert report == []
        for mesh, plain in zip(meshes, build_levels(scene), strict=True):
            np.testing.assert_array_equal(mesh.points, plain.points)


def test_out_of_planes_and_obstacles():
    """Up out of the floor along its normal, and away from the obstacle's middle."""
    meshes, report = build_apart(two_boxes(2, 0.1, (Separate(),), Plane((0.0, 0.02), (0.0, 1.0))), 2)
    assert 0.02 < meshes[0].points[:, 1].min() < 0.04 and len(report) == 2
    stone = Rigid(Outline(np.array([[0.9, 0.4], [1.2, 0.4], [1.2, 0.6], [0.9, 0.6]])), name="stone")
    scene = two_boxes(2, 0.3, (Separate(),), stone)
    meshes, report = build_apart(scene, 2)
    check_start(meshes, scene)
    assert [line.split(" moved")[0] for line in report] == ["body 'box 1'"]


def bowl(n=40):
    """A block with a round hollow of radius one in its top."""
    a = np.linspace(np.pi, 2 * np.pi, n)
    return Outline(
        np.vstack(
            [[[-1.3, -1.3], [1.3, -1.3], [1.3, 0.0]], np.column_stack([np.cos(a), np.sin(a)])[::-1], [[-1.3, 0.0]]]
        )
    )


def test_refined_where_the_coarse_shape_cuts_corners():
    """A ball that fills a bowl: chords of the coarse bowl cut through it. Less decimation of that level helps, and only
    that level changes.
    """
    a = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    ball = Outline(0.98 * np.column_stack([np.cos(a), np.sin(a)]))
    bodies = (Body(bowl(), SOFT, (22, 90), name="bowl"), Body(ball, SOFT, (40, 90), name="ball"))
    scene = Scene(bodies, dt=0.01, steps=1, contact=(Barrier(),), separate=(Separate("refine", 1.0),))
    plain = build_levels(scene)
    with pytest.raises(IntersectionError, match="level 0"):
        check_start(plain, scene)
    meshes, report = build_apart(scene, 2)
    check_start(meshes, scene)
    assert len(meshes[0].points) > len(plain[0].points)
    np.testing.assert_array_equal(meshes[1].points, plain[1].points)
    assert report and all("level 0" in line for line in report)


SCENE = """
import numpy as np
from pdvol import Barrier, Body, NeoHookean, Placement, Scene, Separate, meshes

def scene(separate=True):
    disc = Body(meshes.disc(0.5), NeoHookean(1e5), (20, 40), name="disc")
    discs = disc.instances(Placement(), Placement(translate=(0.98, 0.0)))
    return Scene(discs, dt=0.01, steps=2, contact=(Barrier(),), separate=(Separate(),) if separate else ())
"""


def test_from_the_command_line(tmp_path, capsys):
    """Refused without it; reported with it by check, run and info; a finer level added later stands where the coarser
    ones do.
    """
    file, out = tmp_path / "discs.py", tmp_path / "run"
    file.write_text(SCENE)
    assert run(["run", str(file), "--out", str(out), "--set", "separate=False"]) == 2
    assert run(["check", str(file)]) == 0
    assert "note: body 'disc 2' moved by (" in capsys.readouterr().out
    assert run(["run", str(file), "--out", str(out), "--levels", "0"]) == 0
    assert "note: body 'disc 1' moved by (" in capsys.readouterr().err
    assert run(["refine", str(out), "--to", "1"]) == 0
    assert run(["info", str(out)]) == 0
    assert "body 'disc 2' moved by (" in capsys.readouterr().out
    edges = [level.rest[:, 0].max() for level in open_run(out).levels]
    assert edges[0] == pytest.approx(edges[1], abs=0.02) and edges[0] > 1.48
