"""Attached bodies, levels side by side: the same numbers and the same broken springs as one after the other."""

import subprocess

import numpy as np

import pdvol
from commands import SAFETY, WITHOUT_PICTURE

SCENE = """
import pdvol
from pdvol import Attachment, Barrier, Body, Gravity, NeoHookean, Placement, Plane, Scene, Support, meshes

def scene(strength=900.0):
    soft = NeoHookean(1e5, 0.3, 1000.0)
    held = Body(meshes.rectangle(0.4, 0.1), soft, (30, 90), name="held", placement=Placement(translate=(0.0, 0.154)))
    hung = Body(meshes.rectangle(0.4, 0.2), soft, (30, 90), name="hung", velocity=lambda X: -2.0 * X[:, :1] * (0, 1))
    glue = Attachment("hung", "held", lambda X: X[:, 1] > 0.099, stiffness=5e5, breaking=strength)
    return Scene(bodies=(held, hung), dt=0.01, steps=12, loads=(Gravity((0.0, -9.81)),), attachments=(glue,),
                 supports=(Support(lambda X: X[:, 1] > 0.2, body="held"),), contact=(Barrier(),))
"""


def test_springs_break_alike_side_by_side(tmp_path):
    """To the last bit, on both levels; some springs break early, and what has broken is in the log."""
    (tmp_path / "hung.py").write_text(SCENE)
    runs = []
    for out, more in (("one_after_the_other", []), ("side_by_side", ["--wavefront"])):
        words = [*WITHOUT_PICTURE, "run", "hung.py", "--no-xdmf", "--out", out, *more]
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=SAFETY)
        assert done.returncode == 0, done.stderr
        runs.append(pdvol.open_run(tmp_path / out))
    for one, other in zip(*(run.levels for run in runs), strict=True):
        assert one.steps == other.steps == 13
        for step in range(one.steps):
            np.testing.assert_array_equal(one.positions(step), other.positions(step))
        broken = [[record["terms"].get("attachment", {}).get("broken", []) for record in x.log] for x in (one, other)]
        assert broken[0] == broken[1] and broken[0][0] == []
        assert len({len(found) for found in broken[0]}) >= 3, "they break one after the other"
