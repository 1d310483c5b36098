"""Trials: scenes that run under a limit of time, each in a process of its own, and the measures of their stored states.

States are checked by `pdvol verify`, which is independent of the solver; energies are summed here, from the
states and the log.
"""

import argparse
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from benchmarks.common import march
from benchmarks.common.rows import Row, chosen
from benchmarks.common.tables import Kept, number
from pdvol.geometry.level_mesh import lumped_masses
from pdvol.measure import verify
from pdvol.runs.stored_fields import stored_densities
from pdvol.store.reader import Run, RunLevel, open_run

PATIENCE = 60.0
"""Seconds beyond the limit after which a step that does not end is taken to hang, and its process is ended."""
HEAD = ["scene", "vertices", "cells", "dt [s]", "steps done", "outcome", "contacts mean (most)", "Newton mean (most)"]
HEAD += ["cuts", "smallest gap [m]", "smallest det F", "energy change", "energy rise", "time a step [s]", "memory [MB]"]
OUTCOMES = {"done": "full time", "time": "time limit", "hang": "ended by the clock"}


def run_all(
    study: str, file: str, known: Iterable[str], options: argparse.Namespace, seconds: float, keep=lambda name, path: ""
) -> int:
    """The exit code of a study whose scenes are those of `file`: runs those that `options.scenes` names, for so many
    CPU seconds each, and writes STUDY.json and STUDY.md into `options.out`.

    `keep` is called with a name and its run folder; what it returns stands below the table.
    """
    names = chosen(options.scenes, known)
    kept = Kept(options.out / f"{study}.json", known, HEAD, cells, around=lambda rows: ("", remarks(rows)))
    kept.run(names, lambda name: trial(Row(name, file, None, {"name": name}, limit=seconds), keep))
    return int(not all(sound(record) for record in kept.rows.values()))


def trial(row: Row, keep=lambda name, path: "") -> dict:
    """The record of one scene: stopped between steps after the row's limit, and killed at half of that more."""
    with tempfile.TemporaryDirectory(prefix="pdvol-trial-") as folder:
        path = Path(folder) / "run"
        noted = march.start(row, path, hard=1.5 * row.limit + PATIENCE, whole=True)
        found, note = {"levels": [], "problems": []}, ""
        if (path / "run.json").is_file():
            found, note = measured(path), keep(row.title, path)
    return {key: noted.get(key) for key in ("outcome", "reason", "peak_memory_mb")} | found | {"note": note}


def sound(record: dict) -> bool:
    """Whether a trial ended as allowed: at its end, at its time limit or with a named error, with every state free of
    intersections and inversions.
    """
    return record["outcome"] in ("done", "time", "ConvergenceError", "InputError") and not record["problems"]


def measured(path: Path) -> dict:
    """The measures of a run folder: one record per level that has begun, and everything wrong with its states."""
    run = open_run(path)
    levels, problems = [], []
    for level, found in zip(run.levels, verify.check_levels(path), strict=True):
        problems += found.problems
        if not level.log:
            continue
        column = lambda key, log=level.log: [record[key] for record in log if record[key] is not None]
        levels.append(
            {
                "level": level.index,
                "vertices": len(level.rest),
                "cells": len(level.cells),
                "steps": max(level.steps - 1, 0),
                "det_f_min": float(found.smallest_det) if np.isfinite(found.smallest_det) else None,
                "gap_min": min(column("min_gap"), default=None),
                "contacts": [float(np.mean(column("contacts"))), max(column("contacts"))],
                "newton": [float(np.mean(column("newton_iterations"))), max(column("newton_iterations"))],
                "cuts": sum(column("cuts")),
                "seconds": float(sum(record["seconds"]["total"] for record in level.log)),
                "memory": max(column("peak_memory_mb"), default=0.0),
                **energies(run, level),
            }
        )
    return {"dt": run.dt, "steps": run.info["steps"], "levels": levels, "problems": problems[:10]}


# ---- energy


def energies(run: Run, level: RunLevel) -> dict:
    """Change of kinetic, elastic, load and barrier energy together over the run, and its largest rise from any step to
    a later one.

    Both are fractions of the largest kinetic energy or change of another kind, so that a body that only falls loses
    about nothing.
    """
    own = masses(run, level)
    log = [record for record in level.log if record["step"] < level.steps]
    kinetic = np.array([0.5 * own @ (level.velocities(record["step"]) ** 2).sum(axis=1) for record in log])
    if len(kinetic) < 2:
        return {"energy_change": None, "energy_rise": None}
    parts = [np.array([record["energy"][kind] for record in log]) for kind in ("elastic", "load", "barrier")]
    total = kinetic + sum(parts)
    scale = max(kinetic.max(), *(np.ptp(values) for values in parts), 1e-300)
    rise = (total - np.minimum.accumulate(total)).max()
    return {"energy_change": float((total[-1] - total[0]) / scale), "energy_rise": float(rise / scale)}


def masses(run: Run, level: RunLevel) -> np.ndarray:
    """(n,) [kg], lumped."""
    return lumped_masses(level.mesh, stored_densities(run)[level.index])


# ---- the table


def remarks(rows: dict[str, dict]) -> str:
    """What stands below the table: the notes and messages of all trials."""
    said = [(name, text) for name, record in rows.items() for text in (record["note"], record["reason"])]
    said += [(name, text) for name, record in rows.items() for text in record["problems"]]
    return "\n".join(f"- {name}: {text}" for name, text in said if text)


def cells(name: str, record: dict) -> list[list[str]]:
    """The rows of one record, one per level."""
    outcome = OUTCOMES.get(record["outcome"], record["outcome"]) + (", states wrong" if record["problems"] else "")
    if not record["levels"]:
        return [[name, *[""] * 4, outcome, *[""] * (len(HEAD) - 6)]]
    several = len(record["levels"]) > 1
    return [
        [
            f"{name}, level {level['level']}" if several else name,
            f"{level['vertices']:,}",
            f"{level['cells']:,}",
            f"{record['dt']:g}",
            f"{level['steps']:,} of {record['steps']:,}",
            outcome,
            f"{level['contacts'][0]:.0f} ({level['contacts'][1]})",
            f"{level['newton'][0]:.1f} ({level['newton'][1]})",
            str(level["cuts"]),
            *(number(level[key], 2) for key in ("gap_min", "det_f_min", "energy_change", "energy_rise")),
            number(level["seconds"] / max(level["steps"], 1), 2),
            f"{record['peak_memory_mb'] or level['memory']:.0f}",
        ]
        for level in record["levels"]
    ]
