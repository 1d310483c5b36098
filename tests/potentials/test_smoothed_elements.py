"""Edge-smoothed elements: their energies in plain numpy, the patch test, cells that a mean would let invert."""

from collections import defaultdict
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from mpi4py import MPI

from pdvol.errors import InputError
from pdvol.geometry.level_mesh import simplex_volumes
from pdvol.levels.materials import cell_materials
from pdvol.levels.space import LevelSpace
from pdvol.potentials.build import build_terms
from pdvol.potentials.elasticity import CauchyStress, elastic_terms
from pdvol.potentials.potential import Positions
from pdvol.runs.scene_file import Shot
from pdvol.scene import Muscle, NeoHookean, Region, StVenantKirchhoff, Support, Translation
from problems import block, elastic, make_model, make_scene, make_stepper, march
from shapes import box, together
from taylor import check_term, hessian_of, smallest_eigenvalue, state

DIMENSIONS = [2, 3]
ROUND = 1e-12  # relative size of what should cancel


# ---- one by one in plain numpy, apart from pdvol's own


def cell_gradient(mesh, cell, positions):
    """F (d, d) of one cell, from its edges."""
    corners = mesh.cells[cell]
    at_rest, now = (p[corners[1:]] - p[corners[0]] for p in (mesh.points, positions))
    return np.linalg.solve(at_rest, now).T


def cell_volume(mesh, cell):
    corners = mesh.points[mesh.cells[cell]]
    return abs(np.linalg.det(corners[1:] - corners[0])) / (2.0 if mesh.dim == 2 else 6.0)


def edge_domains(mesh, materials, positions, among=None):
    """Of each edge within each material: its cells, F (d, d) and volume. `materials` (m,) are any marks of cells;
    `among` are the cells that count, all where not given.
    """
    around = defaultdict(list)
    for cell in range(len(mesh.cells)) if among is None else among:
        for edge in combinations(sorted(mesh.cells[cell]), 2):
            around[edge, materials[cell]].append(cell)
    for cells in around.values():
        volumes = [cell_volume(mesh, cell) for cell in cells]
        F = sum(v * cell_gradient(mesh, cell, positions) for v, cell in zip(volumes, cells, strict=True)) / sum(volumes)
        yield cells, F, sum(volumes) / (3.0 if mesh.dim == 2 else 6.0)


def mean(mesh, cells, values):
    """The volume-weighted mean of cells' values."""
    volumes = [cell_volume(mesh, cell) for cell in cells]
    return np.dot(volumes, values[cells]) / sum(volumes)


def neo_hookean(F, mu, lmbda):
    ln_J = np.log(np.linalg.det(F))
    return mu / 2 * (np.sum(F * F) - len(F)) - mu * ln_J + lmbda / 2 * ln_J**2


def st_venant_kirchhoff(F, mu, lmbda):
    E = (F.T @ F - np.eye(len(F))) / 2
    return mu * np.sum(E * E) + lmbda / 2 * np.trace(E) ** 2


# ---- tests


def graded(X):
    return 3.0 + 2.0 * X[:, 0]


