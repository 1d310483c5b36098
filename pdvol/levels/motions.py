"""What moves vertices on a level: the scene's own motions, and point caches, which are read."""

import numpy as np

from pdvol.scene import Motion, PointCache


def motion_of(motion: Motion | PointCache, vertices: np.ndarray, whose: str) -> Motion:
    """The motion of vertices (n, d) at rest [m]; those that a point cache moves are matched to its first frame.

    Raises
    ------
    InputError
        As `pdvol.levels.animated.cached_motion`, which names the vertices by `whose`.
    """
    if not isinstance(motion, PointCache):
        return motion
    from pdvol.levels.animated import cached_motion  # loads libigl and SciPy's transforms, which few scenes need

    return cached_motion(motion, vertices, whose)
