"""Which commit each page of the gallery is of, and which of its numbers are older than the solver."""

import ast
import re
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path

from benchmarks.common.commits import MissingObject, Repository
from benchmarks.common.tables import table
from demos.gallery.entries import DEMOS, Entry
from demos.gallery.shots import read_costs

FOLDERS = ("geometry", "integrate", "levels", "measure", "meshing", "potentials", "runs", "scene", "solve", "store")
FILES = ("compat.py", "compiled.py", "registry.py")
SOLVER = (*(f"pdvol/{name}" for name in (*FOLDERS, *FILES)), "forms")
"""What may change a number of a page: compiled.py has the compiler's options. Commands and the studio cannot."""
LAUNCHER = "launcher.py"
"""Of `pdvol/runs`, what cannot: a page's runs have one rank."""


class History:
    """What commits have at some paths.

    Raises
    ------
    MissingObject
        There is no repository, or the commit that is checked out is not in it.
    """

    def __init__(self, folder: Path):
        self._repository = Repository(folder)
        self.head = self._repository.head()
        self.parents = lru_cache(None)(self._repository.parents)
        self._root = lru_cache(None)(self._repository.tree)
        self._listed = lru_cache(None)(self._repository.listed)
        self._code = lru_cache(None)(self._read_code)
        self.parents(self.head)

    def entry(self, commit: str, path: str) -> str:
        """The id of what a commit has at a path; empty where it has nothing."""
        name = self._root(commit)
        for part in path.split("/"):
            name = self._listed(name).get(part, "")
            if not name:
                break
        return name

    def same(self, commit: str, path: str) -> bool:
        """Whether a commit has the same at a path as the one that is checked out, but for comments."""
        return self._alike(self._repository.full(commit), self.head, path)

    def _alike(self, first: str, second: str, path: str) -> bool:
        before, now = (self.entry(commit, path) for commit in (first, second))
        return before == now or bool(before and now) and self._code(before, path) == self._code(now, path)

    def _read_code(self, name: str, path: str) -> object:
        """What an object says without comments, to compare: a file's code, or that of each file of a folder."""
        kind, content = self._repository.read(name)
        if kind == "tree":
            return {file: self._code(inner, file) for file, inner in self._listed(name).items() if file != LAUNCHER}
        if path.endswith(".py"):
            return ast.dump(ast.parse(content))
        return re.sub(rb"/\*.*?\*/", b"", content, flags=re.DOTALL) if path.endswith((".c", ".h")) else name

    def last_change(self, paths: Sequence[str]) -> str:
        """The last commit that changed one of these paths by more than comments: a merge that only took over what one
        side has is none. The oldest one that is there, in a shallow clone.
        """
        commit = self.head
        while True:
            try:
                same = [p for p in self.parents(commit) if all(self._alike(p, commit, path) for path in paths)]
            except MissingObject:
                return commit
            if not same:
                return commit
            commit = same[0]


def table_of_ages(entries: Sequence[Entry], pages: Path, repository: Path = DEMOS.parent) -> str:
    """Markdown: a row a page.

    Raises
    ------
    MissingObject
        The folder is no git repository.
    """
    history = History(repository)
    rows = [
        _row(each, found, history)
        for entry in entries
        for each in (entry, *(entry.varied(variant) for variant in entry.variants))
        if (found := read_costs(pages / f"{entry.name}.md", each.name))["levels"]
    ]
    old = sum(row[-1] != "nothing" for row in rows)
    head = ["run", "made at", "direct run made at", "solver last changed at", "demo last changed at", "older"]
    return (
        f"{table(head, rows)}\n\nAt commit {history.head[:7]}: {len(rows) - old} of {len(rows)} runs have all their"
        f" numbers of this solver and demo; {old} have older ones."
    )


def _row(entry: Entry, found: Mapping, history: History) -> list[str]:
    demo = f"demos/{entry.file.name}"
    solver, own = (history.last_change(paths)[:7] for paths in (SOLVER, (demo,)))
    made, directly = found["commits"], found["direct_commits"] if entry.direct else ""
    ages = [_age(commits, (*SOLVER, demo), history) for commits in (made, directly)]
    if ages[0] == "current" and ages[1] in ("", "current"):
        older = "nothing"
    elif ages[0] == "current":
        older = f"the direct run ({ages[1]})"
    elif ages[1] == "current":
        older = f"all but the direct run ({ages[0]})"
    else:
        older = f"all numbers ({ages[0]})"
    return [entry.name, made or "unknown", directly or "-", solver, own, older]


def _age(commits: str, paths: Sequence[str], history: History) -> str:
    """`current`, or what differs from the commit that is checked out; empty where there is no run."""
    if not commits:
        return ""
    try:
        changed = [path for path in paths if not all(history.same(commit, path) for commit in commits.split(", "))]
    except MissingObject:
        return "its commit is not in this repository"
    return f"{', '.join(changed)} changed since" if changed else "current"
