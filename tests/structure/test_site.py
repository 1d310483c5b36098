"""The site that `./run docs` builds, and what its pages promise."""

import ast
import importlib
import inspect
import re
import runpy
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import pages
import pdvol

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
LISTED = pages.reference(ROOT)
MOST_WORDS = 2500  # of a page, generated ones included
CODE_OR_TAG = re.compile(r"<(pre|math|svg)\b.*?</\1>|<[^>]*>", re.DOTALL)


def test_every_public_name_is_in_the_reference():
    shown = [pages.named(path) for path in LISTED]
    forms = [importlib.import_module(f"pdvol.forms.{f.stem}") for f in sorted((ROOT / "forms").glob("[a-z]*.py"))]
    public = {
        **{f"pdvol.{name}": getattr(pdvol, name) for name in pdvol.__all__},
        **{f"pdvol.meshes.{name}": getattr(pdvol.meshes, name) for name in pdvol.meshes.__all__},
        **{
            f"{m.__name__}.{n}": f
            for m in forms
            for n, f in vars(m).items()
            if getattr(f, "__module__", "") == m.__name__
        },
    }
    lacking = [n for n, thing in public.items() if not inspect.ismodule(thing) and not any(thing is s for s in shown)]
    assert lacking == []
    assert len(LISTED) == len(set(LISTED))


def parameters(thing: object) -> list[str]:
    """Names of a function's or a class's parameters; none of a protocol, for which Python shows any."""
    is_protocol = inspect.isclass(thing) and getattr(thing.__init__, "__module__", "") == "typing"
    return [] if is_protocol else list(inspect.signature(thing).parameters)


@pytest.mark.parametrize("path", LISTED)
def test_a_name_of_the_reference_documents_its_parameters(path):
    """Each parameter's name stands in the docstring, or in that of a class it derives from."""
    thing = pages.named(path)
    assert inspect.getdoc(thing), path
    if inspect.isclass(thing) and issubclass(thing, BaseException):
        return
    text = " ".join(c.__doc__ or "" for c in thing.__mro__) if inspect.isclass(thing) else inspect.getdoc(thing)
    lacking = [name for name in parameters(thing) if not re.search(rf"\b{re.escape(name)}\b", text)]
    assert lacking == [], f"{path}: {', '.join(lacking)} not in its docstring"
    if inspect.isclass(thing):
        methods = [
            n for n, m in vars(thing).items() if inspect.isfunction(m) and not n.startswith("_") and m.__name__ == n
        ]
        assert [n for n in methods if not inspect.getdoc(getattr(thing, n))] == []


@cache
def definitions(file: Path) -> set[str]:
    """Functions and classes of a file, and methods as `Class.method`."""
    tree = ast.parse(file.read_text())
    kinds = ast.FunctionDef | ast.ClassDef
    names = {node.name for node in tree.body if isinstance(node, kinds)}
    methods = {
        f"{c.name}.{m.name}" for c in tree.body if isinstance(c, ast.ClassDef) for m in c.body if isinstance(m, kinds)
    }
    return names | methods


def test_functions_that_pages_name_are_in_the_files_they_link():
    """A link `[`name`](../file.py)` promises that the file defines the name."""
    links = [
        (page.name, name, (page.parent / target).resolve())
        for page in sorted(DOCS.rglob("*.md"))
        for name, target in re.findall(r"\[`([\w.]+)`\]\(([^)]+\.py)\)", page.read_text())
    ]
    assert len(links) > 40
    assert [link for link in links if not link[2].exists() or link[1] not in definitions(link[2])] == []


def run_python(*words: object) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, *map(str, words)], capture_output=True, text=True, timeout=300, cwd=ROOT)


@pytest.mark.slow
def test_the_site_builds_without_a_warning_and_asks_for_nothing_outside(tmp_path):
    """Sphinx refuses dead links and anchors. Addresses of other machines are followed by a reader alone."""
    done = run_python(DOCS / "_site" / "build.py", tmp_path / "site")
    assert done.returncode == 0, done.stderr
    built = sorted((tmp_path / "site").rglob("*.html"))
    assert len(built) > len(list(DOCS.rglob("*.md")))
    fetched = re.compile(r"<(?:script|img|link|iframe|source)\b[^>]*\b(?:src|href)=\"(?:https?:)?//[^\"]*\"")
    assert [(p.name, hit) for p in built for hit in fetched.findall(p.read_text())] == []
    texts = {page.name: re.sub(CODE_OR_TAG, " ", page.read_text().partition("<article")[2]) for page in built}
    assert [name for name, text in texts.items() if len(re.findall(r"\S*\w\S*", text)) > MOST_WORDS] == []
    assert "<math" in (tmp_path / "site" / "method.html").read_text()
    assert (tmp_path / "site" / "source" / "pdvol" / "integrate" / "marches.py.html").exists()


def test_a_dead_link_stops_the_build_and_a_folder_that_is_no_site_stays(tmp_path):
    """A copy with one page, whose links lead to a page, an anchor and a file that do not exist."""
    docs = tmp_path / "docs"
    shutil.copytree(DOCS / "_site", docs / "_site")
    (docs / "index.md").write_text("# A\n\n[x](none.md) [y](#none) [z](../none.py)\n")
    done = run_python(docs / "_site" / "build.py", tmp_path / "site")
    assert done.returncode != 0
    assert all(word in done.stderr for word in ("none.md", "'none'", "none.py"))
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "mine.txt").write_text("kept")
    done = run_python(docs / "_site" / "build.py", tmp_path / "mine")
    assert done.returncode == 2 and "choose another folder" in done.stderr
    assert (tmp_path / "mine" / "mine.txt").read_text() == "kept"
    drawn = runpy.run_path(str(DOCS / "_site" / "house.py"))["drawn"]
    assert (DOCS / "pictures" / "house.svg").read_text() == drawn(), "the diagram is that of the rules"
