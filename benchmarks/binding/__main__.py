"""Binding: what snapping would do to the cells of a coarse level, and the weights of Biharmonic Coordinates before and
after small ones are dropped (paper, figures "snapping coarse boundary vertices" and "sparsity and locality").

    ./run python -m benchmarks.binding

It writes the tables of NOTES.md beside this file between their markers, and the pictures of docs/binding.md.
"""

import sys
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from scipy.spatial import cKDTree

from benchmarks.binding.figures import draw_locality, draw_snapping
from benchmarks.common import commits
from benchmarks.common.process import REPOSITORY
from benchmarks.common.study import command
from benchmarks.common.tables import Page, number, table
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.binding import Binding, bind
from pdvol.levels.interpolants.biharmonic import biharmonic_columns, make_local
from pdvol.levels.space import LevelSpace
from pdvol.measure.verify import signed_volumes
from pdvol.meshing.build import build_levels
from pdvol.meshing.tetrahedralise import mean_ratio
from pdvol.runs.scene_file import load_shot

PICTURES = REPOSITORY / "docs" / "pictures"
POOR = 0.1
"""Mean ratio, without a unit, below which a cell counts as poor: half of the worst cell that most levels have."""
SMALL = 1e-3
"""Weight, without a unit, that a displacement of 10 cm at a coarse vertex turns into a tenth of a millimetre."""


@dataclass(frozen=True)
class Pair:
    """A body on two levels of a demo.

    Attributes
    ----------
    demo : file name without its ending
    body : index in the scene
    level : the coarser one
    vertices : targets of the levels, instead of the demo's
    """

    demo: str
    body: int
    level: int
    vertices: tuple[int, ...] = ()

    @cached_property
    def meshes(self) -> tuple[LevelMesh, LevelMesh]:
        """Coarse and fine."""
        settings = {"vertices": self.vertices} if self.vertices else {}
        levels = build_levels(load_shot(REPOSITORY / "demos" / f"{self.demo}.py", settings).scene)
        coarse, fine = (levels[level].body(self.body)[0] for level in (self.level, self.level + 1))
        return coarse, fine

    @property
    def name(self) -> str:
        """The demo, and the levels."""
        levels = f"{self.level} to {self.level + 1}"
        return f"`{self.demo}`, levels {levels}{' of similar size' if self.vertices else ''}"


SIMILAR, SEAHORSE = Pair("extreme_shapes", 1, 0, (260, 330)), Pair("extreme_shapes", 1, 1)
"""The pairs that are drawn: of snapping, and of weights."""
PAIRS = (SIMILAR, SEAHORSE, Pair("slit_array", 0, 6), Pair("drop", 0, 0), Pair("ape", 0, 2))


@command(
    "binding",
    __doc__,
    {"--docs": {"type": Path, "default": Path(__file__).with_name("NOTES.md"), "help": "where tables are kept"}},
)
def main(options) -> None:
    """Runs the command; returns its exit code."""
    page, snapped, local = Page(options.docs, "binding"), [], []
    for pair in PAIRS:
        coarse, fine = pair.meshes
        places = {"boundary": snap(coarse, fine, boundary_only=True), "all": snap(coarse, fine)}
        snapped.append(snapping_row(pair, places))
        weights = all_weights(pair)
        local.append(locality_row(pair, *weights))
        if pair is SIMILAR:
            draw_snapping(PICTURES / "binding_snapping.png", coarse, fine, places)
        if pair is SEAHORSE:
            draw_locality(PICTURES / "binding_locality.png", coarse, fine, *weights)
    tables = f"### Snapping\n\n{table(SNAPPING_HEAD, snapped)}\n\n### Locality\n\n{table(LOCALITY_HEAD, local)}"
    report = f"Measured at commit {commits.Repository(REPOSITORY).head()[:7]}.\n\n{tables}"
    print(report)
    page.write(report)


def snap(coarse: LevelMesh, fine: LevelMesh, boundary_only: bool = False) -> np.ndarray:
    """Positions (m, d) [m] of coarse vertices after each has moved to the nearest fine vertex; with `boundary_only`,
    those of the boundary alone, to the nearest one of the fine boundary.
    """
    targets = fine.points[np.unique(fine.boundary)] if boundary_only else fine.points
    moved = np.unique(coarse.boundary) if boundary_only else np.arange(len(coarse.points))
    snapped = coarse.points.copy()
    snapped[moved] = targets[cKDTree(targets).query(coarse.points[moved])[1]]
    return snapped


