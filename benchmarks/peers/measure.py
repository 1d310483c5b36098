"""Measures of a finished (or interrupted) run, as JSON: `measure NAME RANKS PEERS RUN`.

Times are those of `log.jsonl`, without the first step where there are more: it contains the set-up, and the peers leave
theirs out. States are checked by `pdvol verify`, which is independent of the solver.
"""

import json
import sys
from pathlib import Path

import numpy as np

from benchmarks.peers import figures
from pdvol.measure import verify
from pdvol.store.reader import Run, RunLevel, open_run

SMALL = 10_000
"""Vertices from which on only every tenth state is searched for intersections."""


def measured(name: str, ranks: int, peers: Path, path: Path) -> dict:
    """The record of one run: figures of its finest level that has begun, a summary of the coarser ones, and the
    comparison with the peers.

    Where no step was finished it holds only the number of steps, 0.
    """
    run, noted = open_run(path), _noted(path)
    begun = [level for level in run.levels if level.steps > 1 and level.log]
    if not begun:
        return {"steps": 0}
    level = begun[-1]
    coarser = [{"level": one.index, **sizes(one), **speed(one, ranks)} for one in begun[:-1]]
    return {
        "level": level.index,
        "steps": level.steps - 1,
        "done": run.info["state"] == "done",
        **sizes(level),
        **speed(level, ranks),
        **memory(level, noted),
        **stored(level, noted),
        **soundness(run, level),
        **against_peers(name, ranks, peers, level),
        "coarser": coarser,
        "versions": run.info["versions"],
    }


def _noted(path: Path) -> dict:
    """What run_one.py wrote beside the run; empty when it was killed before."""
    file = path.with_suffix(".json")
    return json.loads(file.read_text()) if file.is_file() else {}


def sizes(level: RunLevel) -> dict:
    """Vertices and tetrahedra."""
    return {"vertices": len(level.rest), "tets": len(level.cells)}


# ---- speed


def timed(level: RunLevel) -> list[dict]:
    """The log's records that times are taken from: all but the first step, where there are more."""
    return level.log[1:] or level.log


def speed(level: RunLevel, ranks: int) -> dict:
    """Seconds and iterations per step."""
    log, counted = level.log, timed(level)
    seconds = [record["seconds"]["total"] for record in counted]
    newton = sum(record["newton_iterations"] for record in counted)
    parts = sorted({part for record in counted for part in record["seconds"]} - {"total", "cpu"})
    return {
        "seconds": spread(seconds),
        "seconds_first_step": log[0]["seconds"]["total"] if log else None,
        "seconds_without_contact": mean(s for s, r in zip(seconds, counted, strict=True) if not r["contacts"]),
        "seconds_with_contact": mean(s for s, r in zip(seconds, counted, strict=True) if r["contacts"]),
        "seconds_per_newton": sum(seconds) / newton if newton else None,
        "seconds_by_part": {part: mean(record["seconds"].get(part, 0.0) for record in counted) for part in parts},
        "newton": spread([record["newton_iterations"] for record in log]),
        "linear": spread([record["linear_iterations"] for record in log]),
        "linear_solvers": sorted({record.get("linear_solver", "") for record in log}),
        "contacts_max": max((record["contacts"] for record in log), default=0),
        "cuts": sum(record["cuts"] for record in log),
        "reached_min": min((record["reached"] for record in log), default=1.0),
    }


def spread(values: list) -> dict:
    """Mean, median and largest."""
    if not values:
        return dict.fromkeys(("mean", "median", "max"))
    return {"mean": mean(values), "median": float(np.median(values)), "max": float(max(values))}


def mean(values) -> float | None:
    """Their mean; None where there are no values."""
    values = list(values)
    return float(np.mean(values)) if values else None


def memory(level: RunLevel, noted: dict) -> dict:
    """Peak memory [MB] of the largest process from start to end, of all ranks together, and of the largest one at its
    last step (`log.jsonl`).
    """
    ranks = noted.get("peak_memory_mb") or [None]
    whole = None not in ranks
    return {
        "memory_mb": max(ranks) if whole else None,
        "memory_all_ranks_mb": sum(ranks) if whole else None,
        "memory_log_mb": max((record["peak_memory_mb"] for record in level.log), default=None),
    }


def stored(level: RunLevel, noted: dict) -> dict:
    """Wall-clock seconds of a step with its storage: of all steps, of those without and with contact; and of the whole
    process from its imports on.
    """
    steps = list(
        zip(
            noted.get("stored", {}).get(str(level.index), []),
            (record["contacts"] for record in level.log),
            strict=False,
        )
    )
    steps = steps[1:] or steps
    return {
        "seconds_with_storage": {
            "mean": mean(s for s, _ in steps),
            "without_contact": mean(s for s, contacts in steps if not contacts),
            "with_contact": mean(s for s, contacts in steps if contacts),
        },
        "wall_seconds": noted.get("wall_seconds"),
    }


