"""Progress: a bar on a terminal, plain lines elsewhere."""

import io

import runs
from pdvol.runs.progress import Progress


def lasting(step, iterations, seconds):
    """What is shown of a step so far."""
    record = {"step": step, "newton_iterations": iterations, "contacts": 37, "min_gap": 1.2e-4}
    return record | {"seconds": {"total": seconds}}


def test_plain_lines_of_steps_and_ever_fewer_of_a_step_that_lasts():
    stream = io.StringIO()
    progress = Progress(1, 100, stream=stream)
    progress.step(runs.record(1, 11))
    for tenths in range(20, 100, 5):
        progress.lasts(lasting(12, tenths, 0.1 * tenths))
    progress.step({"step": 12, "newton_iterations": 2, "contacts": 0, "min_gap": None, "seconds": {"total": 12.5}})
    progress.lasts(lasting(13, 8, 2.0))
    progress.step({"step": 100})
    progress.close()
    assert stream.getvalue().splitlines() == [
        "level 1  step  11/100  newton 4  contacts 37  gap 1.2e-04  0.31 s",
        "level 1  step  12/100  newton 20  contacts 37  gap 1.2e-04  2.00 s so far",
        "level 1  step  12/100  newton 40  contacts 37  gap 1.2e-04  4.00 s so far",
        "level 1  step  12/100  newton 80  contacts 37  gap 1.2e-04  8.00 s so far",
        "level 1  step  12/100  newton 2  contacts 0  12.50 s",
        "level 1  step  13/100  newton 8  contacts 37  gap 1.2e-04  2.00 s so far",
        "level 1  step 100/100",
        f"level 1: {runs.DT:.3g} s of the shot in 0.31 s, real-time factor {runs.DT / 0.31:.2g}",
    ]


def test_the_real_time_factor_is_that_of_the_steps_seen():
    stream = io.StringIO()
    progress = Progress(1, 14, 11, stream)
    for step in (12, 13, 14):
        progress.step({"step": step, "time": 0.02 * step, "seconds": {"total": 0.5}})
    progress.close()
    assert stream.getvalue().splitlines()[-1] == "level 1: 0.06 s of the shot in 1.50 s, real-time factor 0.04"


def test_a_bar_shows_steps_the_time_left_and_a_step_that_lasts(monkeypatch):
    stream = io.StringIO()
    monkeypatch.setattr(stream, "isatty", lambda: True, raising=False)
    progress = Progress(2, 3, 1, stream)
    progress.lasts(lasting(2, 45, 3.0))
    for words in ("level 2", "1/3", "step=2", "newton=45", "gap=1.2e-04"):
        assert words in stream.getvalue()
    for step in (2, 3):
        progress.step(runs.record(2, step))
    progress.close()
    for words in ("3/3", "newton=4,", "contacts=37", "<"):
        assert words in stream.getvalue()
