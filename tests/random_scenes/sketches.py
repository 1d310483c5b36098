"""A Hypothesis strategy for small scenes, which combines all features that a scene may have."""

import numpy as np
from hypothesis import strategies as st

import pdvol
from pdvol.meshes import ball, box, brick, disc, hollow_ball, rectangle
from pdvol.registry import ELEMENTS, INTEGRATORS, INTERPOLANTS, METHODS
from shapes import grid

APART = 0.5  # m between the centres of bodies, whose diagonals are below
ACCURATE = pdvol.Solver(tolerance=pdvol.Relative(1e-6), linear="direct", max_iterations=100, max_halvings=4)


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
    law = draw(st.sampled_from([pdvol.NeoHookean, pdvol.FixedCorotational, pdvol.StVenantKirchhoff]))
    if extreme:
        young, density = 10.0 ** draw(numbers(2.0, 11.0)), 10.0 ** draw(numbers(0.0, 5.0))
        return law(young, draw(st.sampled_from([-0.5, 0.0, 0.3, 0.45, 0.499])), density)
    young = 10.0 ** draw(numbers(4.0, 6.0))
    kind = draw(st.sampled_from(["constant", "field", "keyed"]))
    if kind == "field":
        value = lambda X: young * (1.0 + 0.5 * np.sin(7.0 * X[:, 0]))
    else:
        value = pdvol.Keyed((0.0, 0.1), (young, 0.5 * young)) if kind == "keyed" else young
    damping = draw(st.sampled_from([0.0, 0.0, 0.01, 0.1]))
    return law(value, draw(numbers(0.0, 0.45)), draw(numbers(100.0, 2000.0)), damping)


def shape(draw, dim: int, levels: int) -> tuple[pdvol.Solid, ...]:
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

    def block(level: int) -> pdvol.Solid:
        cut = [k + level for k in cuts]
        if dim == 3:
            return brick(size, cut, lambda X: bent(X, level))
        mesh = grid(*(side * np.linspace(-0.5, 0.5, k + 1) for side, k in zip(size, cut, strict=True)))
        return pdvol.Solid(bent(mesh.points, level), mesh.cells.astype(np.int32), mesh.regions)

    return tuple(block(level) for level in range(levels))


