"""`pdvol metrics` gives the values that theory predicts for direct runs, reports what it leaves out, and compares two
runs.
"""

import io
import json
import shutil
from contextlib import redirect_stdout

import numpy as np
import pytest
from mpi4py import MPI

import runs
from cli_scenes import FALL, SQUARE, pdvol, write
from pdvol import open_run
from pdvol.geometry.level_mesh import lumped_masses
from pdvol.levels.hierarchy import Hierarchy
from pdvol.runs.run_metrics import animation_line, last_animation, motion_from_level_0
from pdvol.store.writer import RunWriter
from shapes import box

STEPS = 12

# A support that turns, a floor that rises, friction that is lagged there: all that forces at a stored state depend on.
MOVING = (
    SQUARE
    + """
from pdvol import Rotation, Translation

def scene():
    place = Placement(translate=(0.0, 0.02), angle=0.05)
    return Scene(bodies=(Body(tuple(square(n) for n in (2, 3)), NeoHookean(2e4), placement=place),),
                 obstacles=(Plane((0.0, 0.0), (0.0, 1.0), motion=Translation((0.0, 0.1))),),
                 supports=(Support(lambda X: X[:, 1] > 0.95, motion=Rotation(1.0, (0.5, 1.0))),),
                 loads=(Gravity((0.0, -9.81)),), contact=(Barrier(), Friction(0.3)), dt=0.02, steps=8)
"""
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """One scene, direct by each integrator and progressive, so loosely solved that residuals are above round-off."""
    folder = tmp_path_factory.mktemp("metrics")
    write(folder / "fall.py", FALL)
    euler = ("--set", "integrator=implicit_euler")
    for name, tolerance, more in (("direct", 1e-2, ()), ("euler", 1e-2, euler), ("progressive", 1e-6, ())):
        words = ["--steps", STEPS, "--set", f"tolerance=Relative({tolerance})", "--set", "linear=direct", *more]
        method = ("--method", "progressive" if name == "progressive" else "direct")
        assert pdvol("run", folder / "fall.py", *method, "--out", folder / name, *words) == 0
    return folder


def measured(*words):
    assert pdvol("metrics", *words) == 0
    return json.loads((words[0] / "metrics.json").read_text())


@pytest.fixture(scope="module")
def direct(folder):
    """What is measured of the direct run."""
    return measured(folder / "direct")


@pytest.fixture(scope="module")
def progressive(folder, final_pictures):
    """What is measured of the progressive run, and what is printed."""
    with final_pictures(), redirect_stdout(io.StringIO()) as printed:
        return measured(folder / "progressive"), printed.getvalue()


@pytest.mark.parametrize("name", ["direct", "euler"])
def test_continuity_of_a_direct_run_is_a_quarter(folder, direct, name):
    result = direct if name == "direct" else measured(folder / name)
    assert [level["level"] for level in result["levels"]] == [0, 1] and result["notes"] == []
    for level in result["levels"]:
        assert len(level["continuity"]) == len(level["jitter"]) == level["steps"] == STEPS
        assert level["mass"] == pytest.approx(1000.0)  # a square metre of 1000 kg/m^2
        # Without contact the first steps leave a residual of round-off, which is then all there is to see.
        in_contact = [r["contacts"] > 0 for r in open_run(folder / name).levels[level["level"]].log]
        assert sum(in_contact) > 4
        np.testing.assert_allclose(np.array(level["continuity"])[in_contact], 0.25, rtol=1e-5)
        # Falling freely from its initial velocity: half the mass times (g dt)^2.
        assert level["jitter"][0] == pytest.approx(0.5 * 1000.0 * (9.81 * 0.02) ** 2, rel=1e-6)


def test_metrics_end_with_whether_it_is_the_same_animation(folder, progressive):
    """It is another one with a body in another place, or on another face."""
    result, out = progressive
    run = open_run(folder / "progressive")
    entry, line = result["levels"][1], out.splitlines()[-1]
    assert line == last_animation(run) == entry["animation"]
    apart, turned = entry["centre_drift_from_0"][-1] / np.sqrt(2.0), entry["angle_drift_from_0"][-1]  # of a unit square
    assert line == f"level 1: {100 * apart:.1f} % of the size, {turned:.1f} degrees from level 0: same animation"
    for centre, angle, end in ((0.3, 0.0, "same animation"), (0.4, 0.0, "another animation ('square')")):
        assert animation_line(run.levels[1], ["square"], np.array([centre]), np.array([angle])).endswith(end)
    assert "another animation" in animation_line(run.levels[1], ["square"], np.array([0.0]), np.array([40.0]))


def test_continuity_with_motions_of_supports_and_obstacles(tmp_path):
    scene = write(tmp_path / "moving.py", MOVING)
    words = ("--method", "direct", "--set", "tolerance=Relative(1e-3)", "--set", "linear=direct")
    assert pdvol("run", scene, "--out", tmp_path / "run", *words) == 0
    for level, entry in zip(open_run(tmp_path / "run").levels, measured(tmp_path / "run")["levels"], strict=True):
        whole = np.array([r["reached"] == 1.0 and r["cuts"] == 0 for r in level.log])
        assert whole.sum() > 4 and max(r["contacts"] for r in level.log) > 0
        values = np.array([np.nan if v is None else v for v in entry["continuity"]])
        np.testing.assert_array_equal(np.isnan(values), ~whole)
        np.testing.assert_allclose(values[whole], 0.25, rtol=1e-4)


def test_measures_between_levels(folder, progressive):
    """Roughness, drifts and distances, by hand; a rough level is named."""
    result, out = progressive
    run = open_run(folder / "progressive")
    for said in ("method progressive, barycentric prolongation", "rank of P 9 of 9", "metrics.json and metrics.png"):
        assert said in out
    assert (folder / "progressive" / "metrics.png").read_bytes()[:4] == b"\x89PNG"
    coarse, fine = result["levels"]
    x = np.array([run.levels[0].positions(n) for n in range(run.levels[0].steps)])
    squares = np.einsum("v,tvd->t", masses_of(run.levels[0]), np.diff(x, 4, axis=0) ** 2)
    np.testing.assert_allclose(coarse["roughness"], np.sqrt(squares), rtol=1e-9)
    means = [np.sqrt(np.mean(np.square(entry["roughness"]))) for entry in (coarse, fine)]
    assert coarse["rougher"] == 1.0 and fine["rougher"] == pytest.approx(means[1] / means[0])
    assert f"roughness {means[0]:.3g} m" in out
    assert ("rougher than level 0" in out) == (means[1] > 1.3 * means[0])
    assert not {"consistency", "distance", "centre_drift", "bodies"} & set(coarse)
    assert fine["projection"] == {"rank": 9, "columns": 9}
    # All start alike; then the fine level lands differently.
    for key, largest in (("consistency", 1.0), ("distance", 0.05), ("centre_drift", 0.05), ("angle_drift", 5.0)):
        assert len(fine[key]) == STEPS + 1
        assert fine[key][0] < 1e-6 < fine[key][-1] < largest
        assert fine["summary"][key]["largest"] == max(fine[key])
        assert fine["summary"][key]["last"] == fine[key][-1]
    assert fine["centre_drift"][-1] < fine["distance"][-1], "bodies' centres are closer than their points"
    (body,) = fine["bodies"]
    assert body["centre_drift"] == fine["centre_drift"] == fine["centre_drift_from_0"]
    (_, last) = motion_from_level_0(run)
    assert last["centre_drifts"] == {body["name"]: pytest.approx(body["centre_drift_from_0"][-1], rel=1e-9)}
    assert f"drift from the level below at most {max(fine['centre_drift']):.3g} m" in out
    hierarchy = Hierarchy([level.mesh for level in run.levels], MPI.COMM_SELF)
    apart = run.levels[1].positions(STEPS) - hierarchy.prolong(run.levels[0].positions(STEPS), 0, 1)
    assert body["centre_drift"][-1] == pytest.approx(np.linalg.norm(masses_of(run.levels[1]) @ apart), rel=1e-9)
    # e_hat is what the solver left of the equation with the progressive x_hat: little, as the tolerance was tight. With
    # the x_hat of a direct step the quotient would be near one.
    assert fine["summary"]["continuity"]["median"] > 1e6
    assert coarse["summary"]["continuity"]["median"] == pytest.approx(0.25, rel=1e-2)


def masses_of(level):
    """Lumped masses as shares of the whole mass, which is the same in all cells."""
    masses = lumped_masses(level.mesh, np.ones(len(level.cells)))
    return masses / masses.sum()


def test_against_another_run(folder, direct, progressive, tmp_path, capsys, final_pictures):
    alone, _ = progressive
    with final_pictures():
        result = measured(folder / "progressive", "--against", folder / "direct", "--json", tmp_path / "numbers.json")
    assert json.loads((tmp_path / "numbers.json").read_text()) == result
    other = result.pop("against")
    assert result == alone
    between = other.pop("between")
    assert other["levels"] == direct["levels"]
    ours, theirs = open_run(folder / "progressive"), open_run(folder / "direct")
    for entry in between:
        level = entry["level"]
        masses = masses_of(ours.levels[level])
        apart = ours.levels[level].positions(STEPS) - theirs.levels[level].positions(STEPS)
        assert entry["distance"][-1] == pytest.approx(np.sqrt(masses @ (apart**2).sum(axis=1)), rel=1e-9)
        assert entry["centre_error"][-1] == pytest.approx(np.linalg.norm(masses @ apart), rel=1e-9)
    out = capsys.readouterr().out
    assert "against" in out and "apart: centre of mass" in out


@pytest.mark.parametrize("name", ["barycentric", "biharmonic", "phong"])
def test_a_run_that_is_prolonged_exactly(tmp_path, name):
    """Level 1 is P level 0, coarse positions at random: all differences vanish, for each interpolant's own P."""
    meshes = [box(2, 3), box(2, 7)]
    P = Hierarchy(meshes, MPI.COMM_SELF, name).prolongation(1)
    rng = np.random.default_rng(0)
    info = {"scene": "made", "dt": 0.1, "steps": 2, "method": "dreamt", "prolongation": name}
    with RunWriter.create(tmp_path / "run", info, meshes, ["b"]) as run:
        for step in range(3):
            coarse = rng.normal(size=meshes[0].points.shape)
            run.write_state(0, step, coarse)
            run.write_state(1, step, P.prolong(coarse))
    result = measured(tmp_path / "run")
    assert "continuity" not in result["levels"][1]
    assert any("x_hat of the method 'dreamt' is not known" in note for note in result["notes"])
    assert any("masses are volumes" in note for note in result["notes"])
    assert max(result["levels"][1]["consistency"]) < 1e-25 and max(result["levels"][1]["distance"]) < 1e-13
    assert result["levels"][1]["projection"] == {"rank": 16, "columns": 16}


def test_what_cannot_be_measured_is_said(folder, tmp_path, capsys):
    run = shutil.copytree(folder / "direct", tmp_path / "run")
    lines = [json.loads(line) for line in (run / "log.jsonl").read_text().splitlines()]
    lines[2]["cuts"] = 1  # level 0, step 3
    (run / "log.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    assert measured(run)["levels"][0]["continuity"][2] is None
    info = json.loads((run / "run.json").read_text())
    for change, printed in (
        ({"scene_file": str(tmp_path / "gone.py")}, "gone.py is gone"),
        ({"parameters": {"mu": 0.9}}, "has changed (scene.contact[1].mu"),
        ({"parameters": {"colour": 1}}, "no parameter 'colour'"),
    ):
        (run / "run.json").write_text(json.dumps({**info, **change}))
        capsys.readouterr()
        result = measured(run)
        assert printed in capsys.readouterr().out and all("continuity" not in level for level in result["levels"])
        assert "consistency" in result["levels"][1]


def test_an_unfinished_run(folder, tmp_path, final_pictures):
    run = shutil.copytree(folder / "progressive", tmp_path / "run")
    runs.keep_states(run / "levels" / "1", 6)
    with final_pictures():
        coarse, fine = measured(run)["levels"]
    assert (coarse["steps"], fine["steps"]) == (STEPS, 5)
    assert len(fine["consistency"]) == 6 and len(fine["continuity"]) == 5
