"""What a user sees of a wedge: the table, the contact sheet, its film, and parameters against scores."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pdvol.store.reader import Run
from pdvol.studio.draw.layout import cluster_name
from pdvol.studio.wedge.wedge import Wedge, group, ordered


def default_sort(entries: Sequence[Mapping[str, Any]]) -> str:
    """The first score, or the number where there is none."""
    return next((name for entry in entries for name in entry["scores"]), "number")


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
    if not rows:
        return []
    cells = [list(rows[0]), *([cell_text(value) for value in row.values()] for row in rows)]
    if not any(row[-2] for row in cells[1:]):
        cells = [[*row[:-2], row[-1]] for row in cells]
    widths = [max(len(row[i]) for row in cells) for i in range(len(cells[0]) - 1)]
    return ["  ".join([*(c.rjust(w) for c, w in zip(row, widths, strict=False)), row[-1]]).rstrip() for row in cells]


def cell_text(value: Any) -> str:
    """A value as a table shows it."""
    if value is None:
        return "-"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def tiles(entries: Sequence[Mapping[str, Any]], runs: Sequence[Run | None]) -> list:
    """A tile of the contact sheet for each variation, with parameters and scores, or the reason of a failure."""
    from pdvol.studio.draw.sheet import Tile

    found = []
    for entry, run in zip(entries, runs, strict=True):
        lines = [f"{name} {text}" for name, text in entry["changes"].items()]
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


def write_results(
    wedge: Wedge, sort: str = "", sheet: bool = True, film: bool = False, apart: bool = False
) -> tuple[list[dict], list[Path]]:
    """Group the variations, draw what is wanted, and write wedge.json.

    Parameters
    ----------
    sheet : whether to draw sheet.png, and scatter.png where there are scores
    film : whether to write sheet.mp4
    apart : whether the sheet's pictures are also written as files of their own, `tiles/NUMBER.png`
    sort : as `ordered` takes it; `default_sort` where empty

    Returns
    -------
    entries, files
        Variations in order, and the files that were written.

    Raises
    ------
    InputError
        `sort` names nothing.
    """
    group(wedge.entries, wedge.runs(wedge.entries))
    entries = ordered(wedge.entries, sort or default_sort(wedge.entries))
    wedge.write()
    files = [wedge.file]
    if not entries or not (sheet or film):
        return entries, files
    from pdvol.studio.draw.sheet import MOST_TILES, sheet_image

    shown = entries[:MOST_TILES]
    drawn = tiles(shown, wedge.runs(shown))
    if sheet:
        files.append(sheet_image(drawn, wedge.out / "sheet.png", apart=wedge.out / "tiles" if apart else None))
        scatter = draw_scatter(wedge.out / "scatter.png", entries)
        files += [scatter] if scatter else []
    if film:
        from pdvol.studio.draw.sheet import sheet_film

        files.append(sheet_film(drawn, wedge.out / "sheet.mp4"))
    return entries, files


def draw_scatter(file: Path, entries: Sequence[Mapping[str, Any]]) -> Path | None:
    """Parameters against scores; None where there is none of either."""
    from pdvol.studio.draw.plots import scatter_image

    done = [entry for entry in entries if entry["state"] == "done"]
    names = dict.fromkeys(name for entry in done for name in entry["changes"])
    values = {name: [_number(entry["changes"].get(name, "")) for entry in done] for name in names}
    texts = dict.fromkeys(name for entry in done for name in entry["scores"])
    scores = {text: [entry["scores"].get(text) for entry in done] for text in texts}
    if not values or not scores:
        return None
    return scatter_image(values, scores, [str(entry["number"]) for entry in done], file)


def _number(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text
