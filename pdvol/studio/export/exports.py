"""Exports of stored runs, with contact forces and stresses where the run's scene is available."""

from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from inspect import signature
from pathlib import Path
from typing import Any

from pdvol.errors import InputError
from pdvol.registry import FORMATS
from pdvol.stages import say, stage
from pdvol.store.files import require_place
from pdvol.store.reader import Run, open_run
from pdvol.store.series import Fields, Series, nothing_more
from pdvol.studio.export.parts import CONTACT_SURFACE, RENDER
from pdvol.studio.export.render_crossings import deepest_crossing, rest_gaps


def export_run(
    path: str | Path,
    format_name: str,
    out: str | Path,
    levels: Sequence[int] | None = None,
    fps: float | None = None,
    with_fields: bool = False,
    surface: str | None = None,
    crossings: bool = True,
) -> tuple[list[Path], list[str]]:
    """Export a stored run, finished or not, into the folder `out`.

    Parameters
    ----------
    path : the run folder
    format_name : a name in `pdvol.registry.FORMATS`
    out : a folder; it is made where there is none
    levels : all that hold a state when None
    fps : frames a second, for formats that resample; the format's own choice when None
    with_fields : contact forces, strains and stresses in usd, which leaves them out otherwise
    surface : of bodies with a render mesh, one of `pdvol.registry.SHOWN_SURFACES`; the mesh where None
    crossings : whether to look where render meshes cross

    Returns
    -------
    tuple[list[Path], list[str]]
        The paths written, and notes on what could not be exported and on where render meshes cross.

    Raises
    ------
    InputError
        The folder is no run, a level is missing or empty, the format unknown, its library not installed, or it does
        not take one of the choices.
    SimulationError
        `out` cannot be written.
    """
    FORMATS.check(format_name)
    require_place(Path(out))
    run = open_run(path)
    fields = RunFields(run)
    levels = [level.index for level in run.levels if level.steps] if levels is None else list(levels)
    if not levels:
        raise InputError(f"{path} has no stored state to export")
    for level in levels:
        Series(run, level)  # refuses a level that is missing or empty, before anything is written
    chosen: dict[str, Any] = {**({} if fps is None else {"fps": fps}), **({"with_fields": True} if with_fields else {})}
    chosen |= {} if surface is None else {"surface": surface}
    writer = FORMATS[format_name]
    _check_choices(format_name, writer, chosen)
    with stage(f"exporting {format_name}"):
        written = writer(run, levels, Path(out), fields, **chosen)
    drawn = "surface" in signature(writer).parameters and surface != CONTACT_SURFACE
    crossed = []
    if crossings and drawn and run.render_meshes:
        with stage("measuring how render meshes cross"):
            crossed = render_lines(run, levels)
    covered = _covered_bodies(run) if with_fields and surface in (None, RENDER) else []
    return [Path(file) for file in written], fields.notes + covered + crossed


def _covered_bodies(run: Run) -> list[str]:
    """A line on bodies whose fields are not written, because render meshes stand for their simulated surfaces."""
    names = dict.fromkeys(str(run.info["bodies"][mesh.body]) for mesh in run.render_meshes)
    return [f"without fields of {', '.join(names)}: render meshes have none; --surface contact does"] if names else []


def render_lines(run: Run, levels: Sequence[int]) -> list[str]:
    """Lines: how far render meshes stand out from simulated surfaces, how deep they cross what is drawn beside them."""
    lines = []
    for number in levels if run.render_meshes else ():
        level = run.levels[number]
        say(f"level {number}")
        for mesh in run.render_meshes:
            out, within = rest_gaps(level, mesh)
            lines.append(
                f"level {number}: the render mesh of {mesh.name!r} stands out from the contact surface by up to"
                f" {out:.3g} m at rest, and lies up to {within:.3g} m within it"
            )
        worst = deepest_crossing(run, level)
        lines.append(
            f"level {number}: render meshes cross by up to {worst.depth:.3g} m: {worst.name!r} and {worst.other} at"
            f" step {worst.step}"
            if worst.depth > 0.0
            else f"level {number}: render meshes cross nothing in {level.steps} states"
        )
    return lines


def _check_choices(format_name: str, writer: Callable, chosen: Iterable[str]) -> None:
    """InputError where a format does not take one of the choices."""
    refused = {
        "fps": f"--fps: the format {format_name} holds the stored steps alone, without frames between them",
        "with_fields": f"--fields: the format {format_name} has no such choice",
        "surface": f"--surface: the format {format_name} holds the simulated mesh alone",
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
