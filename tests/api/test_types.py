"""A type checker sees the public names with their types, and whether a term or an integrator of one's own fits."""

import re

from mypy import api

SCRIPT = """\
import numpy as np
import numpy.typing as npt
import pdvol
from pdvol import Body, NeoHookean, Scene, meshes

Array = npt.NDArray[np.float64]

class Pull(pdvol.Term):
    name = "pull"
    def __init__(self, model: pdvol.LevelModel, space: pdvol.LevelSpace):
        self.space, self.mask = space, space.from_input(model.free)
    def value(self, x: pdvol.Positions) -> float:
        return float(self.space.comm.allreduce(x.owned.sum()))
    def gradient(self, x: pdvol.Positions) -> Array:
        return np.ones_like(x.owned)

class Euler:
    states = 1
    def predict(self, past: tuple[pdvol.State, ...], dt: float) -> Array:
        return np.asarray(past[0].positions + dt * past[0].velocity)
    def weight(self, past: tuple[pdvol.State, ...], dt: float) -> float:
        return dt**2
    def velocity(self, positions: Array, past: tuple[pdvol.State, ...], dt: float) -> Array:
        return np.asarray((positions - past[0].positions) / dt)

class Blind(pdvol.Term):
    name = "blind"
    def __init__(self, model: pdvol.LevelModel, space: pdvol.LevelSpace): ...

body = Body((meshes.disc(0.1),), NeoHookean(1e5), name="ball")
scene = Scene((body,), dt=0.01, steps=3)
run = pdvol.run(scene, levels=0)
count: int = len(run.levels)
wrong: int = pdvol.run(scene)
Scene((body,), dt="fast", steps=3)
pdvol.simulate(scene)
march = pdvol.march(scene, levels=0, terms=(Pull,), integrator=Euler())
for step in march:
    height: float = step.positions[:, 1].min() + step.forces["pull"].sum() + step.report.energy["pull"]
Blind(march.model(0), march.hierarchy[0])
pdvol.march(scene, integrator=Pull)
stepper = pdvol.Stepper(march.model(0), march.hierarchy[0], integrator=Euler())
word: str = stepper.step(1, (pdvol.State(step.positions, step.velocity),)).positions
"""
WRONG = {"wrong: int": "assignment", 'dt="fast"': "arg-type", "simulate": "attr-defined", "Blind(march": "abstract"}
WRONG |= {"integrator=Pull)": "arg-type", "word: str": "assignment"}


UNREAD = """\
[mypy]
[mypy-IPython.*,pyvista.*,trimesh.*,matplotlib.*,meshio.*,imageio.*,jinja2.*]
follow_imports = skip
"""
"""Libraries on which no public type depends: reading them takes most of the time."""


def test_a_typed_user_script(tmp_path):
    path = tmp_path / "shot.py"
    path.write_text(SCRIPT)
    (tmp_path / "mypy.ini").write_text(UNREAD)
    words = ["--strict", "--follow-imports=silent", "--cache-dir", str(tmp_path / "cache")]
    words += ["--config-file", str(tmp_path / "mypy.ini")]
    found, errors, _ = api.run([*words, str(path)])
    assert errors == ""
    lines = [(int(n), code) for n, code in re.findall(r"shot\.py:(\d+): error: .*\[([a-z-]+)\]", found)]
    lines_of = lambda piece: [n for n, line in enumerate(SCRIPT.splitlines(), 1) if piece in line]
    assert lines == sorted((n, code) for piece, code in WRONG.items() for n in lines_of(piece)), found
    assert len(lines) == len(WRONG)
