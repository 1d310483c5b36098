"""Errors of made-up runs that are moved and turned by known amounts."""

import numpy as np
import pytest

from pdvol.store.reader import open_run
from pdvol.store.writer import RunWriter
from pdvol.studio.study.reference import ReferenceStates
from runs import DT, level_meshes, moved

STEPS = 8
DURATION = STEPS * DT


def write(path, change, dt=DT, dim=2, counts=(60, 200)):
    """A run whose positions at a time are those of `moved`, then changed: (mesh, positions, time) -> positions."""
    meshes = level_meshes(dim, counts)
    info = {"scene": "made up", "dt": dt, "steps": round(DURATION / dt), "method": "progressive", "versions": {}}
    with RunWriter.create(path, {**info, "parameters": {}}, meshes, ["left", "right"]) as run:
        for level, mesh in enumerate(meshes):
            for step in range(info["steps"] + 1):
                x = change(mesh, moved(mesh, 2 * step * dt), step * dt)
                energy = {"elastic": 2.0, "load": 1.0}
                log = {"level": level, "step": step, "time": step * dt, "contacts": int(step * dt > 0.05)}
                log |= {"min_gap": 1e-3 * step, "energy": energy}
                run.write_state(level, step, x, log if step else None)
    return open_run(path)


def turned(mesh, x, angle, body):
    mine = mesh.point_bodies == body
    centre = np.average(x[mine], axis=0)
    c, s = np.cos(angle), np.sin(angle)
    y = x.copy()
    y[mine] = centre + (x[mine] - centre) @ np.array([[c, s], [-s, c]])
    return y


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    return ReferenceStates(write(tmp_path_factory.mktemp("reference") / "run", lambda mesh, x, t: x), 1)


def test_a_shift_is_the_error_and_grows_with_time(reference, tmp_path):
    shift = np.array([0.3, -0.4])
    found = reference.errors(write(tmp_path / "run", lambda mesh, x, t: x + t * shift), 1)
    assert found["end"] == pytest.approx(0.5 * DURATION, rel=1e-12)
    assert found["worst"] == pytest.approx(found["end"])
    times = np.arange(1, STEPS + 1) * DT
    assert found["time"] == pytest.approx(0.5 * np.sqrt(np.mean(times**2)))
    assert found["share"] == pytest.approx(found["end"] / reference.sizes.min())
    for body in found["bodies"]:
        assert body["centre"] == pytest.approx(found["end"]) == body["centre_most"]
        assert body["angle"] == pytest.approx(0.0, abs=1e-5)
    assert found["volume"] == pytest.approx(0.0, abs=1e-12) and found["first_contact"] == 0.0 and found["outcome"]


def test_a_turn_is_seen_on_the_body_that_turns_and_makes_another_outcome(reference, tmp_path):
    for angle, same in ((0.2, True), (0.9, False)):
        run = write(tmp_path / f"run{angle}", lambda mesh, x, t, a=angle: turned(mesh, x, a * t / DURATION, 1))
        left, right = reference.errors(run, 1)["bodies"]
        assert right["angle"] == pytest.approx(np.degrees(angle), rel=1e-3) and left["angle"] < 1e-5
        assert reference.errors(run, 1)["outcome"] == same


def test_half_the_time_step_is_compared_at_common_times(reference, tmp_path):
    assert reference.errors(write(tmp_path / "fine", lambda mesh, x, t: x, dt=DT / 2), 1)["worst"] < 1e-14
    solid = write(tmp_path / "solid", lambda mesh, x, t: x, dim=3, counts=(80, 160))
    assert ReferenceStates(solid, 1).errors(solid, 1)["worst"] == 0.0
    odd = write(tmp_path / "odd", lambda mesh, x, t: mesh.points + t, dt=DT * 2 / 3)
    still = write(tmp_path / "still", lambda mesh, x, t: mesh.points + t)
    assert reference.apart((odd, 1), (still, 1))[1] < 1e-12, "states in between are linear in time"


def test_coarse_levels_are_compared_through_the_prolongation(reference, tmp_path):
    """An affine motion is carried exactly."""
    affine = lambda mesh, x, t: mesh.points @ (np.eye(2) + t * np.array([[0.1, 0.4], [-0.3, 0.2]])) + t
    run = write(tmp_path / "run", affine)
    own = ReferenceStates(run, 1)
    assert own.errors(run, 1)["drift"] < 1e-12 and own.errors(run, 0)["drift"] is None
    assert own.errors(run, 0)["worst"] < 1e-12
    assert own.errors(run, 0)["energy"] == pytest.approx(0.0, abs=0.05 * abs(own.errors(run, 0)["energy"]) + 50.0)
