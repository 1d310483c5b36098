"""What to simulate: frozen dataclasses that know nothing of meshes' levels, solvers or files' formats.

Absent physics is an absent element: a scene without `contact` has no barrier, one without a `Friction` lags nothing. Units are SI;
lengths marked `Relative` are fractions of the scene's diagonal, so that they mean the same on every level (design, section 5).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path

import numpy as np

from pdvol.errors import InputError
from pdvol.forms import elasticity
from pdvol.meshes import Outline, Solid, Surface

Vector = Sequence[float]
Shape = str | Path | Outline | Surface | Solid


def _require(condition: bool, message: str) -> None:
    if not condition:
        raise InputError(message)


def _finite(name: str, value, lowest=-np.inf) -> None:
    number = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    _require(number and np.isfinite(value), f"{name} = {value!r} is not a finite number")
    _require(value >= lowest, f"{name} = {value!r} is below {lowest:g}")


def _positive(name: str, value) -> None:
    _finite(name, value)
    _require(value > 0, f"{name} = {value!r} must be positive")


def _vector(name: str, value) -> None:
    _require(np.ndim(value) == 1 and len(value) in (2, 3), f"{name} = {value!r} must have two or three components")
    for component in value:
        _finite(name, component)


def _tuple(name: str, value) -> None:
    _require(isinstance(value, (tuple, list)), f"{name} must be a tuple, as in {name}=(..., ), not {type(value).__name__}")


def _count(name: str, value, lowest: int) -> None:
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    _require(whole and value >= lowest, f"{name} = {value!r} is not a whole number >= {lowest}")


@dataclass(frozen=True)
class Relative:
    """A length (or speed) given as a fraction of the scene's diagonal (per second)."""

    fraction: float

    def __post_init__(self):
        _positive("Relative.fraction", self.fraction)


Length = float | Relative


def metres(length: Length, diagonal: float) -> float:
    """A length in metres (or a speed in m/s), given the scene's diagonal [m]."""
    return length.fraction * diagonal if isinstance(length, Relative) else float(length)


def _length(name: str, value) -> None:
    if not isinstance(value, Relative):
        _positive(name, value)


# ---- materials: one UFL function in forms/ and one dataclass each ------------------------------------------------------------


@dataclass(frozen=True)
class Material:
    """Isotropic hyperelastic material; a law overrides `psi`.

    Attributes
    ----------
    young : float [Pa], poisson : float, density : float [kg/m^3] ([kg/m^2] per metre of depth in 2D, which is plane strain)
    """

    young: float
    poisson: float = 0.4
    density: float = 1000.0

    def __post_init__(self):
        name = type(self).__name__
        _positive(f"{name}.young", self.young)
        _positive(f"{name}.density", self.density)
        _finite(f"{name}.poisson", self.poisson)
        _require(-1.0 < self.poisson < 0.5, f"{name}.poisson = {self.poisson!r} must lie between -1 and 0.5 (0.499 is the stiffest in use)")

    @property
    def mu(self) -> float:
        """Shear modulus [Pa]."""
        return self.young / (2.0 * (1.0 + self.poisson))

    @property
    def lmbda(self) -> float:
        """First Lame parameter [Pa]."""
        return self.young * self.poisson / ((1.0 + self.poisson) * (1.0 - 2.0 * self.poisson))

    @staticmethod
    def psi(F, mu, lmbda):
        """Energy density [Pa] of the deformation gradient F, as UFL."""
        raise InputError("a material must define psi(F, mu, lmbda); use NeoHookean or your own subclass of Material")


@dataclass(frozen=True)
class NeoHookean(Material):
    """Compressible Neo-Hookean law with a logarithmic volume term: infinite energy at zero volume."""

    psi = staticmethod(elasticity.neo_hookean)


# ---- motions of supports and obstacles: callables (X, t) -> x ----------------------------------------------------------------


@dataclass(frozen=True)
class Still:
    """No motion."""

    def __call__(self, X: np.ndarray, t: float) -> np.ndarray:
        return X


@dataclass(frozen=True)
class Translation:
    """Constant velocity [m/s], until `stop` [s]."""

    velocity: tuple[float, ...]
    stop: float = np.inf

    def __call__(self, X: np.ndarray, t: float) -> np.ndarray:
        return X + min(t, self.stop) * np.asarray(self.velocity, dtype=float)


@dataclass(frozen=True)
class Rotation:
    """Constant angular speed [rad/s] about an axis through a centre, until `stop` [s]. In 2D the axis is the plane's normal."""

    speed: float
    centre: tuple[float, ...]
    axis: tuple[float, ...] = (0.0, 0.0, 1.0)
    stop: float = np.inf

    def __call__(self, X: np.ndarray, t: float) -> np.ndarray:
        turn = rotation_matrix(self.speed * min(t, self.stop), self.axis, X.shape[1])
        return (X - np.asarray(self.centre, dtype=float)) @ turn.T + np.asarray(self.centre, dtype=float)


Motion = Callable[[np.ndarray, float], np.ndarray]


