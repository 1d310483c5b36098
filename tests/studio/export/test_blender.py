"""Exports as Blender imports them. PDVOL_BLENDER_PYTHON names a Python that has the package bpy (5.0.1 has a wheel for
CPython 3.11); without it these tests are skipped.
"""

import io
import json
import os
import subprocess
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import runs
from commands import SAFETY
from exported import write_usd
from pdvol.geometry.level_mesh import vertex_strain
from pdvol.store.reader import open_run
from pdvol.store.series import StepFields
from pdvol.store.writer import RunWriter
from pdvol.studio.export.exports import export_run
from pdvol.studio.export.frames import even_frames
from pdvol.studio.shown import GROUND, OBSTACLE, PALETTE, linear_colour
from rendered import entry_of, grown_box, write_render_meshes
from shapes import box

BLENDER = os.environ.get("PDVOL_BLENDER_PYTHON", "")
PROGRAM = Path(__file__).resolve().parents[2] / "helpers" / "in_blender.py"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not BLENDER, reason="PDVOL_BLENDER_PYTHON names no Python that has bpy"),
]
STEPS = 25
FLOAT32 = 2e-6  # m: positions of a few metres


@pytest.fixture(scope="module")
def half_second(tmp_path_factory):
    """0.5 s of two balls, a ground, a ball at rest and a ball that rises."""
    return runs.stored_run(tmp_path_factory.mktemp("stored") / "solid", 3, (150, 600), STEPS)


def in_blender(*arguments) -> dict:
    ended = subprocess.run(
        [BLENDER, str(PROGRAM), *map(str, arguments)], capture_output=True, text=True, timeout=SAFETY
    )
    assert ended.returncode == 0, ended.stderr
    (line,) = [line for line in ended.stdout.splitlines() if line.startswith("FOUND")]
    return json.loads(line.removeprefix("FOUND"))


EXPECTED_COLOURS = {"left": PALETTE[0], "right": PALETTE[1], "ground": GROUND, "ball": OBSTACLE, "ball_1": OBSTACLE}


def made_up_fields(run):
    """The force grows along x with a vertex's number, the stress with a cell's; both grow with time."""

    def of_level(number: int):
        points, cells = np.arange(len(run.levels[number].rest)), np.arange(len(run.levels[number].cells))
        return lambda step: StepFields(
            {"contact_force": step * np.outer(points, [1.0, 0.0, 0.0])}, {"von_mises": step * 1.0 * cells}
        )

    return of_level


def compare_fields(found: dict, run, rate: float) -> None:
    """The left body's attributes follow the frames. Velocities lead from a frame to the next one, where each frame has
    a sample of its own.
    """
    level = run.levels[1]
    mine = level.mesh.point_bodies[level.surface[:, 0]] == 0
    used, behind = np.unique(level.surface[mine]), level.mesh.boundary_cells[mine]
    frames = even_frames(level.steps, run.dt, rate)
    assert [int(number) for number in found] == [frame.code for frame in frames]
    for frame in frames:
        fields = found[str(int(frame.code))]
        strain = frame.sampled(lambda step: vertex_strain(level.mesh, level.positions(step)))[used]
        np.testing.assert_allclose(fields["strain"], strain, atol=1e-6)
        step = frame.step - 1 + frame.fraction
        np.testing.assert_allclose(np.array(fields["contact_force"])[:, 0], step * used, rtol=1e-6, atol=1e-6)
        np.testing.assert_allclose(fields["von_mises"], step * behind, rtol=1e-6, atol=1e-6)
    assert max(found["12"]["strain"]) > 0.1
    for before, after in pairwise(frames) if rate != 24.0 else ():
        way = (after.sampled(level.positions) - before.sampled(level.positions))[used] * rate
        np.testing.assert_allclose(found[str(int(before.code))]["velocity"], way, atol=1e-4)


@pytest.mark.parametrize(("kind", "rate"), [("usd", 24.0), ("usd", 30.0), ("pc2", 30.0), ("alembic", 24.0)])
def test_an_import_has_the_states_of_the_run(half_second, tmp_path, kind, rate):
    """Bodies and the moving obstacle at every frame; times, colours, and in USD fields."""
    if kind == "alembic":
        pytest.importorskip("alembic3d", reason="alembic3d is an optional extra")
    run = open_run(half_second)
    if kind == "usd":
        fps = None if rate == 24.0 else rate
        found = in_blender(kind, write_usd(run, [0, 1], tmp_path / "a", fps, made_up_fields(run)), "--fields")
        compare_fields(found["meshes"]["left"]["fields"], run, rate)
    else:
        found = in_blender(kind, export_run(half_second, kind, tmp_path, fps=rate)[0][-1])
    # Blender 5.0 takes the frames of a USD file and keeps the rate of its scene, which is 24 at first.
    assert (found["fps"], found["unit"]) == (24.0 if kind == "usd" else rate, 1.0)
    assert found["frames"] == [0, int(STEPS * runs.DT * rate)] and set(found["meshes"]) == set(EXPECTED_COLOURS)
    for name, code in EXPECTED_COLOURS.items() if kind != "alembic" else ():
        assert found["meshes"][name]["colour"] == pytest.approx([*linear_colour(code), 1], abs=1e-6)
    level = run.levels[1]
    bodies = [np.unique(level.surface[level.mesh.point_bodies[level.surface[:, 0]] == k]) for k in (0, 1)]
    moving = {name: lambda step, k=k: level.positions(step)[bodies[k]] for k, name in enumerate(("left", "right"))}
    for name, at in {**moving, "ball_1": run.obstacles[2].vertices}.items():
        for frame in even_frames(level.steps, run.dt, rate):
            seen = np.array(found["meshes"][name]["points"][str(int(frame.code))])
            np.testing.assert_allclose(seen, frame.sampled(at), atol=FLOAT32, err_msg=f"{name} at {frame}")


def test_usd_with_a_textured_render_mesh(tmp_path):
    """Blender takes the render mesh alone of a file that has both surfaces, with its seams and its texture."""
    mesh, surface = box(3, 2), grown_box(0.0, 1.0, 0.03)
    buffer = io.BytesIO()
    Image.new("RGB", (8, 8), (255, 0, 255)).save(buffer, "PNG")
    with RunWriter.create(tmp_path / "run", {"dt": 0.05, "steps": 4}, [mesh], ["left"]) as run:
        write_render_meshes(run.path, [entry_of(mesh, 0, surface, texture=(buffer.getvalue(), ".png"))])
        for step in range(5):
            run.write_state(0, step, mesh.points + [0.0, 0.0, 0.1 * step])
    (file,), _ = export_run(tmp_path / "run", "usd", tmp_path / "out", fps=20.0, surface="both")
    ((name, seen),) = in_blender("usd", file)["meshes"].items()
    assert (name, Path(seen["texture"]).name) == ("left_render", "left_render.png")
    np.testing.assert_allclose(seen["uvs"], surface.uvs[surface.uv_corners], atol=1e-6)
    for step in range(5):
        np.testing.assert_allclose(seen["points"][str(step)], surface.vertices + [0, 0, 0.1 * step], atol=FLOAT32)
