"""One run in STARK, in a process of its own: `python -m benchmarks.stark.run_one JSON`.

PYTHONPATH names the folder of pystark. JSON has `file`, `settings` and `steps` of the scene, `out`, `cache`, the folder
of the code that STARK compiles, `cores`, how many threads it has, and `limit`, the CPU seconds after which the march
stops. `out` is an npz of the last
positions `last` (n, 3) [m] and, as JSON, `record`: for each step the seconds (of CPU with one thread, of the clock
with more; without storage), the Newton
iterations and the step [s] that was taken, and the milliseconds that a fixed loop took after each step.

STARK goes on where a solve has failed, with a harder contact or half of the step, and the time of failed solves
counts. So the times are those of the way to the scene's end, whatever the number of its steps.
"""

import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pystark

from benchmarks.common.run_one import Timer, TimeUp
from benchmarks.stark.shot import Given, given
from pdvol.runs.scene_file import load_shot
from pdvol.scene import Body, Plane, Rotation, Scene, rotation_matrix

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


def main(words: str) -> int:
    """Runs the scene; returns the exit code."""
    asked = json.loads(words)
    scene = load_shot(asked["file"], asked["settings"], asked["steps"]).scene
    shot = given(scene)
    simulation = pystark.Simulation(settings(scene, shot, Path(asked["cache"]), asked["cores"]))
    contact = pystark.EnergyFrictionalContact.GlobalParams()
    contact.default_contact_thickness = 0.5 * shot.dhat  # two thicknesses add up to dhat
    contact.min_contact_stiffness = HARD
    contact.friction_stick_slide_threshold = shot.eps_v
    contact.friction_enabled = shot.mu > 0
    simulation.interactions().contact().set_global_params(contact)
    bodies = [
        add_body(simulation, f"body {k}", shot.dhat, body, *mesh)
        for k, (body, mesh) in enumerate(zip(scene.bodies, shot.meshes, strict=True))
    ]
    walls = [box(simulation, f"plane {k}", shot.dhat, plane) for k, plane in enumerate(shot.planes)]
    surfaces = [surface(simulation, f"surface {k}", shot.dhat, *one[:2]) for k, one in enumerate(shot.surfaces)]
    rub([one.contact for one in bodies], [one.contact for one in (*walls, *surfaces)], shot.mu)
    turns = [(hold(simulation, bodies[0], vertices), motion) for vertices, motion in shot.turned]
    turns += [(one.inertia, motion) for one, (*_, motion) in zip(surfaces, shot.surfaces, strict=True)]
    timer = Timer(float(asked["limit"]))
    read = time.process_time if asked["cores"] == 1 else time.perf_counter
    steps = march(simulation, scene, turns, timer, read)
    sizes = [len(points) for points, _ in shot.meshes]
    last = [one.point_set.get_position(i) for one, size in zip(bodies, sizes, strict=True) for i in range(size)]
    np.savez(asked["out"], last=np.array(last), record=np.array(json.dumps({"ticks": timer.ticks, **steps})))
    return 0


# ---- the scene


def settings(scene: Scene, shot: Given, cache: Path, cores: int) -> "pystark.Settings":
    """Time step, gravity and stop criterion of the scene; no storage; otherwise STARK's own."""
    found = pystark.Settings()
    found.output.simulation_name = "shot"
    found.output.output_directory = str(cache / "logs")
    found.output.codegen_directory = str(cache / "code")
    found.output.fps = 0
    found.output.enable_frame_writes = False
    found.execution.n_threads = cores
    found.simulation.gravity = np.array(shot.gravity)
    found.simulation.max_time_step_size = scene.dt
    found.newton.step_tolerance = shot.tolerance
    found.newton.residual_tolerance_abs = RESIDUAL
    found.newton.projection_mode = pystark.ProjectionToPD.Progressive
    found.newton.linear_solver = pystark.LinearSolver.BDPCG
    found.newton.cg_rel_tolerance = LINEAR
    return found


def add_body(simulation, name: str, dhat: float, body: Body, points: np.ndarray, cells: np.ndarray):
    """A body of STARK's stable Neo-Hookean law, with lumped masses and without damping."""
    made = pystark.Volume.Params.Soft_Rubber()
    made.inertia.density, made.inertia.damping = body.material.density, 0.0
    made.strain.elasticity_only = True
    made.strain.youngs_modulus, made.strain.poissons_ratio = body.material.young, body.material.poisson
    made.strain.damping = 0.0
    made.contact.contact_thickness = 0.5 * dhat
    found = simulation.presets().deformables().add_volume(name, points, cells, made)
    for i in range(len(points) if any(body.velocity) else 0):
        found.point_set.set_velocity(i, np.array(body.velocity))
    return found


def box(simulation, name: str, dhat: float, plane: Plane):
    """A plane as the side of a fixed box; its normal lies along an axis."""
    normal = np.array(plane.normal) / np.linalg.norm(plane.normal)
    size = np.where(np.abs(normal) > 0.5, THICK, WIDE)
    thickness = pystark.EnergyFrictionalContact.Params().set_contact_thickness(0.5 * dhat)
    *_, found = simulation.presets().rigidbodies().add_box(name, 1.0, size, thickness)
    found.rigidbody.add_translation(np.array(plane.point) - 0.5 * THICK * normal)
    simulation.rigidbodies().add_constraint_fix(found.rigidbody)
    return found


def surface(simulation, name: str, dhat: float, points: np.ndarray, faces: np.ndarray):
    """A surface whose vertices are driven to where they should be; they have no mass."""
    made = pystark.PrescribedSurface.Params()
    made.inertia.stiffness, made.inertia.tolerance = HELD, ASTRAY
    made.contact.contact_thickness = 0.5 * dhat
    return simulation.presets().deformables().add_prescribed_surface(name, points, faces, made)


def transformation(motion: Rotation, time: float) -> tuple:
    """Shift [m], angle [degrees] and axis of a turn about its centre at a time [s]; STARK turns about the origin."""
    axis, centre = np.array(motion.axis), np.array(motion.centre)
    turn = rotation_matrix(motion.speed * time, axis, 3)
    return centre - turn @ centre, np.degrees(motion.speed) * time, axis / np.linalg.norm(axis)


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


def march(simulation, scene: Scene, turns: list, timer: Timer, read: Callable[[], float]) -> dict[str, list]:
    """Marches to the scene's end; lists with an entry for each step that was taken."""
    log, counted = simulation.logger(), 0
    found: dict[str, list] = {"seconds": [], "newton": [], "dt": []}
    spent, small = 0.0, STILL * scene.dt
    while (now := simulation.get_time()) < scene.dt * (scene.steps - STILL):
        after = now + simulation.get_time_step_size()
        for turn, motion in turns:
            turn.set_transformation(*transformation(motion, after))
        begin = read()
        simulation.run_one_time_step()
        spent += read() - begin
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
