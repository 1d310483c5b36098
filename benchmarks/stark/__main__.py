"""pdvol beside STARK: both run the same scenes in turn on one machine, and their times are divided.

    ./run python -m benchmarks.stark --stark DIR [--scenes drop_500,balls] [--cores 2] [--repeats 3]

DIR is the folder that holds STARK's Python module `pystark`, built for the Python of `./run`. Both get the same mesh,
stiffness, time step, contact distance and stop criterion. Times are taken as by benchmarks.dense, with more cores by
the wall clock. The table is written between the markers of NOTES.md; rows that are not run again stay. The exit code is
0 when every run came to its end, 1 otherwise.
"""

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.common import commits, march, process
from benchmarks.common.process import REPOSITORY, Mistake
from benchmarks.common.rows import NAMES, ROWS, Row, chosen
from benchmarks.common.study import command
from benchmarks.common.tables import Kept, Page, number
from benchmarks.stark.shot import given
from pdvol.errors import PdvolError
from pdvol.measure.verify import signed_volumes
from pdvol.runs.scene_file import load_shot

USUAL = ("drop_500", "twist_1k", "twistx_1k", "twist_4k", "drop_4k", "blocks", "stack", "balls", "rollers", "octopus")
LIMIT = 1800.0
"""CPU seconds after which a run stops between two steps."""
SIDES = ("stark", "pdvol")
IMPORTING = 120.0
"""Seconds for an import of pystark."""
HEAD = [*march.HEAD, "smallest step of STARK [ms]", "inverted cells at the end"]
HEAD += ["last positions apart [mm]: median, most", "load", "measured at"]


@command(
    "stark",
    __doc__,
    {
        "--stark": {"type": Path, "metavar": "DIR", "help": "the folder that holds the built module pystark"},
        "--scenes": {**NAMES, "help": f"rows (default: {', '.join(USUAL)})"},
        "--cores": {"type": int, "default": 1, "help": "of each run: STARK's threads, pdvol's ranks (default: 1)"},
        "--repeats": {"type": int, "default": 3, "metavar": "N", "help": "runs of each (default: 3)"},
        "--peers": {"type": Path, "default": REPOSITORY.parent / "shared" / "peers", "help": "the peers' meshes"},
        "--out": {"type": Path, "default": REPOSITORY / "runs" / "stark", "help": "for stark.json, the records"},
        "--docs": {"type": Path, "default": Path(__file__).with_name("NOTES.md"), "help": "where the table is kept"},
    },
)
def main(options) -> int:
    """Runs the command; returns its exit code."""
    names = chosen(options.scenes, ROWS, USUAL)
    if options.repeats < 1:
        raise Mistake("--repeats needs a whole number from 1 on")
    if not (options.peers / "README.md").is_file():
        raise Mistake(f"--peers {options.peers} has no README.md; name the folder of the peers' meshes")
    study = "stark" if options.cores == 1 else f"stark_{options.cores}"
    page = Page(options.docs, study, "table")
    kept = Kept(options.out / f"{study}.json", ROWS, HEAD, cells, page)
    check_module(options.stark)
    at = {"commit": commits.Repository(REPOSITORY).head()[:7]}
    kept.run(names, lambda name: in_turn(ROWS[name], options) | at)
    return int(any(run["reason"] for name in names for side in SIDES for run in kept.rows[name][side]))


def check_module(folder: Path | None) -> None:
    """Raises Mistake where `folder` has no module pystark that this Python can import."""
    remedy = "name the folder that holds STARK's built module pystark"
    if folder is None:
        raise Mistake(f"--stark DIR is missing; {remedy}")
    if not (folder / "pystark" / "__init__.py").is_file():
        raise Mistake(f"--stark {folder} has no pystark/__init__.py; {remedy}")
    with tempfile.TemporaryDirectory(prefix="pdvol-stark-") as aside:
        log = Path(aside) / "import.log"
        reason = process.child([*with_stark(folder), "-c", "import pystark"], IMPORTING, log)
    if reason:
        version = ".".join(map(str, sys.version_info[:2]))
        raise Mistake(f"--stark {folder}: import pystark fails: {reason}; build it for Python {version}")


