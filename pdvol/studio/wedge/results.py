"""What a user sees of a wedge: progress, the table, the contact sheet, its film, and parameters against scores."""

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

from tqdm import tqdm

from pdvol.runs.notebook_text import progress_stream
from pdvol.store.reader import Run
from pdvol.studio.draw.layout import cluster_name
from pdvol.studio.draw.sheet import MOST_TILES, Tile, sheet_film, sheet_image
from pdvol.studio.wedge.jobs import Outcome
from pdvol.studio.wedge.variation import short_text
from pdvol.studio.wedge.wedge import Report, Wedge, change, stored_runs


@contextmanager
def progress(total: int, best_of: str = "", stream: TextIO | None = None) -> Iterator[Report]:
    """Shows how many runs have ended and the time left: one bar on a terminal, a line per run anywhere else.

    Parameters
    ----------
    total : runs
    best_of : text of the score whose largest value is shown; none when empty
    stream : `progress_stream()` when None
    """
    stream = progress_stream() if stream is None else stream
    states: list[str] = []
    scores: dict[int, float] = {}
    lines, begin, computed = not stream.isatty(), time.monotonic(), 0
    with tqdm(total=total, desc="wedge", unit="run", file=stream, dynamic_ncols=True, disable=lines) as bar:

        def ended(entry: dict[str, Any], outcome: Outcome) -> None:
            nonlocal computed
            states.append(outcome.state)
            computed += outcome.seconds > 0.0
            if entry["scores"].get(best_of) is not None:
                scores[entry["number"]] = entry["scores"][best_of]
            failed, best = len(states) - states.count("done"), max(scores, key=lambda n: scores[n], default=None)
            notes = [f"{failed} failed"] if failed else []
            notes += [] if best is None else [f"best {cell_text(scores[best])} (number {best})"]
            if lines:
                how = f"done in {outcome.seconds:.1f} s" if outcome.seconds else "stored before"
                how = how if outcome.state == "done" else f"{outcome.state}: {outcome.reason}"
                if computed and len(states) < total:
                    left = (time.monotonic() - begin) / computed * (total - len(states))
                    notes.append(f"about {left:.0f} s left")
                line = f"{len(states)}/{total}  number {entry['number']}, {entry['name']}: {how}"
                print("; ".join([line, *notes]), file=stream, flush=True)
            else:
                bar.set_postfix_str(", ".join(notes), refresh=False)
                bar.update()

        yield ended


def table(entries: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """A row for each variation: number, parameters, scores, cluster, state and reason."""
    changes = dict.fromkeys(name for entry in entries for name in entry["changes"])
    scores = dict.fromkeys(name for entry in entries for name in entry["scores"])
    return [
        {
            "number": entry["number"],
            **{name: entry["changes"].get(name, "") for name in changes},
            **{name: entry["scores"].get(name) for name in scores},
            "cluster": cluster_name(entry["cluster"]) if entry["cluster"] >= 0 else "",
            "state": entry["state"] + (f": {entry['reason']}" if entry["reason"] else ""),
        }
        for entry in entries
    ]


def table_lines(entries: Sequence[Mapping[str, Any]]) -> list[str]:
    """The table as text in columns."""
    rows = table(entries)
    if not any(row["cluster"] for row in rows):
        rows = [{name: value for name, value in row.items() if name != "cluster"} for row in rows]
    cells = [list(rows[0]), *([cell_text(value) for value in row.values()] for row in rows)] if rows else []
    widths = [max(map(len, column)) for column in list(zip(*cells, strict=True))[:-1]]
    return ["  ".join([*(c.rjust(w) for c, w in zip(row, widths, strict=False)), row[-1]]).rstrip() for row in cells]


def cell_text(value: Any) -> str:
    """A value as a table shows it."""
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else short_text(str(value))


def tiles(entries: Sequence[Mapping[str, Any]], runs: Sequence[Run | None]) -> list[Tile]:
    """A tile of the contact sheet for each variation, with parameters and scores, or the reason of a failure."""
    found = []
    for entry, run in zip(entries, runs, strict=True):
        lines = [f"{name} {short_text(text)}" for name, text in entry["changes"].items()]
        lines += [f"{name} {cell_text(value)}" for name, value in entry["scores"].items()]
        note = "" if run else f"{entry['state']}: {entry['reason'] or 'it has not run'}"
        bodies = scored_bodies(list(entry["scores"]), run.info["bodies"]) if run else []
        found.append(Tile(str(entry["number"]), lines, run, note, entry["cluster"], bodies))
    return found


def scored_bodies(scores: Sequence[str], bodies: Sequence[str]) -> list[str]:
    """The names of bodies that scores' texts quote, as `upright("bear")` does; all where a score names none, since it
    may ask for any.
    """
    quoted = [[name for name in bodies if f'"{name}"' in text or f"'{name}'" in text] for text in scores]
    return list(bodies) if [] in quoted else list(dict.fromkeys(sum(quoted, [])))


def draw_results(
    wedge: Wedge, entries: Sequence[Mapping[str, Any]], sheet: bool, film: bool, apart: bool, facets: bool = False
) -> list[Path]:
    """Draw variations in their order; returns the files.

    Parameters
    ----------
    sheet : whether to draw sheet.png, and scatter.png where there are parameters and scores
    film : whether to write sheet.mp4
    apart : whether the sheet's pictures are also written as files, `tiles/NUMBER.png`
    facets : whether bodies that carry render meshes are drawn by their cells
    """
    from pdvol.studio.draw.plots import scatter_image  # matplotlib

    shown, files = entries[:MOST_TILES], list[Path]()
    drawn = tiles(shown, stored_runs(wedge.out, shown)) if sheet or film else []
    if sheet:
        files.append(sheet_image(drawn, wedge.out / "sheet.png", wedge.out / "tiles" if apart else None, facets))
        done = [entry for entry in entries if entry["state"] == "done"]
        names = dict.fromkeys(name for entry in done for name in entry["changes"])
        values = {name: [change(entry, name) for entry in done] for name in names}
        texts = dict.fromkeys(text for entry in done for text in entry["scores"])
        scores = {text: [entry["scores"].get(text) for entry in done] for text in texts}
        if values and scores:
            numbers = [str(entry["number"]) for entry in done]
            files.append(scatter_image(values, scores, numbers, wedge.out / "scatter.png"))
    if film:
        files.append(sheet_film(drawn, wedge.out / "sheet.mp4", facets))
    return files
