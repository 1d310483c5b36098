"""`pdvol.Contact`: derivatives, ranks, friction, obstacles that move, messages; and the demo with an own time loop."""

import runpy
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
import touching
import ufl
from basix.ufl import element, mixed_element
from dolfinx import fem, mesh
from dolfinx.fem import petsc
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_array

import pdvol
import taylor
from commands import SAFETY
from on_ranks import results_on
from pdvol import Barrier, Friction, InputError, IntersectionError, Placement, Plane, Rigid, Translation
from pdvol.levels.space import LevelSpace

ROOT = Path(__file__).resolve().parents[2]
DEMO = ROOT / "demos" / "own_energy.py"
DIMENSIONS = pytest.mark.parametrize("dim", [2, 3])


def sparse(matrix) -> csr_array:
    starts, columns, values = matrix.getValuesCSR()
    return csr_array((values, columns, starts), shape=matrix.getSize())


def function(V, rows) -> fem.Function:
    u = fem.Function(V)
    u.x.array[:] = rows.ravel()
    return u


@DIMENSIONS
@pytest.mark.parametrize("friction", [None, Friction(0.4)], ids=["barrier", "with friction"])
def test_derivatives(dim, friction):
    V = touching.space(dim)
    contact = touching.contact(V, friction=friction)
    start = touching.displaced(V, 1e-3)
    contact.begin_step(start, 0.0, 0.01)
    assert contact.count(start) > 5
    taylor.check_derivatives(
        lambda rows: contact.energy(function(V, rows)),
        lambda rows: contact.gradient(function(V, rows)).array.reshape(-1, dim).copy(),
        lambda rows: sparse(contact.hessian(function(V, rows), projected=False)),
        touching.displaced(V, 2e-3).x.array.reshape(-1, dim).copy(),
        length=2e-4,
    )


@DIMENSIONS
def test_the_projected_hessian_is_positive_and_adds_to_the_matrix_of_a_form(dim):
    V = touching.space(dim)
    contact, u = touching.contact(V), touching.displaced(V)
    contact.begin_step(touching.displaced(V, 1e-3), 0.0, 0.01)
    exact, projected = (sparse(contact.hessian(u, projected)).toarray() for projected in (False, True))
    plain = PETSc.Vec().createWithArray(u.x.array.copy(), comm=MPI.COMM_WORLD)
    for of in (contact.energy, contact.min_gap):
        assert of(plain) == of(u) == of(u.x.petsc_vec) > 0.0, "a vector is as good as a function"
    size = np.abs(projected).max()
    assert np.linalg.eigvalsh(projected)[0] > -1e-10 * size > np.linalg.eigvalsh(exact)[0]
    one, other = ufl.TrialFunction(V), ufl.TestFunction(V)
    A = petsc.assemble_matrix(fem.form(ufl.inner(ufl.grad(one), ufl.grad(other)) * ufl.dx))
    A.assemble()
    own = sparse(A).toarray()
    A.axpy(1.0, contact.hessian(u))
    np.testing.assert_allclose(sparse(A).toarray(), own + projected, rtol=0.0, atol=1e-12 * size)
    b = u.x.petsc_vec.copy()
    b.axpy(1.0, contact.gradient(u))  # of one kind with dolfinx's own vectors
    assert b.norm() > 0.0


@DIMENSIONS
def test_contact_forces_sum_to_those_of_obstacles(dim):
    V = touching.space(dim)
    u, alone = touching.displaced(V), {}
    for names in ((), ("ground",), ("wedge",), ("ground", "wedge")):
        obstacles = tuple(each for each in touching.obstacles(dim) if each.name in names)
        contact = touching.contact(V, obstacles=obstacles, friction=Friction(0.4))
        contact.begin_step(touching.displaced(V, 1e-3), 0.0, 0.01)
        forces, found = contact.gradient(u).array.reshape(-1, dim), {name: contact.force(u, name) for name in names}
        assert (small := 1e-12 * np.abs(forces).sum()) > 0.0
        assert np.abs(forces.sum(axis=0) + sum(found.values())).max() < small
        assert all(np.abs(force - alone.setdefault(name, force)).max() < small for name, force in found.items())
    assert alone["ground"][-1] > 0.0 and alone["wedge"][0] > 0.0


