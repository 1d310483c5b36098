"""One run in STARK, in a process of its own: `python -m benchmarks.stark.run_one SHOT.npz OUT.npz CACHE SECONDS`.

PYTHONPATH names the folder of pystark. SHOT.npz is what shot.py wrote. STARK keeps the code that it compiles in the
folder CACHE. The march stops after SECONDS of CPU time. OUT.npz has the last positions `last` (n, 3) [m] and, as JSON,
`record`: for each step the CPU seconds (user and system, without storage), the Newton iterations and the step [s]
that was taken, and the milliseconds that a fixed loop took after each step.

STARK goes on where a solve has failed, with a harder contact or half of the step, and the time of failed solves
counts. So the times are those of the way to the scene's end, whatever the number of its steps.
"""

import json
import os
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pystark

from benchmarks.common.run_one import Timer, TimeUp
from pdvol.scene import rotation_matrix

THICK, WIDE = 0.1, 4.0
"""Metres: the boxes that stand for planes."""
HELD, ASTRAY = 1e7, 1e-3
"""Stiffness [N/m] of supports at the start, and the distance [m] from their places above which STARK hardens it."""
HARD = 1e6
"""Stiffness of contact at the start, STARK's own default; it hardens where surfaces cross."""
LINEAR = 1e-4
"""Relative tolerance of the linear solver, STARK's own default."""
RESIDUAL = 1e-12
"""Residual that would stop Newton: so small that the length of the full step does."""
STILL = 1e-9
"""Share of a step below which time has not advanced."""


def main(shot: str, out: str, cache: str, seconds: str) -> int:
    """Runs the scene; returns the exit code."""
    with np.load(shot) as arrays:
        scene = json.loads(str(arrays["scene"]))
        meshes = [(arrays[f"points_{k}"], arrays[f"cells_{k}"]) for k in range(len(scene["bodies"]))]
        turned = [arrays[f"turned_{k}"] for k in range(len(scene["turns"]))]
        rigid = [(arrays[f"surface_{k}"], arrays[f"faces_{k}"]) for k in range(len(scene["surfaces"]))]
    simulation = pystark.Simulation(settings(scene, Path(cache)))
    contact = pystark.EnergyFrictionalContact.GlobalParams()
    contact.default_contact_thickness = 0.5 * scene["dhat"]  # two thicknesses add up to dhat
    contact.min_contact_stiffness = HARD
    contact.friction_stick_slide_threshold = scene["eps_v"]
    contact.friction_enabled = scene["mu"] > 0
    simulation.interactions().contact().set_global_params(contact)
    bodies = [
        body(simulation, f"body {k}", scene["dhat"], described, *mesh)
        for k, (described, mesh) in enumerate(zip(scene["bodies"], meshes, strict=True))
    ]
    walls = [box(simulation, f"plane {k}", scene["dhat"], plane) for k, plane in enumerate(scene["planes"])]
    surfaces = [surface(simulation, f"surface {k}", scene["dhat"], *mesh) for k, mesh in enumerate(rigid)]
    rub([one.contact for one in bodies], [one.contact for one in (*walls, *surfaces)], scene["mu"])
    turns = [hold(simulation, bodies[0], vertices) for vertices in turned] + [one.inertia for one in surfaces]
    timer = Timer(float(seconds))
    steps = march(simulation, scene, turns, timer)
    last = [
        one.point_set.get_position(i) for one, mesh in zip(bodies, meshes, strict=True) for i in range(len(mesh[0]))
    ]
    np.savez(out, last=np.array(last), record=np.array(json.dumps({"ticks": timer.ticks, **steps})))
    return 0


# ---- the scene


def settings(scene: dict, cache: Path) -> "pystark.Settings":
    """Time step, gravity and stop criterion of the scene; one thread, no storage; otherwise STARK's own."""
    found = pystark.Settings()
    found.output.simulation_name = "shot"
    found.output.output_directory = str(cache / "logs")
    found.output.codegen_directory = str(cache / "code")
    found.output.fps = 0
    found.output.enable_frame_writes = False
    found.execution.n_threads = 1
    found.simulation.gravity = np.array(scene["gravity"])
    found.simulation.max_time_step_size = scene["dt"]
    found.newton.step_tolerance = scene["tolerance"]
    found.newton.residual_tolerance_abs = RESIDUAL
    found.newton.projection_mode = pystark.ProjectionToPD.Progressive
    found.newton.linear_solver = pystark.LinearSolver.BDPCG
    found.newton.cg_rel_tolerance = LINEAR
    return found


