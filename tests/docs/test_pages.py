"""The code of README and docs runs: blocks of Python one after the other on each page, commands by the parser, and the
tutorial as a whole. Pages are run in an empty folder, with what their text takes for granted.
"""

import linecache
import re
import shlex
from importlib.util import module_from_spec, spec_from_file_location
from inspect import getsource
from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest
from mpi4py import MPI

import pages
import pdvol
from pdvol import Body, Gravity, NeoHookean, RenderMesh, Scene, Support, meshes
from pdvol.cli import parse

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"
PAGES = pages.all_pages(ROOT)
WITH_CODE = [page for page in PAGES if any(block.language == "python" for block in pages.blocks(page))]
TUTORIAL = ROOT / "docs" / "tutorial.md"
# What makes the tutorial short: the coarsest meshes and three throws, of which the second is the one that is picked.
SHORTER = {
    "(150, 450, 1300)": "(60, 150, 300)",
    "steps=75": "steps=25",
    "1.4:3:9": "2:2.4:3",
    "pick w 2": "pick w 1",
    "--fps 24": "--fps 4",
}
FEWER = {"-0.1:0.1:20": "-0.1:0.1:3", "pick w 17": "pick w 1", "--to 2": "--to 1", "--to 4": "--to 2"}
"""What makes README's loop short: three variations instead of twenty, and three levels instead of five."""
MOST_STEPS = 5  # of a page's scene
EIGHT, TWO = '"0.5:1:8"', '"0.5:1:2"'  # variations of the wedge of python.md, and how many are tried
# pages whose code is complete: nothing is imported for it
WHOLE = ("README.md", "cookbook.md", "python.md", "scenes.md")
SHOT = """
import pdvol
from pdvol import Body, Gravity, NeoHookean, Placement, Scene, meshes

def scene(height=0.5, offset=0.0):
    body = Body(meshes.disc(0.1), NeoHookean(1e5), (30, 60), name="ball", placement=Placement((offset, height)))
    return Scene((body,), loads=(Gravity((0, -9.81)),), dt=0.01, steps=3)
"""


def ids(page):
    return str(page.relative_to(ROOT))


def surface(path: str, shape, shift=(0.0, 0.0, 0.0)) -> None:
    """Write a shape as OBJ."""
    lines = [f"v {x} {y} {z}" for x, y, z in shape.vertices + np.array(shift)]
    lines += [f"f {a} {b} {c}" for a, b, c in shape.triangles + 1]
    Path(path).write_text("\n".join(lines) + "\n")


def given(page: Path) -> dict:
    """Files and names that a page's text has introduced before its code."""
    Path("demos").mkdir()
    Path("demos/ball_on_spike.py").write_text(SHOT)
    Path("shot.py").write_text(SHOT)
    names: dict = {}
    if page.name not in WHOLE:
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
    names["solve"] = lambda u, most=MOST_STEPS: None
    exec(dedent("\n".join(lines[2:end])), names)


@pytest.mark.parametrize("page", [page for page in WITH_CODE if page != TUTORIAL], ids=ids)
def test_python_on_pages_runs(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = given(page)
    assert (EIGHT in page.read_text()) == (page.name == "python.md")
    for block in pages.blocks(page):
        if block.language == "python":
            where = f"<{page.name}, line {block.line}>"
            linecache.cache[where] = (len(block.code), None, block.code.splitlines(keepends=True), where)
            exec(compile(block.code.replace(EIGHT, TWO), where, "exec"), names)
            if callable(names.get("scene")):
                shot = names.pop("scene")()
                assert pdvol.run(shot, levels=0, steps=min(shot.steps, MOST_STEPS)).levels[0].steps > 1


def test_commands_on_pages_are_parsed():
    """Each `pdvol ...` line has a command and options that are there, and each `./run pdvol ...` in a paragraph."""
    found = [(page, words) for page in PAGES for block in pages.blocks(page) for words in block.commands]
    inline = re.compile(r"`\./run pdvol ([^`\n]+)`")
    found += [(page, shlex.split(words)) for page in PAGES for words in inline.findall(page.read_text())]
    assert len(found) > 80
    for page, words in found:
        if "--help" in words or words[:1] == ["COMMAND"]:
            continue
        try:
            parse(words)
        except SystemExit:
            pytest.fail(f"{ids(page)}: pdvol {' '.join(words)}")


PROGRAMS = ("pdvol", "pytest", "python", "pip", "jupyter", "bash", "ruff", "mypy", "codespell", "env", "docs")


def test_run_lines_on_pages_name_what_is_there():
    """Each `./run ...` line begins with a program of the environment, and files of the repository exist."""
    for page in PAGES:
        for block in pages.blocks(page):
            for line in block.code.replace("\\\n", " ").splitlines():
                if not (found := re.search(r"\./run ([^#]*)", line)):
                    continue
                words = found[1].split()
                words = words[3:] if words[0] == "mpirun" else words
                assert words[0] in PROGRAMS, (page, line)
                for word in words:
                    assert not word.startswith(("demos/", "tests/", "benchmarks/")) or (ROOT / word).exists(), (
                        page,
                        line,
                    )
                if words[:2] == ["python", "-m"]:
                    assert program(words[2]), (page, line)


def program(module: str) -> bool:
    """Whether `python -m MODULE` has something to run."""
    path = ROOT / module.replace(".", "/")
    return (path / "__main__.py").exists() or path.with_suffix(".py").exists()


def test_every_study_is_listed():
    """docs/benchmarks.md has the command of each folder of benchmarks/ that has one."""
    listed = set(re.findall(r"`\./run python -m benchmarks\.(\w+)", (ROOT / "docs" / "benchmarks.md").read_text()))
    assert listed == {path.parent.name for path in (ROOT / "benchmarks").glob("*/__main__.py")}


@pytest.mark.slow
def test_the_tutorial_makes_what_it_shows(tmp_path, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    assert all(TUTORIAL.read_text().count(text) == 1 for text in SHORTER)
    pages.run_page(TUTORIAL, tmp_path, SHORTER)
    shown = pages.pictures(TUTORIAL)
    assert len(shown) >= 4
    for kept, made in shown:
        assert kept.stat().st_size > 10_000, kept
        assert (tmp_path / made).stat().st_size > 5_000, made
    assert (tmp_path / "bear.html").is_file() and list((tmp_path / "out").iterdir())
    assert [level.steps for level in pdvol.open_run(tmp_path / "runs" / "bear").levels] == [26, 26, 26]


@pytest.mark.slow
def test_the_loop_of_readme(tmp_path, monkeypatch):
    """The five commands in order, as they stand there but for fewer variations and levels. The chosen variation keeps
    its side of the spike on all levels.
    """
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    (loop,) = [block for block in pages.blocks(README) if len(block.commands) > 1]
    assert [words[0] for words in loop.commands] == ["preview", "wedge", "pick", "refine", "play"]
    assert all(loop.code.count(text) == 1 for text in FEWER)
    (tmp_path / "demos").symlink_to(ROOT / "demos")
    pages.run_block(loop, tmp_path, FEWER)
    previewed, chosen = (pdvol.open_run(tmp_path / "runs" / name) for name in ("ball_on_spike_preview", "chosen"))
    assert [level.steps for level in previewed.levels] == [chosen.levels[0].steps]
    assert [level.steps for level in chosen.levels] == [chosen.levels[0].steps] * 3
    ends = [level.positions(level.steps - 1)[:, 0].mean() for level in chosen.levels]
    assert min(np.abs(ends)) > 0.1 and np.ptp(ends) < 0.1, ends
    assert (tmp_path / "shot.html").stat().st_size > 100_000
