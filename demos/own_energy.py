"""Contact for a user's own energy on a user's own mesh: a beam with fibres, in UFL, falls on a ball and the floor.

The time loop is the user's own. pdvol adds only contact: its barrier and friction keep the beam from the ball, the
floor and itself. The result is the same on any number of ranks:

python demos/own_energy.py
mpirun -n 2 python demos/own_energy.py
"""

import sys

import numpy as np
import ufl
from mpi4py import MPI  # first: dolfinx' wheel takes the MPI library that mpi4py has loaded

# isort: split
from dolfinx import fem, mesh
from dolfinx.fem import petsc
from petsc4py import PETSc

import pdvol

YOUNG, POISSON, DENSITY = 2e5, 0.35, 1000.0  # Pa, -, kg/m^3
FIBRES = 1e6  # Pa: stiffness of fibres along the beam, which resist being stretched or pressed
GRAVITY = np.array([0.0, 0.0, -9.81])  # m/s^2
LOW, HIGH = np.array([0.0, 0.0, 0.205]), np.array([0.6, 0.1, 0.265])  # m: corners of the beam
DT, STEPS = 0.01, 40  # s
SLOW = 1e-8  # m: Newton stops where its step moves no vertex further
MOST = 100  # Newton iterations of a step


def energy_density(u):
    """psi [Pa] of a Neo-Hookean matrix and of fibres along x, in UFL."""
    mu, lmbda = YOUNG / (2 * (1 + POISSON)), YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    F = ufl.Identity(3) + ufl.grad(u)
    C, log_J = F.T * F, ufl.ln(ufl.det(F))
    return mu / 2 * (ufl.tr(C) - 3) - mu * log_J + lmbda / 2 * log_J**2 + FIBRES / 8 * (C[0, 0] - 1) ** 2


def simulate(steps=STEPS, comm=MPI.COMM_WORLD):
    """The contact, the last displacements, and the `Claims` with what they found in all steps."""
    domain = mesh.create_box(comm, (LOW, HIGH), (18, 3, 2), mesh.CellType.tetrahedron)
    V = fem.functionspace(domain, ("Lagrange", 1, (3,)))
    u, u_hat, v, du = (fem.Function(V) for _ in range(4))  # displacement, predicted one, velocity, Newton's step
    inertia = DENSITY / (2 * DT**2) * ufl.inner(u - u_hat, u - u_hat)
    E = (inertia + energy_density(u) - DENSITY * ufl.dot(ufl.as_vector(GRAVITY), u)) * ufl.dx
    E, dE, ddE = (fem.form(form) for form in (E, ufl.derivative(E, u), ufl.derivative(ufl.derivative(E, u), u)))
    ball = pdvol.Rigid(pdvol.meshes.ball(0.1, 3), pdvol.Placement((0.2, 0.05, 0.1)), name="ball")
    floor = pdvol.Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), name="floor")
    contact = pdvol.Contact(V, YOUNG, pdvol.Barrier(dhat=1e-3), pdvol.Friction(0.3), (floor, ball))
    energy = lambda: comm.allreduce(fem.assemble_scalar(E)) + contact.energy(u)
    solver, claims = direct_solver(comm), Claims(v)

    # Implicit Euler: each step minimises E and the energy of contact by Newton's method.
    for step in range(steps):
        contact.begin_step(u, step * DT, (step + 1) * DT)
        u_old = u.x.array.copy()
        u_hat.x.array[:] = u_old + DT * v.x.array
        for _ in range(MOST):
            g = petsc.assemble_vector(dE)
            g.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
            g.axpy(1.0, contact.gradient(u))
            H = petsc.assemble_matrix(ddE)
            H.assemble()
            H.axpy(1.0, contact.hessian(u))
            solver.setOperators(H)
            solver.solve(-g, du.x.petsc_vec)
            du.x.scatter_forward()
            if du.x.petsc_vec.norm(PETSc.NormType.INFINITY) < SLOW:
                break
            # No further than contact allows, and until the energy falls. It is NaN where a cell is inverted.
            start, before, length = u.x.array.copy(), energy(), contact.max_step(u, du)
            u.x.array[:] = start + length * du.x.array
            while length > 1e-9 and not energy() <= before + 1e-12 * abs(before):
                length /= 2
                u.x.array[:] = start + length * du.x.array
        else:
            raise RuntimeError(f"step {step}: Newton did not converge")
        v.x.array[:] = (u.x.array - u_old) / DT
        claims.check(contact, u)
    return contact, u, claims


class Claims:
    """The smallest gap [m] at the end of steps, and the error of momentum: only weight and contact may change it."""

    def __init__(self, v):
        self._momentum = [fem.form(DENSITY * v[i] * ufl.dx) for i in range(3)]
        self._last, self._comm = np.zeros(3), v.function_space.mesh.comm
        self.gap, self.error = np.inf, 0.0  # m, N s

    def check(self, contact, u):
        """At the end of a step."""
        pull = -contact.gradient(u).array.reshape(-1, 3).sum(axis=0)
        forces = self._comm.allreduce(pull) + DENSITY * np.prod(HIGH - LOW) * GRAVITY
        momentum = self._comm.allreduce(np.array([fem.assemble_scalar(form) for form in self._momentum]))
        self.error = max(self.error, np.abs(momentum - self._last - DT * forces).max())
        self.gap, self._last = min(self.gap, contact.min_gap(u)), momentum


def direct_solver(comm):
    """MUMPS' LU."""
    solver = PETSc.KSP().create(comm)
    solver.setType("preonly")
    solver.pc.setType("lu")
    solver.pc.setFactorSolverType("mumps")
    return solver


if __name__ == "__main__":
    contact, u, claims = simulate()
    positions, crossings, contacts = contact.positions(u), contact.intersections(u), contact.count(u)
    impulse = DT * DENSITY * np.prod(HIGH - LOW) * 9.81  # N s, of the weight in one step
    assert crossings == 0 and claims.gap > 0.0, f"{crossings} crossings, smallest gap {claims.gap} m"
    assert contacts > 0 and claims.error < 1e-3 * impulse, f"{contacts} contacts, momentum wrong by {claims.error} N s"
    if MPI.COMM_WORLD.rank == 0:
        print(f"{contacts} contacts, no intersection, smallest gap {claims.gap:.2e} m")
        print(f"momentum as weight and contact make it, to {claims.error / impulse:.1e} of the weight's in a step")
        print(f"the beam's centre is at {positions.mean(axis=0).round(4)} m")
        if len(sys.argv) > 1:
            np.save(sys.argv[1], positions)
