"""The files of a commit, read from the repository's own objects: `./run`'s environment has no git.

Objects are loose or in packs of version 2, as every git since 2008 writes them.
"""

import mmap
import re
import struct
import zlib
from bisect import bisect_left
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

KEPT_OBJECTS = 1000
"""Number of objects of a pack that are kept in memory: more than a chain of deltas has, whose ends are read again and
again.
"""
PIECE = 4096
"""Number of bytes of a pack that are read at a time: most objects but pictures are shorter."""
KINDS = {1: "commit", 2: "tree", 3: "blob", 4: "tag"}


class MissingObject(Exception):
    """An object is not in the repository."""


class Repository:
    """The objects of the repository whose work tree is `folder` (a worktree will do).

    Raises
    ------
    MissingObject
        There is no repository.
    """

    def __init__(self, folder: Path):
        self.git = folder / ".git"
        if self.git.is_file():  # a worktree names its folder in the repository
            self.git = folder / self.git.read_text().partition(":")[2].strip()
        if not (self.git / "HEAD").is_file():
            raise MissingObject(f"{folder} is no git repository")
        common = self.git / "commondir"
        self.common = (self.git / common.read_text().strip()).resolve() if common.is_file() else self.git
        self._packs = [Pack(path, self) for path in sorted((self.common / "objects" / "pack").glob("*.idx"))]

    def head(self) -> str:
        """The commit that is checked out, in full; empty where its branch has none."""
        text = (self.git / "HEAD").read_text().strip()
        if not text.startswith("ref: "):
            return text
        name = text[5:]
        if (self.common / name).is_file():
            return (self.common / name).read_text().strip()
        packed = self.common / "packed-refs"
        lines = packed.read_text().splitlines() if packed.is_file() else []
        return next((line.split()[0] for line in lines if line.endswith(f" {name}")), "")

    def full(self, start: str) -> str:
        """The one object whose id begins with `start` (four digits or more).

        Raises
        ------
        MissingObject
            There is none, or more than one.
        """
        if not re.fullmatch("[0-9a-f]{4,40}", start):
            raise MissingObject(f"{start!r} is no commit's id, or less than four digits of one")
        found = {start[:2] + path.name for path in (self.common / "objects" / start[:2]).glob(f"{start[2:]}*")}
        for pack in self._packs:
            found.update(pack.starting(start))
        if len(found) != 1:
            raise MissingObject(f"{len(found)} objects begin with {start!r}; more digits, or a deeper clone, may help")
        return found.pop()

    def read(self, name: str) -> tuple[str, bytes]:
        """Kind and content of an object."""
        loose = self.common / "objects" / name[:2] / name[2:]
        if loose.is_file():
            head, _, content = zlib.decompress(loose.read_bytes()).partition(b"\0")
            return head.split()[0].decode(), content
        for pack in self._packs:
            offset = pack.offset(bytes.fromhex(name))
            if offset is not None:
                return pack.read(offset)
        raise MissingObject(f"object {name} is not in the repository (a shallow clone lacks old commits)")

    def files(self, commit: str) -> Iterator[tuple[str, bytes]]:
        """Paths and contents of a commit's files; links and submodules are left out.

        Raises
        ------
        MissingObject
            Also where the object is no commit.
        """
        kind, content = self.read(commit)
        if kind != "commit":
            raise MissingObject(f"{commit} is a {kind}, not a commit")
        yield from self._tree(content.split()[1].decode(), "")

    def parents(self, commit: str) -> tuple[str, ...]:
        """The commits that a commit follows; none for the first one."""
        lines = self.read(commit)[1].partition(b"\n\n")[0].decode(errors="replace").splitlines()
        return tuple(line[7:] for line in lines if line.startswith("parent "))

    def tree(self, commit: str) -> str:
        """The id of a commit's root folder."""
        return self.read(commit)[1].split()[1].decode()

    def listed(self, tree: str) -> dict[str, str]:
        """What a folder has: names and ids."""
        rest, found = self.read(tree)[1], {}
        while rest:
            head, _, rest = rest.partition(b"\0")
            found[head.partition(b" ")[2].decode()] = rest[:20].hex()
            rest = rest[20:]
        return found

    def _tree(self, name: str, prefix: str) -> Iterator[tuple[str, bytes]]:
        rest = self.read(name)[1]
        while rest:
            head, _, rest = rest.partition(b"\0")
            mode, path = head.decode().split(" ", 1)
            entry, rest = rest[:20].hex(), rest[20:]
            if mode == "40000":
                yield from self._tree(entry, f"{prefix}{path}/")
            elif mode.startswith("100"):
                yield prefix + path, self.read(entry)[1]

    def write(self, commit: str, folders: tuple[str, ...], to: Path) -> None:
        """Writes a commit's files below `folders` into a folder."""
        for path, content in self.files(commit):
            if path.split("/")[0] in folders:
                (to / path).parent.mkdir(parents=True, exist_ok=True)
                (to / path).write_bytes(content)