def rotation_matrix(angle: float, axis: Vector, dim: int) -> np.ndarray:
    """Rotation by `angle` [rad], shape (dim, dim); Rodrigues' formula in 3D."""
    c, s = np.cos(angle), np.sin(angle)
    if dim == 2:
        return np.array([[c, -s], [s, c]])
    n = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    K = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
    return np.eye(3) + s * K + (1 - c) * K @ K


# ---- what there is -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Placement:
    """Scale, then rotate by `angle` [rad] about `axis` through the origin, then translate [m]."""

    translate: tuple[float, ...] = ()
    angle: float = 0.0
    axis: tuple[float, ...] = (0.0, 0.0, 1.0)
    scale: float = 1.0

    def __post_init__(self):
        _positive("Placement.scale", self.scale)
        _finite("Placement.angle", self.angle)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        dim = points.shape[1]
        moved = self.scale * points @ rotation_matrix(self.angle, self.axis, dim).T
        if len(self.translate) == 0:
            return moved
        _require(len(self.translate) == dim, f"Placement.translate has {len(self.translate)} components in a {dim}D scene")
        return moved + np.asarray(self.translate, dtype=float)


@dataclass(frozen=True)
class Body:
    """A deformable body.

    Attributes
    ----------
    shape : path of a surface or volume mesh, `Outline`, `Surface`, `Solid`; or a tuple of them, one per level, taken as they are
    material : Material
    vertices : vertex targets, coarsest level first; left empty where `shape` lists the levels
    name : str
    placement : Placement
    velocity : initial velocity [m/s]
    spin : initial angular velocity [rad/s] about the body's centre of mass: a number in 2D, three in 3D
    """

    shape: Shape | tuple[Shape, ...]
    material: Material
    vertices: tuple[int, ...] = ()
    name: str = "body"
    placement: Placement = Placement()
    velocity: tuple[float, ...] = ()
    spin: float | tuple[float, ...] = ()

    def __post_init__(self):
        listed = isinstance(self.shape, (tuple, list))
        _require(isinstance(self.material, Material), f"body {self.name!r}: material must be a Material, not {type(self.material).__name__}")
        if listed:
            _require(len(self.vertices) == 0, f"body {self.name!r}: vertex targets make no sense for a list of meshes; leave vertices empty")
            _require(len(self.shape) > 0, f"body {self.name!r}: the list of meshes is empty")
        else:
            _require(len(self.vertices) > 0, f"body {self.name!r}: give vertices=(coarsest, ..., finest), one target per level")
            for v in self.vertices:
                _require(isinstance(v, (int, np.integer)) and v >= 4, f"body {self.name!r}: vertex target {v!r} is not a whole number of at least 4")
            _require(list(self.vertices) == sorted(self.vertices), f"body {self.name!r}: vertex targets {self.vertices} must go from coarse to fine")
        for value in (*np.ravel(self.velocity), *np.ravel(self.spin)):
            _finite(f"body {self.name!r}: velocity or spin", float(value))

    @property
    def levels(self) -> int:
        """How many levels this body has."""
        return len(self.shape) if isinstance(self.shape, (tuple, list)) else len(self.vertices)

    def initial_velocity(self, points: np.ndarray, centre: np.ndarray) -> np.ndarray:
        """Velocity field [m/s] at `points` (n, d) of a body with centre of mass `centre` (d,)."""
        dim = points.shape[1]
        v = np.zeros_like(points)
        if len(self.velocity):
            _require(len(self.velocity) == dim, f"body {self.name!r}: velocity has {len(self.velocity)} components in a {dim}D scene")
            v += np.asarray(self.velocity, dtype=float)
        spin = np.ravel(np.asarray(self.spin, dtype=float))
        if spin.size:
            _require(spin.size == (1 if dim == 2 else 3), f"body {self.name!r}: spin has {spin.size} components in a {dim}D scene")
            r = points - centre
            v += spin[0] * np.column_stack([-r[:, 1], r[:, 0]]) if dim == 2 else np.cross(spin, r)
        return v


@dataclass(frozen=True)
class Plane:
    """A rigid half-space: the side that `normal` points to is free."""

    point: tuple[float, ...]
    normal: tuple[float, ...]
    motion: Motion = Still()
    name: str = "plane"

    def __post_init__(self):
        _vector(f"plane {self.name!r}: point", self.point)
        _vector(f"plane {self.name!r}: normal", self.normal)
        _require(len(self.point) == len(self.normal), f"plane {self.name!r}: point and normal differ in length")
        _require(np.linalg.norm(self.normal) > 0, f"plane {self.name!r}: the normal is zero")


@dataclass(frozen=True)
class Rigid:
    """A rigid obstacle: a surface (3D), a closed outline or an open polyline (2D); the path of a surface file will do."""

    shape: str | Path | Outline | Surface
    placement: Placement = Placement()
    motion: Motion = Still()
    name: str = "obstacle"
    closed: bool = True


@dataclass(frozen=True)
class Support:
    """Vertices whose positions are prescribed.

    Attributes
    ----------
    where : function of rest positions (n, d) giving a mask (n,)
    body : name of the body it applies to; all bodies when empty
    motion : callable (X, t) -> x; Still() fixes them
    """

    where: Callable[[np.ndarray], np.ndarray]
    body: str = ""
    motion: Motion = Still()


