"""Each law against stresses derived by hand, and plane strain; damping against its own formula; a user's law; keys."""

from dataclasses import make_dataclass

import numpy as np
import pytest
import ufl
from mpi4py import MPI

from pdvol import (
    Body,
    FixedCorotational,
    Keyed,
    Material,
    NeoHookean,
    Pressure,
    Region,
    Scene,
    StVenantKirchhoff,
    native,
)
from pdvol.errors import InputError
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.materials import cell_materials, level_materials
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.cell_energy import CellEnergy, Density
from pdvol.potentials.assembly.domains import Domains
from pdvol.potentials.elasticity import CauchyStress, Damping
from pdvol.potentials.potential import Positions
from pdvol.scene import rotation_matrix
from problems import elastic, make_scene
from shapes import box, level, together
from taylor import check_term, hessian_of, smallest_eigenvalue, state

LAWS = [NeoHookean, StVenantKirchhoff, FixedCorotational]
DIMENSIONS = [2, 3]
YOUNG, POISSON = 3.0, 0.3
MU, LMBDA = YOUNG / (2 * (1 + POISSON)), YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
EXACT = 1e-12  # relative round-off of a few dozen operations


@pytest.fixture(scope="module")
def cells():
    """The unit simplex in each dimension."""
    return {
        d: LevelSpace(level(np.concatenate([np.zeros((1, d)), np.eye(d)]), [range(d + 1)]), MPI.COMM_SELF)
        for d in DIMENSIONS
    }


@pytest.fixture(scope="module")
def terms(cells):
    return {(law, d): elastic(cells[d], law(YOUNG, POISSON))[0] for law in LAWS for d in DIMENSIONS}


def moved(space, F):
    return Positions(space, space.from_input(space.mesh.points) @ np.asarray(F, dtype=float).T)


def stress(term, space, F):
    """First Piola-Kirchhoff stress: the force on corner a is the volume times P grad(hat a), and grad(hat a) is the
    a-th unit vector.
    """
    forces = space.to_input(term.gradient(moved(space, F))) * (2 if space.dim == 2 else 6)
    return forces[1:].T


def guard(J):
    """d/dJ of -k (u - 1)^2 ln u, u = J / 0.1 < 1, k = 2 mu + lmbda: barrier of laws that are finite at zero volume."""
    u = J / 0.1
    return 0.0 if u >= 1 else -(2 * MU + LMBDA) / 0.1 * (2 * (u - 1) * np.log(u) + (u - 1) ** 2 / u)


def stress_by_hand(law, U, s, V):
    """First Piola-Kirchhoff stress of F = U diag(s) V', in 2D for plane strain. Down to a tenth of the volume a law is
    unchanged; below, a smooth barrier is added, which is infinite at zero volume.
    """
    J, F, inverse, R = np.prod(s), U * s @ V.T, U / s @ V.T, U @ V.T
    if law is NeoHookean:
        return MU * (F - inverse) + LMBDA * np.log(J) * inverse
    strain = (s**2 - 1) / 2
    if law is StVenantKirchhoff:
        P = U * (s * (2 * MU * strain + LMBDA * strain.sum())) @ V.T
    else:
        P = 2 * MU * (F - R) + LMBDA * (J - 1) * J * inverse
    return P + guard(J) * J * inverse


STRETCHES = {
    "pulled": (1.7, 1.0, 1.0),
    "pressed": (0.4, 1.0, 1.0),
    "large": (1.6, 1.6, 1.6),
    "small": (0.5, 0.5, 0.5),
    "uneven": (1.4, 0.9, 0.7),
    "nearly equal": (1.2, 1.2 + 1e-9, 1.2 - 1e-5),
    "above the barrier": (0.101, 1.0, 1.0),
    "below the barrier": (0.099, 1.0, 1.0),
    "flat": (0.02, 1.0, 1.0),
    "needle": 1.2 * np.exp(-8.0 * np.array([0.0, 1.0, 1.8])),
}


@pytest.mark.parametrize("stretch", STRETCHES)
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("d", DIMENSIONS)
def test_stresses_by_hand(terms, cells, d, law, stretch):
    """Stretched along the axes and along any others, so also sheared, and turned."""
    s, one = np.array(STRETCHES[stretch][:d]), np.eye(d)
    turns = rotation_matrix(1.1, (1.0, 2.0, -0.5), d), rotation_matrix(-0.7, (0.3, -1.0, 0.4), d)
    for U, V in ((one, one), turns):
        P = stress_by_hand(law, U, s, V)
        found = stress(terms[law, d], cells[d], U * s @ V.T)
        atol = EXACT * np.abs(P).sum() if U is V else 1e-11 * np.abs(P).max()
        # Round-off of F changes a needle's volume.
        np.testing.assert_allclose(found, P, rtol=1e-7 if stretch == "needle" else 0.0, atol=atol)


