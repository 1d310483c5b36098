"""Materials through the command line: the law of docs/scenes.md, regions on two levels, and what a run keeps."""

from pathlib import Path

import numpy as np
import pytest

import pages
from pdvol import open_run
from pdvol.cli import run

SCENES = Path(__file__).resolve().parents[2] / "docs" / "scenes.md"

SCENE = '''
import pdvol
from pdvol import Body, FixedCorotational, Gravity, Placement, Region, Scene, Support, meshes
{material}

def scene(fibres=1e5, young=1e6, damping=0.0):
    """A beam with muscle fibres in its lower half and a stiff tip."""
    muscle = Region(Muscle(young, fibres=fibres), lambda X: X[:, 1] < 0.1)
    tip = Region(FixedCorotational(2e10, density=2000.0), lambda X: X[:, 0] > 0.8)
    beam = Body(meshes.rectangle(1.0, 0.2), FixedCorotational(young, damping=damping), vertices=(40, 90), name="beam",
                placement=Placement(translate=(0.5, 0.1)), regions=(muscle, tip))
    held = Support(lambda X: X[:, 0] < 0.01)
    return Scene((beam,), dt=0.02, steps=15, loads=(Gravity((0.0, -9.81)),), supports=(held,))
'''


@pytest.fixture(scope="module")
def beam(tmp_path_factory):
    folder = tmp_path_factory.mktemp("beam")
    (material,) = [block.code for block in pages.blocks(SCENES) if "class Muscle" in block.code]
    (folder / "beam.py").write_text(SCENE.format(material=material))
    return folder


def sag(folder, name, *words):
    assert run(["run", str(folder / "beam.py"), "--out", str(folder / name), *words]) == 0
    levels = open_run(folder / name).levels
    return [
        level.positions(15)[level.rest[:, 0] > 0.99, 1].mean() - level.rest[level.rest[:, 0] > 0.99, 1].mean()
        for level in levels
    ]


@pytest.fixture(scope="module")
def plain(beam):
    """How far the beam without fibres sinks on each level [m]."""
    return sag(beam, "plain", "--set", "fibres=0.0")


def test_the_documented_material_and_regions_run(beam, plain, capsys):
    fibrous = sag(beam, "fibrous", "--set", "fibres=1e7")
    for loose, held in zip(plain, fibrous, strict=True):
        assert loose < 1.5 * held < 0.0, "fibres hold the beam up"
    assert abs(plain[0] - plain[1]) < 0.1 * abs(plain[0]), "levels agree"
    # The tip is as good as rigid: its edges keep their lengths while the beam bends.
    for level in open_run(beam / "plain").levels:
        cells = level.cells[(level.rest[level.cells][:, :, 0] > 0.85).all(axis=1)]
        assert len(cells) > 0
        for a, b in ((0, 1), (1, 2), (2, 0)):
            rest, now = (
                np.linalg.norm(x[cells[:, a]] - x[cells[:, b]], axis=1) for x in (level.rest, level.positions(15))
            )
            assert np.abs(now / rest - 1.0).max() < 1e-4
    assert run(["info", str(beam / "beam.py")]) == 0
    told = capsys.readouterr().out
    said = ("FixedCorotational, young 1e+06 Pa", "Muscle", "fibres 100000", "young 2e+10 Pa", "plane strain")
    assert all(part in told for part in said) and "damping" not in told
    assert run(["metrics", str(beam / "plain")]) == 0
