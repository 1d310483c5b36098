"""Python and commands of README, CONTRIBUTING and docs run, each page's in order in an empty folder, with what its text
takes for granted. A block `text` has lines that those before it print. Commands of most pages are slow tests.

./run pytest tests/docs -m "slow or not slow"               # all pages
PDVOL_DRAW=1 ./run pytest tests/docs -m slow -k tutorial    # keep the pictures that a page's commands make
"""

import json
import linecache
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from inspect import getsource
from itertools import pairwise
from pathlib import Path
from textwrap import dedent

import meshio
import numpy as np
import pytest
from mpi4py import MPI
from trimesh import Trimesh

import pages
import pdvol
from commands import PDVOL, SAFETY
from pdvol import Body, Gravity, NeoHookean, RenderMesh, Scene, Support, cli, meshes

ROOT = Path(__file__).resolve().parents[2]
PAGES = pages.all_pages(ROOT)
WITH_CODE = [page for page in PAGES if any(block.language == "python" for block in pages.blocks(page))]
STEPS = 5  # of a page's scene, at most
# pages whose code is complete: nothing is imported for it
COMPLETE = ("README.md", "cookbook.md", "python.md", "scenes.md")
SHOT = """
import pdvol
from pdvol import Body, Gravity, NeoHookean, Placement, Scene, meshes

def scene(height=0.5, offset=0.0):
    body = Body(meshes.disc(0.1), NeoHookean(1e5), (30, 60), name="ball", placement=Placement((offset, height)))
    return Scene((body,), loads=(Gravity((0, -9.81)),), dt=0.01, steps=3)
"""


def surface(path: str, shape, shift=(0.0, 0.0, 0.0), without: int = 0) -> None:
    """Write a shape to a file, without some of its triangles."""
    Trimesh(shape.vertices + shift, shape.triangles[without:]).export(path)


def given(page: Path) -> dict:
    """Files and names that a page's text has introduced before its code."""
    Path("demos").mkdir()
    Path("demos/ball_on_spike.py").write_text(SHOT)
    Path("shot.py").write_text(SHOT)
    names: dict = {}
    if page.name not in COMPLETE:
        names = {"np": np, "pdvol": pdvol, "meshes": meshes, **{name: getattr(pdvol, name) for name in pdvol.__all__}}
    soft = NeoHookean(1e5)
    shape = meshes.rectangle(0.4, 0.1)
    if page.name == "scenes.md":
        surface("bar.obj", meshes.box((1.0, 0.2, 0.2), (10, 2, 2)), (0.5, 0.0, 0.0))
    if page.name == "rig.md":
        ball = meshes.ball(0.1)
        times = np.linspace(0.0, 1.0, 5)
        points = ball.vertices + times[:, None, None] * np.array([0.0, 0.0, 0.5])
        cloth = Body(meshes.box((1.0, 1.0, 0.02)), soft, (300, 1000), name="cloth")
        names |= {"points": points, "times": times, "triangles": ball.triangles, "soft": soft, "cloth": cloth}
    if page.name == "actuation.md":
        held = Support(lambda X: X[:, 0] < -0.19)
        shot = Scene(
            (Body(shape, soft, (60, 200)),), supports=(held,), loads=(Gravity((0.0, -9.81)),), dt=0.01, steps=150
        )
        pdvol.run(shot, "runs/settled", levels=0)
        names |= {"shape": shape, "material": soft}
    if page.name == "render_meshes.md":
        donut = Body(meshes.donut(), soft, (60, 200), render=RenderMesh(meshes.donut_render()))
        pdvol.run(Scene((donut,), dt=0.01, steps=20), "runs/donuts", levels=1)
    if page.name == "own_energy.md":
        begin_own_energy(names)
    names["__name__"] = page.stem
    return names


