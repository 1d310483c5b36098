"""What new users do in their first hour: each has a line that helps, at once, and costs nothing that was there."""

import re
import signal
import subprocess
import sys
import time
from argparse import Namespace
from contextlib import nullcontext

import pytest

from cli_scenes import CUBE, CUBE_OFF, pdvol, write
from commands import children
from pdvol import InputError, march
from pdvol.commands.options import chosen_shot
from pdvol.runs.scene_file import load_shot

LAW = """
from dataclasses import dataclass
from pdvol import *

@dataclass(frozen=True)
class Law(Material):
    @staticmethod
    def psi(F, mu, lmbda):
        return {sign}NeoHookean.psi(F, mu, lmbda)

def scene():
    square = Outline([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    down = Gravity((0.0, -9.5))
    return Scene((Body(square, Law(1e4), (12,), name="square"),), loads=(down,), dt=0.01, steps=2)
"""
HEAVY = "young = 1e+04 Pa cannot carry its weight, density * g * height = 9.5e+05 Pa; moduli are in Pa (1 MPa is 1e6)"
UNIT = (
    "lengths are metres: Placement(scale=0.001) of millimetres makes it 0.141 m, Placement(scale=0.01) of centimetres"
)


@pytest.fixture
def scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "cube.off", CUBE_OFF)
    return write(tmp_path / "scene.py", CUBE)


def test_steps_are_a_setting_and_another_time_step_says_what_the_shot_lasts(scene, capsys):
    write(hand := scene.parent / "hand", '{"step": 1, "pulls": [], "obstacles": {}}\n')
    for words, record, said in (
        (["dt=0.02", "steps=1"], None, ""),
        (
            ["dt=0.02"],
            None,
            "2 steps of 0.02 s: the shot lasts 0.04 s instead of 0.02 s; add --set steps=1 to keep that",
        ),
        (["dt=0.02"], hand, "1 steps of 0.02 s: the shot lasts 0.02 s instead of 0.01 s; a hand has a line for each"),
    ):
        shot = chosen_shot(Namespace(scene=scene, set=words, steps=None, hand=record))
        found = capsys.readouterr().err
        assert shot.scene.steps == 1 if said == found else found.startswith(f"note: {said}")


def test_too_few_vertices_are_refused_at_once_and_leave_an_earlier_preview(scene, tmp_path, capsys):
    words = ["preview", scene, "--no-xdmf", "--out", tmp_path / "run"]
    assert pdvol(*words) == 0
    before = (tmp_path / "run" / "picture.png").stat().st_mtime_ns
    capsys.readouterr()
    begin = time.monotonic()
    assert pdvol(*words, "--set", "vertices=(9,)") == 2
    said = capsys.readouterr().err
    assert said.endswith("9 vertices are too few for a solid; ask for 20 or more\n") and "picture" not in said
    assert (tmp_path / "run" / "picture.png").stat().st_mtime_ns == before
    assert time.monotonic() - begin < 10.0


def test_an_interrupt_ends_the_meshers(scene, tmp_path, own_meshes):
    words = ["--set", "vertices=(20000,)", "--out", str(tmp_path / "run")]
    command = [sys.executable, "-m", "pdvol", "preview", str(scene), *words]
    obey = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)  # what is in the background of a shell ignores it
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, preexec_fn=obey) as process:
        while not children(process.pid):
            time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        begin = time.monotonic()
        said = process.communicate()[1]
    assert process.returncode == 130 and "interrupted; finished steps are kept, go on with --resume\n" in said
    assert time.monotonic() - begin < 20.0 and not (tmp_path / "run").exists()


FIBRE = "mu * (F[0, 0] ** 2 + F[1, 0] ** 2 - 1) ** 2 + "


def test_a_law_that_has_no_minimum_or_fails_is_refused(tmp_path, capsys):
    for number, (sign, said) in enumerate(
        [
            ("", ""),
            ("2.0 * ", ""),
            (f"-0.1 * {FIBRE}", ""),  # falls in large stretches alone
            ("mu * (F[0, 0] - 1) ** 2 * (F[0, 0] - 2) ** 2 + ", ""),  # has a second minimum
            ("StVenantKirchhoff.psi(F, mu, lmbda) + 0.0 * ", ""),
            ("-", "Law.psi has no minimum near F = I: it keeps falling along ("),
            (f"-2.0 * {FIBRE}", "Law.psi has no minimum near F = I: it keeps falling along ("),
            ("(F[0, 0] - 1) ** 0.5 + ", "Law.psi, or its derivative by F, is NaN or infinite at or near F = I"),
            ("mu * nothing + ", "body 'square': Law.psi(F, mu, lmbda) failed: NameError: "),
        ]
    ):
        scene = write(tmp_path / f"law{number}.py", LAW.format(sign=sign))
        assert pdvol("check", scene) == 2 * bool(said)
        printed = capsys.readouterr().out
        assert f": {said}" in printed and "at rest" not in printed
        with pytest.raises(InputError, match=re.escape(said)) if said else nullcontext():
            list(march(load_shot(scene).scene))
    scene = write(tmp_path / "bound.py", LAW.format(sign="").replace("    @staticmethod\n", ""))
    assert pdvol("check", scene) == 2 and "Law.psi must be a @staticmethod" in capsys.readouterr().err


def test_a_stress_at_rest_and_an_unusual_size_are_noted(tmp_path, capsys):
    for more, size, said in (
        ("", 1, []),
        ("2e3 * F[0, 0] + ", 1, ["Law has a stress of 2e+03 Pa at rest, which sets it in motion"]),
        ("", 100, [f"141 m across; {UNIT} makes it 1.41 m", HEAVY]),
    ):
        scene = write(tmp_path / "law.py", LAW.format(sign=more).replace("1.0", f"{size}.0"))
        assert pdvol("check", scene, "--measure", 0) == 0
        notes = [line for line in capsys.readouterr().out.splitlines() if line.startswith("note")]
        assert notes == [f"note: body 'square': {line}" for line in said]


def test_a_pick_is_refined_after_an_edit_of_its_scene(scene, tmp_path):
    assert pdvol("wedge", scene, "--vary", "dt=0.01,0.02", "--no-picture", "-o", tmp_path / "w") == 0
    write(scene, CUBE + "# edited\n")
    assert pdvol("pick", tmp_path / "w", 1, "--refine", "--to", 0, "-o", tmp_path / "picked") == 0
