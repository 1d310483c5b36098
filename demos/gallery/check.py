"""Which commit each page of the gallery is of, and which of its numbers are older than the solver."""

import ast
import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path

from benchmarks.common.commits import MissingObject, Repository
from benchmarks.common.tables import table
from demos.gallery.entries import DEMOS, Entry
from demos.gallery.shots import commits, read_costs

FOLDERS = ("geometry", "integrate", "levels", "measure", "meshing", "potentials", "runs", "scene", "solve", "store")
FILES = ("compat.py", "compiled.py", "registry.py")
SOLVER = (*(f"pdvol/{name}" for name in (*FOLDERS, *FILES)), "forms")
"""What may change a number of a page: compiled.py has the compiler's options. Commands and the studio cannot."""
LAUNCHER = "launcher.py"
"""Of `pdvol/runs`, what cannot: a page's runs have one rank."""


class History:
    """What commits have at some paths. Raises MissingObject outside of a repository."""

    def __init__(self, folder: Path):
        self._repository = Repository(folder)
        self.head = self._repository.head()
        self._root = lru_cache(None)(self._repository.tree)
        self._listed = lru_cache(None)(self._repository.listed)
        self._code = lru_cache(None)(self._read_code)
        self._root(self.head)

    def same(self, commit: str, path: str) -> bool:
        """Whether a commit has the same at a path as the one that is checked out, but for comments."""
        before, now = (self._entry(each, path) for each in (self._repository.full(commit), self.head))
        return before == now or bool(before and now) and self._code(before, path) == self._code(now, path)

    def _entry(self, commit: str, path: str) -> str:
        """The id of what a commit has at a path; empty where it has nothing."""
        name = self._root(commit)
        for part in path.split("/"):
            name = self._listed(name).get(part, "") if name else ""
        return name

    def _read_code(self, name: str, path: str) -> object:
        """What an object says without comments, to compare: a file's code, or that of each file of a folder."""
        kind, content = self._repository.read(name)
        if kind == "tree":
            return {file: self._code(inner, file) for file, inner in self._listed(name).items() if file != LAUNCHER}
        if path.endswith(".py"):
            return ast.dump(ast.parse(content))
        return re.sub(rb"/\*.*?\*/", b"", content, flags=re.DOTALL) if path.endswith((".c", ".h")) else name


def table_of_ages(entries: Sequence[Entry], pages: Path, repository: Path = DEMOS.parent) -> tuple[str, int]:
    """Markdown with a row a run, and how many runs have numbers that are older than the solver. Raises MissingObject
    where the folder is no git repository.
    """
    history = History(repository)
    found = [(each, read_costs(each, pages)) for entry in entries for each in entry.rows]
    rows = [_row(each, kept, history) for each, kept in found if kept]
    old = sum(row[-1] != "nothing" for row in rows)
    text = (
        f"{table(['run', 'made at', 'direct run made at', 'older'], rows)}\n\nAt commit {history.head[:7]}:"
        f" {len(rows) - old} of {len(rows)} runs have all their numbers of this solver and demo; {old} have older ones."
    )
    return text, old


def _row(entry: Entry, kept: Mapping, history: History) -> list[str]:
    paths = (*SOLVER, f"demos/{entry.file.name}")
    made, directly = commits(kept["made"]), commits(kept["made_directly"]) if entry.direct else ""
    older = [
        f"{name} ({age})"
        for name, at in (("the run", made), ("the direct run", directly))
        if at and (age := _age(at, paths, history))
    ]
    return [entry.name, made or "unknown", directly or "-", "; ".join(older) or "nothing"]


def _age(made: str, paths: Sequence[str], history: History) -> str:
    """What differs between some commits and the one that is checked out; empty where nothing does."""
    try:
        changed = [path for path in paths if not all(history.same(commit, path) for commit in made.split(", "))]
    except MissingObject:
        return "its commit is not in this repository"
    return f"{', '.join(changed)} changed since" if changed else ""