def body(draw, dim: int, number: int, levels: int, extreme: bool) -> pdvol.Body:
    angle, axis = draw(numbers(-3.0, 3.0)), (0.3, draw(numbers(-1.0, 1.0)), 1.0)
    scale = draw(st.sampled_from([1.0, 0.7]))
    sideways = [0.1 * draw(numbers(-1.0, 1.0)) for _ in range(dim - 1)]
    place = pdvol.Placement((sideways[0], 0.3 + APART * number, *sideways[1:]), angle, axis, scale)
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
        regions = (pdvol.Region(material(draw, extreme), lambda X: X[:, 0] > middle[0] + 1e-3),)
    return pdvol.Body(
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
    shift, turn = pdvol.Translation(velocity, stop), pdvol.Rotation(speed, centre, axis, stop)
    points = [(0.0,) * dim, tuple(0.1 * v for v in velocity), tuple(-0.05 * v for v in velocity)]
    path = pdvol.Path((0.0, 0.05, 0.15), points, smooth=draw(st.booleans()))
    own = lambda X, t: X + np.sin(8.0 * t) * 0.05 * np.asarray(velocity)
    return {
        "still": pdvol.Still(),
        "translation": shift,
        "rotation": turn,
        "path": path,
        "both": pdvol.Sequential((turn, path)),
        "own": own,
    }[kind]


def obstacle(draw, dim: int, number: int, height: float):
    """A plane below all, or something round or square or animated beside or above."""
    name, flat = f"obstacle {number}", (0.0,) * (dim - 2)
    tilt = draw(numbers(-0.2, 0.2))
    if number == 0:
        normal = (tilt, 1.0, *flat)
        return pdvol.Plane((0.0, 0.0, *flat), normal, motion(draw, dim, (0.5, -0.3, *flat)), name)
    side = draw(st.sampled_from([-1.0, 1.0]))
    centre = (0.75 * side, draw(numbers(0.2, 1.0)) * height, *flat)
    kind = draw(st.sampled_from(["ball", "box", "cache"]))
    round_ = (disc(0.15, 10) if dim == 2 else ball(0.15, 1)) if kind != "box" else None
    square = rectangle(0.4, 0.1) if dim == 2 else box((0.4, 0.1, 0.5))
    place = pdvol.Placement(centre, tilt)
    toward = pdvol.Translation((-side * draw(numbers(0.5, 6.0)), 0.0, *flat))
    if kind == "cache":
        points = place(np.asarray(round_.points if dim == 2 else round_.vertices))
        frames = [points - [side * 0.1 * k, *(0.0,) * (dim - 1)] + 0.02 * k * (points - centre) for k in range(4)]
        faces = np.column_stack([np.arange(10), np.roll(np.arange(10), -1)]) if dim == 2 else round_.triangles
        return pdvol.Deforming(pdvol.PointCache(np.array(frames), times=(0.0, 0.05, 0.1, 0.2), faces=faces), name=name)
    moving = toward if draw(st.booleans()) else motion(draw, dim, centre)
    return pdvol.Rigid(square if kind == "box" else round_, place, moving, name)


def slab(plane: pdvol.Plane) -> pdvol.Rigid:
    """Its upper side is the plane's surface. No edge lies below bodies: the diagonals of its faces pass far away."""
    normal = np.array(plane.normal) / np.linalg.norm(plane.normal)
    d = len(normal)
    sides = np.linalg.svd(normal[None])[2][1:]
    axes = (
        np.array([*sides, normal])
        if np.linalg.det([*sides, normal]) > 0
        else np.array([*-sides[:1], *sides[1:], normal])
    )
    low, high = np.array([-5.0, -3.0][: d - 1] + [-1.0]), np.array([5.0, 40.0][: d - 1] + [0.0])
    corners = lambda unit: low + (unit + 0.5) * (high - low)
    if d == 2:
        shape = pdvol.Outline(np.array(plane.point) + corners(rectangle(1.0, 1.0).points) @ axes)
    else:
        unit = box((1.0, 1.0, 1.0))
        shape = pdvol.Surface(np.array(plane.point) + corners(unit.vertices) @ axes, unit.triangles)
    return pdvol.Rigid(shape, pdvol.Placement(), plane.motion, plane.name)


def pressing(draw, dim: int, of: pdvol.Body) -> tuple[pdvol.Rigid, pdvol.Rigid]:
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
            pdvol.Rotation(side * turn, centre, (0.0, 0.0, 1.0)),
            pdvol.Translation((0.0, side * slide, *flat)),
            pdvol.Translation((-side * speed, 0.0, *flat), (start - 0.5 * left) / speed),
        )
        pair.append(pdvol.Rigid(tool, pdvol.Placement(centre), pdvol.Sequential(motions), f"press {number}"))
    return pair[0], pair[1]


def support(draw, dim: int, of: pdvol.Body) -> pdvol.Support:
    """One end of a body."""
    back, centre = of.placement, np.array(of.placement.translate)
    along = back(np.eye(dim)[:1])[0] - centre
    along = along / np.linalg.norm(along)
    reach = max(float(((back(solid.vertices) - centre) @ along).max()) for solid in of.shape[:1])
    where = lambda X: (X - centre) @ along > 0.8 * reach
    release = draw(st.sampled_from([np.inf, np.inf, 0.04]))
    return pdvol.Support(where, of.name, motion(draw, dim, tuple(centre)), release)


# ---- loads


def load(draw, dim: int, of: pdvol.Body):
    kind = draw(st.sampled_from(["force", "point", "impulse", "flow", "pressure"]))
    direction = np.array(draw(vectors(dim, 1.0)))
    weight = 10.0 * 500.0 * 0.2**dim
    steady = tuple(weight * direction)
    force = draw(st.sampled_from(["constant", "keyed", "function"]))
    value = {
        "constant": steady,
        "keyed": pdvol.Keyed((0.0, 0.05), ((0.0,) * dim, steady)),
        "function": lambda t: tuple(weight * np.sin(20.0 * t) * direction),
    }[force]
    middle = of.placement.translate
    half = lambda X: X[:, 0] <= middle[0] + 1e-3
    if kind == "force":
        return pdvol.Force(value, half if draw(st.booleans()) else (lambda X: np.ones(len(X), dtype=bool)), of.name)
    if kind == "point":
        return pdvol.PointForce(value, middle, of.name)
    if kind == "impulse":
        return pdvol.Impulse(tuple(2.0 * direction), draw(st.sampled_from([0.0, 0.02])), half, of.name)
    if kind == "flow":
        return pdvol.Flow(tuple(5.0 * direction), 10.0, body=of.name)
    return pdvol.Pressure(of.name, draw(st.sampled_from([200.0, pdvol.Keyed((0.0, 0.1), (0.0, 500.0))])))


