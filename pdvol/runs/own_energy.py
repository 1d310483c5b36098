"""Contact for a user's own energy on a user's own dolfinx mesh: `pdvol.Contact`.

It is the barrier of Li et al. 2023 and the lagged friction of Li et al. 2020, as in a scene's run: functions B(u) [J]
and D(u) [J] of displacements. The user adds them to an incremental potential of the user's own, `E(u) + B(u) + D(u)`,
and minimises the sum by steps that `max_step` limits. Where the first state is free of intersections, all states that
are reached that way are.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
from mpi4py import MPI

from pdvol.compat import PETSc, fem
from pdvol.errors import InputError
from pdvol.geometry.closed_surfaces import gyration_diagonal
from pdvol.integrate.scripted_motion import LEAST_GAIN
from pdvol.levels.initial_state import count_intersections, find_defects
from pdvol.levels.level_check import check_distance
from pdvol.levels.obstacles import placed_obstacles, read_geometry
from pdvol.levels.script import ON_TIME, Script
from pdvol.levels.space import LevelSpace
from pdvol.parallel import on_root
from pdvol.potentials.assembly.hessian_blocks import BlockPattern, HessianBlocks
from pdvol.potentials.build import Terms, contact_terms
from pdvol.potentials.potential import LEAST_LEFT, Positions
from pdvol.runs.own_parts import GivenEnergy, held_points, longest_part, owned_rows
from pdvol.scene import Barrier, Friction, Obstructing, Pascal, Still
from pdvol.scene.checks import finite, instance, optional, positive, several
from pdvol.solve.incremental_potential import IncrementalPotential
from pdvol.solve.linear.system_matrix import SystemMatrix
from pdvol.solve.report import Stopwatch

Displacement: TypeAlias = fem.Function | PETSc.Vec
PINCHED = 2e-3  # of dhat: twice the gap that a step leaves at least; obstacles do not close such a gap any further
NEARLY_ALL = 0.999  # share that is left of pinched gaps: that of all others stays LEAST_LEFT


class Contact:
    """Barrier and friction of a mesh's boundary, with itself and with obstacles, as functions of displacements u.

    Construction and all methods are collective. Vectors and matrices have the numbering and the distribution of V.
    Numbers are the same on every rank. In 2D forces and energies are per metre of depth.

    Parameters
    ----------
    V : dolfinx.fem.FunctionSpace
        Vector P1 on straight triangles (2D) or tetrahedra (3D). Its mesh is the rest configuration.
    young : float [Pa], optional
        Young's modulus of the softest material, or a comparable stiffness, of which `barrier.stiffness` is a fraction.
        Not needed where that is in `Pascal`.
    barrier : Barrier
        Of the convergent law, the default.
    friction : Friction, optional
        Names in its `pairs` are those of obstacles and of `bodies`.
    obstacles : sequence of Plane, Rigid and Deforming
        Their motions give their places at a time t.
    diagonal : float [m], optional
        What `Relative` lengths and speeds are fractions of; when None that of the mesh's smallest connected part, at
        rest (`gyration_diagonal`).

    Attributes
    ----------
    V : dolfinx.fem.FunctionSpace
    bodies : tuple of str
        Names of the connected parts of the mesh: "body", or "body 1", "body 2", ... in the order of their first
        vertices.
    dhat : float [m]
        Distance at which contact begins to push.
    kappa : float [Pa]
        The barrier's stiffness.

    Raises
    ------
    InputError
        V is another kind of space, a value is invalid, dhat is larger than a body, an obstacle has another dimension,
        or a name in `friction.pairs` is unknown.
    """

    def __init__(
        self,
        V: fem.FunctionSpace,
        young: float | None = None,
        barrier: Barrier | None = None,
        friction: Friction | None = None,
        obstacles: Sequence[Obstructing] = (),
        diagonal: float | None = None,
    ):
        barrier = Barrier() if barrier is None else barrier
        instance(Barrier)("Contact.barrier", barrier)
        optional(instance(Friction))("Contact.friction", friction)
        several(Obstructing, "Plane, Rigid and Deforming")("Contact.obstacles", obstacles)
        if young is not None:
            positive("Contact.young", young)
        elif not isinstance(barrier.stiffness, Pascal):
            raise InputError("Contact needs young [Pa], or its stiffness in pascal: Barrier(stiffness=Pascal(1e4))")
        self.V, self._space = V, LevelSpace.of(V)
        mesh = self._space.mesh
        count = int(mesh.bodies.max()) + 1
        if diagonal is None:
            of = mesh.point_bodies[mesh.boundary[:, 0]]
            diagonal = min(gyration_diagonal(mesh.points, mesh.boundary[of == part]) for part in range(count))
        positive("Contact.diagonal", diagonal)
        self.bodies = ("body",) if count == 1 else tuple(f"body {number}" for number in range(1, count + 1))
        self._rest = self._space.from_input(mesh.points)
        self._at: Positions | None = None
        self._stepped, self._time, self._step = False, 0.0, (0.0, 1.0)
        self._blocks = HessianBlocks(BlockPattern(self._space))
        nobody = np.zeros(self._space.n_owned, dtype=bool)  # the user eliminates supported rows
        self._matrix: Any = SystemMatrix(self._space, nobody)
        geometry = on_root(V.mesh.comm, lambda: read_geometry(obstacles))
        contact = (barrier,) if friction is None else (barrier, friction)
        self._obstacles = placed_obstacles(obstacles, geometry)
        for placed in self._obstacles:
            if (given := placed.vertices.shape[1]) != self._space.dim:
                raise InputError(f"obstacle {placed.name!r} is {given}D, the mesh is {self._space.dim}D")
        names = [*self.bodies, *(placed.name for placed in self._obstacles)]
        triples = () if friction is None else friction.triples
        unknown = {name for one, other, _ in triples for name in (one, other)} - {*names}
        if unknown:
            raise InputError(f"Friction.pairs names {sorted(unknown)[0]!r}; there are {names}")
        softest = float(young or 0.0)
        contacts, frictions = contact_terms(contact, names, self._obstacles, self._space, diagonal, softest)
        self._barrier = contacts[0]
        self.dhat, self.kappa = self._barrier.dhat, self._barrier.kappa
        check_distance(self.bodies, mesh, self.dhat)
        self._terms = Terms(np.zeros_like(self._rest), (*contacts, *frictions), contacts, frictions)
        self._potential = IncrementalPotential(self._space, self._terms, Stopwatch(), self.bodies)

    def __repr__(self) -> str:
        names = [self.bodies[0] if len(self.bodies) == 1 else f"{len(self.bodies)} bodies"]
        friction = ", with friction" if self._potential.frictions else ""
        return f"Contact({names[0]}, dhat={self.dhat:.3g} m, kappa={self.kappa:.3g} Pa{friction})"

    def begin_step(self, u: Displacement, t0: float, t1: float) -> None:
        """Start the step from t0 to t1 [s] at displacements u.

        Obstacles are at their places at t0. Friction has the forces and directions of u, and slips count from here on.

        Raises
        ------
        IntersectionError
            Vertices lie behind a plane or, at the first call, anything crosses, touches or lies inside another. Later
            calls do not look for that, which takes as long as a Hessian: where u was set by hand, call `intersections`.
        InputError
            The times do not ascend, a motion fails, or contact keeps an obstacle from its place at t0, for neither
            `follow` nor `move_obstacles` has brought it there.
        """
        finite("begin_step: t0", t0)
        finite("begin_step: t1", t1)
        if not t1 > t0:
            raise InputError(f"begin_step: the step from {t0:g} to {t1:g} s has no length")
        x = self._positions(u)
        if not self._stepped or t0 <= self._time:
            self._time = float(t0)
            self._potential.move_obstacles(t0)
        self._apart(x)
        if self._go_on(x, float(t0)) < t0:
            raise InputError(
                f"begin_step: contact holds obstacles at t = {self._time:g} s, not {t0:g} s; solve and call follow (or"
                " move_obstacles) until it returns the step's end"
            )
        self._potential.begin_step(x, x.owned, 1.0, t0, t1)
        self._stepped, self._step = True, (float(t0), float(t1))

    def move_obstacles(self, u: Displacement, until: float) -> float:
        """Move the obstacles to their places at a time `until` [s], as far as they touch nothing at u.

        Returns the time [s] that they have reached. Where it is not `until`, solve for u and call it again. Where a gap
        is a few thousandths of `dhat`, obstacles do not close it further: u has to give way first.
        """
        return self._go_on(self._started(u), float(until))

    def follow(
        self,
        u: Displacement,
        until: float,
        hessian: PETSc.Mat,
        gradient: Displacement,
        held: np.ndarray | None = None,
        to: Displacement | None = None,
    ) -> float:
        """Move the obstacles towards their places at a time `until` [s], and the mesh along with them.

        What touches an obstacle that moves goes along with it, and the rest takes Newton's direction of `E + B + D`,
        as in a scene's march: a step takes few parts, where `move_obstacles` goes on by the gap that is left. Where a
        part would gain less than a fiftieth of the step, u stays; solve, so that bodies give way, and call it again.

        Parameters
        ----------
        u : displacements [m], which are changed
        until : [s], within the step
        hessian, gradient : of the user's own E at u [N/m, N], without contact and before supported rows are eliminated
        held : block numbers of V whose vertices are prescribed, as `locate_dofs_topological` gives them
        to : displacements [m] that these have at `until`; where None they stay

        Returns
        -------
        reached : time [s] that obstacles and held vertices have reached; E may fall further from u on

        Raises
        ------
        InputError
            A part of E is not finite or has another size, or the step ends before `until`.
        """
        finite("follow: until", until)
        x, forces, (t0, t1) = self._apart(self._started(u)), self._owned(gradient, "gradients"), self._step
        if until > t1 + ON_TIME * (t1 - t0):
            raise InputError(f"follow: {until:g} s is outside of the step from {t0:g} to {t1:g} s; begin the next one")
        ends = None if to is None else self._rest + self._owned(to)
        energy, rows = GivenEnergy(self._space, forces, hessian), owned_rows(self._space, held)
        if until > self._time:
            script = Script(held_points(x, rows, ends, self._time, until), self._obstacles)
            least = LEAST_GAIN * (t1 - t0)
            reached, end = longest_part(x, energy, self._terms, script, self._time, float(until), least)
            if end is not None:
                self._set(u, end)
                self._time = reached
                self._potential.move_obstacles(reached)
        return self._time

    def _go_on(self, x: Positions, until: float) -> float:
        """Moves the obstacles from where they are towards their places at a time, and returns the time reached."""
        pinched = self._potential.min_gap(x) < PINCHED * self.dhat
        still, kept = np.zeros_like(x.owned), NEARLY_ALL if pinched else LEAST_LEFT
        while until > self._time:
            share = self._potential.max_step(x, still, until, kept)
            if share == 1.0:
                self._time = until
                self._potential.move_obstacles(until)
                break
            # On the way to a nearer place an obstacle that turns takes another path, which is checked again.
            nearer = self._time + (1.0 - LEAST_LEFT) * share * (until - self._time)
            until = nearer if nearer < until else self._time
        return self._time

    def energy(self, u: Displacement) -> float:
        """B(u) + D(u) [J]; inf behind a plane.

        It does not detect surfaces that have passed through each other: `max_step` prevents that.
        """
        return self._potential.value(self._started(u))

    def gradient(self, u: Displacement) -> PETSc.Vec:
        """Gradient of the energy [N] by the unknowns of V: minus the contact forces. A new vector, with V's ghosts."""
        return self._vector(self._potential.gradient(self._apart(self._started(u))))

    def force(self, u: Displacement, obstacle: str) -> np.ndarray:
        """(d,) [N]: force of an obstacle on the bodies, barrier and friction together. All that have its name count.

        The sum over all obstacles is minus the sum of `gradient`.
        """
        x, names = self._apart(self._started(u)), [placed.name for placed in self._obstacles]
        numbers = [number for number, name in enumerate(names, len(self.bodies)) if name == obstacle]
        if not numbers:
            raise InputError(f"force: there is no obstacle {obstacle!r}; there are {names}")
        of = np.isin(self._barrier.surface.objects, numbers)
        found = [self._barrier.contacts(x).gradient, *(term.found_at(x)[1] for term in self._terms.frictions)]
        return self._space.reduce(sum(by_vertices[of].sum(axis=0) for by_vertices in found))

    def hessian(self, u: Displacement, projected: bool = True) -> PETSc.Mat:
        """Hessian of the energy [N/m], a new AIJ matrix that couples at least what cells couple.

        Parameters
        ----------
        u : displacements [m]
        projected : whether it is made positive semi-definite, for Newton's method; or exact, and then indefinite

        Add it to a matrix A of a form on V by `A.axpy(1.0, contact.hessian(u))`.
        """
        x = self._apart(self._started(u))
        self._blocks.clear()
        self._blocks.projection = "clamp" if projected else "none"
        self._potential.add_hessian(x, 1.0, self._blocks)
        self._matrix.assemble(self._blocks, eliminate=False)
        matrix = self._matrix.petsc.convert("aij", PETSc.Mat())
        matrix.setOption(PETSc.Mat.Option.SPD, False)  # rows that touch nothing are zero
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        return matrix

    def max_step(self, u: Displacement, du: Displacement) -> float:
        """Largest s in [0, 1] such that all states from u to u + s du are free of intersections.

        Where contact ends the step, a tenth of each gap is left.
        """
        return self._potential.max_step(self._started(u), self._owned(du))

    def update_lag(self, u: Displacement) -> float:
        """Take the forces and directions of friction from u.

        Returns by how much that changes the friction forces, relative to them. A step may be solved and lagged several
        times until that is small; once, as `begin_step` does it, is common.
        """
        return self._potential.update_lag(self._apart(self._started(u)))

    def min_gap(self, u: Displacement) -> float:
        """Smallest distance [m] of what is nearer than dhat; inf where nothing is."""
        return self._potential.min_gap(self._started(u))

    def count(self, u: Displacement) -> int:
        """How many pairs are nearer than dhat."""
        return self._barrier.count(self._started(u))

    def intersections(self, u: Displacement) -> int:
        """How many edges cross edges (2D) or triangles (3D), and how many vertices lie behind planes.

        The test for crossings is independent of the barrier's code.
        """
        places = {obstacle: obstacle.place(self._time) for obstacle in self._obstacles}
        return count_intersections(self._space.mesh, self._positions(u).whole, self._obstacles, self.bodies, places)

    def positions(self, u: Displacement) -> np.ndarray:
        """(n, d) [m] on every rank: where all vertices are, in the order of the points that the mesh was made from."""
        return self._positions(u).whole.copy()

    # ---- their parts

    def _owned(self, u: Displacement, what: str = "displacements") -> np.ndarray:
        """(n_owned, d) this rank's rows of a function or a vector; `what` they are, for messages."""
        size = self._space.n_owned * self._space.dim
        if not isinstance(u, fem.Function | PETSc.Vec):
            raise InputError(f"{what} are a dolfinx Function or a PETSc Vec, not {type(u).__name__}")
        values = _vector_of(u).array_r
        if len(values) != size:
            raise InputError(f"{what} have {len(values)} values on this rank, the function space has {size}")
        if not self._space.reduce(bool(np.isfinite(values).all()), MPI.LAND):
            raise InputError(f"{what} are not all finite numbers; end the solve where they first are not")
        return np.array(values, dtype=np.float64).reshape(-1, self._space.dim)

    def _positions(self, u: Displacement) -> Positions:
        """Positions at u: the same object as before where u is the same, because terms keep their results for it."""
        owned = self._rest + self._owned(u)
        same = self._at is not None and np.array_equal(owned, self._at.owned)
        if not self.V.mesh.comm.allreduce(same, op=MPI.LAND) or self._at is None:
            self._at = Positions(self._space, owned)
        return self._at

    def _set(self, u: Displacement, x: Positions) -> None:
        """Sets displacements, and those of ghosts, to what leads to x. Collective."""
        vector = _vector_of(u)
        vector.array_w[:] = (x.owned - self._rest).ravel()
        vector.ghostUpdate(PETSc.InsertMode.INSERT, PETSc.ScatterMode.FORWARD)

    def _started(self, u: Displacement) -> Positions:
        if not self._stepped:
            raise InputError("call contact.begin_step(u, t0, t1) first: it places the obstacles")
        return self._positions(u)

    def _vector(self, owned: np.ndarray) -> PETSc.Vec:
        index_map, d = self.V.dofmap.index_map, self._space.dim
        vector = PETSc.Vec().createGhost(
            index_map.ghosts.astype(PETSc.IntType),
            (index_map.size_local * d, index_map.size_global * d),
            bsize=d,
            comm=self.V.mesh.comm,
        )
        vector.array_w[:] = owned.ravel()
        vector.ghostUpdate(PETSc.InsertMode.INSERT, PETSc.ScatterMode.FORWARD)
        return vector

    def _apart(self, x: Positions) -> Positions:
        """x. IntersectionError where it is behind planes or, before the first step, anything meets. Collective."""
        if self._stepped and not self._barrier.behind_planes(x):
            return x
        mesh = replace(self._space.mesh, points=x.whole)
        placed = [replace(o, vertices=o.at(self._time), motion=Still()) for o in self._obstacles]
        for defect in find_defects(None, mesh, placed, self.bodies):
            raise defect.error
        return x


def _vector_of(u: Displacement) -> PETSc.Vec:
    return u.x.petsc_vec if isinstance(u, fem.Function) else u
