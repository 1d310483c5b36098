"""Files of a commit, read without git: loose objects made here, and packs made by hand."""

import hashlib
import struct
import zlib

from benchmarks.common import commits


def loose(git, kind, content):
    """Writes an object; its id."""
    data = f"{kind} {len(content)}\0".encode() + content
    name = hashlib.sha1(data).hexdigest()
    path = git / "objects" / name[:2] / name[2:]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(zlib.compress(data))
    return name


def entry(mode, path, name):
    return f"{mode} {path}\0".encode() + bytes.fromhex(name)


def repository(tmp_path):
    """A work tree whose one commit has pdvol/deep/a.py, README and a link: the work tree, and the commit's id."""
    git = tmp_path / ".git"
    blob = loose(git, "blob", b"print(1)\n")
    deep = loose(git, "tree", entry("100644", "a.py", blob))
    package = loose(git, "tree", entry("40000", "deep", deep) + entry("120000", "link", blob))
    root = loose(git, "tree", entry("100755", "README", blob) + entry("40000", "pdvol", package))
    commit = loose(git, "commit", f"tree {root}\nauthor nobody\n\nAdd\n".encode())
    (git / "refs" / "heads").mkdir(parents=True)
    (git / "HEAD").write_text("ref: refs/heads/main\n")
    (git / "refs" / "heads" / "main").write_text(commit + "\n")
    return tmp_path, commit


def test_a_commit_is_written(tmp_path):
    folder, commit = repository(tmp_path)
    found = commits.Repository(folder)
    assert found.head() == commit == found.full(commit[:8])
    assert dict(found.files(commit)) == {"README": b"print(1)\n", "pdvol/deep/a.py": b"print(1)\n"}
    found.write(commit, ("pdvol",), tmp_path / "out")
    assert [str(path.relative_to(tmp_path / "out")) for path in (tmp_path / "out").rglob("*.*")] == ["pdvol/deep/a.py"]


def test_packs_and_deltas(tmp_path):
    """A blob, a delta to it by its offset, and one by its name: copy eleven bytes from 2 on, then add three."""
    folder, _ = repository(tmp_path)
    base = b"0123456789abcdefghij"
    delta = bytes([len(base), 14, 0x80 | 0x01 | 0x10, 2, 11, 3]) + b"xyz"
    made = base[2:13] + b"xyz"
    entries = [
        (base, bytes([3 << 4 | len(base) & 15 | 0x80, len(base) >> 4])),
        (delta, lambda place, first: bytes([6 << 4 | len(delta), place - first])),
        (delta, lambda place, first: bytes([7 << 4 | len(delta)]) + hashlib.sha1(b"blob 20\0" + base).digest()),
    ]
    data, offsets = b"PACK" + struct.pack(">II", 2, 3), []
    for content, head in entries:
        offsets.append(len(data))
        data += (head if isinstance(head, bytes) else head(len(data), offsets[0])) + zlib.compress(content)
    ids = [hashlib.sha1(b"blob 20\0" + base).digest(), b"\x01" * 20, b"\xfe" * 20]
    ordered = sorted(zip(ids, offsets, strict=True))
    counts = [sum(name[0] <= byte for name in ids) for byte in range(256)]
    index = b"\xfftOc" + struct.pack(">I256I", 2, *counts) + b"".join(name for name, _ in ordered)
    index += struct.pack(">3I", 0, 0, 0) + struct.pack(">3I", *(offset for _, offset in ordered))
    packs = folder / ".git" / "objects" / "pack"
    packs.mkdir()
    (packs / "one.pack").write_bytes(data)
    (packs / "one.idx").write_bytes(index)
    found = commits.Repository(folder)
    assert found.read(ids[0].hex()) == ("blob", base)
    assert found.read("01" * 20) == found.read("fe" * 20) == ("blob", made)
    assert found.full("0101") == "01" * 20