def pull(draw, dim: int, of: pdvol.Body) -> pdvol.Pull:
    """From a side of a body to some way off, and back."""
    middle, away = np.array(of.placement.translate), np.array(draw(vectors(dim, 0.4)))
    begin, duration = draw(st.sampled_from([0.0, 0.013, 0.04])), draw(numbers(0.03, 0.2))
    points = [tuple(middle + share * away) for share in (0.1, 1.0, 0.0)]
    times = (begin, begin + 0.5 * duration, begin + duration)
    return pdvol.Pull(of.name, points[0], times, points, 10.0 ** draw(numbers(1.0, 4.0)), draw(numbers(0.01, 0.15)))


def gravity(draw, dim: int) -> pdvol.Gravity:
    down = (0.0, -9.81, *(0.0,) * (dim - 2))
    return pdvol.Gravity(
        draw(
            st.sampled_from(
                [down, pdvol.Keyed((0.0, 0.1), ((0.0,) * dim, down)), lambda t: tuple(np.cos(3.0 * t) * np.array(down))]
            )
        )
    )


# ---- scenes


@st.composite
def scenes(draw, extreme: bool = False, pressed: bool = False) -> pdvol.Scene:
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
        contact = (pdvol.Barrier(draw(st.sampled_from([pdvol.Relative(1e-2), pdvol.Relative(1e-3), 2e-3]))),)
        if draw(st.booleans()):
            mu, eps_v = draw(st.sampled_from([0.1, 0.5, 1.5])), draw(st.sampled_from([pdvol.Relative(1e-2), 0.01]))
            contact += (pdvol.Friction(mu, eps_v, draw(st.integers(1, 3))),)
    held = [support(draw, dim, one) for one in bodies if some(draw, 0.15)]
    loads = [gravity(draw, dim)] if some(draw, 0.6) else []
    loads += [load(draw, dim, one) for one in bodies if some(draw, 0.2)]
    muscles = [
        pdvol.Muscle(
            one.name,
            (1.0, *(0.0,) * (dim - 1)),
            draw(numbers(1e3, 2e4)),
            draw(st.sampled_from([1.0, pdvol.Keyed((0.0, 0.1), (0.0, 1.0)), lambda t: 0.5 - 0.5 * np.cos(30.0 * t)])),
        )
        for one in bodies
        if some(draw, 0.15)
    ]
    springs = [
        pdvol.Attachment(a.name, b.name, _upper(a), _lower(b), draw(numbers(50.0, 2e3)), breaking=draw(broken))
        for a, b in zip(bodies, bodies[1:], strict=False)
        if some(draw, 0.15)
    ]
    return pdvol.Scene(
        bodies,
        pulls=[pull(draw, dim, one) for one in bodies if some(draw, 0.15)],
        dt=draw(st.sampled_from([1e-4, 1e-3, 0.01, 0.04, 0.1] if extreme else [0.02, 0.04, 0.01, 0.005])),
        steps=3 if extreme else draw(st.integers(2, 10)),
        loads=loads,
        supports=held,
        obstacles=around,
        contact=contact,
        solver=pdvol.Solver(max_iterations=60, max_halvings=2) if extreme else ACCURATE,
        integrator=draw(st.sampled_from(list(INTEGRATORS))),
        elements=draw(st.sampled_from(ELEMENTS)),
        feedback=draw(st.sampled_from([0.05, 0.0])),
        penalty=pdvol.Penalty(weight=0.1, consistency=draw(st.sampled_from([0.0, 0.02]))),
        attachments=springs,
        muscles=muscles,
    )


hows = st.fixed_dictionaries({"method": st.sampled_from(METHODS), "prolongation": st.sampled_from(list(INTERPOLANTS))})
broken = st.sampled_from([None, None, 5.0])


def _upper(of: pdvol.Body):
    return lambda X: X[:, 1] > of.placement.translate[1] + 0.013


def _lower(of: pdvol.Body):
    return lambda X: X[:, 1] < of.placement.translate[1] - 0.013


def materials_of(scene: pdvol.Scene) -> list[pdvol.Material]:
    return [each for body in scene.bodies for each in (body.material, *(region.material for region in body.regions))]


def dimension(scene: pdvol.Scene) -> int:
    return scene.bodies[0].shape[0].vertices.shape[1]
