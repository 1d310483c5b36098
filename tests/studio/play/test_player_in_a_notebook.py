"""`run.play()` in an executed notebook, and what it shows opened in a browser."""

import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient

from browser import busy
from pdvol.store.reader import open_run


def test_a_cell_shows_the_player(solid_run, tmp_path, monkeypatch):
    for name in ("JUPYTER_PATH", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR", "IPYTHONDIR", "JUPYTER_CONFIG_DIR"):
        monkeypatch.setenv(name, str(tmp_path / name.lower()))
    monkeypatch.setenv("JUPYTER_PATH", str(Path(sys.prefix) / "share" / "jupyter"))
    source = f"import pdvol\nrun = pdvol.open_run({str(solid_run)!r})\nrun.play(width=700, height=480)"
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source)])
    NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    (output,) = notebook.cells[0].outputs
    assert output["data"]["text/plain"].startswith("PlayerFrame(700 x 480")
    shown = output["data"]["text/html"]
    assert shown.startswith('<iframe srcdoc="') and 'width="700" height="480"' in shown


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
