"""Do a study's predictions hold? Random shots, three accuracies each, measured against finer references.

Three accuracies between a shot's best and worst point, each with the reference's own error, are wanted. The runs that
`pdvol run --accuracy` would make are compared with a reference of half the study's finest time step and a tenth of its
tolerance. A shot holds where all three accuracies do.
"""

import json
import subprocess
import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.common.study import each
from benchmarks.common.tables import table
from pdvol.runs.scene_file import load_shot
from pdvol.store.reader import open_run
from pdvol.studio.study.conclusions import length
from pdvol.studio.study.front import cheapest_within
from pdvol.studio.study.reference import ReferenceStates
from pdvol.studio.wedge.variation import Base, Variation, times

SHOT = Path(__file__).resolve().with_name("scenes.py")
HEAD = ["shot", "scene", "loose", "middle", "strict", "holds"]


def compare(options: Namespace) -> None:
    """Studies so many random shots, and prints their table."""
    held = []

    def measured(seed: str) -> dict:
        folder = options.out / "random" / seed
        words = ["study", str(SHOT), "-o", str(folder), "--set", f"seed={seed}", "--budget", options.budget]
        if not options.dry:
            pdvol(words, folder.with_suffix(".log"))
        found = record(int(seed), folder)
        held.append(found["holds"])
        return found

    print(table(HEAD, each(map(str, range(options.first, options.first + options.random)), measured, cells)))
    print(f"{sum(held)} of {len(held)} shots hold")


def record(seed: int, folder: Path) -> dict:
    """What one shot's study promised, and what the finer reference says."""
    study = json.loads((folder / "study.json").read_text())
    shot = load_shot(SHOT, {"seed": seed})
    text = f"{len(study.get('levels', []))} levels, E {shot.scene.bodies[0].material.young:.2g} Pa"
    if "reference" not in study or study["reference"]["error"] is None:
        return {"text": f"{text}, no reference", "wanted": [], "holds": False}
    own, points = study["reference"]["error"], [p for p in study["points"] if p["errors"]["outcome"]]
    errors = sorted(p["errors"]["end"] for p in points)
    strict = 1.02 * (errors[0] + own)
    loose = max(errors[-1] + own, 1.5 * strict)
    states, wanted = finer(seed, folder, study), []
    for accuracy in np.geomspace(loose, strict, 3):
        point, error = cheapest_within(points, accuracy, own), None
        if point is not None:
            error = states.errors(open_run(folder / "runs" / point["run"]), point["level"])["end"]
        wanted.append({"accuracy": accuracy, "error": error, "settings": point["label"] if point else ""})
    holds = all(a["error"] is not None and a["error"] <= a["accuracy"] for a in wanted)
    return {"text": text, "wanted": wanted, "holds": holds}


def finer(seed: int, folder: Path, study: dict) -> ReferenceStates:
    """The states of a reference with half the time step and a tenth of the tolerance of the study's own."""
    changes, level = dict(Variation.from_json(study["reference"]).changes), study["reference"]["level"]
    half = {"dt": times(changes.get("dt", study["dt"]), 0.5), "tolerance": times(changes.get("tolerance"), 0.1)}
    base, out = Base(SHOT, (("seed", seed),), study["duration"], study["dt"]), folder / "finer"
    words = ["run", str(SHOT), *Variation.of(half).words(base, f"0:{level}"), "--out", str(out), "--no-picture"]
    pdvol([*words, *(["--resume"] if (out / "run.json").exists() else [])], folder.with_suffix(".finer.log"))
    return ReferenceStates(open_run(out), level)


def pdvol(words: Sequence[str], log: Path | None = None) -> None:
    """Runs a command of pdvol, whose text goes into a log."""
    if log is None:
        subprocess.run([sys.executable, "-m", "pdvol", *words], check=False)
        return
    log.parent.mkdir(parents=True, exist_ok=True)
    with log.open("w") as file:
        subprocess.run([sys.executable, "-m", "pdvol", *words], check=False, stdout=file, stderr=file)


def cells(seed: str, found: dict) -> list[list[str]]:
    """The row of a shot."""
    wanted = []
    for one in found["wanted"] or ():
        error = "none" if one["error"] is None else length(one["error"])
        wanted.append(f"{length(one['accuracy'])}: {one['settings']} gives {error}")
    return [[seed, found["text"], *(wanted or ["-"] * 3), "yes" if found["holds"] else "no"]]
