"""The whole way by mouse: the README's bunny is picked up, thrown over a wall onto stairs, met by a paddle, thrown
again from an earlier step, kept and refined.
"""

import numpy as np

from cli_scenes import pdvol
from live_page import PATIENCE_OF_TESTS, Live, shows
from pdvol.geometry.level_mesh import lumped_masses
from pdvol.store.reader import open_run

STAIRS = """
import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Rigid, Scene, meshes


def scene(young=2e5, steps=20):
    bunny = Body(meshes.bunny(0.8), NeoHookean(young), vertices=(150, 300), name="bunny",
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
        dt=0.02,
        steps=steps,
    )
"""
NEAR = 0.03  # of the bunny's diagonal: how far apart the levels' centres may be
TIMES = 2  # steps of level 0 between two events of the mouse, so that a slow machine sees the same hand
SEEN = """(what) => {
  const box = stage.getBoundingClientRect(), found = [];
  for (let x = box.left + 4; x < box.right; x += 12) for (let y = box.top + 4; y < box.bottom; y += 12) {
    const held = live.hand.pick({ clientX: x, clientY: y });
    if (held && (held.body || held.obstacle) === what) found.push([x, y]);
  }
  const middle = [0, 1].map((k) => found.reduce((sum, at) => sum + at[k], 0) / found.length);
  const away = (at) => Math.hypot(at[0] - middle[0], at[1] - middle[1]);
  return found.sort((a, b) => away(a) - away(b))[0];
}"""
"""The pixel nearest to the middle of what a hand can hold of a thing."""


def press(tab, button):
    tab.page.get_by_role("button", name=button, exact=True).click()


def wait_steps(tab, count):
    tab.until(f"live.status.states[0] - 1 >= {tab.page.evaluate('live.status.states[0] - 1') + count}")
    return tab.page.evaluate("live.status.states[0] - 1")


def play(tab, *drags):
    """A take from the step that is shown on, and its steps after each drag.

    A drag has a thing, ways [pixels] each in some events, and the steps to wait after it has let go.
    """
    before, ends = tab.page.evaluate("live.run"), []
    press(tab, "Play by hand")
    tab.until(f"live.run > {before} && live.status.playing && [...live.levels.values()].includes(live.shown)")
    for what, ways, after in drags:
        x, y = tab.page.evaluate(SEEN, what)
        tab.page.mouse.move(x, y)
        tab.page.mouse.down()
        for dx, dy, count in ways:
            for _ in range(count):
                x, y = x + dx / count, y + dy / count
                tab.page.mouse.move(x, y)
                wait_steps(tab, TIMES)
        tab.page.mouse.up()
        ends.append(wait_steps(tab, after))
    press(tab, "End the take")
    tab.until("!live.status.playing")
    tab.page.evaluate("live.choose(0)")  # or the page shows the take again and again, in software
    return [*ends, tab.page.evaluate("live.status.states[0] - 1")]


def test_the_bunny_is_thrown_twice_kept_and_refined(tab, tmp_path):
    live = Live(tmp_path, STAIRS, "--levels", "0:1")
    try:
        tab.page.set_viewport_size({"width": 480, "height": 340})
        tab.open(live.address)
        tab.until("window.live && live.shown")
        tab.page.evaluate("live.choose(0)")
        over = ((0, -150, 8), (0, 0, 5), (220, 0, 12))  # over the wall before it is let go, on slow machines too
        landed, _, first = play(tab, ("bunny", over, 20), ("paddle", ((-90, 0, 5),), 5))
        tab.page.locator("#step").fill("5")
        tab.page.locator("#step").press("Enter")
        shows(tab, "step 5,")
        *_, second = play(tab, ("bunny", ((0, -60, 4), (80, 20, 5)), 10))
        for take, name in (("take 1", "over_the_wall"), ("take 2", "again")):
            press(tab, take)
            tab.until(f"live.status.takes.find((one) => one.number === live.run).name === {take!r}")
            tab.page.evaluate("live.choose(0)")
            tab.page.get_by_label("name").fill(name)
            press(tab, "Keep this run")
            shows(tab, f"kept/{name}")
        tab.page.locator("#takes p", has_text="again").get_by_role("button", name="Refine").click()
        tab.until("live.status.takes[1].words.includes('levels 0 to 1')", PATIENCE_OF_TESTS)
        shows(tab, "done")
        tab.page.get_by_label("coarse and fine").click()
        tab.until("live.view.shown.length === 2 && live.levels.get(1) === live.view.shown[1]")
        sheet = type(tab)(tab.page.context.browser.new_page()).open(f"{live.address}/takes")
        sheet.until("document.body.dataset.ready === 'yes'")
        assert sheet.page.evaluate("player.panes.map((pane) => pane.title)") == ["over_the_wall", "again"]
        assert tab.complaints == [] == sheet.complaints
        said, code = live.end()
        assert code == 0 and "kept runs are in" in said
    finally:
        live.process.kill()
        live.process.wait()
    kept = [tmp_path / "kept" / name for name in ("over_the_wall", "again")]
    for path, length in zip(kept, (first, second), strict=True):
        assert open_run(path).info["steps"] == length and pdvol("verify", path) == 0
        words = ("--hand", path / "hand.jsonl", "--levels", "0:0", "--no-picture", "--no-xdmf", "--out", path / "again")
        assert pdvol("run", tmp_path / "fall.py", *words) == 0
        one, other = (open_run(out).levels[0] for out in (path, path / "again"))
        for step in range(length + 1):
            np.testing.assert_array_equal(one.positions(step), other.positions(step), err_msg=f"{path.name} {step}")
    thrown, refined = (open_run(path).levels for path in kept)
    assert thrown[0].positions(landed)[:, 0].min() > 0.7, "it is beyond the wall, before the paddle pushes it back"
    masses = [lumped_masses(level.mesh, np.ones(len(level.cells))) for level in refined]
    ways = [
        np.array([mass @ level.positions(step) / mass.sum() for step in range(second + 1)])
        for mass, level in zip(masses, refined, strict=True)
    ]
    size = np.linalg.norm(np.ptp(refined[0].rest, axis=0))
    assert len(ways) == 2 and np.linalg.norm(ways[1] - ways[0], axis=1).max() < NEAR * size
