"""The run folder: stored data is read back, errors name damaged data, and only one process writes."""

import json
import shutil

import numpy as np
import pytest

import pdvol.cli
import runs
from pdvol.errors import InputError, SimulationError
from pdvol.store.copying import copy_run
from pdvol.store.reader import open_run
from pdvol.store.states import HEADER, MAGIC
from pdvol.store.writer import RunWriter

INFO = {"scene": "made up", "dt": runs.DT, "steps": 6, "method": "direct", "parameters": {}, "versions": {}}


def test_round_trip(flat_run):
    run = open_run(flat_run)
    assert (
        run.info["format"] == 2 and run.info["bodies"] == ["left", "right"] and run.info["parameters"] == {"young": 1e5}
    )
    assert [level["state"] for level in run.info["levels"]] == ["done", "done"] and run.info["state"] == "done"
    for level, mesh in zip(run.levels, runs.level_meshes(2, (60, 200)), strict=True):
        assert level.steps == 7
        for name in ("points", "cells", "bodies", "regions"):
            np.testing.assert_array_equal(getattr(level.mesh, name), getattr(mesh, name))
        np.testing.assert_array_equal(level.surface, mesh.boundary)
        for step in range(7):
            np.testing.assert_array_equal(level.positions(step), runs.moved(mesh, 2 * step * runs.DT))
        np.testing.assert_array_equal(level.velocities(3), (level.positions(3) - level.positions(2)) / runs.DT)
        np.testing.assert_array_equal(level.velocities(0), np.zeros_like(mesh.points))
        assert [record["step"] for record in level.log] == [1, 2, 3, 4, 5, 6]


def test_initial_velocity_and_obstacles(tmp_path):
    meshes = runs.level_meshes(3, (100,))
    v = np.random.default_rng(1).normal(size=meshes[0].points.shape)
    sphere = runs.sphere_obstacle((0, 0, 0), steps=5)
    with RunWriter.create(tmp_path / "run", INFO, meshes, ["a", "b"], [v]) as writer:
        writer.write_state(0, 0, meshes[0].points)
        runs.write_obstacles(writer.path, [*runs.OBSTACLES[3], sphere])
        with pytest.raises(InputError, match="needs the arrays"):
            runs.write_obstacles(writer.path, [{"name": "x", "kind": "mesh", "vertices": np.zeros((3, 3))}])
        with pytest.raises(InputError, match="must be one of plane, mesh, polyline"):
            runs.write_obstacles(writer.path, [{"name": "x", "kind": "cone"}])
    run = open_run(tmp_path / "run")
    np.testing.assert_array_equal(run.levels[0].velocities(0), v)
    plane, ball = run.obstacles
    np.testing.assert_array_equal(plane.plane(3)[1], [0, 0, 1])
    np.testing.assert_array_equal(ball.vertices(5), sphere["positions"][5])
    np.testing.assert_array_equal(ball.vertices(99), sphere["positions"][5])


def test_numbers_json_does_not_know(tmp_path):
    parameters = {"n": np.int64(3), "x": np.float32(0.5), "v": np.arange(3), "none": np.inf, "path": tmp_path}
    info = {**INFO, "parameters": parameters}
    with RunWriter.create(tmp_path / "run", info, runs.level_meshes(2, (60,)), ["a", "b"]) as writer:
        writer.write_state(0, 0, runs.level_meshes(2, (60,))[0].points, {"min_gap": np.inf, "contacts": np.int32(0)})
    run = open_run(tmp_path / "run")
    assert run.info["parameters"] == {"n": 3, "x": 0.5, "v": [0, 1, 2], "none": None, "path": str(tmp_path)}
    assert run.levels[0].log == [{"level": 0, "step": 0, "min_gap": None, "contacts": 0}]
    for wrong, message in (
        ({**INFO, "f": open}, "cannot be stored as JSON"),
        ({"steps": 3}, "needs .*dt.* in its info"),
    ):
        with pytest.raises(InputError, match=message):
            RunWriter.create(tmp_path / "other", wrong, [], [])
    assert not (tmp_path / "other").exists()


def test_states_follow_on_each_other(small_run):
    with RunWriter.open(small_run) as writer:
        x = open_run(small_run).levels[0].positions(2)
        for step in (0, 6, 9):
            with pytest.raises(ValueError, match="the next state to store is that of step 7"):
                writer.write_state(0, step, x)
        for wrong in (x * np.nan, x[:-1]):
            with pytest.raises(ValueError, match="finite and of shape"):
                writer.write_state(0, 7, wrong)
        writer.write_state(0, 7, x, {"contacts": 1})
    run = open_run(small_run)
    assert [level.steps for level in run.levels] == [8, 7]
    assert [record["step"] for record in run.levels[0].log] == [*range(1, 8)] and len(run.levels[1].log) == 6


def test_a_level_is_added_to_a_stored_run(small_run):
    before = {p: p.read_bytes() for p in (small_run / "levels").rglob("*.np?")}
    mesh = runs.level_meshes(2, (300,))[0]
    with RunWriter.open(small_run) as writer:
        assert writer.add_level(mesh) == 2
        writer.set_level_state(2, "running")
        writer.write_state(2, 0, mesh.points)
        assert open_run(small_run).info["state"] == "running" and open_run(small_run).in_use
    assert open_run(small_run).levels[2].steps == 1 and not open_run(small_run).in_use
    assert all(p.read_bytes() == content for p, content in before.items())
    with RunWriter.open(small_run) as writer:
        assert [entry["state"] for entry in writer.info["levels"]] == ["done", "done", "interrupted"]


