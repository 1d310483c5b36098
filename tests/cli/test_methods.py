"""Every method through the command line: what is stored, gone on with, refined, measured and refused."""

import numpy as np
import pytest

import runs
from cli_scenes import FALL, pdvol, pdvol_on_ranks, write
from on_ranks import results_on
from pdvol import open_run
from pdvol.measure import verify
from pdvol.registry import METHODS
from pdvol.runs.run_metrics import measure_run

STEPS = 8
STRICT = ("--set", "tolerance=1e-4")  # [m/s]: what is solved leaves little in the balance
CASES = {
    "progressive": ("--method", "progressive", "--set", "feedback=0"),
    "direct": ("--method", "direct"),
    "consistency": ("--method", "progressive", "--set", "consistency=0.2", "--set", "feedback=0"),
    "feedback": ("--method", "progressive", "--set", "feedback=0.2"),
    "implicit_euler": ("--set", "consistency=0.2", "--set", "feedback=0.2", "--set", "integrator=implicit_euler"),
    "tracks": ("--method", "tracks", "--set", "weight=0.2"),
    "embedded": ("--method", "embedded", "--prolongation", "phong"),
}
CASES = {name: (*words, *STRICT) for name, words in CASES.items()}
TIMING = ("seconds", "peak_memory_mb")

# The second body lies beside the first, nearer than its coarse level's flat sides are to the round fine one: embedded,
# they overlap.
ROUND = """
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Scene, meshes

def scene():
    disc, soft = meshes.disc(0.5, 96), NeoHookean(1e4)
    return Scene(bodies=tuple(Body(disc, soft, (14, 90), name=name, velocity=(v, -3.0), placement=Placement((x, 0.55)))
                              for name, x, v in (("left", -0.515, 2.0), ("right", 0.515, -2.0))),
                 obstacles=(Plane((0.0, 0.0), (0.0, 1.0)),), loads=(Gravity((0.0, -9.81)),), contact=(Barrier(),),
                 dt=0.02, steps=8)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A run of each case."""
    folder = tmp_path_factory.mktemp("methods")
    write(folder / "fall.py", FALL)
    for name, words in CASES.items():
        assert pdvol("run", folder / "fall.py", "--steps", STEPS, "--out", folder / name, *words) == 0
    return folder


def logs(path):
    return [[{k: v for k, v in r.items() if k not in TIMING} for r in level.log] for level in open_run(path).levels]


def same_motion(one, other):
    for a, b in zip(open_run(one).levels, open_run(other).levels, strict=True):
        assert a.steps == b.steps
        for step in range(a.steps):
            np.testing.assert_array_equal(a.positions(step), b.positions(step))
    assert logs(one) == logs(other)


def test_every_method_is_tested():
    assert set(METHODS) <= set(CASES)


@pytest.mark.parametrize("name", CASES)
def test_level_zero_is_the_same_and_level_one_its_own(folder, name):
    run, direct = open_run(folder / name), open_run(folder / "direct")
    assert [level.steps for level in run.levels] == [STEPS + 1] * 2
    same = np.array_equal(run.levels[0].positions(STEPS), direct.levels[0].positions(STEPS))
    assert same == (name != "implicit_euler")
    for other in set(CASES) - {name}:
        assert np.abs(run.levels[1].positions(STEPS) - open_run(folder / other).levels[1].positions(STEPS)).max() > 1e-6
    if name != "embedded":
        assert verify.verify_run(folder / name) == []


@pytest.mark.parametrize("name", ["consistency", "feedback", "implicit_euler", "tracks", "embedded"])
def test_resumed_and_refined_are_as_never_stopped(folder, tmp_path, name):
    scene, out = folder / "fall.py", tmp_path / "run"
    assert pdvol("run", scene, "--steps", STEPS, "--levels", "0", "--out", out, *CASES[name]) == 0
    assert pdvol("refine", out, "--to", 1) == 0
    same_motion(out, folder / name)
    runs.keep_states(out / "levels" / "1", 4)  # as a kill in the fourth step of level 1 leaves it
    assert pdvol("run", scene, "--steps", STEPS, "--out", out, "--resume", *CASES[name]) == 0
    same_motion(out, folder / name)