@pytest.mark.parametrize("law", [StVenantKirchhoff, FixedCorotational])
@pytest.mark.parametrize("d", DIMENSIONS)
def test_derivatives_under_the_barrier(law, d):
    space = LevelSpace(box(d, 1, jitter=0.1), MPI.COMM_SELF)
    X = space.from_input(space.mesh.points)
    x = X @ np.diag([0.07] + [1.0] * (d - 1)) + 0.002 * np.random.default_rng(0).uniform(-1, 1, X.shape)
    check_term(elastic(space, law(YOUNG, POISSON))[0], space, x, 1e-3)


@pytest.mark.parametrize("law", LAWS)
def test_isotropic_laws_are_recognised(terms, law):
    """In 3D their Hessians go through stretches (test_terms_and_motions.py checks them), many times faster."""
    assert terms[law, 3].stretches


# ---- damping

DT, BETA = 0.02, 0.7


def damped(space):
    _, damping = elastic(space, NeoHookean(YOUNG, POISSON, damping=BETA))
    assert isinstance(damping, Damping)
    return damping


def begun(d):
    """A block's damping in a step from rest: its space, the positions at rest and the term."""
    space = LevelSpace(box(d, 1, jitter=0.1), MPI.COMM_SELF)
    X, term = space.from_input(space.mesh.points), damped(space)
    term.begin_step(Positions(space, X), 0.0, DT)
    return space, X, term


@pytest.mark.parametrize("d", DIMENSIONS)
def test_nothing_is_damped_where_nothing_deforms(d):
    """And the energy is least there."""
    space = LevelSpace(box(d, 1, jitter=0.1), MPI.COMM_SELF)
    rng = np.random.default_rng(0)
    X = space.from_input(space.mesh.points)
    x_t = X + 0.1 * rng.uniform(-1, 1, X.shape)
    term = damped(space)
    term.begin_step(Positions(space, x_t), 0.1, 0.1 + DT)
    turn = rotation_matrix(0.7, (0.0, 1.0, 1.0), d)
    for rigid in (x_t, x_t @ turn.T + 0.3):
        assert abs(term.value(Positions(space, rigid))) < 1e-25
        np.testing.assert_allclose(term.gradient(Positions(space, rigid)), 0.0, atol=1e-12)
    assert np.linalg.eigvalsh(hessian_of(term, space, x_t, "none").toarray())[0] > -1e-10