def test_damaged_states_are_named_and_the_rest_is_usable(small_run):
    file = small_run / "levels" / "1" / "states.bin"
    whole = file.read_bytes()
    size = (len(whole) - HEADER.size) // 7
    begin, end = HEADER.size + 3 * size, HEADER.size + 4 * size
    for damaged in (whole[: end - 1], whole[: begin + 4], whole[:begin]):
        file.write_bytes(damaged)
        run = open_run(small_run)
        assert [lvl.steps for lvl in run.levels] == [7, 3]
        with pytest.raises(InputError, match="there is no step 3; usable states of level 1: 0 to 2"):
            run.levels[1].positions(3)
        assert np.isfinite(run.levels[1].positions(2)).all() and np.isfinite(run.levels[0].positions(6)).all()
    for at, length in ((begin, size), (begin, 4), (begin + 8, 4), (end - 8, 8)):
        file.write_bytes(whole[:at] + b"\1" * length + whole[at + length :])
        run = open_run(small_run)
        with pytest.raises(InputError, match=r"step 3, is damaged.*usable states of level 1: 0 to 2, 4 to 6"):
            run.levels[1].positions(3)
        assert np.isfinite(run.levels[1].positions(4)).all()
    with RunWriter.open(small_run) as writer:  # states beyond the damaged one are computed again
        writer.write_state(1, 3, open_run(small_run).levels[1].positions(2))
    assert open_run(small_run).levels[1].steps == 4


@pytest.mark.parametrize("content", [b"", b"noise" * 400, HEADER.pack(MAGIC, 7, 2) + bytes(400)])
def test_a_file_that_holds_no_states_is_not_written_over(small_run, content):
    file = small_run / "levels" / "1" / "states.bin"
    file.write_bytes(content)
    assert open_run(small_run).levels[1].steps == 0
    with pytest.raises(InputError, match=r"states.bin does not hold states of \d+ vertices in 2D"):
        RunWriter.open(small_run)
    assert file.read_bytes() == content


def test_a_flipped_bit_is_found(small_run, tmp_path, capsys):
    """By all readers, and by a copy; states after it are new ones."""
    copy_run(small_run, tmp_path / "copy")
    for path in (small_run, tmp_path / "copy"):
        runs.flip_bit(path / "levels" / "1", 3)
        for _ in range(2):
            with pytest.raises(InputError, match=r"step 3, is damaged.*usable states of level 1: 0 to 2, 4 to 6"):
                open_run(path).levels[1].positions(3)
        assert pdvol.cli.run(["verify", str(path)]) == 1
        assert capsys.readouterr().out.count("step 3, is damaged") == 1
    with pytest.raises(InputError, match="step 3, is damaged"):
        copy_run(small_run, tmp_path / "another")
    with RunWriter.open(small_run) as writer:
        x = open_run(small_run).levels[1].positions(2)
        writer.write_state(1, 3, x)
    np.testing.assert_array_equal(open_run(small_run).levels[1].positions(3), x)


def test_other_damage(small_run):
    mesh = small_run / "levels" / "0" / "mesh.npz"
    for content in (mesh.read_bytes()[:200], b"", (small_run / "levels" / "0" / "velocity.npy").read_bytes()):
        mesh.write_bytes(content)
        with pytest.raises(InputError, match="level 0 cannot be used, the other levels can"):
            _ = open_run(small_run).levels[0].rest
    assert open_run(small_run).levels[1].steps == 7
    mesh.unlink()
    with pytest.raises(InputError, match="mesh.npz is missing"):
        RunWriter.open(small_run)

    info = json.loads((small_run / "run.json").read_text())
    for entry, message in (({"format": 7}, "of format 7, this pdvol reads formats 1 and 2"), ({"dt": None}, "lacks")):
        (small_run / "run.json").write_text(json.dumps({**info, **entry}))
        with pytest.raises(InputError, match=message):
            open_run(small_run)
    for text in ("{", "[]"):
        (small_run / "run.json").write_text(text)
        with pytest.raises(InputError, match="JSON"):
            open_run(small_run)
    (small_run / "run.json").unlink()
    with pytest.raises(InputError, match="is not a run folder"):
        open_run(small_run)
    with pytest.raises(InputError, match="does not exist"):
        open_run(small_run / "nowhere")


def test_the_log_is_repaired(small_run):
    log = small_run / "log.jsonl"
    whole = log.read_bytes()
    extra = json.dumps({"level": 0, "step": 7}).encode() + b"\n"  # of a step whose state was never written
    log.write_bytes(whole + extra + b'{"level": 0, "st')
    assert len(open_run(small_run).levels[0].log) == 7
    with RunWriter.open(small_run) as writer:
        assert log.read_bytes() == whole
        writer.write_state(0, 7, open_run(small_run).levels[0].positions(6), {})
    assert log.read_bytes() == whole + extra
    log.write_bytes(whole.replace(b'"level": 0, "step": 2', b'"level": 0; "step": 2'))
    with pytest.raises(
        InputError, match="line 2, is not a JSON object of a level and step; the stored states are unaffected"
    ):
        _ = open_run(small_run).levels[0].log
    assert open_run(small_run).levels[0].steps == 8


def test_a_failed_write_keeps_what_was_stored(small_run):
    with RunWriter.open(small_run) as writer:
        x = open_run(small_run).levels[1].positions(6)
        shutil.move(small_run / "levels" / "1", small_run / "moved")
        with pytest.raises(SimulationError, match="cannot write .*states.bin"):
            writer.write_state(1, 7, x)
        shutil.move(small_run / "moved", small_run / "levels" / "1")
        assert writer.steps(1) == 7
        writer.write_state(1, 7, x)
    assert open_run(small_run).levels[1].steps == 8
