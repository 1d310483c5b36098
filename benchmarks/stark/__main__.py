"""pdvol beside STARK: both run the same scenes in turn on one machine, and their times are divided.

    ./run python -m benchmarks.stark --stark DIR [--scenes drop_500,balls | --all] [--repeats 3]

DIR is the folder that holds STARK's Python module `pystark`, built for the Python of `./run`. Each scene is run by
STARK and by pdvol alternately, each run in a process of its own with one thread. Both get the same mesh, stiffness,
time step, contact distance and stop criterion. Seconds are CPU seconds (user and system) of the steps, without
start-up, storage and the first step, so that other work on the machine hardly counts. They are divided by the tick,
the time of a fixed loop between the steps: a core of a shared host runs at its best or at half of that.

The table is written between the markers of NOTES.md; rows that are not run again stay. The exit code is 0
when every run came to its end, 1 otherwise, and 2 for a wrong command line.
"""

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.common import commits, march, process
from benchmarks.common.process import REPOSITORY
from benchmarks.common.rows import ROWS, Row, chosen
from benchmarks.common.tables import Kept, Page, number, table
from benchmarks.stark import shot
from pdvol.errors import PdvolError
from pdvol.measure.verify import signed_volumes
from pdvol.runs.scene_file import load_shot

USUAL = ("drop_500", "twist_1k", "twistx_1k", "twist_4k", "drop_4k", "blocks", "stack", "balls", "rollers")
LONG = (*USUAL, "twist_20k", "drop_20k")
LIMIT = 1800.0
"""CPU seconds after which a run stops between two steps."""
IMPORTING = 120.0
"""Seconds for an import of pystark."""
HEAD = [
    *march.HEAD,
    "smallest step of STARK [ms]",
    "inverted cells at the end",
    "last positions apart [mm]: median, most",
]
HEAD += ["load", "measured at"]


def main(words: list[str] | None = None) -> int:
    """Runs the command; returns its exit code."""
    parser = process.parser("stark", __doc__)
    add, shared = parser.add_argument, REPOSITORY.parent / "shared" / "peers"
    add("--stark", type=Path, metavar="DIR", help="the folder that holds the built module pystark")
    add("--scenes", default="", metavar="NAME,...", help=f"rows (default: {', '.join(USUAL)})")
    add("--all", action="store_true", help="the rows of 20,000 vertices, too")
    add("--repeats", type=int, default=3, metavar="N", help="runs of each (default: 3)")
    add("--steps", type=int, help="so many steps at most, instead of each row's own")
    add("--peers", type=Path, default=shared, metavar="DIR", help="the peers' meshes")
    add("--out", type=Path, default=REPOSITORY / "runs" / "stark", metavar="DIR", help="for stark.json, the records")
    page = Path(__file__).with_name("NOTES.md")
    add("--docs", type=Path, default=page, metavar="FILE", help="where the table is kept")
    options = parser.parse_args(words)
    try:
        names = chosen(options.scenes, ROWS, LONG if options.all else USUAL)
        if options.repeats < 1 or (options.steps or 2) < 2:
            raise process.Mistake("--repeats needs a whole number from 1 on, --steps one from 2 on")
        if not (options.peers / "README.md").is_file():
            raise process.Mistake(f"--peers {options.peers} has no README.md; name the folder of the peers' meshes")
        kept = Kept(options.out / "stark.json", ROWS, tabled, Page(options.docs, "stark", "table"))
        check_module(options.stark)
        commit = commits.Repository(REPOSITORY).head()[:7]
    except (process.Mistake, commits.MissingObject, OSError) as error:
        print(f"benchmarks.stark: {error}", file=sys.stderr)
        return 2
    ended_well = True
    for name in names:
        records = in_turn(ROWS[name], options) | {"commit": commit}
        ended_well &= not any(run["reason"] for run in (*records["stark"], *records["pdvol"]))
        kept.add(name, records)
        print(" | ".join(cells(name, records)), file=sys.stderr, flush=True)
    print(kept)
    return int(not ended_well)


def check_module(folder: Path | None) -> None:
    """Raises Mistake where `folder` has no module pystark that this Python can import."""
    remedy = "name the folder that holds STARK's built module pystark"
    if folder is None:
        raise process.Mistake(f"--stark DIR is missing; {remedy}")
    if not (folder / "pystark" / "__init__.py").is_file():
        raise process.Mistake(f"--stark {folder} has no pystark/__init__.py; {remedy}")
    with tempfile.TemporaryDirectory(prefix="pdvol-stark-") as aside:
        log = Path(aside) / "import.log"
        reason = process.child([*with_stark(folder), "-c", "import pystark"], IMPORTING, log)
    if reason:
        version = ".".join(map(str, sys.version_info[:2]))
        raise process.Mistake(f"--stark {folder}: import pystark fails: {reason}; build it for Python {version}")


