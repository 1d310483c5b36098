"""`python packaging/wheel_needs.py`: what this Python and its machine lack for pdvol[solver], in one line.

The exit code is 1 if they lack anything. It runs on every Python 3, and installs nothing.
"""

import ctypes
import importlib.util
import os
import platform
import shlex
import shutil
import sys
import sysconfig

GLIBC = (2, 34)  # of dolfinx' wheel, whose tag is manylinux_2_34
LIBRARIES = (  # loaded by the wheels of gmsh (windows, fonts) and vtk (drawing)
    "libGL.so.1",
    "libEGL.so.1",
    "libGLU.so.1",
    "libXcursor.so.1",
    "libXft.so.2",
    "libXinerama.so.1",
    "libfontconfig.so.1",
)


def is_loaded(library):
    """Whether the machine's loader finds a library."""
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


def lacking():
    """The names of what is missing."""
    name, version = platform.libc_ver()
    if sys.platform != "linux" or platform.machine() != "x86_64" or name != "glibc":
        yield "Linux on x86-64 with glibc"
    elif tuple(map(int, version.split(".")[:2])) < GLIBC:
        yield "glibc >= {}.{}".format(*GLIBC)
    if sys.version_info < (3, 12):
        yield "Python >= 3.12"
    if not importlib.util.find_spec("venv") or not importlib.util.find_spec("ensurepip"):
        yield "venv"
    if not os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h")):
        yield "Python.h"
    if not shutil.which(shlex.split(os.environ.get("CC") or "cc")[0]):
        yield "a C compiler"
    for library in LIBRARIES:
        if not is_loaded(library):
            yield library


if __name__ == "__main__":
    found = ", ".join(lacking())
    print(found)
    sys.exit(bool(found))
