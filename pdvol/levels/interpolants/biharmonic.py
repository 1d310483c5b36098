"""Biharmonic Coordinates with control points that need not be fine vertices (Wang et al. 2015; paper 3.4.1 and appendix
A).

Each column of W is the smoothest field on the fine mesh that is one at one coarse vertex and zero at the others:

    min_W tr(1/2 W' A W)  subject to  B W = I,        A = L' M^-1 L

with B the binding of the coarse vertices into the fine mesh (weights of coarse vertices outside are partly negative)
and A the squared Laplacian below, whose kernel is the affine functions: W then reproduces affine fields.

All columns come from one factorisation of [[A, B'], [B, -e I]]. With e = 0 that matrix is singular where B lacks rank:
where a part of the coarse mesh has more vertices than the fine mesh around it. The small e makes those constraints hold
in the least-squares sense, leaves the others as they are to about e, and does not touch affine fields, which satisfy
all constraints at no energy.

W decays with the distance, and is made sparse: each row loses its smallest weights, whose absolute sum is at most
`DROPPED`: a field changes by at most that fraction of its range. The remaining weights are then corrected, per row, by
the smallest change (in the sense of least squares) after which affine fields are exact again. The home cell's corners
stay in every row, so that the remaining coarse vertices never lie in a plane.

A = L' M^-1 L has affine functions in its kernel, boundary included.
L has a row per inner facet: the jump of a P1 field's gradient there, which is all the Laplacian that such a field has,

    (L u)_f = |f| (n_a . grad u_a + n_b . grad u_b)      a, b the cells beside f, n_a = -n_b their normals away from f,

and M_f = (|a| + |b|) / (d + 1): the lumped Crouzeix-Raviart Laplacian. Facets of the boundary have no row: nothing is
required of the normal derivative there (natural boundary conditions). A field without such jumps is affine on every
part joined through facets, hence the kernel.

The cotangent Laplacian, which imposes no flux through the boundary, does not annihilate affine functions at boundary
vertices. Wang et al. (2015) added their flux back; libigl keeps that variant out of use with a note by its authors that
it is in error, and has this one.
"""

from collections.abc import Iterable, Iterator

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from pdvol.compat import PETSc
from pdvol.errors import MeshError
from pdvol.geometry.level_mesh import LevelMesh, connected_parts
from pdvol.levels.binding import Binding, bind
from pdvol.levels.space import LevelSpace
from pdvol.meshing.cache import content_key, default_folder, fetch
from pdvol.parallel import on_root

DROPPED = 0.05
SLACK = 1e-8  # e, beside A scaled to a median diagonal of one
BLOCK = 256  # right-hand sides at a time: bounds the dense part of the memory
# fraction of the body's size by which the solved W may miss the rest positions, before they are restored exactly
ACCURATE = 1e-6
# MUMPS' relative pivoting threshold, the largest value: multipliers of conflicting constraints are as large as 1 / e
PIVOTING = 0.5
KEPT_FROM = 5000  # fine vertices: weights of smaller levels take a second or two and are not kept
SOLVED = (  # key of kept weights beside the meshes; its number grows when the method changes
    f"biharmonic 1, {SLACK:g}, {DROPPED:g}"
)
WORKSPACES = (100, 400, 1600, 6400)  # per cent on top of MUMPS' estimate, tried in turn
_THRESHOLDS = 10.0 ** np.arange(-6.0, -1.9, 0.1)  # tried for each row


def biharmonic(coarse: LevelSpace, fine: LevelSpace, binding: Binding) -> sp.csr_matrix:
    """Weights (n_fine, n_coarse), body by body, sparse to within `DROPPED`. Collective; rank 0 solves, or takes them
    from the cache.

    Raises
    ------
    MeshError
        When a connected part of a fine body has coarse vertices in fewer than d + 1 independent places: W would not be
        unique.
    """
    back = bind(coarse, fine)
    return on_root(fine.comm, lambda: _kept(coarse.mesh, fine.mesh, back, binding.matrix(coarse.mesh)))