class Pack:
    """A pack and its index."""

    def __init__(self, index: Path, repository: Repository):
        self._index, self._repository = index.read_bytes(), repository
        self.read = lru_cache(KEPT_OBJECTS)(self._read)
        """Kind and content of the object at an offset."""
        self._count = struct.unpack(">I", self._index[8 + 255 * 4 : 8 + 256 * 4])[0]
        with index.with_suffix(".pack").open("rb") as file:
            self._data = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, k: int) -> bytes:
        """The k-th id; they are sorted."""
        if not 0 <= k < self._count:
            raise IndexError(k)
        return self._index[1032 + 20 * k : 1052 + 20 * k]

    def starting(self, start: str) -> Iterator[str]:
        """The ids that begin with `start`."""
        k = bisect_left(self, bytes.fromhex(start + "0" * (40 - len(start))))
        while k < self._count and self[k].hex().startswith(start):
            yield self[k].hex()
            k += 1

    def offset(self, name: bytes) -> int | None:
        """Where an object begins; None where it is not in this pack."""
        k = bisect_left(self, name)
        if k == self._count or self[k] != name:
            return None
        small = 1032 + 24 * self._count
        offset = struct.unpack_from(">I", self._index, small + 4 * k)[0]
        if offset & 0x80000000:
            offset = struct.unpack_from(">Q", self._index, small + 4 * self._count + 8 * (offset & 0x7FFFFFFF))[0]
        return offset

    def _read(self, offset: int) -> tuple[str, bytes]:
        """Kind and content of the object there, its deltas carried out."""
        begin, byte = offset, self._data[offset]
        kind, offset = byte >> 4 & 7, offset + 1
        while byte & 0x80:  # its size, which the stream below has as well
            byte, offset = self._data[offset], offset + 1
        if kind == 6:  # a delta to an object of this pack
            byte, offset = self._data[offset], offset + 1
            back = byte & 0x7F
            while byte & 0x80:
                byte, offset = self._data[offset], offset + 1
                back = (back + 1) << 7 | byte & 0x7F
            name, base = self.read(begin - back)
        elif kind == 7:  # a delta to an object anywhere
            name, base = self._repository.read(self._data[offset : offset + 20].hex())
            offset += 20
        content = self._inflated(offset)
        return (name, applied(base, content)) if kind in (6, 7) else (KINDS[kind], content)

    def _inflated(self, offset: int) -> bytes:
        """What is compressed there, read piece by piece: a copy of all the rest of a large pack would take longer."""
        found, stream = [], zlib.decompressobj()
        while not stream.eof and offset < len(self._data):
            found.append(stream.decompress(self._data[offset : offset + PIECE]))
            offset += PIECE
        return b"".join(found)


def applied(base: bytes, delta: bytes) -> bytes:
    """The content that a delta makes of its base."""
    place, out = 0, []
    for _ in range(2):  # the two sizes
        while delta[place] & 0x80:
            place += 1
        place += 1
    while place < len(delta):
        code, place = delta[place], place + 1
        if not code & 0x80:
            out.append(delta[place : place + code])
            place += code
            continue
        numbers = [0, 0]  # where in the base, how many bytes
        for bit in range(7):
            if code >> bit & 1:
                numbers[bit > 3] |= delta[place] << 8 * (bit if bit < 4 else bit - 4)
                place += 1
        out.append(base[numbers[0] : numbers[0] + (numbers[1] or 0x10000)])
    return b"".join(out)
