"""Keyed loads and muscles, levels side by side: the same numbers as one after the other."""

import subprocess

import numpy as np

import pdvol
from commands import SAFETY, WITHOUT_PICTURE

SCENE = """
from pdvol import Barrier, Body, Flow, Friction, Gravity, Keyed, Muscle, NeoHookean, Placement, Plane, Scene, meshes

def scene():
    soft = NeoHookean(Keyed((0.0, 0.1), (1e5, 6e4)), 0.3, 1000.0)
    block = Body(meshes.rectangle(0.4, 0.2), soft, (30, 90), placement=Placement(translate=(0.0, 0.104)))
    loads = (Gravity(Keyed((0.0, 0.1), ((0.0, 0.0), (5.0, -9.81)))), Flow(Keyed((0.0, 0.1), ((0.0, 0.0), (3.0, 0.0)))))
    return Scene(bodies=(block,), dt=0.01, steps=12, loads=loads, contact=(Barrier(), Friction(0.2)),
                 muscles=(Muscle("body", (1.0, 0.0), 2e4, Keyed((0.0, 0.1), (0.0, 1.0))),),
                 obstacles=(Plane((0.0, 0.0), (0.0, 1.0)),))
"""


def test_keys_act_alike_side_by_side(tmp_path):
    """To the last bit, on both levels, which differ from each other and from rest."""
    (tmp_path / "keyed.py").write_text(SCENE)
    runs = []
    for out, more in (("one_after_the_other", []), ("side_by_side", ["--wavefront"])):
        words = [*WITHOUT_PICTURE, "run", "keyed.py", "--no-xdmf", "--out", out, *more]
        done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=SAFETY)
        assert done.returncode == 0, done.stderr
        runs.append(pdvol.open_run(tmp_path / out))
    for one, other in zip(*(run.levels for run in runs), strict=True):
        assert one.steps == other.steps == 13
        assert np.abs(one.positions(12) - one.rest).max() > 5e-3
        for step in range(one.steps):
            np.testing.assert_array_equal(one.positions(step), other.positions(step))
