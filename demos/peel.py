"""A soft strip glued to a ceiling is pulled at one end, peels off from there, and falls on the floor.

The log's `terms` names the springs that have broken so far; both levels have the same springs.
"""

import pdvol
from pdvol import (
    Attachment,
    Barrier,
    Body,
    Force,
    Friction,
    Gravity,
    NeoHookean,
    Placement,
    Plane,
    Scene,
    Support,
    meshes,
)

LENGTH, THICKNESS, GAP = 1.0, 0.08, 4e-3  # m: of the strip, and between it and the ceiling


def scene(vertices=(80, 300), pull=450.0, strength=2500.0, stiffness=5e5, height=0.5, steps=120, dt=0.01):
    """`pull` [N per metre of depth] grows within half a second; the glue bears `strength` [N per metre of depth]."""
    soft = NeoHookean(2e5, 0.4, 1000.0)
    ceiling = Body(
        meshes.rectangle(1.2 * LENGTH, THICKNESS),
        soft,
        tuple(vertices),
        name="ceiling",
        placement=Placement(translate=(0.0, height + THICKNESS + GAP)),
    )
    strip = Body(
        meshes.rectangle(LENGTH, THICKNESS),
        soft,
        tuple(vertices),
        name="strip",
        placement=Placement(translate=(0.0, height)),
    )
    end = 0.4 * LENGTH
    return Scene(
        bodies=(ceiling, strip),
        attachments=(
            Attachment(
                "strip",
                "ceiling",
                lambda X: X[:, 1] > height + 0.499 * THICKNESS,
                stiffness=stiffness,
                breaking=strength,
            ),
        ),
        supports=(Support(lambda X: X[:, 1] > height + THICKNESS + GAP, body="ceiling"),),
        obstacles=(Plane((0.0, 0.0), (0.0, 1.0), name="floor"),),
        loads=(
            Gravity((0.0, -9.81)),
            Force(lambda t: (0.0, -pull * min(2.0 * t, 1.0)), lambda X: X[:, 0] > end, body="strip"),
        ),
        contact=(Barrier(), Friction(0.4)),
        dt=dt,
        steps=steps,
    )


if __name__ == "__main__":
    pdvol.main(scene)
