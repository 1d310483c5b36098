"""Where FFCx keeps the forms that it has compiled: a folder a form, made aside and renamed.

By itself FFCx lets a process wait for ten seconds while another one compiles the same form, and then fails: on a busy
machine, or for ever after a process was killed while it compiled. Here nobody waits. A form that is not yet kept is
compiled in a folder of the process's own, which then gets the form's name. A folder with such a name is therefore
whole. Of two processes that compile one form at once, the first one keeps it.
"""

import contextlib
import os
import shlex
import shutil
import sysconfig
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import ffcx.naming
import ffcx.options
import numpy as np
import ufl
from mpi4py import MPI

from pdvol.compat import jit
from pdvol.compiled import cache_folder, compiler
from pdvol.errors import InputError
from pdvol.parallel import on_root
from pdvol.stages import stage

ASIDE = "aside-"
"""How the names of the folders in which processes compile begin."""
ABANDONED_SECONDS = 86_400.0
"""Age [s] of such a folder from which on it is that of a killed process. Compiling takes seconds."""
Expression = tuple[ufl.core.expr.Expr, np.ndarray]
"""An expression and the points (n, d) of the reference cell at which it is evaluated."""


@contextmanager
def form_cache(comm: MPI.Comm, form: ufl.Form | Expression, flags: Sequence[str] = ()) -> Iterator[dict[str, Any]]:
    """The options with which dolfinx compiles or loads a form within the `with` block. Collective.

    Parameters
    ----------
    form : what is compiled in the block, and nothing else
    flags : of the C compiler

    Raises
    ------
    InputError
        A form cannot be compiled: there is no C compiler, or no Python.h.
    """
    options: dict[str, Any] = {"cffi_extra_compile_args": list(flags)} if flags else {}
    how = f"{sorted(jit.get_options(options).items())} {sysconfig.get_config_var('SOABI')}"
    with kept_folder(comm, form, how) as (folder, new):
        if new:
            on_root(comm, _require_headers)
        with _compiling() if new else contextlib.nullcontext():
            yield {**options, "cache_dir": str(folder)}


@contextmanager
def kept_folder(comm: MPI.Comm, form: ufl.Form | Expression, how: str) -> Iterator[tuple[Path, bool]]:
    """The folder of what is compiled of a form, and whether it is new, so that the `with` block fills it. Collective.

    Parameters
    ----------
    how : in what way it is compiled
    """
    folder = cache_folder() / "forms"
    kept = folder / _name(form, how) if comm.rank == 0 else folder
    used, new = on_root(comm, lambda: (kept, False) if kept.is_dir() else (_folder_aside(folder), True))
    try:
        with stage("compiling forms") if new else contextlib.nullcontext():
            yield used, new
            comm.barrier()  # the other ranks load what the first one has compiled
        if comm.rank == 0 and new:
            _keep(used, kept)
    finally:
        if comm.rank == 0 and new:
            shutil.rmtree(used, ignore_errors=True)


def _name(form: ufl.Form | Expression, how: str) -> str:
    """A name for a form and how it is compiled."""
    return ffcx.naming.compute_signature([form], f"{how} {sorted(ffcx.options.get_options().items())}")


def _require_headers() -> None:
    compiler()
    if not Path(sysconfig.get_path("include"), "Python.h").is_file():
        raise InputError(
            "no Python.h, with which FFCx compiles forms; install Python's headers (python3-dev, python3-devel)"
        )


@contextmanager
def _compiling() -> Iterator[None]:
    """Within it FFCx takes the compiler that pdvol takes, where the one that built Python is not there."""
    words = shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "")
    own = {}
    if not words or not shutil.which(words[0]):
        own = {"CC": shlex.join(compiler()), "LDSHARED": shlex.join([*compiler(), "-shared"])}
    before = {name: os.environ.get(name) for name in own}
    os.environ.update(own)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _folder_aside(folder: Path) -> Path:
    """A new folder beside the kept ones; among temporary files where these cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return Path(tempfile.mkdtemp(prefix=ASIDE, dir=folder))
    except OSError:
        return Path(tempfile.mkdtemp(prefix="pdvol-form-"))


def _keep(made: Path, kept: Path) -> None:
    """Rename a folder with a compiled form, and remove what killed processes have left."""
    with contextlib.suppress(OSError):  # it is kept already, or lies on another file system
        for path in made.iterdir():
            with path.open("rb") as file:
                os.fsync(file.fileno())  # a machine that stops must not leave a name without its contents
        made.chmod(0o755)
        made.rename(kept)
    with contextlib.suppress(OSError):
        for left in kept.parent.glob(ASIDE + "*"):
            if time.time() - left.stat().st_mtime > ABANDONED_SECONDS:
                shutil.rmtree(left, ignore_errors=True)
