"""`pdvol metrics`: measure a run, alone or beside another one."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from pdvol.commands.options import add


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol metrics`."""
    parser.add_argument("run", type=Path, metavar="RUN")
    parser.add_argument("--against", type=Path, metavar="RUN", help="another run of the same shot, to compare with")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers there, too")
    add(parser, "--trust")


def main(options: Namespace) -> None:
    """Write metrics.json and metrics.png into the run, and print the means."""
    from pdvol.runs.run_metrics import write_metrics
    from pdvol.stages import stage
    from pdvol.studio.draw.plots import plot_metrics

    result = write_metrics(options.run, options.against, options.json)
    with stage("drawing metrics.png"):
        plot_metrics(options.run / "metrics.png", [result, *([result["against"]] if "against" in result else [])])
    print("\n".join([*_result_lines(result), f"{options.run}: metrics.json and metrics.png"]))
    if "animation" in result["levels"][-1]:
        print(result["levels"][-1]["animation"])


def _result_lines(result: dict) -> list[str]:
    """Means over all steps, a line for each level; after it, indented, the other run's."""
    others = {entry["level"]: entry for entry in result.get("against", {}).get("levels", [])}
    apart = {entry["level"]: entry["summary"] for entry in result.get("against", {}).get("between", [])}
    lines = [f"{result['run']}: method {result['method']}, {result['prolongation']} prolongation"]
    if others:
        lines.append(
            f"  against {result['against']['run']}: method {result['against']['method']},"
            f" {result['against']['prolongation']} prolongation"
        )
    for entry in result["levels"]:
        lines.append(f"level {entry['level']}: {_means(entry)}")
        if entry["level"] in others:
            lines.append(f"  against {_means(others[entry['level']])}")
        if "centre_error" in apart.get(entry["level"], {}):
            s = apart[entry["level"]]
            distance = f", {_mean(s, 'distance', 'm', 'distance')}" if "distance" in s else ""
            lines.append(f"  apart: {_mean(s, 'centre_error', 'm', 'centre of mass')}{distance}")
    notes = [*result["notes"], *result.get("against", {}).get("notes", [])]
    return [*lines, *(f"note: {note}" for note in dict.fromkeys(notes))]


def _means(entry: dict) -> str:
    from pdvol.measure.metrics import ROUGHER, root_mean_square

    s = {key: value for key, value in entry["summary"].items() if value}
    parts = [f"{entry['steps']} steps"]
    if "consistency" in s:
        parts.append(_mean(s, "distance", "m", "distance from the level below"))
        parts += [_drift(s, "", "the level below")] + [_drift(s, "_from_0", "level 0")] * (entry["level"] > 1)
    if "roughness" in s:
        parts.append(f"roughness {root_mean_square(entry['roughness']):.3g} m")
        parts += ["rougher than level 0"] if entry["rougher"] > ROUGHER else []
    if "jitter" in s:
        parts.append(_mean(s, "jitter", "J", "jitter"))
    if "consistency" in s:
        parts.append(_mean(s, "consistency", "kg m^2", "consistency d"))
        parts.append(f"rank of P {entry['projection']['rank']} of {entry['projection']['columns']}")
    if "continuity_error" in s:
        parts.append(_mean(s, "continuity_error", "kg m^2", "continuity error e"))
    if "continuity" in s:
        parts.append(
            f"continuity n {s['continuity']['mean']:.4g} (median {s['continuity']['median']:.4g}, most"
            f" {s['continuity']['largest']:.3g})"
        )
    return ", ".join(parts)


def _mean(s: dict, key: str, unit: str, what: str) -> str:
    return f"{what} {s[key]['mean']:.3g} {unit} (most {s[key]['largest']:.3g})"


def _drift(s: dict, suffix: str, reference: str) -> str:
    """What `summary` says of the drift from a level."""
    centre, angle = s["centre_drift" + suffix], s["angle_drift" + suffix]
    return (
        f"drift from {reference} at most {centre['largest']:.3g} m and {angle['largest']:.3g} degrees"
        f" (at the end {centre['last']:.3g}, {angle['last']:.3g})"
    )
