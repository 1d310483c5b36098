"""The classic stress tests of contact, with shapes of our own at about the sizes of those of the IPC paper (Li et al.
2020). A scene file.

    ./run pdvol run benchmarks/stress/scenes.py --set name=mat_on_knives

Materials, time steps, mu and motions are the paper's scripts' (SI units, y up); contact distances and tolerances are
pdvol's defaults unless a script asks for something special. Where the paper has points and edges without thickness,
these scenes have thin tetrahedra and triangles.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import pdvol
from pdvol import (
    Barrier,
    Body,
    FixedCorotational,
    Friction,
    NeoHookean,
    Placement,
    Plane,
    Relative,
    Rigid,
    Rotation,
    Scene,
    Solver,
    Support,
    Translation,
)
from pdvol.meshes import Solid, Surface, ball, box, brick, creature, cylinder, funnel, torus

sys.path.append(str(Path(__file__).resolve().parents[2]))  # as a scene file it is no part of a package
sys.path.append(str(Path(__file__).resolve().parents[2] / "demos"))

from benchmarks.common.scenes import FLOOR, ORIGIN, X_AXIS, Z_AXIS, falling, first_order, named, solid
from recipes import dolphin

TURN = np.radians(72.0)
"""rad/s, of each end that is twisted."""


# ---- shapes


def mat(n: int = 39, side: float = 1.0, thickness: float = 0.02) -> Solid:
    """A square mat, one cell thick: n = 39 is IPC's mat40x40 (3,200 vertices)."""
    return brick((side, thickness, side), (n, 1, n))


def merged(surfaces) -> Surface:
    """Several surfaces as one."""
    starts = np.cumsum([0, *(len(s.vertices) for s in surfaces)])
    triangles = np.vstack([s.triangles + start for s, start in zip(surfaces, starts, strict=False)])
    return Surface(np.vstack([s.vertices for s in surfaces]), triangles.astype(np.int32))


def knives() -> Surface:
    """Nine upright triangles, their tips up at y = 0.3 m, turned in different directions."""
    blades = []
    for k, (x, z) in enumerate((x, z) for x in (-0.3, 0.0, 0.3) for z in (-0.3, 0.0, 0.3)):
        across = 0.12 * np.array([np.cos(0.7 * k), 0.0, np.sin(0.7 * k)])
        foot = np.array([x, 0.05, z])
        blades.append(Surface(np.array([foot - across, foot + across, foot + [0.0, 0.25, 0.0]]), np.array([[0, 1, 2]])))
    return merged(blades)


def pins(n: int = 21, pitch: float = 0.1, height: float = 0.4, width: float = 0.01) -> Surface:
    """A field of n by n thin tetrahedra, their tips up at y = 0."""
    foot = width * np.array([(np.cos(a), 0.0, np.sin(a)) for a in (0.1, 2.2, 4.3)])
    pin = np.vstack([foot - [0.0, height, 0.0], [[0.0, 0.0, 0.0]]])
    faces = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    ticks = pitch * (np.arange(n) - (n - 1) / 2)
    return merged([Surface(pin + [x, 0.0, z], faces) for x in ticks for z in ticks])


# ---- scenes


def mat_on_knives(cuts=(39,)) -> Scene:
    """A soft mat falls on nine blades."""
    body = Body(tuple(mat(n) for n in cuts), NeoHookean(2e4), placement=Placement((0.0, 0.5, 0.0)))
    return falling([body], 150, 0.04, obstacles=(FLOOR, Rigid(knives(), name="knives", closed=False)))


def ball_on_points(vertices=(4000,)) -> Scene:
    """A soft ball of 1 m falls on a field of 441 pins."""
    body = Body(ball(0.5, 4), NeoHookean(1e4), vertices, placement=Placement((0.013, 0.75, 0.007)))
    return falling([body], 200, 0.04, obstacles=(Rigid(pins(), name="pins"),))


