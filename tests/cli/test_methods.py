"""Each method does what its name says: measured, logged and counted."""

import numpy as np

from cli_scenes import pdvol, write
from pdvol import open_run
from pdvol.measure import verify
from pdvol.runs.run_metrics import measure_run
from variants import STEPS

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


def test_the_energy_of_the_penalty_is_logged(made):
    for name, w in (("consistency", 0.2), ("tracks", 0.2), ("progressive", 0.0)):
        run = open_run(made(name))
        rows = run.levels[1].log
        assert all(r["energy"]["consistency"] == 0.0 for r in run.levels[0].log)
        distance = [run.levels[1].positions(r["step"]) for r in rows]
        assert (np.array([r["energy"]["consistency"] for r in rows]) > 0.0).sum() == (STEPS if w else 0), name
        assert all(np.isfinite(d).all() for d in distance)
    # W / dt^2 times the squared distance to P x_c, which `pdvol metrics` takes the root of over the mass of 1000 kg.
    measured = measure_run(made("tracks"))["levels"][1]["distance"]
    logged = [r["energy"]["consistency"] for r in open_run(made("tracks")).levels[1].log]
    np.testing.assert_allclose(logged, 0.2 / 0.02**2 * 1000.0 * np.array(measured[1:]) ** 2, rtol=1e-9)


def test_a_penalty_brings_levels_together(made):
    free, held, tracked, lifted = (
        measure_run(made(name))["levels"][1] for name in ("progressive", "consistency", "tracks", "embedded")
    )
    assert held["summary"]["consistency"]["mean"] < 0.7 * free["summary"]["consistency"]["mean"]
    assert max(lifted["distance"]) < 1e-12
    # What was solved leaves little; the pull belongs to it, and is a ghost in the scene's own balance.
    for entry in (held, tracked):
        assert entry["summary"]["continuity"]["median"] > 1e3
    assert not lifted["summary"]["continuity"] and lifted["summary"]["continuity_error"]["mean"] > 0.0


def test_feedback_brings_levels_together(made):
    """Centres are nearer than without; what was solved leaves little beside the scene's own balance, as only the same
    x_hat can show.
    """
    free, drawn = (measure_run(made(name))["levels"][1] for name in ("progressive", "feedback"))
    assert drawn["centre_drift"][-1] < 0.7 * free["centre_drift"][-1]
    assert drawn["summary"]["continuity"]["median"] > 1e3
    described = [open_run(made(name)).info["description"] for name in ("progressive", "feedback")]
    assert [each.get("feedback") for each in described] == [None, 0.2], "runs without are as before there was any"


def test_embedded_levels_cross_and_it_is_counted(tmp_path, capsys):
    scene = write(tmp_path / "round.py", ROUND)
    assert pdvol("run", scene, "--method", "embedded", "--out", tmp_path / "run") == 0
    printed = capsys.readouterr().err
    coarse, fine = open_run(tmp_path / "run").levels
    assert f"but surfaces cross in {sum(r['intersections'] > 0 for r in fine.log)} of 8 steps" in printed
    assert "intersections" not in coarse.log[0]
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
