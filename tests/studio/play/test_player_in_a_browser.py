"""The player in a headless Chromium: it plays, scrubs, switches levels, wipes and colours, and asks for nothing."""

import json

import numpy as np
import pytest

import runs
from browser import Tab, busy, chromium, difference
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.meshes import brick
from pdvol.store.reader import open_run
from pdvol.studio.play.document import with_strain, write_player
from pdvol.studio.play.panes import panes_of_run, panes_of_wedge, thinned

CHANGED = 0.002  # share of the pixels: a small body that moves by its size is more
TITLES = 60  # pixels: the height of the titles, which a wipe has at other places
FRAME_BUDGET = 1 / 60  # s: a frame of 60 a second
CALM = 0.001  # share of the pixels that may differ between two pictures of one state: none, in software rendering


@pytest.fixture(scope="module")
def browser():
    """One browser for all pages of this file."""
    with chromium() as first:
        yield first.page.context.browser


@pytest.fixture
def tab(browser):
    page = browser.new_page(viewport={"width": 1000, "height": 700})
    yield Tab(page)
    page.close()


@pytest.fixture
def player(tab, tmp_path):
    """Opens panes in the tab, and checks at the end that the page complained of nothing and asked for nothing."""

    def opened(panes, **choices):
        tab.open(write_player(panes, tmp_path / "shot.html", "a title", **choices))
        tab.until("document.body.dataset.ready === 'yes'")
        return tab

    yield opened
    assert tab.complaints == []
    assert tab.requests == []


def seen(tab):
    """What the stage shows once its next frame is drawn."""
    tab.page.evaluate("player.redraw()")
    tab.page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return tab.picture("#stage")


def scrub(tab, step):
    tab.page.get_by_role("slider", name="time").fill(str(step))


@pytest.mark.parametrize("name", ["flat_run", "solid_run"])
def test_it_shows_scrubs_plays_and_pauses(name, player, request):
    run = open_run(request.getfixturevalue(name))
    tab = player(panes_of_run(run))
    start = seen(tab)
    half = start.shape[1] // 2
    for pane in (start[:, :half], start[:, half:]):
        assert busy(pane) > 0.05
    assert difference(start[:, :half], start[:, half : 2 * half]) > CHANGED  # two levels
    scrub(tab, run.levels[0].steps - 1)
    assert difference(start, seen(tab)) > 2 * CHANGED
    assert f"{(run.levels[0].steps - 1) * run.dt:.2f} s" in tab.page.locator("#clock").inner_text()
    scrub(tab, 0)
    assert difference(start, seen(tab)) < CALM
    tab.page.get_by_label("speed").select_option("0.1")
    tab.page.get_by_role("button", name="play").click()
    # States are interpolated: a frame shows a time between two of them. The frame of the pause may show a state itself.
    tab.until("player.time > 0.3 * player.duration && (player.time / player.dt) % 1 > 0.1")
    tab.page.get_by_role("button", name="pause").click()
    time = tab.page.evaluate("player.time")
    assert difference(start, seen(tab)) > CHANGED
    tab.page.wait_for_timeout(200)
    assert tab.page.evaluate("player.time") == time
    tab.page.get_by_label("loop").uncheck()
    tab.page.get_by_label("speed").select_option("4")
    tab.page.evaluate("document.activeElement.blur()")
    tab.page.keyboard.press(" ")
    tab.until("!player.playing")
    assert tab.page.evaluate("player.time === player.duration"), "it ends unless it loops"
    tab.page.evaluate("player.view.shown[0].body.goTo = player.view.shown[1].body.goTo = () => {}")  # bodies rest
    end = seen(tab)
    scrub(tab, 0)
    assert (difference(end, seen(tab)) > CHANGED) == (name == "solid_run"), "an obstacle moves there"