@pytest.mark.parametrize("name", ["consistency", "feedback"])
def test_levels_side_by_side_wait_for_the_coarser_level(folder, tmp_path, name):
    """The penalty needs the coarser level one step further ahead than the velocities do."""
    words = ("--steps", STEPS, "--out", tmp_path / "run", "--wavefront")
    assert pdvol("run", folder / "fall.py", *words, *CASES[name]) == 0
    for a, b in zip(open_run(tmp_path / "run").levels, open_run(folder / name).levels, strict=True):
        for step in range(STEPS + 1):
            np.testing.assert_array_equal(a.positions(step), b.positions(step))


def test_the_energy_of_the_penalty_is_logged(folder):
    for name, w in (("consistency", 0.2), ("tracks", 0.2), ("progressive", 0.0)):
        run = open_run(folder / name)
        rows = run.levels[1].log
        assert all(r["energy"]["consistency"] == 0.0 for r in run.levels[0].log)
        distance = [run.levels[1].positions(r["step"]) for r in rows]
        assert (np.array([r["energy"]["consistency"] for r in rows]) > 0.0).sum() == (STEPS if w else 0), name
        assert all(np.isfinite(d).all() for d in distance)
    # W / dt^2 times the squared distance to P x_c, which `pdvol metrics` takes the root of over the mass of 1000 kg.
    measured = measure_run(folder / "tracks")["levels"][1]["distance"]
    logged = [r["energy"]["consistency"] for r in open_run(folder / "tracks").levels[1].log]
    np.testing.assert_allclose(logged, 0.2 / 0.02**2 * 1000.0 * np.array(measured[1:]) ** 2, rtol=1e-9)


def test_a_penalty_brings_levels_together(folder):
    free, held, tracked, lifted = (
        measure_run(folder / name)["levels"][1] for name in ("progressive", "consistency", "tracks", "embedded")
    )
    assert held["summary"]["consistency"]["mean"] < 0.7 * free["summary"]["consistency"]["mean"]
    assert max(lifted["distance"]) < 1e-12
    # What was solved leaves little; the pull belongs to it, and is a ghost in the scene's own balance.
    for entry in (held, tracked):
        assert entry["summary"]["continuity"]["median"] > 1e3
    assert not lifted["summary"]["continuity"] and lifted["summary"]["continuity_error"]["mean"] > 0.0


def test_feedback_brings_levels_together(folder):
    """Centres are nearer than without; what was solved leaves little beside the scene's own balance, as only the same
    x_hat can show.
    """
    free, drawn = (measure_run(folder / name)["levels"][1] for name in ("progressive", "feedback"))
    assert drawn["centre_drift"][-1] < 0.7 * free["centre_drift"][-1]
    assert drawn["summary"]["continuity"]["median"] > 1e3
    described = [open_run(folder / name).info["description"] for name in ("progressive", "feedback")]
    assert [each.get("feedback") for each in described] == [None, 0.2], "runs without are as before there was any"


def test_embedded_levels_cross_and_it_is_counted(tmp_path, capsys):
    scene = write(tmp_path / "round.py", ROUND)
    assert pdvol("run", scene, "--method", "embedded", "--out", tmp_path / "run") == 0
    assert "intersections" in capsys.readouterr().err
    run = open_run(tmp_path / "run")
    fine = run.levels[1]
    assert "intersections" not in run.levels[0].log[0]
    facets, total = verify.boundary(fine.cells), 0
    for record in fine.log:
        x = fine.positions(record["step"])
        np.testing.assert_array_equal(np.isfinite(x), True)
        crossing = len(verify.crossings(x, facets))
        assert record["intersections"] == crossing + int((x[:, 1] <= 0.0).sum())
        total += crossing
    assert total > 0 and any((fine.positions(step)[:, 1] <= 0.0).any() for step in range(9))
    errors = measure_run(tmp_path / "run")["levels"][1]["continuity_error"]
    np.testing.assert_array_equal(
        np.isnan(errors), [r["intersections"] > 0 for r in fine.log]
    )  # no forces are right where surfaces cross
    assert pdvol("run", scene, "--out", tmp_path / "solved") == 0
    assert verify.verify_run(tmp_path / "solved") == []


