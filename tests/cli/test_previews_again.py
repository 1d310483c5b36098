"""`pdvol preview` again after an edit, with and without `--watch`; `-o` and what unknown words are answered."""

import signal
import subprocess
import sys
import time

import pytest

import pdvol as package
from cli_scenes import FALL, pdvol, states, write
from pdvol import open_run

STEPS = 3
SHORT = ("--steps", STEPS, "--no-picture", "--no-xdmf")


@pytest.fixture
def scene(tmp_path):
    write(tmp_path / "fall.py", FALL)
    return tmp_path / "fall.py"


def test_a_preview_replaces_the_one_before_it(scene, tmp_path):
    out, fresh = tmp_path / "p", tmp_path / "fresh"
    assert pdvol("preview", scene, *SHORT, "-o", out) == 0
    (out / "notes.txt").write_text("mine")
    before = states(out, 0)
    assert pdvol("preview", scene, *SHORT, "-o", out, "--set", "young=-1") == 2
    assert states(out, 0) == before
    write(scene, FALL.replace("height=0.02", "height=0.01").replace("(2, 4)", "(3, 4)"))
    for folder in (out, fresh):
        assert pdvol("preview", scene, *SHORT, "-o", folder) == 0
    assert states(out, 0) == states(fresh, 0) != before
    assert len(open_run(out).levels[0].log) == STEPS and (out / "notes.txt").read_text() == "mine"


def test_watching_previews_at_each_save(scene, tmp_path):
    """A broken scene is a line, and the next save is previewed again; a module beside the scene counts, too."""
    out = tmp_path / "p"
    write(tmp_path / "high.py", "HEIGHT = 0.02")
    write(scene, FALL.replace("height=0.02", "height=high.HEIGHT").replace("import pdvol\n", "import pdvol, high\n", 1))
    words = [sys.executable, "-m", "pdvol", "preview", scene, *map(str, SHORT), "-o", out, "--watch"]
    interrupted = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)  # jobs in the background ignore it
    process = subprocess.Popen(
        words, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, preexec_fn=interrupted
    )
    try:
        until(process, "stop with Ctrl-C")
        first = states(out, 0)
        write(tmp_path / "high.py", "HEIGHT =")
        lines = until(process, "stop with Ctrl-C")
        assert any("could not be read" in line for line in lines), lines
        assert states(out, 0) == first
        write(tmp_path / "high.py", "HEIGHT = 0.01")
        until(process, "stop with Ctrl-C")
        assert states(out, 0) != first
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=60) == 0
    finally:
        process.kill()
        process.stderr.close()


def until(process, word):
    """The lines on standard error up to one that has a word."""
    lines, end = [], time.monotonic() + 120.0
    while not (lines and word in lines[-1]):
        lines.append(process.stderr.readline())
        assert lines[-1] and time.monotonic() < end, lines
    return lines


def test_the_version(capsys):
    assert pdvol("--version") == 0
    assert capsys.readouterr().out == f"pdvol {package.__version__}\n"
