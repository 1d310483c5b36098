"""A type checker sees the public names with their types, and whether a term or an integrator of one's own fits."""

import re
from pathlib import Path

from mypy import api

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = """\
# mypy: disallow-any-generics, disallow-subclassing-any, disallow-untyped-calls, disallow-incomplete-defs
# mypy: disallow-untyped-decorators, warn-return-any, strict-equality, extra-checks, no-implicit-reexport
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


def test_a_typed_user_script(tmp_path):
    path = tmp_path / "shot.py"
    path.write_text(SCRIPT)
    # The options and the cache of `./run mypy`, which CI has run before: reading all anew takes half a minute.
    words = ["--config-file", str(ROOT / "pyproject.toml"), "--cache-dir", str(ROOT / ".mypy_cache")]
    found, errors, _ = api.run([*words, str(path)])
    assert errors == ""
    lines = [(int(n), code) for n, code in re.findall(r"shot\.py:(\d+): error: .*\[([a-z-]+)\]", found)]
    lines_of = lambda piece: [n for n, line in enumerate(SCRIPT.splitlines(), 1) if piece in line]
    assert lines == sorted((n, code) for piece, code in WRONG.items() for n in lines_of(piece)), found
    assert len(lines) == len(WRONG)
