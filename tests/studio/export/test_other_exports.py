"""Forces and stresses in exports, by hand; exports that go on; names that would lead
elsewhere.
"""

import json
import runpy
import shutil
import sys
from pathlib import Path
from types import ModuleType

import h5py
import meshio
import numpy as np
import pytest

import shapes
from pdvol import Body, FixedCorotational, NeoHookean, Scene, StVenantKirchhoff, open_run
from pdvol.geometry.level_mesh import vertex_strain
from pdvol.runs.runner import run_scene
from pdvol.runs.scene_file import load_shot
from pdvol.runs.stored_fields import SceneFields
from pdvol.store.writer import RunWriter
from pdvol.studio.export.exports import export_run

YOUNG, POISSON, DENSITY, GRAVITY, DT = 2e5, 0.3, 1000.0, 9.81, 0.02


def fields_of(path, dim, states, law=NeoHookean):
    """The exported fields' source for made-up states of a unit block."""
    mesh = shapes.box(dim, 3)
    with RunWriter.create(path, {"dt": DT, "steps": len(states) - 1, "diagonal": 1.0}, [mesh], ["block"]) as writer:
        for step, state in enumerate(states):
            writer.write_state(0, step, state(mesh.points))
    made = Scene(bodies=(Body((shapes.solid(dim, 3),), law(YOUNG, POISSON, DENSITY)),), dt=DT, steps=len(states) - 1)
    return SceneFields(made, open_run(path), 0, [])


def principal(law, stretches):
    """First Piola-Kirchhoff stresses [Pa] along the axes of a stretched block, by hand."""
    mu, lmbda = YOUNG / (2 * (1 + POISSON)), YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    a, J, E = stretches, stretches.prod(), (stretches**2 - 1) / 2
    return {
        NeoHookean: mu * (a - 1 / a) + lmbda * np.log(J) / a,
        StVenantKirchhoff: a * (2 * mu * E + lmbda * E.sum()),
        FixedCorotational: 2 * mu * (a - 1) + lmbda * (J - 1) * J / a,
    }[law]


@pytest.mark.parametrize("law", [NeoHookean, StVenantKirchhoff, FixedCorotational])
@pytest.mark.parametrize("dim", [2, 3])
def test_von_mises_of_a_stretched_block(tmp_path, dim, law):
    """Cauchy stresses are P_i a_i / J; in 2D the one across the plane counts, where nothing stretches."""
    stretches = np.array([1.2, 0.9, 0.95 if dim == 3 else 1.0])
    s = principal(law, stretches) * stretches / stretches.prod()
    expected = np.sqrt(0.5 * ((s[0] - s[1]) ** 2 + (s[1] - s[2]) ** 2 + (s[2] - s[0]) ** 2))
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(dim, dim)))[0]
    turn[:, 0] *= np.linalg.det(turn)
    fields = fields_of(tmp_path / "run", dim, [lambda X: 1.001 * X, lambda X: (X * stretches[:dim]) @ turn.T], law)
    assert fields.von_mises(0).max() < (1e-9 if dim == 3 else 2e-3) * YOUNG
    np.testing.assert_allclose(fields.von_mises(1), expected, rtol=1e-9)


@pytest.fixture(scope="module")
def resting(tmp_path_factory):
    """A scene file and its run: a block that has come to rest on the floor."""
    folder = tmp_path_factory.mktemp("resting")
    (folder / "rest.py").write_text(f"""
import sys; sys.path.insert(0, {str(Path(shapes.__file__).parent)!r})
import shapes
from pdvol import *

def scene(steps=40, name="block"):
    place = Placement(translate=(0.0, 0.0, 9e-4))
    return Scene(bodies=(Body((shapes.solid(3, 2),), NeoHookean(2e5, 0.3, 1000.0), name=name, placement=place),),
                 loads=(Gravity((0.0, 0.0, -9.81)),), obstacles=(Plane((0, 0, 0.0), (0, 0, 1.0)),),
                 contact=(Barrier(1e-3), Friction(0.4)), dt=0.05, steps=steps)
""")
    run_scene(load_shot(folder / "rest.py"), folder / "run")
    return folder / "run"


def test_the_contact_force_is_the_weight_of_what_rests(resting):
    weight = DENSITY * 1.0 * GRAVITY
    with h5py.File(resting / "level_0.h5") as file:  # as the run itself left it
        force = file["steps/40/Node/contact_force"][:]
    rest = open_run(resting).levels[0].rest
    np.testing.assert_allclose(force.sum(axis=0), [0, 0, weight], atol=0.01 * weight)
    assert (force[rest[:, 2] > 0.01] == 0).all() and (force[rest[:, 2] < 0.01][:, 2] > 0).all()