def body(simulation, name: str, dhat: float, described: dict, points: np.ndarray, cells: np.ndarray):
    """A body of STARK's stable Neo-Hookean law, with lumped masses and without damping."""
    made = pystark.Volume.Params.Soft_Rubber()
    made.inertia.density, made.inertia.damping = described["density"], 0.0
    made.strain.elasticity_only = True
    made.strain.youngs_modulus, made.strain.poissons_ratio = described["young"], described["poisson"]
    made.strain.damping = 0.0
    made.contact.contact_thickness = 0.5 * dhat
    found = simulation.presets().deformables().add_volume(name, points, cells, made)
    for i in range(len(points) if any(described["velocity"]) else 0):
        found.point_set.set_velocity(i, np.array(described["velocity"]))
    return found


def box(simulation, name: str, dhat: float, plane: dict):
    """A plane as the side of a fixed box; its normal lies along an axis."""
    normal = np.array(plane["normal"]) / np.linalg.norm(plane["normal"])
    size = np.where(np.abs(normal) > 0.5, THICK, WIDE)
    thickness = pystark.EnergyFrictionalContact.Params().set_contact_thickness(0.5 * dhat)
    *_, found = simulation.presets().rigidbodies().add_box(name, 1.0, size, thickness)
    found.rigidbody.add_translation(np.array(plane["point"]) - 0.5 * THICK * normal)
    simulation.rigidbodies().add_constraint_fix(found.rigidbody)
    return found


def surface(simulation, name: str, dhat: float, points: np.ndarray, faces: np.ndarray):
    """A surface whose vertices are driven to where they should be; they have no mass."""
    made = pystark.PrescribedSurface.Params()
    made.inertia.stiffness, made.inertia.tolerance = HELD, ASTRAY
    made.contact.contact_thickness = 0.5 * dhat
    return simulation.presets().deformables().add_prescribed_surface(name, points, faces, made)


def transformation(described: dict, time: float) -> tuple:
    """Shift [m], angle [degrees] and axis of a turn about its centre at a time [s]; STARK turns about the origin."""
    axis, centre = np.array(described["axis"]), np.array(described.get("centre", (0.0, 0.0, 0.0)))
    turn = rotation_matrix(described["speed"] * time, axis, 3)
    return centre - turn @ centre, np.degrees(described["speed"]) * time, axis / np.linalg.norm(axis)


def rub(bodies: list, walls: list, mu: float) -> None:
    """Friction between all bodies, and between bodies and walls; walls do not meet each other."""
    for k, one in enumerate(bodies):
        for other in [*bodies[k + 1 :], *walls] if mu > 0 else ():
            one.set_friction(other, mu)
    for k, one in enumerate(walls):
        for other in walls[k + 1 :]:
            one.disable_collision(other)


def hold(simulation, held, vertices: np.ndarray):
    """A support of some vertices of a body."""
    stiff = pystark.EnergyPrescribedPositions.Params().set_stiffness(HELD).set_tolerance(ASTRAY)
    return simulation.deformables().prescribed_positions().add(held.point_set, vertices, stiff)


# ---- its steps


def march(simulation, scene: dict, turns: list, timer: Timer) -> dict[str, list]:
    """Marches to the scene's end; lists with an entry for each step that was taken."""
    log, counted = simulation.logger(), 0
    found: dict[str, list] = {"seconds": [], "newton": [], "dt": []}
    spent, small = 0.0, STILL * scene["dt"]
    while (now := simulation.get_time()) < scene["dt"] * (scene["steps"] - STILL):
        after = now + simulation.get_time_step_size()
        for turn, described in zip(turns, scene["turns"] + scene["surfaces"], strict=True):
            turn.set_transformation(*transformation(described, after))
        begin = time.process_time()
        simulation.run_one_time_step()
        spent += time.process_time() - begin
        taken = simulation.get_time() - now
        if taken < small:  # the solve has failed, and STARK tries again
            if time.process_time() > timer.seconds:
                break
            continue
        solved = log.get_int_series("newton_iterations")
        for key, value in {"seconds": spent, "newton": sum(solved[counted:]), "dt": taken}.items():
            found[key].append(value)
        counted, spent = len(solved), 0.0
        try:
            timer.step(SimpleNamespace())
        except TimeUp:
            break
    return found


if __name__ == "__main__":
    code = main(*sys.argv[1:])
    sys.stdout.flush()
    os._exit(code)  # pystark's objects must not outlive its module, and the interpreter would end them in any order
