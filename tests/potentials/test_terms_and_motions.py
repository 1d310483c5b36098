"""Every term, under every motion of the obstacles, exact and projected, in 2D and 3D: its derivatives, the sign of what
is projected, and that a body which goes along with its ground feels no friction.
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
import ufl
from mpi4py import MPI

import pdvol
from pdvol.levels.script import Script
from pdvol.levels.space import LevelSpace
from pdvol.potentials.build import Terms, build_terms
from pdvol.potentials.consistency import Guide
from pdvol.potentials.elasticity import CellGuard
from pdvol.potentials.potential import Earlier, Positions, Rates
from pdvol.registry import ELEMENTS
from pdvol.scene import rotation_matrix
from pdvol.solve.incremental_potential import IncrementalPotential
from pdvol.solve.report import Stopwatch
from problems import elastic, make_model, make_scene
from shapes import box, level, together
from taylor import check_derivatives, check_term, hessian_of, smallest_eigenvalue, state

DHAT, EPS_V, MU = 0.05, 0.1, 0.4
T0, DT = 1.0, 0.02  # [s]: motions have gone some way when the step begins
SLIP = EPS_V * DT  # [m]: below it friction is smoothed
DIMENSIONS = (2, 3)
ROUND = 1e-10  # relative size of what should cancel


def turned(d):
    return pdvol.Rotation(0.1, (5.0, -1.0, 0.4)[:d], (0.3, -0.2, 1.0))


def shifted(d, stop=np.inf):
    return pdvol.Translation((0.4, 0.1, -0.2)[:d], stop)


MOTIONS = {  # the motion of all obstacles, and its own time [s] at the step's start and end
    "none": (lambda d: pdvol.Still(), T0, T0 + DT),
    "translation": (shifted, T0, T0 + DT),
    "rotation": (turned, T0, T0 + DT),
    "path": (lambda d: pdvol.Path((0.0, 1.0, 2.0), np.eye(3)[:, :d] * 0.3, smooth=True), T0, T0 + DT),
    "held back": (turned, T0, T0 + 0.3 * DT),
    "stopped": (shifted, T0, T0),
    "late": (turned, T0 - 0.5 * DT, T0 + DT),
    "ended": (lambda d: shifted(d, 0.5 * T0), T0, T0 + DT),
}

TERMS = {  # a length [m] over which remainders show, and whether the energy is linear or quadratic
    "elastic": (1e-2, {}),
    "damping": (1e-2, {}),
    "load": (1e-2, {"linear": True}),
    "pressure": (1e-2, {}),
    "drag": (1e-2, {}),
    "muscle": (1e-2, {"quadratic": True}),
    "attachment": (1e-2, {}),
    "pull": (1e-2, {}),
    "consistency": (1e-2, {"quadratic": True}),
    "plane barrier": (2e-4, {}),
    "surface barrier": (2e-4, {}),
    "plane friction": (0.02 * SLIP, {}),
    "surface friction": (0.02 * SLIP, {}),
}
GROUNDS = ("plane", "surface")
LENGTHS = (None, 0.0, 0.5, 5.0)  # [m] of springs at rest: their own, none, pulled and pressed ones
INTERNAL = ("elastic", "damping", "pressure", "muscle", "attachment")
WITH_RATES = ("damping", "drag", "plane friction", "surface friction")
WITH_OBSTACLES = ("plane barrier", "surface barrier", "plane friction", "surface friction")
KINDS = {
    "ContactBarrier": "{} barrier",
    "LaggedFriction": "{} friction",
    "DeadLoad": "load",
    "Attachments": "attachment",
}


def placed(d):
    """A mesh at rest, positions (n, d) of it in contact, and a rigid pit: a cube above height zero, another one that
    stands on a corner in the pit, where edges meet at a corner that is concave.
    """
    rng = np.random.default_rng(d)
    flat, tip = box(d, 2, jitter=0.05, seed=1), box(d, 1)
    low = flat.points[:, -1] < 0.2
    flat.points[low, -1] = DHAT * rng.uniform(0.3, 0.8, low.sum())
    diagonal, up = np.ones(d) / np.sqrt(d), np.eye(d)[-1]
    axis = np.cross(np.pad(diagonal, (0, 3 - d)), np.pad(up, (0, 3 - d)))
    turn = rotation_matrix(np.arccos(diagonal @ up) if d == 3 else np.pi / 4, axis, d)
    corner = np.array([2.5, 0.3, 0.2])[:d]
    onto = tip.points @ turn.T + corner
    rim = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]] if d == 3 else [[-1, 0], [1, 0]]
    bottom = corner - 0.5 * DHAT * up + 0.05 * DHAT * np.eye(d)[0]
    pit = np.vstack([bottom, bottom + 3.0 * np.array(rim) + 2.0 * up])
    edges = [[0, i + 1] for i in range(len(rim))]
    faces = [[0, i + 1, (i + 1) % 4 + 1] for i in range(4)] if d == 3 else np.zeros((0, 3))
    positions = np.vstack([flat.points, onto])
    mesh = together(flat, replace(tip, points=onto))
    strain = np.eye(d) + 0.1 * rng.uniform(-1, 1, (d, d))
    return replace(mesh, points=positions @ strain.T), positions, (pit, np.array(edges), np.array(faces, dtype=int))


class Built:
    """All terms of a level on one of the grounds, begun at T0 and moved on to the end of a step.

    Attributes
    ----------
    terms : by name, of which there is one but for loads
    whole : the terms and the masses
    along : (n, d) [m] where everything goes along with the obstacles
    x : (n, d) [m] some slips away from there, where friction is smoothed
    far : (n, d) [m] where all that touches slides
    """

    def __init__(self, d, motion, ground, law=pdvol.NeoHookean, order=1, elements="linear"):
        make, begin, end = MOTIONS[motion]
        move, up = make(d), np.eye(d)[-1]
        mesh, positions, pit = placed(d)
        self.space = LevelSpace(mesh, MPI.COMM_SELF)
        scene = make_scene(
            (law(3e3, 0.3, 10.0, damping=0.01),) * 2,
            elements=elements,
            loads=(
                pdvol.Gravity(tuple(-9.8 * up)),
                pdvol.Force(tuple(3.0 * up), body="body 0"),
                pdvol.PointForce(tuple(np.ones(d)), tuple(mesh.points[0]), "body 0"),
                pdvol.Pressure("body 0", 40.0),
                pdvol.Flow(tuple(np.ones(d)), 10.0, body="body 1"),
            ),
            muscles=(pdvol.Muscle("body 1", tuple(np.eye(d)[0]), 500.0),),
            attachments=tuple(
                pdvol.Attachment("body 0", "body 1", lambda X: X[:, 0] > 0.7, stiffness=30.0, rest_length=length)
                for length in LENGTHS
            ),
            pulls=(pdvol.Pull("body 0", (1.0,) * d, (T0, T0 + 1.0), [(1.2,) * d, (3.0,) * d], 30.0, 0.8),),
            obstacles=(
                pdvol.Plane((0.0,) * d, tuple(up), move)
                if ground == "plane"
                else pdvol.Rigid("pit", motion=move, closed=False),
            ),
            contact=(pdvol.Barrier(dhat=DHAT), pdvol.Friction(MU, eps_v=EPS_V)),
        )
        model = make_model(scene, mesh, [pit] if ground == "surface" else [])
        script = Script()
        target = positions + 0.1 * np.sin(np.arange(positions.size)).reshape(positions.shape)
        self.whole = build_terms(model, self.space, (Guide(3.0, lambda time: target),), script)
        terms = self.whole.potentials
        rows, x_t = self.space.from_input, move(positions, begin)
        late = dict.fromkeys(model.obstacles, T0 - begin)
        script.begin(T0, T0 + DT, late)
        before = Earlier(-1 / 3, Positions(self.space, rows(move(positions, T0 - DT))), T0 - DT, {})  # on time
        for term in terms:
            term.begin_step(Positions(self.space, rows(x_t)), T0, T0 + DT)
            if order == 2:
                term.set_rates(Rates(2 * DT / 3, (before,)))
        if end < T0 + DT:
            script.stop(model.obstacles, end)
        for term in terms:
            term.move_obstacles(T0 + DT)
        self.along = rows(move(positions, end))
        self.x = self.along + SLIP * np.random.default_rng(5).uniform(0.1, 0.4, self.along.shape)
        self.far = self.x + 10.0 * SLIP * np.eye(d)[0]
        self.terms: dict = {}
        for term in terms:
            if not isinstance(term, CellGuard):  # zero here; test_smoothed_elements.py presses cells
                self.terms.setdefault(KINDS.get(type(term).__name__, term.name).format(ground), []).append(term)


built = cache(Built)


def assert_projected(term, at, x, size=0.0):
    """Projected Hessians are positive semi-definite, beside entries of this size at least."""
    for projection in ("clamp", "abs"):
        rows = hessian_of(term, at.space, x, projection).toarray()
        assert smallest_eigenvalue(rows) >= -ROUND * max(size, np.abs(rows).max()), projection


def check(at, name, length, options):
    """Derivatives, exact and projected, of the terms of a name; those of internal forces balance."""
    flat = at.space.dim == 2
    for term in at.terms[name]:
        try:
            if name == "pressure":
                options = {"quadratic": flat}  # an area is quadratic, a volume is not
            elif name == "attachment":
                options = {"quadratic": term.springs.rest_length.max() == 0.0}
            check_term(term, at.space, at.x, length, **options)
            assert_projected(term, at, at.x)
            if "friction" in name:  # on a line, sliding forces are constant
                check_term(term, at.space, at.far, 10.0 * length, linear=flat)
                assert_projected(term, at, at.far, np.abs(term.gradient(Positions(at.space, at.far))).max() / SLIP)
            if name in INTERNAL:
                force = term.gradient(Positions(at.space, at.x))
                moments, size = at.x.T @ force, np.abs(force).max()
                np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=ROUND * size)
                np.testing.assert_allclose(moments, moments.T, atol=ROUND * size)
        except AssertionError as error:
            raise AssertionError(f"{name}: {error}") from None


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("d", DIMENSIONS)
def test_exact_derivatives_and_projected_signs(d, motion, order):
    """Gradients and Hessians that are not projected agree with differences; projected ones are semi-definite."""
    on = {ground: built(d, motion, ground, order=order) for ground in GROUNDS}
    assert set().union(*(at.terms for at in on.values())) == set(TERMS)
    for name, (length, options) in TERMS.items():
        if (motion != "none" and name not in WITH_OBSTACLES) or (order == 2 and name not in WITH_RATES):
            continue  # nothing in these depends on obstacles, or on rates
        check(on["surface" if name.startswith("surface") else "plane"], name, length, options)


@dataclass(frozen=True)
class Fibred(pdvol.Material):
    """A law of a user's own, which is not isotropic."""

    fibres: float = 5e3
    along: object = lambda X: np.eye(X.shape[1])[0] + 0.3 * X  # a vector (n, d)

    @staticmethod
    def psi(F, mu, lmbda, fibres, along):
        stretched = ufl.inner(F * along, F * along)
        return pdvol.NeoHookean.psi(F, mu, lmbda) + fibres / 4 * (stretched - 1) ** 2


