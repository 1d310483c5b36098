"""A type checker sees the public names with their types."""

import re

from mypy import api

SCRIPT = """\
import pdvol
from pdvol import Body, NeoHookean, Scene, meshes

body = Body((meshes.disc(0.1),), NeoHookean(1e5), name="ball")
scene = Scene((body,), dt=0.01, steps=3)
run = pdvol.run(scene, levels=0)
count: int = len(run.levels)
wrong: int = pdvol.run(scene)
Scene((body,), dt="fast", steps=3)
pdvol.simulate(scene)
"""


UNREAD = """\
[mypy]
[mypy-IPython.*,pyvista.*,trimesh.*,matplotlib.*,meshio.*,imageio.*,jinja2.*]
follow_imports = skip
"""
"""Libraries on which no public type depends: reading them takes most of the time."""


def test_a_typed_user_script(tmp_path):
    path = tmp_path / "shot.py"
    path.write_text(SCRIPT)
    (tmp_path / "mypy.ini").write_text(UNREAD)
    words = ["--strict", "--follow-imports=silent", "--cache-dir", str(tmp_path / "cache")]
    words += ["--config-file", str(tmp_path / "mypy.ini")]
    found, errors, _ = api.run([*words, str(path)])
    assert errors == ""
    lines = [(int(n), code) for n, code in re.findall(r"shot\.py:(\d+): error: .*\[([a-z-]+)\]", found)]
    assert lines == [(8, "assignment"), (9, "arg-type"), (10, "attr-defined")], found
