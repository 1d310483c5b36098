"""What a hand does with level 0 goes into a record, from which a run makes the same states on all levels."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pdvol
import takes
from cli_scenes import SQUARE, write
from cli_scenes import pdvol as command
from killing import PressesCtrlC
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Rigid, meshes
from pdvol.errors import InputError
from pdvol.geometry.level_mesh import body_sizes
from pdvol.measure.verify import verify_run
from pdvol.runs.branch import branch_run
from pdvol.runs.run_metrics import motion_from_level_0
from pdvol.runs.runner import Execution, refine_run, run_scene
from pdvol.runs.scene_file import Shot, load_shot, with_hand
from pdvol.scene import Hand
from pdvol.store.folder import RECORD
from pdvol.studio.live import player
from runs import assert_same_runs
from shapes import grid

STEPS = 40
MOST = 80  # Newton iterations of a step


def scene(dim: int = 2, **more) -> pdvol.Scene:
    """A soft block on a floor beside a wall that can be moved."""
    flat, size, middle = (0.0,) * (dim - 2), (0.3,) * dim, (0.0, 0.16, *(0.0,) * (dim - 2))

    def block(n):
        if dim == 3:
            return meshes.brick(size, (n,) * 3)
        mesh = grid(*(np.linspace(-0.15, 0.15, n + 1),) * 2)
        return pdvol.Solid(mesh.points, mesh.cells.astype(np.int32), mesh.regions)

    wall = meshes.rectangle(0.1, 0.6) if dim == 2 else meshes.box((0.1, 0.6, 0.6))
    return pdvol.Scene(
        (Body((block(2), block(4)), NeoHookean(1e5, 0.4), name="block", placement=Placement(middle)),),
        dt=0.01,
        steps=STEPS,
        loads=(Gravity((0.0, -9.81, *flat)),),
        contact=(Barrier(), Friction(0.3)),
        obstacles=(
            Plane((0.0, 0.0, *flat), (0.0, 1.0, *flat)),
            Rigid(wall, Placement((0.4, 0.32, *flat)), name="wall", movable=True),
        ),
        **more,
    )


def shot_of(scene: pdvol.Scene) -> Shot:
    return Shot(None, {}, scene)


def simulated(scene: pdvol.Scene, out: Path, last: int = 0, **more) -> None:
    run_scene(shot_of(scene), out, 0, last, how=Execution(xdmf=False), **more)


def replayed(scene: pdvol.Scene, take: Path, levels: int = 0, logs: bool = True) -> None:
    """Asserts that a run from the record of a take has the same states."""
    out = take.with_name(f"{take.name}_again")
    simulated(replace(scene, hand=Hand(take / RECORD), steps=pdvol.open_run(take).info["steps"]), out, levels)
    assert_same_runs(take, out, logs)


def is_sound(seed: int, folder: Path) -> None:
    """A random take has no defect and no long step, and is replayed and refined to the last bit."""
    one = scene(2 + seed % 2)
    played = takes.random_take(one, folder / "take", seed, STEPS)
    replayed(one, folder / "take")
    simulated(played, folder / "take", 1, resume=True)
    run = pdvol.open_run(folder / "take")
    assert verify_run(run.path) == [] and max(record["newton_iterations"] for record in run.levels[0].log) <= MOST
    drift = motion_from_level_0(run)[1]["centre_drifts"]["block"]
    assert drift < 0.03 * body_sizes(run.levels[0].mesh)[0]
    replayed(one, (folder / "take").rename(folder / "refined"), 1)


@pytest.mark.parametrize("seed", range(3))
def test_random_takes(seed, tmp_path):
    is_sound(seed, tmp_path)


@pytest.mark.slow
def test_a_thousand_random_takes(tmp_path):
    for seed in range(3, 1003):
        is_sound(seed, tmp_path / str(seed))


def test_an_interrupted_take_is_whole_and_goes_on(tmp_path):
    """It ends where it was interrupted; the hand goes on from there, or finer levels follow."""
    out, one = tmp_path / "take", scene()
    takes.put(out.with_suffix(".state"), [pull(1, (0.0, 0.5))])
    with pytest.raises(KeyboardInterrupt):
        takes.play(one, out, 100, PressesCtrlC(12))
    info = pdvol.open_run(out).info
    assert (info["steps"], info["state"], info["channel"], len(lines(out))) == (12, "done", None, 12)
    replayed(one, out)
    takes.put(out.with_suffix(".state"), obstacles={"wall": (-0.1, 0.0)})
    takes.play(one, out, 20, resume=True)
    assert [len(line["pulls"]) for line in lines(out)] == [1] * 12 + [0] * 8
    simulated(replace(one, hand=Hand(out / RECORD), steps=20), out, 1, resume=True)
    (tmp_path / "take_again").rename(tmp_path / "first_again")
    replayed(one, out, 1)


@pytest.mark.parametrize("by_hand", [True, False], ids=["a take", "a run"])
def test_going_on_by_hand_from_a_step(by_hand, tmp_path):
    one, first, out = scene(), tmp_path / "first", tmp_path / "second"
    if by_hand:
        takes.random_take(one, first, 7, STEPS)
    else:
        simulated(one, first)
    takes.put(out.with_suffix(".state"), [pull(8, (0.3, 0.5))])
    branch_run(player.played(shot_of(one), out, out.with_suffix(".state"), 30), first, 15, out, 0)
    takes.play(one, out, 30, resume=True)
    if by_hand:
        assert lines(out)[:15] == lines(first)[:15]
    assert [pull["number"] for line in lines(out)[15:] for pull in line["pulls"]] == [8] * 15
    for step in range(16):
        places = [pdvol.open_run(each).levels[0].positions(step) for each in (first, out)]
        np.testing.assert_array_equal(*places)
    replayed(one, out, logs=by_hand)  # that of a run without a hand has no energy of pulls
    assert pdvol.open_run(out).info["branched"]["whole"]


def test_what_a_hand_has_shifted_stays_in_a_branch(tmp_path):
    one, first = scene(), tmp_path / "first"
    takes.put(first.with_suffix(".state"), obstacles={"wall": [0.1, 0.0]})
    takes.play(one, first, 8)
    with pytest.raises(InputError, match="what a hand has shifted is elsewhere at step 5"):
        branch_run(shot_of(one), first, 5, tmp_path / "second", 0)


def pull(number, point, **more):
    return {"number": number, "body": "block", "place": [0.0, 0.31], "point": list(point)} | more


def lines(out: Path) -> list[dict]:
    return [json.loads(line) for line in (out / RECORD).read_text().splitlines()]


class Says:
    """Follows a run by putting states one after the other, some of them as they are."""

    def __init__(self, channel: Path, states):
        self._channel, self._states = channel, list(states)

    def __call__(self, *_):
        return self

    def step(self, record):
        state = self._states[min(record["step"], len(self._states)) - 1]
        self._channel.write_text(state if isinstance(state, str) else json.dumps(state))

    def lasts(self, record):
        pass

    def close(self):
        pass


def test_bad_states_have_a_line_each_and_change_nothing(tmp_path, capsys):
    good = {"pulls": [pull(1, (0.0, 0.4))], "obstacles": {"wall": [0.01, 0.0]}}
    bad = [
        ("{", "Expecting"),
        ("[]", "must be a JSON object"),
        ('{"pulls": [{"number": 1, "point": [NaN, 0]}]}', "not a finite number"),
        ('{"pulls": [{"number": 1, "point": [1e300, 0]}]}', "too far away"),
        ({"pulls": [pull(1, (0.0, 0.0, 0.0))]}, "differ in length"),
        ({"pulls": [pull(1, "no")]}, "'n' is not a finite number"),
        ({"pulls": [pull(1, (0.0, 0.4)), pull(2, (0.0, 0.5)) | {"place": [9.0, 0.0]}]}, "far outside"),
        ({"pulls": [pull(1, (0.0, 0.4)), pull(2, (0.0, 0.5)) | {"body": "nobody"}]}, "no body 'nobody'"),
        ({"pulls": [pull(1, (0.0, 0.4)), pull([3], (0.0, 0.5)), 5, None]}, "must be a JSON object"),
        ({"pulls": [pull(1, (0.0, 0.4)), pull(2, (0.0, 0.5), stiffness=-1.0)]}, "must be positive"),
        ({**good, "obstacles": {"plane": [0.0, 0.0], "wall": [float("inf"), 0.0]}}, "'plane' is nothing movable"),
    ]
    out = tmp_path / "take"
    takes.play(scene(), out, 4 + len(bad), Says(out.with_suffix(".state"), [good, good, *(text for text, _ in bad)]))
    said = [line for line in capsys.readouterr().err.splitlines() if line.startswith("hand: ")]
    for _, message in bad:
        assert any(message in line for line in said), (message, said)
    assert len(said) == len(set(said))
    held = [[each["number"] for each in line["pulls"]] for line in lines(out)]
    assert held == [[]] * 2 + [[1]] * (len(held) - 2)
    assert all(line["obstacles"]["wall"][0] == 0.01 for line in lines(out)[4:])
    assert verify_run(out) == []
    replayed(scene(), out)


def test_what_is_taken_where_it_is_is_not_pulled_before_the_hand_moves(tmp_path):
    """The mean of the patch is beside its place."""
    out, place, one = tmp_path / "take", [0.15, 0.31], replace(scene(), loads=())
    still, moved = ({"number": 1, "body": "block", "place": place, "point": [x, 0.31]} for x in (0.15, 0.3))
    states = [{}] * 4 + [{"pulls": [still]}] * 4 + [{"pulls": [moved]}]
    takes.play(one, out, 14, Says(out.with_suffix(".state"), states))
    energy = [record["energy"]["pull"] for record in pdvol.open_run(out).levels[0].log]
    assert [bool(line["pulls"]) for line in lines(out)] == [False] * 6 + [True] * 8
    assert max(energy[6:8]) < 1e-12 and max(energy[10:]) > 0.1
    ways = [0.3 - line["pulls"][0]["point"][0] for line in lines(out)[9:]]  # it comes to the hand without a jump
    np.testing.assert_allclose(ways, 0.15 * np.exp(-one.dt / player.LAG * np.arange(5)), rtol=1e-9)
    assert 0.01 < np.linalg.norm(lines(out)[7]["pulls"][0]["grip"]) < 0.1
    replayed(one, out)


def test_more_fingers_than_a_hand_has_are_left_out(tmp_path):
    out = tmp_path / "take"
    takes.put(out.with_suffix(".state"), [pull(number % 30, (0.0, 0.4)) for number in range(1000)])
    takes.play(scene(), out, 3)
    assert [[p["number"] for p in line["pulls"]] for line in lines(out)] == [list(range(player.MOST_PULLS))] * 3


def test_what_is_moved_has_a_bounded_speed_and_gives_way(tmp_path):
    """The wall comes from the right, presses the block against another wall, and waits there."""
    post = Rigid(meshes.rectangle(0.1, 0.6), Placement((-0.22, 0.32)), name="post")
    far = Rigid(meshes.rectangle(0.1, 0.1), Placement((2.0, 2.0)), name="far", movable=True)
    one = scene()
    one, out = replace(one, obstacles=(*one.obstacles, post, far)), tmp_path / "take"
    states = [{"obstacles": {"wall": [-0.6, 0.0], "far": [0.0, y]}} for y in [0.0] * 20 + [0.05] * 15 + [0.1]]
    takes.play(one, out, STEPS, Says(out.with_suffix(".state"), states))
    run, offsets = pdvol.open_run(out), np.array([line["obstacles"].get("wall", [0.0])[0] for line in lines(out)])
    ways = np.diff(np.concatenate([[0.0], offsets]))
    assert 0.02 < -ways.min() < 0.05 * 0.5 and ways.max() < 0.05, "and back to where it was held"
    assert verify_run(out) == []
    assert sum(record.get("behind", 0.0) > 0.0 for record in run.levels[0].log) > 3
    assert max(record["newton_iterations"] for record in run.levels[0].log) <= MOST
    for step in range(STEPS + 1):  # what is on time is where the hand has it, while another one waits
        offset = lines(out)[step - 1]["obstacles"].get("far", [0.0, 0.0]) if step else [0.0, 0.0]
        place = run.levels[0].placed(run.obstacles, step)[3].vertices(step).mean(axis=0)
        np.testing.assert_allclose(place, [2.0, 2.0] + np.array(offset), atol=1e-12)
    wall = run.levels[0].placed(run.obstacles, STEPS)[1].vertices(STEPS)
    left = wall[:, 0].min()
    assert -0.17 < left < -0.16 and -0.05 < 0.35 + offsets[-1] - left < 0.0, "at the post, and at most a step ahead"
    takes.put(out.with_suffix(".state"), obstacles={"wall": [0.3, 0.0]})
    takes.play(one, out, 3 * STEPS, resume=True)
    assert lines(out)[-1]["obstacles"]["wall"][0] == 0.3
    run = pdvol.open_run(out)
    wall = run.levels[0].placed(run.obstacles, 3 * STEPS)[1].vertices(3 * STEPS)
    assert wall[:, 0].min() == pytest.approx(0.65)
    replayed(one, out)


def test_a_support_is_moved(tmp_path):
    held = pdvol.Support(lambda X: X[:, 1] > 0.3, movable=True)
    one, out = scene(supports=(held,)), tmp_path / "take"
    takes.put(out.with_suffix(".state"), obstacles={"support 0": [0.0, 0.1]})
    takes.play(one, out, STEPS)
    level = pdvol.open_run(out).levels[0]
    top = level.rest[:, 1] > 0.3
    np.testing.assert_allclose(level.positions(STEPS)[top], level.rest[top] + [0.0, 0.1], atol=1e-12)
    replayed(one, out)


def test_time_goes_with_the_clock_and_never_ahead(monkeypatch, tmp_path):
    """Fast steps wait for the clock; a slow one is not made up for."""
    now, out, at = [100.0], tmp_path / "take", []

    class Clock:
        monotonic = staticmethod(lambda: now[0])
        sleep = staticmethod(lambda seconds: now.__setitem__(0, now[0] + seconds))

    class Watch(Says):
        def step(self, record):
            at.append(now[0])
            now[0] += 0.5 if record["step"] == 5 else 0.002

    monkeypatch.setattr(player, "time", Clock)
    shot = player.played(shot_of(scene()), out, out.with_suffix(".state"), 10)
    run_scene(shot, out, 0, 0, how=Execution(progress=Watch(out, [{}]), xdmf=False))
    times = 0.01 * np.arange(1, 11) + np.where(np.arange(1, 11) > 5, 0.5, 0.0)
    assert len(lines(out)) == 10 and (np.array(at) - 100.0 >= 0.01 * np.arange(1, 11) - 1e-9).all()
    np.testing.assert_allclose(np.array(at) - 100.0, times, atol=0.011)
    assert (np.diff(at) > 0.01 - 1e-9).all()


FILE = (
    SQUARE
    + """

