"""Trials: scenes that run under a limit of time, each in a process of its own, and the measures of their stored states.

States are checked by `pdvol verify`, which is independent of the solver; energies are summed here, from the
states and the log.
"""

import json
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from benchmarks.common import process
from pdvol.measure import verify
from pdvol.scene import Scene, metres
from pdvol.store.reader import Run, RunLevel, open_run

PATIENCE = 60.0
"""Seconds beyond the limit after which a step that does not end is taken to hang, and its process is ended."""


def trial(
    file: Path, name: str, seconds: float, hard: float, keep: Callable[[Path], None] | None = None, seed: int = 0
) -> dict:
    """The record of one scene. It is stopped between steps after `seconds`, and killed after `hard` seconds; `keep` is
    called with its run folder.
    """
    with tempfile.TemporaryDirectory(prefix=f"pdvol-{name}-") as folder:
        path = Path(folder) / "run"
        log = Path(folder) / "run.log"
        words = [str(file), name, str(path), str(seconds), *([str(seed)] if seed else [])]
        reason = process.child([sys.executable, "-m", "benchmarks.common.trial_one", *words], hard, log)
        file_noted = path.with_suffix(".json")
        if file_noted.is_file():
            noted = json.loads(file_noted.read_text())
        else:
            noted = {"outcome": "hang" if reason.startswith("ended after") else "traceback", "reason": reason}
        found = measured(path) if (path / "run.json").is_file() else {"levels": [], "problems": []}
        if keep is not None and (path / "run.json").is_file():
            keep(path)
    return {"name": name, **noted, **found}


def chosen(text: str, known) -> list[str]:
    """Names from names and beginnings of names, each once; all names when the text is empty."""
    names = []
    for word in filter(None, text.split(",")):
        fitting = [word] if word in known else [name for name in known if name.startswith(word)]
        if not fitting:
            raise process.Mistake(f"there is no {word!r}; choose from {', '.join(known)}")
        names += fitting
    return list(dict.fromkeys(names)) or list(known)


class Trials:
    """The trials of a table: records in the order of `known`, written to NAME.json and NAME.md in a folder, each as
    soon as it exists.

    Parameters
    ----------
    folder : made where it is missing; records of an earlier table there stay, but for those that are tried again
    name : of the two files
    known : names in order
    again : names that are tried again
    tabled : gives the table of records, as Markdown
    """

    def __init__(
        self, folder: Path, name: str, known: Iterable[str], again: list[str], tabled: Callable[[list[dict]], str]
    ):
        folder.mkdir(parents=True, exist_ok=True)
        self._json, self._markdown = folder / f"{name}.json", folder / f"{name}.md"
        self._order, self._tabled = list(known), tabled
        earlier = json.loads(self._json.read_text())["rows"] if self._json.is_file() else []
        self.result = {"machine": process.machine(), "rows": [row for row in earlier if row["name"] not in again]}

    @property
    def records(self) -> list[dict]:
        """All records."""
        return self.result["rows"]

    def add(self, record: dict, line: str) -> None:
        """Adds a record, and prints a line about it on stderr."""
        self.records.append(record)
        self.records.sort(key=lambda row: self._order.index(row["name"]))
        print(line, record["reason"], *record["problems"], file=sys.stderr, flush=True)
        self._json.write_text(json.dumps(self.result, indent=1) + "\n")
        self._markdown.write_text(str(self))

    def __str__(self) -> str:
        """The machine, the table, and the messages of trials that stopped or whose states are wrong."""
        lines = [f"Measured on {machine_line(self.result['machine'])}.", "", self._tabled(self.records), ""]
        lines += [
            f"- {record['name']}: {text}"
            for record in self.records
            for text in filter(None, [record["reason"], *record["problems"]])
        ]
        return "\n".join(lines) + "\n"


def measured(path: Path) -> dict:
    """The measures of a run folder: one record per level, and everything wrong with its states."""
    run = open_run(path)
    levels, problems = [], []
    for level, found in zip(run.levels, verify.check_levels(path), strict=True):
        problems += found.problems
        levels.append(
            {
                "level": level.index,
                "vertices": len(level.rest),
                "cells": len(level.cells),
                "steps": max(level.steps - 1, 0),
                "intersections": found.crossings,
                "det_f_min": finite(found.smallest_det),
                "plane_gap_min": finite(found.smallest_gap),
                "end": end(level),
                **figures(level.log),
                **energies(run, level),
            }
        )
    return {
        "dt": run.dt,
        "steps": run.info["steps"],
        "diagonal": run.info["diagonal"],
        "levels": levels,
        "problems": problems[:10],
    }