def test_a_thinned_shot_ends_where_the_whole_one_does(player, flat_run):
    run = open_run(flat_run)
    ends = []
    for every in (1, 4):
        tab = player(thinned(panes_of_run(run), every))
        tab.page.keyboard.press("End")
        ends.append(seen(tab))
        assert tab.page.evaluate("[player.time, Number(document.getElementById('scrubber').value)]") == [
            pytest.approx((run.levels[0].steps - 1) * run.dt),
            {1: 6, 4: 2}[every],
        ]
    tab.page.evaluate("document.getElementById('labels').hidden = true")
    ends[1] = seen(tab)
    tab.page.keyboard.press("ArrowLeft")
    assert tab.page.evaluate("player.time") == pytest.approx(4 * run.dt)
    assert difference(ends[1], seen(tab)) > CHANGED
    tab.page.evaluate(f"player.go({5 * run.dt})")
    tab.until("Math.abs(player.view.shown[0].body.uniforms.between.value - 0.5) < 1e-6")  # drawn in the next frame
    assert difference(ends[0][TITLES:], ends[1][TITLES:]) < 0.01


def test_levels_and_the_wipe(player, flat_run):
    tab = player(panes_of_run(open_run(flat_run)))
    scrub(tab, 3)
    beside = seen(tab)
    tab.page.get_by_role("button", name="One").click()
    coarse = seen(tab)
    tab.page.get_by_label("shown", exact=True).select_option(label="level 1")
    fine = seen(tab)
    assert min(difference(beside, coarse), difference(coarse, fine)) > CHANGED and busy(fine) > 0.05
    tab.page.get_by_role("button", name="Wipe").click()
    tab.page.get_by_label("shown", exact=True).select_option(label="level 0")
    tab.page.get_by_label("shown on the right").select_option(label="level 1")
    mixed, middle = seen(tab)[TITLES:], coarse.shape[1] // 2
    assert difference(mixed[:, : middle - 12], coarse[TITLES:, : middle - 12]) < CALM
    assert difference(mixed[:, middle + 12 :], fine[TITLES:, middle + 12 :]) < CALM
    wipe = tab.page.get_by_role("slider", name="wipe")
    wipe.focus()
    for _ in range(12):
        tab.page.keyboard.press("ArrowLeft")
    assert wipe.get_attribute("aria-valuenow") == "0"
    assert difference(seen(tab)[TITLES:, 30:], fine[TITLES:, 30:]) < CALM
    tab.page.evaluate("document.activeElement.blur()")
    tab.page.keyboard.press("Escape")
    assert difference(seen(tab), beside) < CALM


def test_colours_wireframe_and_camera(player, solid_run):
    panes = [with_strain(pane) for pane in panes_of_run(open_run(solid_run))]
    tab = player(panes)
    scrub(tab, 3)
    pictures = [seen(tab)]
    for label, choice in (("colour", "strain"), ("drawn as", "wireframe"), ("drawn as", "surface")):
        tab.page.get_by_label(label).select_option(choice)
        pictures.append(seen(tab))
        assert "strain" in tab.page.get_by_label("legend").inner_text()
    for direction in ("Front", "Side", "Top"):
        tab.page.get_by_role("button", name=direction, exact=True).click()
        pictures.append(seen(tab))
    box = tab.page.locator("#stage").bounding_box()
    tab.page.mouse.move(box["x"] + 200, box["y"] + 200)
    tab.page.mouse.down()
    tab.page.mouse.move(box["x"] + 320, box["y"] + 240, steps=4)
    tab.page.mouse.up()
    pictures.append(seen(tab))
    for i, one in enumerate(pictures):
        assert busy(one) > 0.03
        for other in pictures[:i]:
            assert difference(one, other) > CHANGED
    tab.page.get_by_label("colour").select_option("bodies")
    tab.page.get_by_label("drawn as").select_option("surface and edges")
    tab.page.get_by_role("button", name="Reset").click()
    assert difference(seen(tab), pictures[0]) < CALM


def coloured(picture):
    """Where the stage is blue, and where it is green, as the texture of `detailed_run` is above and below."""
    red, green, blue = np.moveaxis(picture.astype(int), 2, 0)
    return blue - np.maximum(red, green) > 60, green - np.maximum(red, blue) > 60


