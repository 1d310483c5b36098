"""Jelly animals thrown fast into a glass bowl (paper, section 5, jello in the bowl): a bear, a bunny and a frog, with
little friction.

Level 0 has about 500 vertices an animal: rough shapes, simulated quickly. The finest level shows their faces and the
ripples of the impact.
"""

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Rigid, Scene, meshes
from pdvol.runs.run_metrics import motion_from_level_0

RADIUS, DEPTH = 1.0, 0.6  # m, inside the bowl
# name, shape, place of its feet before it is turned, angle and axis of that turn, direction of the throw, spin
THROWN = (
    ("bear", meshes.creature, 0.75, (-0.95, 1.10, 0.10), 0.5, (0, 0, 1), (0.62, -0.78, -0.02), (0.0, 2.0, -4.0)),
    ("bunny", meshes.bunny, 0.80, (0.95, 1.30, 0.25), 0.4, (0, 0, 1), (-0.60, -0.80, -0.12), (3.0, 0.0, 4.0)),
    ("frog", meshes.frog, 0.48, (0.05, 1.75, -0.45), -0.5, (1, 0, 0), (0.0, -0.93, 0.36), (-4.0, 0.0, 1.0)),
)


def scene(
    vertices=(500, 1500, 4500, 13500), who=("bear", "bunny", "frog"), speed=6.0, young=6e4, mu=0.05, steps=60, dt=0.01
):
    """The animals `who`, with `vertices` each, are thrown at `speed` m/s. `young` is their stiffness [Pa]."""
    material = NeoHookean(young, 0.45, 1000.0)
    bodies = tuple(
        Body(
            make(height),
            material,
            tuple(vertices),
            name=name,
            placement=Placement(place, angle, axis),
            spin=spin,
            velocity=tuple(speed * part for part in way),
        )
        for name, make, height, place, angle, axis, way, spin in THROWN
        if name in who
    )
    return Scene(
        bodies=bodies,
        obstacles=(Rigid(meshes.bowl(RADIUS, DEPTH, 0.05), name="bowl", opacity=0.3),),
        loads=(Gravity((0.0, -9.81, 0.0)),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


def claim(run):
    """The animals end where level 0 puts them: in the bowl, and turned alike."""
    found = motion_from_level_0(run)[1:]
    places, angles = ([entry[key] for entry in found] for key in ("centre_drift", "angle_drift"))
    sentence = f"Animals of finer levels end at most {', '.join(f'{1000 * x:.0f}' for x in places)} mm and"
    sentence += f" {', '.join(f'{angle:.1f}' for angle in angles)} degrees from level 0, less than a twentieth of the"
    return [(f"{sentence} bowl's radius and 10 degrees.", max(places) < 0.05 * RADIUS and max(angles) < 10.0)]


if __name__ == "__main__":
    pdvol.main(scene)
