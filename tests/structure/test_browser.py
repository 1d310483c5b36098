"""The browser that tests of pages share: it draws WebGL, hears complaints, and ends with its test."""

import numpy as np
import psutil

from browser import busy, chromium, difference

PAGE = """<!DOCTYPE html><title>a page</title><body style="margin:0;background:#fff"><canvas id="c"></canvas><script>
const gl = document.getElementById("c").getContext("webgl2");
function paint(r, g, b) { gl.clearColor(r, g, b, 1); gl.clear(gl.COLOR_BUFFER_BIT); }
paint(1, 0, 0);
</script>"""


def test_a_page_is_drawn_and_seen(tab, tmp_path):
    (tmp_path / "page.html").write_text(PAGE)
    tab.open(tmp_path / "page.html")
    red = tab.picture("#c")
    assert tuple(red[5, 5]) == (255, 0, 0) and busy(red) == 0.0
    whole = tab.picture()
    assert whole.shape == (700, 1000, 3) and 0.02 < busy(whole) < 0.2
    assert difference(whole, whole) == 0.0
    tab.page.evaluate("requestAnimationFrame(() => paint(0, 0, 1))")
    tab.page.wait_for_timeout(300)
    assert difference(red, tab.picture("#c")) == 1.0
    assert difference(red, np.zeros((2, 2, 3), np.uint8)) == 1.0
    assert tab.complaints == [] and tab.requests == []


def test_complaints_and_requests_are_heard(tab, tmp_path):
    (tmp_path / "page.html").write_text(
        "<script>console.error('one'); setTimeout(() => { throw new Error('two'); });</script>"
        "<img src='https://pdvol.invalid/three.png'>"
    )
    tab.open(tmp_path / "page.html")
    said = " ".join(tab.complaints)
    assert "error: one" in said and "exception: two" in said
    assert tab.requests == ["https://pdvol.invalid/three.png"]


def test_the_browser_ends_with_its_test():
    before = children()
    with chromium():
        started = children() - before
        assert len(started) > 1
    assert not started & children()


def children():
    """The ids of all processes that this one, or one of them, has started."""
    return {process.pid for process in psutil.Process().children(recursive=True)}
