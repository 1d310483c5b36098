"""Takes: runs that a hand directs, without a page."""

import numpy as np
import pytest

from cli_scenes import FALL, pdvol, write
from live_page import next_run, until
from pdvol.errors import InputError
from pdvol.store.reader import open_run
from pdvol.studio.live import session as sessions

PLAYED = 15  # steps of a take


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("takes")
    write(made / "fall.py", FALL)
    (made / "runs").mkdir()
    return made


@pytest.fixture(scope="module")
def session(folder):
    made = sessions.Session(folder / "fall.py", {}, folder / "runs", folder / "kept", finest=1)
    yield made
    made.close()


def play(session, step=0):
    """A new take from a step of the shown run, while it is played."""
    last = session.current.number if session.current else 0
    session.branch(step, by_hand=True)
    until(session, lambda: session.playing is not None and session.playing.number > last)
    until(session, lambda: session.playing.steps > step)
    return session.playing


def pull(session, take, point, steps=PLAYED):
    """The hand draws the square's corner to a point for some steps."""
    first = take.steps
    take.hand.hold([{"number": 1, "body": "square", "place": [0.0, 1.0], "point": point}], {}, 7)
    until(session, lambda: take.steps > first + steps)


def end(session, take):
    session.end_take()
    until(session, lambda: not take.running)
    return take.stored


def test_a_take_ends_when_it_is_told_to_is_refined_and_replays_to_the_last_bit(session, folder):
    take = play(session)
    take.hand.hold([{"number": 1, "body": "nobody", "place": [0.0, 1.0], "point": [0.0, 0.0]}], {})
    until(session, lambda: "no body 'nobody'" in take.remark)
    pull(session, take, [-0.5, 1.5])
    assert take.stored.hand.line(take.steps - 1)["sample"] == 7
    stored = end(session, take)
    assert (take.state, take.reason) == ("done", "") and session.playing is None and session.takes == [take]
    steps = stored.info["steps"]
    assert take.steps == steps + 1 > PLAYED and take.levels_with(steps) == 2, "finer levels follow"
    again = folder / "again"
    record = take.folder / "hand.jsonl"
    assert pdvol("run", folder / "fall.py", "--hand", record, "--out", again, "--levels", "0:0", "--no-picture") == 0
    for step in range(steps + 1):
        np.testing.assert_array_equal(
            open_run(again).levels[0].positions(step), stored.levels[0].positions(step), err_msg=str(step)
        )
    assert pdvol("verify", take.folder) == 0


def test_a_take_goes_on_by_hand_from_a_step_of_another(session, folder):
    first = session.takes[0]
    session.show(first.number)
    take = play(session, step=8)
    pull(session, take, [0.5, 1.5])
    stored = end(session, take)
    for level in (0, 1):
        for step in range(9):
            np.testing.assert_array_equal(
                stored.levels[level].positions(step), first.stored.levels[level].positions(step)
            )
    assert not np.array_equal(stored.levels[0].positions(PLAYED), first.stored.levels[0].positions(PLAYED))
    session.show(first.number)
    assert session.shown is first
    assert open_run(session.keep("thrown")).hand.line(3) == first.stored.hand.line(3)
    with pytest.raises(InputError, match="no take 99"):
        session.show(99)


def test_takes_stay_while_other_runs_come_and_go(session, folder, monkeypatch):
    monkeypatch.setattr(sessions, "MOST_RUNS", 2)
    numbers = [take.number for take in session.takes]
    for i in range(4):
        session.change({"young": 1e4 + i, "steps": 2})
        next_run(session)
    assert [take.number for take in session.takes] == numbers
    assert len([path for path in (folder / "runs").iterdir() if path.is_dir()]) <= 2 + len(numbers)
    session.refine(numbers[0])
    until(session, lambda: not session.current.running)
    assert (session.shown.number, session.current.number, session.current.state) == (numbers[0], numbers[0], "done")


def test_a_change_ends_a_take_which_stays(session):
    take = play(session)
    until(session, lambda: take.steps > 3)
    with pytest.raises(InputError, match="end it before"):
        session.refine(session.takes[0].number)
    session.change({"young": 1.5e4, "steps": 2})
    until(session, lambda: session.current is not take)
    assert take.state == "stopped" and not take.running and take in session.takes
    until(session, lambda: not session.current.running)
    assert take.stored.info["steps"] == take.steps - 1


def test_a_take_goes_on_from_a_step_that_only_level_0_has_reached(session, monkeypatch):
    step = 0
    for cores in (1, 2):  # with the second one idle, level 1 would follow
        monkeypatch.setattr(sessions, "idle_cores", lambda cores=cores: cores)
        take = play(session, step)
        until(session, lambda take=take, step=step: take.steps > step + 4)
        step = take.steps - 1
    assert "step 0" not in take.note and step > 0
    end(session, take)
