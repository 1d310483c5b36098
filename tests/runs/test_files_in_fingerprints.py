"""A scene's fingerprint has the contents of all files that a shape is read from."""

import pytest

from pdvol.errors import InputError
from pdvol.runs.fingerprint import describe, differences
from pdvol.runs.scene_file import Shot, kept_value, load_shot, stored_shot
from pdvol.store.files import jsonable

MESH = """#usda 1.0
(defaultPrim = "mesh")
def Mesh "mesh"
{{
    point3f[] points = [(0, 0, 0), ({}, 0, 0), (0, 1, 0), (0, 0, 1)]
    int[] faceVertexCounts = [3, 3, 3, 3]
    int[] faceVertexIndices = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]
}}
"""
SCENE = """#usda 1.0
def "one" (references = @./parts/one.usda@) {}
def "other" (payload = @./parts/other.usda@) {}
"""
NAMED = {
    "scene.usda": (SCENE, "parts/other.usda", MESH.format(1), MESH.format(2)),
    "level.xdmf": ("<Xdmf><DataItem>level.h5:/cells 1.5 2.e5</DataItem></Xdmf>", "level.h5", "1", "2"),
    "steps.pvd": ('<DataSet file="pieces.pvtu"/>', "piece.vtu", "<VTKFile/>", "<VTKFile />"),
    "parts.vtm": ('<DataSet file="parts/a.vtu"/>', "parts/a.vtu", "<VTKFile/>", "<VTKFile />"),
    "mesh.node": ("1", "mesh.ele", "1", "2"),
}


@pytest.mark.parametrize("name", NAMED)
def test_files_that_a_file_names_count(tmp_path, name):
    if name.endswith("usda"):
        pytest.importorskip("pxr")
    text, other, before, after = NAMED[name]
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "one.usda").write_text(MESH.format(1))
    (tmp_path / "pieces.pvtu").write_text('<Piece Source="piece.vtu"/><Piece Source="pieces.pvtu"/>')
    (tmp_path / name).write_text(text)
    (tmp_path / other).write_text(before)
    first = describe(str(tmp_path / name))
    assert describe(tmp_path / name) == first
    (tmp_path / other).write_text(after)
    assert differences(first, describe(tmp_path / name)) == [f"scene: the contents of {name} have changed"]


def test_numbers_without_an_end_come_back(tmp_path):
    """As `run.json` keeps them, so that a run is resumed with its settings."""
    file = tmp_path / "scene.py"
    file.write_text(
        "from pdvol import *\n\ndef scene(release=1.0, pair=(1.0, 2.0)):\n    assert max(pair) > 1e308\n"
        "    support = Support(lambda X: X[:, 0] < 0.1, release=release)\n"
        "    return Scene((Body(meshes.disc(1.0), NeoHookean(1e4), (40,)),), 0.01, 1, supports=(support,))\n"
    )
    shot = load_shot(file, {"release": float("inf"), "pair": (1.0, float("inf"))})
    info = {"scene_file": str(file), "steps": 1, "parameters": jsonable(kept_value(shot.parameters))}
    again = stored_shot(info)
    assert again.scene.supports[0].release == float("inf") and again.parameters["pair"] == [1.0, float("inf")]
    assert isinstance(again, Shot) and differences(shot.description(), again.description()) == []
    with pytest.raises(InputError):
        stored_shot({**info, "parameters": {"release": {"number": "1", "more": 2}}})