@pytest.mark.parametrize("d", DIMENSIONS)
def test_energies_in_plain_numpy(d):
    """Two bodies; the second one, smoothed, has three regions: a law of its own, another modulus of the same law, and a
    modulus that differs from cell to cell.
    """
    mesh = together(box(d, 1), box(d, 3, 2.0, 3.0, jitter=0.05))
    scene = make_scene((NeoHookean(2.0, 0.3), NeoHookean(graded, 0.3)))
    low, left = (lambda X: X[:, -1] < 2.4), (lambda X: X[:, 0] < 2.4)
    regions = (Region(StVenantKirchhoff(4.0, 0.2), low), Region(NeoHookean(1.0, 0.4), left))
    scene = replace(scene, bodies=(scene.bodies[0], replace(scene.bodies[1], regions=regions, elements="smoothed")))
    space = LevelSpace(mesh, MPI.COMM_SELF)
    materials = cell_materials(scene, mesh)
    x = state(space, 0.2)
    energies = {term.domains: term.value(Positions(space, x)) for term in elastic_terms(space, materials)}
    centres = mesh.points[mesh.cells].mean(axis=1)
    part = np.where(mesh.bodies == 0, 0, np.where(left(centres), 3, np.where(low(centres), 2, 1)))
    marks = np.where(part == 0, -1 - np.arange(len(part)), part)  # each cell of the linear body by itself
    assert set(part) == {0, 1, 2, 3}
    mu, lmbda = (sum(values[name] for values in materials.values) for name in ("mu", "lmbda"))
    expected, volume = {neo_hookean: 0.0, st_venant_kirchhoff: 0.0}, 0.0
    for cells, F, size in edge_domains(mesh, marks, space.to_input(x)):
        law = st_venant_kirchhoff if part[cells[0]] == 2 else neo_hookean
        expected[law] += size * law(F, mean(mesh, cells, mu), mean(mesh, cells, lmbda))
        volume += size
    assert volume == pytest.approx(mesh.volumes.sum(), rel=ROUND)
    assert sum(domains.volumes.sum() for domains in list(energies)[:2]) == pytest.approx(volume, rel=ROUND)
    np.testing.assert_allclose([*energies.values()], [*expected.values(), 0.0], rtol=1e-12)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_damping_and_muscles_in_plain_numpy(d):
    """Both by the mean F of each edge; a muscle's edges are those of its own cells, whose fibres point in different
    directions, with the activation of the step's end.
    """
    mesh = box(d, 2, jitter=0.1)
    waves = lambda t, X: 1.0 + np.sin(3.0 * X[:, 0] + t)
    muscle = Muscle("body 0", lambda X: X - 0.4, 30.0, waves, where=lambda X: X[:, 0] < 0.6)
    scene = make_scene((NeoHookean(3.0, 0.3, damping=0.2),), muscles=(muscle,), elements="smoothed")
    space, model = LevelSpace(mesh, MPI.COMM_SELF), make_model(scene, mesh)
    x_t, x = (Positions(space, state(space, strain)) for strain in (0.1, 0.2))
    terms = {term.name: term for term in build_terms(model, space).potentials if term.name in ("damping", "muscle")}
    for term in terms.values():
        term.begin_step(x_t, 0.0, 0.05)
    mu, lmbda = (0.2 / 0.05 * getattr(scene.bodies[0].material, name) for name in ("mu", "lmbda"))
    one = np.zeros(len(mesh.cells))
    before = edge_domains(mesh, one, x_t.whole)
    expected = {"damping": 0.0, "muscle": 0.0}
    for (_, F, volume), (_, F_t, _) in zip(edge_domains(mesh, one, x.whole), before, strict=True):
        squares, axes = np.linalg.eigh(F_t.T @ F_t)
        D = (F.T @ F - F_t.T @ F_t) / 2 @ axes @ np.diag(1.0 / np.minimum(squares, np.sqrt(squares))) @ axes.T
        growth = np.log(np.linalg.det(F) / np.linalg.det(F_t))
        expected["damping"] += volume * (mu * np.sum(D * D.T) + lmbda / 2 * growth**2)
    held, fibres = model.muscles[0].cells, np.zeros((len(mesh.cells), d))
    fibres[held] = model.muscles[0].fibres * np.sqrt(waves(0.05, model.muscles[0].places))[:, None]
    for cells, F, volume in edge_domains(mesh, one, x.whole, held):
        tension = 30.0 * np.array(
            [[mean(mesh, cells, fibres[:, i] * fibres[:, j]) for j in range(d)] for i in range(d)]
        )
        expected["muscle"] += volume * np.sum(F.T @ F * tension) / 2
    for name, term in terms.items():
        assert term.value(x) == pytest.approx(expected[name], rel=1e-12), name


@pytest.mark.parametrize("d", DIMENSIONS)
@pytest.mark.parametrize("law", [NeoHookean, StVenantKirchhoff])
def test_patch(d, law):
    """Under an affine motion the stress is the same everywhere, inner vertices feel no force, and outer ones that of
    linear elements.
    """
    mesh = box(d, 3, jitter=0.1, seed=d)
    space = LevelSpace(mesh, MPI.COMM_SELF)
    F = np.eye(d) + 0.3 * np.random.default_rng(d).uniform(-1, 1, (d, d))
    x = Positions(space, space.from_input(mesh.points @ F.T + 0.7))
    smoothed, _ = elastic(space, law(3.0, 0.3), elements="smoothed")
    (linear,) = elastic(space, law(3.0, 0.3))
    forces, scale = space.to_input(smoothed.gradient(x)), np.abs(linear.gradient(x)).max()
    inside = np.setdiff1d(np.arange(len(mesh.points)), mesh.boundary)
    assert len(inside) >= 4 and scale > 0.01
    np.testing.assert_allclose(forces[inside], 0.0, atol=10 * ROUND * scale)
    np.testing.assert_allclose(forces, space.to_input(linear.gradient(x)), atol=10 * ROUND * scale)
    assert smoothed.value(x) == pytest.approx(linear.value(x), rel=ROUND)
    stresses = np.zeros((len(mesh.cells), 3, 3))
    CauchyStress(smoothed).add_to(stresses, x.whole)
    np.testing.assert_allclose(stresses, stresses[[0] * len(stresses)], atol=1e-11 * np.abs(stresses).max())


