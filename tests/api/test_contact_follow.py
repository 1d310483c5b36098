"""`pdvol.Contact.follow`: parts of a step in which a user's own body goes along with what presses it."""

import numpy as np
import pressing
import pytest
from petsc4py import PETSc

import pdvol
from on_ranks import results_on

DIMENSIONS = pytest.mark.parametrize("dim", [2, 3])


@DIMENSIONS
def test_a_press_takes_few_parts(dim):
    """As many as steps, and nearly the same end in finer ones: friction is lagged at their starts. Moving obstacles
    alone closes gaps by degrees and gets stuck.
    """
    followed, moved = pressing.Pressed(dim).press(), pressing.Pressed(dim).press(follow=False, most=20)
    assert followed.reached and followed.crossings == 0
    assert max(followed.rounds) <= 3 and moved.rounds[0] == 20, (followed.rounds, moved.rounds)
    finer = pressing.Pressed(dim, steps=16).press()
    one, other = (pressed.contact.positions(pressed.u) for pressed in (followed, finer))
    assert np.linalg.norm(one - other, axis=1).max() < 2.0 * pressing.DHAT


@DIMENSIONS
def test_held_vertices_move_in_the_same_parts(dim):
    """The bottom goes up to its places at the step's end, and the block is pressed against a plate that stays."""
    pressed = pressing.Pressed(dim, lifted=True).press()
    assert pressed.reached and pressed.crossings == 0 and max(pressed.rounds) <= 3, pressed.rounds
    lifted = pressed.u.x.array.reshape(-1, dim)[pressed.held]
    np.testing.assert_allclose(lifted[:, -1], 0.04, atol=1e-12)
    assert pressed.contact.positions(pressed.u)[:, -1].max() < pressing.SIZE + pressing.DHAT


@DIMENSIONS
def test_a_body_that_gives_no_way_is_not_passed(dim):
    pressed = pressing.Pressed(dim, steps=1)
    pressed.held = np.arange(len(pressed.u.x.array) // dim, dtype=np.int32)
    pressed.press(most=20)
    assert not pressed.reached and pressed.crossings == 0
    assert pressed.contact.min_gap(pressed.u) > 0.8e-3 * pressing.DHAT
    assert np.all(pressed.u.x.array == 0.0)


def test_the_same_on_two_ranks():
    one, two = results_on((1, 2), pressing.findings)
    for dim in ("2D", "3D"):
        np.testing.assert_allclose(two[dim], one[dim], rtol=0.0, atol=1e-9)


def test_a_vector_is_changed_like_a_function():
    """Displacements may be a PETSc vector, and what is not a part of E is an error that changes nothing."""
    pressed = pressing.Pressed(3, steps=1)
    contact, vector = pressed.contact, pressed.u.x.petsc_vec.copy()
    contact.begin_step(vector, 0.0, pressing.DT)
    H, g = pressed.derivatives()
    small, none, raw = g.copy(), g.copy(), PETSc.Mat().createAIJ(H.getSize(), comm=H.comm)
    none.set(np.nan)
    for given, message in (
        ((g, g), "follow: the Hessian is an assembled PETSc matrix of"),
        ((raw, g), "follow: the Hessian is an assembled PETSc matrix of"),
        ((H, none), "gradients are not all finite numbers"),
        ((H, small, np.array([10**6])), "0 to 124 of V, by dolfinx.fem.locate_dofs_topological"),
        ((H, small, np.array([0.5])), "follow: held has block numbers 0 to"),
    ):
        with pytest.raises(pdvol.InputError, match=message):
            contact.follow(vector, pressing.DT, *given)
    assert vector.norm() == 0.0
    reached = contact.follow(vector, pressing.DT, H, g, pressed.held)
    assert 0.0 < reached <= pressing.DT and vector.norm() > 0.0
    assert contact.intersections(vector) == 0
