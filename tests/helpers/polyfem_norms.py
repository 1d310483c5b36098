"""Norms of the displacement as PolyFEM's scenes list them under `tests`, assembled by dolfinx from a stored state."""

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from pdvol import compat


def norms(level, step: int) -> dict[str, float]:
    """err_l2, err_h1_semi, err_h1 and err_lp (p = 8) of a stored displacement, by the rule of cells' centres."""
    points, cells = level.mesh.points, level.mesh.cells
    dim = points.shape[1]
    domain = compat.create_mesh(MPI.COMM_SELF, points, cells, None)
    u = fem.Function(fem.functionspace(domain, ("Lagrange", 1, (dim,))))
    rank = np.argsort(domain.geometry.input_global_indices)  # node of the domain, by number of the vertex
    nodes = np.asarray(domain.geometry.dofmap)
    displacement = (level.positions(step) - level.rest)[domain.geometry.input_global_indices]
    assert len(rank) == len(points)
    values = u.x.array.reshape(-1, dim)
    values[np.asarray(u.function_space.dofmap.list)] = displacement[nodes]

    def total(density) -> float:
        return float(fem.assemble_scalar(fem.form(density * ufl.dx(metadata={"quadrature_degree": 1}))))

    l2, semi = total(ufl.inner(u, u)), total(ufl.inner(ufl.grad(u), ufl.grad(u)))
    return {
        "err_l2": l2**0.5,
        "err_h1_semi": semi**0.5,
        "err_h1": (l2 + semi) ** 0.5,
        "err_lp": total(ufl.inner(u, u) ** 4) ** 0.125,
    }
