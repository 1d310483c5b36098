"""Compares methods, interpolants and weights on a demo: runs its cases, prints a Markdown table of them and draws a
figure.

    ./run python -m benchmarks.methods rope_drop slit_array [--only WORDS] [--steps N] [--levels N] [--out runs/methods]

Runs, tables (NAME.md), numbers (NAME.json) and figures (NAME.png) go to the folder `--out`; finished runs there are
used again. Intersections are counted by `pdvol verify`, which is independent of the solver. The exit code is 2 for a
wrong command line.
"""

import sys
from pathlib import Path

import numpy as np

from benchmarks.common import process
from benchmarks.common.first_order import FIRST_ORDER
from benchmarks.common.tables import number, table
from benchmarks.methods.figures import METRICS, draw
from benchmarks.methods.studies import DEMOS, STUDIES, Case, Study
from pdvol import PdvolError, open_run
from pdvol.measure import verify
from pdvol.runs.run_metrics import measure_run
from pdvol.runs.runner import run_scene
from pdvol.runs.scene_file import load_shot
from pdvol.store.files import write_json

HEAD = [
    "method",
    "interpolant",
    "continuity n mean (median)",
    "continuity error [kg m²]",
    "consistency [kg m²]",
    "distance from P x_c [m]",
    "roughness [m]",
    "states with intersections (pairs)",
    "largest change of volume",
    "smallest det F",
    "facets turned [deg]",
    "CPU time [s]",
]


def main(words: list[str] | None = None) -> int:
    """Runs the command; returns its exit code."""
    parser = process.parser("methods", __doc__)
    parser.add_argument("studies", nargs="+", choices=sorted(STUDIES), metavar="STUDY", help=", ".join(STUDIES))
    parser.add_argument("--steps", type=int, help="instead of the study's")
    parser.add_argument("--levels", type=int, help="only so many of the coarsest levels")
    parser.add_argument("--only", default="", metavar="WORDS", help="only the cases whose name has these words in it")
    parser.add_argument("--out", type=Path, default=Path("runs/methods"))
    options = parser.parse_args(words)
    try:
        for name in options.studies:
            study(name, options)
    except PdvolError as error:
        print(f"benchmarks.methods: {error}", file=sys.stderr)
        return 2
    return 0


def study(name: str, options) -> None:
    """One study: its runs, its table, its figure."""
    chosen, records = STUDIES[name], []
    cases = [case for case in chosen.cases if options.only in case.name]
    for case in cases:
        path = options.out / name / case.name.replace(" ", "_")
        run(chosen, case, path, options)
        records.append(judge(path, case, options.levels or chosen.levels))
        print(f"{name}: {case.name}: {records[-1]['seconds']:.0f} s", file=sys.stderr, flush=True)
    write_json(options.out / f"{name}.json", {"study": name, "cases": records})
    text = tabled(records)
    (options.out / f"{name}.md").write_text(text)
    print(f"{name}\n\n{text}")
    draw(
        options.out / f"{name}.png",
        chosen,
        records,
        [options.out / name / case.name.replace(" ", "_") for case in cases],
    )


def run(chosen: Study, case: Case, path: Path, options) -> None:
    """Simulates a case, or the steps that are missing."""
    shot = load_shot(DEMOS / f"{chosen.demo}.py", FIRST_ORDER | case.settings, options.steps or chosen.steps)
    levels = options.levels or chosen.levels
    stored = open_run(path).levels if (path / "run.json").is_file() else ()
    if not (len(stored) >= levels and all(level.steps > shot.scene.steps for level in stored[:levels])):
        run_scene(shot, path, 0, levels - 1, case.method, case.prolongation, resume=True)


def judge(path: Path, case: Case, count: int) -> dict:
    """Findings about one run: metrics of its `count` coarsest levels, and defects of their states."""
    result, stored, levels = measure_run(path), open_run(path), []
    for entry, level in zip(result["levels"][:count], stored.levels, strict=False):
        record = {key: entry[key] for key in ("level", "summary")} | {
            "vertices": len(level.rest),
            **{key: entry.get(key) for key in METRICS},
        }
        record["seconds"] = sum(r["seconds"]["cpu"] for r in level.log)
        levels.append(record | states(level, stored.obstacles))
    return {
        "name": case.name,
        "method": case.method,
        "prolongation": case.prolongation,
        "settings": dict(case.settings),
        "notes": result["notes"],
        "dt": stored.dt,
        "seconds": sum(r["seconds"] for r in levels),
        "levels": levels,
    }


