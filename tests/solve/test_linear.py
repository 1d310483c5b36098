"""The choice of the linear solver: every method gives the same answer, and failures lead through the remedies."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_array

from pdvol.errors import SimulationError
from pdvol.integrate.integrator import State
from pdvol.integrate.marches import Start, direct
from pdvol.levels.space import LevelSpace
from pdvol.scene import Barrier, Friction, NeoHookean, Solver, Support
from pdvol.solve import newton
from pdvol.solve.linear import solver as linear
from pdvol.solve.linear.coarse_space import CoarseSpace, grid_weights
from pdvol.solve.linear.petsc_methods import check_options
from pdvol.solve.linear.solver import COARSE_SETUP, MUMPS_WORKSPACES, LinearSolver
from pdvol.solve.linear.system_matrix import SystemMatrix
from problems import block, ground, make_scene, make_stepper, take_step, weight
from shapes import box, together
from springs import dense, springs

COMM = MPI.COMM_SELF


@pytest.fixture(scope="module", params=[2, 3])
def space(request):
    return LevelSpace(box(request.param, 4, jitter=0.1, seed=1), COMM)


def systems(space, **options):
    blocks = springs(space, **options)
    system = SystemMatrix(space, np.zeros(space.n_owned, dtype=bool))
    system.assemble(blocks)
    return system, dense(space, blocks)


def solver(space, system, **settings):
    made = LinearSolver(
        PETSc.KSP().create(COMM),
        Solver(**settings),
        lambda: [CoarseSpace(space, grid_weights(space.mesh), system.all_supported)],
    )
    made.set_matrix(system)
    return made


def right_of(space):
    """A random right-hand side, and a vector for the solution."""
    right = space.create_vector()
    right.setArray(np.random.default_rng(4).standard_normal(right.getLocalSize()))
    return right, right.duplicate()


def assert_solved(matrix, solution, right):
    residual = matrix @ solution.getArray() - right.getArray()
    assert np.linalg.norm(residual) < 1e-9 * np.linalg.norm(right.getArray())


def taught(space, system, monkeypatch, **settings):
    """A solver after a solve for which two iterations without a coarse space were enough."""
    monkeypatch.setattr(linear, "COARSE_SETUP", 1)
    made = solver(space, system, **settings)
    made.solve_once(*right_of(space))
    return made


@pytest.mark.parametrize("method", ["iterative", "multilevel", "direct"])
def test_all_methods_agree(space, method):
    system, matrix = systems(space, mass=0.1)
    made = solver(space, system, linear=method, linear_rtol=1e-10)
    right, solution = right_of(space)
    made.solve(right, solution)
    expected = np.linalg.solve(matrix, right.getArray())
    np.testing.assert_allclose(solution.getArray(), expected, rtol=0.0, atol=1e-7 * np.abs(expected).max())
    assert made.method == method
    made.solve(right, solution, near=True)
    np.testing.assert_allclose(solution.getArray(), expected, rtol=0.0, atol=1e-7 * np.abs(expected).max())
    assert made.ksp.getIterationNumber() == (1 if method == "direct" else 0)
    made.solve(right, solution)  # from zero again
    assert method == "direct" or made.ksp.getIterationNumber() > 0


def test_options_that_petsc_uses_pass_the_check():
    for options in (
        "-ksp_rtol 1e-6 -ksp_max_it 900 -ksp_monitor",
        "-mat_mumps_icntl_14 200",
        "-ksp_type gmres -ksp_gmres_restart 20 -pc_type gamg -mg_levels_ksp_type richardson -mg_coarse_pc_type lu",
        "-pc_type bjacobi -sub_pc_type icc -sub_pc_factor_levels 1",
        "-pc_type fieldsplit",
    ):
        check_options(Solver(petsc=options))


@pytest.mark.parametrize("options", ["-ksp_type cg -pc_type gamg", "-ksp_type gmres -pc_type jacobi"])
def test_users_options_reach_petsc(options):
    """One step under a user's own solver is that of the direct one."""
    results = []
    for settings in ({"linear": "direct"}, {"linear": "iterative", "petsc": f"{options} -ksp_rtol 1e-10"}):
        scene = make_scene(
            loads=(weight(3),), supports=(Support(lambda X: X[:, 2] < 1e-9),), solver=Solver(tolerance=1e-8, **settings)
        )
        problem = make_stepper(scene, box(3, 3))
        X = problem.space.mesh.points
        results.append(take_step(problem, 1, X, np.zeros_like(X)).positions)
    assert np.abs(results[0] - X).max() > 1e-5
    np.testing.assert_allclose(results[1], results[0], atol=1e-9)


