"""Code blocks of Markdown pages, run as a reader would run them. As a program it draws a page's pictures anew:

./run env PYTHONPATH=tests/helpers python tests/helpers/pages.py docs/tutorial.md
"""

import importlib
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

BLOCK = re.compile(r"^```(?P<language>\w*)[^\n]*\n(?P<code>.*?)^```", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"# (?P<name>\w+\.py)\n")  # the first line of a block that is a file
PICTURE = re.compile(r"!\[[^\]]*\]\((?P<shown>[^)]+)\)\n<!-- made by: (?P<made>.+?) -->")


@dataclass(frozen=True)
class Block:
    """A fenced block: its language ("" for commands), text, and line in the page."""

    language: str
    code: str
    line: int

    @property
    def file(self) -> str:
        """The name of the file that the block is; empty where it is none."""
        found = FILE.match(self.code)
        return found["name"] if found and self.language == "python" else ""

    @property
    def commands(self) -> list[list[str]]:
        """Words of each command line of pdvol, without `./run`."""
        if self.language not in ("", "console", "sh", "bash", "shell"):
            return []
        lines = [line.strip().removeprefix("$ ") for line in self.code.replace("\\\n", " ").splitlines()]
        words = [
            shlex.split(line, comments=True) for line in lines if re.match(r"(\./run )?(mpirun -n \d+ )?pdvol ", line)
        ]
        return [line[line.index("pdvol") + 1 :] for line in words]


def all_pages(root: Path) -> list[Path]:
    """README, CONTRIBUTING, CHANGELOG, docs and the studies' notes of the repository in `root`."""
    return [
        *(root / f"{name}.md" for name in ("README", "CONTRIBUTING", "CHANGELOG")),
        *sorted((root / "docs").rglob("*.md")),
        *sorted((root / "benchmarks").rglob("*.md")),
    ]


def reference(root: Path) -> list[str]:
    """Dotted names that the Python reference shows."""
    text = "\n".join(page.read_text() for page in sorted((root / "docs" / "api").glob("*.md")))
    return re.findall(r"^\.\. auto(?:class|function|exception):: (\S+)$", text, re.MULTILINE)


def named(path: str) -> object:
    """What a dotted name of the reference stands for."""
    module, name = path.rsplit(".", 1)
    return getattr(importlib.import_module(module), name)


def blocks(page: Path) -> list[Block]:
    """Of a page, in order."""
    text = page.read_text()
    return [Block(m["language"], m["code"], text.count("\n", 0, m.start()) + 2) for m in BLOCK.finditer(text)]


def pictures(page: Path) -> list[tuple[Path, str]]:
    """Each picture that a page's own commands make: where the page has it, and the file that they write."""
    return [(page.parent / m["shown"], m["made"]) for m in PICTURE.finditer(page.read_text())]


def run_block(block: Block, folder: Path, instead: dict[str, str] | None = None) -> None:
    """Write the file that a block is into `folder`, and run its commands there; `instead` replaces text before that.

    Raises
    ------
    subprocess.CalledProcessError
        A command failed.
    """
    code = block.code
    for old, new in (instead or {}).items():
        code = code.replace(old, new)
    if block.file:
        (folder / block.file).write_text(code)
    for words in Block(block.language, code, block.line).commands:
        subprocess.run([sys.executable, "-m", "pdvol", *words], cwd=folder, check=True)


def run_page(page: Path, folder: Path, instead: dict[str, str] | None = None) -> None:
    """Run all blocks of a page, as `run_block` does."""
    for block in blocks(page):
        run_block(block, folder, instead)


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    for name in sys.argv[1:]:
        with tempfile.TemporaryDirectory() as there:
            run_page(Path(name), Path(there))
            for shown, made in pictures(Path(name)):
                shown.parent.mkdir(parents=True, exist_ok=True)
                print(shutil.copyfile(Path(there) / made, shown))
