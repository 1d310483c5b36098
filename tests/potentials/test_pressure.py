"""Pressure in closed bodies: the enclosed volume, derivatives, and expansions worked out by hand."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import brentq

from pdvol import meshes
from pdvol.errors import InputError
from pdvol.geometry.closed_surfaces import enclosed_volume, pressed_facets
from pdvol.levels.scene_fields import check_fields
from pdvol.levels.space import LevelSpace
from pdvol.potentials.loads import EnclosedPressure
from pdvol.potentials.potential import Positions
from pdvol.scene import NeoHookean, Pressure, Solver, Support
from problems import SOFT, make_scene, make_stepper, take_step
from shapes import box, level, together
from taylor import check_term, hessian_of, smallest_eigenvalue, state

DIMENSIONS = [2, 3]
PRESSURE = 300.0


def ring(inner=0.5, outer=1.0, layers=6, around=48):
    """A disc with a hole."""
    angles = 2.0 * np.pi * np.arange(around) / around
    radii = np.linspace(inner, outer, layers + 1)
    points = (radii[:, None, None] * np.column_stack([np.cos(angles), np.sin(angles)])).reshape(-1, 2)
    i = np.arange(around)
    j = (i + 1) % around
    cells = []
    for low in range(0, layers * around, around):
        up = low + around
        cells += [np.column_stack([i + low, j + low, j + up]), np.column_stack([i + low, j + up, i + up])]
    return level(points, np.concatenate(cells))


def hollow():
    shape = meshes.hollow_ball(1.0, 0.3, 1)
    return level(shape.vertices, shape.cells)


def shapes_of(d):
    """A full body, and one with a cavity."""
    return box(d, 2, jitter=0.1), ring(around=12, layers=2) if d == 2 else hollow()


def term_on(mesh, pressure=PRESSURE):
    space = LevelSpace(mesh, MPI.COMM_SELF)
    term = EnclosedPressure(space, pressed_facets(mesh, 0), lambda t: pressure * t)
    term.begin_step(Positions(space, space.from_input(mesh.points)), 0.5, 1.0)
    assert term.pressure == pressure
    return term


@pytest.mark.parametrize("d", DIMENSIONS)
def test_what_is_enclosed(d):
    full, open_inside = shapes_of(d)
    assert enclosed_volume(full.points, pressed_facets(full, 0)) == pytest.approx(full.volumes.sum(), rel=1e-12)
    facets = pressed_facets(open_inside, 0)
    cavity = 6 * np.sin(2 * np.pi / 12) * 0.25 if d == 2 else meshes.ball(0.7, 1)
    if d == 3:
        cavity = np.linalg.det(cavity.vertices[cavity.triangles]).sum() / 6
    assert enclosed_volume(open_inside.points, facets) == pytest.approx(cavity, rel=1e-12)
    assert enclosed_volume(open_inside.points + 1e3, facets) == pytest.approx(cavity, rel=1e-9)
    two = together(full, box(d, 1, 2.0, 4.0))
    assert enclosed_volume(two.points, pressed_facets(two, 1)) == pytest.approx(2.0**d, rel=1e-12)


def test_a_cavity_that_touches_the_outer_boundary_at_a_vertex():
    """Of 27 cubes the middle one is missing, and one at a corner: they share a vertex."""
    brick = meshes.brick((3.0, 3.0, 3.0), (3, 3, 3))
    cube = np.floor(brick.vertices[brick.cells].mean(axis=1) - brick.vertices.min(axis=0)).astype(int)
    missing = (cube == 1).all(axis=1) | (cube == 0).all(axis=1)
    mesh = level(brick.vertices, brick.cells[~missing])
    assert enclosed_volume(mesh.points, pressed_facets(mesh, 0)) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("d", DIMENSIONS)
@pytest.mark.parametrize("pressure", [PRESSURE, -PRESSURE])
@pytest.mark.parametrize("shape", [0, 1], ids=["full", "cavity"])
def test_derivatives(d, pressure, shape):
    """Exact and projected; the gradient by the whole size is p times d times the volume."""
    term = term_on(shapes_of(d)[shape], pressure)
    x = state(term.space)
    check_term(term, term.space, x, 1e-1, quadratic=d == 2)
    exact = hessian_of(term, term.space, x, "none").toarray()
    for projection in ("clamp", "abs"):
        filtered = hessian_of(term, term.space, x, projection).toarray()
        assert smallest_eigenvalue(filtered) >= -1e-10 * np.abs(exact).max()
    assert smallest_eigenvalue(exact) < 0.0
    # Absolute values are twice the positive part, less the whole.
    clamped, whole = (hessian_of(term, term.space, x, name).toarray() for name in ("clamp", "abs"))
    np.testing.assert_allclose(whole, 2.0 * clamped - exact, atol=1e-10 * np.abs(exact).max())
    force, volume = -term.gradient(Positions(term.space, x)), enclosed_volume(term.space.to_input(x), term.facets)
    assert np.vdot(x, force) == pytest.approx(d * pressure * volume, rel=1e-11)


def settled(scene, mesh, steps=6):
    """Where pressure has led after steps so long that inertia does not matter."""
    stepper, x = make_stepper(scene, mesh), mesh.points
    for number in range(1, steps + 1):
        report = take_step(stepper, number, x, np.zeros_like(x))
        x = report.positions
    return x


def pressed(material, pressure, where, seconds=10.0):
    return make_scene(
        (material,),
        dt=seconds,
        loads=(Pressure("body 0", pressure),),
        supports=(Support(where),),
        solver=Solver(tolerance=1e-7 / seconds, linear="direct"),
    )


@pytest.mark.parametrize("d", DIMENSIONS)
def test_a_full_body_swells_evenly(d):
    """x = s X: the Cauchy stress (mu (s - 1/s) + lambda d ln s / s) / s^(d - 1) is p. The law is that of forms/."""
    material, pressure = NeoHookean(1e5, 0.3, 1000.0), 2e4
    stress = lambda s: (material.mu * (s - 1 / s) + material.lmbda * d * np.log(s) / s) / s ** (d - 1)
    s = brentq(lambda s: stress(s) - pressure, 1.0, 1.5)
    assert s > 1.05
    mesh = box(d, 2, jitter=0.1)
    corner = mesh.points[np.argmin(mesh.points.sum(axis=1))]
    x = settled(pressed(material, pressure, lambda X: np.linalg.norm(X - corner, axis=1) < 1e-9), mesh)
    sizes = [np.linalg.norm(y[:, None] - y[None], axis=2) for y in (mesh.points, x)]
    np.testing.assert_allclose(sizes[1], s * sizes[0], atol=1e-5)


def test_a_ring_widens_as_lame_says():
    """Plane strain, inner radius a, outer b: u(r) = p a^2 / (b^2 - a^2) (1 + nu) / E ((1 - 2 nu) r + b^2 / r)."""
    young, nu, a, b, pressure = 1e5, 0.3, 0.5, 1.0, 100.0
    mesh = ring(a, b, 8, 64)
    x = settled(pressed(NeoHookean(young, nu), pressure, lambda X: X[:, 0] > 0.9999), mesh, 3)
    moved = (x - x[:64].mean(axis=0)) - (mesh.points - mesh.points[:64].mean(axis=0))
    radius = np.linalg.norm(mesh.points, axis=1)
    outward = np.einsum("ki,ki->k", moved, mesh.points) / radius
    for r in (a, b):
        expected = pressure * a**2 / (b**2 - a**2) * (1 + nu) / young * ((1 - 2 * nu) * r + b**2 / r)
        assert outward[np.isclose(radius, r)].mean() == pytest.approx(expected, rel=0.02)


def test_mistakes_are_named():
    mesh = box(2, 1)
    for pressure, message in (
        (lambda t: np.nan, "Pressure.pressure gives NaN"),
        (lambda t: (1.0, 2.0), "Pressure.pressure must give an array of shape"),
        (lambda t: 1 / 0, "Pressure.pressure failed"),
    ):
        with pytest.raises(InputError, match=message):
            check_fields(make_scene((SOFT,), loads=(Pressure("body 0", pressure),)), mesh, 0)
    with pytest.raises(InputError, match="is not a finite number"):
        Pressure("a", np.inf)
    with pytest.raises(InputError, match="Pressure names the body 'b'"):
        make_scene((SOFT,), loads=(Pressure("b", 1.0),))