def _kept(coarse: LevelMesh, fine: LevelMesh, back: Binding, home: sp.csr_matrix) -> sp.csr_matrix:
    """The weights, kept in the cache of meshes where they take seconds."""
    if len(fine.points) < KEPT_FROM:
        return _all_bodies(coarse, fine, back, home)

    def build() -> dict[str, np.ndarray]:
        weights = _all_bodies(coarse, fine, back, home)
        return {"data": weights.data, "indices": weights.indices, "indptr": weights.indptr}

    meshes = (array for mesh in (coarse, fine) for array in (mesh.points, mesh.cells, mesh.bodies))
    found = fetch(
        default_folder(),
        content_key(*meshes, back.cells, back.weights, home.indices, home.data, SOLVED) + "-weights",
        build,
    )
    return sp.csr_matrix((found["data"], found["indices"], found["indptr"]), shape=home.shape)


def _all_bodies(coarse: LevelMesh, fine: LevelMesh, back: Binding, home: sp.csr_matrix) -> sp.csr_matrix:
    blocks, fine_order, coarse_order = [], [], []
    for body in np.unique(fine.bodies):
        mesh, mine = fine.body(body)
        controls = np.flatnonzero(coarse.point_bodies == body)
        cells = np.searchsorted(np.flatnonzero(fine.bodies == body), back.cells[controls])
        own = Binding(cells, back.kind[controls], back.weights[controls])
        columns = biharmonic_columns(mesh, own, coarse.points[controls], f"body {body}")
        blocks.append(make_local(columns, home[mine][:, controls], coarse.points[controls], mesh.points))
        fine_order.append(mine)
        coarse_order.append(controls)
    rows, coarse_points = np.argsort(np.concatenate(fine_order)), np.concatenate(coarse_order)
    weights = sp.block_diag(blocks, format="csr")[rows]
    weights = sp.csr_matrix((weights.data, coarse_points[weights.indices], weights.indptr), shape=home.shape)
    weights.sort_indices()
    return weights


def biharmonic_columns(mesh: LevelMesh, back: Binding, points: np.ndarray, name: str) -> Iterator[np.ndarray]:
    """The dense columns of W of one body, in blocks (n, k). Not collective.

    Parameters
    ----------
    mesh : the fine body
    back : binding of the body's m coarse vertices to its fine cells
    points : (m, d) these vertices [m]
    name : of the body, for errors
    """
    _check_controls(mesh, back, points, name)
    control = back.matrix(mesh)
    energy = squared_laplacian(mesh)
    energy /= np.median(energy.diagonal()) or 1.0  # a body of one cell has no inner facet and no energy
    system = sp.bmat([[energy, control.T], [control, -SLACK * sp.eye(len(points))]], format="csr")
    rest = np.zeros_like(mesh.points)
    for first, block in _solve(system, len(mesh.points)):
        rest += block @ points[first : first + block.shape[1]]
        yield block
    error = np.abs(rest - mesh.points).max() / np.ptp(mesh.points, axis=0).max()
    if not error < ACCURATE:
        raise MeshError(
            f"{name}: biharmonic coordinates miss the rest positions by {error:.1g} of its size, as its finer mesh has"
            " cells of very poor shape; use --prolongation barycentric"
        )


