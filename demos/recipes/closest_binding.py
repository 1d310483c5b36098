"""The naive baseline of bindings, with which demos and tests compare."""

import numpy as np

from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.binding import CLOSEST, INSIDE, Binding
from pdvol.levels.locate import behind_nearest_facets, containing_cells
from pdvol.levels.space import LevelSpace


def closest_binding(target: LevelSpace | LevelMesh, source: LevelSpace) -> Binding:
    """As `pdvol.levels.binding.bind`, but points outside go to the Euclidean-closest cell of their body. Collective."""
    target = target.mesh if isinstance(target, LevelSpace) else target
    inside = containing_cells(target.points, target.point_bodies, source)
    cells, _ = behind_nearest_facets(source.mesh, target.points, target.point_bodies, inside)
    kind = np.where(inside < 0, CLOSEST, INSIDE).astype(np.int8)
    return Binding(cells, kind, source.mesh.coordinates(cells, target.points))
