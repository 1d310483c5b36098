"""Forces of every step balance, and contact gives the momentum that its forces have, in the step that it has them."""

import numpy as np
import pytest

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, Impulse, NeoHookean, Placement, Plane, Scene, Support, meshes
from pdvol.registry import INTEGRATORS

G, RADIUS, DT, MU = 9.81, 0.1, 0.01, 0.1
STIFF = NeoHookean(1e8, 0.3, 1000.0)


def solid(d: int, size: tuple[float, ...], cuts: tuple[int, ...]) -> tuple:
    """A block, given as a mesh."""
    if d == 3:
        return (meshes.brick(size, cuts),)
    grid = np.stack(np.meshgrid(*(np.linspace(-0.5 * s, 0.5 * s, n + 1) for s, n in zip(size, cuts, strict=True))), -1)
    points, (rows, columns) = grid.reshape(-1, 2), grid.shape[:2]
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    corners = np.stack([first, first + 1, first + columns + 1, first + columns], axis=1)
    cells = corners[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3).astype(np.int32)
    return (meshes.Solid(points, cells, np.zeros(len(cells), dtype=np.int32)),)


@pytest.mark.parametrize(
    ("d", "mu", "integrator"),
    [(2, 0.0, "bdf2"), (2, 0.1, "implicit_euler"), (3, 0.0, "implicit_euler"), (3, 0.1, "bdf2")],
)
def test_a_heavy_stiff_block_at_rest_weighs_what_it_weighs(d, mu, integrator):
    """Its contact is so stiff that a step far below the tolerance changes the force by a tenth of the weight."""
    up = np.eye(d)[1]
    stiff = NeoHookean(1e10, 0.4, 1000.0)
    cube = Body(solid(d, (1.0,) * d, (2,) * d), stiff, name="cube", placement=Placement(tuple(0.501 * up)))
    flat = (2.0, 0.2, 2.0)[:d]
    pad = Body(solid(d, flat, (6, 1, 6)[:d]), stiff, name="pad", placement=Placement(tuple(-0.1 * up)))
    scene = Scene(
        (cube, pad),
        supports=(Support(lambda X: X[:, 1] < -0.19, "pad"),),
        loads=(Gravity(tuple(-G * up)),),
        contact=(Barrier(), *((Friction(mu),) if mu else ())),
        dt=0.025,
        steps=40,
        integrator=integrator,
    )
    for step in pdvol.march(scene, levels=0):
        top = step.model.start[:, 1] > 0.0
        forces = {name: rows[top].sum(axis=0) for name, rows in step.forces.items()}
        left, largest = np.abs(sum(forces.values())).max(), max(np.abs(rows).max() for rows in forces.values())
        assert left <= 0.01 * largest
    weight = 1000.0 * G
    assert (forces["barrier"] + forces.get("friction", 0.0))[1] == pytest.approx(weight, rel=0.02)


def ball(d: int, gap: float) -> Body:
    """A ball, or a square in 2D, above the floor."""
    shape = meshes.ball(RADIUS, 2) if d == 3 else meshes.rectangle(2.0 * RADIUS, 2.0 * RADIUS)
    up = np.eye(d)[1]
    return Body(
        shape, STIFF, vertices=(300 if d == 3 else 60,), name="ball", placement=Placement(tuple((RADIUS + gap) * up))
    )


def momentum_and_impulses(scene: Scene):
    """The change of momentum [N s] over the shot, and the impulses of barrier and friction [N s]."""
    impulses = dict.fromkeys(("barrier", "friction"), 0.0)
    for step in pdvol.march(scene, levels=0):
        if step.step == 1:
            mass = masses_of(step)
            begin = mass @ step.model.velocity
        for name in impulses:
            impulses[name] = impulses[name] + scene.dt * step.forces.get(name, np.zeros((1, 1))).sum(axis=0)
    return mass @ step.velocity - begin, impulses, mass.sum()


def masses_of(step) -> np.ndarray:
    """(n,) [kg] lumped, of constant density."""
    points, cells = np.asarray(step.model.mesh.points), np.asarray(step.model.mesh.cells)
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    volumes = np.abs(np.linalg.det(edges)) / (6.0 if points.shape[1] == 3 else 2.0)
    masses = np.zeros(len(points))
    np.add.at(masses, cells, STIFF.density * volumes[:, None] / cells.shape[1])
    return masses


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize(("d", "gap", "iterations"), [(2, 0.002, 1), (2, 0.035, 20), (3, 0.002, 20), (3, 0.035, 1)])
def test_a_blow_counts_once_at_the_start_and_later(d, gap, iterations, integrator):
    """A ball hits a floor in the first step, or in a later one, and slides: both impulses are its momentum's change,
    and Coulomb's law holds between them.
    """
    e, up = np.eye(d)[0], np.eye(d)[1]
    body = ball(d, gap)
    scene = Scene(
        (
            Body(
                body.shape,
                STIFF,
                vertices=body.vertices,
                name="ball",
                placement=body.placement,
                velocity=tuple(3.0 * e - up),
            ),
        ),
        obstacles=(Plane((0.0,) * d, tuple(up)),),
        contact=(Barrier(), Friction(MU, iterations=iterations)),
        dt=DT,
        steps=20,
        integrator=integrator,
    )
    change, impulses, _ = momentum_and_impulses(scene)
    assert impulses["barrier"][1] > 0.0
    assert change[1] == pytest.approx(impulses["barrier"][1], rel=0.02)
    assert change[0] == pytest.approx(impulses["friction"][0], rel=0.02)
    assert -change[0] / change[1] == pytest.approx(MU, rel=0.02)


@pytest.mark.parametrize(("d", "gap"), [(2, 0.004), (2, 0.014), (2, 0.024), (2, 0.044), (3, 0.004), (3, 0.024)])
def test_a_blow_counts_once_after_an_impulse(d, gap):
    """The ball is pushed at 0.1 s, and hits the floor in that step, in the next one or later."""
    up = np.eye(d)[1]
    scene = Scene(
        (ball(d, gap),),
        obstacles=(Plane((0.0,) * d, tuple(up)),),
        loads=(Impulse(tuple(-up), time=0.1),),
        contact=(Barrier(),),
        dt=DT,
        steps=30,
    )
    change, impulses, mass = momentum_and_impulses(scene)
    assert impulses["barrier"][1] > 0.0
    assert change[1] + mass == pytest.approx(impulses["barrier"][1], rel=0.02)