def _solve(system: sp.csr_matrix, n: int) -> Iterator[tuple[int, np.ndarray]]:
    """Rows 0 ... n - 1 of columns n, n + 1, ... of a symmetric indefinite matrix's inverse: (column, block (n, k))."""
    size = system.shape[0]
    system.sort_indices()
    csr = (system.indptr.astype(PETSc.IntType), system.indices.astype(PETSc.IntType), system.data)
    matrix = PETSc.Mat().createAIJ(system.shape, csr=csr, comm=MPI.COMM_SELF)
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    pc = _factor(matrix)
    factor = pc.getFactorMatrix()
    for first in range(n, size, BLOCK):
        k = min(BLOCK, size - first)
        # Unit vectors, given to MUMPS as sparse ones (a transposed AIJ): a third faster.
        units = (np.arange(k + 1, dtype=PETSc.IntType), np.arange(first, first + k, dtype=PETSc.IntType), np.ones(k))
        right = PETSc.Mat().createTranspose(PETSc.Mat().createAIJ((k, size), csr=units, comm=MPI.COMM_SELF))
        solution = PETSc.Mat().createDense((size, k), comm=MPI.COMM_SELF)
        solution.setUp()
        solution.assemble()
        factor.matSolve(right, solution)
        yield first - n, solution.getDenseArray()[:n].copy()
        solution.destroy()
        right.destroy()
    pc.destroy()
    matrix.destroy()


def _factor(matrix: PETSc.Mat) -> PETSc.PC:
    """MUMPS' LDL' of a symmetric indefinite matrix. It sizes its work array by the pattern; pivoting may need more."""
    for workspace in WORKSPACES:
        pc = PETSc.PC().create(MPI.COMM_SELF)
        pc.setOperators(matrix)
        pc.setType(PETSc.PC.Type.CHOLESKY)
        pc.setFactorSolverType(PETSc.Mat.SolverType.MUMPS)
        pc.setFactorSetUpSolverType()
        factor = pc.getFactorMatrix()
        factor.setMumpsIcntl(14, workspace)
        factor.setMumpsIcntl(27, BLOCK)
        factor.setMumpsCntl(1, PIVOTING)
        pc.setUp()
        status = factor.getMumpsInfog(1)
        if status >= 0:
            return pc
        pc.destroy()
    raise MeshError(
        f"the system of the biharmonic coordinates cannot be factorised (MUMPS error {status}); use --prolongation"
        " barycentric"
    )


def _check_controls(mesh: LevelMesh, back: Binding, points: np.ndarray, name: str) -> None:
    """Affine functions on a part joined through facets have no energy: coarse vertices bound to it must fix them."""
    m = len(mesh.cells)
    part = connected_parts(mesh.inner_facets[0], m)
    parts, homes = int(part.max()) + 1, part[back.cells]
    size = np.ptp(mesh.points, axis=0).max()
    for i in range(parts):
        mine = points[homes == i]
        if len(mine) <= mesh.dim or np.linalg.matrix_rank((mine - mine.mean(axis=0)) / size, tol=1e-6) < mesh.dim:
            where = "" if parts == 1 else f" in one of its {parts} separate parts ({np.sum(part == i):,} cells)"
            flat = "line" if mesh.dim == 2 else "plane"
            raise MeshError(
                f"{name}: biharmonic coordinates need {mesh.dim + 1} or more coarse vertices that do not lie in a"
                f" {flat}, and find {len(mine)}{where}; give the coarser level more vertices or use --prolongation"
                " barycentric"
            )


def flux_laplacian(mesh: LevelMesh) -> sp.csr_matrix:
    """L: (inner facets, n) [m^(d-2)]."""
    cells, opposite = mesh.inner_facets
    gradients = mesh.hat_gradients[cells]
    # A facet's area vector, into the cell, is d |cell| grad phi_opposite.
    area = (
        mesh.dim
        * mesh.volumes[cells][..., None]
        * np.take_along_axis(gradients, opposite[..., None, None], axis=2)[:, :, 0]
    )
    flux = (gradients @ area[..., None])[..., 0]
    rows = np.broadcast_to(np.arange(len(cells))[:, None, None], flux.shape)
    return sp.csr_matrix(
        (flux.ravel(), (rows.ravel(), mesh.cells[cells].ravel())), shape=(len(cells), len(mesh.points))
    )