@dataclass(frozen=True)
class Gravity:
    """A uniform acceleration [m/s^2]."""

    acceleration: tuple[float, ...]

    def __post_init__(self):
        _vector("Gravity.acceleration", self.acceleration)


@dataclass(frozen=True)
class Barrier:
    """Contact without interpenetration: the area-weighted, convergent barrier (Li et al. 2023).

    Attributes
    ----------
    dhat : distance [m] at which contact begins to push
    stiffness : barrier stiffness as a fraction of the softest Young's modulus
    ccd : "additive", or "tight-inclusion": certified in exact arithmetic and many times slower
    """

    dhat: Length = Relative(1e-3)
    stiffness: float = 0.1
    ccd: str = "additive"

    def __post_init__(self):
        _length("Barrier.dhat", self.dhat)
        _positive("Barrier.stiffness", self.stiffness)
        _require(self.ccd in ("additive", "tight-inclusion"), f"Barrier.ccd = {self.ccd!r} must be additive or tight-inclusion")


@dataclass(frozen=True)
class Friction:
    """Coulomb friction, smoothed below the sliding speed `eps_v` [m/s] and lagged (Li et al. 2020)."""

    mu: float
    eps_v: Length = Relative(1e-3)
    iterations: int = 1

    def __post_init__(self):
        _finite("Friction.mu", self.mu, 0.0)
        _length("Friction.eps_v", self.eps_v)
        _count("Friction.iterations", self.iterations, 1)


@dataclass(frozen=True)
class Solver:
    """How each incremental potential is minimised.

    Attributes
    ----------
    tolerance : speed [m/s]: Newton stops when its full step is nowhere faster
    max_iterations : Newton iterations allowed per solve
    max_halvings : how often a step may be halved before the run stops
    linear : "auto", or "iterative", "multilevel" or "direct"
    accuracy : relative error of an iterative linear solve, in the energy norm
    petsc : extra PETSc options, for example "-ksp_rtol 1e-6"
    """

    tolerance: Length = Relative(1e-3)
    max_iterations: int = 200
    max_halvings: int = 6
    linear: str = "auto"
    accuracy: float = 3e-3
    petsc: str = ""

    def __post_init__(self):
        _length("Solver.tolerance", self.tolerance)
        _count("Solver.max_iterations", self.max_iterations, 1)
        _count("Solver.max_halvings", self.max_halvings, 0)
        _require(self.max_halvings <= 20, f"Solver.max_halvings = {self.max_halvings!r} must be at most 20")
        _require(isinstance(self.petsc, str), f'Solver.petsc = {self.petsc!r} must be text, as in "-ksp_rtol 1e-6"')
        _require(self.linear in ("auto", "iterative", "multilevel", "direct"),
                 f"Solver.linear = {self.linear!r} must be auto, iterative, multilevel or direct")
        _positive("Solver.accuracy", self.accuracy)
        _require(self.accuracy <= 0.1, f"Solver.accuracy = {self.accuracy!r} must be at most 0.1")


@dataclass(frozen=True)
class Scene:
    """A shot. Everything below is described once, for all levels."""

    bodies: tuple[Body, ...]
    dt: float
    steps: int
    loads: tuple[Gravity, ...] = ()
    supports: tuple[Support, ...] = ()
    obstacles: tuple[Plane | Rigid, ...] = ()
    contact: tuple[Barrier | Friction, ...] = ()
    solver: Solver = field(default_factory=Solver)
    name: str = "scene"

    def __post_init__(self):
        _positive("dt", self.dt)
        _count("steps", self.steps, 0)
        for name in ("bodies", "loads", "supports", "obstacles", "contact"):
            _tuple(name, getattr(self, name))
        _require(len(self.bodies) > 0, "a scene needs at least one body")
        names = [b.name for b in self.bodies]
        _require(len(set(names)) == len(names), f"bodies must have different names, not {names}")
        counts = {b.levels for b in self.bodies}
        _require(len(counts) == 1, f"all bodies need the same number of levels, not {sorted(counts)}")
        for s in self.supports:
            _require(s.body in ("", *names), f"a support names the body {s.body!r}; there are {names}")
        for kind in (Barrier, Friction):
            _require(sum(isinstance(c, kind) for c in self.contact) <= 1, f"contact names more than one {kind.__name__}")
        if any(isinstance(c, Friction) for c in self.contact) or self.obstacles:
            _require(any(isinstance(c, Barrier) for c in self.contact), "friction and obstacles need contact=(Barrier(), ...)")

    @property
    def levels(self) -> int:
        """How many levels the scene has."""
        return self.bodies[0].levels

    def with_solver(self, **settings) -> "Scene":
        """The same scene with some solver settings replaced."""
        known = {f.name for f in fields(Solver)}
        unknown = set(settings) - known
        _require(not unknown, f"unknown solver setting {sorted(unknown)}; there are {sorted(known)}")
        return replace(self, solver=replace(self.solver, **settings))
