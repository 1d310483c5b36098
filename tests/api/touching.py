"""Two blocks on an own dolfinx mesh, near each other, the ground and an obstacle, for tests of `pdvol.Contact`."""

import numpy as np
from dolfinx import fem
from mpi4py import MPI

import pdvol
from pdvol import compat
from pdvol.meshes import Outline, Surface
from shapes import box

DHAT = 0.05


def blocks(dim: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and cells of two unit blocks, one 0.03 above the other and turned by 0.1 rad against it."""
    block = box(dim, 3)
    points, cells = block.points, block.cells
    c, s = np.cos(0.1), np.sin(0.1)
    turned = points.copy()
    turned[:, [0, -1]] = (points - 0.5)[:, [0, -1]] @ np.array([[c, s], [-s, c]]) + 0.5
    turned[:, -1] += 1.03 - turned[:, -1].min()
    return np.concatenate([points, turned]), np.concatenate([cells, cells + len(points)])


def space(dim: int, comm=MPI.COMM_WORLD):
    """Vector P1 on the two blocks, distributed as dolfinx likes."""
    return fem.functionspace(compat.create_mesh(comm, *blocks(dim)), ("Lagrange", 1, (dim,)))


def wedge(dim: int):
    """A rigid obstacle whose edge or tip is 0.02 left of the lower block."""
    outline = np.array([(-0.02, 0.52), (-0.5, 0.9), (-0.5, 0.1)])
    if dim == 2:
        return Outline(outline)
    corners = np.insert(np.concatenate([outline, outline]), 1, np.repeat([-0.5, 1.47], 3), axis=1)
    sides = [(0, 2, 1), (3, 4, 5)]
    for a, b in ((0, 1), (1, 2), (2, 0)):
        sides += [(a, b, b + 3), (a, b + 3, a + 3)]
    return Surface(corners, np.array(sides, dtype=np.int32))


def obstacles(dim: int, **placed):
    """The ground 0.03 below, and the wedge."""
    ground = pdvol.Plane((0.0,) * (dim - 1) + (-0.03,), (0.0,) * (dim - 1) + (1.0,), name="ground")
    return ground, pdvol.Rigid(wedge(dim), name="wedge", **placed)


def contact(V, **changed) -> pdvol.Contact:
    """Barrier and friction of the two blocks with each other and the obstacles."""
    given = {
        "young": 1e5,
        "barrier": pdvol.Barrier(dhat=DHAT),
        "friction": pdvol.Friction(0.4, pairs={("body 1", "wedge"): 0.8, ("body 2", "body 1"): 0.2}),
        "obstacles": obstacles(V.mesh.geometry.dim),
    }
    return pdvol.Contact(V, **{**given, **changed})


def displaced(V, size: float = 2e-3) -> fem.Function:
    """A smooth displacement that depends on places alone."""
    u, dim = fem.Function(V), V.mesh.geometry.dim
    waves = np.array([[7.0, 3.0, 2.0], [5.0, -4.0, 6.0], [-3.0, 8.0, 1.0]])[:dim, :dim]
    u.interpolate(lambda x: size * np.sin(waves @ x[:dim] + 0.3))
    return u


def findings(comm) -> dict[str, np.ndarray]:
    """What contact says in 2D and 3D, vectors in the order of the mesh's input."""
    return {f"{key}_{dim}": np.asarray(value) for dim in (2, 3) for key, value in found(dim, comm).items()}


def found(dim: int, comm) -> dict:
    """What contact says in one dimension."""
    V = space(dim, comm)
    touching, start, u = contact(V), displaced(V, 1e-3), displaced(V)
    touching.begin_step(start, 0.0, 0.01)
    far = displaced(V, -0.3)
    whole = lambda vector: touching.positions(vector) - touching.positions(fem.Function(V))
    H = touching.hessian(u)
    product = H.createVecLeft()
    H.mult(touching.gradient(u), product)
    return {
        "positions": touching.positions(u),
        "energy": touching.energy(u),
        "gradient": whole(touching.gradient(u)),
        "product": whole(product),
        "forces": [touching.force(u, name) for name in ("ground", "wedge")],
        "max_step": touching.max_step(u, far),
        "min_gap": touching.min_gap(u),
        "count": touching.count(u),
        "intersections": touching.intersections(far),
        "lag": touching.update_lag(u),
        "lagged": whole(touching.gradient(u)),
    }
