"""Vertices that follow an animation: on any mesh of a body, within a tolerance, and with its velocity at the end."""

import numpy as np
import pytest

from pdvol import meshes
from pdvol.errors import InputError
from pdvol.levels.animated import taken_velocity
from pdvol.levels.obstacles import motion_of
from pdvol.levels.scene_fields import initial_velocity
from pdvol.scene import Body, PointCache, Scene, Support, TakeOver, rotation_matrix
from problems import SOFT, block, make_model, make_scene

AXIS = np.array([0.3, -0.5, 0.8]) / np.linalg.norm([0.3, -0.5, 0.8])


def turned(points, angle, shift=0.0):
    return points @ rotation_matrix(angle, AXIS, points.shape[1]).T + shift


def circle(n, radius=1.0):
    angles = 2.0 * np.pi * np.arange(n) / n
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def round_shapes(d):
    """Points and facets of a round animated mesh, and vertices of other resolutions and sizes near it."""
    if d == 2:
        ring = np.column_stack([np.arange(40), np.roll(np.arange(40), -1)])
        return circle(40), ring, (circle(7), circle(133, 1.03))
    fine = meshes.ball(1.0, 2)
    return fine.vertices, fine.triangles, (meshes.ball(1.0, 0).vertices, meshes.ball(0.97, 3).vertices)


@pytest.mark.parametrize("d", [2, 3])
def test_meshes_of_all_resolutions_turn_with_the_animation(d):
    """Rigid frames carry vertices rigidly, offsets included: at the frames to round-off."""
    points, faces, others = round_shapes(d)
    shift, angles = 0.7 * np.eye(d)[0], (0.0, 0.6, 1.5)
    frames = np.array([turned(points, a, shift * a) for a in angles])
    for vertices in others:
        motion = motion_of(PointCache(frames, fps=10.0, faces=faces), vertices, "these")
        for k, a in enumerate(angles):
            np.testing.assert_allclose(motion(vertices, 0.1 * k), turned(vertices, a, shift * a), atol=1e-12)


def test_vertices_on_the_mesh_follow_what_stretches_it():
    """Barycentric coordinates are exact on affine motions, between frames too."""
    box, random = meshes.box((1.0, 1.0, 1.0), (3, 3, 3)), np.random.default_rng(1)
    corners = random.integers(len(box.triangles), size=50)
    weights = random.dirichlet((1.0, 1.0, 1.0), 50)
    vertices = np.einsum("nc,ncd->nd", weights, box.vertices[box.triangles[corners]])
    A = np.eye(3) + 0.4 * random.normal(size=(3, 3))
    frames = np.array([box.vertices, box.vertices @ A.T])
    motion = motion_of(PointCache(frames, times=(0.0, 2.0), faces=box.triangles), vertices, "these")
    np.testing.assert_allclose(motion(vertices, 2.0), vertices @ A.T, atol=1e-12)
    np.testing.assert_allclose(motion(vertices, 0.5), 0.75 * vertices + 0.25 * vertices @ A.T, atol=1e-12)


@pytest.mark.parametrize("d", [2, 3])
def test_what_a_cache_encloses_follows_it(d):
    """At any depth, as what a hand's skin moves; not what is outside, nor what units make a hundred times smaller."""
    points, faces, _ = round_shapes(d)
    frames = np.array([points, turned(points, 0.4, 0.3 * np.eye(d)[0])])
    cache = PointCache(frames, fps=1.0, faces=faces)
    inner = 0.6 * points
    motion = motion_of(cache, inner, "a bone")
    np.testing.assert_allclose(motion(inner, 1.0), turned(inner, 0.4, 0.3 * np.eye(d)[0]), atol=1e-12)
    for refused in (1.5 * points, 0.01 * points):
        with pytest.raises(InputError, match="a bone: .* further than"):
            motion_of(cache, refused, "a bone")


def test_what_is_too_far_away_is_named():
    points, faces, _ = round_shapes(3)
    cache, vertices = PointCache([points, points], fps=1.0, faces=faces), points.copy()
    vertices[5] *= 1.5
    with pytest.raises(InputError, match=r"a hand: 1 of 162 vertices are further than .* in frame 0, as the one at \("):
        motion_of(cache, vertices, "a hand")
    with pytest.raises(InputError, match="a hand is 2D, and the point cache 3D"):
        motion_of(cache, circle(5), "a hand")


# ---- supports