LAWS = [pdvol.NeoHookean, pdvol.StVenantKirchhoff, pdvol.FixedCorotational, Fibred]


@pytest.mark.parametrize("elements", ELEMENTS)
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("d", DIMENSIONS)
def test_laws_and_elements(d, law, elements):
    at = Built(d, "none", "plane", law, order=2, elements=elements)
    for name in ("elastic", "damping", "muscle"):
        check(at, name, *TERMS[name])


@pytest.mark.parametrize("elements", ELEMENTS)
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("d", DIMENSIONS)
def test_filtered_hessians_have_the_positive_part_or_the_size_of_each_eigenvalue(d, law, elements):
    """Of the Hessian over F, which one cell's own shows: sheared, compressed, stretched and uniformly compressed, where
    the frames of F are not unique.
    """
    corners = np.concatenate([np.zeros((1, d)), np.eye(d)])
    space = LevelSpace(
        level(corners + 0.1 * np.sin(np.arange(d * d + d)).reshape(-1, d), [range(d + 1)]), MPI.COMM_SELF
    )
    term, indefinite = elastic(space, law(3.0, 0.3), elements=elements)[0], 0
    slopes = np.linalg.inv(np.column_stack([np.ones(d + 1), space.from_input(space.mesh.points)]))[1:]  # of hats
    K = np.einsum("ab,ji->ajib", np.eye(d), slopes).reshape(d * d, -1)  # from positions to F
    for strain, stretch in ((0.3, 0.8), (0.1, 0.5), (0.05, 1.4), (0.0, 0.6)):
        x = state(space, strain, seed=7, stretch=stretch)
        exact, clamped, whole = (hessian_of(term, space, x, name).toarray() for name in ("none", "clamp", "abs"))
        values, vectors = np.linalg.eigh(np.linalg.pinv(K).T @ exact @ np.linalg.pinv(K))
        for found, kept in ((clamped, np.maximum(values, 0.0)), (whole, np.abs(values))):
            expected = K.T @ (vectors * kept @ vectors.T) @ K
            np.testing.assert_allclose(found, expected, rtol=0.0, atol=ROUND * np.abs(exact).max())
        indefinite += values[0] < -1e-3 * values[-1]
    assert indefinite >= 1, "the filter had nothing to do"


