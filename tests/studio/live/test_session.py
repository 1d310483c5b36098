"""The runs behind a live page, without a page."""

import json
import re
import time

import numpy as np
import pytest

from cli_scenes import FALL, pdvol, write
from live_page import PATIENCE_OF_TESTS, next_run, until
from pdvol.errors import InputError
from pdvol.store.reader import open_run
from pdvol.studio.live.session import Session
from runs import assert_same_runs

STEPS = 6
LONG = 100_000  # steps of a run that a test ends


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("live")
    write(made / "fall.py", FALL)
    (made / "runs").mkdir()
    return made


@pytest.fixture(scope="module")
def session(folder):
    made = Session(folder / "fall.py", {"steps": STEPS}, folder / "runs", folder / "kept", finest=1)
    yield made
    made.close()


def run_with(session, **values):
    """The run that these values start, at its end."""
    session.change({"steps": STEPS, "young": 2e4, "height": 0.02} | values)
    return next_run(session)


def long_run(session, **values):
    """A run that has begun."""
    session.change({"steps": LONG} | values)
    until(session, lambda: session.current and session.current.values["steps"] == LONG and session.current.steps > 3)
    return session.current


def test_a_change_starts_a_run_that_is_refined_as_one_of_the_command_line(session, folder):
    run = run_with(session, young=1.5e4)
    assert (run.state, run.reason, run.steps, run.levels_with(STEPS)) == ("done", "", STEPS + 1, 2)
    assert session.shown is run and 0.0 < run.first_state < PATIENCE_OF_TESTS
    words = ("--steps", STEPS, "--no-picture", "--no-xdmf", "--set", "young=1.5e4", "--out", folder / "alone")
    assert pdvol("run", folder / "fall.py", *words) == 0
    assert_same_runs(run.folder, folder / "alone", logs=False)


def test_values_and_modules_beside_the_scene_are_those_of_now(session, folder):
    """Values to the last bit, in processes that carry out one run after the other."""
    write(folder / "fall.py", "import beside\n" + FALL.replace("Gravity((0.0, -9.81))", "Gravity((0.0, beside.PULL))"))
    lowest = []
    for pull in ("-9.81", "-0.01", "-9.81"):
        write(folder / "beside.py", f"PULL = {pull}")
        run = run_with(session, young=1e4 / 3, height=1 / 240)
        assert (run.state, run.reason) == ("done", "")
        stored = run.stored.info["parameters"]
        assert (stored["young"], stored["height"]) == (1e4 / 3, 1 / 240)
        lowest.append(run.stored.levels[0].positions(2)[:, 1].min())
    assert lowest[0] == lowest[2] < lowest[1]
    write(folder / "fall.py", FALL)


def test_changes_in_a_row_start_one_run_with_the_last_value(session):
    first = session.current.number if session.current else 0
    for young in np.linspace(1e4, 2e4, 9):
        session.change({"young": float(young)})
        session.tick()
    assert next_run(session, first).number == first + 1 and session.current.values["young"] == 2e4


def test_a_change_ends_the_run_before_and_its_states_stay(session):
    long = long_run(session)
    run = run_with(session)
    assert run.number == long.number + 1 and run.state == "done"
    assert long.state == "stopped" and not long.running
    assert 3 < open_run(long.folder).levels[0].steps < LONG


def test_a_paused_run_waits_and_goes_on_one_step(session):
    run = long_run(session)
    session.pause()
    time.sleep(0.3)
    for _ in range(2):  # at once, and after one step more
        session.tick()
        held = run.steps
        time.sleep(0.4)
        session.tick()
        assert session.paused and run.steps == held and run.running
        session.go_to(held)
        until(session, lambda held=held: run.steps > held)
        time.sleep(0.3)
    session.resume()
    until(session, lambda: run.steps > held + 3)
    assert run_with(session).state == "done"


def test_a_wrong_value_is_one_line_and_the_run_before_stays_on_the_screen(session):
    good = run_with(session)
    wrong = run_with(session, young=-1.0)
    assert wrong.state == "failed" and "young = -1" in wrong.reason and "\n" not in wrong.reason
    assert session.shown is good and session.current is wrong
    assert run_with(session).state == "done"


