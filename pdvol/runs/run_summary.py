"""What a run folder holds, as lines of text."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pdvol.errors import InputError
from pdvol.registry import INTERPOLANTS
from pdvol.runs.fingerprint import differences
from pdvol.runs.stage_lines import real_time
from pdvol.store.folder import require_scene
from pdvol.store.reader import Run

if TYPE_CHECKING:
    from pdvol.levels.hierarchy import Hierarchy


def run_summary(run: Run) -> list[str]:
    """What a run folder holds: method, levels, costs and held-back motions, one line each.

    Raises
    ------
    InputError
        The folder is damaged.
    """
    path, info = run.path, run.info
    require_scene(path, info)
    lines = [
        f"{info['scene']}: method {info['method']}, dt {run.dt:g} s, {info['steps']} steps, parameters"
        f" {info['parameters'] or 'as in the file'}"
    ]
    lines += info.get("mended", [])
    for level in run.levels:
        log = level.log
        line = (
            f"level {level.index}: {level.info['state']}, {len(level.rest):,} vertices, {max(level.steps - 1, 0)} steps"
        )
        if log:
            line += _cost(path, log, run.dt)
        if "reason" in level.info:
            line += f"; {level.info['reason']}"
        lines.append(line)
    lines += [
        f"render mesh of {mesh.name!r}: {len(mesh.points):,} vertices, {mesh.interpolant} weights"
        + (", with a texture" if mesh.texture else "")
        + "".join(f"; {note}" for note in mesh.notes)
        for mesh in run.render_meshes
    ]
    INTERPOLANTS.check(info["prolongation"])
    return [*lines, *solver_lines(run), *event_lines(run)]


def binding_lines(hierarchy: "Hierarchy") -> list[str]:
    """One line a finer level: how its vertices are bound to the level below, and the weights' size. Collective."""
    reports = {level: hierarchy.prolongation(level).report() for level in range(1, len(hierarchy))}
    return [
        f"levels {level - 1} -> {level}: {r['inside']:,} bound inside, {r['ray']:,} by ray, {r['neighbour']:,} by"
        f" neighbour, {r['islands']:,} on islands, {r['orphans']:,} orphans; {r['weights_per_point']:.3g} weights a"
        f" vertex, largest |weight| {r['largest_weight']:.3g}, ||P||_F {r['frobenius_norm']:.4g} (sqrt m ="
        f" {r['sqrt_points']:.4g}), ||P||_2 {r['two_norm']:.3g}"
        for level, r in reports.items()
    ]


def solver_lines(run: Run) -> list[str]:
    """A line for each change of the solver's settings in a run that has gone on with others."""
    try:
        return [
            f"solver settings from step {', '.join(map(str, now['from']))} of levels 0 to {len(now['from']) - 1} on: "
            + "; ".join(differences(before["settings"], now["settings"], "solver"))
            for before, now in pairwise(run.info.get("solvers", []))
        ]
    except (TypeError, KeyError) as error:
        raise InputError(f"{run.path / 'run.json'}: solvers is no list of settings; remove it") from error


def event_lines(run: Run) -> list[str]:
    """Where contact held scripted motions back, and where springs of attachments broke, a line each per level."""
    lines = []
    for level in run.levels:
        short = [r for r in level.log if r.get("reached", 1.0) < 1.0]
        if short:
            least = min(short, key=lambda r: r["reached"])
            end = level.log[-1].get("behind", 0.0)
            lines.append(
                f"level {level.index}: contact held scripted motions back in {len(short)} of {len(level.log)} steps,"
                f" first in step {short[0]['step']}; least fraction of a step {least['reached']:.2g} (step"
                f" {least['step']}), " + (f"{end:.3g} s behind at the end" if end else "caught up at the end")
            )
        broken = [0, *(sum(len(of.get("broken", ())) for of in r.get("terms", {}).values()) for r in level.log)]
        if at := [r["step"] for r, (before, now) in zip(level.log, pairwise(broken), strict=True) if now > before]:
            lines.append(f"level {level.index}: {broken[-1]} springs of attachments broke in steps {at[0]} to {at[-1]}")
    return lines


def _cost(path: Path, log: Sequence[dict], dt: float) -> str:
    """The seconds, iterations and contacts of a level's steps."""
    try:
        seconds = np.array([float(r["seconds"]["total"]) for r in log])
        newton, contacts, cuts = ([int(r[key]) for r in log] for key in ("newton_iterations", "contacts", "cuts"))
        crossing = [int(r["intersections"]) for r in log if "intersections" in r]
    except (KeyError, TypeError, ValueError) as error:
        mend = "remove that line, the states do not depend on it"
        raise InputError(f"{path / 'log.jsonl'}: a record lacks what pdvol writes ({error}); {mend}") from error
    return (
        f", {seconds.sum():.1f} s ({np.median(seconds):.3g} s a step, {real_time(dt * len(log), seconds.sum())}),"
        f" Newton {np.mean(newton):.1f} (most {max(newton)}), contacts up to {max(contacts)}, cuts {sum(cuts)}"
        + (f", intersections {sum(crossing)} in {sum(c > 0 for c in crossing)} states" if crossing else "")
    )
