"""Every demo builds its scene, and each runs short and coarse, through what makes it worth watching, with nothing
interpenetrating.
"""

from pathlib import Path

import numpy as np
import pytest

from demos.gallery.shown import ENTRIES
from pdvol import Scene, open_run
from pdvol.cli import run
from pdvol.measure.verify import verify_run
from pdvol.runs.scene_file import load_module

ROOT = Path(__file__).resolve().parents[2]
OWN_LOOPS = {"own_energy"}  # have no scene but a time loop of their own: tests/api/test_own_energy.py runs them
DEMOS = sorted(path for path in (ROOT / "demos").glob("*.py") if path.stem not in OWN_LOOPS)
RUN_HERE = {"phong", "slit_array", "tracks"}
"""Those without a page in the gallery."""


@pytest.mark.parametrize("demo", DEMOS, ids=lambda path: path.stem)
def test_builds_its_scene(demo):
    module = load_module(demo)
    scene = module.scene()
    assert isinstance(scene, Scene)
    assert scene.levels >= 2 and scene.steps > 0
    assert module.__doc__ and module.scene.__doc__
    assert len(demo.read_text().splitlines()) < 150
    assert demo.read_text().rstrip().endswith('if __name__ == "__main__":\n    pdvol.main(scene)')


def test_every_demo_is_run_by_a_test():
    gallery = {entry.name for entry in ENTRIES}  # run by test_claims.py
    assert {demo.stem for demo in DEMOS} == RUN_HERE | gallery


def simulated(demo, out, steps, *words, levels=2, touching=True, **settings):
    """A demo's run with these settings, after what holds for every demo: all steps are there, nothing crosses, contact
    happened if it is `touching`.
    """
    words = [*words, *(word for name, value in settings.items() for word in ("--set", f"{name}={value}"))]
    words += ["--levels", f"0:{levels - 1}", "--steps", str(steps), "--no-picture", "--no-xdmf", "--out", str(out)]
    assert run(["run", str(ROOT / "demos" / f"{demo}.py"), *words]) == 0
    stored = open_run(out)
    assert [level.steps for level in stored.levels] == [steps + 1] * levels
    assert verify_run(out) == []
    for level in stored.levels if touching else ():
        assert max(record["contacts"] for record in level.log) > 0, f"level {level.index} touched nothing"
    return stored


def test_drop(tmp_path):
    # 0.4 m to fall at a fiftieth of a second a step: the stones are met at step 9.
    simulated("drop", tmp_path / "run", 12, vertices=(150, 400), height=0.9, dt=0.02)


def test_slit_array(tmp_path):
    scene = load_module(ROOT / "demos" / "slit_array.py").scene()
    assert (scene.levels, scene.dt, scene.steps) == (8, 0.04, 150)
    stored = simulated("slit_array", tmp_path / "run", 6, height=0.05, consistency=0.025)
    assert max(record["energy"]["consistency"] for record in stored.levels[1].log) > 0.0


@pytest.mark.slow  # a minute of meshing where the ball's levels are not kept yet
def test_phong(tmp_path):
    stored = simulated("phong", tmp_path / "run", 8, "--prolongation", "phong", vertices=(60, 150), height=0.47)
    assert stored.info["prolongation"] == "phong"


def test_tracks(tmp_path):
    words = ("--method", "tracks")
    stored = simulated("tracks", tmp_path / "run", 10, *words, vertices=(100, 200), height=0.02, weight=0.01)
    assert max(record["energy"]["consistency"] for record in stored.levels[1].log) > 0.0


def test_twist(tmp_path):
    # 0.15 s at 300 deg/s: 45 degrees at the end that stays; the other one, let go then, has turned back a good part
    # after 0.1 s more.
    stored = simulated("twist", tmp_path / "run", 25, touching=False, cuts=((8, 2), (12, 3)), release=0.15)
    for level in stored.levels:
        held, free = level.rest[:, 0] < -0.499, level.rest[:, 0] > 0.499
        assert turned(level, 15, held) == pytest.approx(45.0, abs=0.01)
        assert turned(level, 15, free) == pytest.approx(-45.0, abs=0.01)
        assert turned(level, 25, held) == pytest.approx(45.0, abs=0.01)
        assert turned(level, 25, free) > -20.0


def turned(level, step, where):
    """Mean angle [degrees] about the x axis of some vertices."""
    X, x = level.rest[where][:, 1:] @ (1.0, 1j), level.positions(step)[where][:, 1:] @ (1.0, 1j)
    return np.degrees(np.angle((x * X.conj()).sum()))


@pytest.mark.slow
def test_ape(tmp_path):
    # A soft bar's wave needs 0.2 s up to the head: by then it has risen nearly freely, 5 m/s * 0.15 s, and what is held
    # has not.
    stored = simulated("ape", tmp_path / "run", 15, touching=False, vertices=(300, 450))
    for level in stored.levels:
        rise = level.positions(15)[:, 2] - level.rest[:, 2]
        assert rise[level.rest[:, 2] > 0.9].mean() > 0.6
        seat, feet, fist = (
            (level.rest[:, 2] < 0.03) & part
            for part in (abs(level.rest[:, 0]) < 0.2, level.rest[:, 1] < -0.4, level.rest[:, 0] < -0.4)
        )
        for held in (seat, feet & (level.rest[:, 0] > 0), feet & (level.rest[:, 0] < 0), fist):
            assert held.sum() >= 3 and np.abs(rise[held]).max() == 0.0


