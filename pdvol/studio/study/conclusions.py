"""What a study says: the reference's own error, the scene's spread, the front, orders, and sentences for users."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from pdvol.geometry.level_mesh import LevelMesh
from pdvol.store.reader import Run, open_run
from pdvol.studio.study.front import LEAST_DIFFERENCES, cheapest_within, fitted_order, on_front, richardson
from pdvol.studio.study.plan import STRICTER, Plan
from pdvol.studio.study.reference import ReferenceStates
from pdvol.studio.wedge.variation import Variation, length, number

SHOWN_ORDER = 3  # values of an axis from which on their differences are shown
CHAOTIC = 10.0  # times by which jitter may grow until the end: more, and the end follows from chance
MESH_ORDER = 2.0  # of displacements in the mesh size, with linear elements
# Order of the error at the end in the time step, a pure number: second order smears the waves of an impact over a width
# of this order, and their energy is lost. Over 14 random shots half the step left 0.25 to 1.17 of the last difference,
# median 0.67.
TIME_ORDER = 2.0 / 3.0
SHARES = (0.01, 0.03)  # of the size: accuracies of the sentences


def conclusions(
    result: Mapping[str, Any],
    reference: Variation,
    states: ReferenceStates,
    plan: Plan,
    folder: Callable[[Variation], Path],
    levels: int,
) -> dict:
    """`reference`, `spread`, `orders`, `default`, `levels_not_run`, `sentences`, for study.json; marks the points on
    the front.

    Parameters
    ----------
    result : what study.json has so far
    reference : whose run `states` holds
    folder : the run folder of a variation
    levels : of the scene, their number
    """
    points = result["points"]
    same = [point["errors"]["outcome"] for point in points]
    front = on_front([p["cost"]["cpu"] for p in points], [p["errors"]["end"] for p in points])
    for point, kept in zip(points, front, strict=True):
        point["front"] = kept
    known = _reference(reference, states, plan, folder)
    spread = _spread(states, plan, folder)
    default = next((p for p in points if p["run"] == plan.base.name and p["level"] == plan.last), None)
    found = {
        "reference": known,
        "spread": spread,
        "orders": _orders(result, states, plan, folder),
        "default": default,
        "same_outcome": sum(same),
        "levels_not_run": list(range((plan.last or 0) + 1, levels)),
    }
    return {**found, "sentences": sentences(points, found, result["size"])}


def _reference(reference: Variation, states: ReferenceStates, plan: Plan, folder: Callable[[Variation], Path]) -> dict:
    """The reference and its own error [m], by parts: time step, tolerance, and, beside them, the finest mesh."""
    last = plan.last or 0

    def apart(*variations: Variation) -> float | None:
        if any(plan.done.get(v, -1) < last for v in variations):
            return None
        one, other = ((open_run(folder(v)), last) for v in variations)
        return states.apart(one, other)[0]

    parts: dict[str, float | None] = {}
    second = plan.second_reference()
    difference = None if second is None else apart(reference, second)
    parts["dt"] = None if difference is None else richardson(difference, 2.0, TIME_ORDER)
    tolerances = [
        v
        for axis in plan.axes
        if axis.name == "tolerance"
        for v in axis.variations(plan.method)
        if number(v.changes[0][1]) == number(dict(reference.changes).get("tolerance"))
    ]
    if tolerances:
        difference = apart(plan.base, tolerances[0])
        parts["tolerance"] = None if difference is None else richardson(difference, 1.0 / STRICTER, 1.0)
    known = [part for part in parts.values() if part is not None]
    mesh = None
    if last > 0:
        run = _alone(plan, folder)
        coarse, fine = (_mesh_size(run.levels[level].mesh) for level in (last - 1, last))
        mesh = richardson(states.apart((run, last), (run, last - 1))[0], coarse / fine, MESH_ORDER)
    return {
        "run": reference.name,
        **reference.as_json(),
        "level": last,
        "parts": parts,
        "error": sum(known) if parts["dt"] is not None else None,
        "mesh": mesh,
    }


def _spread(states: ReferenceStates, plan: Plan, folder: Callable[[Variation], Path]) -> dict | None:
    """How far jittered starts of level 0 end apart [m]; None where none ran."""
    ends = []
    base = (open_run(folder(plan.base)), 0)
    for variation in plan.jitters:
        if variation in plan.done:
            ends.append(states.apart(base, (open_run(folder(variation)), 0))[0])
    if not ends:
        return None
    jitter = plan.speed * states.duration
    growth = max(ends) / jitter
    return {"jitter": jitter, "end": max(ends), "growth": growth, "chaotic": growth > CHAOTIC, "runs": len(ends)}


def _orders(
    result: Mapping[str, Any], states: ReferenceStates, plan: Plan, folder: Callable[[Variation], Path]
) -> list[dict]:
    """Fitted orders of each axis of numbers at the finest level, and of the mesh size, from differences [m]."""
    found = []
    last = plan.last or 0
    for axis in plan.axes:
        series = [
            (number(dict(v.changes).get(axis.name, axis.base)), v)
            for v in (plan.base, *axis.variations(plan.method))
            if plan.done.get(v, -1) >= last
        ]
        numbers = sorted(((value, v) for value, v in series if value), key=lambda entry: entry[0])
        if len(numbers) < SHOWN_ORDER or len(numbers) < len(series):
            continue
        finest = (open_run(folder(numbers[0][1])), last)
        rest = [(value, states.apart((open_run(folder(v)), last), finest)[0]) for value, v in numbers[1:]]
        found.append(_fit(axis.name, numbers[0][0], rest))
    if last >= SHOWN_ORDER - 1:
        run = _alone(plan, folder)
        sizes = [_mesh_size(run.levels[level].mesh) for level in range(last, -1, -1)]
        rest = [(size, states.apart((run, last - k), (run, last))[0]) for k, size in enumerate(sizes) if k]
        # Interpolation from the next coarser mesh adds to its difference, but has no part at the finest one.
        found.append(_fit("mesh size", sizes[0], rest, skipped=1))
    return found


def _alone(plan: Plan, folder: Callable[[Variation], Path]) -> Run:
    """The run of levels simulated alone, which shows the mesh's order; the scene's own settings where there is none."""
    alone = Variation(method="direct")
    return open_run(folder(alone if plan.done.get(alone, -1) >= (plan.last or 0) else plan.base))


def _mesh_size(mesh: LevelMesh) -> float:
    """[m] of a cell: the root of the mean volume."""
    return float(mesh.volumes.mean() ** (1.0 / mesh.dim))


def _fit(name: str, finest: float, rest: Sequence[tuple[float, float]], skipped: int = 0) -> dict:
    """The order of the finest values, after the ones skipped; None where these are too few."""
    fitted = list(range(skipped, min(skipped + LEAST_DIFFERENCES, len(rest))))
    values, differences = [rest[i][0] for i in fitted], [rest[i][1] for i in fitted]
    order = fitted_order(values, differences, finest)
    return {"axis": name, "finest": finest, "values": rest, "fitted": fitted, "order": order}


def sentences(points: Sequence[Mapping], found: Mapping[str, Any], size: float) -> list[str]:
    """What a user wants to know, one sentence each."""
    reference, spread, default = found["reference"], found["spread"], found["default"]
    own = float("inf") if reference["error"] is None else reference["error"]
    # Differences below the spread follow from chance: errors that small are the same.
    spread_end = 0.0 if spread is None else spread["end"]
    seen = lambda point: max(point["errors"]["end"], spread_end)
    lines = _not_run(found["levels_not_run"])
    if default is not None:
        error, seconds = default["errors"]["end"], default["cost"]["cpu"]
        lines.append(
            f"The scene's settings on level {default['level']} end {length(error)} ({error / size:.2%} of the size)"
            f" from the reference, in {seconds:.3g} s of CPU time"
            f"{'.' if default['errors']['outcome'] else ', and have another outcome: a body rests elsewhere.'}"
        )
        for fraction in SHARES:
            best = cheapest_within(points, fraction * size, own)
            if best is not None and fraction * size >= spread_end:
                lines.append(_compared(best, default, f"within {fraction:.0%} of the size"))
        half = [p for p in points if p["cost"]["cpu"] <= 0.5 * seconds and p["errors"]["outcome"]]
        if half:
            best = min(half, key=lambda point: (seen(point), point["cost"]["cpu"]))
            lines.append(
                f"In half the time of the scene's settings, {option_text(best)} gives {length(best['errors']['end'])}."
            )
        finer = [p for p in points if seen(p) < 0.5 * error and p["errors"]["outcome"]]
        if finer:
            best = min(finer, key=lambda point: point["cost"]["cpu"])
            times = best["cost"]["cpu"] / seconds
            lines.append(
                f"Less than half the error of the scene's settings, {length(best['errors']['end'])}, takes"
                f" {times:.2g} times their time: {option_text(best)}."
            )
    lines += _levels(points, found)
    lines.append(_reference_sentence(reference))
    if spread is not None:
        lines.append(_spread_sentence(spread))
    return lines


def _not_run(levels: Sequence[int]) -> list[str]:
    """That levels of the scene are not in the study: the first thing to know of it."""
    if not levels:
        return []
    named = f"Level {levels[0]} was" if len(levels) == 1 else f"Levels {levels[0]} to {levels[-1]} were"
    return [f"{named} not run: what follows holds for level{'s 0 to' * (levels[0] > 1)} {levels[0] - 1} alone."]


def _compared(best: Mapping, default: Mapping, goal: str) -> str:
    ratio = default["cost"]["cpu"] / best["cost"]["cpu"]
    if best is default:
        return f"The scene's settings are the cheapest ones found {goal}."
    how = f"cost {ratio:.2g} times" if ratio >= 1.0 else f"take {ratio:.0%} of the time of"
    return (
        f"The scene's settings {how} the cheapest ones found {goal}: {option_text(best)} gives"
        f" {length(best['errors']['end'])} in {1.0 / ratio:.0%} of their time."
    )


def _levels(points: Sequence[Mapping], found: Mapping[str, Any]) -> list[str]:
    """Progressive levels beside levels alone."""
    lines = []
    progressive = {p["level"]: p for p in points if not p["changes"] and p["method"] == "progressive"}
    alone = {p["level"]: p for p in points if not p["changes"] and p["method"] == "direct"}
    for level, mine in progressive.items():
        other = alone.get(level)
        if other is not None and level > 0:
            lines.append(
                f"Level {level} by progressive refinement takes {mine['cost']['cpu']:.3g} s with all coarser levels and"
                f" ends {length(mine['errors']['end'])} from the reference; level {level} alone takes"
                f" {other['cost']['cpu']:.3g} s and ends {length(other['errors']['end'])} from it"
                f"{'' if other['errors']['outcome'] else ', another outcome'}."
            )
    return lines


def _reference_sentence(reference: Mapping) -> str:
    parts = [f"{name} {length(part)}" for name, part in reference["parts"].items() if part is not None]
    own = "its own error could not be estimated in the budget"
    if reference["error"] is not None:
        own = f"its own error is about {length(reference['error'])} ({', '.join(parts)})"
    mesh = "" if reference["mesh"] is None else f"; the mesh of its level adds about {length(reference['mesh'])}"
    label = Variation.from_json(reference).label(reference["level"])
    return f"The reference is {label}; {own}{mesh}."


def _spread_sentence(spread: Mapping) -> str:
    text = (
        f"Starts that would end {length(spread['jitter'])} apart in free flight end up to {length(spread['end'])} apart"
        f" on level 0"
    )
    if spread["chaotic"]:
        return f"{text}: the scene is chaotic, and errors below that are not errors of the settings."
    return f"{text}: the scene is not chaotic."


def option_text(point: Mapping) -> str:
    """The options of `pdvol run` that give a point."""
    words = list(point["words"])
    level = words[words.index("--levels") + 1]
    settings = [f"--set {words[i + 1]}" for i, word in enumerate(words) if word == "--set"]
    steps = [f"--steps {words[words.index('--steps') + 1]}"] if "dt" in point["changes"] else []
    method = ["--method direct"] if point["method"] == "direct" else []
    return f"`{' '.join([*settings, *steps, *method, f'--levels {level}'])}`"
