"""Meshes from files of Gmsh, read by Gmsh: all its formats, partitioned meshes, and physical groups that overlap."""

import contextlib
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pdvol.errors import MeshError

if TYPE_CHECKING:
    import meshio


def read_gmsh(path: Path) -> "meshio.Mesh":
    """A mesh of Gmsh, of all files of a partitioned one. Cells are repeated for each of their physical groups. It
    raises MeshError where other parts of a partitioned mesh are missing.
    """
    import meshio

    parts = [_part_of_gmsh(path)]
    tags, points, blocks, partitions, count = parts[0]
    with path.open("rb") as file:
        second = file.read(100).split()[1:2] in ([b"2"], [b"2.0"], [b"2.1"], [b"2.2"])
    if second and not count:  # whose cells have groups each; Gmsh takes all of one entity together
        with contextlib.suppress(Exception, SystemExit):
            return meshio.read(path)
    if len(partitions) == 1:
        (number,) = partitions
        stem, last = path.stem.removesuffix(f"_{number}"), max(count, number)
        while stem != path.stem and path.with_stem(f"{stem}_{last + 1}").is_file():
            last += 1
        others = [path.with_stem(f"{stem}_{k}") for k in range(1, last + 1) if k != number]
        missing = ", ".join(other.name for other in others if not other.is_file())
        if missing:
            raise MeshError(
                f"{path}: part {number} of a mesh that Gmsh has partitioned, without {missing} beside it; give all"
                " parts, or save the mesh in one file"
            )
        parts += [_part_of_gmsh(other) for other in others]
    tags, first = np.unique(np.concatenate([part[0] for part in parts]), return_index=True)
    points = np.concatenate([part[1] for part in parts])[first]
    blocks = [block for part in parts for block in part[2]]
    return meshio.Mesh(
        points,
        [(kind, np.searchsorted(tags, nodes)) for kind, nodes, _, _ in blocks],
        cell_data={
            "gmsh:physical": [np.full(len(nodes), group) for _, nodes, group, _ in blocks],
            "gmsh:geometrical": [np.full(len(nodes), entity) for _, nodes, _, entity in blocks],
        },
        info=[f"its {len(parts)} files are read, as one mesh"] if len(parts) > 1 else None,
    )


def _part_of_gmsh(path: Path) -> tuple[np.ndarray, np.ndarray, list[tuple[str, np.ndarray, int, int]], set[int], int]:
    """Of one file: numbers and coordinates of nodes; kind, nodes, physical group and entity of blocks of cells; the
    partitions that these belong to, and how many the mesh has.
    """
    import gmsh

    with path.open("rb") as file:
        if not file.read(20).startswith((b"$MeshFormat", b"$NOD")):  # Gmsh would run other contents as a script
            raise ValueError("it does not begin as a mesh of Gmsh")
    blocks: list[tuple[str, np.ndarray, int, int]] = []
    partitions: dict[int, set[int]] = {}
    with tempfile.TemporaryDirectory(prefix="pdvol-read-") as folder:
        alone = Path(folder) / "alone.msh"  # Gmsh also runs a script NAME.msh.opt beside a mesh
        alone.symlink_to(path.resolve())
        gmsh.initialize(readConfigFiles=False, interruptible=False)
        try:
            gmsh.option.setNumber("General.Terminal", 0)
            gmsh.merge(str(alone))
            mesh = gmsh.model.mesh
            tags, coordinates, _ = mesh.getNodes(returnParametricCoord=False)
            for dim, entity in (*gmsh.model.getEntities(3), *gmsh.model.getEntities(2)):
                if gmsh.model.getType(dim, entity).startswith("Ghost"):
                    continue
                parent = gmsh.model.getParent(dim, entity)[1]
                groups = gmsh.model.getPhysicalGroupsForEntity(dim, entity).tolist()
                for kind, _, nodes in zip(*mesh.getElements(dim, entity), strict=True):
                    _, _, _, width, _, corners = mesh.getElementProperties(kind)
                    name = {(2, 3): "triangle", (2, 4): "quad", (3, 4): "tetra"}.get((dim, corners), "hexahedron")
                    cells = nodes.reshape(-1, width)
                    blocks += [(name, cells, group, max(parent, entity * (parent < 0))) for group in groups or [0]]
                    partitions.setdefault(dim, set()).update(gmsh.model.getPartitions(dim, entity).tolist())
            mine = partitions.get(3, partitions.get(2, set()))
            return tags, coordinates.reshape(-1, 3), blocks, mine, gmsh.model.getNumberOfPartitions()
        finally:
            gmsh.finalize()


def in_one_group(cells: np.ndarray, labels: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Cells (m, k) and labels (m,), those that are repeated for each of their groups once: with the label of the
    smallest group. Notes say which groups lose cells by it.
    """
    _, which = np.unique(np.sort(cells, axis=1), axis=0, return_inverse=True)
    which = which.ravel()
    names, index, counts = np.unique(labels, return_inverse=True, return_counts=True)
    order = np.lexsort((labels, counts[index], which))
    _, first = np.unique(which[order], return_index=True)
    kept = labels == labels[order[first]][which]
    lost = np.bincount(index[~kept], minlength=len(names))
    note = "cells in several physical groups have the label of the smallest: group {} keeps {:,} of its {:,} cells"
    notes = [note.format(names[k], counts[k] - lost[k], counts[k]) for k in np.flatnonzero(lost)]
    return np.ascontiguousarray(cells[kept]), labels[kept], notes
