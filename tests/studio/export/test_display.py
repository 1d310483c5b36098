"""The script for ParaView on a machine without a display, with modules that stand in for ParaView's own."""

import runpy
import sys
from types import ModuleType

import pytest

from pdvol.studio.export.exports import export_run


class Asked(Exception):
    """ParaView was asked to draw."""


def run_script(script, window: str, monkeypatch) -> None:
    def draw(*_):
        raise Asked

    modules = {name: ModuleType(name) for name in ("paraview", "paraview.simple", "vtkmodules.vtkRenderingCore")}
    modules["paraview"].simple = modules["paraview.simple"]
    modules["paraview.simple"].GetActiveViewOrCreate = draw
    modules["vtkmodules.vtkRenderingCore"].vtkRenderWindow = type(window, (), {})
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setattr(sys, "argv", [str(script), "a.png"])
    runpy.run_path(str(script))


def test_without_a_display_the_script_names_the_command(flat_run, tmp_path, monkeypatch):
    written, _ = export_run(flat_run, "xdmf", tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(SystemExit, match=f"no display; run it by: xvfb-run -a pvpython {written[-1]} a.png"):
        run_script(written[-1], "vtkXOpenGLRenderWindow", monkeypatch)
    with pytest.raises(Asked):  # it draws without one
        run_script(written[-1], "vtkOSOpenGLRenderWindow", monkeypatch)
    monkeypatch.setenv("DISPLAY", ":0")
    with pytest.raises(Asked):
        run_script(written[-1], "vtkXOpenGLRenderWindow", monkeypatch)