def test_a_failed_simulation_says_why_and_keeps_its_steps(session):
    run = run_with(session, max_iterations=1, velocity=(0.0, -300.0))
    for name in ("max_iterations", "velocity"):
        del session.values[name]
    assert run.state == "failed" and run.reason.startswith("level 0, step")
    assert session.shown is run and 1 <= run.steps <= STEPS
    assert np.isfinite(run.stored.levels[0].positions(run.steps - 1)).all()


def test_a_run_goes_on_from_a_stored_step_with_another_value(session, folder):
    first = run_with(session, young=2e4)
    session.change({"young": 1e4})
    session.branch(4)
    run = next_run(session)
    assert (run.state, run.reason, run.note) == ("done", "", "")
    old, new = first.stored, run.stored
    for level in (0, 1):
        for step in range(STEPS + 1):
            same = np.array_equal(old.levels[level].positions(step), new.levels[level].positions(step))
            assert same == (step <= 4), (level, step)
    assert new.info["branched"]["step"] == 4 and new.info["branched"]["parameters"]["young"] == 2e4
    assert new.info["parameters"]["young"] == 1e4


def test_where_a_run_cannot_go_on_it_starts_again_and_says_so(session):
    first = run_with(session, height=0.02)
    session.change({"height": 0.5})
    session.branch(4)
    run = next_run(session, first.number + 1)
    assert run.state == "done" and run.branch is None and "starts from step 0" in run.note and "placement" in run.note
    assert run.stored.levels[0].positions(0)[:, 1].min() > 0.4
    assert "branched" not in run.stored.info


def test_a_kept_run_is_a_run_of_its_own_with_all_that_follows(session, folder):
    long_run(session, young=1.7e4)
    until(session, lambda: session.shown is session.current)
    long = session.keep("long")
    assert long == folder / "kept" / "long" and open_run(long).levels[0].steps > 3
    with pytest.raises(InputError, match="is there already"):
        session.keep("long")
    for name in ("", "a/b", "..", ".hidden"):
        with pytest.raises(InputError, match="no name of a folder"):
            session.keep(name)
    done = run_with(session)
    assert open_run(long).levels[0].steps > 4
    assert open_run(long).info["state"] == "interrupted"
    assert_same_runs(session.keep("done"), done.folder)
    assert pdvol("verify", long) == 0
    assert pdvol("run", folder / "fall.py", "--resume", "--out", long) == 2, "other steps"
    assert pdvol("refine", folder / "kept" / "done", "--to", 1, "--no-picture") == 0


def test_a_process_that_is_killed_is_replaced(session):
    run = long_run(session)
    run.worker._process.kill()
    until(session, lambda: not run.running)
    assert run.state == "failed" and session.shown is run
    assert run_with(session).state == "done"


SLOW = """
import time
from pdvol.integrate import long_step

long_step.SHOWN_AFTER = long_step.SHOWN_EVERY = 0.0
shown = long_step.LongStep.iterated
long_step.LongStep.iterated = lambda *state: (shown(*state), time.sleep(0.1))
"""


def test_a_step_that_lasts_says_how_far_it_is_and_the_end_ends_all_processes(tmp_path):
    write(tmp_path / "fall.py", FALL + SLOW)
    (tmp_path / "runs").mkdir()
    made = Session(tmp_path / "fall.py", {"steps": LONG}, tmp_path / "runs", tmp_path / "kept")
    try:
        made.start()
        until(made, lambda: made.current is not None and made.current.lasting)
        assert re.match(r"level 0  step +\d+/100000  newton \d+  contacts .* s so far$", made.current.lasting)
        until(made, lambda: made.shown is not None)
        workers = list(made._workers._workers)
        made.keep("end")
    finally:
        made.close()
    assert len(workers) >= 2 and not any(worker.alive for worker in workers)
    assert open_run(tmp_path / "kept" / "end").levels[0].steps > 0
    assert json.loads((tmp_path / "kept" / "end" / "run.json").read_text())["state"] == "interrupted"
