"""A Hypothesis strategy for small scenes, which combines all features that a scene may have."""

import numpy as np
from hypothesis import strategies as st

import pdvol
from pdvol import (
    Attachment,
    Barrier,
    Body,
    Deforming,
    FixedCorotational,
    Flow,
    Force,
    Friction,
    Gravity,
    Impulse,
    Keyed,
    Muscle,
    NeoHookean,
    Path,
    Placement,
    Plane,
    PointCache,
    PointForce,
    Pressure,
    Region,
    Relative,
    Rigid,
    Rotation,
    Scene,
    Sequential,
    Solid,
    Solver,
    Still,
    StVenantKirchhoff,
    Support,
    Translation,
)
from pdvol.meshes import ball, box, brick, disc, hollow_ball, rectangle
from pdvol.registry import ELEMENTS, INTEGRATORS, INTERPOLANTS, METHODS
from shapes import grid

APART = 0.5  # m between the centres of bodies, whose diagonals are below
ACCURATE = Solver(tolerance=Relative(1e-6), linear="direct", max_iterations=100, max_halvings=4)


def numbers(low: float, high: float):
    """Evenly spread; `floats` prefers zero and other simple ones, with which nothing happens in a scene."""
    return st.integers(0, 1000).map(lambda k: low + (high - low) * k / 1000.0)


def vectors(dim: int, most: float):
    return st.tuples(*[numbers(-most, most)] * dim)


def some(draw, probability: float) -> bool:
    """Simplest, and last in a smaller example, is no."""
    return draw(st.integers(0, 99)) >= 100 * (1.0 - probability)


# ---- bodies


def material(draw, extreme: bool):
    law = draw(st.sampled_from([NeoHookean, FixedCorotational, StVenantKirchhoff]))
    if extreme:
        young, density = 10.0 ** draw(numbers(2.0, 11.0)), 10.0 ** draw(numbers(0.0, 5.0))
        return law(young, draw(st.sampled_from([-0.5, 0.0, 0.3, 0.45, 0.499])), density)
    young = 10.0 ** draw(numbers(4.0, 6.0))
    kind = draw(st.sampled_from(["constant", "field", "keyed"]))
    if kind == "field":
        value = lambda X: young * (1.0 + 0.5 * np.sin(7.0 * X[:, 0]))
    else:
        value = Keyed((0.0, 0.1), (young, 0.5 * young)) if kind == "keyed" else young
    damping = draw(st.sampled_from([0.0, 0.0, 0.01, 0.1]))
    return law(value, draw(numbers(0.0, 0.45)), draw(numbers(100.0, 2000.0)), damping)


def shape(draw, dim: int, levels: int) -> tuple[Solid, ...]:
    """A block of one or more boxes on each level, or a hollow ball; all within `APART`."""
    if dim == 3 and some(draw, 0.1):
        return tuple(hollow_ball(0.18, 0.05, 1, 1 + level) for level in range(levels))
    size = draw(st.tuples(*[numbers(0.1, 0.28)] * dim))
    cuts = draw(st.tuples(*[st.integers(1, 3 if dim == 2 else 2)] * dim))
    twist = draw(numbers(-1.0, 1.0)) if some(draw, 0.3) else 0.0

    seed = draw(st.integers(0, 999))

    def bent(X: np.ndarray, level: int) -> np.ndarray:
        # Uneven: no point or centre lies between two coarse cells, where either would do.
        X = X + 0.05 / max(cuts) * min(size) * np.random.default_rng(seed + level).uniform(-1.0, 1.0, X.shape)
        c, s = np.cos(twist * X[:, -1]), np.sin(twist * X[:, -1])
        return np.column_stack([c * X[:, 0] - s * X[:, -1], *X.T[1:-1], s * X[:, 0] + c * X[:, -1]])

    def block(level: int) -> Solid:
        cut = [k + level for k in cuts]
        if dim == 3:
            return brick(size, cut, lambda X: bent(X, level))
        mesh = grid(*(side * np.linspace(-0.5, 0.5, k + 1) for side, k in zip(size, cut, strict=True)))
        return Solid(bent(mesh.points, level), mesh.cells.astype(np.int32), mesh.regions)

    return tuple(block(level) for level in range(levels))


