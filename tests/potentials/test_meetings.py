"""Pairs that a direction brings together: which, the tangents that stand for them, and what these do to Newton's
method.
"""

from itertools import product

import numpy as np
import pytest

from barrier_law import curvature, pressure
from pdvol import meshes
from pdvol.meshing.build import read_obstacle
from pdvol.potentials.assembly.hessian_blocks import BlockPattern, HessianBlocks
from pdvol.potentials.contact.barrier import ContactBarrier
from pdvol.potentials.contact.candidates import EDGES, POINT
from pdvol.potentials.potential import LEAST_LEFT, PRESSED_GAP_SHARE, Positions
from pdvol.scene import Barrier, Friction, NeoHookean, Placement, Rigid, Solver
from pdvol.solve import newton
from pdvol.solve.newton import Newton
from problems import SOFT, block, ground, make_scene, make_stepper, march, weight
from shapes import together
from touching_blocks import DHAT, KAPPA, touching


@pytest.fixture(scope="module", params=list(product((2, 3), ("plane", "surface"))), ids=str)
def barrier(request):
    """Two blocks, near each other and their ground."""
    _, term = touching(*request.param)
    return term


def ways(term, count=60):
    """Random directions from where the blocks are, of sizes from a tenth of dhat to a hundred dhat."""
    rng, x = np.random.default_rng(3), Positions(term.space, term.space.from_input(term.space.mesh.points))
    for size in np.logspace(-1, 2, count) * DHAT:
        whole = rng.uniform(-1, 1, x.owned.shape[1])  # bodies move as wholes, and a little within
        yield x, x.moved(size, whole + 0.3 * rng.uniform(-1, 1, x.owned.shape))


def law_at(gaps):
    """Forces and stiffnesses of a unit weight at gaps (k,)."""
    s = np.minimum(gaps / DHAT, 1.0) ** 2
    return pressure(s, DHAT, KAPPA), curvature(s, DHAT, KAPPA)


def test_an_obstacle_cut_finely_changes_nothing_between_bodies():
    """Lists keep their slack, and two bodies meet as far apart as before. With that obstacle, meetings are nearer."""
    reached = {}
    for cuts in (1, 60):
        floor = Rigid(meshes.box((4.0, 4.0, 0.2), (cuts, cuts, 1)), Placement((0.5, 0.5, -0.2)), name="floor")
        cubes = together(block((0, 0, 0), (1, 1, 1), 4), block((0, 0, 1.1), (1, 1, 2.1), 4))
        scene = make_scene((SOFT, SOFT), obstacles=(floor,), contact=(Barrier(dhat=1e-2),))
        problem = make_stepper(scene, cubes, [read_obstacle(floor)])
        (term,) = problem.potential.contacts
        candidates, surface = term.candidates, term.surface
        start = surface.vertices(Positions(term.space, term.space.from_input(term.space.mesh.points)))
        bodies, others = surface.objects < 2, surface.objects == 2
        for name, who, way in (("bodies", surface.objects == 1, -0.5), ("floor", bodies, -0.5)):
            end = start + np.where(who[:, None], [0.0, 0.0, way], 0.0)
            found = candidates.meetings(start, end)
            with_floor = others[found["vertices"]].any(axis=1)
            reached[name, cuts] = np.count_nonzero(with_floor == (name == "floor"))
        reached["slack", cuts] = candidates.primitives.edge_length
    assert reached["slack", 1] == reached["slack", 60]
    assert reached["bodies", 1] == reached["bodies", 60] > 0
    assert reached["floor", 1] > 0 == reached["floor", 60]