@pytest.mark.parametrize("s, t", [(1.1, 1.3), (0.6, 0.5), (0.9, 1.2)])
@pytest.mark.parametrize("d", DIMENSIONS)
def test_damping_stress_by_hand(cells, d, s, t):
    """Stretched from s to t in dt: D = (t^2 - s^2) / 2 along the axis, whose metric m is 1 / s, or 1 / s^2 where s < 1:
    P = damping / dt (2 mu m^2 D t + lmbda ln(t / s) / t) along it, and lmbda ln(t / s) damping / dt across.
    """
    space = cells[d]
    term = damped(space)
    term.begin_step(moved(space, np.diag([s] + [1.0] * (d - 1))), 0.0, DT)
    metric, growth = 1.0 / min(s, s**2), LMBDA * np.log(t / s)
    along = MU * metric**2 * (t**2 - s**2) * t + growth / t
    expected = BETA / DT * np.diag([along] + [growth] * (d - 1))
    np.testing.assert_allclose(stress(term, space, np.diag([t] + [1.0] * (d - 1))), expected, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_damping_is_rayleigh_s_at_rest(d):
    """D ~ 1/2 (x - x_t)' (damping / dt) K (x - x_t) with K the elastic Hessian at rest: stiffness-proportional."""
    space, X, damping = begun(d)
    (law,) = elastic(space, NeoHookean(YOUNG, POISSON))  # without damping there is no term of it
    K, C = (hessian_of(term, space, X, "none").toarray() for term in (law, damping))
    np.testing.assert_allclose(C, BETA / DT * K, atol=1e-10 * np.abs(C).max())


@pytest.mark.parametrize("d", DIMENSIONS)
def test_projected_damping_by_hand(d):
    """v'Hv = sum over cells of volume (2 mu |e|^2 + lmbda tr(F^-1 f)^2) damping / dt, e = sym(F'f), f the gradient of
    v: nothing of the viscous stress, however far from definite the exact Hessian is.
    """
    (space, X, term), rng = begun(d), np.random.default_rng(2)
    x, v = 0.7 * X + 0.1 * rng.uniform(-1, 1, X.shape), rng.standard_normal(X.shape)
    exact, H = (hessian_of(term, space, x, name).toarray() for name in ("none", "clamp"))
    F, f = (
        np.einsum("kia,kij->kaj", space.to_input(rows)[space.mesh.cells], space.mesh.hat_gradients) for rows in (x, v)
    )
    e = np.einsum("kai,kaj->kij", F, f)
    e = 0.5 * (e + e.transpose(0, 2, 1))
    density = 2.0 * MU * np.einsum("kij,kij->k", e, e) + LMBDA * np.einsum("kja,kaj->k", np.linalg.inv(F), f) ** 2
    assert v.ravel() @ H @ v.ravel() == pytest.approx(BETA / DT * density @ space.mesh.volumes, rel=1e-12)
    assert smallest_eigenvalue(H) > -1e-10 > smallest_eigenvalue(exact)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_damping_of_an_expansion_is_stiff_across_it(d):
    """The viscous stress is tensile, so the exact Hessian is definite: the projection "abs", for steps that overshoot,
    takes it whole, while "clamp" has nothing of it against a turn.
    """
    space, X, term = begun(d)
    exact, clamped, whole = (hessian_of(term, space, 1.5 * X, name).toarray() for name in ("none", "clamp", "abs"))
    np.testing.assert_allclose(whole, exact, atol=1e-11 * np.abs(exact).max())
    turn = (X @ (np.eye(d)[[1, 0, 2][:d]] * np.array([1.0, -1.0, 0.0])[:d, None])).ravel()
    assert abs(turn @ clamped @ turn) < 1e-9 < 1e-3 < turn @ exact @ turn


# ---- a user's law


def many_parameters(count):
    """A Neo-Hookean law whose mu is split into `count` parameters of its own."""

    def psi(F, mu, lmbda, **own):
        assert len(own) == count
        return NeoHookean.psi(F, sum(own.values()), lmbda)

    fields = [(f"p{i}", float, MU / count) for i in range(count)]
    return make_dataclass("Many", fields, bases=(Material,), namespace={"psi": staticmethod(psi)}, frozen=True)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_a_law_with_many_parameters_of_its_own(d):
    """As many as the C code has room for; it is isotropic all the same."""
    space, count = LevelSpace(box(d, 2, jitter=0.1), MPI.COMM_SELF), native.MAX_PARAMETERS - 2
    x = space.from_input(space.mesh.points * np.linspace(0.8, 1.3, d))
    (many,), (plain,) = (
        elastic(space, many_parameters(count)(YOUNG, POISSON)),
        elastic(space, NeoHookean(YOUNG, POISSON)),
    )
    assert bool(many.stretches) == (d == 3)
    at = Positions(space, x)
    np.testing.assert_allclose(many.value(at), plain.value(at), rtol=EXACT)
    np.testing.assert_allclose(many.gradient(at), plain.gradient(at), atol=EXACT * np.abs(plain.gradient(at)).max())
    H = hessian_of(plain, space, x).toarray()
    np.testing.assert_allclose(hessian_of(many, space, x).toarray(), H, atol=1e2 * EXACT * np.abs(H).max())


def test_a_law_with_too_many_parameters_is_refused(cells):
    with pytest.raises(InputError, match="^Many: psi has 72 parameters, at most 64 are possible; [^\\n]*$"):
        elastic(cells[3], many_parameters(70)(YOUNG, POISSON))


def test_a_parameter_that_is_a_vector_in_one_body_alone_is_refused():
    law = many_parameters(1)
    with pytest.raises(InputError, match="^Many.p0 is a vector in one place, and a number in another$"):
        cell_materials(make_scene((law(1.0), law(1.0, p0=(1.0, 0.0)))), together(box(2, 2), box(2, 1, 2.0, 3.0)))


def test_fibres_that_act_in_large_stretches_alone_are_seen():
    """Near rest the density is isotropic to the last bit, and its Hessian far from there still has the fibre."""
    space = LevelSpace(box(3, 2, jitter=0.1), MPI.COMM_SELF)
    ones = np.ones(len(space.mesh.cells))

    def psi(F, mu, lmbda):
        along = F[0, 0] ** 2 + F[1, 0] ** 2 + F[2, 0] ** 2
        return NeoHookean.psi(F, mu, lmbda) + 50.0 * ufl.max_value(along - 1.6**2, 0.0) ** 2

    term = CellEnergy(space, Density(psi), {"mu": MU * ones, "lmbda": LMBDA * ones}, Domains(space, ones > 0.0))
    assert not term.stretches
    check_term(term, space, 1.8 * space.from_input(space.mesh.points), 1e-2)


@pytest.mark.parametrize("psi", [lambda F, mu: mu**2, lambda F, mu: mu * F[0, 0]])
def test_a_density_without_forces_or_stiffness_is_refused(psi):
    space = LevelSpace(box(3, 1), MPI.COMM_SELF)
    mu = np.ones(len(space.mesh.cells))
    with pytest.raises(InputError, match=r"^an energy density, or a derivative of it by F, is zero; let psi [^\n]*$"):
        CellEnergy(space, Density(psi), {"mu": mu}, Domains(space, mu > 0.0))


# ---- Young's modulus by keys in time: energies are those of the material of each time

KEYS = Keyed((1.0, 3.0), (2.0, 6.0))
SECOND = 5.0  # Pa: Young's modulus of the other body


@pytest.mark.parametrize(
    ("d", "law", "elements"),
    [(2, StVenantKirchhoff, "linear"), (2, FixedCorotational, "smoothed"), (3, NeoHookean, "smoothed")],
)
def test_each_time_has_its_own_material(d, law, elements):
    """Value, gradient, Hessian and stress at t = 2.5 s are those of 5 Pa in one body, and of the other's own."""
    space = LevelSpace(together(box(d, 2, jitter=0.1), box(d, 1, 2.0, 3.0)), MPI.COMM_SELF)
    keyed, *_ = elastic(space, law(KEYS, 0.3), law(SECOND, 0.3), elements=elements)
    fixed, *_ = elastic(space, law(5.0, 0.3), law(SECOND, 0.3), elements=elements)
    x = state(space)
    at = Positions(space, x)
    early = keyed.value(at)
    keyed.begin_step(at, 2.4, 2.5)
    assert keyed.value(at) == pytest.approx(fixed.value(at), rel=1e-13) and keyed.value(at) > 1.2 * early
    np.testing.assert_allclose(keyed.gradient(at), fixed.gradient(at), rtol=1e-11, atol=1e-13)
    for projection in ("none", "clamp"):
        one, other = (hessian_of(term, space, x, projection).toarray() for term in (keyed, fixed))
        np.testing.assert_allclose(one, other, rtol=1e-10, atol=1e-12)
    stresses = [np.zeros((len(space.mesh.cells), 3, 3)) for _ in range(3)]
    measured = CauchyStress(keyed)
    for time, into in ((2.5, stresses[0]), (0.0, stresses[1])):
        keyed.set_time(time)
        measured.add_to(into, space.to_input(x))
    CauchyStress(fixed).add_to(stresses[2], space.to_input(x))
    np.testing.assert_allclose(stresses[0], stresses[2], rtol=1e-11, atol=1e-13)
    mine = space.mesh.bodies == 0
    np.testing.assert_allclose(stresses[0][mine], 2.5 * stresses[1][mine], rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("d", DIMENSIONS)
def test_damping_follows_too(d):
    """Damping is stress over strain rate by stress over strain: it scales with Young's modulus."""
    space = LevelSpace(box(d, 2, jitter=0.1), MPI.COMM_SELF)
    _, keyed = elastic(space, NeoHookean(KEYS, 0.3, damping=0.1))
    _, fixed = elastic(space, NeoHookean(6.0, 0.3, damping=0.1))
    x_t, x = Positions(space, space.from_input(space.mesh.points)), Positions(space, state(space))
    for term in (keyed, fixed):
        term.begin_step(x_t, 3.9, 4.0)
    assert keyed.value(x) == pytest.approx(fixed.value(x), rel=1e-13)
    keyed.begin_step(x_t, 0.1, 0.2)
    assert keyed.value(x) == pytest.approx(fixed.value(x) / 3.0, rel=1e-12)


def test_levels_carry_what_follows_time():
    coarse, fine = box(2, 2), box(2, 5, jitter=0.1)
    hierarchy = Hierarchy([coarse, fine], MPI.COMM_SELF)
    body = Body(("grid",), NeoHookean(5.0), regions=(Region(NeoHookean(KEYS), lambda X: X[:, 0] > 0.5),))
    scene = Scene((body,), dt=0.1, steps=1)
    found = [level_materials(scene, hierarchy, level) for level in range(2)]
    ((_, chosen),), ((keys, carried),) = (materials.keyed for materials in found)
    assert keys is KEYS and 0 < carried.sum() < len(carried)
    np.testing.assert_array_equal(carried, chosen[hierarchy.origins(1)])
    np.testing.assert_array_equal(found[1].young == 2.0, carried)
    assert found[0].softest == found[1].softest == 2.0
    falling = make_scene((NeoHookean(Keyed((0.0, 1.0), (8.0, 3.0))), NeoHookean(5.0)))
    assert cell_materials(falling, together(coarse, box(2, 1, 2.0, 3.0))).softest == 3.0
    assert falling.bodies[0].uniform  # in space: nothing is bound


def test_keys():
    assert [KEYS(t) for t in (0.0, 1.0, 2.0, 9.0)] == [2.0, 2.0, 4.0, 6.0]
    assert Keyed(np.array([1.0, 3.0]), [2.0, 6.0]) == KEYS and hash(KEYS) == hash(Keyed([1, 3], [2, 6]))
    assert Pressure("a", KEYS).at(2.0) == 4.0