def with_stark(folder: Path, cores: int = 1) -> list[str]:
    """The start of a command: this Python, which finds pystark and the benchmarks."""
    path = f"PYTHONPATH={folder.resolve()}{os.pathsep}{REPOSITORY}"
    return ["env", path, f"OMP_NUM_THREADS={cores}", sys.executable]


# ---- runs


def in_turn(row: Row, options: argparse.Namespace) -> dict:
    """The records of a row, by system, how far their last positions are `apart` [m] (median, most) and the `load`."""
    peers = {"peers": str(options.peers.resolve())} if row.file.endswith("peers.py") else {}
    row = replace(row, settings=row.settings | peers, limit=LIMIT)
    steps, ends, loads = row.steps, {}, []
    with tempfile.TemporaryDirectory(prefix="pdvol-stark-") as aside:
        folder = Path(aside)
        meshes = given(load_shot(REPOSITORY / row.file, row.settings, steps).scene).meshes

        def by(side: str) -> dict:
            loads.append(os.getloadavg()[0])
            if side == "pdvol":
                record, ends[side] = by_pdvol(row, folder, steps, options.cores)
            else:
                record, ends[side] = by_stark(row, steps, meshes, options)
            return record

        records = march.in_turn({side: partial(by, side) for side in SIDES}, options.repeats)
    distances = march.distances(ends["stark"], ends["pdvol"]) if ends["stark"] and ends.get("pdvol") else None
    apart = None if distances is None else [float(np.median(distances)), float(np.max(distances))]
    return {**records, "apart": apart, "load": [min(loads), max(loads)]}


def by_stark(row: Row, steps: int, meshes: list, options: argparse.Namespace) -> tuple[dict, dict]:
    """The record of one run by STARK, and its last state."""
    with tempfile.TemporaryDirectory(prefix="pdvol-stark-") as folder:
        out = Path(folder) / "stark.npz"
        asked = {"file": str(REPOSITORY / row.file), "settings": row.settings, "steps": steps, "limit": row.limit}
        asked |= {"out": str(out), "cache": str(options.out.resolve() / "cache"), "cores": options.cores}
        words = ["-m", "benchmarks.stark.run_one", json.dumps(asked)]
        reason = process.child(
            [*with_stark(options.stark, options.cores), *words], 4.0 * row.limit, out.with_suffix(".log")
        )
        if not out.is_file():
            return {"reason": reason or "it left no result", "seconds": []}, {}
        with np.load(out) as arrays:
            found, last = json.loads(str(arrays["record"])), arrays["last"]
    offsets = np.cumsum([0, *(len(points) for points, _ in meshes)])
    cells = np.concatenate([cells + offset for (_, cells), offset in zip(meshes, offsets, strict=False)])
    ticks, rest = found.pop("ticks", []), np.concatenate([points for points, _ in meshes])
    found |= {"tick": float(np.mean(ticks)) if ticks and options.cores == 1 else 1.0, "vertices": len(rest)}
    state = {"rest": rest, "last": last, "cells": cells, "step": steps}
    return ended(found, steps, reason, state), state


def by_pdvol(row: Row, folder: Path, steps: int, ranks: int) -> tuple[dict, dict]:
    """The record of one run by pdvol, and its last state."""
    found = march.march(row, folder / "run", steps, ranks=ranks)
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


def cells(name: str, records: dict) -> list[list[str]]:
    """The cells of a row, STARK's figures first."""
    both = {side: records[side] for side in SIDES}
    compared = march.versus(ROWS[name].title, both)
    if any(run["reason"] for some in both.values() for run in some):
        return [[*compared, *[""] * 4, records["commit"]]]
    more = [
        number(1e3 * min(min(run["dt"]) for run in records["stark"]), 2),
        ", ".join(str(max(run["inverted"] for run in some)) for some in both.values()),
        ", ".join(number(1e3 * one, 2) for one in records["apart"] or ()),
        " to ".join(f"{load:.1f}" for load in records["load"]),
    ]
    return [[*compared, *more, records["commit"]]]


if __name__ == "__main__":
    sys.exit(main())