def test_render_meshes_with_their_textures(player, detailed_run):
    tab = player([with_strain(pane) for pane in panes_of_run(open_run(detailed_run))])
    tab.page.get_by_role("button", name="Front").click()
    first = seen(tab)
    blue, green = coloured(first)
    assert min(blue.mean(), green.mean()) > 0.01
    assert np.argwhere(blue)[:, 0].mean() < np.argwhere(green)[:, 0].mean() - 20  # the right way up
    scrub(tab, 5)
    moved = seen(tab)
    assert np.argwhere(coloured(moved)[0])[:, 0].mean() > np.argwhere(blue)[:, 0].mean() + 10
    scrub(tab, 0)
    bodies = tab.page.get_by_role("combobox", name="bodies", exact=True)
    bodies.select_option("simulated surfaces")
    simulated = seen(tab)
    assert max(found.mean() for found in coloured(simulated)) < 1e-4 and difference(first, simulated) > CHANGED
    bodies.select_option("render meshes")
    assert difference(seen(tab), first) < CALM
    tab.page.get_by_label("colour").select_option("strain")  # fields are those of the simulated surfaces
    assert bodies.is_disabled() and max(found.mean() for found in coloured(seen(tab))) < 1e-4
    tab.page.get_by_label("colour").select_option("bodies")
    assert bodies.is_enabled() and difference(seen(tab), first) < CALM
    drawn = tab.page.get_by_label("drawn as")
    drawn.select_option("wireframe")
    wires = seen(tab)
    assert difference(wires, first) > CHANGED and max(found.mean() for found in coloured(wires)) < 1e-4
    drawn.select_option("surface")
    assert difference(seen(tab), first) > CHANGED  # the other body's edges
    drawn.select_option("surface and edges")
    assert difference(seen(tab), first) < CALM


def test_keys_and_graphs(player, flat_run):
    tab = player(panes_of_run(open_run(flat_run)))
    state = lambda: tab.page.evaluate("Math.round(player.time / player.dt)")
    for key, wanted in (("ArrowRight", 1), ("ArrowRight", 2), ("End", 6), ("ArrowLeft", 5), ("Home", 0)):
        tab.page.keyboard.press(key)
        assert state() == wanted
    for key, layout in (("2", "one"), ("w", "wipe"), ("g", "grid")):
        tab.page.keyboard.press(key)
        assert tab.page.evaluate("player.view.layout") == layout
        if key == "w":
            assert tab.page.evaluate("[player.view.first, player.view.second]") == [1, 0], "not against itself"
    energy, drift = (tab.page.get_by_role("img", name=f"{graph} over time") for graph in ("energy", "drift"))
    assert energy.locator("polyline").count() == 2 and drift.locator("polyline").count() == 1
    box = energy.bounding_box()
    tab.page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 20)
    assert state() == 3
    head = tab.page.locator("#playhead").bounding_box()
    assert abs(head["x"] - box["x"] - 0.5 * box["width"]) < 2
    before = tab.picture("#graphs")
    tab.page.get_by_role("combobox", name="drift").select_option("of orientations")
    assert difference(before, tab.picture("#graphs")) > CHANGED
    height = tab.page.locator("#stage").bounding_box()["height"]
    tab.page.get_by_label("graphs").uncheck()
    assert tab.page.locator("#stage").bounding_box()["height"] > height + 50


def test_every_control_has_a_name_and_fits_a_narrow_window_too(player, solid_run):
    tab = player([with_strain(pane) for pane in panes_of_run(open_run(solid_run))])
    tab.page.get_by_role("button", name="Wipe").click()
    for width, height in ((1000, 700), (420, 800)):
        tab.page.set_viewport_size({"width": width, "height": height})
        seen(tab)
        controls = tab.page.locator("button:visible, select:visible, input:visible, [role=slider]:visible").all()
        assert len(controls) > 14
        for control in controls:
            box = control.bounding_box()
            assert 0 <= box["x"] and box["x"] + box["width"] <= width
            assert 0 <= box["y"] and box["y"] + box["height"] <= height
            name = control.evaluate("e => e.ariaLabel || e.innerText || (e.labels && e.labels[0].innerText)")
            assert name and name.strip()
        assert tab.page.evaluate("[document.body.scrollWidth, document.body.scrollHeight]") == [width, height]
    energy = tab.page.get_by_role("img", name="energy over time")
    assert energy.bounding_box()["width"] > 250 and energy.locator("polyline").count() == 2
    place = tab.page.locator("#playhead").bounding_box()["x"] - energy.bounding_box()["x"]
    assert 0 <= place < 10, "it moves with the graphs"
    assert tab.page.locator("#stage").bounding_box()["height"] > 300


