"""Marches rows in processes of their own, in turn with one another, and compares the times of their steps.

A record is what one march left: `outcome`, `reason` and `tick` (the mean of what a fixed loop took after each step,
1 by the wall clock) [ms], and of the level that is timed `vertices`, lists with an entry for each step done (`seconds`,
`newton`, `linear`, `contacts`; `dt` where steps were cut) and `parts`, the seconds a step by part.
"""

import json
import shutil
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from statistics import fmean, median

import numpy as np

from benchmarks.common import process
from benchmarks.common.process import REPOSITORY
from benchmarks.common.rows import Row
from benchmarks.common.tables import number, table
from pdvol.errors import PdvolError
from pdvol.store.reader import open_run

PARTS = ("assembly", "contact", "ccd", "linear", "other")
RUNS, PATIENCE = 3, 60.0
"""Runs of a row on each side, and the seconds after which there are no more."""
HEAD = ["scene", "vertices", "steps (runs)", "times as fast (run by run)", "time a step [ms]", "tick [ms]"]
HEAD += ["Newton, mean (most)", "linear iterations a step"]
"""Of `versus`."""


def start(
    row: Row,
    out: Path,
    steps: int | None = None,
    code: Path = REPOSITORY,
    ranks: int = 1,
    hard: float | None = None,
    whole: bool = False,
) -> dict:
    """Marches a row into the run folder `out` with the package in `code`; what `run_one.py` wrote beside it.

    A process that lasts longer than `hard` seconds is ended. With `whole` all levels of the scene run.
    """
    shutil.rmtree(out, ignore_errors=True)
    out.with_suffix(".json").unlink(missing_ok=True)
    asked = {"code": str(code), "clock": "cpu" if ranks == 1 else "wall", "limit": row.limit, "out": str(out)}
    asked |= {"file": str(REPOSITORY / row.file), "settings": row.settings}
    asked |= {"steps": row.steps if steps is None else steps, "levels": None if whole else (0, row.level)}
    python = [sys.executable]
    if ranks > 1:  # mpi4py's own runner ends all ranks when one of them fails alone
        python = [shutil.which("mpirun") or "mpirun", "-n", str(ranks), sys.executable, "-m", "mpi4py"]
    script = Path(__file__).with_name("run_one.py")
    command = ["env", f"PYTHONPATH={code}", *python, str(script), json.dumps(asked)]
    reason = process.child(command, hard or 3.0 * row.limit + 600.0, out.with_suffix(".log"))
    if out.with_suffix(".json").is_file():
        return json.loads(out.with_suffix(".json").read_text())
    outcome = "hang" if reason.startswith("ended after") else "traceback"
    return {"outcome": outcome, "reason": reason, "seconds": [], "ticks": []}


def march(row: Row, out: Path, steps: int | None = None, code: Path = REPOSITORY, ranks: int = 1) -> dict:
    """The record of one march."""
    noted = start(row, out, steps, code, ranks)
    record = {"outcome": noted["outcome"], "reason": noted["reason"], "seconds": []}
    record["tick"] = fmean(noted["ticks"]) if noted["ticks"] and ranks == 1 else 1.0
    try:
        level = open_run(out).levels[row.level]
        log = [entry for entry in level.log if entry["step"] < level.steps]
    except (PdvolError, IndexError) as error:
        return record | {"reason": record["reason"] or str(error)}
    if not log:
        return record | {"reason": record["reason"] or "no step was done"}
    seconds = noted["seconds"][-len(log) :]
    scale = sum(seconds) / sum(entry["seconds"]["total"] for entry in log)  # the log has wall-clock time
    return {
        **record,
        "seconds": seconds,
        "vertices": len(level.rest),
        "parts": {part: scale * fmean(entry["seconds"].get(part, 0.0) for entry in log) for part in PARTS},
        "newton": [entry["newton_iterations"] for entry in log],
        "linear": [entry["linear_iterations"] for entry in log],
        "contacts": [entry["contacts"] for entry in log],
    }


