"""Every demo builds its scene. Those without a page in the gallery run short and coarse, with nothing interpenetrating;
test_claims.py runs the others.
"""

from pathlib import Path

import numpy as np
import pytest

from demos.gallery.shown import ENTRIES
from pdvol import Scene, Surface, open_run
from pdvol.cli import run
from pdvol.geometry.closed_surfaces import enclosed_volume
from pdvol.measure.verify import verify_run
from pdvol.meshing.decimate import topology
from pdvol.meshing.validate import check_surface
from pdvol.runs.scene_file import load_module

ROOT = Path(__file__).resolve().parents[2]
OWN_LOOPS = {"own_energy"}  # have no scene but a time loop of their own: tests/api/test_own_energy.py runs them
DEMOS = sorted(path for path in (ROOT / "demos").glob("*.py") if path.stem not in OWN_LOOPS)
RUN_HERE = {"phong", "slit_array", "tracks"}
"""Those without a page in the gallery."""
SLOW = pytest.mark.slow


SIZES = {
    "dice_and_wizard": {"gnome": (1, 0.6), "block": (1, 0.4)},
    "leaf_sheep": {"sheep 1": (2, 0.36), "plant": (1, 0.6), "stone": (0, 0.34)},
    "phong": {"dolphin": (1, 1.0)},
}
"""Of figures that are made to measure: axis and size [m]."""


@pytest.mark.parametrize("demo", DEMOS, ids=lambda path: path.stem)
def test_builds_its_scene(demo):
    """Of surfaces that the pre-flight checks accept: whole, with one hole at most, of their size."""
    module = load_module(demo)
    scene = module.scene()
    assert isinstance(scene, Scene)
    assert scene.levels >= 2 and scene.steps > 0
    named = [(thing.name, getattr(thing, "shape", None)) for thing in (*scene.bodies, *scene.obstacles)]
    several = [(name, shape if isinstance(shape, tuple) else (shape,)) for name, shape in named]
    shapes = {name: shape for name, each in several for shape in each if isinstance(shape, Surface)}
    for shape in {id(shape): shape for shape in shapes.values()}.values():
        checked = check_surface(shape)
        assert topology(checked.triangles, len(checked.vertices)) in ((1, 2), (1, 0))
        assert enclosed_volume(shape.vertices, shape.triangles) > 0.0
    for name, (axis, size) in SIZES.get(demo.stem, {}).items():
        assert np.ptp(shapes[name].vertices[:, axis]) == pytest.approx(size, rel=2e-3)
    assert module.__doc__ and module.scene.__doc__
    assert len(demo.read_text().splitlines()) < 150
    assert demo.read_text().rstrip().endswith('if __name__ == "__main__":\n    pdvol.main(scene)')


def test_every_demo_is_run_by_a_test():
    gallery = {entry.name for entry in ENTRIES}  # run by test_claims.py
    assert {demo.stem for demo in DEMOS} == RUN_HERE | gallery


SHORT = [
    # demo, number of steps, options
    ("slit_array", 6, ("--set", "height=0.05", "--set", "consistency=0.025")),
    ("tracks", 10, "--method tracks --set vertices=(100,200) --set height=0.02 --set weight=0.01".split()),
    # a minute of meshing where the dolphin's levels are not kept yet
    pytest.param("phong", 10, "--prolongation phong --set vertices=(60,150) --set height=0.64".split(), marks=SLOW),
]


@pytest.mark.parametrize(("demo", "steps", "words"), SHORT)
def test_without_a_page_in_the_gallery(demo, steps, words, tmp_path):
    words = [*words, "--levels", "0:1", "--steps", str(steps), "--no-picture", "--no-xdmf", "--out", tmp_path / "run"]
    assert run(["run", str(ROOT / "demos" / f"{demo}.py"), *map(str, words)]) == 0
    stored = open_run(tmp_path / "run")
    assert [level.steps for level in stored.levels] == [steps + 1] * 2 and verify_run(tmp_path / "run") == []
    for level in stored.levels:
        assert max(record["contacts"] for record in level.log) > 0, f"level {level.index} touched nothing"
    tied = max(record["energy"]["consistency"] for record in stored.levels[1].log)
    assert (tied > 0.0) == (demo != "phong") and (stored.info["prolongation"] == "phong") == (demo == "phong")


def test_a_solid_coarse_level_is_found_before_anything_runs(capsys):
    assert run(["check", str(ROOT / "demos" / "hollow_cube.py"), "--set", "coarse=solid", "--measure", "0"]) == 2
    said = capsys.readouterr().out
    assert "level 0: body 'ball' lies inside body 'cube'" in said
    assert "on level 1 they are apart: give level 0 more vertices or a mesh of its own" in said
