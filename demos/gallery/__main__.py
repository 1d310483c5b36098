"""`./run python -m demos.gallery NAME ...`: run what is not stored, then film, picture, player file and page.
`./run python -m demos.gallery --check [NAME ...]`: simulate the quick levels anew, and say which numbers are older than
the solver.
"""

import argparse
import sys
from pathlib import Path

from demos.gallery.check import table_of_ages
from demos.gallery.entries import DEMOS, Entry
from demos.gallery.film import write_binding, write_film, write_picture, write_tile
from demos.gallery.page import RUNS, Shown, write_entry, write_index
from demos.gallery.shots import table_of_levels, write_costs
from demos.gallery.shown import ENTRIES
from demos.gallery.simulation import claims, note, simulate
from pdvol.errors import PdvolError
from pdvol.studio.play.document import write_player
from pdvol.studio.play.panes import panes_of_run

PAGES = DEMOS.parent / "docs" / "gallery"


def main(words: list[str]) -> int:
    """0 where all pages were written, 1 where a run failed, a claim does not hold or `--check` finds numbers older than
    the solver, 2 for a wrong name.
    """
    names = [entry.name for entry in ENTRIES]
    parser = argparse.ArgumentParser(prog="python -m demos.gallery", description=__doc__)
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"{', '.join(names)}, or all (with --check by default)"
    )
    parser.add_argument("--runs", type=Path, default=DEMOS.parent / RUNS, help=f"folder of the runs (default: {RUNS})")
    parser.add_argument("--no-film", action="store_true", help="keep film and pictures; write page and table anew")
    parser.add_argument("--check", action="store_true", help="say which numbers are older than the solver")
    options = parser.parse_args(words)
    if not (options.check or options.names):
        parser.error("give names, or --check")
    wanted = names if options.names in (["all"], []) else options.names
    wrong = [name for name in wanted if name not in names]
    if wrong:
        print(f"gallery: there is no {wrong[0]}; choose of {', '.join(names)}, or all", file=sys.stderr)
        return 2
    try:
        if options.check:
            text, old = table_of_ages([entry for entry in ENTRIES if entry.name in wanted], PAGES)
            print(text)
            return 1 if old else 0
        held = [show(entry, options.runs, not options.no_film) for entry in ENTRIES if entry.name in wanted]
    except PdvolError as error:
        print(f"gallery: {error}", file=sys.stderr)
        return 1
    print(write_index(ENTRIES, PAGES / "README.md"))
    return 0 if all(held) else 1


def show(entry: Entry, runs: Path, drawn: bool = True) -> bool:
    """Make everything of one entry, pictures if `drawn`; whether its claim holds."""
    PAGES.mkdir(parents=True, exist_ok=True)
    shown, *variants = found = [measured(each, runs) for each in entry.rows]
    if drawn:
        for each in found:
            write_film(each.entry, each.run, PAGES / f"{each.entry.name}.webp", each.beside)
        write_picture(entry, shown.run, PAGES / f"{entry.name}.png", shown.beside)
        write_tile(entry, shown.run, ENTRIES, PAGES / "sheet.png")
        if entry.binding:
            write_binding(shown.run, PAGES / f"{entry.name}_binding.png")
    write_player(panes_of_run(shown.run), runs / f"{entry.name}.html", entry.title)
    print(write_entry(shown, PAGES / f"{entry.name}.md", variants))
    broken = [(each.entry.name, sentence) for each in found for sentence, holds in each.claims if not holds]
    for name, sentence in broken:
        print(f"gallery: {name}: does not hold: {sentence}", file=sys.stderr)
    return not broken


def measured(entry: Entry, runs: Path) -> Shown:
    """The runs of an entry or of a variant, simulated where they are missing, and what is measured on them."""
    run = simulate(entry, runs / entry.name)
    direct = simulate(entry, runs / f"{entry.name}_direct", "direct") if entry.direct else None
    made, made_directly = note(run.path), {} if direct is None else note(direct.path)
    write_costs(run, direct, made, made_directly, PAGES / f"{entry.name}.json")
    beside = direct if entry.beside else None
    return Shown(entry, run, table_of_levels(run, direct), claims(entry, run), made, made_directly, beside)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