def with_stark(folder: Path) -> list[str]:
    """The start of a command: this Python, which finds pystark and the benchmarks."""
    return ["env", f"PYTHONPATH={folder.resolve()}{os.pathsep}{REPOSITORY}", sys.executable]


# ---- runs


def in_turn(row: Row, options: argparse.Namespace) -> dict:
    """The records of a row, by system, how far their last positions are `apart` [m] (median, most) and the `load`."""
    peers = {"peers": str(options.peers.resolve())} if row.file.endswith("peers.py") else {}
    row = replace(row, settings=row.settings | peers, limit=LIMIT)
    steps, ends, loads = min(options.steps or row.steps, row.steps), {}, []
    with tempfile.TemporaryDirectory(prefix="pdvol-stark-") as aside:
        folder = Path(aside)
        shot.write(load_shot(REPOSITORY / row.file, row.settings, steps).scene, folder / "shot.npz")

        def theirs() -> dict:
            loads.append(os.getloadavg()[0])
            record, ends["stark"] = by_stark(options.stark, folder, options.out.resolve() / "cache", steps)
            return record

        def ours() -> dict:
            loads.append(os.getloadavg()[0])
            record, ends["pdvol"] = by_pdvol(row, folder, steps)
            return record

        records = march.in_turn({"stark": theirs, "pdvol": ours}, options.repeats)
    distances = march.distances(ends["stark"], ends["pdvol"]) if ends["stark"] and ends.get("pdvol") else None
    apart = None if distances is None else [float(np.median(distances)), float(np.max(distances))]
    return {**records, "apart": apart, "load": [min(loads), max(loads)]}


def by_stark(stark: Path, folder: Path, cache: Path, steps: int) -> tuple[dict, dict]:
    """The record of one run by STARK, and its last state."""
    out = folder / "stark.npz"
    out.unlink(missing_ok=True)
    words = ["-m", "benchmarks.stark.run_one", folder / "shot.npz", out, cache, LIMIT]
    reason = process.child([*with_stark(stark), *map(str, words)], 4.0 * LIMIT, folder / "stark.log")
    if not out.is_file():
        return {"reason": reason or "it left no result", "seconds": []}, {}
    with np.load(out) as arrays:
        found, last = json.loads(str(arrays["record"])), arrays["last"]
    with np.load(folder / "shot.npz") as arrays:
        bodies = [name.partition("_")[2] for name in arrays if name.startswith("points_")]
        meshes = [(arrays[f"points_{k}"], arrays[f"cells_{k}"]) for k in bodies]
    offsets = np.cumsum([0, *(len(points) for points, _ in meshes)])
    rest = np.concatenate([points for points, _ in meshes])
    cells = np.concatenate([cells + offset for (_, cells), offset in zip(meshes, offsets, strict=False)])
    ticks = found.pop("ticks", [])
    found |= {"tick": float(np.mean(ticks)) if ticks else 1.0, "vertices": len(rest)}
    state = {"rest": rest, "last": last, "cells": cells, "step": steps}
    return ended(found, steps, reason, state), state


def by_pdvol(row: Row, folder: Path, steps: int) -> tuple[dict, dict]:
    """The record of one run by pdvol, and its last state."""
    found = march.march(row, folder / "run", steps)
    try:
        state = march.end(folder / "run")
    except PdvolError:
        return found, {}
    return ended(found, steps, found["reason"], state), state


def ended(found: dict, steps: int, reason: str, state: Mapping) -> dict:
    """The record of a run, with the cells that were `inverted` at its end, and what was wrong with it."""
    taken = found.get("dt", [1.0] * len(found["seconds"]))
    done = sum(taken) / max(taken) if taken else 0.0
    if not reason and round(done) < steps:
        reason = f"stopped after {done:.0f} of {steps} steps and {sum(found['seconds']):.0f} s"
    volumes = (signed_volumes(state[key], state["cells"]) for key in ("last", "rest"))
    return {**found, "reason": reason, "inverted": int(np.count_nonzero(~(np.divide(*volumes) > 0)))}


# ---- the table


def cells(name: str, records: dict) -> list[str]:
    """The cells of a row, STARK's figures first."""
    both = {"stark": records["stark"], "pdvol": records["pdvol"]}
    compared = march.versus(ROWS[name].title, both)
    if any(run["reason"] for some in both.values() for run in some):
        return [*compared, *[""] * 4, records["commit"]]
    return [
        *compared,
        number(1e3 * min(min(run["dt"]) for run in records["stark"]), 2),
        ", ".join(str(max(run["inverted"] for run in some)) for some in both.values()),
        ", ".join(number(1e3 * one, 2) for one in records["apart"] or ()),
        " to ".join(f"{load:.1f}" for load in records["load"]),
        records["commit"],
    ]


def tabled(rows: dict) -> str:
    """The table of all rows that were run."""
    return table(HEAD, [cells(name, records) for name, records in rows.items()])


if __name__ == "__main__":
    sys.exit(main())
