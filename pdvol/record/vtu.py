"""One level at rest as a VTU file, for ParaView."""

from collections.abc import Mapping
from pathlib import Path

import meshio
import numpy as np

from pdvol.hierarchy.level_mesh import LevelMesh


def write_vtu(path: Path, mesh: LevelMesh, point_data: Mapping[str, np.ndarray]) -> None:
    """Writes points (zero-padded in 2D), cells with `body` and `region`, and point data."""
    points = np.pad(mesh.points, ((0, 0), (0, 3 - mesh.dim)))
    kind = {2: "triangle", 3: "tetra"}[mesh.dim]
    cell_data = {"body": [mesh.bodies], "region": [mesh.regions]}
    meshio.Mesh(points, [(kind, mesh.cells)], point_data=dict(point_data), cell_data=cell_data).write(path)
