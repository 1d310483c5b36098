"""`./run python -m demos.gallery NAME ...`: run what is not stored, then film, picture, player file and page."""

import argparse
import sys
from pathlib import Path

from demos.gallery.entries import DEMOS, Entry
from demos.gallery.figures import table_of_levels
from demos.gallery.film import write_binding, write_film, write_picture, write_sheet, write_tile
from demos.gallery.further import write_further
from demos.gallery.page import RUNS, write_entry, write_index
from demos.gallery.shown import ENTRIES
from demos.gallery.simulation import claims, note, simulate
from pdvol.errors import PdvolError
from pdvol.studio.play.document import write_player
from pdvol.studio.play.panes import panes_of_run

PAGES = DEMOS.parent / "docs" / "gallery"


def main(words: list[str]) -> int:
    """0 where all pages were written, 1 where a run failed or a claim does not hold, 2 for a wrong name."""
    names = [entry.name for entry in ENTRIES]
    parser = argparse.ArgumentParser(prog="python -m demos.gallery", description=__doc__)
    parser.add_argument("names", nargs="+", metavar="NAME", help=f"{', '.join(names)}, or all")
    parser.add_argument("--runs", type=Path, default=DEMOS.parent / RUNS, help=f"folder of the runs (default: {RUNS})")
    parser.add_argument(
        "--no-film", action="store_true", help="keep film and pictures; write the page and its table anew"
    )
    options = parser.parse_args(words)
    wanted = names if options.names == ["all"] else options.names
    wrong = [name for name in wanted if name not in names]
    if wrong:
        print(f"gallery: there is no {wrong[0]}; choose of {', '.join(names)}, or all", file=sys.stderr)
        return 2
    try:
        held = [show(entry, options.runs, not options.no_film) for entry in ENTRIES if entry.name in wanted]
    except PdvolError as error:
        print(f"gallery: {error}", file=sys.stderr)
        return 1
    write_sheet(ENTRIES, PAGES / "tiles", PAGES / "sheet.png")
    print(write_index(ENTRIES, PAGES / "README.md"))
    return 0 if all(held) else 1


def show(entry: Entry, runs: Path, drawn: bool = True) -> bool:
    """Make everything of one entry, pictures if `drawn`; whether its claim holds."""
    run = simulate(entry, runs / entry.name)
    direct = simulate(entry, runs / f"{entry.name}_direct", "direct") if entry.direct else None
    found = claims(entry, run)
    PAGES.mkdir(parents=True, exist_ok=True)
    if drawn:
        write_film(entry, run, PAGES / f"{entry.name}.webp")
        write_picture(entry, run, PAGES / f"{entry.name}.png")
        write_tile(entry, run, PAGES / "tiles" / f"{entry.name}.png")
        if entry.binding:
            write_binding(run, PAGES / f"{entry.name}_binding.png")
        for film in entry.further:
            write_further(entry, film, run, PAGES / f"{entry.name}_{film.name}.webp")
    write_player(panes_of_run(run), runs / f"{entry.name}.html", entry.title)
    levels = table_of_levels(run, direct)
    made = note(run.path), {} if direct is None else note(direct.path)
    print(write_entry(entry, run, levels, found, *made, PAGES / f"{entry.name}.md"))
    for sentence, holds in found:
        if not holds:
            print(f"gallery: {entry.name}: does not hold: {sentence}", file=sys.stderr)
    return all(holds for _, holds in found)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
