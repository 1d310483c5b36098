"""A hollow ball is blown up between a floor and a ceiling until it is wedged, and let down again."""

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, Keyed, NeoHookean, Placement, Plane, Pressure, Scene, meshes
from pdvol.geometry.closed_surfaces import enclosed_volume, pressed_facets

RADIUS, WALL = 0.3, 0.03  # m


def scene(subdivisions=(2, 3), layers=(1, 2), young=5e4, pressure=2400.0, room=0.68, mu=0.4, steps=120, dt=0.01):
    """`pressure` [Pa] is reached after 0.4 s, held until 0.8 s and let off by 1.1 s; `room` [m] is the height."""

    inside = Keyed((0.0, 0.4, 0.8, 1.1), (0.0, pressure, pressure, 0.0))
    balloon = Body(
        tuple(meshes.hollow_ball(RADIUS, WALL, *cuts) for cuts in zip(subdivisions, layers, strict=True)),
        NeoHookean(young, 0.45, 200.0, damping=0.01),
        name="balloon",
        placement=Placement(translate=(0.0, RADIUS + 2e-3, 0.0)),
    )
    return Scene(
        bodies=(balloon,),
        obstacles=(
            Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), name="floor"),
            Plane((0.0, room, 0.0), (0.0, -1.0, 0.0), name="ceiling"),
        ),
        loads=(Gravity((0.0, -9.81, 0.0)), Pressure("balloon", inside)),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


def claim(run):
    """It grows until it is wedged, and gets small again."""
    full, last = round(0.8 / run.dt), run.info["steps"]
    room = next(obstacle.plane(0)[0][1] for obstacle in run.obstacles if obstacle.name == "ceiling")
    grown, ends, gaps = [], [], []
    for level in run.levels:
        facets = pressed_facets(level.mesh, 0)
        begin, most, end = (enclosed_volume(level.positions(step), facets) for step in (0, full, last))
        grown.append(most / begin)
        ends.append(end / begin)
        heights = level.positions(full)[:, 1]
        gaps.append(max(heights.min(), room - heights.max()))
    air, left, touching = (
        ", ".join(f"{factor * x:.2f}" for x in found) for factor, found in ((1, grown), (1, ends), (1000, gaps))
    )
    return [
        (
            f"At 0.8 s the air has {air} times its first volume on the levels, and the balloon touches floor and"
            f" ceiling (within {touching} mm).",
            min(grown) > 1.6 and max(gaps) < 2e-3,
        ),
        (f"At the end it has {left} times that volume.", max(ends) < 1.3),
        ("The levels grow alike, within a fifth.", max(grown) < 1.2 * min(grown)),
    ]


if __name__ == "__main__":
    pdvol.main(scene)
