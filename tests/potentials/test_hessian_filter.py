"""The elastic Hessian's filter against a dense reference, for isotropic laws and for any other."""

import numpy as np
import pytest
import ufl
from mpi4py import MPI

from pdvol.forms.elasticity import neo_hookean
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.cell_energy import CellEnergy, Density
from pdvol.potentials.assembly.domains import Domains
from pdvol.scene import NeoHookean
from problems import elastic
from shapes import box
from taylor import check_term, hessian_of, smallest_eigenvalue, state

DIMENSIONS = [2, 3]
YOUNG, POISSON, DENSITY = 3.0, 0.3, 2.0
# relative difference to the dense reference: two eigensolvers of 4 x 4 and 9 x 9 matrices, summed over some cells
SAME = 1e-10
ROUND = 1e-12  # relative size of what should cancel


@pytest.fixture(scope="module")
def spaces():
    """A jittered cube of 2 boxes a side in each dimension."""
    return {d: LevelSpace(box(d, 2, jitter=0.1, seed=d), MPI.COMM_SELF) for d in DIMENSIONS}


def neo_hookean_hessian(F):
    """d2 psi / dF2 as a (d^2, d^2) matrix, rows of F first. By hand: dP = mu dF + (mu - lmbda ln J) G dF' G + lmbda (G
    : dF) G, G = F^-T.
    """
    d = len(F)
    mu, lmbda = (getattr(NeoHookean(YOUNG, POISSON), name) for name in ("mu", "lmbda"))
    G, ln_J = np.linalg.inv(F).T, np.log(np.linalg.det(F))
    columns = []
    for k in range(d * d):
        dF = np.eye(d * d)[k].reshape(d, d)
        columns.append((mu * dF + (mu - lmbda * ln_J) * G @ dF.T @ G + lmbda * np.sum(G * dF) * G).ravel())
    return np.column_stack(columns)


FIBRE = np.array([0.8, 0.6, 0.0])


def fibre_hessian(F, stiffness=5.0):
    """psi = (s / 4) (|F a|^2 - 1)^2. By hand: P = s (|F a|^2 - 1) F a a', dP = s [(|F a|^2 - 1) dF a a' + 2 (F a . dF
    a) F a a'].
    """
    d = len(F)
    a = FIBRE[:d]
    Fa = F @ a
    columns = []
    for k in range(d * d):
        dF = np.eye(d * d)[k].reshape(d, d)
        columns.append(
            (stiffness * ((Fa @ Fa - 1.0) * np.outer(dF @ a, a) + 2.0 * (Fa @ dF @ a) * np.outer(Fa, a))).ravel()
        )
    return np.column_stack(columns) + neo_hookean_hessian(F)


def fibre_psi(F, mu, lmbda, stiffness):
    a = ufl.as_vector([float(c) for c in FIBRE[: F.ufl_shape[0]]])
    return stiffness / 4 * (ufl.dot(F * a, F * a) - 1) ** 2 + neo_hookean(F, mu, lmbda)


def filtered(H, mode):
    values, vectors = np.linalg.eigh(0.5 * (H + H.T))
    values = {"none": values, "clamp": np.maximum(values, 0.0), "abs": np.abs(values)}[mode]
    return vectors * values @ vectors.T


def reference_hessian(space, x, law_hessian, mode):
    """Assembled densely in numpy: sum over cells of volume K' H K, H over F filtered, K from positions to F. Also the
    lowest eigenvalue.
    """
    mesh, d = space.mesh, space.dim
    out = np.zeros((x.size, x.size))
    lowest = np.inf
    where = np.empty(len(mesh.points), dtype=int)
    where[space.owned_points] = np.arange(len(mesh.points))
    for cell, volume in zip(where[mesh.cells], mesh.volumes, strict=True):
        X = space.from_input(mesh.points)[cell]
        gradients = np.linalg.inv(np.column_stack([np.ones(d + 1), X]))[1:].T  # (d + 1, d): of the hat functions
        F = x[cell].T @ gradients
        K = np.einsum("ab,ij->ajib", np.eye(d), gradients).reshape(
            d * d, (d + 1) * d
        )  # dF_aj = sum_i dx_ia gradients_ij
        H = law_hessian(F)
        lowest = min(lowest, np.linalg.eigvalsh(H)[0])
        unknowns = (cell[:, None] * d + np.arange(d)).ravel()
        out[np.ix_(unknowns, unknowns)] += volume * K.T @ filtered(H, mode) @ K
    return out, lowest


def make_law(space, anisotropic):
    if not anisotropic:
        return elastic(space, NeoHookean(YOUNG, POISSON, DENSITY))[0], neo_hookean_hessian
    material, ones = NeoHookean(YOUNG, POISSON), np.ones(len(space.mesh.cells))
    parameters = {"mu": material.mu * ones, "lmbda": material.lmbda * ones, "stiffness": 5.0 * ones}
    return CellEnergy(space, Density(fibre_psi), parameters, Domains(space, ones > 0.0)), fibre_hessian


# Compressed and sheared; the last is uniformly compressed: equal stretches, where the frames of F are not unique.
STATES = {"sheared": (0.3, 0.8), "compressed": (0.1, 0.5), "stretched": (0.05, 1.4), "uniform": (0.0, 0.6)}


@pytest.mark.parametrize("d", DIMENSIONS)
@pytest.mark.parametrize("anisotropic", [False, True], ids=["isotropic", "fibre"])
@pytest.mark.parametrize("mode", ["none", "clamp", "abs"])
def test_filter_against_a_dense_reference(spaces, d, anisotropic, mode):
    space = spaces[d]
    term, law_hessian = make_law(space, anisotropic)
    indefinite = 0
    for strain, stretch in STATES.values():
        x = state(space, strain, seed=7, stretch=stretch)
        expected, lowest = reference_hessian(space, x, law_hessian, mode)
        H = hessian_of(term, space, x, mode).toarray()
        scale = np.abs(expected).max()
        np.testing.assert_allclose(H, expected, atol=SAME * scale, rtol=0.0)
        if mode != "none":
            assert smallest_eigenvalue(H) >= -ROUND * scale
        indefinite += lowest < -1e-3
        # Translations are free: every row sums to zero over the vertices, component by component.
        np.testing.assert_allclose(H.reshape(x.size, -1, d).sum(axis=1), 0.0, atol=ROUND * scale * len(x))
    assert indefinite >= 2, "the filter had nothing to do"


def test_fibres_that_act_in_large_stretches_alone_are_seen(spaces):
    """Near rest the density is isotropic to the last bit, and its Hessian far from there still has the fibre."""
    material, space = NeoHookean(YOUNG, POISSON), spaces[3]
    ones = np.ones(len(space.mesh.cells))

    def psi(F, mu, lmbda):
        along = F[0, 0] ** 2 + F[1, 0] ** 2 + F[2, 0] ** 2
        return neo_hookean(F, mu, lmbda) + 50.0 * ufl.max_value(along - 1.6**2, 0.0) ** 2

    parameters = {"mu": material.mu * ones, "lmbda": material.lmbda * ones}
    term = CellEnergy(space, Density(psi), parameters, Domains(space, ones > 0.0))
    assert not term.stretches
    check_term(term, space, 1.8 * space.from_input(space.mesh.points), 1e-2)
