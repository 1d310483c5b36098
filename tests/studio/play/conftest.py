"""A run with a render mesh."""

import io

import numpy as np
import pytest
from PIL import Image

from pdvol.store.obstacles import write_obstacles
from pdvol.store.writer import RunWriter
from rendered import entry_of, grown_box, write_render_meshes
from runs import OBSTACLES
from shapes import box, together

DETAILED_STATES = 6


@pytest.fixture
def detailed_run(tmp_path):
    """Two boxes that fall and turn; the left one carries a larger box, blue above and green below. A test may damage
    it.
    """
    pixels = np.zeros((8, 8, 3), dtype=np.uint8)
    pixels[:4], pixels[4:] = (0, 0, 255), (0, 255, 0)
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    mesh = together(box(3, 2, [-1.2, 0.0, 1.0], [-0.2, 1.0, 2.0]), box(3, 2, [0.4, 0.0, 1.0], [1.4, 1.0, 2.0]))
    surface = grown_box([-1.2, 0.0, 1.0], [-0.2, 1.0, 2.0], 0.1)
    info = {"scene": "detailed", "dt": 0.05, "steps": DETAILED_STATES - 1, "method": "direct", "up": [0.0, 0.0, 1.0]}
    with RunWriter.create(tmp_path / "detailed", info, [mesh], ["left", "right"]) as run:
        write_obstacles(run.path, OBSTACLES[3])
        write_render_meshes(run.path, [entry_of(mesh, 0, surface, texture=(buffer.getvalue(), ".png"))])
        for step in range(DETAILED_STATES):
            turn = 0.08 * step
            x = mesh.points @ np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]]).T
            run.write_state(0, step, x - [0.0, 0.0, 0.1 * step])
    return tmp_path / "detailed"