def test_heterogeneous(tmp_path):
    # The letters are 0.05 m above the bed here: met at step 5 at a fiftieth of a second each.
    steps = 12
    stored = simulated("heterogeneous", tmp_path / "run", steps, vertices=(25, 50), drop=0.1, dt=0.02)
    moduli = {
        body.name: body.material.young for body in load_module(ROOT / "demos" / "heterogeneous.py").scene().bodies
    }
    assert [moduli[name] for name in ("worm", "propeller", "A", "B", "C")] == [2e4, 2e10, 4e4, 5e5, 6e6]
    # The propeller keeps its shape to a ten-thousandth, on every level: a body of 2e10 Pa is rigid.
    for level in stored.levels:
        mine = np.flatnonzero(level.mesh.point_bodies == 5)
        lengths = [np.linalg.norm(np.diff(x[mine], axis=0), axis=1) for x in (level.rest, level.positions(steps))]
        assert np.allclose(*lengths, rtol=1e-4)


@pytest.mark.slow
def test_peel_goes_on_to_the_last_bit(tmp_path):
    # Springs have torn at step 22 and before, and go on tearing after it.
    words = [str(ROOT / "demos" / "peel.py"), "--set", "vertices=(60, 150)", "--no-picture", "--out"]
    assert run(["run", *words, str(tmp_path / "whole"), "--steps", "30"]) == 0
    assert run(["run", *words, str(tmp_path / "parts"), "--steps", "22"]) == 0
    assert run(["run", *words, str(tmp_path / "parts"), "--steps", "30", "--resume"]) == 0
    whole, parts = (open_run(tmp_path / name) for name in ("whole", "parts"))
    for one, other in zip(whole.levels, parts.levels, strict=True):
        broken = [[record["terms"] for record in level.log] for level in (one, other)]
        assert broken[0] == broken[1]
        numbers = [len(terms.get("attachment", {}).get("broken", ())) for terms in broken[0]]
        assert 0 < numbers[21] < numbers[29]
        for step in range(31):
            np.testing.assert_array_equal(one.positions(step), other.positions(step))


@pytest.mark.slow
def test_the_worm_stays_where_it_is_on_ice(tmp_path):
    # The waves of tests/demos/test_claims.py, without friction.
    stored = simulated("worm", tmp_path / "run", 60, vertices=(60, 150), mu=0.0, frequency=2.0)
    for level in stored.levels:
        assert abs(centre(level, 60)[0] - centre(level, 0)[0]) < 2e-3


def centre(level, step):
    """The centre of mass [m] of a level of one density."""
    cells, volumes = level.mesh.cells, level.mesh.volumes
    return volumes @ level.positions(step)[cells].mean(axis=1) / volumes.sum()


@pytest.mark.slow
def test_gripper(tmp_path):
    # Gripped at 0.4 s, lifted from 0.5 to 1.1 s by 0.4 m, and held; without friction it stays below.
    steps, module, found = 70, load_module(ROOT / "demos" / "gripper.py"), {}
    for mu, levels in ((0.7, 2), (0.0, 1)):
        settings = {"vertices": (60, 150), "mu": mu, "dt": 0.02}
        stored = simulated("gripper", tmp_path / f"run {mu}", steps, levels=levels, **settings)
        assert all(record["behind"] == 0.0 for level in stored.levels for record in level.log)
        found[mu] = module.hold(stored)
    for held in found[0.7]:
        assert 0.35 < held["risen"] < 0.4 and held["above"] > 0.34 and abs(held["speed"]) < 0.02
    assert abs(found[0.7][0]["risen"] - found[0.7][1]["risen"]) < 0.02
    assert found[0.0][0]["risen"] < 0.0 and found[0.0][0]["above"] < 0.01


@pytest.mark.slow
def test_donuts(tmp_path):
    """The lower one lands; what is drawn of it follows, with its glaze, and stays of its size."""
    steps = 14
    stored = simulated("donuts", tmp_path / "run", steps, vertices=(150, 300), detail=48, height=0.34)
    for level in stored.levels:
        for mesh in stored.render_meshes:
            mine = level.mesh.point_bodies == mesh.body
            seen, own = level.render_weights(mesh) @ level.positions(steps), level.positions(steps)[mine]
            fallen = seen.mean(axis=0) - mesh.points.mean(axis=0)
            np.testing.assert_allclose(fallen, own.mean(axis=0) - level.rest[mine].mean(axis=0), atol=0.02)
            assert fallen[1] < -0.1
            assert (seen.min(axis=0) > own.min(axis=0) - 0.03).all()
            assert (seen.max(axis=0) < own.max(axis=0) + 0.03).all()
    words = ["--format", "obj", "--levels", "0:0", "-o", str(tmp_path / "obj")]
    assert run(["export", str(tmp_path / "run"), *words]) == 0


def test_a_solid_coarse_level_is_found_before_anything_runs(capsys):
    assert run(["check", str(ROOT / "demos" / "hollow_cube.py"), "--set", "coarse=solid", "--measure", "0"]) == 2
    said = capsys.readouterr().out
    assert "level 0: body 'ball' lies inside body 'cube'" in said
    assert "on level 1 they are apart: give level 0 more vertices or a mesh of its own" in said