def test_usd_has_forces_stresses_and_strains_on_request(resting, tmp_path):
    """Without the scene's file, strain alone, which needs none."""
    pytest.importorskip("pxr", reason="usd-core is an optional extra")
    from pxr import Usd, UsdGeom

    def primvars(out: Path, with_fields: bool) -> tuple[dict, list[str], Usd.Stage]:
        (file,), notes = export_run(out.parent / "run", "usd", out, with_fields=with_fields)
        stage = Usd.Stage.Open(str(file))
        (prim,) = stage.GetPrimAtPath("/run/bodies").GetChildren()
        return {p.GetPrimvarName(): p.GetAttr() for p in UsdGeom.PrimvarsAPI(prim).GetPrimvars()}, notes, stage

    own = {"rest", "normals", "displayColor", "displayOpacity"}
    shutil.copytree(resting, tmp_path / "run")
    found, notes, _stage = primvars(tmp_path / "without", False)
    assert set(found) == own and notes == []
    found, notes, _stage = primvars(tmp_path / "with", True)
    assert set(found) == {*own, "contact_force", "strain", "von_mises"} and notes == []
    codes = [pytest.approx(step * 0.05 * 24) for step in range(41)]
    level = open_run(resting).levels[0]
    used = np.unique(level.surface)
    for name in ("contact_force", "strain", "von_mises"):
        assert found[name].GetTimeSamples() == codes
    weight = DENSITY * 1.0 * GRAVITY
    np.testing.assert_allclose(np.sum(found["contact_force"].Get(48), axis=0), [0, 0, weight], atol=0.01 * weight)
    for step in (0, 3, 40):
        expected = vertex_strain(level.mesh, level.positions(step))[used]
        np.testing.assert_allclose(found["strain"].Get(step * 0.05 * 24), expected, rtol=1e-5, atol=1e-7)
    assert max(found["strain"].Get(48)) > 1e-3 > 1e-6 > max(found["strain"].Get(0)), "it has sunk under its weight"

    info = json.loads((tmp_path / "run" / "run.json").read_text())
    (tmp_path / "run" / "run.json").write_text(json.dumps({**info, "scene_file": "/nowhere.py"}))
    found, notes, _stage = primvars(tmp_path / "gone", True)
    assert set(found) == {*own, "strain"}
    assert notes == ["without contact forces and stresses: its scene file /nowhere.py is gone"]


def test_xdmf_holds_forces_and_stresses(resting, tmp_path):
    expected = [tmp_path / name for name in ("level_0.xdmf", "open_in_paraview.py")]
    assert export_run(resting, "xdmf", tmp_path) == (expected, [])
    with meshio.xdmf.TimeSeriesReader(expected[0]) as xdmf:
        xdmf.read_points_cells()
        _, points, cells = xdmf.read_data(40)
    assert set(points) == {"displacement", "velocity", "contact_force"}
    assert set(cells) == {"von_mises", "body", "region"}
    with h5py.File(resting / "level_0.h5") as file:  # as the run itself left them
        np.testing.assert_array_equal(points["contact_force"], file["steps/40/Node/contact_force"])
        np.testing.assert_array_equal(cells["von_mises"][0], file["steps/40/Cell/von_mises"])


def test_a_run_without_its_scene_is_exported_as_it_is(resting, tmp_path):
    copy = shutil.copytree(resting, tmp_path / "run")
    info = json.loads((copy / "run.json").read_text())
    (copy / "run.json").write_text(json.dumps({**info, "scene_file": "/nowhere.py"}))
    (file, _), (note,) = export_run(copy, "xdmf", tmp_path / "out")
    assert note == "without contact forces and stresses: its scene file /nowhere.py is gone"
    with meshio.xdmf.TimeSeriesReader(file) as reader:
        reader.read_points_cells()
        assert set(reader.read_data(3)[1]) == {"displacement", "velocity"}


class Asked(Exception):
    """ParaView was asked to draw."""


def test_the_script_for_paraview_finds_its_export_and_names_the_command_without_a_display(
    flat_run, tmp_path, monkeypatch
):
    """With modules that stand in for ParaView's own, whose window runs a script without `__file__`."""

    def draw(*_):
        raise Asked

    script = export_run(flat_run, "xdmf", tmp_path)[0][-1]
    head = script.read_text().partition("DIRECTION =")[0].replace("from paraview import simple", "")
    for known in ({"__file__": str(tmp_path / "moved" / script.name)}, {}):
        exec(compile(head, "head", "exec"), known)
        assert known["FOLDER"] == (tmp_path / "moved" if "__file__" in known else tmp_path)
    modules = {name: ModuleType(name) for name in ("paraview", "paraview.simple", "vtkmodules.vtkRenderingCore")}
    modules["paraview"].simple = modules["paraview.simple"]
    modules["paraview.simple"].GetActiveViewOrCreate = draw
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setattr(sys, "argv", [str(script), "a.png"])
    monkeypatch.delenv("DISPLAY", raising=False)
    for window, error in (("X", SystemExit), ("OS", Asked)):  # the second one draws without a display
        modules["vtkmodules.vtkRenderingCore"].vtkRenderWindow = type(f"vtk{window}OpenGLRenderWindow", (), {})
        with pytest.raises(error) as raised:
            runpy.run_path(str(script))
        said = f"no display; run it by: xvfb-run -a pvpython {script} a.png"
        assert error is Asked or said in str(raised.value)
    monkeypatch.setenv("DISPLAY", ":0")
    with pytest.raises(Asked):
        runpy.run_path(str(script))
