"""A shot as plain data, in metres and seconds, z upward: what Blender has, and what the scene file will say."""

from dataclasses import dataclass

import numpy as np


class ShotError(Exception):
    """A mistake of the user: one line that says what, where, and what mends it."""


@dataclass(frozen=True)
class Material:
    """As `pdvol.NeoHookean`: young [Pa], poisson, density [kg/m^3], damping [s]."""

    young: float
    poisson: float
    density: float
    damping: float


PRESETS = {
    "JELLY": ("Jelly", Material(1.0e4, 0.45, 1050.0, 0.005)),
    "MEAT": ("Meat", Material(4.0e4, 0.45, 1060.0, 0.02)),
    "SPONGE": ("Sponge", Material(6.0e4, 0.1, 120.0, 0.02)),
    "RUBBER": ("Rubber", Material(1.0e6, 0.47, 1100.0, 0.002)),
}
"""Materials by name, softest first: gelatine, relaxed muscle, foam, soft rubber."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A surface.

    Attributes
    ----------
    points : (n, 3) [m]
    counts, corners : (f,) and (sum of counts,) int
        How many corners each polygon has, and the corners of all.
    """

    points: np.ndarray
    counts: np.ndarray
    corners: np.ndarray

    @property
    def closed(self) -> bool:
        """Whether each edge has a face on either side."""
        ends = np.cumsum(self.counts)
        following = np.arange(1, len(self.corners) + 1)
        following[ends - 1] = ends - self.counts
        edges = np.sort(np.column_stack([self.corners, self.corners[following]]), axis=1)
        return bool((np.unique(edges, axis=0, return_counts=True)[1] == 2).all()) if len(edges) else False


@dataclass(frozen=True, eq=False)
class Group:
    """A vertex group of a body: a weight, 0 to 1, for each vertex of its shape."""

    name: str
    weights: np.ndarray


@dataclass(frozen=True, eq=False)
class Pin:
    """A group that is held, or led by the body's own animation. `reach` is a fraction of the shape's diagonal."""

    group: Group
    reach: float


@dataclass(frozen=True, eq=False)
class Region:
    """A group that is made of something else."""

    group: Group
    material: Material


@dataclass(frozen=True, eq=False)
class Pull:
    """An object that a body is drawn to.

    Attributes
    ----------
    where : (3,) [m], on the body's shape
    first : frames from t = 0 to its beginning
    points : (k, 3) [m], where the object is at that frame and those after it, up to its end
    """

    where: np.ndarray
    first: int
    points: np.ndarray


@dataclass(frozen=True, eq=False)
class Body:
    """A soft body.

    Attributes
    ----------
    name : of letters, digits and underscores (`names.plain_names`)
    label : its name in Blender
    shape : what the 3D view shows at t = 0: it is simulated, and drawn there
    rendered : the mesh of renders, where that has other vertices than the shape; it follows, too
    motion : (k, n, 3) [m], the shape at the end of each step, from t = 0 on; None where it has no animation
    vertices : of each level, coarsest first
    velocity : (3,) [m/s] at t = 0
    repair : whether the shape is to be closed before
    hole : longest rim of a hole that is closed then, in diagonals
    """

    name: str
    label: str
    shape: Mesh
    rendered: Mesh | None
    motion: np.ndarray | None
    material: Material
    vertices: tuple[int, ...]
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pins: tuple[Pin, ...] = ()
    regions: tuple[Region, ...] = ()
    repair: bool = False
    hole: float = 1.0
    pull: Pull | None = None


@dataclass(frozen=True, eq=False)
class Obstacle:
    """What bodies cannot enter; `motion` as of a `Body`."""

    name: str
    label: str
    shape: Mesh
    motion: np.ndarray | None


@dataclass(frozen=True, eq=False)
class Shot:
    """A shot.

    Attributes
    ----------
    source : name of the .blend file
    ground : height [m] of a horizontal plane; None without one
    gravity : (3,) [m/s^2]; None without it
    friction : coefficient; zero leaves friction out
    fps : frames a second
    frames : how many there are after the first one
    steps_a_frame : time steps from one frame to the next
    first_frame : that of t = 0, for the reader of the scene file
    """

    source: str
    bodies: tuple[Body, ...]
    obstacles: tuple[Obstacle, ...] = ()
    ground: float | None = 0.0
    gravity: tuple[float, float, float] | None = (0.0, 0.0, -9.81)
    friction: float = 0.3
    fps: float = 24.0
    frames: int = 50
    steps_a_frame: int = 2
    first_frame: int = 1