def twisted(bodies, dt: float, steps: int) -> Scene:
    """Bodies 1 m long about the x axis, their ends turned against each other by 72 deg/s each."""
    ends = tuple(
        Support(lambda X, s=side: s * X[:, 0] > 0.4999, motion=Rotation(side * TURN, ORIGIN, X_AXIS))
        for side in (-1, 1)
    )
    return Scene(bodies, dt=dt, steps=steps, supports=ends, contact=(Barrier(),))


def rods_twist(cuts=((69, 2, 2),)) -> Scene:
    """Four rods of 1 x 0.1 x 0.1 m side by side, their ends turned 20 times each in 100 s."""
    rod = tuple(brick((1.0, 0.1, 0.1), three) for three in cuts)
    places = [Placement((0.0, y, z)) for y in (-0.07, 0.07) for z in (-0.07, 0.07)]
    rods = (Body(rod, NeoHookean(1e4), name=f"rod {k}", placement=place) for k, place in enumerate(places))
    return twisted(tuple(rods), 0.025, 4000)


def mat_twist() -> Scene:
    """A mat's two ends turned 20 times each in 100 s."""
    return twisted((Body((mat(),), NeoHookean(2e4)),), 0.04, 2500)


class Squash:
    """A plate that moves along `normal` at 1 m/s until `far` [m], and back."""

    def __init__(self, normal, far: float):
        self.normal, self.far = np.asarray(normal, dtype=float), far

    def __call__(self, X: np.ndarray, t: float) -> np.ndarray:
        return X + max(min(t, 2.0 * self.far - t), 0.0) * self.normal


def trash_compactor(gap: float = 0.1) -> Scene:
    """A ball, a mat and a bear in a box of 1 m whose six sides close at 1 m/s to `gap` [m], and open again."""
    soft, thrown = FixedCorotational(1e4), Placement((0.0, 0.02, 0.0), 0.2, (1.0, 0.3, 0.5))
    bodies = (
        Body(ball(0.15, 3), soft, (900,), name="ball", placement=Placement((0.2, 0.25, 0.1))),
        Body((brick((0.5, 0.02, 0.5), (15, 1, 15)),), soft, name="mat", placement=thrown),
        Body(creature(0.38, 3000), soft, (1500,), name="bear", placement=Placement((0.02, -0.48, 0.0))),
    )
    sides = [side * np.eye(3)[axis] for axis in range(3) for side in (-1.0, 1.0)]
    close = [Squash(-n, 0.5 - gap / 2) for n in sides]
    plates = (Plane(tuple(0.5 * n), tuple(-n), close[k], name=f"plate {k}") for k, n in enumerate(sides))
    return Scene(bodies, dt=0.01, steps=250, contact=(Barrier(),), obstacles=tuple(plates))


def dolphin_funnel(vertices=(4000,)) -> Scene:
    """A dolphin is pulled by its nose through a funnel whose neck is a third of its girth."""
    body = Body(dolphin(1.0, 4000), NeoHookean(1e4), vertices, placement=Placement((0.0, 0.45, 0.0)))
    nose = Support(lambda X: X[:, 1] < -0.01, motion=Translation((0.0, -0.08, 0.0)))
    narrow = Rigid(funnel(0.35, 0.06, 0.45, 0.1), Placement((0.0, 0.02, 0.0)), name="funnel")
    return Scene((body,), dt=0.04, steps=800, supports=(nose,), contact=(Barrier(),), obstacles=(narrow,))


def ball_roller(vertices=(3000,)) -> Scene:
    """A ball falls between two turning rollers, and below them between two more, across."""
    body = Body(ball(0.5, 4), NeoHookean(1e4), vertices, placement=Placement((0.0, 2.45, 0.0)))
    rollers = []
    for y, across in ((1.7, 0), (0.9, 2)):
        for side in (-1, 1):
            centre = np.array([0.0, y, 0.0])
            centre[across] = side * 0.55
            axis = Z_AXIS if across == 0 else X_AXIS
            speed = (1 if across == 0 else -1) * side * np.pi / 2  # inward at the top
            lying = Placement(tuple(centre), np.pi / 2, X_AXIS if across == 0 else Z_AXIS)
            turning = Rotation(speed, tuple(centre), axis)
            rollers.append(Rigid(cylinder(0.35, 2.0, 32), lying, turning, f"roller {len(rollers)}"))
    return falling([body], 1000, mu=0.5, obstacles=(FLOOR, *rollers))


