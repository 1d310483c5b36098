"""Where a shot's files lie, and how meshes, weights and point caches are written and read.

shot.blend
shot.py                     the scene file
shot_pdvol/meshes/          what it reads: NAME.obj, NAME_render.obj, NAME_GROUP.txt, NAME.pc2
shot_pdvol/runs/1/          run folders of pdvol
shot_pdvol/play/1/          what Blender's objects are called there and where they are (objects.json), and
shot_pdvol/play/1/level_0/  point caches in their own coordinates
shot_pdvol/wedge/           many variations of level 0
shot_pdvol/log.txt          what pdvol said
"""

import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .description import Mesh

PC2_HEADER = struct.Struct("<12siiffi")  # of a PC2 file: sign, version, points, first frame, frames a sample, samples
PC2_SIGN = b"POINTCACHE2\0"


@dataclass(frozen=True)
class Places:
    """The files of a shot beside a .blend file."""

    blend: Path

    @property
    def scene(self) -> Path:
        """The scene file."""
        return self.blend.with_suffix(".py")

    @property
    def folder(self) -> Path:
        """All else."""
        return self.blend.with_name(f"{self.blend.stem}_pdvol")

    @property
    def meshes(self) -> Path:
        """What the scene file reads."""
        return self.folder / "meshes"

    @property
    def log(self) -> Path:
        """What pdvol said."""
        return self.folder / "log.txt"

    @property
    def findings(self) -> Path:
        """What a check has found."""
        return self.folder / "check.json"

    @property
    def wedge(self) -> Path:
        """Many variations of level 0."""
        return self.folder / "wedge"

    def run(self, number: int) -> Path:
        """A run folder; they are numbered from 1 on."""
        return self.folder / "runs" / str(number)

    def play(self, number: int) -> Path:
        """What Blender shows of a run."""
        return self.folder / "play" / str(number)

    def caches(self, number: int, level: int) -> Path:
        """The point caches of a level of a run."""
        return self.play(number) / f"level_{level}"

    def run_numbers(self) -> list[int]:
        """Those of the runs that are there, ascending."""
        runs = self.folder / "runs"
        return sorted(int(p.name) for p in runs.iterdir() if p.name.isdecimal()) if runs.is_dir() else []


@contextmanager
def written_aside(path: Path) -> Iterator[Path]:
    """A name for writing; the file gets its own name once it is whole."""
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = path.with_name(f".{path.name}.part")
    try:
        yield aside
        os.replace(aside, path)
    finally:
        aside.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a file whole; one that holds the same already is left as it is."""
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        with written_aside(path) as aside:
            aside.write_text(text, encoding="utf-8")


def write_obj(path: Path, mesh: Mesh) -> None:
    """Vertices in their order, and polygons."""
    lines = ["v {!r} {!r} {!r}".format(*row) for row in mesh.points.tolist()]
    words, ends = [str(c) for c in (mesh.corners + 1).tolist()], np.cumsum(mesh.counts).tolist()
    lines += ["f " + " ".join(words[e - n : e]) for e, n in zip(ends, mesh.counts.tolist(), strict=True)]
    write_text(path, "\n".join([*lines, ""]))


def write_weights(path: Path, weights: np.ndarray) -> None:
    """A weight on each line."""
    write_text(path, "\n".join([*(repr(w) for w in weights.tolist()), ""]))


def write_pc2(path: Path, frames: np.ndarray, frames_a_sample: float = 1.0) -> None:
    """Points (k, n, 3) as a PC2 file, whose first sample is frame 0."""
    with written_aside(path) as aside, open(aside, "wb") as file:
        file.write(PC2_HEADER.pack(PC2_SIGN, 1, frames.shape[1], 0.0, frames_a_sample, len(frames)))
        for frame in frames:
            file.write(np.ascontiguousarray(frame, dtype="<f4").tobytes())


def read_pc2(path: Path) -> np.ndarray:
    """(k, n, 3) float32, a view of the file; ValueError where it is none."""
    with open(path, "rb") as file:
        sign, _, points, _, _, samples = PC2_HEADER.unpack(file.read(PC2_HEADER.size))
    if sign != PC2_SIGN or path.stat().st_size < PC2_HEADER.size + 12 * points * samples:
        raise ValueError(f"{path} is no PC2 file, or truncated")
    return np.memmap(path, "<f4", "r", PC2_HEADER.size, (samples, points, 3))
