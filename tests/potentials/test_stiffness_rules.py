"""Barrier stiffness that is chosen at each step's start, against ipctk's own functions."""

import ipctk
import numpy as np
import pytest
from mpi4py import MPI
from scipy.sparse import block_diag, csc_matrix

from contact_reference import mesh_of
from pdvol.levels.obstacles import plane_obstacle
from pdvol.levels.space import LevelSpace
from pdvol.potentials.build import build_terms
from pdvol.potentials.contact import barrier_law
from pdvol.potentials.contact.barrier import SurfaceBarrier
from pdvol.potentials.contact.collision_surface import CollisionSurface, Obstacle
from pdvol.potentials.contact.planes import HalfSpaceBarrier
from pdvol.potentials.contact.stiffness import (
    CUBIC_CURVATURE,
    MIDWAY_CURVATURE,
    AdaptiveStiffness,
    SemiImplicitStiffness,
)
from pdvol.potentials.potential import Positions
from pdvol.scene import Barrier, Body, Gravity, NeoHookean, Plane, Scene
from problems import make_model, polyline, tetrahedron
from shapes import box, together

DHAT, KAPPA = 0.05, 0.3


@pytest.fixture(scope="module")
def touching():
    """By dimension: a space of two boxes half a dhat apart with an obstacle's tip below, its unweighted barrier, and
    owned positions.
    """
    made = {}
    for d in (2, 3):
        low = np.r_[np.full(d - 1, 0.13), 1.0 + 0.5 * DHAT]
        space = LevelSpace(together(box(d, 2), box(d, 2, low=low, high=low + 0.5)), MPI.COMM_SELF)
        foot = [[-1, -2], [2, -2]] if d == 2 else [[-1, -1, -2], [2, 0, -2], [0, 2, -2]]
        tip = (polyline if d == 2 else tetrahedron)([*foot, [0.45] * (d - 1) + [-0.4 * DHAT]])
        jitter = 0.2 * DHAT * np.random.default_rng(d).uniform(-1, 1, (space.n_owned, d))
        x = space.from_input(space.mesh.points) + jitter
        made[d] = (
            space,
            SurfaceBarrier(
                CollisionSurface(
                    space, (Obstacle("tip", "mesh" if d == 3 else "polyline", *tip),), DHAT, weighted=False
                ),
                KAPPA,
            ),
            x,
        )
    return made


@pytest.mark.parametrize("d", [2, 3])
def test_contact_stiffness_is_ipctks(touching, d):
    """With masses and a block-diagonal Hessian of random numbers, contact by contact: those of vertices and facets that
    ipctk finds among the same pairs.
    """
    space, term, x = touching[d]
    rng = np.random.default_rng(7)
    n, k = len(space.mesh.points), len(term.surface.objects)
    masses, blocks = rng.uniform(0.5, 1.5, n), rng.uniform(-1, 1, (n, d, d))
    blocks = blocks @ blocks.transpose(0, 2, 1)
    own = term.contact_stiffness(Positions(space, x), masses, blocks)
    vertices, mesh = term.surface.vertices(Positions(space, x)), mesh_of(term.surface)
    active = ipctk.NormalCollisions()
    active.build(mesh=mesh, vertices=vertices, dhat=DHAT, broad_phase=ipctk.BruteForce())
    surface = term.surface.surface
    fill = np.zeros((k - len(surface), d, d))
    theirs = ipctk.semi_implicit_stiffness(
        mesh=mesh,
        vertices=vertices,
        collisions=active,
        vertex_masses=np.r_[masses[surface], np.zeros(len(fill))],
        hess=csc_matrix(block_diag([*blocks[surface], *fill])),
        dmin=0.0,
    )
    found = term.stencils(Positions(space, x))
    ours = {
        tuple(sorted(v[c != 0.0])): stiffness
        for v, c, stiffness in zip(found.vertices.tolist(), found.coefficients, own, strict=True)
        for v in [np.array(v)]
    }
    compared = 0
    for i, expected in enumerate(np.ravel(theirs)):
        ids = active[i].vertex_ids(mesh.edges, mesh.faces)
        key = tuple(sorted(v for v in ids if v >= 0))
        if key in ours:
            np.testing.assert_allclose(ours[key], expected, rtol=1e-10)
            compared += 1
    assert compared > 2
    # A plane's: m / gap^2 + n' H n.
    plane = HalfSpaceBarrier(
        space,
        (plane_obstacle(Plane((0.0,) * d, tuple(np.eye(d)[-1]))),),
        DHAT,
        KAPPA,
        weighted=False,
    )
    lifted = x + (0.5 * DHAT - x[:, -1].min()) * np.eye(d)[-1]
    near = np.flatnonzero(lifted[:, -1] < DHAT)
    expected = masses[space.owned_points[near]] / lifted[near, -1] ** 2 + blocks[space.owned_points[near], -1, -1]
    np.testing.assert_allclose(plane.contact_stiffness(Positions(space, lifted), masses, blocks), expected, rtol=1e-10)