def test_a_wedge_is_a_grid_of_labelled_tiles(player, tmp_path):
    for number in range(3):
        runs.stored_run(tmp_path / "wedge" / "runs" / f"v{number}", 2, (40 + 20 * number, 100), 3)
    variations = [
        {"number": n, "name": f"v{n}", "changes": {"spin": f"{n}"}, "state": "done", "scores": {"upright": 0.25 * n}}
        for n in range(3)
    ]
    variations[1] |= {"name": "v3", "state": "failed", "reason": "it <b>broke</b>"}
    variations.append({"name": "bare"})
    (tmp_path / "wedge" / "wedge.json").write_text(json.dumps({"format": 1, "variations": variations}))
    tab = player(panes_of_wedge(tmp_path / "wedge"))
    words = tab.page.locator("#labels").inner_text()
    for said in ("spin=2", "upright 0.5", "it <b>broke</b>", "spin=1", "bare"):
        assert said in words
    grid = seen(tab)
    box = tab.page.locator(".frame").nth(0).bounding_box()  # of the best one
    tab.page.mouse.dblclick(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    assert tab.page.evaluate("[player.view.layout, player.view.first]") == ["one", 0]
    assert difference(grid, seen(tab)) > CHANGED
    assert (
        "spin=2" in tab.page.locator("#labels").inner_text()
        and "spin=1" not in tab.page.locator("#labels").inner_text()
    )


def test_a_frame_of_ten_thousand_vertices_leaves_the_processor_idle(player, tmp_path):
    slab = brick((1.0, 1.0, 0.02), (71, 71, 1))
    cells = slab.cells.astype(np.int64)
    mesh = LevelMesh(slab.vertices, cells, *np.zeros((2, len(cells)), np.int32))
    info = {"scene": "slab", "dt": 0.02, "steps": 8, "method": "direct"}
    with runs.RunWriter.create(tmp_path / "slab", info, [mesh], ["slab"]) as writer:
        runs.write_obstacles(writer.path, runs.OBSTACLES[3])
        for step in range(9):
            writer.write_state(0, step, mesh.points + [0, 0, 0.1 + 0.03 * np.sin(6 * step)], None)
    run = open_run(tmp_path / "slab")
    assert len(np.unique(run.levels[0].surface)) > 10000
    tab = player(panes_of_run(run))
    # The processor's part of a frame: states are chosen and uploaded, calls are made. Pixels are the graphics card's
    # part: in software they take far longer, so the picture is made small and each frame is awaited outside the clock.
    seconds = tab.page.evaluate("""() => {
      const { view } = player, gl = view.renderer.getContext(), found = [];
      view.renderer.setSize(8, 8, false);
      for (let i = 0; i < 60; i++) {
        const start = performance.now();
        view.draw(i % 16 * player.dt / 2.3);
        found.push((performance.now() - start) / 1000);
        gl.finish();
      }
      return found.sort((a, b) => a - b)[30];
    }""")
    assert seconds < FRAME_BUDGET / 3


def test_the_frame_of_a_notebook_plays(solid_run, tab, tmp_path):
    frame = open_run(solid_run).play(700, 480, levels=[1])
    (tmp_path / "cell.html").write_text(f"<!DOCTYPE html><body style='margin:0'>{frame._repr_html_()}</body>")
    tab.open(tmp_path / "cell.html")
    inside = tab.page.frame_locator("iframe")
    inside.locator("body[data-ready]").wait_for()
    inside.get_by_role("slider", name="time").fill("3")
    inside.get_by_label("colour").select_option("strain")
    tab.page.wait_for_timeout(200)
    picture = tab.picture("iframe")
    assert picture.shape == (480, 700, 3) and busy(picture[60:300]) > 0.05
    assert tab.complaints == [] and tab.requests == []