def test_auto_goes_on_with_a_coarse_space_after_enough_iterations(space, monkeypatch):
    """Within the solve, from where it is. The coarse space goes where its iterations cost less than its setup."""
    system, matrix = systems(space, mass=1e-3)
    made = solver(space, system, linear_rtol=1e-10)
    right, solution = right_of(space)
    monkeypatch.setattr(linear, "COARSE_SETUP", 50)
    made.solve(right, solution)
    assert made.method == "iterative" and made.ksp.getIterationNumber() > 2
    monkeypatch.setattr(linear, "COARSE_SETUP", 1)
    made.solve(right, solution)
    assert made.method == "multilevel" and made.ksp.getIterationNumber() > 2
    assert_solved(matrix, solution, right)
    monkeypatch.setattr(linear, "COARSE_SETUP", COARSE_SETUP)
    for iterations, method in ((COARSE_SETUP // 2, "multilevel"), (COARSE_SETUP // 2 - 1, "iterative")):
        made.note_iterations(iterations)
        assert made.method == method
    made.solve(right, solution)
    made.fall_back()
    made.note_iterations(1)
    assert made.method == "direct"
    made.begin_step()
    assert made.method == "multilevel"


@pytest.mark.parametrize("setting", ["auto", "multilevel"])
def test_a_solve_goes_on_with_a_better_coarse_space_where_there_is_one(space, monkeypatch, setting):
    """With P = 1 the second one solves exactly. The choice is remembered."""
    monkeypatch.setattr(linear, "COARSE_SETUP", 1)
    system, matrix = systems(space, mass=1e-3)
    whole = csr_array(np.eye(space.n_owned))
    spaces = [CoarseSpace(space, P, system.all_supported) for P in (grid_weights(space.mesh), whole)]
    right, solution = right_of(space)
    found = {}
    for count in (1, 2):
        made = solver(space, system, linear=setting, linear_rtol=1e-10)
        made.gradients._make_spaces = lambda count=count: spaces[:count]
        made.solve(right, solution)
        assert_solved(matrix, solution, right)
        found[count] = made.ksp.getIterationNumber()
        assert made.memory["coarse"] == count - 1 and made.memory["method"] == "multilevel"
    assert found[2] < found[1]
    resumed = solver(space, system, linear=setting, linear_rtol=1e-10)
    resumed.gradients._make_spaces = lambda: spaces
    resumed.restore(made.memory)
    resumed.solve(right, solution)
    assert resumed.ksp.getIterationNumber() < found[2] and resumed.memory["coarse"] == 1


def test_conjugate_gradients_that_reach_their_limit_are_a_failure(space, monkeypatch):
    """The direct method takes over within the same solve."""
    monkeypatch.setattr(linear, "MAX_ITERATIONS", 2)
    system, matrix = systems(space, mass=1e-3)
    made = solver(space, system, linear="iterative", linear_rtol=1e-10)
    right, solution = right_of(space)
    made.solve(right, solution)
    assert made.method == "direct"
    assert_solved(matrix, solution, right)


def test_the_direct_method_goes_after_one_system_and_stays_after_two_failures_in_a_row(space):
    """Or where Newton asks for it. A system whose solve begins near its solution is not one of the row."""
    system, _ = systems(space)
    made = solver(space, system)
    right = space.create_vector()
    right.set(1.0)

    def methods(*near):
        for begins_near in near:
            made.set_matrix(system)
            made.solve(right, right.duplicate(), begins_near)
            yield made.method

    for _ in range(2):
        assert made.fall_back() and list(methods(False, False, True)) == ["direct", "iterative", "iterative"]
    assert made.fall_back() and list(methods(False, True)) == ["direct", "iterative"]
    assert made.fall_back() and list(methods(False, False)) == ["direct", "direct"]
    made.begin_step()
    assert made.fall_back() and made.use_direct() and not made.use_direct()
    assert list(methods(False, False)) == ["direct", "direct"]
    made.begin_step()
    assert list(methods(False)) == ["iterative"]


@pytest.mark.parametrize("linear", ["auto", "iterative", "multilevel", "direct"])
def test_a_remembered_method_is_used_only_with_the_same_setting(space, monkeypatch, linear):
    """A solver that has switched to the coarse space continues with it after a resume. If the setting has changed, the
    setting decides. A remedy lasts for its step.
    """
    system, _ = systems(space)
    learned = taught(space, system, monkeypatch, linear=linear)
    method = learned.method
    learned.use_direct()
    for other in ("auto", "iterative", "multilevel", "direct"):
        resumed = solver(space, system, linear=other)
        before = resumed.method
        resumed.restore(learned.memory)
        assert resumed.method == (method if other == linear else before)
        assert resumed.memory == learned.memory or other != linear
    assert method == ("multilevel" if linear == "auto" else linear)


def test_a_memory_that_no_solver_wrote_is_ignored(space, monkeypatch):
    system, _ = systems(space)
    learned = taught(space, system, monkeypatch)
    wrong = {"method": (3, [1]), "workspace": (-1, "2"), "coarse": (-1, "1"), "linear": (None,)}
    for name, value in ((name, value) for name, values in wrong.items() for value in values):
        resumed = solver(space, system)
        resumed.restore({**learned.memory, name: value})
        assert resumed.method == "iterative"


class Broken:
    """A KSP whose solves fail, or raise PETSc's error of a code."""

    def __init__(self, ksp, tried, code=None):
        self.ksp, self.tried, self.code = ksp, tried, code

    def __getattr__(self, name):
        return getattr(self.ksp, name)

    def solve(self, *_):
        self.tried()
        if self.code is not None:
            raise PETSc.Error(self.code)

    def getConvergedReason(self):
        return int(PETSc.KSP.ConvergedReason.DIVERGED_INDEFINITE_PC)


def test_failures_take_every_remedy_once(space):
    """No linear solve converges. Every remedy is tried once, then the error names the linear solve."""
    system, _ = systems(space)
    made, tried = solver(space, system), []
    made.ksp = Broken(made.ksp, lambda: tried.append(made.method))
    with pytest.raises(SimulationError, match="linear solve failed"):
        made.solve(None, None)
    assert tried == ["iterative"] + ["direct"] * len(MUMPS_WORKSPACES)


def test_an_error_of_mumps_is_a_failed_solve(space):
    """A random scene met it: error 76 after a factorisation that had failed, with a traceback. Wrong arguments are a
    mistake of pdvol.
    """
    system, _ = systems(space)
    made = solver(space, system, linear="direct")
    inner = made.petsc.ksp
    for code, error in ((76, SimulationError), (62, PETSc.Error)):
        made.petsc.ksp = Broken(inner, lambda: None, code)
        with pytest.raises(error):
            made.solve(*right_of(space))


@pytest.mark.parametrize("method", ["iterative", "multilevel"])
def test_every_method_reports_an_indefinite_matrix(space, method):
    """One vertex has a negative mass. A direct factor then has negative pivots, and otherwise it has none."""
    for mass in (1.0, -100.0):
        blocks = springs(space)
        masses = np.zeros((space.n_owned, space.dim))
        masses[3] = mass
        blocks.add_masses(masses)
        system = SystemMatrix(space, np.zeros(space.n_owned, dtype=bool))
        system.assemble(blocks)
        made = solver(space, system, linear="direct")
        right = space.create_vector()
        right.set(1.0)
        made.solve(right, right.duplicate())
        assert made.detects_indefinite and made.found_indefinite == (mass < 0)
        other = solver(space, system, linear=method)
        assert not other.found_indefinite
        reason, _ = other.solve_once(right, right.duplicate())
        indefinite = (linear._Reasons.DIVERGED_INDEFINITE_MAT, linear._Reasons.DIVERGED_INDEFINITE_PC)
        assert (reason in indefinite) == (mass < 0)
    assert not solver(space, system, linear="direct", petsc="-pc_type lu").detects_indefinite, "an option hides pivots"


@pytest.mark.parametrize("indefinite", [False, True])
def test_newton_tries_the_true_hessian_under_a_direct_solver(monkeypatch, indefinite):
    """A thin strip is released from a compressed and uneven state. The solver reports an indefinite matrix or does not;
    the step ends in the same state as with the iterative solver in both cases.
    """
    ends, tried = [], []
    solve, after = LinearSolver.solve, newton.next_projection  # Newton itself solves by SNES, but for a second try

    def projected(*arguments):
        tried.append(after(*arguments))
        return tried[-1]

    monkeypatch.setattr(LinearSolver, "solve", lambda self, *vectors: tried.append("again") or solve(self, *vectors))
    monkeypatch.setattr(newton, "next_projection", projected)
    if indefinite:
        monkeypatch.setattr(LinearSolver, "found_indefinite", property(lambda self: self.method == "direct"))
    mesh = block((0.0, 0.0), (1.0, 0.05), (20, 1))
    wild = mesh.points * [0.6, 1.0] + 0.002 * np.random.default_rng(5).uniform(-1.0, 1.0, mesh.points.shape)
    for method in ("iterative", "direct"):
        tried.clear()
        scene = make_scene(
            materials=(NeoHookean(1e6),), solver=Solver(tolerance=1e-8, linear=method, linear_rtol=1e-10), dt=0.1
        )
        ends.append(take_step(make_stepper(scene, mesh), 1, wild, np.zeros_like(wild)).positions)
    assert "none" in tried and ("again" in tried) == indefinite
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-7)


@pytest.mark.parametrize("settings", [{}, {"linear": "direct"}, {"linear": "multilevel"}])
def test_a_resumed_run_repeats_to_the_last_bit(settings, monkeypatch):
    """Two blocks fall on a floor and on each other. Methods change on the way, and the memory carries them over."""
    monkeypatch.setattr(linear, "COARSE_SETUP", 2)
    low, high = block((0.0, 0.0, 0.01), (0.3, 0.3, 0.31), 3), block((0.05, 0.1, 0.33), (0.35, 0.4, 0.63), 3)
    scene = make_scene(
        materials=(NeoHookean(5e4), NeoHookean(1e5)),
        steps=16,
        loads=(weight(3),),
        obstacles=ground(3)[:1],
        contact=(Barrier(dhat=5e-3), Friction(0.3)),
        solver=Solver(tolerance=1e-3, **settings),
    )
    mesh = together(low, high)
    whole = list(direct(make_stepper(scene, mesh), Start.at_rest(mesh.points, np.zeros_like(mesh.points)), scene.steps))
    methods = {report.linear_solver for report in whole}
    assert methods == ({"iterative", "multilevel"} if not settings else {settings["linear"]})
    assert max(report.contacts for report in whole) > 10
    for at in (5, 11, 14):
        velocity = (whole[at - 1].positions - whole[at - 2].positions) / scene.dt
        start = Start(at, (State(whole[at - 1].positions, velocity),), whole[at - 1].record())
        for one, other in zip(whole[at:], direct(make_stepper(scene, mesh), start, scene.steps), strict=True):
            np.testing.assert_array_equal(one.positions, other.positions)
            assert one.linear_iterations == other.linear_iterations and one.solver_memory == other.solver_memory
