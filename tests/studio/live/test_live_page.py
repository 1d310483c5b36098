"""The live page in a browser, over scenes so small that the page is what is tested."""

import re
import time

import pytest

import runs
from browser import busy, difference
from cli_scenes import DROP, FALL
from live_page import PATIENCE_OF_TESTS, Live, shows
from sockets import listening_addresses

STEPS = 12
DONE = f"level 1: {STEPS} of {STEPS} steps"
WINDOW = {"width": 820, "height": 520}  # pixels: software draws it
SETTLED = 500  # milliseconds after which a change is drawn
WATCH_LEVELS = r"""() => {
  window.levels = [];
  setInterval(() => {
    const found = document.getElementById("moment").textContent.match(/, level (\d)$/);
    if (!found || live.run !== 2 || ![...live.levels.values()].includes(live.shown)) return;
    if (window.levels.at(-1) !== found[1]) window.levels.push(found[1]);
  }, 10);
}"""
"""Notes each level that is shown of run 2, once for each change."""


@pytest.fixture(params=[FALL])
def live(tmp_path, request):
    ranges = ("--vary", "young=5e3:5e4", "--vary", "height=0.01:1.0")
    made = Live(tmp_path, request.param, *ranges, "--steps", str(STEPS))
    yield made
    made.process.kill()
    made.process.wait()


def becomes(tab, holds):
    """The drawing, once it `holds` what is asked for, or the last one: a busy machine draws late."""
    end = time.monotonic() + PATIENCE_OF_TESTS
    while True:
        tab.page.wait_for_timeout(SETTLED)
        seen = tab.picture("#stage")
        if holds(seen) or time.monotonic() > end:
            return seen


def field(tab, name):
    """The input beside a label; a slider has one for numbers."""
    return tab.page.locator(f"xpath=//label[normalize-space()='{name}']//input").last


def opened(tab, live):
    """The page, once both levels are done."""
    tab.page.set_viewport_size(WINDOW)
    tab.open(live.address)
    shows(tab, DONE)


def put(tab, name, value):
    """A number into the field beside a slider."""
    field(tab, name).fill(str(value))
    field(tab, name).press("Enter")


def still(tab, button):
    """The drawing once the step that a button asks for is shown."""
    tab.page.get_by_role("button", name=button, exact=True).click()
    shows(tab, {"first": "step 0,", "newest": f"step {STEPS},"}[button])
    tab.page.wait_for_timeout(SETTLED)
    return tab.picture("#stage")


def test_a_shot_is_seen_changed_stepped_gone_on_with_and_kept(tab, live):
    opened(tab, live)
    shows(tab, "run 1")
    tab.page.get_by_role("button", name="Stop").click()
    first, last = still(tab, "first"), still(tab, "newest")
    assert busy(first) > 0.02 and busy(last) > 0.02 and difference(first, last) > 0.01
    put(tab, "height", 0.9)
    shows(tab, "run 2")
    shows(tab, "height 0.9")
    shows(tab, DONE)
    assert difference(last, still(tab, "newest")) > 0.01
    begin = time.monotonic()
    put(tab, "young", 8000)
    shows(tab, "run 3")
    tab.until("/first state after [0-9.]+ s/.test(document.body.innerText.split('run 3')[1] || '')")
    seconds = float(re.search(r"first state after ([0-9.]+) s", tab.page.inner_text("body"))[1])
    assert 0.0 < seconds <= time.monotonic() - begin < 20.0  # 0.4 s on an idle machine
    shows(tab, DONE)
    tab.page.get_by_role("button", name="Keep this run").click()
    shows(tab, "kept in")
    assert runs.count(live.folder / "kept" / "fall_1" / "levels" / "1") == STEPS + 1
    still(tab, "newest")
    put(tab, "step", 7)
    shows(tab, "step 7,")
    tab.page.get_by_role("button", name="Go on from this step").click()
    shows(tab, "run 4")
    shows(tab, DONE)
    a_mistake_is_shown_and_the_last_run_stays(tab, live)
    tab.page.get_by_role("button", name="first").click()
    tab.page.get_by_role("button", name="Fit view").click()
    tab.page.wait_for_timeout(SETTLED)
    shows(tab, "step 0,")
    assert tab.page.locator("#play").inner_text() == "Play", "to fit the view does not play"
    assert tab.complaints == []
    assert {re.match(r"\w+://([^/:]+)", asked)[1] for asked in tab.requests} == {"127.0.0.1"}
    assert [path for path in live.folder.iterdir() if path.name.startswith("pdvol-live-")]
    said, code = live.end()
    assert code == 0 and "Traceback" not in said and str(live.folder / "kept") in said
    assert not [path for path in live.folder.iterdir() if path.name.startswith("pdvol-live-")]


def choose_level(tab, level):
    tab.page.get_by_label("level").select_option(level)


@pytest.mark.parametrize("live", [DROP], indirect=True)
def test_a_solid_is_previewed_refined_and_drawn_as_a_wireframe(tab, live):
    assert listening_addresses(int(live.address.rpartition(":")[2])) == {"127.0.0.1"}
    opened(tab, live)
    first, last = still(tab, "first"), still(tab, "newest")
    assert busy(first) > 0.02 and busy(last) > 0.02 and difference(first, last) > 0.01
    shows(tab, f"step {STEPS}, 0.24 s, level 1")
    choose_level(tab, "0")
    shows(tab, f"step {STEPS}, 0.24 s, level 0")
    other = becomes(tab, lambda seen: difference(last, seen) > 0.002)
    assert difference(last, other) > 0.002, "the preview has another surface"
    choose_level(tab, "finest")
    shows(tab, f"step {STEPS}, 0.24 s, level 1")
    assert difference(last, becomes(tab, lambda seen: difference(last, seen) < 0.0005)) < 0.0005
    tab.page.get_by_label("Drawn as").select_option("wireframe")
    edges = becomes(tab, lambda seen: difference(last, seen) > 0.02)
    assert difference(last, edges) > 0.02 and busy(edges) > 0.005
    tab.page.evaluate(WATCH_LEVELS)
    put(tab, "height", 0.9)
    shows(tab, "run 2")
    shows(tab, DONE)
    higher = still(tab, "first")
    assert difference(first, higher) > 0.02
    assert tab.page.evaluate("window.levels")[:2] == ["0", "1"], "the preview comes first, and is replaced"
    tab.page.get_by_label("Drawn as").select_option("surface")
    solid = becomes(tab, lambda seen: difference(higher, seen) > 0.01)
    assert difference(higher, solid) > 0.01, "the new run's bodies were edges, too"
    assert tab.complaints == []


def a_mistake_is_shown_and_the_last_run_stays(tab, live):
    """With run 4 on the screen."""
    kept = sorted((live.folder / "kept").iterdir())
    field(tab, "name").fill("a/b")
    tab.page.get_by_role("button", name="Keep this run").click()
    shows(tab, "'a/b' is no name of a folder")
    assert sorted((live.folder / "kept").iterdir()) == kept
    field(tab, "velocity").fill("sideways")
    shows(tab, "on the screen: run 4")
    shows(tab, "must have two or three components")
    shows(tab, "failed")
    field(tab, "velocity").fill("(1.0, 0.0)")
    shows(tab, "on the screen: run 4", gone=True)
    shows(tab, DONE)
