"""Which numbers of the gallery are older than the solver: the quick levels of each run are simulated anew."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.common.tables import number, table
from demos.gallery.entries import Entry
from demos.gallery.shots import commits, costs, read_costs
from pdvol.runs.runner import Execution, run_scene
from pdvol.runs.scene_file import load_shot
from pdvol.store.reader import open_run

QUICK = 60.0
"""CPU time [s] of a level up to which it is simulated anew: all runs together then take a quarter of an hour."""
SCATTER = 0.05
"""Share of vertices, cells and iterations a step, without a unit: round-off and another processor change that many."""
MOVED = 0.02
"""Share of a level's size, without a unit: by less, centre and size differ where bodies bounce in another order."""
REMESHED = 3.0
"""Factor of these shares, without a unit, where cells differ: meshes of another processor changed iterations by 8 %."""


def table_of_ages(entries: Sequence[Entry], pages: Path) -> tuple[str, int]:
    """Markdown with a row a run, and how many runs have numbers that are older than the solver."""
    rows = [_row(each, kept) for entry in entries for each in entry.rows if (kept := read_costs(each, pages))]
    old = sum(row[-1] != "nothing" for row in rows)
    text = (
        f"{table(['run', 'made at', 'direct run made at', 'levels', 'older'], rows)}\n\n"
        f"{len(rows) - old} of {len(rows)} runs have the numbers of this solver; {old} have older ones."
    )
    return text, old


def _row(entry: Entry, kept: Mapping[str, Any]) -> list[str]:
    levels, direct = kept["levels"], kept["direct"][:1]  # level 0 has no ties
    last = max((i for i, each in enumerate(levels) if each["cpu"] * each["steps"] <= QUICK), default=0)
    with TemporaryDirectory() as folder:
        run_scene(load_shot(entry.file, entry.settings), Path(folder) / "run", last=last, how=Execution(xdmf=False))
        now = costs(open_run(Path(folder) / "run"))
    older = [
        f"level {one['level']}: {age}" for one, other in zip(levels, now, strict=False) if (age := _age(one, other))
    ]
    older += [f"by `--method direct`: {age}" for one in direct if (age := _age(one, now[0]))]
    made = commits(kept["made"]), commits(kept["made_directly"]) if direct else "-"
    return [entry.name, *made, f"0 to {last}", "; ".join(older) or "nothing"]


def _age(kept: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """How a level differs from what is kept of it; empty where it does not."""
    for name, share in (("vertices", SCATTER), ("cells", SCATTER), ("steps", 0.0)):
        if abs(kept[name] - now[name]) > share * now[name]:
            return f"{kept[name]:,} instead of {now[name]:,} {name}"
    factor = REMESHED if kept["cells"] != now["cells"] else 1.0
    if abs(kept["newton"] - now["newton"]) > factor * SCATTER * now["newton"]:
        return f"{number(kept['newton'])} instead of {number(now['newton'])} iterations a step"
    before, after = (np.array(level["motion"]) for level in (kept, now))
    apart = float(np.abs(before - after).max() / after[:, -1].max())
    return f"places {number(apart, 2)} of its size away" if apart > factor * MOVED else ""
