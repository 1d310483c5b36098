"""No level may start with an intersection. The error names the level and both parties of each intersection."""

import numpy as np
import pytest

import shapes
from pdvol import meshes
from pdvol.errors import InputError, IntersectionError
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.initial_state import find_defects
from pdvol.scene import Barrier, Body, NeoHookean, Placement, Plane, Rigid, Scene, Translation
from problems import check_start
from shapes import box, solid, together

SOFT = NeoHookean(2e5)
UNIT = {dim: box(dim, 1) for dim in (2, 3)}


def level(dim, *places):
    """A level of unit squares or cubes, each scaled and shifted by a (scale, shift) of `places`."""
    at = lambda scale, shift: scale * UNIT[dim].points + np.resize(shift, dim)
    return together(*(shapes.level(at(*place), UNIT[dim].cells) for place in places))


def scene(dim, count, *obstacles):
    bodies = tuple(Body(shape=(solid(dim, 1),) * 2, material=SOFT, name=f"b{k}") for k in range(count))
    return Scene(bodies=bodies, dt=0.01, steps=1, obstacles=obstacles, contact=(Barrier(),))


def refuse(match, meshes_, the_scene):
    with pytest.raises(IntersectionError, match=match) as caught:
        check_start(meshes_, the_scene)
    assert "\n" not in str(caught.value)
    assert caught.value.pairs
    return caught.value


APART, CROSSING, INSIDE, TOUCHING = (1.0, 1.5), (1.0, (0.7, 0.6, 0.5)), (0.3, 0.35), (1.0, (1.0, 0.25, 0.25))


@pytest.mark.parametrize("dim", [2, 3])
def test_bodies(dim):
    good, whole = level(dim, (1.0, 0.0), APART), scene(dim, 2)
    check_start([good, good], whole)
    error = refuse("level 1: body 'b.' crosses body 'b.'", [good, level(dim, (1.0, 0.0), CROSSING)], whole)
    first, second = error.pairs[0]
    assert len(first) == 2 and len(second) == dim
    refuse("level 0: body 'b1' lies inside body 'b0'", [level(dim, (1.0, 0.0), INSIDE), good], whole)
    refuse("level 0: body 'b0' lies inside body 'b1'", [level(dim, INSIDE, (1.0, 0.0)), good], whole)
    refuse("level 0: body 'b.' (touches|crosses) body 'b.'", [level(dim, (1.0, 0.0), TOUCHING), good], whole)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("meeting", [INSIDE, CROSSING])
def test_what_a_finer_level_keeps_apart_is_said(dim, meeting):
    whole, good, bad = scene(dim, 2), level(dim, (1.0, 0.0), APART), level(dim, (1.0, 0.0), meeting)
    refuse("level 0: .* on level 1 they are apart: give level 0 more vertices or a mesh of its own", [bad, good], whole)
    refuse("level 0: .*; move them apart, or", [bad, bad], whole)
    refuse("level 1: .*; move them apart, or", [good, bad], whole)


def test_a_body_that_crosses_itself():
    # Two triangles of one body that overlap without sharing a vertex.
    points = np.array([[0.0, 0], [1, 0], [0, 1], [0.2, 0.2], [1.2, 0.2], [0.2, 1.2]])
    mesh = LevelMesh(points, np.array([[0, 1, 2], [3, 4, 5]]), np.zeros(2, np.int32), np.zeros(2, np.int32))
    refuse("level 0: body 'b0' crosses itself", [mesh], scene(2, 1))


@pytest.mark.parametrize("dim", [2, 3])
def test_obstacles(dim):
    shape = meshes.disc(0.3, 20) if dim == 2 else meshes.ball(0.3, 1)

    def rigid(*shift, **settings):
        return Rigid(shape=shape, placement=Placement(translate=np.resize(shift, dim)), name="rock", **settings)

    one = [level(dim, (1.0, 0.0))]
    check_start(one, scene(dim, 1, rigid(-0.31, 0.5, 0.5)))
    refuse(
        "(body 'b0' crosses obstacle 'rock')|(obstacle 'rock' crosses body 'b0')",
        one,
        scene(dim, 1, rigid(0.0, 0.5, 0.5)),
    )
    refuse("obstacle 'rock' lies inside body 'b0'", one, scene(dim, 1, rigid(0.5)))
    refuse("body 'b0' lies inside obstacle 'rock'", [level(dim, (0.05, 0.0))], scene(dim, 1, rigid(0.0)))
    check_start([level(dim, (0.05, 0.0))], scene(dim, 1, rigid(0.0, closed=False)))
    # Obstacles may overlap: a floor of several pieces, say.
    check_start(one, scene(dim, 1, rigid(-0.4), rigid(-0.5)))
    moving = rigid(-2.0, 0.5, 0.5, motion=lambda X, t: X + np.eye(dim)[0] * (2.0 + t))
    refuse("crosses", one, scene(dim, 1, moving))


@pytest.mark.parametrize("dim", [2, 3])
def test_planes(dim):
    up = tuple(np.eye(dim)[1])
    one = [level(dim, (1.0, 0.0))]
    below = tuple(np.full(dim, -0.1))
    check_start(one, scene(dim, 1, Plane(below, up, motion=Translation((0.0,) * dim))))
    n = 2 ** (dim - 1)
    error = refuse(
        rf"level 0: {n} vertices are at or below plane 'plane' .* by 0.2 m", one, scene(dim, 1, Plane((0.2,) * dim, up))
    )
    assert len(error.pairs) == n
    refuse("at or below", one, scene(dim, 1, Plane((0.0,) * dim, up)))
    with pytest.raises(InputError, match="give . components"):
        check_start(one, scene(dim, 1, Plane((0.0,) * (5 - dim), tuple(np.eye(5 - dim)[1]))))


def test_what_touches_does_not_depend_on_what_is_far_away():
    """Two cubes of 1 mm, 1e-7 m apart, and a third one 10 km away."""
    near = together(box(3, 1, 0.0, 1e-3), box(3, 1, [1.0001e-3, 0.0, 0.0], [2e-3, 1e-3, 1e-3]), box(3, 1, 1e4, 1e4 + 1))
    assert list(find_defects(0, near, (), ("one", "other", "far"))) == []
    touching = together(box(3, 1, 0.0, 1e-3), box(3, 1, [1e-3, 0.0, 0.0], [2e-3, 1e-3, 1e-3]), box(3, 1, 1e4, 1e4 + 1))
    assert len(list(find_defects(0, touching, (), ("one", "other", "far")))) == 1