@pytest.mark.parametrize("d", DIMENSIONS)
def test_the_whole_potential(d):
    """Inertia plus dt^2 times the terms but friction, with a large dt so that both matter."""
    at = Built(d, "none", "plane")
    terms = tuple(term for term in at.whole.potentials if term.name != "friction")
    potential = IncrementalPotential(at.space, Terms(at.whole.mass, terms), Stopwatch())
    potential.begin_step(Positions(at.space, at.along), at.x - 0.1, 1.0, T0, T0 + 1.0)
    check_term(potential, at.space, at.x, 2e-3)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("kind", GROUNDS)
@pytest.mark.parametrize("d", DIMENSIONS)
def test_what_goes_along_feels_no_friction(d, kind, motion, order):
    """Bodies that follow where obstacles have really gone slip by nothing: at most a gap times the angle of the step,
    which is the more beside the smoothed slip, the shorter the duration of rates. Sliding by ten times the smoothed
    slip they feel mu times the normal force, against the slip.
    """
    at = built(d, motion, kind, order=order)
    (friction,), (barrier,) = at.terms[f"{kind} friction"], at.terms[f"{kind} barrier"]
    sliding = np.abs(friction.forces).max()
    assert barrier.count(Positions(at.space, at.along)) > 1 and sliding > 0.0
    duration = {1: DT, 2: 2 * DT / 3}[order]
    assert np.abs(friction.gradient(Positions(at.space, at.along))).max() < 0.1 * sliding * DT / duration
    away = at.along + 10.0 * SLIP * np.eye(d)[0]
    force = friction.gradient(Positions(at.space, away))
    if kind == "plane":
        lagged = np.sort(np.linalg.norm(force, axis=1)[np.abs(force).max(axis=1) > 0.0])
        np.testing.assert_allclose(lagged, np.sort(friction.forces), rtol=1e-9)
        assert np.all(force[:, 0] >= 0.0)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_the_pit_has_contacts_that_weigh_negatively(d):
    """The corner of the property's scene: its contacts in a concave corner are counted more than once, and taken off
    again.
    """
    (friction,) = built(d, "none", "surface").terms["surface friction"]
    assert friction.forces.min() < 0.0 < friction.forces.max()


def test_the_check_notices_a_wrong_gradient():
    x = np.linspace(0.1, 1.0, 6).reshape(3, 2)
    value, gradient = lambda x: np.sum(x**4), lambda x: 4.0 * x**3
    hessian = lambda x: np.diag(12.0 * x.ravel() ** 2)
    check_derivatives(value, gradient, hessian, x, 1e-2)
    with pytest.raises(AssertionError, match="gradient: slope"):
        check_derivatives(value, lambda x: 4.04 * x**3, hessian, x, 1e-2)
    with pytest.raises(AssertionError, match="Hessian: slope"):
        check_derivatives(value, gradient, lambda x: 1.01 * hessian(x), x, 1e-2)
    with pytest.raises(AssertionError, match="not active"):
        check_derivatives(lambda x: 0.0, np.zeros_like, None, x, 1e-2)
