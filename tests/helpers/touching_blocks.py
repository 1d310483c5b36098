"""Two blocks that nearly touch each other and what is below them."""

import numpy as np
from mpi4py import MPI

from pdvol.levels.obstacles import plane_obstacle
from pdvol.levels.script import Obstacle
from pdvol.levels.space import LevelSpace
from pdvol.potentials.contact.barrier import ContactBarrier
from pdvol.potentials.contact.candidates import Candidates
from pdvol.potentials.contact.surface import ContactSurface
from pdvol.scene import Plane
from problems import block, polyline, tetrahedron
from shapes import box, together

DHAT, KAPPA = 0.05, 0.3


def touching(d, ground):
    """The space and the barrier of two blocks, the upper one 0.4 dhat above the lower one, which is as far above a
    plane or an obstacle's tip.
    """
    lower = box(d, 2, jitter=0.05, seed=1)
    top, bottom = lower.points[:, -1].max() + 0.4 * DHAT, lower.points[:, -1].min() - 0.4 * DHAT
    upper = block((0.13,) * (d - 1) + (top,), (0.71,) * (d - 1) + (top + 0.4,), (2,) * (d - 1) + (1,))
    if ground == "plane":
        obstacle = plane_obstacle(Plane((0.0,) * (d - 1) + (bottom,), tuple(np.eye(d)[-1])))
    elif d == 2:
        tip = polyline([[-1.0, bottom - 1.0], [3.0, bottom - 1.0], [0.41, bottom]])
        obstacle = Obstacle("tip", "polyline", *tip)
    else:
        foot = [[-1.0, -1.0, bottom - 1.0], [3.0, 0.0, bottom - 1.0], [0.0, 3.0, bottom - 1.0]]
        obstacle = Obstacle("tip", "mesh", *tetrahedron([*foot, [0.37, 0.41, bottom]]))
    space = LevelSpace(together(lower, upper), MPI.COMM_SELF)
    return space, ContactBarrier(Candidates(ContactSurface(space, (obstacle,)), DHAT), KAPPA)