def begin_own_energy(names: dict) -> None:
    """Add what demos/own_energy.py has before its loop, with two steps to go."""
    surface("bowl.obj", meshes.ball(0.1, 2))
    spec = spec_from_file_location("own_energy", ROOT / "demos" / "own_energy.py")
    demo = module_from_spec(spec)
    spec.loader.exec_module(demo)
    lines = getsource(demo.simulate).splitlines()
    end = next(i for i, line in enumerate(lines) if "# Implicit Euler" in line)
    names |= vars(demo) | {"comm": MPI.COMM_SELF, "steps": 2, "t0": 0.02, "t1": 0.03, "held": None}
    names["solve"] = lambda u, most=STEPS: None
    exec(dedent("\n".join(lines[2:end])), names)


@pytest.mark.parametrize("page", [page for page in WITH_CODE if page.name != "tutorial.md"], ids=lambda page: page.stem)
def test_python_on_pages_runs(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = given(page)
    for before, block in pairwise([None, *pages.blocks(page)]):
        if block.language == "text" and before.language == "python":
            assert pages.unprinted(block, capsys.readouterr().out) == []
        if block.language == "python":
            where = f"<{page.name}, line {block.line}>"
            linecache.cache[where] = (len(block.code), None, block.code.splitlines(keepends=True), where)
            exec(compile(block.code.replace('"0.5:1:8"', '"0.5:1:2"'), where, "exec"), names)
            if callable(names.get("scene")):
                shot = names.pop("scene")()
                assert pdvol.run(shot, levels=0, steps=min(shot.steps, STEPS)).levels[0].steps > 1


QUICK = ("README.md", "index.md", "install.md", "live.md", "polyfem.md")
"""The other pages' commands are slow tests."""
NOT_RUN = {
    "git clone": "needs the repository's address",
    "python3 -m venv|venv/bin": "fetches packages of 375 MB",
    "pip install": "would change the environment",
    "podman": "needs containers",
    "sbatch": "needs Slurm; tests/cli/test_slurm_script.py runs the script without it",
    "pvpython|xvfb-run|paraview": "needs ParaView; tests/studio/export/test_paraview.py runs the script",
    "jupyter lab": "serves until it is stopped; tests/api/test_notebook.py runs the notebook",
    "pytest|ruff|mypy|codespell": "tests and checks of the whole repository",
    "env PYTHONPATH=tests/helpers python tests/golden/golden.py": "stores the golden states anew",
    "pdvol (run SCENE.py --hand|(refine|play) runs/take_)": "needs a hand; tests/studio/live/test_takes.py has one",
    "pdvol (run demos/bunny_noodles.py|render runs/pile)": "takes 16 minutes",
    "pdvol run shot.py": "needs a scene of Blender; tests/blender/test_scenarios.py has one",
}
"""Pattern at the beginning of a command: why it does not run here."""
UNTIL_STOPPED = re.compile(r"pdvol (live|preview .*--watch)\b")
PROGRAMS = {"python": [sys.executable], "pdvol": PDVOL}
SHORTER = (
    (r"^pdvol (run|preview|wedge|study|live) \S+\.py", rf"\g<0> --set steps={STEPS}"),
    (r"^pdvol run \S+\.py(?!.*--(accuracy|time|method|levels)).*", r"\g<0> --levels 0:1"),
    (r"--levels 0:2", "--levels 0:1"),
    (r"--set levels=3", "--set levels=2"),
    (r"--frames \d+", f"--frames {STEPS}"),
    (r"(demos/drop|shot)\.py", r"\g<0> --set vertices=(60,150,300)"),
    (r"(--vary \S+:\S+):\d+", r"\1:2"),
    (r"pick (\w+) \d+", r"pick \1 1"),
    (r"--to [2-9]", "--to 1"),
    (r"--size \d+x\d+", "--size 320x180"),
    (r"--runs \d+", "--runs 2"),
    (r"--budget \d+", "--budget 0.5"),
)
"""Patterns in commands that take long, and what stands in their place."""
WHOLE = ("render_meshes.md", "tutorial.md")
"""Pages whose commands run as they stand, and whose output is that of all steps."""


def files_of_a_reader(folder: Path) -> None:
    """The repository's folders, a surface, a scan with a hole and a scene of PolyFEM."""
    for name in ("demos", "packaging"):
        (folder / name).symlink_to(ROOT / name)
    surface("cow.obj", meshes.ball(0.5, 2))
    surface("scan.ply", meshes.ball(0.5, 2), without=1)
    brick = meshes.brick((1.0, 1.0, 1.0), (1, 1, 1))
    meshio.Mesh(brick.vertices, {"tetra": brick.cells}).write("cube.msh", "gmsh22", binary=False)
    shot = {"geometry": [{"mesh": "cube.msh"}], "materials": {"type": "NeoHookean", "E": 1e6, "nu": 0.3, "rho": 500}}
    Path("shot.json").write_text(json.dumps(shot | {"time": {"dt": 0.01, "time_steps": STEPS}}))


def shortened(command: str) -> str:
    for pattern, text in SHORTER:
        command = re.sub(pattern, text, command)
    return command


def run(command: str) -> None:
    """Carry out a command line in the present folder: pdvol's in this process, others, and those that end by an
    interruption, in one of their own.
    """
    words = shlex.split(command)
    if UNTIL_STOPPED.match(command):
        heard = lambda: signal.signal(signal.SIGINT, signal.default_int_handler)  # jobs in the background ignore it
        process = subprocess.Popen([*PDVOL, *words[1:]], stderr=subprocess.PIPE, text=True, preexec_fn=heard)
        assert any("Ctrl-C" in line for line in process.stderr), command
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=SAFETY)
        assert process.returncode in (0, 130), command
    elif words[0] == "pdvol" and "--help" not in words:
        assert cli.run(words[1:]) == 0, command
    else:
        words = [part for word in words for part in PROGRAMS.get(word, [word])]
        subprocess.run(words, check=True, timeout=SAFETY)