def states(level, obstacles) -> dict:
    """Crossings, volumes, determinants and bent facets over all states of a level."""
    facets = verify.boundary(level.cells)
    rest = verify.signed_volumes(level.rest, level.cells)
    total, hinges = np.bincount(level.bodies, rest), Hinges(level.rest, level.surface)
    crossing, pairs, change, smallest, turned = 0, 0, 0.0, np.inf, []
    for step in range(level.steps):
        x = level.positions(step)
        solids = [
            (o.vertices(step), o.arrays["faces" if o.kind == "mesh" else "edges"])
            for o in obstacles
            if o.kind != "plane"
        ]
        planes = [o.plane(step) for o in obstacles if o.kind == "plane"]
        found = len(verify.crossings(x, facets, solids)) + sum(int(((x - p) @ n <= 0).sum()) for p, n in planes)
        crossing, pairs = crossing + (found > 0), pairs + found
        volumes = verify.signed_volumes(x, level.cells)
        change = max(change, float(np.abs(np.bincount(level.bodies, volumes) / total - 1).max()))
        smallest = min(smallest, float((volumes / rest).min()))
        turned.append(hinges.turned(x))
    return {
        "states": level.steps,
        "crossing_states": crossing,
        "crossing_pairs": pairs,
        "volume_change": change,
        "smallest_det": smallest,
        "turned": float(np.mean(turned)),
    }


class Hinges:
    """Neighbouring facets of a boundary, and how much the angle between them has changed. That is large where facets
    of a coarse mesh show.
    """

    def __init__(self, rest: np.ndarray, surface: np.ndarray):
        d = surface.shape[1]
        ridges = np.sort(np.concatenate([np.delete(surface, k, axis=1) for k in range(d)]), axis=1)
        owner = np.tile(np.arange(len(surface)), d)
        order = np.lexsort(ridges.T)
        same = (ridges[order][1:] == ridges[order][:-1]).all(axis=1)
        self.surface, self.pairs = surface, np.column_stack([owner[order][:-1][same], owner[order][1:][same]])
        self._rest = self._angles(rest)

    def _angles(self, x: np.ndarray) -> np.ndarray:
        corners = x[self.surface]
        edges = corners[:, 1:] - corners[:, :1]
        normals = (
            np.column_stack([edges[:, 0, 1], -edges[:, 0, 0]])
            if x.shape[1] == 2
            else np.cross(edges[:, 0], edges[:, 1])
        )
        normals /= np.linalg.norm(normals, axis=1, keepdims=True) + 1e-300
        return np.arccos(
            np.clip(np.einsum("ij,ij->i", normals[self.pairs[:, 0]], normals[self.pairs[:, 1]]), -1.0, 1.0)
        )

    def turned(self, x: np.ndarray) -> float:
        """Root mean square change of the angles between neighbours [degrees] at positions x (n, d)."""
        return float(np.degrees(np.sqrt(np.mean((self._angles(x) - self._rest) ** 2))))


def tabled(records: list[dict]) -> str:
    """The finest levels as a Markdown table; intersections of all levels above the coarsest."""
    rows = []
    for record in records:
        finest, above = record["levels"][-1], record["levels"][1:]
        s = finest["summary"]
        n = s.get("continuity") or {}
        settings = ", ".join(f"{key} {value:g}" for key, value in record["settings"].items())
        rows.append(
            [
                f"{record['method']}{', ' if settings else ''}{settings}",
                record["prolongation"] if record["method"] != "direct" else "-",
                f"{n['mean']:.2g} ({n['median']:.2g})" if n else "-",
                *(
                    number(s[key]["mean"], 2) if s.get(key) else "-"
                    for key in ("continuity_error", "consistency", "distance", "roughness")
                ),
                (
                    f"{sum(x['crossing_states'] for x in above)} of {sum(x['states'] for x in above)}"
                    f" ({sum(x['crossing_pairs'] for x in above):,})"
                ),
                f"{100 * finest['volume_change']:.2g} %",
                number(finest["smallest_det"], 2),
                number(finest["turned"], 2),
                f"{record['seconds']:.0f}",
            ]
        )
    return table(HEAD, rows) + "\n"


if __name__ == "__main__":
    sys.exit(main())
