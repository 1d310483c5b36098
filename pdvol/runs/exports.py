"""Exports of stored runs, with contact forces and stresses where the run's scene is available."""

from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from inspect import signature
from pathlib import Path

from pdvol.errors import InputError
from pdvol.export.series import Fields, Series, nothing_more
from pdvol.registry import FORMATS
from pdvol.store.reader import Run, open_run


def export_run(
    path: str | Path,
    format_name: str,
    out: str | Path,
    levels: Sequence[int] | None = None,
    fps: float | None = None,
    with_fields: bool = False,
) -> tuple[list[Path], list[str]]:
    """Export a stored run, finished or not, into the folder `out`.

    Parameters
    ----------
    path : the run folder
    format_name : a name in `pdvol.registry.FORMATS`
    out : a folder; it is made where there is none
    levels : all that hold a state when None
    fps : frames a second, for formats that resample; the format's own choice when None
    with_fields : contact forces and stresses also in formats that leave them out otherwise

    Returns
    -------
    tuple[list[Path], list[str]]
        The paths written, and notes on what could not be exported.

    Raises
    ------
    InputError
        The folder is no run, a level is missing or empty, the format unknown, its library not installed, or it does
        not take one of the choices.
    SimulationError
        `out` cannot be written.
    """
    FORMATS.check(format_name)
    run = open_run(path)
    fields = RunFields(run)
    levels = [level.index for level in run.levels if level.steps] if levels is None else list(levels)
    if not levels:
        raise InputError(f"{path} has no stored state to export")
    for level in levels:
        Series(run, level)  # refuses a level that is missing or empty, before anything is written
    chosen = {**({} if fps is None else {"fps": fps}), **({"with_fields": True} if with_fields else {})}
    writer = FORMATS[format_name]
    _check_choices(format_name, writer, chosen)
    written = writer(run, levels, Path(out), fields, **chosen)
    return [Path(file) for file in written], fields.notes


def _check_choices(format_name: str, writer: Callable, chosen: Iterable[str]) -> None:
    """InputError where a format does not take one of the choices."""
    refused = {
        "fps": f"--fps: the format {format_name} holds the stored steps alone, without frames between them",
        "with_fields": f"--fields: the format {format_name} has no such choice",
    }
    taken = signature(writer).parameters
    for name in chosen:
        if name not in taken:
            raise InputError(refused[name])


class RunFields:
    """`contact_force` and `von_mises` of a run's levels, by level; none where the run's scene is not available.

    The scene and the finite elements are loaded at the first call, which formats without fields never make.

    Attributes
    ----------
    notes : list of str
        Why fields are missing.
    """

    def __init__(self, run: Run):
        self._run = run
        self.notes: list[str] = []

    @cached_property
    def _scene(self) -> tuple | None:
        """The scene and its obstacles' geometry."""
        from pdvol.runs.stored_fields import stored_scene

        try:
            return stored_scene(self._run)
        except InputError as error:
            self.notes.append(f"without contact forces and stresses: {error}")
            return None

    def __call__(self, level: int) -> Fields:
        if self._scene is None:
            return nothing_more
        from pdvol.runs.stored_fields import SceneFields

        scene, obstacles = self._scene
        return SceneFields(scene, self._run, level, obstacles)
