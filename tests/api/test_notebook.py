"""The demo notebook, executed by a kernel of this environment: it shows the progress of its runs, and pictures."""

import base64
import io
import sys
from pathlib import Path

import nbformat
import numpy as np
import pytest
import small
from nbclient import NotebookClient
from PIL import Image

import pdvol
from pdvol.runs.notebook_text import in_notebook

NOTEBOOK = Path(__file__).resolve().parents[2] / "demos" / "notebook.ipynb"


def texts(cell) -> str:
    """All text of a cell's outputs."""
    return "".join(
        output.get("text", "") + output.get("data", {}).get("text/plain", "") for output in cell.get("outputs", ())
    )


def pictures(cell) -> list[np.ndarray]:
    """The PNG pictures among a cell's outputs."""
    found = [output["data"]["image/png"] for output in cell.get("outputs", ()) if "image/png" in output.get("data", {})]
    return [np.asarray(Image.open(io.BytesIO(base64.b64decode(data)))) for data in found]


def executed(notebook, tmp_path, monkeypatch):
    """The notebook with its outputs, as a client saves them."""
    # The kernel that ipykernel installs beside this Python, whatever the user has registered; and no files at home.
    for name in ("JUPYTER_PATH", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR", "IPYTHONDIR", "JUPYTER_CONFIG_DIR"):
        monkeypatch.setenv(name, str(tmp_path / name.lower()))
    monkeypatch.setenv("JUPYTER_PATH", str(Path(sys.prefix) / "share" / "jupyter"))
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": tmp_path}}).execute()
    return notebook


def test_a_saved_notebook_keeps_the_last_state_of_progress(solid_run, tmp_path, monkeypatch):
    """A hundred updates of two bars, and stages that a thread of their own shows, leave one output of three lines.
    Another cell shows the player.
    """
    source = """
import time
from pdvol.runs import stage_lines
from pdvol.runs.notebook_text import progress_stream
from pdvol.runs.progress import Progress
from pdvol.stages import reported_to, stage
stage_lines.FIRST_SIGN, stage_lines._REWRITTEN_EVERY = 0.05, 0.02
stage_lines.SHOWN_SECONDS = 0.2
stream = progress_stream()
with reported_to(stage_lines.StageLines(stream)):
    with stage("meshing"):
        time.sleep(0.4)
    for level in range(2):
        bar = Progress(level, 100, stream=stream)
        for step in range(100):
            bar.step({"step": step + 1})
            time.sleep(0.003)
        bar.close()
"""
    play = f"import pdvol\nrun = pdvol.open_run({str(solid_run)!r})\nrun.play(width=700, height=480)"
    cells = [nbformat.v4.new_code_cell(text) for text in (source, play)]
    notebook = executed(nbformat.v4.new_notebook(cells=cells), tmp_path, monkeypatch)
    (output,), (player,) = (cell.outputs for cell in notebook.cells)
    assert player["data"]["text/plain"].startswith("PlayerFrame(700 x 480")
    shown = player["data"]["text/html"]
    assert shown.startswith('<iframe srcdoc="') and 'width="700" height="480"' in shown
    lines = output["data"]["text/plain"].splitlines()
    assert len(lines) == 3 and lines[0].startswith("meshing: 0.") and all("100/100" in line for line in lines[1:])


@pytest.mark.slow  # a whole demo
def test_the_notebook_shows_progress_and_pictures(tmp_path, monkeypatch):
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbformat.validate(notebook)
    cells = [cell for cell in executed(notebook, tmp_path, monkeypatch).cells if cell.cell_type == "code"]
    assert all(len(cell.outputs) <= 2 and texts(cell).count("\n") < 12 for cell in cells), "no line for each update"
    assert not any("Warning" in texts(cell) for cell in cells)
    drawn = [cell for cell in cells if pictures(cell)]
    assert ["level 1" in texts(cell) for cell in drawn] == [False, True]
    assert all("level 0" in texts(cell) and "12/12" in texts(cell) for cell in drawn)
    for picture in (picture for cell in drawn for picture in pictures(cell)):
        assert picture.ndim == 3 and len(np.unique(picture.reshape(-1, picture.shape[-1]), axis=0)) > 20
    assert "PlayerFrame(900 x 560" in texts(cells[-1])
    assert '<iframe srcdoc="' in cells[-1]["outputs"][0]["data"]["text/html"]


def test_the_stored_notebook_has_no_outputs():
    code = [cell for cell in nbformat.read(NOTEBOOK, as_version=4).cells if cell.cell_type == "code"]
    assert code and all(not cell.outputs and cell.execution_count is None for cell in code)


def test_a_picture_is_an_image_that_notebooks_show():
    run = pdvol.run(small.scene(), steps=2)
    picture = pdvol.picture(run, levels=[1], steps=[0, 2], width=200)
    assert picture._repr_png_().startswith(b"\x89PNG")
    pixels = np.asarray(picture)
    assert pixels.dtype == np.uint8 and pixels.shape[2] == 3 and pixels.shape[1] > 400
    assert not in_notebook()
