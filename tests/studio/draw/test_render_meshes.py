"""Render meshes in pictures: with their textures the right way up, and only where they are asked for."""

import io

import numpy as np
import pytest
from PIL import Image

from pdvol.store.reader import open_run
from pdvol.store.writer import RunWriter
from pdvol.studio.draw.picture import render
from pdvol.studio.draw.views import Shot
from pdvol.studio.shown import PALETTE
from rendered import entry_of, grown_box
from shapes import box


@pytest.fixture
def painted(tmp_path):
    """A box whose faces are blue above and green below."""
    pixels = np.zeros((8, 8, 3), dtype=np.uint8)
    pixels[:4], pixels[4:] = (0, 0, 255), (0, 255, 0)
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    mesh = box(3, 2)
    with RunWriter.create(tmp_path / "run", {"dt": 0.05, "steps": 0}, [mesh], ["left"]) as run:
        run.write_render_meshes([entry_of(mesh, 0, grown_box(0.0, 1.0, 0.03), texture=(buffer.getvalue(), ".png"))])
        run.write_state(0, 0, mesh.points)
    return open_run(tmp_path / "run")


def shares(path) -> tuple[np.ndarray, ...]:
    """Where a picture is blue, green, and of the colour of the first body."""
    picture = np.asarray(Image.open(path).convert("RGB"), dtype=int)
    body = np.array([int(PALETTE[0][i : i + 2], 16) for i in (1, 3, 5)], dtype=float)
    cosine = (picture @ body) / (np.linalg.norm(picture, axis=2) * np.linalg.norm(body) + 1e-9)
    red, green, blue = picture[..., 0], picture[..., 1], picture[..., 2]
    return blue - np.maximum(red, green) > 60, green - np.maximum(red, blue) > 60, cosine > np.cos(np.radians(4))


def test_a_picture_with_its_texture(painted, tmp_path):
    blue, green, body = shares(render(painted, tmp_path / "a.png", shot=Shot("front", render_meshes=True)))
    assert blue.mean() > 0.05 and green.mean() > 0.05 and body.mean() < 0.001
    height = lambda mask: np.nonzero(mask)[0].mean()
    assert height(blue) < height(green) - 20, "the upper half of the texture is drawn below"
    blue, green, body = shares(render(painted, tmp_path / "b.png", shot=Shot("front")))
    assert blue.mean() == green.mean() == 0.0 and body.mean() > 0.1
