"""Materials through the command line: the law of docs/scenes.md, regions on two levels, and what a run keeps."""

from pathlib import Path

import numpy as np

import pages
from cli_scenes import pdvol, write
from pdvol import open_run

SCENES = Path(__file__).resolve().parents[2] / "docs" / "scenes.md"

SCENE = '''
import pdvol
from pdvol import Body, FixedCorotational, Gravity, Placement, Region, Scene, Support, meshes
{material}

def scene(fibres=1e5, young=1e6, damping=0.0):
    """A beam with muscle fibres in its lower half and a stiff tip."""
    muscle = Region(Muscle(young, fibres=fibres, along=lambda X: 0.0 * X + (1.0, 0.0)), lambda X: X[:, 1] < 0.1)
    tip = Region(FixedCorotational(2e10, density=2000.0), lambda X: X[:, 0] > 0.8)
    beam = Body(meshes.rectangle(1.0, 0.2), FixedCorotational(young, damping=damping), vertices=(40, 90), name="beam",
                placement=Placement(translate=(0.5, 0.1)), regions=(muscle, tip))
    held = Support(lambda X: X[:, 0] < 0.01)
    return Scene((beam,), dt=0.02, steps=15, loads=(Gravity((0.0, -9.81)),), supports=(held,))
'''


def sag(folder, fibres):
    """The levels of a run with so stiff fibres [Pa], and how far the beam sinks on each [m]."""
    out = folder / f"run_{fibres}"
    assert pdvol("run", folder / "beam.py", "--out", out, "--set", f"fibres={fibres}") == 0
    levels = open_run(out).levels
    return levels, [(x.positions(15) - x.rest)[x.rest[:, 0] > 0.99, 1].mean() for x in levels]


def test_the_documented_material_and_regions_run(tmp_path, capsys):
    (material,) = [block.code for block in pages.blocks(SCENES) if "class Muscle" in block.code]
    write(tmp_path / "beam.py", SCENE.format(material=material))
    (levels, plain), (_, fibrous) = sag(tmp_path, 0.0), sag(tmp_path, 1e7)
    for loose, held in zip(plain, fibrous, strict=True):
        assert loose < 1.5 * held < 0.0, "fibres hold the beam up"
    assert abs(plain[0] - plain[1]) < 0.1 * abs(plain[0]), "levels agree"
    # The tip is as good as rigid: its edges keep their lengths while the beam bends.
    for level in levels:
        cells = level.cells[(level.rest[level.cells][:, :, 0] > 0.85).all(axis=1)]
        assert len(cells) > 0
        rest, now = (
            np.linalg.norm(x[cells] - x[np.roll(cells, 1, 1)], axis=2) for x in (level.rest, level.positions(15))
        )
        assert np.abs(now / rest - 1.0).max() < 1e-4
    assert pdvol("info", tmp_path / "beam.py") == 0
    printed = capsys.readouterr().out
    said = "FixedCorotational, young 1e+06 Pa", "Muscle", "along by position", "young 2e+10 Pa", "plane strain"
    assert all(part in printed for part in said) and "damping" not in printed
    assert pdvol("metrics", tmp_path / "run_0.0") == 0
