"""A soft strip glued to a ceiling is pulled at one end, peels off from there, and falls on the floor.

The log's `terms` names the springs that have broken so far; both levels have the same springs.
"""

import numpy as np

import pdvol
from pdvol import (
    Attachment,
    Barrier,
    Body,
    Force,
    Friction,
    Gravity,
    Keyed,
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
    glued = lambda X: X[:, 1] > height + 0.499 * THICKNESS
    end, top = 0.4 * LENGTH, height + THICKNESS + GAP

    def bar(name, length, y):
        shape, place = meshes.rectangle(length, THICKNESS), Placement((0.0, y))
        return Body(shape, soft, tuple(vertices), name=name, placement=place)

    return Scene(
        bodies=(bar("ceiling", 1.2 * LENGTH, top), bar("strip", LENGTH, height)),
        attachments=(Attachment("strip", "ceiling", glued, stiffness=stiffness, breaking=strength),),
        supports=(Support(lambda X: X[:, 1] > top, body="ceiling"),),
        obstacles=(Plane((0.0, 0.0), (0.0, 1.0), name="floor"),),
        loads=(
            Gravity((0.0, -9.81)),
            Force(Keyed((0.0, 0.5), ((0.0, 0.0), (0.0, -pull))), lambda X: X[:, 0] > end, body="strip"),
        ),
        contact=(Barrier(), Friction(0.4)),
        dt=dt,
        steps=steps,
    )


def claim(run):
    """It peels off, spring by spring, at the same time on all levels."""
    broken = [[record["terms"].get("attachment", {}).get("broken", []) for record in x.log] for x in run.levels]
    begins = [next((i for i, found in enumerate(steps) if found), len(steps)) * run.dt for steps in broken]
    ends = [next((i for i, n in enumerate(map(len, steps)) if n == len(steps[-1])), 0) * run.dt for steps in broken]
    same = all(steps[-1] == broken[0][-1] for steps in broken)
    spans = ", ".join(f"from {begin:.2f} to {end:.2f} s" for begin, end in zip(begins, ends, strict=True))
    apart = max(max(times) - min(times) for times in (begins, ends))
    places = np.array([x.positions(run.info["steps"])[x.mesh.point_bodies == 1].mean(axis=0) for x in run.levels])
    falls = [x.rest[x.mesh.point_bodies == 1, 1].mean() - y for x, (_, y) in zip(run.levels, places, strict=True)]
    between = float(np.linalg.norm(places - places[0], axis=1).max())
    return [
        (f"All {len(broken[0][-1])} springs break, the same ones on all levels.", same and len(broken[0][-1]) > 15),
        (f"They break one after the other: {spans}.", all(e - b > 0.1 for b, e in zip(begins, ends, strict=True))),
        (f"On all levels at the same time, within {apart:.2f} s.", apart < 0.05),
        (
            f"At the end the strip has fallen, to places within {1000 * between:.0f} mm.",
            min(falls) > 0 and between < 0.03,
        ),
    ]


if __name__ == "__main__":
    pdvol.main(scene)