# ---- states


def soundness(run: Run, level: RunLevel) -> dict:
    """Smallest det F and inverted cells of all states; intersections and depths below planes of the states searched;
    vertices of a ball that came through a slab.
    """
    every = 1 if len(level.rest) < SMALL or level.steps <= 10 else 10
    facets, rest = verify.boundary(level.cells), verify.signed_volumes(level.rest, level.cells)
    found = verify.LevelFindings(level.index)
    smallest, inverted, through = np.inf, 0, 0
    for step in range(level.steps):
        positions = level.positions(step)
        ratio = verify.signed_volumes(positions, level.cells) / rest
        smallest, inverted = min(smallest, float(ratio.min())), inverted + int((~(ratio > 0)).sum())
        through += come_through(run, level, positions)
        if step % every == 0 or step == level.steps - 1:
            planes = [(o.name, *o.plane(step)) for o in run.obstacles if o.kind == "plane"]
            verify.check_state(found, step, level.rest, level.cells, facets, positions, planes)
    gap = found.smallest_gap if np.isfinite(found.smallest_gap) else None
    return {
        "det_f_min": smallest,
        "inverted": inverted,
        "intersections": found.crossings,
        "states_searched": found.steps,
        "plane_gap_min": gap,
        "through": through,
        "problems": found.problems[:5],
    }


def come_through(run: Run, level: RunLevel, positions: np.ndarray) -> int:
    """Vertices of a body `ball` that are below a `slab`, whatever its shape: 0 in scenes without them.

    The slab is held at its rim. Below its rest position a vertex that has not come through lies within the dent,
    between where the slab's upper side was and where it is: there, and only there, that pair of surfaces winds round
    it.
    """
    names = run.info["bodies"]
    if "slab" not in names:
        return 0
    ball, slab = (np.unique(level.cells[level.bodies == names.index(name)]) for name in ("ball", "slab"))
    top = level.rest[slab, 1].max()
    faces = level.surface[
        (level.rest[level.surface][:, :, 1] > top - 1e-9).all(1) & np.isin(level.surface, slab).all(1)
    ]
    below = positions[ball][positions[ball][:, 1] < top]
    winding = (solid_angles(below, positions[faces]) - solid_angles(below, level.rest[faces])) / (4.0 * np.pi)
    return int((np.abs(winding) < 0.5).sum())


def solid_angles(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Solid angle [sr] that triangles (m, 3, 3) together take up as seen from points (n, 3) (Van Oosterom and
    Strackee).
    """
    a, b, c = (triangles[None, :, k] - points[:, None] for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=2) for v in (a, b, c))
    top = np.einsum("ijk,ijk->ij", a, np.cross(b, c))
    bottom = la * lb * lc + (a * b).sum(2) * lc + (b * c).sum(2) * la + (c * a).sum(2) * lb
    return 2.0 * np.arctan2(top, bottom).sum(1)


# ---- peers


def against_peers(name: str, ranks: int, peers: Path, level: RunLevel) -> dict:
    """Per peer: its seconds per step on as many threads, how many times slower that is, and how far our state is from
    its last one.
    """
    result = {}
    for peer in ("stark", "ipc"):
        steps = figures.steps(name, peer)
        its = figures.SECONDS.get(name, {}).get(peer, {})
        ours = mean(record["seconds"]["total"] for record in timed(level) if record["step"] <= steps)
        whole = level.steps > steps and ranks in its  # the cheap first steps of a scene do not represent all of it
        result[peer] = {
            "seconds": its,
            "newton": figures.NEWTON.get(name, {}).get(peer),
            "ratio": its[ranks] / ours if whole else None,
            "seconds_over_same_steps": ours,
            **difference(name, peer, peers, level, steps),
        }
    return result


def difference(name: str, peer: str, peers: Path, level: RunLevel, step: int) -> dict:
    """RMS and largest distance [m] at `step` to the peer's last state; empty where there is none, or ours has not come
    so far.
    """
    path = peers / "final_states" / f"{name}.npz"
    if not path.is_file() or step >= level.steps:
        return {}
    with np.load(path) as arrays:
        bodies = [arrays[key] for key in sorted(arrays) if key.startswith(f"{peer}_")]
    if not bodies:
        return {}
    distance = np.linalg.norm(level.positions(step) - np.vstack(bodies), axis=1)
    return {"rms_m": float(np.sqrt((distance**2).mean())), "max_m": float(distance.max())}


if __name__ == "__main__":
    json.dump(measured(sys.argv[1], int(sys.argv[2]), Path(sys.argv[3]), Path(sys.argv[4])), sys.stdout)
