"""The files of a commit, from the repository's objects: `./run`'s environment has no git."""

import re
import weakref
from collections.abc import Iterator
from pathlib import Path

from dulwich.errors import NotGitRepository
from dulwich.object_store import iter_tree_contents
from dulwich.objects import Commit, ShaFile
from dulwich.repo import Repo

from benchmarks.common.process import Mistake


class MissingObject(Mistake):
    """An object is not in the repository."""


class Repository:
    """The objects of the repository whose work tree is `folder`; MissingObject where there is none."""

    def __init__(self, folder: Path):
        try:
            self._repo = Repo(str(folder))
        except NotGitRepository as error:
            raise MissingObject(f"{folder} is no git repository") from error
        weakref.finalize(self, self._repo.close)

    def head(self) -> str:
        """The commit that is checked out, in full; empty where its branch has none."""
        try:
            return self._repo.head().decode()
        except KeyError:
            return ""

    def full(self, start: str) -> str:
        """The one object whose id begins with `start` (four digits or more); MissingObject where it is not one."""
        if not re.fullmatch("[0-9a-f]{4,40}", start):
            raise MissingObject(f"{start!r} is no commit's id, or less than four digits of one")
        found = set(self._repo.object_store.iter_prefix(start.encode()))
        if len(found) != 1:
            raise MissingObject(f"{len(found)} objects begin with {start!r}; more digits, or a deeper clone, may help")
        return found.pop().decode()

    def files(self, commit: str) -> Iterator[tuple[str, bytes]]:
        """Paths and contents of a commit's files, without links and submodules; MissingObject where it is none."""
        found = self._object(commit)
        if not isinstance(found, Commit):
            raise MissingObject(f"{commit} is a {found.type_name.decode()}, not a commit")
        for entry in iter_tree_contents(self._repo.object_store, found.tree):
            if entry.mode & 0o170000 == 0o100000:
                yield entry.path.decode(), self._object(entry.sha.decode()).as_raw_string()

    def write(self, commit: str, folders: tuple[str, ...], to: Path) -> None:
        """Writes a commit's files below `folders` into a folder."""
        for path, content in self.files(commit):
            if path.split("/")[0] in folders:
                (to / path).parent.mkdir(parents=True, exist_ok=True)
                (to / path).write_bytes(content)

    def _object(self, name: str) -> ShaFile:
        try:
            return self._repo[name.encode()]
        except KeyError as error:
            reason = "is not in the repository (a shallow clone lacks old commits)"
            raise MissingObject(f"object {name} {reason}") from error