def body(draw, dim: int, number: int, levels: int, extreme: bool) -> Body:
    angle, axis = draw(numbers(-3.0, 3.0)), (0.3, draw(numbers(-1.0, 1.0)), 1.0)
    scale = draw(st.sampled_from([1.0, 0.7]))
    sideways = [0.1 * draw(numbers(-1.0, 1.0)) for _ in range(dim - 1)]
    place = Placement((sideways[0], 0.3 + APART * number, *sideways[1:]), angle, axis, scale)
    middle = np.array(place.translate)
    velocity = np.array(draw(vectors(dim, 1.0)))
    velocity[1] -= draw(st.sampled_from([6.0, 2.0, 0.0])) * (number + 1)  # down, the upper ones faster
    velocity *= 10.0 ** draw(numbers(-2.0, 2.5)) if extreme else 1.0
    kind = draw(st.sampled_from(["vector", "field", "spin", "rest"]))
    spin: float | tuple = ()
    if kind == "spin":
        spin = draw(numbers(-10.0, 10.0)) if dim == 2 else draw(vectors(3, 10.0))
    field = lambda X: velocity + 2.0 * (X - middle)
    regions = ()
    if some(draw, 0.2):
        regions = (Region(material(draw, extreme), lambda X: X[:, 0] > middle[0] + 1e-3),)
    return Body(
        shape(draw, dim, levels),
        material(draw, extreme),
        name=f"body {number}",
        placement=place,
        velocity={"rest": (), "spin": (), "vector": tuple(velocity), "field": field}[kind],
        spin=spin,
        regions=regions,
        start=(lambda X: middle + 0.95 * (X - middle)) if some(draw, 0.1) else None,
        elements=draw(st.sampled_from([None, *ELEMENTS])),
    )


# ---- what moves


def motion(draw, dim: int, centre: tuple):
    """Any, about or along a point; slow enough that a step does not carry it across a body."""
    kind = draw(st.sampled_from(["still", "translation", "rotation", "path", "both", "own"]))
    stop = draw(st.sampled_from([np.inf, 0.03]))
    velocity, speed = draw(vectors(dim, 1.0)), draw(numbers(-4.0, 4.0))
    axis = (0.0, 0.0, 1.0) if dim == 2 else (0.2, draw(numbers(-1.0, 1.0)), 1.0)
    shift, turn = Translation(velocity, stop), Rotation(speed, centre, axis, stop)
    points = [(0.0,) * dim, tuple(0.1 * v for v in velocity), tuple(-0.05 * v for v in velocity)]
    path = Path((0.0, 0.05, 0.15), points, smooth=draw(st.booleans()))
    own = lambda X, t: X + np.sin(8.0 * t) * 0.05 * np.asarray(velocity)
    return {
        "still": Still(),
        "translation": shift,
        "rotation": turn,
        "path": path,
        "both": Sequential((turn, path)),
        "own": own,
    }[kind]


