"""A sponge roll bounces: turn lies upon turn, and level 0 cuts their corners (paper, figure "robust vertex-element
binding").

Between the corners the vertices of level 1 lie outside of level 0, many of them nearer to the next turn than to their
own. Which cells are they bound to?
"""

import numpy as np
from mpi4py import MPI

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Scene, meshes
from pdvol.levels.binding import INSIDE, bind
from pdvol.levels.space import LevelSpace
from pdvol.runs.run_metrics import motion_from_level_0
from recipes.closest_binding import closest_binding

TURNS = 2.25
FIRST = 0.06  # m, from the axis to the middle of the inner end
THICKNESS, WIDTH = 0.02, 0.12  # m, of the sponge, and along the axis
GROWTH = 0.11  # by which the radius grows a turn, beside the thickness: the gap between turns grows with it
CUTS = ((18, 2, 2), (144, 2, 6))  # boxes along, through and across the sponge, per level


def reach(turn):
    """From the axis to the middle of the sponge [m] after so many turns."""
    return (FIRST + THICKNESS / GROWTH) * (1.0 + GROWTH) ** turn - THICKNESS / GROWTH


def rolled(points):
    """A brick of `TURNS` x `THICKNESS` x `WIDTH`, rolled up about the z axis."""
    turn = points[:, 0] + TURNS / 2
    radius = reach(turn) + points[:, 1]
    angle = -2.0 * np.pi * turn
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), points[:, 2]])


def scene(young=2e5, height=0.03, speed=1.5, lean=8.0, spin=-5.0, mu=0.4, damping=0.01, steps=110, dt=0.01):
    """The roll is thrown down from `height` m at `speed` m/s, leaning by `lean` degrees and turning at `spin` rad/s."""
    return Scene(
        bodies=(
            Body(
                tuple(meshes.brick((TURNS, THICKNESS, WIDTH), cuts, rolled) for cuts in CUTS),
                NeoHookean(young, 0.4, 1000.0, damping=damping),
                name="roll",
                placement=Placement((0.0, reach(TURNS) + THICKNESS + height, 0.0), np.radians(lean), (1.0, 0.0, 0.0)),
                velocity=(0.0, -speed, 0.0),
                spin=(0.0, 0.0, spin),
            ),
        ),
        obstacles=(Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), name="ground"),),
        loads=(Gravity((0.0, -9.81, 0.0)),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


def turns(cuts):
    """How far along the sponge each vertex of a level lies [turns], as `meshes.brick` numbers them."""
    return np.repeat(np.linspace(0.0, TURNS, cuts[0] + 1), (cuts[1] + 1) * (cuts[2] + 1))


def outside(run, rule=bind):
    """The vertices of level 1 outside of level 0, and which of them a `rule` binds to another turn than their own."""
    coarse, fine = (level.mesh for level in run.levels[:2])
    binding = rule(fine, LevelSpace(coarse, MPI.COMM_SELF))
    own, home = (turns(CUTS[level]) for level in (1, 0))
    away = np.abs(home[coarse.cells[binding.cells]].mean(axis=1) - own)
    found = np.flatnonzero(binding.kind != INSIDE)
    return found, found[away[found] > 0.5]


def claim(run):
    """Every vertex is bound to its own turn, and the roll of level 1 moves as that of level 0."""
    found, wrong = outside(run)
    _, wrong_nearest = outside(run, closest_binding)
    last = motion_from_level_0(run)[-1]
    return [
        (
            f"Of the {len(found)} vertices of level 1 outside of level 0, {len(wrong)} are bound to another turn than"
            f" their own. The nearest cell would be one of another turn for {len(wrong_nearest)}.",
            len(wrong) == 0 and len(wrong_nearest) > 0.2 * len(found),
        ),
        (
            f"Level 1 ends {1000 * last['centre_drift']:.0f} mm and {last['angle_drift']:.1f} degrees from level 0.",
            last["centre_drift"] < THICKNESS and last["angle_drift"] < 10.0,
        ),
    ]


if __name__ == "__main__":
    pdvol.main(scene)
