"""The player as one HTML file: states, obstacles, graphs, three.js, the page's own scripts. It needs no network."""

from collections.abc import Sequence
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from pdvol.errors import InputError, SimulationError
from pdvol.store.files import jsonable, write_bytes
from pdvol.studio.draw.camera import VIEW_ANGLE, Camera, content_of_run, fitted_camera, front_of
from pdvol.studio.draw.layout import BACKGROUND, FAINT_INK, INK
from pdvol.studio.play.curves import GRAPHS, UNITS, Curves
from pdvol.studio.play.details import packed_details
from pdvol.studio.play.fields import FIELDS, packed_fields, strain
from pdvol.studio.play.motion import packed_obstacles, packed_skin
from pdvol.studio.play.packing import Chunks
from pdvol.studio.play.panes import Pane
from pdvol.studio.shown import GROUND, OBSTACLE, PALETTE, upward

SCRIPTS = ("states.js", "shaders.js", "bodies.js", "view.js", "graphs.js", "controls.js")
"""The page's own scripts in the order in which they are loaded."""
THREE_JS = "three-0.187.0"  # folder of the library within vendor/
COLOURS = {
    "background": BACKGROUND,
    "ground": GROUND,
    "obstacle": OBSTACLE,
    "bodies": PALETTE,
    "ink": INK,
    "faint": FAINT_INK,
}
"""By use."""
FRAMED_STATES = 12  # states of a level that the first camera must show: enough for the course of a motion
DIGITS = 6  # of the numbers in graphs: more than a pixel shows


def write_player(panes: Sequence[Pane], out: str | Path, title: str = "", columns: int | None = None) -> Path:
    """Write panes as one HTML file that plays them; it is written aside and renamed.

    Parameters
    ----------
    panes : at least one with a run
    out : the file; its name ends in .html
    title : of the page
    columns : of the panes side by side; those that fill the window best when None

    Raises
    ------
    InputError
        The name has another ending, there is nothing to play, or scenes of 2D and 3D are mixed.
    SimulationError
        The file cannot be written.
    """
    out = html_name(out)
    page = player_page(panes, title, columns)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SimulationError(f"cannot write {out}: {error.strerror}") from error
    write_bytes(out, page.encode())
    return out


def html_name(out: str | Path) -> Path:
    """The path of a player's file; InputError unless its name ends in .html."""
    if Path(out).suffix.lower() not in (".html", ".htm"):
        raise InputError(f"{out}: the name of a player ends in .html")
    return Path(out)


def with_strain(pane: Pane) -> Pane:
    """The same pane with the colour `strain`."""
    return replace(pane, fields={**pane.fields, "strain": strain(pane.stored)}) if pane.run else pane


def player_page(panes: Sequence[Pane], title: str = "", columns: int | None = None) -> str:
    """The page of a player; arguments and errors as of `write_player`."""
    shown = [pane for pane in panes if pane.run is not None]
    if not shown:
        raise InputError("there is no stored state to play")
    dims = {pane.stored.rest.shape[1] for pane in shown}
    if len(dims) > 1:
        raise InputError("scenes in 2D and in 3D cannot be played in one file; write a file for each")
    chunks = Chunks()
    fields, numbers = packed_fields([(pane.stored, pane.steps, pane.fields) for pane in shown], chunks)
    curves = {id(pane.run): Curves(pane.run) for pane in shown if pane.run is not None}
    data = {
        "title": title,
        "camera": _camera(shown),
        "colours": COLOURS,
        "graphs": GRAPHS,
        "units": UNITS,
        "fields": fields,
        "columns": columns,
        "notes": sorted({c.note for c in curves.values() if c.note}),
        "panes": [
            _pane(pane, numbers[shown.index(pane)], curves[id(pane.run)], chunks) if pane.run else _text(pane)
            for pane in panes
        ],
        "chunks": chunks.entries,
    }
    return rendered(
        "player.html.jinja",
        SCRIPTS,
        title=title or "pdvol player",
        data=jsonable(data),
        chunks=chunks.texts,
        field_labels={name: FIELDS[name][0] for name in fields},
        graphs=GRAPHS,
        flat=dims == {2},
        detailed=any(pane.details for pane in shown),
    )


def _text(pane: Pane) -> dict:
    return {"title": pane.title, "lines": list(pane.lines), "note": pane.note, "states": 0}


def _pane(pane: Pane, fields: dict, curves: Curves, chunks: Chunks) -> dict:
    level, run = pane.stored, curves.run
    details, error = packed_details(level, pane.details, pane.steps, chunks)
    skin = packed_skin(level, pane.steps, chunks, [mesh.body for mesh in pane.details])
    return _text(pane) | {
        "states": len(pane.steps),
        "dt": pane.every * run.dt,
        "end": (pane.states - 1) * run.dt,
        "names": list(run.info.get("bodies", [])),
        "fields": fields,
        "obstacles": packed_obstacles(level, run.obstacles, pane.steps, chunks),
        "curves": {
            name: [float(f"{value:.{DIGITS}g}") for value in values]
            for name, values in curves.of_level(pane.level, pane.steps).items()
        },
        "details": details,
        **skin,
        "error": max(skin["error"], error),
    }


def _camera(panes: Sequence[Pane]) -> dict:
    """The camera that shows all panes, with the directions of its buttons."""
    seen = []
    for pane in panes:
        steps = np.unique(np.linspace(0, pane.states - 1, FRAMED_STATES).round().astype(int)).tolist()
        seen.append(content_of_run([pane.stored], steps, pane.run.obstacles if pane.run else ()))
    first, dim = panes[0].run, panes[0].stored.rest.shape[1]
    up = upward(first) if first else np.array([0.0, 0.0, 1.0])
    return camera_entry(fitted_camera(np.concatenate(seen), dim, up), up)


def camera_entry(camera: Camera, up: np.ndarray) -> dict:
    """A camera as pages have it, with the directions of its buttons; `up` is the way up of a 3D scene."""
    up, front = (up, front_of(up)) if camera.dim == 3 else (camera.up, camera.towards)
    return {
        "dim": camera.dim,
        "right": camera.right,
        "up": camera.up,
        "towards": camera.towards,
        "focus": camera.focus,
        "distance": camera.distance,
        "half_height": camera.half_height,
        "aspect": camera.aspect,
        "size": camera.size,
        "angle": VIEW_ANGLE,
        "upward": up,
        "front": front,
        "side": np.cross(up, front),
    }


def rendered(template: str, scripts: Sequence[str], **values: Any) -> str:
    """A page of the folder `page` with the style, the library and these scripts."""
    environment = Environment(
        loader=PackageLoader("pdvol.studio.play", "page"), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    return environment.get_template(template).render(
        colours=COLOURS,
        style=_source("page/player.css"),
        library=_source(f"vendor/{THREE_JS}/three.min.js"),
        scripts=[_source(f"page/{name}") for name in scripts],
        **values,
    )


def _source(path: str) -> Markup:
    """A file of the player as it is. None of them holds the end of a script or style."""
    return Markup(files("pdvol.studio.play").joinpath(path).read_text(encoding="utf-8"))