def stiff_ball_on_mat(cuts=(39,), vertices=(1760,)) -> Scene:
    """A ball a hundred times stiffer falls on a mat held at two sides."""
    stiff, above = NeoHookean(1e8, density=2000.0), Placement((0.0, 1.2, 0.0))
    bodies = (
        Body(ball(0.15, 4), stiff, vertices, name="ball", placement=above),
        Body(tuple(mat(n) for n in cuts), NeoHookean(1e6), name="mat", placement=Placement((0.0, 1.0, 0.0))),
    )
    sides = Support(lambda X: np.abs(X[:, 0]) > 0.4999, body="mat")
    return falling(bodies, 250, supports=(sides,))


def card_house(n: int = 9) -> Scene:
    """Seven cards lean and lie on each other in two storeys, nearly at rest; two cubes fall on them."""
    length, thick, lean, gap, dhat = 0.5, 0.02, np.radians(24.0), 2.5e-4, 2.8e-4
    card = brick((thick, length, length), (1, n, n))
    stiff = NeoHookean(1e8)

    def leaning(side: int, apex: float, y: float) -> Placement:
        """A card whose top leans towards `apex` from one side, its foot at y."""
        turned = Placement(angle=side * lean, axis=Z_AXIS)
        points = turned(card.vertices)
        reach = (side * points[:, 0]).min()  # the side that faces the other card
        return Placement((apex + side * (gap / 2 - reach), y + gap - points[:, 1].min(), 0.0), side * lean, Z_AXIS)

    height = np.ptp(Placement(angle=lean, axis=Z_AXIS)(card.vertices)[:, 1])
    places = [leaning(side, apex, 0.0) for apex in (-0.24, 0.24) for side in (-1, 1)]
    places.append(Placement((0.0, height + 2 * gap + thick / 2, 0.0), np.pi / 2, Z_AXIS))
    places += [leaning(side, 0.0, height + 2 * gap + thick) for side in (-1, 1)]
    bodies = [Body((card,), stiff, name=f"card {k}", placement=place) for k, place in enumerate(places)]
    cube = Body((brick((0.12, 0.12, 0.12)),), stiff, velocity=(0.0, -1.0, 0.0))
    for k, (x, y) in enumerate(((-0.1, 2.0), (0.15, 2.5))):
        bodies.append(replace(cube, name=f"cube {k}", placement=Placement((x, y, 0.05), 0.4, (1.0, 1.0, 0.3))))
    return falling(bodies, 200, 0.025, contact=(Barrier(dhat), Friction(0.9, dhat / 10)))