def squared_laplacian(mesh: LevelMesh) -> sp.csr_matrix:
    """A: (n, n) [m^(d-4)], symmetric and positive semi-definite."""
    laplacian = flux_laplacian(mesh)
    masses = mesh.volumes[mesh.inner_facets[0]].sum(axis=1) / (mesh.dim + 1)
    return (laplacian.T @ sp.diags(1.0 / masses) @ laplacian).tocsr()


def make_local(
    columns: Iterable[np.ndarray], home: sp.csr_matrix, coarse: np.ndarray, fine: np.ndarray
) -> sp.csr_matrix:
    """Sparse weights (n, m), exact on affine fields, from blocks (n, k) of the columns of dense ones.

    Parameters
    ----------
    columns : blocks, from the first column to the last
    home : (n, m) barycentric weights in home cells; only its pattern counts
    coarse, fine : (m, d), (n, d) rest positions [m]
    """
    # Even if all m weights of a row are below this, their sum is a fifth of what may be dropped.
    noise = 0.2 * DROPPED / home.shape[1]
    weights = sp.hstack([sp.csc_matrix(np.where(np.abs(block) > noise, block, 0.0)) for block in columns], format="csr")
    return restore_affine(_with_pattern(_drop_small(weights, 0.8 * DROPPED), home), coarse, fine)


def _drop_small(weights: sp.csr_matrix, budget: float) -> sp.csr_matrix:
    """Without each row's smallest weights, of absolute sum at most `budget`."""
    row, size = np.repeat(np.arange(weights.shape[0]), np.diff(weights.indptr)), np.abs(weights.data)
    smallest_kept = np.zeros(weights.shape[0])
    for threshold in _THRESHOLDS:
        smallest_kept[np.bincount(row, size * (size < threshold), minlength=weights.shape[0]) <= budget] = threshold
    kept = size >= smallest_kept[row]
    indptr = np.concatenate([[0], np.cumsum(np.bincount(row[kept], minlength=weights.shape[0]))])
    return sp.csr_matrix((weights.data[kept], weights.indices[kept], indptr), shape=weights.shape)


def _with_pattern(weights: sp.csr_matrix, pattern: sp.csr_matrix) -> sp.csr_matrix:
    """The same weights with explicit zeros where only `pattern` has entries."""
    a, b = weights.tocoo(), pattern.tocoo()
    values, rows, columns = np.r_[a.data, np.zeros(b.nnz)], np.r_[a.row, b.row], np.r_[a.col, b.col]
    return sp.coo_matrix((values, (rows, columns)), shape=weights.shape).tocsr()


def restore_affine(weights: sp.csr_matrix, coarse: np.ndarray, fine: np.ndarray) -> sp.csr_matrix:
    """The closest weights of the same pattern, row by row in least squares, whose rows sum to one and take coarse to
    fine points.

    The coarse vertices of each row must span space.
    """
    row = np.repeat(np.arange(weights.shape[0]), np.diff(weights.indptr))
    reach = np.ptp(coarse, axis=0).max() / len(coarse) ** (1.0 / coarse.shape[1])
    # Relative to the fine point: all that must come out of a row is a one and zeros.
    affine = [np.ones(len(row)), *((coarse[weights.indices] - fine[row]) / reach).T]
    row_sums = lambda values: np.add.reduceat(values, weights.indptr[:-1])
    gram = np.array([[row_sums(a * b) for b in affine] for a in affine]).transpose(2, 0, 1)
    missing = -np.array([row_sums(weights.data * a) for a in affine]).T
    missing[:, 0] += 1.0
    factors = np.linalg.solve(gram, missing[..., None])[..., 0]
    change = sum(factors[row, k] * a for k, a in enumerate(affine))
    restored = sp.csr_matrix(
        (weights.data + change, weights.indices.copy(), weights.indptr.copy()), shape=weights.shape
    )
    restored.eliminate_zeros()
    return restored
