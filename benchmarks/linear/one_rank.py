"""One rank of `benchmarks.linear`: `pdvol run`, in which some of Newton's systems are also solved by PETSc's methods.

`one_rank.py FILE WORD ...` calls `pdvol WORD ...`. The system of each step's second iteration is solved by each of
METHODS, too, to the residual that pdvol reached. FILE then has a list of rows.
"""

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from pdvol import cli
from pdvol.compat import PETSc
from pdvol.solve.linear.solver import MAX_ITERATIONS, LinearSolver, parse_options
from pdvol.solve.newton import Newton

METHODS = {
    "block Jacobi, ICC(0)": ("sbaij", "-pc_type bjacobi -sub_pc_type icc -sub_pc_factor_shift_type positive_definite"),
    "additive Schwarz, overlap 1, ICC(0)": (
        "aij",
        "-pc_type asm -pc_asm_type basic -sub_pc_type icc",
    ),
    "GAMG with rigid motions": ("aij", "-pc_type gamg -pc_gamg_threshold 0.02"),
    "GAMG with rigid motions, ICC(0) smoother": (
        "aij",
        "-pc_type gamg -pc_gamg_threshold 0.02 -mg_levels_ksp_type richardson -mg_levels_ksp_max_it 1"
        " -mg_levels_pc_type bjacobi -mg_levels_sub_pc_type icc",
    ),
    "BoomerAMG, by components": (
        "aij",
        "-pc_type hypre -pc_hypre_type boomeramg -pc_hypre_boomeramg_strong_threshold 0.5"
        " -pc_hypre_boomeramg_coarsen_type HMIS -pc_hypre_boomeramg_interp_type ext+i"
        " -pc_hypre_boomeramg_relax_type_all l1scaled-SOR/Jacobi",
    ),
}
"""Each method's type of matrix and PETSc's options; all within conjugate gradients."""

ITERATION = 2
"""The iteration of a step whose system is measured: the first one of a step has no new contacts."""


class Peer:
    """A method of PETSc's, which keeps what it derived from a pattern."""

    def __init__(self, kind: str, options: str, comm: MPI.Comm):
        self.kind, self.matrix = kind, PETSc.Mat()
        self.source: Any = None
        self.ksp = PETSc.KSP().create(comm)
        self.ksp.setType(PETSc.KSP.Type.CG)
        self.ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
        prefix = f"peer_{id(self)}_"
        self.ksp.setOptionsPrefix(prefix)
        database = PETSc.Options(prefix)
        for name, value in parse_options(options).items():
            database[name] = value
        self.ksp.setFromOptions()

    def take(self, system: Any, points: np.ndarray) -> None:
        """The matrix of `system` in this method's format, with the rigid motions of points (n_owned, d)."""
        source = system.petsc
        if self.kind == "sbaij":
            self.matrix = source
            return
        fresh = source.convert(self.kind, PETSc.Mat())
        if source is self.source:
            fresh.copy(self.matrix, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
            return
        self.matrix, self.source = fresh, source
        fresh.setOption(PETSc.Mat.Option.SPD, True)
        places = PETSc.Vec().createWithArray(points.ravel().copy(), comm=system.space.comm, bsize=system.space.dim)
        fresh.setNearNullSpace(PETSc.NullSpace().createRigidBody(places))

    def solve(self, right: PETSc.Vec, tolerance: float) -> tuple[float, float, int, bool]:
        """Seconds of the preparation and of the solve, iterations, and whether the tolerance was reached."""
        ksp, solution = self.ksp, right.duplicate()
        ksp.setTolerances(rtol=tolerance, atol=0.0, max_it=MAX_ITERATIONS)

        def prepare() -> None:
            ksp.setOperators(self.matrix)
            ksp.setUp()
            ksp.setUpOnBlocks()

        prepared = seconds(right.comm.tompi4py(), prepare)
        solved = seconds(right.comm.tompi4py(), lambda: ksp.solve(right, solution))
        return prepared, solved, ksp.getIterationNumber(), ksp.getConvergedReason() > 0


def seconds(comm: MPI.Comm, work: Callable[[], object]) -> float:
    """Wall-clock time of the slowest rank."""
    comm.Barrier()
    begin = time.perf_counter()
    work()
    comm.Barrier()
    return time.perf_counter() - begin


def main(file: Path, words: list[str]) -> None:
    """Runs pdvol; rank 0 writes the file after each measurement."""
    rows: list[dict] = []
    peers: dict[tuple[int, str], Peer] = {}  # of levels, by their vertices
    points, solves = np.zeros(0), 0
    renew, solve_once, begin_step = Newton._renew_matrix, LinearSolver.solve_once, LinearSolver.begin_step

    def begun(self: LinearSolver) -> None:
        nonlocal solves
        solves = 0
        begin_step(self)

    def noted(self: Newton, x: Any) -> None:
        nonlocal points
        points = x.owned
        renew(self, x)

    def measured(self: LinearSolver, right: Any, solution: Any, near: bool = False) -> tuple[int, int]:
        nonlocal solves
        solves += not near
        if near or self._by_petsc or solves != ITERATION:
            return solve_once(self, right, solution, near)
        system, comm, found = self._system, self._system.space.comm, []
        prepared = seconds(comm, self._prepare)
        solved = seconds(comm, lambda: found.append(solve_once(self, right, solution, near)))
        residual = right.duplicate()
        system.shell.mult(solution, residual)
        residual.aypx(-1.0, right)
        tolerance = residual.norm() / right.norm()
        row: dict[str, Any] = {"vertices": int(system.space.rank_ends[-1]), "tolerance": tolerance}
        row["pdvol"] = prepared, solved, found[0][1], found[0][0] > 0
        for name, (kind, options) in METHODS.items():
            level = row["vertices"], name
            peer = peers[level] = peers.get(level) or Peer(kind, options, comm)
            peer.take(system, points)
            row[name] = peer.solve(right, tolerance)
        rows.append(row)
        if comm.rank == 0:
            file.write_text(json.dumps(rows))
        return found[0]

    Newton._renew_matrix, LinearSolver.begin_step = noted, begun
    LinearSolver.solve_once = measured
    cli.main(argv=words)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