def masonry_arch(stones: int = 25) -> Scene:
    """An arch of stones, eight vertices each, along an upturned catenary 20 m wide and 12.5 m high, stands by friction
    alone.
    """
    half, depth, thick, gap = 10.0, 3.0, 1.6, 1.3e-6
    a = 7.0  # y = top - a (cosh(x / a) - 1)
    fine = np.linspace(-half, half, 20001)
    curve = np.column_stack([fine, a * (np.cosh(half / a) - np.cosh(fine / a))])
    length = np.r_[0.0, np.linalg.norm(np.diff(curve, axis=0), axis=1).cumsum()]
    marks = np.interp(np.linspace(0.0, length[-1], stones + 1), length, fine)
    slope = -np.sinh(marks / a)
    middle = np.column_stack([marks, a * (np.cosh(half / a) - np.cosh(marks / a))])
    normal = np.column_stack([-slope, np.ones(stones + 1)]) / np.sqrt(1.0 + slope[:, None] ** 2)
    normal[0], normal[-1] = (-1.0, 0.0), (1.0, 0.0)  # the feet stand flat on the floor
    bodies = []
    for k in range(stones):

        def bend(X, k=k):
            """Unit box to the stone between marks k and k + 1, a gap shorter at each end."""
            ends = [middle[i] + t * thick / 2 * normal[i] for i in (k, k + 1) for t in (-1, 1)]
            low, high = np.array(ends[:2]), np.array(ends[2:])
            along = (high - low) / np.linalg.norm(high - low, axis=1, keepdims=True)
            low, high = low + gap / 2 * along, high - gap / 2 * along
            s, r = X[:, :1] + 0.5, X[:, 1:2] + 0.5
            flat = (1 - s) * ((1 - r) * low[0] + r * low[1]) + s * ((1 - r) * high[0] + r * high[1])
            return np.column_stack([flat, depth * X[:, 2]])

        bodies.append(Body((brick(bend=bend),), FixedCorotational(2e10, 0.2, 2300.0), name=f"stone {k}"))
    outer, block = half + thick / 2 + gap + 1.0, box((2.0, 2.0, 4.0))
    ends = (Rigid(block, Placement((side * outer, 1.001, 0.0)), name=f"abutment {side:+d}") for side in (-1, 1))
    contact, solver = (Barrier(1.355e-6), Friction(0.5, 2.71e-4)), Solver(tolerance=2.71e-3)
    return falling(bodies, 2000, obstacles=(FLOOR, *ends), contact=contact, solver=solver)


def chain(links: int = 10) -> Scene:
    """A chain of soft links hangs from a rigid one and falls until it is taut; IPC's chain10."""
    soft, ring = NeoHookean(1e7, density=500.0), torus(0.35, 0.1, 24, 10)

    def place(k: int) -> Placement:
        return Placement((0.0, -0.475 * k, 0.0), np.pi / 2, X_AXIS if k % 2 == 0 else Z_AXIS)

    bodies = (Body(ring, soft, (240,), name=f"link {k}", placement=place(k)) for k in range(1, links + 1))
    return falling(bodies, 250, 0.04, obstacles=(Rigid(ring, place(0), name="hook"),))


def tight_fit(gap: float = 1e-3) -> Scene:
    """A cube of 1 m slides into a box that is 1e-3 m wider on every side."""
    side = 1.0 + 2.0 * gap
    open_box = box((side, side, side), 4)
    corners = open_box.vertices[open_box.triangles]
    wall = Surface(open_box.vertices, open_box.triangles[~(corners[:, :, 1] > 0.49).all(axis=1)])
    cube = Body((brick(cuts=(5, 5, 5)),), NeoHookean(1e5), placement=Placement((0.0, 0.6, 0.0)))
    around = Rigid(wall, name="box", closed=False)
    return falling([cube], 100, 0.04, contact=(Barrier(Relative(1e-5)),), obstacles=(around,))


# ---- Erleben's pairs


def spike(up: bool) -> tuple[np.ndarray, np.ndarray]:
    """Pyramid, 0.5 m wide and 1 m high, its tip at the origin: points and tetrahedra."""
    points = np.array([(-0.25, 1.0, -0.25), (0.25, 1.0, -0.25), (0.25, 1.0, 0.25), (-0.25, 1.0, 0.25), (0.0, 0.0, 0.0)])
    return points * ([1.0, -1.0, 1.0] if up else [1.0, 1.0, 1.0]), np.array([[0, 1, 2, 4], [0, 2, 3, 4]])


def wedge(up: bool) -> tuple[np.ndarray, np.ndarray]:
    """Prism, 0.5 m wide and deep and 1 m high, its edge along z at the origin: points and tetrahedra."""
    points = np.array([(x, y, z) for z in (-0.25, 0.25) for x, y in ((-0.25, 1.0), (0.25, 1.0), (0.0, 0.0))])
    return points * ([1.0, -1.0, 1.0] if up else [1.0, 1.0, 1.0]), np.array([[0, 1, 2, 3], [1, 2, 3, 4], [2, 3, 4, 5]])


