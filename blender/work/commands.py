"""The command lines of pdvol that buttons stand for, after the words that start pdvol."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..shot.description import ShotError

QUIET = ("--no-picture", "--no-xdmf")  # Blender draws


def install_source(given: str, extension: Path) -> str:
    """What pip installs: what the user gives, or the wheel in the extension's folder, with the solver.

    It is never a name, which pip would look for on the package index, where pdvol is not and anyone could put it.

    Raises
    ------
    ShotError
        It is neither a wheel, nor a checkout, nor an address with its digest.
    """
    wheels = sorted(extension.glob("pdvol-*.whl"))
    source = given.strip() or (f"{wheels[-1]}[solver]" if wheels else "")
    place, bracket, extras = source.partition("[")
    if place and Path(place).exists():
        return f"{Path(place).absolute()}{bracket}{extras}"
    if "://" in source and "#sha256=" in source:
        return source
    raise ShotError(
        "Install from: give a wheel or a checkout of pdvol, as /home/me/pdvol[solver], or an address with its #sha256="
    )


def check(scene: Path, findings: Path) -> list[str]:
    """What would stop or spoil a run, and what levels cost; it is also written as JSON."""
    return ["check", str(scene), "--json", str(findings)]


def repair(open_mesh: Path, closed: Path, hole: float) -> list[str]:
    """Close a surface; the longest rim is in diagonals."""
    return ["repair", str(open_mesh), "-o", str(closed), "--hole", f"{hole:g}"]


def preview(scene: Path, run: Path) -> list[str]:
    """Level 0; replaces a preview that is there."""
    return ["preview", str(scene), "-o", str(run), *QUIET]


def resume(scene: Path, run: Path, last: int, settings: Mapping[str, str]) -> list[str]:
    """Levels 0 to `last` of a run, going on with what is stored."""
    words = [word for name, value in settings.items() for word in ("--set", f"{name}={value}")]
    return ["run", str(scene), "--levels", f"0:{last}", "-o", str(run), "--resume", *words, *QUIET]


def refine(run: Path, last: int) -> list[str]:
    """The finer levels of a run, up to `last`."""
    return ["refine", str(run), "--to", str(last), *QUIET]


def branch(scene: Path, source: Path, step: int, run: Path, last: int) -> list[str]:
    """A new run that begins with the states of another one."""
    begin = ["--branch", str(source), "--at", str(step)]
    return ["run", str(scene), "--levels", f"0:{last}", *begin, "-o", str(run), *QUIET]


def wedge(scene: Path, out: Path, name: str, first: float, last: float, count: int) -> list[str]:
    """Many variations of level 0, and their contact sheet; the ends are Blender's numbers, of single precision."""
    ends = f"{np.float32(first)!s}:{np.float32(last)!s}"
    return ["wedge", str(scene), "--vary", f"{name}={ends}:{count}", "-o", str(out), "--tiles"]


def pick(out: Path, number: int, run: Path) -> list[str]:
    """One of them as a run of its own."""
    return ["pick", str(out), str(number), "-o", str(run), *QUIET]


def export(run: Path, level: int, fps: float, out: Path) -> list[str]:
    """A level as point caches at the frames of Blender's scene."""
    frames = ["--levels", f"{level}:{level}", "--fps", f"{fps:.17g}", "--no-crossings"]
    return ["export", str(run), "--format", "pc2", *frames, "-o", str(out)]
