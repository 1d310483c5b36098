"""The description of a simulation: frozen dataclasses, independent of levels' meshes, solvers and file formats.

Physics that is absent is left out: a scene without `contact` has no barrier, one without a `Friction` no friction.
Units are SI; lengths marked `Relative` are fractions of the smallest free body's diagonal, the same on every level
(docs/input.md).
"""

from pdvol.scene.attachments import Attachment, Pull
from pdvol.scene.bodies import Body, Separate, Shape
from pdvol.scene.contact import Barrier, Friction, Pascal
from pdvol.scene.hand import Hand
from pdvol.scene.loads import Flow, Force, Gravity, Impulse, Load, PointForce, Pressure, at_time
from pdvol.scene.materials import FixedCorotational, Material, NeoHookean, Region, StVenantKirchhoff, Value, lame
from pdvol.scene.motions import (
    Led,
    Motion,
    Path,
    Rotation,
    Sequential,
    Still,
    Translation,
    keeps_shape,
    moved,
    rotation_matrix,
    stands,
)
from pdvol.scene.muscles import Muscle
from pdvol.scene.placement import Placement
from pdvol.scene.point_caches import PointCache, Posed, TakeOver
from pdvol.scene.render_mesh import RenderMesh
from pdvol.scene.scene import Scene
from pdvol.scene.solver import Penalty, Solver
from pdvol.scene.surroundings import Deforming, Obstructing, Plane, Rigid, Support
from pdvol.scene.values import Keyed, Length, Relative, Vector, metres
