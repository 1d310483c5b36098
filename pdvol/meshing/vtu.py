"""Levels at rest, and primitives that are at fault, as VTU files for ParaView."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import meshio
import numpy as np

from pdvol.geometry.level_mesh import LevelMesh


def write_vtu(
    path: Path, mesh: LevelMesh, point_data: Mapping[str, np.ndarray], cell_data: Mapping[str, np.ndarray] | None = None
) -> None:
    """Writes points (zero-padded in 2D), cells with `body` and `region`, and more data of points and cells."""
    points = np.pad(mesh.points, ((0, 0), (0, 3 - mesh.dim)))
    kind = {2: "triangle", 3: "tetra"}[mesh.dim]
    cells = {
        "body": [mesh.bodies],
        "region": [mesh.regions],
        **{name: [values] for name, values in (cell_data or {}).items()},
    }
    meshio.Mesh(points, [(kind, mesh.cells)], point_data=dict(point_data), cell_data=cells).write(path)


def write_primitives(path: Path, primitives: Sequence[np.ndarray], numbers: Sequence[int]) -> None:
    """Writes vertices, edges and triangles by their corners (k, d) [m], each with a `defect` number."""
    kinds = {1: "vertex", 2: "line", 3: "triangle"}
    points, blocks, data, first = [], [], [], 0
    for size, kind in kinds.items():
        chosen = [i for i, corners in enumerate(primitives) if len(corners) == size]
        if chosen:
            corners = np.concatenate([primitives[i] for i in chosen])
            points.append(np.pad(corners, ((0, 0), (0, 3 - corners.shape[1]))))
            blocks.append((kind, first + np.arange(len(corners)).reshape(-1, size)))
            data.append(np.array([numbers[i] for i in chosen]))
            first += len(corners)
    meshio.Mesh(np.concatenate(points), blocks, cell_data={"defect": data}).write(path)
