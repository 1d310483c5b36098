"""Markdown pages: their blocks of code, and the lines that these print."""

import importlib
import math
import re
from dataclasses import dataclass
from pathlib import Path

BLOCK = re.compile(r"^```(?P<language>\w*)[^\n]*\n(?P<code>.*?)^```", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"# (?P<name>\w+\.py)\n")  # the first line of a block that is a file
NUMBER = re.compile(r"(\d+(?:\.\d+)?(?:e[+-]\d+)?)")
PICTURE = re.compile(r"!\[[^\]]*\]\((?P<shown>[^)]+)\)\n<!-- made by: (?P<made>.+?) -->")


@dataclass(frozen=True)
class Block:
    """A fenced block: its language (`bash` or `console` for commands), text, and line in the page."""

    language: str
    code: str
    line: int

    @property
    def file(self) -> str:
        """The name of the file that the block is; empty where it is none."""
        found = FILE.match(self.code)
        return found["name"] if found and self.language == "python" else ""

    @property
    def commands(self) -> list[str]:
        """Command lines of a block `bash` or `console`, without `./run`, `$` and comments."""
        if self.language not in ("bash", "console"):
            return []
        lines = self.code.replace("\\\n", " ").splitlines()
        lines = [re.sub(r"^(\$ )?(\./run )?", "", re.sub(r" +# .*", "", line)) for line in lines]
        return [re.sub(r" +", " ", line).strip() for line in lines]


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


def unprinted(block: Block, output: str) -> list[str]:
    """Lines of a block that are none of the output's, with numbers within a twentieth; `...` stands for anything."""
    return [line for line in block.code.splitlines() if not any(alike(line, found) for found in output.splitlines())]


def alike(line: str, found: str) -> bool:
    """Whether a line of a page is one that was printed."""
    parts = NUMBER.split(line)
    texts = [".*".join(map(re.escape, text.split("..."))) for text in parts[::2]]
    match = re.fullmatch(NUMBER.pattern.join(texts), found)
    pairs = zip(parts[1::2], match.groups(), strict=True) if match else ()
    return bool(match) and all(math.isclose(float(a), float(b), rel_tol=0.05) for a, b in pairs)
