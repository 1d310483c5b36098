"""`pdvol check`: what would stop or spoil a run, before it starts."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from pdvol.commands.options import add, chosen_shot, number
from pdvol.errors import InputError

LISTED = 5  # bodies whose thinnest parts are printed for each level: those of the fewest cells


def add_arguments(parser: ArgumentParser) -> None:
    """The options of `pdvol check`."""
    parser.add_argument("files", type=Path, nargs="+", metavar="SCENE.py | MESH")
    parser.add_argument(
        "-o",
        "--out",
        type=Path,
        metavar="DIR",
        help="write each level, and the primitives of all crossings, there as VTU",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the findings there, too")
    parser.add_argument(
        "--measure",
        type=number,
        default=3.0,
        metavar="SECONDS",
        help="simulate level 0 so long to estimate costs (default 3; 0: not)",
    )
    add(parser, "--set")


def main(options: Namespace) -> int:
    """Print the findings; 0 where nothing would stop a run, else 2."""
    if options.measure < 0:
        raise InputError(f"--measure: {options.measure:g} seconds are too few; 0 measures nothing")
    from pdvol.stages import stage
    from pdvol.store.files import require_place, require_writable, write_json

    if options.out is not None:
        require_place(options.out)
    if options.json is not None:
        require_writable(options.json)
    with stage("loading the solver"):
        from pdvol.runs.preflight import check_scene
        from pdvol.runs.shape_check import check_meshes

    if len(options.files) == 1 and options.files[0].suffix in (".py", ".json"):
        result = check_scene(chosen_shot(options, options.files[0]).scene, options.measure, options.out)
        lines = _scene_lines(result)
    else:
        result = check_meshes(options.files, options.out)
        lines = [line for entry in result["files"] for line in (entry["message"], *entry["notes"])]
    if options.json is not None:
        write_json(options.json, result)
    print("\n".join(lines))
    return 0 if result["sound"] else 2


def _scene_lines(result: dict) -> list[str]:
    """The result of `check_scene`."""
    from pdvol.runs.preflight import sizes_line

    lines = list(result["modelled"])
    if result["stiffness_ratio"] not in (None, 1.0):
        lines.append(f"stiffness ratio of the materials: {result['stiffness_ratio']:.3g}")
    for held in result["supports"]:
        parts = zip(held["areas"], held["shares"], strict=True)
        words = ", ".join(f"{area:.3g} {held['unit']} ({share:.1%})" for area, share in parts)
        lines.append(f"a support of {held['body'] or 'all bodies'} holds of the boundary, by level: {words}")
    for e in result["levels"]:
        lines.append(sizes_line(e))
        lines.append(
            "  worst cells (mean ratio): "
            + ", ".join(f"{w['cell']} of {w['body']} ({w['quality']:.2f})" for w in e["worst_cells"])
        )
        thinnest = (f"{t['cells']} of {t['body']} ({t['thickness']:.3g} m)" for t in e["thinnest"][:LISTED])
        lines.append(f"  cells through the thinnest part: {', '.join(thinnest)}")
        gap = e["smallest_gap"]
        if gap is not None:
            lines.append(
                f"  smallest gap at t = 0: {gap['distance']:.3g} m, {gap['dhats']:.2g} dhat, between {gap['one']} and"
                f" {gap['other']}"
            )
        if e.get("speed"):
            lines.append(
                f"  fastest vertex at t = 0: {e['speed']:.3g} m/s, {e['edges_per_step']:.2g} shortest edges a step"
            )
        if "seconds" in e:
            lines.append(
                f"  about {_duration(e['seconds'])} ({e['seconds_per_step']:.2g} s a step) and {e['memory_mb']:,.0f} MB"
            )
    if "measured" in result:
        m = result["measured"]
        lines.append(
            f"costs from {m['steps']} steps of level 0: {m['seconds_per_step']:.2g} s and {m['newton_iterations']:.1f}"
            " Newton iterations a step"
        )
    lines += result["notes"] + result["defects"]
    return [
        *lines,
        "sound: nothing found that would stop a run" if result["sound"] else "not sound: mend the defects above",
    ]


def _duration(seconds: float) -> str:
    length, unit = (1, "s") if seconds < 60 else (60, "min") if seconds < 3600 else (3600, "h")
    return f"{seconds / length:.2g} {unit}"