SNAPPING_HEAD = ["levels", "vertices", "coarse cells", "worst cell: as made", "boundary snapped", "all snapped"]
SNAPPING_HEAD += [f"cells below {POOR:g}: as made", "boundary snapped", "all snapped"]
SNAPPING_HEAD += ["flat or inverted: boundary snapped", "all snapped", "vertices that meet another one"]


def snapping_row(pair: Pair, places: dict[str, np.ndarray]) -> list[str]:
    """Quality of the coarse cells, by their mean ratio, before and after snapping."""
    coarse, fine = pair.meshes
    qualities = [mean_ratio(points, coarse.cells) for points in (coarse.points, *places.values())]
    flat = [
        int((signed_volumes(points, coarse.cells) < 1e-12 * coarse.volumes.mean()).sum()) for points in places.values()
    ]
    met = len(coarse.points) - len(np.unique(places["all"], axis=0))
    return [
        pair.name,
        f"{len(coarse.points):,} to {len(fine.points):,}",
        f"{len(coarse.cells):,}",
        *(number(float(quality.min()), 2) for quality in qualities),
        *(f"{int((quality < POOR).sum()):,}" for quality in qualities),
        *(f"{count:,}" for count in flat),
        f"{met:,}",
    ]


def all_weights(pair: Pair) -> tuple[sp.csr_matrix, np.ndarray, sp.csr_matrix]:
    """Weights (n, m): barycentric, and those of Biharmonic Coordinates before and after small ones are dropped."""
    coarse, fine = (LevelSpace(mesh, MPI.COMM_SELF) for mesh in pair.meshes)
    home: Binding = bind(fine, coarse)
    barycentric = home.matrix(coarse.mesh)
    whole = np.hstack(list(biharmonic_columns(fine.mesh, bind(coarse, fine), coarse.mesh.points, f"body {pair.body}")))
    return barycentric, whole, make_local([whole], barycentric, coarse.mesh.points, fine.mesh.points)


LOCALITY_HEAD = ["levels", "vertices", "weights a vertex: barycentric", "biharmonic before"]
LOCALITY_HEAD += [f"of these above {SMALL:g}", "biharmonic after", "largest change of a vertex's weights, summed"]
LOCALITY_HEAD += ["distance [coarse edges] within which 99 % of the weights lie: before, after"]
LOCALITY_HEAD += ["affine fields are missed by, after", "rows at coarse vertices miss the identity by: an entry, a row"]


def locality_row(pair: Pair, barycentric: sp.csr_matrix, whole: np.ndarray, local: sp.csr_matrix) -> list[str]:
    """Numbers of weights, and how far they reach."""
    coarse, fine = pair.meshes
    at = bind(*(LevelSpace(mesh, MPI.COMM_SELF) for mesh in pair.meshes)).matrix(fine)
    apart = np.abs((at @ local).toarray() - np.eye(len(coarse.points)))
    missed = np.abs(local @ coarse.points - fine.points).max() / np.ptp(fine.points, axis=0).max()
    return [
        pair.name,
        f"{len(coarse.points):,} to {len(fine.points):,}",
        f"{barycentric.nnz / len(fine.points):.0f}",
        f"{np.count_nonzero(whole) / len(fine.points):,.0f}",
        f"{(np.abs(whole) > SMALL).sum() / len(fine.points):.0f}",
        f"{local.nnz / len(fine.points):.0f}",
        number(float(np.abs(local - whole).sum(axis=1).max()), 2),
        ", ".join(number(reach(weights, coarse, fine), 2) for weights in (whole, local.toarray())),
        f"{missed:.0e}",
        f"{apart.max():.2g}, {apart.sum(axis=1).max():.2g}",
    ]


def reach(weights: np.ndarray, coarse: LevelMesh, fine: LevelMesh, share: float = 0.99) -> float:
    """The distance between fine and coarse vertices, in mean edges of the coarse mesh, within which `share` of the sum
    of all absolute weights lies.
    """
    distances = np.linalg.norm(fine.points[:, None] - coarse.points[None], axis=2).ravel() / mean_edge(coarse)
    order = np.argsort(distances)
    summed = np.cumsum(np.abs(weights).ravel()[order])
    return float(distances[order][np.searchsorted(summed, share * summed[-1])])


def mean_edge(mesh: LevelMesh) -> float:
    """Mean length of the cells' edges [m]."""
    first, second = np.triu_indices(mesh.dim + 1, 1)
    return float(np.linalg.norm(mesh.points[mesh.cells[:, first]] - mesh.points[mesh.cells[:, second]], axis=2).mean())


if __name__ == "__main__":
    sys.exit(main())
