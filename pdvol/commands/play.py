"""`pdvol play`: runs, or a wedge folder, as one HTML file that plays them."""

from argparse import ArgumentParser, Namespace
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pdvol.commands.options import add, stored_levels
from pdvol.errors import InputError

if TYPE_CHECKING:
    from pdvol.studio.play.panes import Pane


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol play`."""
    parser.add_argument("runs", type=Path, nargs="+", metavar="RUN", help="run folders, or one folder of pdvol wedge")
    parser.add_argument("-o", "--out", type=Path, metavar="FILE.html", help="default: player.html in the first folder")
    add(parser, "--levels")
    parser.add_argument(
        "--fields",
        default="",
        metavar="NAMES",
        help="more to colour by, with commas: strain, contact_force (needs the scene's file)",
    )
    parser.add_argument(
        "--every",
        type=int,
        metavar="N",
        help="store one state in N, and the last (default: as many as a browser takes)",
    )
    parser.add_argument(
        "--no-render-meshes", action="store_true", help="leave render meshes out: a smaller file, with more states"
    )
    add(parser, "--trust")


def main(options: Namespace) -> None:
    """Write the player, and print its name, its size and how exact it is."""
    from pdvol.store.files import require_place
    from pdvol.studio.play.document import html_name, with_strain, write_player
    from pdvol.studio.play.fields import FIELDS
    from pdvol.studio.play.panes import thinned

    out = html_name(options.out or options.runs[0] / "player.html")
    fields = [name for name in options.fields.split(",") if name]
    for name in fields:
        if name not in FIELDS:
            raise InputError(f"--fields: unknown field {name!r}; choose of {', '.join(FIELDS)}")
    if options.every is not None and options.every < 1:
        raise InputError(f"--every: {options.every} is too small; 1 stores every state")
    require_place(out.parent)
    panes, columns, title = chosen_panes(options)
    panes = [replace(pane, detailed=not options.no_render_meshes) for pane in panes]
    panes, notes = thinned(panes, options.every), list[str]()
    every = max(pane.every for pane in panes)
    if every > 1 and options.every is None:
        notes.append(f"one state in {every} is in the file, so that a browser can hold it; --every 1 takes all")
    if "contact_force" in fields:
        panes = with_contact_force(panes, notes)
    if "strain" in fields:
        panes = [with_strain(pane) for pane in panes]
    write_player(panes, out, title, columns)
    print("\n".join([f"{out}: {len(panes)} panes, {out.stat().st_size / 1e6:.1f} MB", *notes]))


def chosen_panes(options: Namespace) -> tuple[list["Pane"], int | None, str]:
    """The panes of the command line's folders, the number of columns if it matters, and the page's title."""
    from pdvol.store.reader import open_run
    from pdvol.studio.play.panes import WEDGE, panes_of_run, panes_of_wedge

    wedges = [path for path in options.runs if (path / WEDGE).is_file()]
    if wedges:
        if len(options.runs) > 1:
            raise InputError(f"{wedges[0]} is a wedge folder: play it alone, or name single runs of it")
        (folder,) = wedges
        return panes_of_wedge(folder, stored_levels(options.levels, None)), None, folder.resolve().name
    runs = [open_run(path) for path in options.runs]
    rows = [panes_of_run(run, stored_levels(options.levels, run), named=len(runs) > 1) for run in runs]
    columns = len(rows[0]) if len(runs) > 1 and len({len(row) for row in rows}) == 1 and len(rows[0]) > 1 else None
    scenes = dict.fromkeys(str(run.info.get("scene") or run.path.resolve().name) for run in runs)
    return [pane for row in rows for pane in row], columns, ", ".join(scenes)


def with_contact_force(panes: list["Pane"], notes: list[str]) -> list["Pane"]:
    """The same panes with the colour `contact_force`, where a run's scene is available; notes name where it is not."""
    from pdvol.studio.export.exports import RunFields
    from pdvol.studio.play.fields import per_area

    by_run = {id(pane.run): RunFields(pane.run) for pane in panes if pane.run is not None}
    found = []
    for pane in panes:
        if pane.run is not None:
            of_step = by_run[id(pane.run)](pane.level)
            if "contact_force" in of_step(0).points:
                force = lambda step, of_step=of_step: of_step(step).points["contact_force"]
                pane = replace(pane, fields={**pane.fields, "contact_force": per_area(pane.stored, force)})
        found.append(pane)
    notes += dict.fromkeys(note for its in by_run.values() for note in its.notes)
    return found