def tried(block: pages.Block) -> list[str]:
    return [command for command in block.commands if not re.match("|".join(NOT_RUN), command)]


MARKS = [
    pytest.param(page, marks=() if page.name in QUICK else pytest.mark.slow, id=page.stem)
    for page in PAGES
    if any(tried(block) for block in pages.blocks(page))
]


@pytest.mark.parametrize("page", MARKS)
def test_commands_on_pages_run(page, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    files_of_a_reader(tmp_path)
    for before, block in pairwise([None, *pages.blocks(page)]):
        if block.file:
            Path(block.file).write_text(block.code)
        if block.language == "text":
            assert before.language == "python" or pages.unprinted(block, "".join(capfd.readouterr())) == []
        elif todo := tried(block):
            capfd.readouterr()
            for command in todo:
                run(command if page.name in WHOLE else shortened(command))
    for kept, made in pages.pictures(page):
        assert (tmp_path / made).stat().st_size > 5_000, made
        if "PDVOL_DRAW" in os.environ:
            shutil.copyfile(tmp_path / made, kept)


def test_commands_on_pages_are_known():
    """Programs of commands in blocks, words of each `pdvol ...` there and of each `./run pdvol ...` in a sentence."""
    blocks = [block for page in PAGES for block in pages.blocks(page)]
    there = [command for block in blocks for command in block.commands]
    assert len(there) > 90 and all(any(re.match(start, command) for command in there) for start in NOT_RUN)
    assert {command.split()[0] for block in blocks for command in tried(block)} == {"pdvol", "python", "mpirun"}
    there += [command for page in PAGES for command in re.findall(r"`\./run (pdvol [^`\n]+)`", page.read_text())]
    for command in there:
        if command.startswith("pdvol ") and "--help" not in command:
            cli.parse(shlex.split(command)[1:])
    others = "\n".join(block.code for block in blocks if block.language == "")
    assert re.findall(r"^(?:\$ )?(?:\./run|pdvol|pip|git) .*", others, re.MULTILINE) == [], "to be blocks `bash`"


def test_every_study_is_listed():
    """docs/benchmarks.md has the command of each folder of benchmarks/ that has one."""
    listed = set(re.findall(r"`\./run python -m benchmarks\.(\w+)", (ROOT / "docs" / "benchmarks.md").read_text()))
    assert listed == {path.parent.name for path in (ROOT / "benchmarks").glob("*/__main__.py")}
