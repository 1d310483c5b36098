"""A start that is given on a mesh: where the vertices of a body are at t = 0, as another run has left them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pdvol.scene.checks import keep_plain, positive, require
from pdvol.scene.point_caches import kept_array
from pdvol.scene.representation import one_line


@dataclass(frozen=True, eq=False)
class Posed:
    """Vertices of a mesh at rest, and where they are at t = 0: the `start` of a `Body` on all of its levels.

    A level's vertices follow the cell that they lie in at rest, or that is nearest to them, by its linear map. So the
    mesh may be that of any level, or another one of the same shape. A stored state of an earlier run is given by
    `Posed(level.rest, level.cells, level.positions(step))`, and one of its bodies by a part of the cells.

    Attributes
    ----------
    rest : (n, d) [m]
        Rest positions in the scene, as placed.
    cells : (m, d + 1) triangles or tetrahedra; vertices of none are left out
    positions : (n, d) [m]
        Where the same vertices are at t = 0.
    tolerance : how far a vertex of a level may be from the mesh, as a fraction of its diagonal
    """

    rest: np.ndarray | Sequence
    cells: np.ndarray | Sequence
    positions: np.ndarray | Sequence
    tolerance: float = 0.05
    __repr__ = one_line

    def __post_init__(self) -> None:
        keep_plain(self, "tolerance")
        positive("Posed.tolerance", self.tolerance)
        for name, dtype in (("rest", None), ("positions", None), ("cells", np.int64)):
            object.__setattr__(self, name, kept_array(f"Posed.{name}", getattr(self, name), dtype))
        rest, cells, positions = np.asarray(self.rest), np.asarray(self.cells), np.asarray(self.positions)
        require(
            rest.ndim == 2 and rest.shape[1] in (2, 3) and rest.shape == positions.shape,
            f"Posed.rest and positions have the shapes {rest.shape} and {positions.shape}; give (n, 2) or (n, 3)",
        )
        require(
            bool(np.isfinite(rest).all() and np.isfinite(positions).all()),
            "Posed.rest or positions has NaN or infinity",
        )
        require(
            cells.ndim == 2 and len(cells) > 0 and cells.shape[1] == rest.shape[1] + 1,
            f"Posed.cells has the shape {cells.shape}; give (m, {rest.shape[1] + 1}), as triangles in 2D or tetrahedra",
        )
        require(
            bool(cells.min() >= 0 and cells.max() < len(rest)),
            f"Posed.cells names vertices from {cells.min()} to {cells.max()}; there are 0 to {len(rest) - 1}",
        )