def test_what_methods_refuse(folder, tmp_path, capsys):
    def refuse(*words):
        assert pdvol("run", folder / "fall.py", *words) == 2
        return capsys.readouterr().err

    assert "tracks needs a weight above zero" in refuse("--method", "tracks", "--out", tmp_path / "a")
    assert "Penalty.consistency = -1 is below 0" in refuse("--set", "consistency=-1", "--out", tmp_path / "a")
    assert "Penalty.weight = 'much' is not a finite number" in refuse("--set", "weight=much", "--out", tmp_path / "a")
    assert "feedback = -1 is below 0" in refuse("--set", "feedback=-1", "--out", tmp_path / "a")
    assert "feedback = 1.5 must be at most 1" in refuse("--set", "feedback=1.5", "--out", tmp_path / "a")
    assert "scene.feedback: 0.2 -> 0.3" in refuse("--set", "feedback=0.3", "--resume", "--out", folder / "feedback")
    assert "scene.penalty.weight: 0.2 -> 0.3" in refuse(
        "--method", "tracks", "--set", "weight=0.3", "--resume", "--out", folder / "tracks"
    )
    assert "was run with method 'tracks'" in refuse(
        "--method", "direct", "--set", "weight=0.2", "--resume", "--out", folder / "tracks"
    )
    assert "consistency" in refuse("--set", "colour=1", "--out", tmp_path / "a")  # the message lists what there is
    assert not (tmp_path / "a").exists()


@pytest.mark.mpi
@pytest.mark.parametrize("name", ["consistency", "feedback", "implicit_euler", "embedded"])
def test_two_ranks_give_the_same(tmp_path, folder, name):
    words = [
        "run",
        folder / "fall.py",
        "--steps",
        4,
        "--set",
        "linear=direct",
        "--set",
        "tolerance=Relative(1e-7)",
        *CASES[name],
        "--out",
    ]
    (ended,) = results_on((2,), pdvol_on_ranks, *words, tmp_path / "two")
    assert ended["code"] == 0, ended["said"]
    assert pdvol(*words, tmp_path / "one") == 0
    for a, b in zip(open_run(tmp_path / "one").levels, open_run(tmp_path / "two").levels, strict=True):
        assert a.steps == b.steps == 5
        for step in range(5):
            np.testing.assert_allclose(b.positions(step), a.positions(step), rtol=0.0, atol=1e-8)
        for one, other in zip(a.log, b.log, strict=True):
            assert other["energy"].get("consistency", 0.0) == pytest.approx(
                one["energy"].get("consistency", 0.0), rel=1e-4, abs=1e-9
            )


def test_a_level_alone_needs_no_coarser_one(tmp_path):
    write(tmp_path / "fall.py", FALL)
    words = ("--method", "direct", "--no-picture", "--steps", 2)
    assert pdvol("run", tmp_path / "fall.py", "--levels", "1:1", "--out", tmp_path / "alone", *words) == 0
    assert pdvol("run", tmp_path / "fall.py", "--out", tmp_path / "all", *words) == 0
    alone, every = (open_run(tmp_path / name) for name in ("alone", "all"))
    assert [level.steps for level in alone.levels] == [0, 3] and not (tmp_path / "alone" / "picture.png").exists()
    np.testing.assert_array_equal(alone.levels[1].positions(2), every.levels[1].positions(2))