def obstacle(draw, dim: int, number: int, height: float):
    """A plane below all, or something round or square or animated beside or above."""
    name, flat = f"obstacle {number}", (0.0,) * (dim - 2)
    tilt = draw(numbers(-0.2, 0.2))
    if number == 0:
        normal = (tilt, 1.0, *flat)
        return Plane((0.0, 0.0, *flat), normal, motion(draw, dim, (0.5, -0.3, *flat)), name)
    side = draw(st.sampled_from([-1.0, 1.0]))
    centre = (0.75 * side, draw(numbers(0.2, 1.0)) * height, *flat)
    kind = draw(st.sampled_from(["ball", "box", "cache"]))
    round_ = (disc(0.15, 10) if dim == 2 else ball(0.15, 1)) if kind != "box" else None
    square = rectangle(0.4, 0.1) if dim == 2 else box((0.4, 0.1, 0.5))
    place = Placement(centre, tilt)
    toward = Translation((-side * draw(numbers(0.5, 6.0)), 0.0, *flat))
    if kind == "cache":
        points = place(np.asarray(round_.points if dim == 2 else round_.vertices))
        frames = [points - [side * 0.1 * k, *(0.0,) * (dim - 1)] + 0.02 * k * (points - centre) for k in range(4)]
        faces = np.column_stack([np.arange(10), np.roll(np.arange(10), -1)]) if dim == 2 else round_.triangles
        return Deforming(PointCache(np.array(frames), times=(0.0, 0.05, 0.1, 0.2), faces=faces), name=name)
    moving = toward if draw(st.booleans()) else motion(draw, dim, centre)
    return Rigid(square if kind == "box" else round_, place, moving, name)


def pressing(draw, dim: int, of: Body) -> tuple[Rigid, Rigid]:
    """Two obstacles that come together from both sides of a body, and turn or slide along it meanwhile: as rollers,
    gears, presses and belts do. They stop before they touch each other.
    """
    flat, speed, left = (0.0,) * (dim - 2), draw(numbers(1.0, 6.0)), draw(numbers(0.02, 0.2))
    if draw(st.booleans()):
        radius, tool = 0.15, disc(0.15, 10) if dim == 2 else ball(0.15, 1)
    else:
        radius, tool = 0.05, rectangle(0.1, 0.5) if dim == 2 else box((0.1, 0.5, 0.5))
    turn, slide = draw(numbers(-10.0, 10.0)) if radius > 0.1 else 0.0, draw(numbers(-1.0, 1.0))
    start = 0.36  # m from the middle: bodies reach to 0.35 at most
    pair = []
    for number, side in enumerate((-1.0, 1.0)):
        centre = (side * (start + radius), of.placement.translate[1], *flat)
        motions = (
            Rotation(side * turn, centre, (0.0, 0.0, 1.0)),
            Translation((0.0, side * slide, *flat)),
            Translation((-side * speed, 0.0, *flat), (start - 0.5 * left) / speed),
        )
        pair.append(Rigid(tool, Placement(centre), Sequential(motions), f"press {number}"))
    return pair[0], pair[1]


def support(draw, dim: int, of: Body) -> Support:
    """One end of a body."""
    back, centre = of.placement, np.array(of.placement.translate)
    along = back(np.eye(dim)[:1])[0] - centre
    along = along / np.linalg.norm(along)
    reach = max(float(((back(solid.vertices) - centre) @ along).max()) for solid in of.shape[:1])
    where = lambda X: (X - centre) @ along > 0.8 * reach
    release = draw(st.sampled_from([np.inf, np.inf, 0.04]))
    return Support(where, of.name, motion(draw, dim, tuple(centre)), release)


# ---- loads


def load(draw, dim: int, of: Body):
    kind = draw(st.sampled_from(["force", "point", "impulse", "flow", "pressure"]))
    direction = np.array(draw(vectors(dim, 1.0)))
    weight = 10.0 * 500.0 * 0.2**dim
    steady = tuple(weight * direction)
    force = draw(st.sampled_from(["constant", "keyed", "function"]))
    value = {
        "constant": steady,
        "keyed": Keyed((0.0, 0.05), ((0.0,) * dim, steady)),
        "function": lambda t: tuple(weight * np.sin(20.0 * t) * direction),
    }[force]
    middle = of.placement.translate
    half = lambda X: X[:, 0] <= middle[0] + 1e-3
    if kind == "force":
        return Force(value, half if draw(st.booleans()) else (lambda X: np.ones(len(X), dtype=bool)), of.name)
    if kind == "point":
        return PointForce(value, middle, of.name)
    if kind == "impulse":
        return Impulse(tuple(2.0 * direction), draw(st.sampled_from([0.0, 0.02])), half, of.name)
    if kind == "flow":
        return Flow(tuple(5.0 * direction), 10.0, body=of.name)
    return Pressure(of.name, draw(st.sampled_from([200.0, Keyed((0.0, 0.1), (0.0, 500.0))])))


