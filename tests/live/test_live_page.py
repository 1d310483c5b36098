"""The live page in a browser, over a scene so small that the page is what is tested."""

import os
import re
import signal
import subprocess
import sys
import threading
import time

import pytest

from browser import busy, difference
from cli_scenes import FALL, write

STEPS = 12
DONE = f"level 1: {STEPS} of {STEPS} steps"
PATIENCE_OF_TESTS = 120.0  # seconds for one thing to appear on a busy machine
WINDOW = {"width": 820, "height": 520}  # pixels: software draws it
SCENE = (0, 0, 480, 520)  # left, upper, right, lower edge of the drawing: the controls are beside it [pixels]


class Live:
    """`pdvol live` as a process."""

    def __init__(self, folder, *words):
        self.folder = folder
        write(folder / "fall.py", FALL)
        self.process = subprocess.Popen(
            [sys.executable, "-m", "pdvol", "live", folder / "fall.py", "--port", "0", "-o", folder / "kept", *words],
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | {"TMPDIR": str(folder)},
        )
        guard = threading.Timer(PATIENCE_OF_TESTS, self.process.kill)
        guard.start()
        line = self.process.stderr.readline()
        guard.cancel()
        assert line, "the server ended"
        self.address = re.search(r"http://127\.0\.0\.1:\d+", line)[0]

    def end(self):
        """Its exit code and what it said, after Ctrl-C."""
        self.process.send_signal(signal.SIGINT)
        try:
            return self.process.communicate(timeout=PATIENCE_OF_TESTS)[1], self.process.returncode
        finally:
            self.process.kill()


@pytest.fixture
def live(tmp_path):
    made = Live(tmp_path, "--vary", "young=5e3:5e4", "--vary", "height=0.01:1.0", "--steps", str(STEPS))
    yield made
    made.process.kill()
    made.process.wait()


def shows(tab, text, gone=False):
    """Wait until the page has this text, or has it no more."""
    script = "([text, gone]) => document.body.innerText.includes(text) != gone"
    tab.page.wait_for_function(script, arg=[text, gone], timeout=1000 * PATIENCE_OF_TESTS)


def drawing(tab):
    left, upper, right, lower = SCENE
    return tab.picture()[upper:lower, left:right]


def field(tab, name):
    """The input beside a label; a slider has one for numbers."""
    row = f"//label[normalize-space()='{name}']/ancestor::*[.//input][1]"
    return tab.page.locator(f"xpath={row}//input[not(@type='hidden')]").last


def opened(tab, live):
    """The page, once both levels are done."""
    tab.page.set_viewport_size(WINDOW)
    tab.open(live.address)
    shows(tab, DONE)


def put(tab, name, value):
    """A number into the field beside a slider."""
    field(tab, name).fill(str(value))
    field(tab, name).press("Enter")


def test_a_shot_is_seen_changed_stepped_gone_on_with_and_kept(tab, live):
    opened(tab, live)
    shows(tab, "run 1")
    tab.page.get_by_role("button", name="Stop").click()
    tab.page.get_by_role("button", name="first").click()
    shows(tab, "step 0,")
    tab.page.wait_for_timeout(500)
    first = drawing(tab)
    tab.page.get_by_role("button", name="newest").click()
    shows(tab, f"step {STEPS},")
    tab.page.wait_for_timeout(500)
    last = drawing(tab)
    assert busy(first) > 0.02 and busy(last) > 0.02 and difference(first, last) > 0.01
    put(tab, "height", 0.9)
    shows(tab, "run 2")
    shows(tab, "height 0.9")
    shows(tab, DONE)
    tab.page.get_by_role("button", name="newest").click()
    tab.page.wait_for_timeout(500)
    assert difference(last, drawing(tab)) > 0.01
    put(tab, "young", 8000)
    shows(tab, "run 3")
    shows(tab, DONE)
    tab.page.get_by_role("button", name="Keep this run").click()
    shows(tab, "kept in")
    assert (live.folder / "kept" / "fall_1" / "levels" / "1" / f"{STEPS:06d}.npy").exists()
    tab.page.get_by_role("button", name="newest").click()  # what plays writes its step into the field
    shows(tab, f"step {STEPS},")
    put(tab, "step", 7)
    shows(tab, "step 7,")
    tab.page.get_by_role("button", name="Go on from this step").click()
    shows(tab, "run 4")
    shows(tab, DONE)
    assert not [said for said in tab.complaints if "THREE.Clock" not in said]
    assert {re.match(r"\w+://([^/:]+)", asked)[1] for asked in tab.requests} == {"127.0.0.1"}
    assert [path for path in live.folder.iterdir() if path.name.startswith("pdvol-live-")]
    said, code = live.end()
    assert code == 0 and "Traceback" not in said and str(live.folder / "kept") in said
    assert not [path for path in live.folder.iterdir() if path.name.startswith("pdvol-live-")]


def test_a_mistake_is_shown_and_the_last_run_stays(tab, live):
    opened(tab, live)
    field(tab, "velocity").fill("sideways")
    shows(tab, "on the screen: run 1")
    shows(tab, "must have two or three components")
    shows(tab, "failed")
    field(tab, "velocity").fill("(1.0, 0.0)")
    shows(tab, "on the screen: run 1", gone=True)
    shows(tab, DONE)


def test_the_first_state_after_a_change_is_there_soon(tab, live):
    opened(tab, live)
    begin = time.monotonic()
    put(tab, "young", 9000)
    shows(tab, "run 2")
    tab.page.wait_for_function(
        "() => /first state after [0-9.]+ s/.test(document.body.innerText.split('run 2')[1] || '')",
        timeout=1000 * PATIENCE_OF_TESTS,
    )
    seconds = float(re.search(r"first state after ([0-9.]+) s", tab.page.inner_text("body"))[1])
    assert 0.0 < seconds <= time.monotonic() - begin < 20.0  # 0.4 s on an idle machine
