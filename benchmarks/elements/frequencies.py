"""Free vibrations: squared angular frequencies of meshes with linear and with smoothed elements."""

import numpy as np
import ufl
from mpi4py import MPI
from scipy.sparse import bsr_array, csc_array, csr_array, diags_array
from scipy.sparse.linalg import eigsh

from benchmarks.common.process import REPOSITORY
from pdvol import compat
from pdvol.compat import fem
from pdvol.geometry.level_mesh import LevelMesh, lumped_masses
from pdvol.levels.materials import cell_materials
from pdvol.levels.space import LevelSpace
from pdvol.meshes import brick
from pdvol.meshing.build import build_levels
from pdvol.potentials.assembly.hessian_blocks import BlockPattern, HessianBlocks
from pdvol.potentials.elasticity import elastic_terms
from pdvol.potentials.potential import Positions
from pdvol.registry import ELEMENTS
from pdvol.runs.scene_file import load_shot
from pdvol.scene import Body, Material, NeoHookean, Scene

RIGID, LOWEST = 6, 6
"""Modes of a free body that cost nothing, and modes above them that are compared."""
BAR, BAR_MATERIAL = (1.0, 0.25, 0.25), NeoHookean(2e4, 0.4, 1000.0)
"""Sides [m] and material of the bar."""
TRUTH = 4
"""Quadratic elements through the thickness of the bar that stands for the truth."""


def apes() -> list[dict]:
    """Of each level of demos/ape.py: vertices, blocks of the matrix with linear and with smoothed elements, and their
    lowest squared frequencies over those of the finest level's smoothed elements.
    """
    scene = load_shot(REPOSITORY / "demos" / "ape.py").scene
    levels = [
        {kind: vibrations(mesh, scene.bodies[0].material, kind) for kind in ELEMENTS} | {"vertices": len(mesh.points)}
        for mesh in build_levels(scene)
    ]
    best = levels[-1]["smoothed"][0]
    return [
        {
            "vertices": level["vertices"],
            **{kind: (level[kind][0] / best).tolist() for kind in ELEMENTS},
            "nonzeros": level["smoothed"][2] / level["linear"][2],
        }
        for level in levels
    ]


def bars(through: tuple[int, ...]) -> list[dict]:
    """Of each bar, with so many cells through its thickness: the squared frequencies of bending and torsion, over those
    of quadratic elements. Masses are consistent: lumped ones at the surface would turn more slowly by themselves.
    """
    bent, twisted = named_modes(*quadratic(bar(TRUTH)))
    rows = []
    for cells in through:
        mesh, row = bar(cells), {"cells": cells}
        for kind in ELEMENTS:
            values, vectors, blocks = vibrations(mesh, BAR_MATERIAL, kind, lumped=False)
            bending, torsion = named_modes(values, vectors, mesh.points)
            row |= {kind: [bending / bent, torsion / twisted], f"blocks {kind}": blocks}
        rows.append({"vertices": len(mesh.points), **row})
    return rows


def bar(through: int) -> LevelMesh:
    """Cubes of six tetrahedra, so many through the thickness."""
    solid = brick(BAR, tuple(round(through * side / BAR[1]) for side in BAR))
    none = np.zeros(len(solid.cells), dtype=np.int32)
    return LevelMesh(solid.vertices, solid.cells, none, none)


def vibrations(
    mesh: LevelMesh, material: Material, elements: str, lumped: bool = True
) -> tuple[np.ndarray, np.ndarray, int]:
    """The lowest squared angular frequencies (LOWEST,) [1/s^2] of a free body, their modes (n, 3, LOWEST), and the
    number of blocks of the matrix.
    """
    scene = Scene((Body(("mesh",), material),), dt=0.01, steps=1, elements=elements)
    space = LevelSpace(mesh, MPI.COMM_SELF)
    materials = cell_materials(scene, mesh)
    terms = elastic_terms(space, materials)
    blocks = HessianBlocks(BlockPattern(space, [domains for term in terms for domains in term.stencils]), "none")
    for term in terms:
        term.add_hessian(Positions(space, space.from_input(mesh.points)), 1.0, blocks)
    starts, columns, values = blocks.merged()
    n = len(mesh.points)
    whole = lambda *rows: csr_array(bsr_array(rows, shape=(3 * n, 3 * n)))
    upper = whole(values, columns, starts)
    stiffness = upper + upper.T - whole(values[starts[:-1]], np.arange(n), np.arange(n + 1))
    masses = np.repeat(space.from_input(lumped_masses(mesh, materials.density)), 3)
    mass = diags_array(masses, format="csc") if lumped else consistent(space.V, material)
    found, vectors = lowest(csc_array(stiffness), mass, material)
    modes = np.empty((n, 3, LOWEST))
    modes[space.owned_points] = vectors.reshape(n, 3, -1)
    return found, modes, 2 * blocks.pattern.count - n


def quadratic(mesh: LevelMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The lowest squared angular frequencies of the bar with quadratic elements and consistent masses, their modes
    (n, 3, LOWEST), and the nodes (n, 3): linear elasticity by dolfinx, apart from pdvol's own.
    """
    domain = compat.create_mesh(MPI.COMM_SELF, mesh.points, mesh.cells, None)
    V = fem.functionspace(domain, ("Lagrange", 2, (3,)))
    u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    strain = lambda w: ufl.sym(ufl.grad(w))
    mu, lmbda = BAR_MATERIAL.mu, BAR_MATERIAL.lmbda
    energy = 2 * mu * ufl.inner(strain(u), strain(v)) + lmbda * ufl.div(u) * ufl.div(v)
    stiffness = csc_array(fem.assemble_matrix(fem.form(energy * ufl.dx)).to_scipy())
    values, vectors = lowest(stiffness, consistent(V, BAR_MATERIAL), BAR_MATERIAL)
    return values, vectors.reshape(-1, 3, LOWEST), V.tabulate_dof_coordinates()


def consistent(V: fem.FunctionSpace, material: Material) -> csc_array:
    """The consistent mass matrix."""
    u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    form = fem.form(material.density * ufl.inner(u, v) * ufl.dx)
    return csc_array(fem.assemble_matrix(form).to_scipy())


def lowest(stiffness: csc_array, mass: csc_array, material: Material) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues above those of rigid motions, ascending, and eigenvectors (3 n, LOWEST)."""
    shift = -0.05 * material.young / material.density  # K alone is singular
    values, vectors = eigsh(stiffness, RIGID + LOWEST, mass, sigma=shift, v0=np.ones(stiffness.shape[0]))
    order = np.argsort(values)[RIGID:]
    return values[order], vectors[:, order]


def named_modes(values: np.ndarray, modes: np.ndarray, points: np.ndarray) -> tuple[float, float]:
    """The squared frequencies of bending, the mean of both directions, and of torsion: of the lowest three modes it is
    the one that turns its ends against each other.
    """
    x, y, z = (points - points.mean(axis=0)).T
    twist = np.sin(np.pi * x / BAR[0])
    turned = np.abs(np.einsum("n,nk->k", -z * twist, modes[:, 1]) + np.einsum("n,nk->k", y * twist, modes[:, 2]))
    torsion = int(np.argmax(turned[:3] / np.linalg.norm(modes[..., :3], axis=(0, 1))))
    return float(np.delete(values[:3], torsion).mean()), float(values[torsion])
