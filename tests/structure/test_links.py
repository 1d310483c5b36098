"""Links and file names of README, CONTRIBUTING, CHANGELOG and docs lead to something. Addresses of other machines are
asked by `./run docs --links`, which needs a net.
"""

import re
from functools import cache
from pathlib import Path

import pytest

import pages

ROOT = Path(__file__).resolve().parents[2]
PAGES = pages.all_pages(ROOT)
LINK = re.compile(r"!?\[(?:[^\]\[]|\[[^\]]*\])*\]\(<?([^)>\s]+)>?(?:\s\"[^\"]*\")?\)")
SOURCES = (".py", ".md", ".c", ".h", ".toml", ".cff", ".yml", ".npz")
"""Endings of what is kept in the repository, not made by a run."""
TOPS = ("pdvol", "forms", "meshes", "blender", "docs", "tests", "demos", "benchmarks", "joss", "packaging", ".ci")
SAVED = {"bunny.py", "beam.py"}
"""What a reader saves from README, for the table in docs/install.md."""
MADE = {"open_in_blender.py", "open_in_paraview.py", "render/", "textures/", "runs/"}
"""What pdvol writes, beside an export or into a run folder; a reader finds it there."""


def ids(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


@cache
def prose(page: Path) -> str:
    """A page without its fenced blocks."""
    return re.sub(r"^ *(```|~~~)[^\n]*\n.*?^ *\1\s*$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)


@cache
def anchors(page: Path) -> set[str]:
    """The anchors that code hosts and the site give to a page's headings."""
    heads = re.findall(r"^#+ (.+?)\s*$", prose(page), re.MULTILINE)
    bare = [re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", head).lower() for head in heads]
    return {re.sub(r"[^\w\- ]", "", head).replace(" ", "-") for head in bare}


def dead(page: Path, target: str) -> bool:
    """Whether a link of a page leads nowhere in the repository."""
    name, _, anchor = target.partition("#")
    file = (page.parent / name).resolve() if name else page
    if not file.exists() or not file.is_relative_to(ROOT):
        return True
    return bool(anchor) and file.suffix == ".md" and anchor not in anchors(file)


def links(page: Path) -> list[str]:
    """Targets of a page's links within the repository."""
    text = re.sub(r"`[^`\n]*`", "", prose(page).replace("[`", "[").replace("`]", "]"))
    return [target for target in LINK.findall(text) if not re.match(r"[a-z]+:", target)]


def test_links_and_names_are_found(tmp_path):
    page = ROOT / "docs" / "none.md"
    assert dead(page, "nothing.md") and dead(page, "index.md#nothing") and dead(page, "../../elsewhere")
    assert not dead(page, "index.md#where-to-read-on") and not dead(page, "../README.md")
    sample = tmp_path / "a.md"
    sample.write_text("[a](b.md) ![c](d.png) [`e`](f.py#g)\n```\n[h](i)\n```\n`[j](k)` [l](https://m)")
    assert links(sample) == ["b.md", "d.png", "f.py#g"]
    assert sum(len(links(page)) for page in PAGES) > 250 and sum(len(names(page)) for page in PAGES) > 200
    assert there("pdvol/errors.py") and there("runs/runner.py") and there("docs/gallery/") and there("demos/NAME.py")
    assert not there("unner.py") and not there("docs/none.md")
    source = "\n".join(path.read_text() for path in (ROOT / "pdvol").rglob("*.py"))
    assert all(name.strip("/") in source for name in MADE)


@cache
def kept() -> str:
    """All files and folders of the repository, a line each, folders with a stroke at their end."""
    found = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "CITATION.cff", "pyproject.toml")]
    for top in TOPS:
        found += [ROOT / top, *(path for path in (ROOT / top).rglob("*") if "__pycache__" not in path.parts)]
    return "\n".join("/" + ids(path) + "/" * path.is_dir() for path in found if path.exists()) + "\n"


def names(page: Path) -> list[str]:
    """Back-ticked names of files and folders of the repository; NAME, * and <...> stand for anything."""
    words = re.findall(r"`([\w./*<>-]+)`", prose(page))
    own = [w for w in words if w.partition("/")[0] in TOPS and "/" in w or w.endswith((*SOURCES, "/"))]
    written = {block.file for block in pages.blocks(page)}
    return [w for w in own if not w.startswith((".", "/", "<", "levels/<")) and w not in MADE | SAVED | written]


def there(name: str) -> bool:
    """Whether a name is the end of a path in the repository, cut at a stroke."""
    pattern = re.sub(r"NAME|\\\*|<.*?>", "[^/]*", re.escape(name))
    return re.search(rf"/{pattern}/?$", kept(), re.MULTILINE) is not None


@pytest.mark.parametrize("page", PAGES, ids=ids)
def test_links_anchors_and_files_that_a_page_names_exist(page):
    assert [target for target in links(page) if dead(page, target)] == []
    assert [name for name in names(page) if not there(name)] == []


@pytest.mark.parametrize(("page", "least"), [("architecture.md", 60), ("method.md", 20)])
def test_code_that_a_page_names_exists(page, least):
    spans = " ".join(re.findall(r"`([^`]+)`", prose(ROOT / "docs" / page)))
    words = set(re.findall(r"\b(?:[A-Z]\w*[a-z_]\w*|[A-Z][A-Z_]+|[a-z]\w*_\w+)\b", spans))
    files = [path for top in ("pdvol", "blender", "tests/structure") for path in (ROOT / top).rglob("*")]
    source = kept() + " ".join(path.read_text() for path in files if path.suffix in (".py", ".c", ".h", ".js"))
    assert len(words) > least and sorted(words - set(re.findall(r"\w+", source))) == []
