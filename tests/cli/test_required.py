"""A scene loads and builds only the terms that it uses. `pdvol info` lists these terms."""

import subprocess
import sys

import pytest
from mpi4py import MPI

import pdvol.levels.hierarchy as hierarchy_module
from commands import SAFETY
from pdvol import open_run
from pdvol.cli import run
from pdvol.levels.space import LevelSpace
from pdvol.potentials.build import build_terms
from pdvol.scene import Barrier, Flow, Friction, Gravity, Impulse, NeoHookean, Plane
from pdvol.studio.workers import Worker
from problems import make_model, make_scene
from shapes import box, together

SCENE = """
from pdvol import *
from pdvol import meshes

def scene(full=False, levels=1):
    steel = NeoHookean(2e10, density=7800.0)
    soft = StVenantKirchhoff(2e4, damping=0.01) if full else NeoHookean(2e4)
    disc = Body(meshes.disc(0.2), soft, (20, 40, 60)[:levels], name="disc",
                regions=(Region(steel, lambda X: X[:, 0] > 0.1),) if full else ())
    loads = (Force(lambda t: (t, 0.0)), Gravity((0.0, -9.81)), PointForce((1.0, 0.0), (0.0, 0.0)),
             Impulse((0.0, 3.0), 0.5), Flow((1.0, 0.0), 1.2))
    return Scene((disc,), dt=0.01, steps=2, loads=loads if full else (),
                 contact=(Barrier(), Friction(0.3)) if full else (),
                 obstacles=(Plane((0.0, -1.0), (0.0, 1.0)),) if full else (),
                 separate=(Separate("shrink", 0.1),) if full else ())
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "disc.py"
    path.write_text(SCENE)
    return path


def info(file, capsys, *words):
    assert run(["info", str(file), *words]) == 0
    return capsys.readouterr().out.splitlines()


def test_info_lists_what_is_modelled_and_what_is_not(file, capsys):
    lines = info(file, capsys, "--set", "full=True", "--set", "levels=2")
    for start in (
        "body 'disc': StVenantKirchhoff, young 20000 Pa, poisson 0.4, density 1000 kg/m^3, damping 0.01 s",
        "body 'disc', where ",
        "load: Gravity(acceleration=(0.0, -9.81))",
        "load: Force(force=<lambda>)",
        "load: PointForce(force=(1.0, 0.0), at=(0.0, 0.0))",
        "load: Impulse(velocity=(0.0, 3.0), time=0.5)",
        "load: Flow(velocity=(1.0, 0.0), density=1.2)",
        "obstacle: Plane(point=(0.0, -1.0), normal=(0.0, 1.0))",
        "dimension: 2, plane strain",
        "contact: area-weighted barrier",
        "friction: mu 0.3",
        "where bodies meet at t = 0: shrink by up to 0.1",
        "levels: 2",
    ):
        assert sum(line.startswith(start) for line in lines) == 1, start
    lines = info(file, capsys)
    assert {"contact: none", "friction: none", "levels: 1, no prolongation"} <= set(lines)
    assert not any(line.startswith(("load", "obstacle", "support", "where")) or "damping" in line for line in lines)


def test_all_of_it_runs(file, tmp_path):
    out = tmp_path / "run"
    assert run(["run", str(file), "--set", "full=True", "--set", "levels=2", "--out", str(out)]) == 0
    stored = open_run(out)
    assert stored.info["up"] == [0.0, 9.81], "pictures have up against gravity, whichever load it is"
    assert [level.steps for level in stored.levels] == [3, 3]
    assert all({"damping", "drag"} <= set(record["energy"]) for level in stored.levels for record in level.log)
    assert run(["metrics", str(out)]) == 0


def test_one_level_binds_nothing_and_meshes_nothing_else(file, tmp_path, monkeypatch):
    monkeypatch.setattr(hierarchy_module, "bind", lambda *_: pytest.fail("bound"))
    monkeypatch.setattr(hierarchy_module, "Prolongation", lambda *_: pytest.fail("prolonged"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert run(["preview", str(file), "--set", "levels=3", "--out", str(tmp_path / "run")]) == 0
    assert len(list((tmp_path / "cache" / "pdvol" / "meshes").glob("*.npz"))) == 1


def terms(*contact, loads=(), damping=0.0):
    mesh = together(box(2, 1), box(2, 1, low=[0.0, 1.01], high=[1.0, 2.01]))
    law = NeoHookean(1e5, damping=damping)
    scene = make_scene(
        (law, law), contact=contact, obstacles=(Plane((0.0, -0.01), (0.0, 1.0)),) if contact else (), loads=loads
    )
    return [term.name for term in build_terms(make_model(scene, mesh), LevelSpace(mesh, MPI.COMM_SELF)).potentials]


def test_each_term_is_there_because_it_is_asked_for():
    assert terms() == ["elastic"]
    assert terms(damping=0.1) == ["elastic", "damping"]
    down = Gravity((0.0, -9.81))
    assert terms(loads=(down, Impulse((1.0, 0.0)), Flow((1.0, 0.0)))) == ["elastic", "load", "load", "drag"]
    assert terms(Barrier(), Friction(0.3), loads=(down,)) == ["elastic", "load", "barrier", "friction"]


WITHOUT_CONTACT = """
import sys
import pdvol
from pdvol.cli import run
from pdvol.runs.scene_file import load_shot

assert len(list(pdvol.march(load_shot("disc.py").scene))) == 2
assert run(["check", "disc.py"]) == 0
assert run(["run", "disc.py", "--set", "levels=2", "-o", "out", "--no-picture"]) == 0
print(*sorted(name for name in sys.modules if name.startswith("pdvol.potentials.contact")))
"""


def test_without_contact_none_of_it_is_imported(file):
    ended = subprocess.run([sys.executable, "-c", WITHOUT_CONTACT], cwd=file.parent, capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.splitlines()[-1] == ""


def test_nor_in_a_process_that_carries_out_a_wedge(file, tmp_path, monkeypatch):
    listing = "import sys\ndef scene():\n    open('loaded', 'w').write(' '.join(sys.modules))\n"
    (tmp_path / "disc.py").write_text(listing)
    monkeypatch.chdir(tmp_path)
    worker = Worker()
    worker.start(["info", "disc.py"], tmp_path / "log")
    assert worker.answer(SAFETY) == (True, 2), "the function gives no scene"
    worker.stop()
    loaded = (tmp_path / "loaded").read_text().split()
    assert "pdvol.runs.runner" in loaded and not any("potentials.contact" in name for name in loaded)