def gravity(draw, dim: int) -> Gravity:
    down = (0.0, -9.81, *(0.0,) * (dim - 2))
    return Gravity(
        draw(
            st.sampled_from(
                [down, Keyed((0.0, 0.1), ((0.0,) * dim, down)), lambda t: tuple(np.cos(3.0 * t) * np.array(down))]
            )
        )
    )


# ---- scenes


@st.composite
def scenes(draw, extreme: bool = False, pressed: bool = False) -> Scene:
    """One to four bodies, and whatever may act on them. In extreme ones stiffness, density, speed and time step span
    many powers of ten, and few iterations are allowed. In `pressed` ones two obstacles squeeze a body.
    """
    dim = draw(st.sampled_from([2, 3]))
    levels = draw(st.integers(1, 3 if dim == 2 else 2))
    bodies = tuple(body(draw, dim, k, levels, extreme) for k in range(draw(st.integers(1, 4 if dim == 2 else 3))))
    around = tuple(
        obstacle(draw, dim, k, 0.3 + APART * (len(bodies) - 1)) for k in range(draw(st.sampled_from([1, 2, 0])))
    )
    if pressed:
        around = pressing(draw, dim, draw(st.sampled_from(bodies)))
    contact: tuple = ()
    if around or not some(draw, 0.3):
        contact = (Barrier(draw(st.sampled_from([Relative(1e-2), Relative(1e-3), 2e-3]))),)
        if draw(st.booleans()):
            mu, eps_v = draw(st.sampled_from([0.1, 0.5, 1.5])), draw(st.sampled_from([Relative(1e-2), 0.01]))
            contact += (Friction(mu, eps_v, draw(st.integers(1, 3))),)
    held = [support(draw, dim, one) for one in bodies if some(draw, 0.15)]
    loads = [gravity(draw, dim)] if some(draw, 0.6) else []
    loads += [load(draw, dim, one) for one in bodies if some(draw, 0.2)]
    muscles = [
        Muscle(
            one.name,
            (1.0, *(0.0,) * (dim - 1)),
            draw(numbers(1e3, 2e4)),
            draw(st.sampled_from([1.0, Keyed((0.0, 0.1), (0.0, 1.0)), lambda t: 0.5 - 0.5 * np.cos(30.0 * t)])),
        )
        for one in bodies
        if some(draw, 0.15)
    ]
    springs = [
        Attachment(a.name, b.name, _upper(a), _lower(b), draw(numbers(50.0, 2e3)), breaking=draw(broken))
        for a, b in zip(bodies, bodies[1:], strict=False)
        if some(draw, 0.15)
    ]
    return Scene(
        bodies,
        dt=draw(st.sampled_from([1e-4, 1e-3, 0.01, 0.04, 0.1] if extreme else [0.02, 0.04, 0.01, 0.005])),
        steps=3 if extreme else draw(st.integers(2, 10)),
        loads=loads,
        supports=held,
        obstacles=around,
        contact=contact,
        solver=Solver(max_iterations=60, max_halvings=2) if extreme else ACCURATE,
        integrator=draw(st.sampled_from(list(INTEGRATORS))),
        elements=draw(st.sampled_from(ELEMENTS)),
        feedback=draw(st.sampled_from([0.05, 0.0])),
        penalty=pdvol.Penalty(weight=0.1, consistency=draw(st.sampled_from([0.0, 0.02]))),
        attachments=springs,
        muscles=muscles,
    )


methods = st.sampled_from(METHODS)
interpolants = st.sampled_from(list(INTERPOLANTS))
broken = st.sampled_from([None, None, 5.0])


def _upper(of: Body):
    return lambda X: X[:, 1] > of.placement.translate[1] + 0.013


def _lower(of: Body):
    return lambda X: X[:, 1] < of.placement.translate[1] - 0.013