def lengths(scene: Scene, diagonal: float) -> dict:
    """dhat [m], eps_v [m/s] and Newton's tolerance [m/s] of a scene; None for what it does not have."""
    given = {"dhat": None, "eps_v": None, "tolerance": scene.solver.tolerance}
    for contact in scene.contact:
        given |= {key: getattr(contact, key) for key in ("dhat", "eps_v") if hasattr(contact, key)}
    return {key: None if value is None else metres(value, diagonal) for key, value in given.items()}


def end(level: RunLevel) -> list[float] | None:
    """The vertices' mean position [m] in the last state."""
    return level.positions(level.steps - 1).mean(axis=0).tolist() if level.steps else None


def figures(log: list[dict]) -> dict:
    """Sums, means and extremes of a level's log."""
    gaps = [record["min_gap"] for record in log if record["min_gap"] is not None]
    return {
        "gap_min": min(gaps, default=None),
        "contacts": spread(log, "contacts"),
        "newton": spread(log, "newton_iterations"),
        "cuts": sum(record["cuts"] for record in log),
        "reached_min": min((record["reached"] for record in log), default=1.0),
        "linear_solvers": sorted({record.get("linear_solver", "") for record in log}),
        "seconds": float(sum(record["seconds"]["total"] for record in log)),
        "memory_log_mb": max((record["peak_memory_mb"] for record in log), default=None),
    }


def spread(log: list[dict], key: str) -> dict:
    """Mean and largest."""
    values = [record[key] for record in log]
    return {"mean": float(np.mean(values)), "max": int(max(values))} if values else {"mean": None, "max": None}


def finite(value: float) -> float | None:
    """The value; None where there was nothing to measure."""
    return float(value) if np.isfinite(value) else None


# ---- energy


def energies(run: Run, level: RunLevel) -> dict:
    """Change of kinetic, elastic, load and barrier energy together over the run, and its largest rise from any step to
    a later one.

    Both are fractions of the largest kinetic energy or change of another kind, so that a body that only falls loses
    about nothing.
    """
    kinetic = np.array(
        [kinetic_energy(run, level, record["step"]) for record in level.log if record["step"] < level.steps]
    )
    if len(kinetic) < 2:
        return {"energy_change": None, "energy_rise": None}
    parts = {
        kind: np.array([record["energy"][kind] for record in level.log[: len(kinetic)]])
        for kind in ("elastic", "load", "barrier")
    }
    total = kinetic + sum(parts.values())
    scale = max(kinetic.max(), *(np.ptp(values) for values in parts.values()), 1e-300)
    rise = (total - np.minimum.accumulate(total)).max()
    return {"energy_change": float((total[-1] - total[0]) / scale), "energy_rise": float(rise / scale)}


def kinetic_energy(run: Run, level: RunLevel, step: int) -> float:
    """1/2 sum of m v^2 [J]."""
    return float(0.5 * lumped_masses(run, level) @ (level.velocities(step) ** 2).sum(axis=1))


def lumped_masses(run: Run, level: RunLevel) -> np.ndarray:
    """(n,) [kg], a quarter (third in 2D) of each cell's mass at each of its corners."""
    corners = level.rest[level.cells]
    dim = level.rest.shape[1]
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / (2.0 if dim == 2 else 6.0)
    density = np.array([body["material"]["density"] for body in run.info["description"]["bodies"]])[level.bodies]
    parts = np.repeat(density * volumes / (dim + 1), dim + 1)
    return np.bincount(level.cells.ravel(), weights=parts, minlength=len(level.rest))


# ---- tables


def sound(record: dict) -> bool:
    """Whether a trial ended as allowed: at its end, at its time limit or with a named error, with every state free of
    intersections and inversions.
    """
    return record["outcome"] in ("done", "time", "ConvergenceError", "InputError") and not record["problems"]


def number(value: float | None, digits: int = 2) -> str:
    """A number with a few digits; empty for None."""
    return "" if value is None else f"{value:.{digits}g}"


def machine_line(machine: dict) -> str:
    """The machine that the trials were measured on."""
    return f"{machine['processor']}, one of {machine['cores']} cores, one thread"