def test_pairs_meet_where_collision_detection_ends_a_step_and_nowhere_else(barrier):
    candidates, surface, seen = barrier.candidates, barrier.surface, set()
    for (x, end), share in product(ways(barrier), (LEAST_LEFT, PRESSED_GAP_SHARE)):
        start, stop = surface.vertices(x), surface.vertices(end)
        step = candidates.max_step(start, stop, share)
        found = candidates.meetings(start, stop, share)
        assert candidates.is_clear(start, stop, share) == (step == 1.0) == (len(found) == 0)
        assert min(found["time"], default=1.0) == pytest.approx(step, rel=1e-5)
        for kind, one in {(kind, one) for kind, one, _ in found["pair"].tolist() if kind == POINT}:
            times = found["time"][(found["pair"][:, :2] == (kind, one)).all(axis=1)]
            assert np.all(times == times[0]), "of a vertex, only the first"
        d = start.shape[1]
        normals, times = found["normal"][:, :d], found["time"]
        gap_of = lambda places, found=found: np.einsum("ki,kid->kd", found["coefficients"], places[found["vertices"]])
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=1e-12)
        np.testing.assert_allclose(found["coefficients"].sum(axis=1), 0.0, atol=1e-12)
        np.testing.assert_allclose(found["gap"], np.sum(normals * gap_of(start), axis=1), atol=1e-12)
        met = np.sum(normals * gap_of(start) + times[:, None] * normals * gap_of(stop - start), axis=1)
        assert np.all(met > 0.0) and np.all(met <= found["distance"] + 1e-12)
        seen |= set(found["pair"][:, 0].tolist())
    assert POINT in seen and (start.shape[1] == 2 or EDGES in seen)


def test_what_is_predicted_is_the_tangent_of_the_law_at_the_expected_gaps(barrier):
    """Beside the same in numpy: change of the gradient, and blocks of the Hessian, for expectations of two rounds."""
    space, count = barrier.space, 0
    rows, size = barrier.surface.rows, space.n_owned * space.dim
    for x, end in ways(barrier, 12):
        for last in (False, True):
            if not barrier.predict(x, end, last=last):
                continue
            found, d = barrier._meetings, space.dim
            force, stiffness = law_at(found["expected"])
            now, softer = law_at(found["distance"])
            slope = found["weight"] * (stiffness * (found["gap"] - found["expected"]) - force + now)
            more = found["weight"] * np.maximum(stiffness - softer, 0.0)
            gradient, hessian = np.zeros((len(rows), d)), np.zeros((size, size))
            for k, meeting in enumerate(found):
                c, n = meeting["coefficients"], meeting["normal"][:d]
                np.add.at(gradient, meeting["vertices"], slope[k] * c[:, None] * n)
                for (i, v), (j, w) in product(enumerate(rows[meeting["vertices"]]), repeat=2):
                    if v >= 0 and w >= 0:
                        hessian[d * v : d * v + d, d * w : d * w + d] += more[k] * c[i] * c[j] * np.outer(n, n)
            expected = barrier.surface.rows_of(gradient)
            np.testing.assert_allclose(barrier.predicted_change(x), expected, atol=1e-12 * np.abs(expected).max())
            blocks = HessianBlocks(BlockPattern(space))
            barrier.add_predicted(2.0, blocks)
            a, b, added = blocks.added
            upper = np.zeros_like(hessian)
            for row, column, part in zip(a, b, added, strict=True):
                upper[d * row : d * row + d, d * column : d * column + d] += part
            upper = np.triu(upper) + np.triu(upper, 1).T
            np.testing.assert_allclose(upper, 2.0 * hessian, atol=1e-12 * np.abs(hessian).max())
            count += len(found)
        barrier.forget_prediction()
        assert not barrier.meets and np.all(barrier.predicted_change(x) == 0.0)
    assert count > 20


def test_an_expected_gap_has_the_force_that_stops_a_mass():
    """One pair after another along its normal, as springs of a given stiffness press it: rounds of predictions end at
    the gap where law and spring balance.
    """
    _, term = touching(3, "plane")
    x = Positions(term.space, term.space.from_input(term.space.mesh.points))
    spring, shift = 1e-3, np.array([0.0, 0.0, -3.0 * DHAT])  # N/m; the end without contact
    end = x.moved(1.0, np.broadcast_to(shift, x.owned.shape))
    assert term.predict(x, end)
    first = term._meetings[np.flatnonzero(term._meetings["pair"][:, 0] == 2)][:1]  # a vertex and the plane
    assert len(first) == 1
    term._meetings = first
    for _ in range(40):
        meeting = term._meetings[0]
        force, stiffness = (float(part[0] * meeting["weight"]) for part in law_at(meeting["expected"][None]))
        fall = (spring * -shift[2] + stiffness * (meeting["gap"] - meeting["expected"]) - force) / (spring + stiffness)
        if not term.predict(x, x.moved(1.0, np.broadcast_to([0.0, 0.0, -fall], x.owned.shape)), last=True):
            break
    gap = meeting["gap"] - fall
    push = float(meeting["weight"] * law_at(np.array([gap]))[0][0])
    assert push == pytest.approx(spring * (-shift[2] - fall), rel=PRESSED_GAP_SHARE)


