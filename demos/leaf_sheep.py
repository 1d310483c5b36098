"""Two leaf sheep on a sea mushroom (paper, figure 1): a current sweeps them off their caps, they meet over a stone and
come to rest on their feet.

Level 0 answers in minutes; is the night's run of level 2 the same story?
"""

import numpy as np

import pdvol
import recipes
from pdvol import Barrier, Body, Flow, Friction, Gravity, NeoHookean, Placement, Plane, Rigid, Scene, Support
from pdvol.runs.run_metrics import motion_from_level_0
from pdvol.studio.wedge.scored_body import at_level
from pdvol.studio.wedge.scores import quiet, upright

LENGTH = 0.36  # m, of a leaf sheep
HEIGHT = 0.6  # m, of the plant
WEIGHT = 3.0  # m/s^2, gravity less buoyancy
CAPS = ((-0.24, 0.632, 0.0), (0.24, 0.560, 0.03))  # m, the middles of the two upper caps, on top


def scene(
    vertices=((1250, 8000, 38000), (650, 2500, 11000)),
    young=4e4,
    current=0.8,
    until=0.8,
    turns=(65.0, -75.0),
    stone=0.42,
    mu=0.3,
    stalk=60.0,
    damping=0.03,
    steps=220,
    dt=0.02,
):
    """A current of `current` m/s flows towards the stone, from both sides and from behind, `until` that time [s].

    `vertices` of a leaf sheep and of the plant by level; `turns` [degrees] is where their heads point, from +z; `stone`
    is how far before the plant it lies [m]. The plant is `stalk` times as stiff as the sheep: at 12 times the
    stalk of level 1 buckled.
    """
    sheep, plant = vertices
    middle = np.array([0.0, 0.3, stone])

    def flow(x, t):
        way = middle - x
        way[:, 1] = 0.05
        pulse = np.sin(np.pi * min(t / until, 1.0)) ** 2
        return current * pulse * way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 0.2)

    flesh = NeoHookean(young, 0.4, 1000.0, damping=damping)
    return Scene(
        bodies=(
            *(
                Body(
                    recipes.leaf_sheep(LENGTH, 24000),
                    flesh,
                    tuple(sheep),
                    name=f"sheep {k + 1}",
                    placement=Placement((x, y, z), np.radians(turn), (0.0, 1.0, 0.0)),
                )
                for k, ((x, y, z), turn) in enumerate(zip(CAPS, turns, strict=True))
            ),
            Body(
                recipes.sea_mushroom(HEIGHT, 6000),
                NeoHookean(stalk * young, 0.4, 1000.0, damping=damping),
                tuple(plant),
                name="plant",
                placement=Placement((0.0, 0.005, 0.0)),
            ),
        ),
        obstacles=(
            Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), name="sea floor"),
            Rigid(recipes.stone(0.34, 1200), name="stone", placement=Placement((0.0, 0.001, stone))),
        ),
        supports=(Support(lambda X: X[:, 1] < 0.02, body="plant"),),
        loads=(Gravity((0.0, -WEIGHT, 0.0)), Flow(flow, 1000.0, 0.25)),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


def nearest(level, one, others):
    """How near a body of a stored level comes to other points, at least, at any stored time [m]: between vertices."""
    from scipy.spatial import cKDTree

    owners = level.mesh.point_bodies
    found = []
    for step in range(level.steps):
        x = level.positions(step)
        points = others(step) if callable(others) else x[owners == others]
        found.append(cKDTree(points).query(x[owners == one])[0].min())
    return float(min(found))


def claim(run):
    """They meet over the stone and come to rest on their feet, on all levels in the same places."""
    stone = next(obstacle for obstacle in run.obstacles if obstacle.name == "stone")
    names = ("sheep 1", "sheep 2")
    seen = [at_level(run, level.index) for level in run.levels]
    apart = [nearest(level, 0, 1) for level in run.levels]
    above = [max(nearest(level, k, stone.vertices) for k in (0, 1)) for level in run.levels]
    upward = [upright(name, axis=(0.0, 1.0, 0.0)) for name in names]
    leans = [max(np.degrees(np.arccos(each(level))) for each in upward) for level in seen]
    speeds = [max(-quiet(name)(level) for name in names) for level in seen]
    ends = motion_from_level_0(run)[1:]
    sheep = [max(entry["centre_drifts"][name] for name in names) for entry in ends]
    plant, most = [entry["centre_drifts"]["plant"] for entry in ends], [entry["largest_distance"] for entry in ends]
    angles = [entry["angle_drift"] for entry in ends]
    return [
        (
            f"On the levels vertices of the two come as near as {_list(apart, 1000, 1)} mm to each other,"
            f" {_list(above, 1000, 1)} mm to the stone; the two end at most {_list(leans)} degrees from upright, at"
            f" {_list(speeds, 1000)} mm/s at most.",
            max(*apart, *above) < 0.05 * LENGTH and max(leans) < 30.0 and max(speeds) < 0.05,
        ),
        (
            f"Finer levels end with both sheep within {_list(sheep, 1000)} mm ({_list(sheep, 100 / LENGTH, 1)} % of a"
            f" sheep's length), the plant within {_list(plant, 1000)} mm ({_list(plant, 100 / HEIGHT, 1)} % of its"
            f" height) and all within {_list(angles, digits=1)} degrees of level 0; on the way they are at most"
            f" {_list(most, 1000)} mm from it, a mean.",
            max(sheep) < 0.03 * LENGTH and max(plant) < 0.03 * HEIGHT and max(most) < 0.1 * LENGTH,
        ),
    ]


def _list(values, factor=1.0, digits=0):
    return ", ".join(f"{factor * value:.{digits}f}" for value in values)


if __name__ == "__main__":
    pdvol.main(scene)