def scene(steps=8, speed=0.0):
    body = Body((square(2), square(3)), NeoHookean(2e4), name="square", placement=Placement((0.0, 0.02)))
    return Scene((body,), dt=0.02, steps=steps, obstacles=(Plane((0.0, 0.0), (0.0, 1.0)),), contact=(Barrier(),),
                 loads=(Gravity((0.0, -9.81 + speed)),))
"""
)
HELD = {"number": 1, "body": "square", "place": [0.5, 1.02], "point": [0.7, 1.5]}
QUIET = ("--no-picture", "--no-xdmf")


def test_the_command_line_plays_replays_and_refines(tmp_path):
    file, take, again = write(tmp_path / "scene.py", FILE), tmp_path / "take", tmp_path / "again"
    takes.put(tmp_path / "state", [HELD])
    play = ("run", file, "--hand-from", tmp_path / "state", "--levels", "0:1", "--wavefront", "--steps", 12, *QUIET)
    assert command(*play, "--out", take) == 0
    assert len(lines(take)) == 12 and all(line["pulls"] == [HELD] for line in lines(take))
    assert command("run", file, "--hand", take / RECORD, "--out", again, *QUIET) == 0
    assert_same_runs(take, again)
    record = Hand(take / RECORD)
    record.keep(9)
    run_scene(with_hand(load_shot(file), record, 9), tmp_path / "short", 0, 0, how=Execution(xdmf=False))
    assert pdvol.open_run(tmp_path / "short").info["steps"] == 9
    info = json.loads((tmp_path / "short" / "run.json").read_text())
    killed = info | {"steps": 500, "channel": str(tmp_path / "state")}
    (tmp_path / "short" / "run.json").write_text(json.dumps(killed))
    refine_run(tmp_path / "short", 1, Execution(xdmf=False))
    run = pdvol.open_run(tmp_path / "short")
    assert run.info["state"] == "done" and [level.steps for level in run.levels] == [10, 10]


def test_mistakes_have_a_line(tmp_path, capsys):
    def failure(*words):
        capsys.readouterr()
        assert command(*words) == 2
        return capsys.readouterr().err

    file = write(tmp_path / "scene.py", FILE)
    record, out = tmp_path / "h.jsonl", ("--out", tmp_path / "out", *QUIET)
    good = {"step": 1, "pulls": [HELD], "obstacles": {}}
    assert "is missing" in failure("run", file, "--hand", tmp_path / "none", *out)
    for line, message in [
        ("{}", "line 2 is no line of a hand"),
        ("no", "line 2 is no line of a hand"),
        (json.dumps(good | {"obstacles": {"a": [1.0]}}), "the offset of 'a'"),
        (json.dumps(good | {"pulls": [HELD | {"place": [50.0, 0.0]}]}), "far outside square"),
        (json.dumps(good | {"pulls": [HELD | {"body": "round"}]}), "names the body 'round'"),
    ]:
        record.write_text(f"{json.dumps(good)}\n{line}\n")
        assert message in failure("run", file, "--hand", record, *out), message
    assert "leave out" in failure("run", file, "--hand-from", record, "--method", "direct", *out)
    record.write_text(f"{json.dumps(good)}\n")
    assert command("run", file, "--hand", record, *out) == 0
    record.write_text(f"{json.dumps(good | {'pulls': []})}\n")
    assert "hand" in failure("run", file, "--hand", record, "--resume", *out)
    with pytest.raises(InputError, match="needs another name"):
        replace(scene(), obstacles=(*scene().obstacles, scene().obstacles[1]))
