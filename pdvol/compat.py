"""dolfinx and PETSc, which all of pdvol takes from here, and the differences between dolfinx 0.9 and later versions.

Raises
------
InputError
    There is no dolfinx, or what is installed does not fit together.
"""

import contextlib
import importlib.util
import os
import signal
from typing import Any

import numpy as np

from pdvol.errors import InputError

try:
    if importlib.util.find_spec("dolfinx_solver"):  # the wheel of pdvol[solver]: its MPI must be loaded before the rest
        import dolfinx_solver  # noqa: F401
    import basix.ufl
    import dolfinx
    import dolfinx.graph
    import ffcx.compiler
    import ffcx.options
    import ufl
    from dolfinx import fem as fem
    from dolfinx import geometry as geometry
    from dolfinx import la as la
    from mpi4py import MPI
    from petsc4py import PETSc as PETSc
except ImportError as error:
    raise InputError(
        f"no dolfinx that works ({error}); see docs/install.md, or run in a checkout: pip install '.[solver]'"
    ) from error

with contextlib.suppress(ValueError):  # not from a thread
    # As it was before: to Python, a write to a process that has ended is an error. PETSc's handler ends this process.
    signal.signal(signal.SIGPIPE, signal.getsignal(signal.SIGPIPE) or signal.SIG_IGN)

# How many processes Open MPI's launcher has started, or MPICH's: with the library of the other, each of them is alone.
_started = int(os.environ.get("OMPI_COMM_WORLD_SIZE") or os.environ.get("PMI_SIZE") or 1)
if _started > 1 == MPI.COMM_WORLD.size:
    raise InputError(
        f"{_started} processes were started by the launcher of another MPI than {MPI.get_vendor()[0]}, which dolfinx"
        " has, and would not share the work; take its own, as mpiexec beside this Python"
    )

DOLFINX = tuple(int(part) for part in dolfinx.__version__.split(".")[:2])


def form_code(form: ufl.Form) -> str:
    """The C file that FFCx makes of a form. From 0.10 on it comes in a list."""
    code = ffcx.compiler.compile_ufl_objects([form], ffcx.options.get_options())
    return code[1] if DOLFINX < (0, 10) else code[0][1]


def geometry_dofmap(mesh: dolfinx.mesh.Mesh) -> np.ndarray:
    """(cells, d + 1) int32: the geometry nodes of each local cell. `Geometry.dofmap` gave way to `dofmaps`."""
    dofmaps = getattr(mesh.geometry, "dofmaps", None)
    return np.asarray(mesh.geometry.dofmap if dofmaps is None or callable(dofmaps) else dofmaps[0])


def create_mesh(
    comm: MPI.Comm, points: np.ndarray, cells: np.ndarray, owner: np.ndarray | None = None
) -> dolfinx.mesh.Mesh:
    """A simplex mesh distributed over `comm` from arrays given on rank 0: each cell to its `owner` (m,) int32, or by
    dolfinx' partitioner. Collective.

    The argument order of `dolfinx.mesh.create_mesh` changed silently in 0.10: keywords only.
    """
    d = points.shape[1]
    element = basix.ufl.element("Lagrange", {2: "triangle", 3: "tetrahedron"}[d], 1, shape=(d,))
    mine = slice(None) if comm.rank == 0 else slice(0, 0)
    how = {} if owner is None else {"partitioner": lambda *_: _destinations(owner[mine])}
    return dolfinx.mesh.create_mesh(
        comm=comm,
        cells=np.ascontiguousarray(cells[mine], dtype=np.int64),
        x=np.ascontiguousarray(points[mine], dtype=np.float64),
        e=element,
        **how,
    )


def _destinations(owner: np.ndarray) -> Any:
    """One rank per cell, as the graph of dolfinx' C++; newer versions wrap it in Python."""
    graph = dolfinx.graph.adjacencylist(np.ascontiguousarray(owner, dtype=np.int32)[:, None])
    return getattr(graph, "_cpp_object", graph)


def index_map(comm: MPI.Comm, owned: int, ghosts: np.ndarray, owners: np.ndarray) -> dolfinx.common.IndexMap:
    """A distribution of indices from each rank's share, its ghosts (int64, global) and their owners (int32).
    Collective.

    From 0.10 on a message tag must be given.
    """
    tag = () if DOLFINX < (0, 10) else (1202,)
    return dolfinx.common.IndexMap(comm, owned, ghosts, owners, *tag)
