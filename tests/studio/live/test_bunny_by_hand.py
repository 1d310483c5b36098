"""The whole way by mouse: the README's bunny is picked up, thrown over a wall onto stairs, met by a paddle, thrown
again from an earlier step, kept and refined.
"""

import numpy as np
import pytest

from cli_scenes import pdvol
from live_page import PATIENCE_OF_TESTS, Live, shows
from pdvol.geometry.level_mesh import lumped_masses
from pdvol.store.reader import open_run

STAIRS = """
import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Rigid, Scene, meshes


def scene(young=2e5, steps=60):
    bunny = Body(meshes.bunny(0.8), NeoHookean(young), vertices=(300, 500, 800), name="bunny",
                 placement=Placement((0.0, 0.02, 0.0)))
    box = lambda name, size, place, **more: Rigid(meshes.box(size), name=name, placement=Placement(place), **more)
    return Scene(
        bodies=(bunny,),
        obstacles=(
            Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), name="ground"),
            box("wall", (0.08, 0.4, 1.2), (0.7, 0.21, 0.0)),
            box("first stair", (0.4, 0.15, 1.2), (1.2, 0.085, 0.0)),
            box("second stair", (0.4, 0.3, 1.2), (1.61, 0.16, 0.0)),
            box("paddle", (0.08, 0.6, 1.0), (2.3, 0.65, 0.0), movable=True),
        ),
        loads=(Gravity((0.0, -9.81, 0.0)),),
        contact=(Barrier(), Friction(0.3)),
        dt=0.01,
        steps=steps,
    )


if __name__ == "__main__":
    pdvol.main(scene)
"""
NEAR = 0.03  # of the bunny's diagonal: how far apart the levels' centres may be
TIMES = 2  # steps of level 0 between two events of the mouse, so that a slow machine sees the same hand
SEEN = """(what) => {
  const box = stage.getBoundingClientRect(), found = [];
  for (let x = box.left + 4; x < box.right; x += 8) for (let y = box.top + 4; y < box.bottom; y += 8) {
    const held = live.hand.pick({ clientX: x, clientY: y });
    if (held && (held.body || held.obstacle) === what) found.push([x, y]);
  }
  const middle = [0, 1].map((k) => found.reduce((sum, at) => sum + at[k], 0) / found.length);
  const away = (at) => Math.hypot(at[0] - middle[0], at[1] - middle[1]);
  return found.sort((a, b) => away(a) - away(b))[0];
}"""
"""The pixel nearest to the middle of what a hand can hold of a thing."""


@pytest.fixture
def live(tmp_path):
    made = Live(tmp_path, STAIRS, "--levels", "0:2")
    yield made
    made.process.kill()
    made.process.wait()


def steps(tab):
    return tab.page.evaluate("live.status.states[0] - 1")


def wait_steps(tab, count):
    tab.until(f"live.status.states[0] - 1 >= {steps(tab) + count}")


def play(tab):
    """A take, from the step that is shown on."""
    before = tab.page.evaluate("live.run")
    tab.page.get_by_role("button", name="Play by hand").click()
    tab.until(f"live.run > {before} && live.status.playing && [...live.levels.values()].includes(live.shown)")


def drag(tab, what, *ways):
    """Press on a thing, drag it by some ways [pixels], each in some events, and let go."""
    x, y = tab.page.evaluate(SEEN, what)
    tab.page.mouse.move(x, y)
    tab.page.mouse.down()
    for dx, dy, count in ways:
        for _ in range(count):
            x, y = x + dx / count, y + dy / count
            tab.page.mouse.move(x, y)
            wait_steps(tab, TIMES)
    tab.page.mouse.up()


def end(tab):
    tab.page.get_by_role("button", name="End the take").click()
    tab.until("!live.status.playing")


def keep(tab, take, name):
    tab.page.get_by_role("button", name=take, exact=True).click()
    tab.until(f"live.status.takes.find((one) => one.number === live.run).name === {take!r}")
    tab.page.get_by_label("name").fill(name)
    tab.page.get_by_role("button", name="Keep this run").click()
    shows(tab, f"kept/{name}")


def centres(run):
    """(levels, steps, 3) of the body's centre of mass."""
    found = []
    for level in run.levels:
        masses = lumped_masses(level.mesh, np.ones(len(level.cells)))
        found.append([masses @ level.positions(step) / masses.sum() for step in range(level.steps)])
    return np.array(found)


def test_the_bunny_is_thrown_twice_kept_and_refined(tab, live):
    tab.page.set_viewport_size({"width": 820, "height": 520})
    tab.open(live.address)
    tab.until("window.live && live.shown")
    tab.page.evaluate("live.choose(0)")
    play(tab)
    drag(
        tab, "bunny", (0, -150, 15), (0, 0, 10), (220, 0, 24)
    )  # over the wall before it is let go, on slow machines too
    wait_steps(tab, 40)
    landed = steps(tab)
    drag(tab, "paddle", (-90, 0, 10))
    wait_steps(tab, 10)
    end(tab)
    first = steps(tab)
    tab.page.locator("#step").fill("10")
    tab.page.locator("#step").press("Enter")
    shows(tab, "step 10,")
    play(tab)
    drag(tab, "bunny", (0, -60, 8), (80, 20, 10))
    wait_steps(tab, 20)
    end(tab)
    second = steps(tab)
    keep(tab, "take 1", "over_the_wall")
    keep(tab, "take 2", "again")
    tab.page.locator("#takes p", has_text="again").get_by_role("button", name="Refine").click()
    tab.until("live.status.takes[1].words.includes('levels 0 to 2')", PATIENCE_OF_TESTS)
    shows(tab, "done")
    tab.page.get_by_label("coarse and fine").click()
    tab.until("live.view.shown.length === 2 && live.levels.get(2) === live.view.shown[1]")
    assert tab.complaints == []
    sheet = type(tab)(tab.page.context.browser.new_page()).open(f"{live.address}/takes")
    sheet.until("document.body.dataset.ready === 'yes'")
    assert sheet.page.evaluate("player.panes.map((pane) => pane.title)") == ["over_the_wall", "again"]
    assert sheet.complaints == []
    said, code = live.end()
    assert code == 0 and "kept runs are in" in said
    for name, length in (("over_the_wall", first), ("again", second)):
        kept = live.folder / "kept" / name
        take = open_run(kept)
        assert take.info["steps"] == length and pdvol("verify", kept) == 0
        replayed = live.folder / f"{name}_replayed"
        record = ("--hand", kept / "hand.jsonl", "--levels", "0:0", "--no-picture", "--no-xdmf")
        assert pdvol("run", live.folder / "fall.py", *record, "--out", replayed) == 0
        for step in range(length + 1):
            np.testing.assert_array_equal(
                open_run(replayed).levels[0].positions(step), take.levels[0].positions(step), err_msg=f"{name} {step}"
            )
    thrown = open_run(live.folder / "kept" / "over_the_wall").levels[0]
    assert thrown.positions(landed)[:, 0].min() > 0.7, "it is beyond the wall, before the paddle pushes it back"
    refined = open_run(live.folder / "kept" / "again")
    way = centres(refined)
    apart = np.linalg.norm(way - way[0], axis=2).max(axis=1)
    size = np.linalg.norm(np.ptp(refined.levels[0].rest, axis=0))
    assert len(way) == 3 and (apart < NEAR * size).all(), apart / size