def pressed(mesh, share):
    """Positions (n, d) at which an inner vertex has come so near to the opposite side of an inner cell that the cell
    has this share of its volume.
    """
    inner = np.flatnonzero(~np.isin(mesh.cells, mesh.boundary).any(axis=1))
    corners = mesh.cells[inner[len(inner) // 2]]
    positions = mesh.points.copy()
    opposite = mesh.points[corners[1:]].mean(axis=0)
    positions[corners[0]] = opposite + share * (mesh.points[corners[0]] - opposite)
    return positions


@pytest.mark.parametrize("d", DIMENSIONS)
def test_a_cell_cannot_invert_where_means_would_let_it(d):
    mesh = box(d, 4, jitter=0.05)
    space = LevelSpace(mesh, MPI.COMM_SELF)
    term, guard = elastic(space, NeoHookean(3.0, 0.3), elements="smoothed")
    at = lambda share: space.from_input(pressed(mesh, share))
    volumes = lambda x: simplex_volumes(space.to_input(x), mesh.cells) / mesh.volumes
    assert 0.0 < volumes(at(0.05)).min() < 0.1 < volumes(at(0.2)).min() and volumes(at(-0.05)).min() < 0.0
    for share in (0.05, -0.05):
        assert np.isfinite(term.value(Positions(space, at(share)))), "no mean is inverted"
    assert guard.value(Positions(space, at(0.2))) == 0.0 < guard.value(Positions(space, at(0.05))) < np.inf
    assert guard.value(Positions(space, at(-0.05))) == np.inf
    check_term(guard, space, at(0.05), 1e-3)
    for projection in ("clamp", "abs"):
        rows = hessian_of(guard, space, at(0.05), projection).toarray()
        assert np.abs(rows).max() > 0.0 and smallest_eigenvalue(rows) >= -1e-10 * np.abs(rows).max()
    x = Positions(space, space.from_input(mesh.points))
    step = guard.max_step(x, at(-0.5) - x.owned)
    assert volumes(x.owned + step * (at(-0.5) - x.owned)).min() == pytest.approx(0.1, rel=1e-9)


@pytest.mark.parametrize(("d", "elements"), [(2, "linear"), (3, "smoothed")])
def test_a_block_that_is_crushed_keeps_its_cells(d, elements):
    """A law that gives way, pressed to a quarter of its height."""
    up = np.eye(d)[-1]
    supports = (Support(lambda X: X[:, -1] < 0.1), Support(lambda X: X[:, -1] > 0.9, motion=Translation(tuple(-up))))
    scene = make_scene((StVenantKirchhoff(1e5, 0.3),), dt=0.05, supports=supports, elements=elements)
    mesh = block((0.0,) * d, (1.0,) * d, 3, jitter=0.05)
    for report in march(make_stepper(scene, mesh), 15):
        assert simplex_volumes(report.positions, mesh.cells).min() > 0.0
    assert np.ptp(report.positions[:, -1]) == pytest.approx(0.25, abs=0.05)


def test_the_setting():
    """Of a scene, but for bodies that have their own; it is stored where it is not the usual one."""
    bodies = (NeoHookean(1e5),) * 2
    scene = make_scene(bodies, elements="smoothed")
    mixed = replace(scene, bodies=(replace(scene.bodies[0], elements="linear"), scene.bodies[1]))
    assert [mixed.elements_of(body) for body in mixed.bodies] == ["linear", "smoothed"]
    before, after = (Shot(None, {}, each).description() for each in (make_scene(bodies), mixed))
    assert "elements" not in before and after["elements"] == "smoothed"
    assert [body.get("elements") for body in after["bodies"]] == ["linear", None]
    for wrong in (lambda: scene.with_settings(elements="smooth"), lambda: replace(scene.bodies[0], elements="nodal")):
        with pytest.raises(InputError, match="must be smoothed or linear"):
            wrong()