def sheet(points, n: int = 1) -> Surface:
    """The grid (rows of n + 1 points) as an open surface."""
    points = np.asarray(points, dtype=float)
    i = (np.arange(len(points) // (n + 1) - 1)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = [np.column_stack([i, i + n + 1, i + 1]), np.column_stack([i + 1, i + n + 1, i + n + 2])]
    return Surface(points, np.vstack(faces).astype(np.int32))


def lying(n: int) -> Surface:
    """The square of 2 m at y = 0, cut n by n."""
    ticks = np.linspace(-1.0, 1.0, n + 1)
    return sheet([(x, 0.0, z) for x in ticks for z in ticks], n)


def groove(half: float, depth: float) -> Surface:
    """A ground with a V-shaped crack along z."""
    section = ((-1.0, 0.0), (-half, 0.0), (0.0, -depth), (half, 0.0), (1.0, 0.0))
    return sheet([(x, y, z) for x, y in section for z in (-1.0, 1.0)])


def pit(half: float, depth: float) -> Surface:
    """A ground with a four-sided hole that narrows to a point."""
    ring = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    points = np.vstack([np.insert(size * ring, 1, 0.0, axis=1) for size in (1.0, half)] + [[[0.0, -depth, 0.0]]])
    sides = [(k, (k + 1) % 4) for k in range(4)]
    faces = [f for k, n in sides for f in ((k, 4 + n, n), (k, 4 + k, 4 + n), (4 + k, 8, 4 + n))]
    return Surface(points, np.array(faces, dtype=np.int32))


def pair(falling_one, below: Surface | Solid, shift: float = 0.0, closed: bool = False) -> Scene:
    """One small body falls by 5 cm on one rigid shape, with mu = 1."""
    body = Body((solid(*falling_one),), FixedCorotational(1e5), placement=Placement((shift, 0.05, 0.0)))
    deep = replace(FLOOR, point=(0.0, -3.0, 0.0))
    return falling([body], 2000, 0.005, mu=1.0, obstacles=(deep, Rigid(below, name="below", closed=closed)))


def cube(up: bool) -> tuple[np.ndarray, np.ndarray]:
    """The unit cube upon or below the origin."""
    made = brick()
    return made.vertices + [0.0, 0.5 if up else -0.5, 0.0], made.cells


PAIRS = {
    "spike_plane": lambda: pair(spike(False), lying(1)),
    "spike_spike": lambda: pair(spike(False), solid(*spike(True)), closed=True),
    "spike_wedge": lambda: pair(spike(False), solid(*wedge(True)), closed=True),
    "spike_crack": lambda: pair(spike(False), groove(0.15, 1.0)),
    "spike_hole": lambda: pair(spike(False), pit(0.15, 1.0)),
    "wedge_plane": lambda: pair(wedge(False), lying(1)),
    "wedge_wedge": lambda: pair(wedge(False), solid(*wedge(True)), closed=True),
    "wedge_crack": lambda: pair(wedge(False), groove(0.15, 1.0)),
    "cube_cliff": lambda: pair(cube(True), solid(*cube(False)), shift=0.45, closed=True),
    "cube_internal_edges": lambda: pair(cube(True), lying(8)),
}

WHOLE = (mat_on_knives, ball_on_points, rods_twist, mat_twist, trash_compactor, dolphin_funnel, ball_roller)
WHOLE += (stiff_ball_on_mat, card_house, masonry_arch, chain, tight_fit)
SCENES = {
    **{make.__name__: make for make in WHOLE},
    **{f"erleben_{name}": make for name, make in PAIRS.items()},
    "mat_on_knives_levels": lambda: mat_on_knives((9, 19, 39)),
    "ball_on_points_levels": lambda: ball_on_points((300, 1000, 4000)),
    "stiff_ball_on_mat_levels": lambda: stiff_ball_on_mat((9, 19, 39), (200, 600, 1760)),
}
"""Functions by name, in the order of the table."""


def scene(name: str = "mat_on_knives") -> Scene:
    """One of `SCENES`, by the model of IPC's scripts."""
    return first_order(named(SCENES, name))


if __name__ == "__main__":
    pdvol.main(scene)
