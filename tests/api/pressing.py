"""A Neo-Hookean block of a user's own between a bottom that is held and a plate that presses it and slides, for tests
of `pdvol.Contact.follow`."""

import numpy as np
import ufl
from dolfinx import fem, mesh
from dolfinx.fem import petsc
from mpi4py import MPI
from petsc4py import PETSc

import pdvol

DT, YOUNG, DHAT, SIZE = 0.02, 1e4, 2e-3, 0.2  # s, Pa, m, m: of a step, the block, contact, the block's side
SLOW = 1e-9  # m: Newton stops there
FEW = 3  # iterations with which the block gives way between parts


class Pressed:
    """The block, which a plate presses by `depth` [m] in so many steps and moves sideways by half of that.

    With `lifted` the plate waits above, and the block's bottom is pushed up to it by as much.
    """

    def __init__(self, dim, comm=MPI.COMM_SELF, depth=0.04, steps=4, lifted=False):
        low, high = [np.zeros(dim), np.full(dim, SIZE)]
        cells = {2: mesh.CellType.triangle, 3: mesh.CellType.tetrahedron}[dim]
        make = {2: mesh.create_rectangle, 3: mesh.create_box}[dim]
        domain = make(comm, (low, high), (4,) * dim, cells)
        V = fem.functionspace(domain, ("Lagrange", 1, (dim,)))
        self.u, self.du, self.steps, self._dim = fem.Function(V), fem.Function(V), steps, dim
        bottom = mesh.locate_entities_boundary(domain, dim - 1, lambda x: np.isclose(x[dim - 1], 0.0))
        self.held = fem.locate_dofs_topological(V, dim - 1, bottom)
        self.to = fem.Function(V) if lifted else None
        self._up = depth / steps
        end = np.zeros(dim)
        end[0], end[-1] = 0.5 * depth, -depth
        way = pdvol.Path((0.0, steps * DT), (np.zeros(dim), np.zeros(dim) if lifted else end))
        low_side = SIZE + 0.5 * DHAT
        if dim == 3:
            place = pdvol.Placement((SIZE / 2, SIZE / 2, low_side + 0.025))
            plate = pdvol.Rigid(pdvol.meshes.box((0.16, 0.16, 0.05)), place, way, "plate")
        else:
            corners = [(0.02, low_side), (0.18, low_side), (0.18, low_side + 0.05), (0.02, low_side + 0.05)]
            plate = pdvol.Rigid(pdvol.meshes.Outline(np.array(corners)), motion=way, name="plate")
        barrier = pdvol.Barrier(dhat=DHAT)
        self.contact = pdvol.Contact(V, YOUNG, barrier, pdvol.Friction(0.5), (plate,))
        F = ufl.Identity(dim) + ufl.grad(self.u)
        log_J = ufl.ln(ufl.det(F))
        psi = YOUNG / 5 * (ufl.tr(F.T * F) - dim - 2 * log_J) + YOUNG / 4 * log_J**2
        E = psi * ufl.dx
        dE = ufl.derivative(E, self.u)
        self._forms = tuple(fem.form(form) for form in (E, dE, ufl.derivative(dE, self.u)))
        self._comm = comm
        self.rounds, self.crossings, self.reached = [], 0, True

    def energy(self):
        return self._comm.allreduce(fem.assemble_scalar(self._forms[0])) + self.contact.energy(self.u)

    def derivatives(self):
        """H and g of the block's own energy."""
        g = petsc.assemble_vector(self._forms[1])
        g.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
        H = petsc.assemble_matrix(self._forms[2])
        H.assemble()
        return H, g

    def solve(self, most):
        """Newton iterations, at most so many, with the bottom where it is."""
        rows = (self.held[:, None] * self._dim + np.arange(self._dim)).ravel()
        own = rows[rows < self.u.x.petsc_vec.getLocalSize()].astype(np.int32)
        first = self.u.x.petsc_vec.getOwnershipRange()[0]
        for _ in range(most):
            H, g = self.derivatives()
            g.axpy(1.0, self.contact.gradient(self.u))
            H.axpy(1.0, self.contact.hessian(self.u))
            g.array_w[own] = 0.0
            H.zeroRowsColumns(own + first)
            solver = PETSc.KSP().create(self._comm)
            solver.setType("preonly")
            solver.pc.setType("lu")
            solver.pc.setFactorSolverType("mumps")
            solver.setOperators(H)
            solver.solve(-g, self.du.x.petsc_vec)
            self.du.x.scatter_forward()
            if self.du.x.petsc_vec.norm(PETSc.NormType.INFINITY) < SLOW:
                return
            length = self.contact.max_step(self.u, self.du)
            start, before = self.u.x.array.copy(), self.energy()
            self.u.x.array[:] = start + length * self.du.x.array
            while not self.energy() <= before + 1e-12 * abs(before):
                length /= 2
                self.u.x.array[:] = start + length * self.du.x.array

    def press(self, follow=True, most=200):
        """All steps; each takes `most` rounds at most."""
        for step in range(self.steps):
            until = (step + 1) * DT
            self.contact.begin_step(self.u, step * DT, until)
            if self.to is not None:
                self.to.x.array[:] = 0.0
                self.to.x.array[self._dim - 1 :: self._dim] = self._up * (step + 1)
            for number in range(1, most + 1):  # noqa: B007
                if follow:
                    reached = self.contact.follow(self.u, until, *self.derivatives(), self.held, self.to)
                else:
                    reached = self.contact.move_obstacles(self.u, until)
                self.crossings += self.contact.intersections(self.u)
                if reached == until:
                    break
                self.solve(FEW)
            self.reached = reached == until
            self.rounds.append(number)
            if not self.reached:
                return self
            self.solve(100)
        return self


def findings(comm):
    """Places after a press in 2D and 3D."""
    return {f"{dim}D": (pressed := Pressed(dim, comm).press()).contact.positions(pressed.u) for dim in (2, 3)}