def thrown(d, mu, young, speed=6.0, steps=12):
    """Newton iterations, and the energies [J] after the first three steps, of a block that falls onto another one at a
    speed [m/s].
    """
    up = np.eye(d)[-1]
    scene = make_scene(
        (NeoHookean(young, 0.4, 1000.0),) * 2,
        dt=0.01,
        loads=(weight(d),),
        obstacles=ground(d)[:1],
        contact=(Barrier(dhat=2e-3), *((Friction(mu, eps_v=1e-3),) if mu else ())),
        solver=Solver(tolerance=1e-8),
    )
    cuts = (4,) * d
    low = block((0.0,) * (d - 1) + (4e-3,), (0.3,) * (d - 1) + (0.204,), cuts)
    high = block((0.05,) * (d - 1) + (0.21,), (0.33,) * (d - 1) + (0.41,), cuts)
    velocity = np.where(np.arange(len(low.points) + len(high.points))[:, None] < len(low.points), -0.5, -speed) * up
    reports = list(march(make_stepper(scene, together(low, high)), steps, velocity=velocity))
    return sum(r.newton_iterations for r in reports), [sum(r.energy.values()) for r in reports[:3]]


@pytest.mark.parametrize("d, mu, young", [(2, 0.3, 3e4), (3, 0.0, 3e4), (3, 0.3, 3e2)])
def test_predictions_spare_iterations_and_leave_the_minimum_where_it_is(monkeypatch, d, mu, young):
    """They spare two fifths where much meets, between blocks that fold; these have several minima, so that two starts
    are taken together. Between stiffer ones a few vertices may slide without a change of energy.
    """
    folds = young < 1e3
    speeds = (5.99, 6.0) if folds else (6.0,)
    fewer, found = zip(*(thrown(d, mu, young, speed) for speed in speeds), strict=True)
    monkeypatch.setattr(ContactBarrier, "predict", lambda *_, **__: False)
    iterations, expected = zip(*(thrown(d, mu, young, speed) for speed in speeds), strict=True)
    assert sum(fewer) < (0.75 if folds else 1.1) * sum(iterations)
    assert folds or found[0] == pytest.approx(expected[0], rel=1e-9)


@pytest.mark.parametrize("factor", [1.0, 5.0])
def test_the_line_search_begins_where_collision_detection_allows_and_predictions_lead_lower(monkeypatch, factor):
    """Of the direction with pairs that meet and the raw one, each as far as it is free, the one taken ends lower.
    Lengthened directions are as safe.
    """
    begin, predict, ends, longer = Newton._begin_iteration, Newton._predict, [], 0

    def predicted(solver, x, step):
        alone = solver._direction(step).copy()
        way, free = predict(solver, x, step)
        if solver._solve.meets and free is not None:
            ends.append(
                [solver.potential.value(x.moved(solver.potential.max_step(x, path), path)) for path in (way, alone)]
            )
        return way, free

    def begun(solver, x, way, free):
        nonlocal longer
        length = begin(solver, x, way, free)
        longer += solver._solve.last.lengthening > 1.0
        assert solver.potential.max_step(x, length * way, gap_share=0.5 * LEAST_LEFT) > 1.0 - 1e-9
        return length

    monkeypatch.setattr(Newton, "_predict", predicted)
    monkeypatch.setattr(Newton, "_begin_iteration", begun)
    if factor > 1.0:
        monkeypatch.setattr(newton, "step_factor", lambda *_: factor)
    thrown(3, 0.0, 3e2, steps=6)
    new, raw = np.array(ends).T
    assert len(new) > 5 and np.all(new < raw + 1e-9 * np.abs(raw))
    assert factor == 1.0 or longer > 0