def block_on_ground(mu):
    """A block 5 mm above the ground, with friction; dhat is 1 cm."""
    domain = mesh.create_rectangle(MPI.COMM_WORLD, ((0.0, 0.0), (1.0, 1.0)), (3, 3))
    V = fem.functionspace(domain, ("Lagrange", 1, (2,)))
    ground = Plane((0.0, -0.005), (0.0, 1.0), name="ground")
    return V, pdvol.Contact(V, 1e5, Barrier(dhat=0.01), Friction(mu, eps_v=1e-3), (ground,))


def test_friction_is_coulombs():
    V, contact = block_on_ground(0.3)
    contact.begin_step(fem.Function(V), 0.0, 0.01)
    slid = fem.Function(V)
    slid.x.array[0::2] = 0.02  # 2 m/s, far above eps_v
    pull, push = -contact.gradient(slid).array.reshape(-1, 2).sum(axis=0)
    assert push > 0.0 and pull == pytest.approx(-0.3 * push, rel=1e-12)
    assert contact.update_lag(slid) == pytest.approx(0.0, abs=1e-12)  # as far above the ground as before
    slid.x.array[1::2] = 0.001
    assert contact.update_lag(slid) > 0.1
    assert "with friction" in repr(block_on_ground(0.0)[1])
    assert "with friction" not in repr(touching.contact(touching.space(2), friction=None))


def test_the_barriers_stiffness_may_be_in_pascal():
    V = touching.space(2)
    in_pascal = pdvol.Barrier(dhat=touching.DHAT, stiffness=pdvol.Pascal(3e4))
    one, other = touching.contact(V), touching.contact(V, young=None, barrier=in_pascal)
    for contact in (one, other):
        contact.begin_step(touching.displaced(V, 1e-3), 0.0, 0.01)
    assert one.kappa == pytest.approx(other.kappa, rel=1e-15) and other.kappa == 3e4
    assert one.energy(touching.displaced(V)) == pytest.approx(other.energy(touching.displaced(V)), rel=1e-12)


def test_max_step_keeps_blocks_apart():
    V = touching.space(3)
    contact, u = touching.contact(V), fem.Function(V)
    contact.begin_step(u, 0.0, 0.01)
    du = fem.Function(V)
    du.interpolate(
        lambda x: np.stack([0 * x[0], 0 * x[0], np.where(x[2] > 1.01, -1.0, 0.0)])
    )  # one falls into the other
    step = contact.max_step(u, du)
    assert 0.02 < step < 0.031
    u.x.array[:] = step * du.x.array
    assert contact.intersections(u) == 0 and 0.0 < contact.min_gap(u) < 0.01
    assert contact.intersections(du) > 0


def test_obstacles_move_as_far_as_nothing_is_touched():
    V, still = block_on_ground(0.3)
    rising = Plane((0.0, -0.1), (0.0, 1.0), Translation((0.0, 1.0)), name="lift")
    contact, u = pdvol.Contact(V, 1e5, Barrier(dhat=0.01), Friction(0.3), (rising,)), fem.Function(V)
    contact.begin_step(u, 0.0, 0.05)
    assert contact.min_gap(u) == np.inf and contact.count(u) == 0, "nothing is within dhat"
    assert contact.move_obstacles(u, 0.05) == 0.05
    assert contact.min_gap(u) == np.inf
    reached = contact.move_obstacles(u, 0.2)
    assert 0.09 < reached < 0.1 and contact.intersections(u) == 0
    assert 0.0 < contact.min_gap(u) == pytest.approx(0.1 - reached)
    assert np.isfinite(contact.energy(u)) and contact.energy(u) > 0.0
    paddle = Rigid(touching.wedge(2), name="paddle", motion=Translation((1.0, 0.0)))
    contact = pdvol.Contact(V, 1e5, Barrier(dhat=0.01), None, (paddle,))
    contact.begin_step(u, 0.0, 0.1)
    reached = contact.move_obstacles(u, 0.1)
    assert 0.015 < reached < 0.02 and contact.intersections(u) == 0


