"""What a mouse on the live page does, over a made-up session: which body, which place at rest, how far."""

import json
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

from pdvol.store.reader import open_run

pytest.importorskip("websockets", reason="the live page needs websockets (extra `live`)")
from pdvol.studio.live.channel import Channel
from pdvol.studio.live.page import Page
from pdvol.studio.live.server import LocalServer

PATIENCE = 10.0  # seconds for an event to arrive


class Played(SimpleNamespace):
    """A session that shows the last state of a stored run, as if a hand played it."""

    def __init__(self, run, hand):
        stored = open_run(run)
        stored.hand = None
        words = dict.fromkeys(("note", "reason", "lasting", "remark"), "")
        take = SimpleNamespace(number=1, stored=stored, steps=stored.levels[0].steps, branch=None, values={}, hand=hand)
        vars(take).update(words, state="running", kept=None, first_state=0.1, running=True, level_0_ended=False)
        take.levels_with = lambda step: 1
        super().__init__(shown=take, current=take, playing=take, takes=[take], paused=False, values={})

    def tick(self):
        pass


@pytest.fixture(params=["flat_run", "solid_run"])
def played(request, tmp_path):
    """A page over a run, its server, and what the hand holds."""
    hand = Channel(tmp_path / "0001.hand")
    session = Played(request.getfixturevalue(request.param), hand)
    page = Page(session, [], 1, "test", {obstacle.name: None for obstacle in session.shown.stored.obstacles})
    server = LocalServer("127.0.0.1", 0, page.html, page.talk)
    thread = threading.Thread(target=page.serve)
    thread.start()

    def held(holds):
        """What the hand holds, once that `holds`."""
        end = time.monotonic() + PATIENCE
        while not holds(found := json.loads(hand.file.read_text())["pulls"]):
            assert time.monotonic() < end, found
            time.sleep(0.01)
        return found

    yield SimpleNamespace(server=server, stored=session.shown.stored, held=held)
    page.stop()
    thread.join()
    server.stop()


def on_screen(tab, point):
    """Where a point [m] is on the page [pixels]."""
    x, y, z = (*point, 0.0)[:3]
    script = f"""(() => {{
      const seen = new THREE.Vector3({x}, {y}, {z}).project(live.view.camera), box = stage.getBoundingClientRect();
      return [box.left + (seen.x + 1) / 2 * box.width, box.top + (1 - seen.y) / 2 * box.height];
    }})()"""
    tab.until("live.shown.at === live.newest")
    return tab.page.evaluate(script)


def nearest_facet(stored):
    """The middle of a facet that the camera sees, now and at rest, and its body."""
    level = stored.levels[0]
    facets = level.surface if level.rest.shape[1] == 3 else level.cells
    now = level.positions(level.steps - 1)[facets].mean(axis=1)
    depth = now[:, 1] if now.shape[1] == 3 else np.zeros(len(now))  # the front of a 3D scene is -y
    first = int(np.argmin(depth))
    body = stored.info["bodies"][level.mesh.point_bodies[facets[first, 0]]]
    return now[first], level.rest[facets[first]].mean(axis=0), body


def opened(tab, played):
    """The page, pressed on a body; where that is now and at rest, the body, and the pixel."""
    tab.open(played.server.address)
    tab.until("window.live && live.shown")
    now, rest, body = nearest_facet(played.stored)
    x, y = on_screen(tab, now)
    tab.page.mouse.move(x, y)
    tab.page.mouse.down()
    return now, rest, body, x, y


def test_a_body_is_pressed_dragged_and_let_go_by_a_mouse_and_a_finger(tab, played):
    now, rest, body, x, y = opened(tab, played)
    (pull,) = played.held(lambda pulls: pulls)
    size = np.ptp(played.stored.levels[0].rest, axis=0).max()
    assert pull["body"] == body and len(pull["place"]) == len(rest)
    np.testing.assert_allclose(pull["place"], rest, atol=1e-2 * size)
    np.testing.assert_allclose(pull["point"], now, atol=1e-2 * size)
    tab.page.mouse.move(x + 60, y - 40)
    (moved,) = played.held(lambda pulls: pulls[0] != pull)
    assert moved["number"] == pull["number"] and moved["place"] == pull["place"]
    np.testing.assert_allclose(on_screen(tab, moved["point"]), [x + 60, y - 40], atol=0.1)
    if len(now) == 3:
        the_wheel_and_shift_are_for_depth(tab, played, moved["point"], (x + 60, y - 90))
    tab.page.mouse.up()
    played.held(lambda pulls: not pulls)
    fingers = tab.page.context.new_cdp_session(tab.page)
    touch = lambda kind, *points: fingers.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [*points]})
    touch("touchStart", {"x": x, "y": y})
    (pull,) = played.held(lambda pulls: pulls)
    assert pull["body"] == body
    touch("touchMove", {"x": x + 30, "y": y})
    played.held(lambda pulls: pulls[0]["point"][0] > pull["point"][0])
    touch("touchEnd")
    played.held(lambda pulls: not pulls)
    assert tab.complaints == []


def the_wheel_and_shift_are_for_depth(tab, played, before, above):
    towards = np.array(tab.page.evaluate("live.view.camera.getWorldDirection(new THREE.Vector3()).negate().toArray()"))
    tab.page.mouse.wheel(0, 120)
    (pull,) = played.held(lambda pulls: pulls[0]["point"] != before)
    way = np.subtract(pull["point"], before)
    np.testing.assert_allclose(way, (way @ towards) * towards, atol=1e-9)
    assert way @ towards > 0.0, "nearer"
    tab.page.keyboard.down("Shift")
    tab.page.mouse.move(*above)
    (pull,) = played.held(lambda pulls: not np.allclose(pulls[0]["point"], np.add(before, way)))
    tab.page.keyboard.up("Shift")
    further = np.subtract(pull["point"], before) - way
    np.testing.assert_allclose(further, (further @ towards) * towards, atol=1e-9)
    assert further @ towards < 0.0, "up is away"


@pytest.mark.parametrize("played", ["flat_run"], indirect=True)
def test_a_page_that_closes_lets_go_and_another_watches(tab, played):
    now, *_ = opened(tab, played)
    played.held(lambda pulls: len(pulls) == 1)
    tab.until("live.status.mine")
    other = type(tab)(tab.page.context.browser.new_page())
    other.open(played.server.address)
    other.until("window.live && live.shown && document.body.innerText.includes('another page has the hand')")
    other.page.mouse.move(*on_screen(other, now))
    other.page.mouse.down()
    other.page.evaluate("live.ask('hand', {pulls: [], obstacles: {}, sample: 1})")
    other.until("document.getElementById('mistake').textContent === 'another page has the hand'")
    played.held(lambda pulls: len(pulls) == 1)
    tab.page.close()
    other.until("live.status.free")
    played.held(lambda pulls: not pulls)
