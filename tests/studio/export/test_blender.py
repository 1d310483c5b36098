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


def colours(found: dict) -> dict[str, list[float]]:
    return {name: mesh["colour"] for name, mesh in found["meshes"].items()}


EXPECTED_COLOURS = {
    "left": [*linear_colour(PALETTE[0]), 1],
    "right": [*linear_colour(PALETTE[1]), 1],
    "ground": [*linear_colour(GROUND), 1],
    "ball": [*linear_colour(OBSTACLE), 1],
    "ball_1": [*linear_colour(OBSTACLE), 1],
}


def compare(found: dict, path: Path, level: int, fps: float, tolerance: float = FLOAT32) -> None:
    """Bodies and the moving obstacle at every frame, with the states of the run."""
    run = open_run(path)
    stored = run.levels[level]
    owners = stored.mesh.point_bodies[stored.surface[:, 0]]

    def body(number: int):
        used = np.unique(stored.surface[owners == number])
        return lambda step: stored.positions(step)[used]

    expected = {"left": body(0), "right": body(1), "ball_1": run.obstacles[2].vertices}
    for name, at in expected.items():
        for frame in even_frames(stored.steps, run.dt, fps):
            seen = np.array(found["meshes"][name]["points"][str(int(frame.code))])
            np.testing.assert_allclose(seen, frame.sampled(at), atol=tolerance, err_msg=f"{name} at {frame}")


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
    if rate != 24.0:
        for before, after in pairwise(frames):
            way = (after.sampled(level.positions) - before.sampled(level.positions))[used] * rate
            np.testing.assert_allclose(found[str(int(before.code))]["velocity"], way, atol=1e-4)


@pytest.mark.parametrize("fps", [None, 30.0])
def test_usd(half_second, tmp_path, fps):
    run = open_run(half_second)
    file = write_usd(run, [0, 1], tmp_path / "a", fps, made_up_fields(run))
    found = in_blender("usd", file, "--fields", "--picture", tmp_path / "frame.png")
    rate = fps or 24.0
    # Blender 5.0 takes the frames of a file and keeps the rate of its scene, which is 24 at first.
    assert (found["fps"], found["unit"], found["frames"]) == (24.0, 1.0, [0, int(STEPS * runs.DT * rate)])
    assert colours(found) == {name: pytest.approx(colour, abs=1e-6) for name, colour in EXPECTED_COLOURS.items()}
    assert found["meshes"]["left"]["attributes"].items() >= {"rest": "POINT", "velocity": "POINT"}.items()
    assert found["meshes"]["ball"]["modifiers"] == [] and len(found["meshes"]["ground"]["points"]["0"]) == 4
    compare(found, half_second, 1, rate)
    compare_fields(found["meshes"]["left"]["fields"], run, rate)
    picture = np.asarray(Image.open(tmp_path / "frame.png").convert("RGB"), dtype=float)
    for code in PALETTE[:2]:  # some pixels have a body's hue, whatever the light
        colour = np.array([int(code[i : i + 2], 16) for i in (1, 3, 5)], dtype=float)
        angle = (picture @ colour) / (np.linalg.norm(picture, axis=2) * np.linalg.norm(colour) + 1e-9)
        assert (angle > np.cos(np.radians(4))).mean() > 0.01


def test_usd_with_a_textured_render_mesh(tmp_path):
    """Blender takes the render mesh alone of a file that has both surfaces, with its seams and its texture."""
    mesh, surface = box(3, 2), grown_box(0.0, 1.0, 0.03)
    pixels = np.zeros((8, 8, 3), dtype=np.uint8)
    pixels[:, :4], pixels[:, 4:] = (255, 0, 255), (0, 255, 0)
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    with RunWriter.create(tmp_path / "run", {"dt": 0.05, "steps": 4}, [mesh], ["left"]) as run:
        write_render_meshes(run.path, [entry_of(mesh, 0, surface, texture=(buffer.getvalue(), ".png"))])
        for step in range(5):
            run.write_state(0, step, mesh.points + [0.0, 0.0, 0.1 * step])
    (file,), _ = export_run(tmp_path / "run", "usd", tmp_path / "out", fps=20.0, surface="both")
    found = in_blender("usd", file, "--picture", tmp_path / "frame.png")
    assert list(found["meshes"]) == ["left_render"]
    seen = found["meshes"]["left_render"]
    assert Path(seen["texture"]).name == "left_render.png"
    np.testing.assert_allclose(seen["uvs"], surface.uvs[surface.uv_corners], atol=1e-6)
    for step in range(5):
        np.testing.assert_allclose(seen["points"][str(step)], surface.vertices + [0, 0, 0.1 * step], atol=FLOAT32)
    picture = np.asarray(Image.open(tmp_path / "frame.png").convert("RGB"), dtype=int)
    red, green, blue = picture[..., 0], picture[..., 1], picture[..., 2]
    assert (np.minimum(red, blue) - green > 60).mean() > 0.03 and (green - np.maximum(red, blue) > 60).mean() > 0.03


@pytest.mark.parametrize("fps", [30.0])
def test_pc2(half_second, tmp_path, fps):
    written, _ = export_run(half_second, "pc2", tmp_path, fps=fps)
    found = in_blender("pc2", written[-1], "--picture", tmp_path / "frame.png")
    rate = fps or 24.0
    assert (found["fps"], found["frames"]) == (rate, [0, int(STEPS * runs.DT * rate)])
    assert colours(found) == {name: pytest.approx(colour, abs=1e-6) for name, colour in EXPECTED_COLOURS.items()}
    moving = {name for name, mesh in found["meshes"].items() if mesh["modifiers"] == ["MESH_CACHE"]}
    assert moving == {"left", "right", "ball_1"}
    compare(found, half_second, 1, rate)


def test_alembic(half_second, tmp_path):
    pytest.importorskip("alembic3d", reason="alembic3d is an optional extra")
    written, _ = export_run(half_second, "alembic", tmp_path, fps=24.0)
    found = in_blender("alembic", written[-1], "--picture", tmp_path / "frame.png")
    assert (found["fps"], found["frames"]) == (24.0, [0, int(STEPS * runs.DT * 24)])
    assert set(found["meshes"]) == set(EXPECTED_COLOURS)
    compare(found, half_second, 1, 24.0)