def test_parts_of_the_mesh_are_bodies_in_the_inputs_order():
    for dim in (2, 3):
        points, cells = touching.blocks(dim)
        space = LevelSpace.of(touching.space(dim))
        np.testing.assert_array_equal(space.mesh.points, points)
        np.testing.assert_array_equal(np.sort(space.mesh.cells, axis=1), np.sort(cells, axis=1))
        assert (space.mesh.volumes > 0.0).all()
        np.testing.assert_array_equal(space.mesh.point_bodies, np.arange(len(points)) >= len(points) // 2)
        assert touching.contact(space.V).bodies == ("body 1", "body 2")
    assert block_on_ground(0.3)[1].bodies == ("body",)
    assert repr(block_on_ground(0.3)[1]) == "Contact(body, dhat=0.01 m, kappa=3e+04 Pa, with friction)"


def spaces():
    square = mesh.create_unit_square(MPI.COMM_WORLD, 2, 2)
    boxes = mesh.create_unit_square(MPI.COMM_WORLD, 2, 2, mesh.CellType.quadrilateral)
    facets = mesh.create_submesh(square, 1, np.arange(4, dtype=np.int32))[0]
    return {
        "of triangles in 2D": (boxes, ("Lagrange", 1, (2,))),
        "not of intervals in 2D": (facets, ("Lagrange", 1, (2,))),
        '("Lagrange", 1, (2,))': (square, ("Lagrange", 1)),
        "not in": (square, ("Lagrange", 2, (2,))),
        "displacements in": (square, ("DG", 1, (2,))),
        "contact needs displacements": (square, ("Lagrange", 1, (3,))),
        "V.sub(0).collapse()[0]": (square, mixed_element([element("P", "triangle", 1, shape=(2,))] * 2)),
    }


@pytest.mark.parametrize("message", spaces())
def test_other_spaces_are_refused(message):
    domain, element = spaces()[message]
    V = fem.functionspace(domain, element)
    for given in (V, V.sub(0)) if "collapse" in message else (V,):
        with pytest.raises(InputError) as caught:
            pdvol.Contact(given, 1e5)
        assert message in str(caught.value) and "\n" not in str(caught.value)
    with pytest.raises(InputError, match="contact needs a dolfinx FunctionSpace, not Mesh"):
        pdvol.Contact(domain, 1e5)


@pytest.mark.parametrize(
    "message, wrong",
    [
        ("Contact.young = -1.0 must be positive", {"young": -1.0}),
        ("Contact needs young [Pa], or its stiffness in pascal", {"young": None}),
        ("Contact.diagonal = 0 must be positive", {"diagonal": 0}),
        ("Contact.barrier must be a Barrier, not Friction", {"barrier": Friction(0.1)}),
        ("Contact.friction must be a Friction, not float", {"friction": 0.1}),
        ("Contact.obstacles holds Plane, Rigid and Deforming, not Outline", {"obstacles": (touching.wedge(2),)}),
        ("Contact.obstacles must be a tuple, as (Plane(", {"obstacles": Plane((0, 0), (0, 1))}),
        ("body 'body 1': the contact distance dhat = 1 m is larger than the body", {"barrier": Barrier(dhat=1.0)}),
        ("obstacle 'plane' is 3D, the mesh is 2D", {"obstacles": (Plane((0, 0, 0), (0, 0, 1)),)}),
        ("obstacle 'ball' is 3D, the mesh is 2D", {"obstacles": (Rigid(touching.wedge(3), name="ball"),)}),
        (
            "Friction.pairs names 'cat'; there are ['body 1', 'body 2', 'ground', 'wedge']",
            {"friction": Friction(0.1, pairs={("cat", "body 1"): 1})},
        ),
        ("nowhere.obj", {"obstacles": (Rigid("nowhere.obj"),)}),
    ],
)
def test_bad_arguments_are_refused_in_one_line(message, wrong):
    with pytest.raises(InputError) as caught:
        touching.contact(touching.space(2), **wrong)
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_bad_calls_are_refused_in_one_line():
    V, contact = block_on_ground(0.3)
    u = fem.Function(V)
    for call, message in (
        (lambda: contact.energy(u), "begin_step"),
        (lambda: contact.begin_step(u, 0.1, 0.1), "has no length"),
        (lambda: contact.begin_step(u, "now", 0.1), "t0 = 'now'"),
        (lambda: contact.begin_step(u.x.array, 0.0, 0.1), "a dolfinx Function or a PETSc Vec, not ndarray"),
        (lambda: contact.begin_step(fem.Function(touching.space(2)), 0.0, 0.1), "the function space has 32"),
        (lambda: contact.begin_step(PETSc.Vec().createSeq(3), 0.0, 0.1), "3 values on this rank"),
        (lambda: contact.begin_step(u, 0.0, 0.1), None),
        (lambda: contact.force(u, "floor"), r"force: there is no obstacle 'floor'; there are \['ground'\]"),
        (lambda: contact.follow(u, 5.0, None, u), "follow: 5 s is outside of the step from 0 to 0.1 s"),
        (lambda: contact.follow(u, "now", None, u), "follow: until = 'now' is not a finite number"),
    ):
        with pytest.raises(InputError, match=message) if message else nullcontext():
            call()


def test_a_start_with_intersections_is_refused():
    V, contact = block_on_ground(0.3)
    u, sunk = fem.Function(V), fem.Function(V)
    sunk.x.array[1::2] = -0.1
    behind = "^4 vertices are at or below plane 'ground' at u, the worst vertex . of body 'body' by 0.095 m"
    with pytest.raises(IntersectionError, match=behind):
        contact.begin_step(sunk, 0.0, 0.1)
    contact.begin_step(u, 0.0, 0.1)
    assert contact.energy(sunk) == np.inf
    later = (contact.gradient, contact.hessian, contact.update_lag, lambda of: contact.begin_step(of, 0.1, 0.2))
    for call in (*later, lambda of: contact.follow(of, 0.1, None, u), lambda of: contact.force(of, "ground")):
        with pytest.raises(IntersectionError, match=behind):
            call(sunk)
    assert np.isfinite(contact.gradient(u).norm())
    for dim in (2, 3):
        V = touching.space(dim)
        ahead, within = Placement(0.1 * np.eye(dim)[0]), Placement(np.full(dim, 0.5), scale=0.1)
        for size, obstacles, message in (
            (-0.5, (), "^body 'body 1' crosses itself at u .*; repair the shape"),
            (0.0, touching.obstacles(dim, placement=ahead), "'wedge'.* at u.*; move them apart"),
            (0.0, touching.obstacles(dim, placement=within), "obstacle 'wedge' lies inside body 'body 1' at u"),
        ):
            with pytest.raises(IntersectionError, match=message) as caught:
                touching.contact(V, obstacles=obstacles, friction=None).begin_step(touching.displaced(V, size), 0.0, 1)
            assert caught.value.pairs


# ---- ranks, and the demo


@pytest.mark.mpi
def test_two_ranks_find_what_one_finds():
    one, two = results_on((1, 2), touching.findings)
    for key, found in one.items():
        np.testing.assert_allclose(two[key], found, rtol=1e-10, atol=1e-10 * np.abs(found).max(), err_msg=key)
    for dim in (2, 3):
        assert one[f"count_{dim}"] > 5 and one[f"intersections_{dim}"] > 0 and 0.0 < one[f"max_step_{dim}"] < 1.0


def demo(comm):
    contact, u, claims = runpy.run_path(str(DEMO))["simulate"](10, comm)
    return {"contacts": contact.count(u), "positions": contact.positions(u), "gap": claims.gap, "error": claims.error}


@pytest.mark.mpi
def test_the_demo_gives_the_same_on_one_rank_and_on_two():
    one, two = results_on((1, 2), demo)
    assert one["contacts"] > 0 and one["gap"] > 0.0 and one["error"] < 1e-3
    assert np.abs(one["positions"] - two["positions"]).max() < 1e-6


@pytest.mark.slow
def test_the_whole_demo_keeps_its_claims(tmp_path):
    command = [sys.executable, str(DEMO), str(tmp_path / "end.npy")]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=SAFETY)
    assert ended.returncode == 0, ended.stderr
    assert "contacts, no intersection, smallest gap" in ended.stdout
    end = np.load(tmp_path / "end.npy")
    assert end[:, 2].min() > 0.0 and end[:, 2].mean() < 0.2  # it has fallen, and not through the floor
