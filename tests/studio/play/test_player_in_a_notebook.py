"""The frame of `run.play()`, opened in a browser."""

from browser import busy
from pdvol.store.reader import open_run


def test_the_frame_plays(solid_run, tab, tmp_path):
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
