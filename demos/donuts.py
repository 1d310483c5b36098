"""Two glazed donuts fall on a table: what is simulated is dough of some hundred vertices, what is drawn are detailed
surfaces with a texture, which follow it on both levels.

pdvol run demos/donuts.py
pdvol export runs/donuts --format usd -o donuts
"""

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


if __name__ == "__main__":
    pdvol.main(scene)