def test_a_support_holds_the_surface_and_follows_its_cache():
    """The cache moves the left side of a block by 3 cm within 0.1 s."""
    mesh = block((0.0, 0.0, 0.0), (0.4, 0.2, 0.2), (4, 4, 4))
    side = mesh.points[np.abs(mesh.points[:, 0]) < 1e-9]
    cache = PointCache([side, side + [0.0, 0.03, 0.0]], times=(0.0, 0.1), tolerance=0.5)
    (support,) = make_model(make_scene(supports=(Support(lambda X: X[:, 0] < 0.11, motion=cache),)), mesh).supports
    on_surface = np.isin(np.arange(len(mesh.points)), mesh.boundary)
    np.testing.assert_array_equal(support.mask, on_surface & (mesh.points[:, 0] < 0.11))
    assert support.moves
    np.testing.assert_allclose(support.at(0.05), mesh.points[support.mask] + [0.0, 0.015, 0.0], atol=1e-12)


# ---- taking over


def thrown(points, times, spin):
    """A flight under gravity with a constant spin: frames, and the velocities (n, d) at the last one."""
    d = points.shape[1]
    velocity, gravity, centre = np.arange(1.0, d + 1.0), -9.81 * np.eye(d)[-1], points.mean(axis=0)
    frames = [
        turned(points - centre, spin * t, centre + velocity * t + 0.5 * gravity * t**2) for t in np.asarray(times)
    ]
    end, relative = times[-1], frames[-1] - frames[-1].mean(axis=0)
    turning = spin * (np.column_stack([-relative[:, 1], relative[:, 0]]) if d == 2 else np.cross(AXIS, relative))
    return np.array(frames), velocity + gravity * end + turning


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("times", [np.arange(5) / 24.0, np.array([0.0, 0.05, 0.06])], ids=["even", "uneven"])
def test_a_body_goes_on_with_the_velocity_and_spin_of_its_flight(d, times):
    points, faces, _ = round_shapes(d)
    frames, velocity = thrown(points, times, spin=4.0)
    cache = PointCache(frames, times=times, faces=faces)
    found = taken_velocity(TakeOver(cache), frames[-1], np.ones(len(points), dtype=bool), "this")
    np.testing.assert_allclose(found, velocity, atol=1e-8)  # the best rotation is found to a billionth


def test_vertices_take_over_their_own_velocities():
    """x = X + t^2 (x z, 0, 0) stretches a box as it goes: its velocity at the end is 2 t (x z, 0, 0), linear on edges
    along an axis; inner points take the velocity of the surface above them.
    """
    mesh = block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (2, 2, 2))
    times = np.array([0.0, 0.1, 0.2])
    frames = np.array([mesh.points + t**2 * mesh.points[:, :1] * mesh.points[:, 2:] * [1.0, 0.0, 0.0] for t in times])
    body = Body(("grid",), SOFT, velocity=TakeOver(PointCache(frames, times=times, faces=mesh.boundary), rigid=False))
    scene = Scene((body,), dt=0.1, steps=1)
    found = initial_velocity(scene, type(mesh)(frames[-1], mesh.cells, mesh.bodies, mesh.regions))
    expected = np.column_stack([0.4 * mesh.points[:, 0] * mesh.points[:, 2], np.zeros((len(mesh.points), 2))])
    surface = np.unique(mesh.boundary)
    np.testing.assert_allclose(found[surface], expected[surface], atol=1e-10)
    assert np.isfinite(found).all()


def test_a_body_must_be_where_its_animation_ends():
    points, faces, _ = round_shapes(3)
    cache, all_of_them = PointCache([points, points + 1.0], fps=1.0, faces=faces), np.ones(len(points), dtype=bool)
    np.testing.assert_allclose(taken_velocity(TakeOver(cache), points + 1.0, all_of_them, "the ball"), 1.0)
    with pytest.raises(InputError, match="the ball: .* in frame 1"):
        taken_velocity(TakeOver(cache), points, all_of_them, "the ball")
    with pytest.raises(InputError, match="one frame"):
        taken_velocity(TakeOver(PointCache([points], fps=1.0)), points, all_of_them, "the ball")
    with pytest.raises(InputError, match="takes its velocity over"):
        Scene((Body(meshes.ball(), SOFT, (50,), velocity=TakeOver(cache)),), dt=0.1, steps=1).with_settings(
            jitter=(0.1, 1)
        )
