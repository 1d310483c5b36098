"""Two glazed donuts fall on a table: what is simulated is dough of some hundred vertices, what is drawn are detailed
surfaces with a texture, which follow it on both levels.

pdvol run demos/donuts.py
pdvol export runs/donuts --format usd -o donuts
"""

import numpy as np

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, RenderMesh, Scene, meshes

SIZES = (0.3, 0.13)  # m: radius of the ring, and of its tube


def scene(vertices=(250, 1200), young=3e4, mu=0.4, detail=192, interpolant="phong", steps=70, dt=0.015, height=0.4):
    """The lower donut's middle starts `height` m above the table; the render meshes have `detail` segments."""
    glazed = RenderMesh(
        meshes.donut_render(*SIZES, segments=detail, around=detail // 2),
        texture=meshes.donut_texture(),
        interpolant=interpolant,
    )
    dough = Body(
        meshes.donut(*SIZES),
        NeoHookean(young, 0.4, 600.0),
        tuple(vertices),
        "donut",
        velocity=(0.0, -1.5, 0.0),
        render=glazed,
    )
    places = (
        Placement((0.0, height, 0.0), 0.5, (1.0, 0.0, 0.3)),
        Placement((0.28, height + 0.68, -0.05), 0.9, (0.2, 0.0, 1.0)),
    )
    return Scene(
        bodies=dough.instances(*places),
        obstacles=(Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), name="table"),),
        loads=(Gravity((0.0, -9.81, 0.0)),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


def claim(run):
    """What is drawn follows what is simulated, on both levels, and the donuts come to the same places."""
    last, astray, ends, seen = run.info["steps"], 0.0, [], {}
    for level in run.levels:
        for mesh in run.render_meshes:
            mine, x = level.mesh.point_bodies == mesh.body, level.positions(last)
            drawn = level.render_weights(mesh) @ x
            outside = np.maximum(x[mine].min(axis=0) - drawn.min(axis=0), drawn.max(axis=0) - x[mine].max(axis=0))
            astray = max(astray, float(outside.max()))
            seen.setdefault(mesh.body, []).append(drawn.mean(axis=0))
        ends.append(float(level.positions(last)[:, 1].min()))
    apart = max(float(np.linalg.norm(np.ptp(middles, axis=0))) for middles in seen.values())
    simulated = ", ".join(f"{len(level.rest):,}" for level in run.levels)
    points = sum(len(mesh.points) for mesh in run.render_meshes)
    size = 2.0 * sum(SIZES)
    return [
        (
            f"What is drawn has {points:,} vertices, what is simulated {simulated} on the levels.",
            points > len(run.levels[-1].rest),
        ),
        (f"It stays with the dough: at the end it reaches at most {1000 * astray:.0f} mm beyond it.", astray < 0.03),
        (f"The drawn donuts end within {1000 * apart:.0f} mm of each other on the levels.", apart < 0.1 * size),
        ("Both lie above the table.", min(ends) > 0.0),
    ]


if __name__ == "__main__":
    pdvol.main(scene)
