"""Where pdvol is: what the user names, the extension's own virtual environment, or the machine's."""

import os
import shlex
import shutil
import subprocess
from pathlib import Path

import bpy

from ..shot.description import ShotError
from ..work.commands import install_source

EXTENSION = Path(__file__).parents[1]
"""The folder of the extension's files."""
PACKAGE = __package__.rpartition(".")[0]
"""The extension's name in Blender's list of add-ons."""
COMMAND = "PDVOL_COMMAND"
"""The variable that names the words which start pdvol, before all else."""
PYTHONS = ("python3.14", "python3.13", "python3.12", "python3")
"""Interpreters, of which the first that is new enough is taken: pdvol's solver has wheels for 3.12 and newer."""
OLDEST = (3, 12)


def preference(context: bpy.types.Context, name: str) -> str:
    """A field of the extension's preferences; empty where Blender has none, as beside an installation."""
    addon = context.preferences.addons.get(PACKAGE)
    return getattr(addon.preferences, name, "") if addon is not None else ""


def own_folder() -> Path:
    """The extension's own folder, which an update leaves as it is."""
    try:
        return Path(bpy.utils.extension_path_user(PACKAGE, create=True))
    except ValueError:  # this is no installed extension
        return Path(bpy.utils.user_resource("DATAFILES", path="pdvol", create=True))


def own_pdvol(folder: Path) -> Path:
    """The command in the extension's own environment, whether or not it is there."""
    return folder / "venv" / ("Scripts" if os.name == "nt" else "bin") / ("pdvol.exe" if os.name == "nt" else "pdvol")


def pdvol_words(context: bpy.types.Context) -> list[str]:
    """The words that start pdvol; ShotError where it is nowhere."""
    given = os.environ.get(COMMAND, "") or preference(context, "command")
    if given:
        return shlex.split(given)
    own = own_pdvol(own_folder())
    found = str(own) if own.is_file() else shutil.which("pdvol")
    if not found:
        raise ShotError("pdvol is not installed: press Install, or name its command in the preferences")
    return [found]


def install_commands(folder: Path, source: str) -> list[list[str]]:
    """The command lines that make the environment and install `source` there; ShotError where no Python, or no source,
    will do.
    """
    python = _python()
    inside = str(own_pdvol(folder).with_name("python.exe" if os.name == "nt" else "python"))
    return [
        [python, "-m", "venv", "--clear", str(folder / "venv")],
        [inside, "-m", "pip", "install", "--no-input", "--progress-bar", "off", install_source(source, EXTENSION)],
        [str(own_pdvol(folder)), "--version"],
    ]


def _python() -> str:
    for name in PYTHONS:
        path = shutil.which(name)
        if path and _version(path) >= OLDEST:
            return path
    oldest = ".".join(map(str, OLDEST))
    raise ShotError(f"there is no Python {oldest} or newer on this machine: install one, with venv, and press Install")


def _version(python: str) -> tuple[int, int]:
    """Major and minor version of an interpreter that has venv; (0, 0) of one that has not, or does not start."""
    program = "import ensurepip, venv, sys; print(*sys.version_info[:2])"
    try:
        said = subprocess.run([python, "-c", program], capture_output=True, text=True, timeout=20, check=True).stdout
        major, minor = map(int, said.split())
    except (OSError, ValueError, subprocess.SubprocessError):
        return 0, 0
    return major, minor