def end(path: Path, level: int = 0) -> dict:
    """The last state of a level: `rest` and `last` positions (n, d) [m], `cells`, `step` and the run's `diagonal`."""
    run = open_run(path)
    found = run.levels[level]
    step = found.steps - 1
    state = {"rest": found.rest, "last": found.positions(step), "cells": found.cells}
    return {**state, "step": step, "diagonal": run.info["diagonal"]}


def distances(one: Mapping, other: Mapping) -> np.ndarray | None:
    """(n,) [m] between two last states; None where they are not of one mesh and step."""
    same = one["step"] == other["step"] and np.shape(one["rest"]) == np.shape(other["rest"])
    if not (same and np.allclose(one["rest"], other["rest"])):
        return None
    return np.linalg.norm(one["last"] - other["last"], axis=1)


# ---- in turn


def in_turn(sides: Mapping[str, Callable[[], dict]], runs: int = RUNS) -> dict[str, list[dict]]:
    """The records of each side: up to `runs`, fewer once they have taken `PATIENCE` seconds together or one failed."""
    found: dict[str, list[dict]] = {side: [] for side in sides}
    for _ in range(runs):
        for side, run in sides.items():
            spent = sum(sum(record["seconds"]) for record in found[side])
            if spent < PATIENCE and not any(record["reason"] for record in found[side]):
                found[side].append(run())
    return found


def pace(record: dict, steps: int | None = None) -> float:
    """Seconds a step, of all steps or the first `steps`; the first one, with its set-up, only where it is alone. Where
    steps were cut, seconds for the longest step's time.
    """
    seconds = record["seconds"][:steps]
    dt = record.get("dt", [1.0] * len(seconds))[:steps]
    first = int(len(seconds) > 1)
    return sum(seconds[first:]) * max(dt) / sum(dt[first:])


def ratios(records: Sequence[Sequence[dict]]) -> tuple[float, list[float]]:
    """The first side's time over the last one's, in ticks, by which the speed of the core drops out: of the medians,
    and run by run. Steps that both have done count.
    """
    both = None
    if not any("dt" in record for side in records for record in side):
        both = min(len(record["seconds"]) for side in records for record in side)
    taken = [[pace(record, both) / record["tick"] for record in side] for side in (records[0], records[-1])]
    return median(taken[0]) / median(taken[1]), [a / b for a, b in zip(*taken, strict=False)]


def versus(title: str, sides: Mapping[str, Sequence[dict]]) -> list[str]:
    """The cells of a row that compares its sides, figures in the order of the sides; where a run failed, why."""
    failed = {side: record["reason"] for side, some in sides.items() for record in some if record["reason"]}
    if failed:
        reasons = "; ".join(f"{side}: {reason}" for side, reason in failed.items())
        return [title, "", "", reasons, *[""] * (len(HEAD) - 4)]
    records = list(sides.values())
    ratio, each = ratios(records)
    firsts = [some[0] for some in records]
    return [
        title,
        f"{firsts[-1]['vertices']:,}",
        f"{same(len(first['seconds']) for first in firsts)} ({same(len(some) for some in records)})",
        f"{number(ratio)} ({', '.join(number(one) for one in each)})",
        ", ".join(number(1e3 * median(pace(record) for record in some)) for some in records),
        ", ".join(f"{median(record['tick'] for record in some):.2f}" for some in records),
        ", ".join(f"{fmean(first['newton']):.1f} ({max(first['newton'])})" for first in firsts),
        ", ".join(number(fmean(first["linear"])) if first.get("linear") else "-" for first in firsts),
    ]


def same(values) -> str:
    """The values, or one where they are the same."""
    return ", ".join(f"{value:,}" for value in dict.fromkeys(values))


def by_part(rows: Mapping[str, Mapping[str, Sequence[dict]]]) -> str:
    """The table of milliseconds a step by part, of the first record of each side that has parts."""
    lines = []
    for title, sides in rows.items():
        split = [some[0]["parts"] for some in sides.values() if some and "parts" in some[0]]
        lines.append([title, *(", ".join(number(1e3 * one[part], 2) for one in split) for part in PARTS)])
    return table(["scene", *(f"{part} [ms]" for part in PARTS)], lines)