def terms_of(law, gap=0.5):
    """Terms of a unit square `gap` dhat above a plane, and its positions."""
    scene = Scene(
        (Body(("grid",), NeoHookean(1e5, 0.3)),),
        dt=0.01,
        steps=1,
        loads=(Gravity((0.0, -9.81)),),
        obstacles=(Plane((0.0, 0.0), (0.0, 1.0)),),
        contact=(Barrier(dhat=DHAT, law=law),),
    )
    space = LevelSpace(box(2, 3, low=(0.0, gap * DHAT), high=(1.0, 1.0 + gap * DHAT)), MPI.COMM_SELF)
    return (
        space,
        build_terms(make_model(scene, space.mesh, diagonal=1.5), space),
        Positions(space, space.from_input(space.mesh.points)),
    )


def test_adaptive_stiffness_balances_the_other_forces():
    """K = -gE . gB / |gB|^2 between ipctk's bounds; the block's weight and speed are the other forces here."""
    space, terms, x = terms_of("classic")
    (rule,) = terms.rules
    assert isinstance(rule, AdaptiveStiffness)
    dt, velocity = 0.01, np.array([0.0, -3.0])
    rule.begin_step(x, x.owned + dt * velocity, dt**2)
    plane = terms.contacts[0]
    other = terms.mass * -velocity * dt + dt**2 * sum(
        t.gradient(x) for t in terms.potentials if t.name in ("elastic", "load")
    )
    barrier = dt**2 * plane.gradient(x) / plane.kappa  # of unit kappa
    assert np.abs(barrier).max() > 0.0
    assert plane.kappa == pytest.approx(-np.vdot(other, barrier) / np.vdot(barrier, barrier), rel=1e-10)
    assert {term.kappa for term in terms.contacts} == {plane.kappa}
    assert plane.kappa < rule.upper


def test_adaptive_stiffness_doubles_up_to_its_bound_while_tiny_gaps_shrink():
    space, terms, x = terms_of("classic", gap=1e-9)
    (rule,) = terms.rules
    rule.begin_step(x, x.owned, 1e-4)
    start, seen = terms.contacts[0].kappa, []
    for _ in range(20):
        x = x.moved(-0.1 * x.owned[:, 1].min(), np.tile([0.0, 1.0], (space.n_owned, 1)))
        raised = rule.end_solve(x)
        assert raised == (terms.contacts[0].kappa > (seen[-1] if seen else start))
        seen.append(terms.contacts[0].kappa)
    assert seen[0] == pytest.approx(min(2.0 * start, rule.upper))
    assert seen[-1] == pytest.approx(rule.upper)
    x = x.moved(0.5 * DHAT, np.tile([0.0, 1.0], (space.n_owned, 1)))
    assert not rule.end_solve(x)


def test_semi_implicit_stiffness_takes_the_mean_over_contacts():
    space, terms, x = terms_of("semi-implicit")
    (rule,) = terms.rules
    assert isinstance(rule, SemiImplicitStiffness)
    rule.begin_step(x, x.owned, 1e-4)
    near = terms.contacts[0].kappa
    space, terms, x = terms_of("semi-implicit", gap=0.25)
    terms.rules[0].begin_step(x, x.owned, 1e-4)
    lumped = terms.mass[np.flatnonzero(x.owned[:, 1] < DHAT), 0].mean()
    # Lowering a stress-free square changes the gaps alone: k grows by m / gap^2, 16 - 4 times m / dhat^2.
    factor = (
        2.0 / 15.0910 * DHAT
    )  # by hand: g'' at half of dhat is 4 (1/4) g2 + 2 g1, g2 = 23.7726, g1 = -4.3294... of s = 1/4
    assert terms.contacts[0].kappa - near == pytest.approx(factor * 12.0 * lumped / DHAT**2, rel=2e-2)
    # Without contacts there is a stiffness, too.
    space, terms, x = terms_of("semi-implicit", gap=3.0)
    terms.rules[0].begin_step(x, x.owned, 1e-4)
    assert terms.contacts[0].kappa > 0.0


def test_both_barriers_are_equally_stiff_half_way():
    """By second differences of the energies: this one's g, and Ando's (2 / 3) k (dhat - gap)^3 / dhat."""
    h, gap = 1e-4, 0.5 + 1e-4 * np.array([-1.0, 0.0, 1.0])
    second = lambda energies: energies @ [1.0, -2.0, 1.0] / h**2
    np.testing.assert_allclose(second(barrier_law.energy(gap**2, 1.0, 1.0)), MIDWAY_CURVATURE, rtol=1e-6)
    np.testing.assert_allclose(second(2.0 / 3.0 * (1.0 - gap) ** 3), CUBIC_CURVATURE, rtol=1e-6)


def test_the_default_law_has_no_rules():
    assert terms_of("convergent")[1].rules == ()
