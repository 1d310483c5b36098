"""Do a study's predictions hold? Random shots, three accuracies each, measured against finer references.

    ./run python -m benchmarks.study_trials [--shots 10] [--first 0] [--budget 1] [--out runs/study_trials]

Each shot is studied within the budget. Three accuracies between its best and its worst point, each with the reference's
own error, are wanted. The runs that `pdvol run --accuracy` would make are compared with a reference of half the
study's finest time step and a tenth of its tolerance. A shot holds where all three accuracies do.
"""

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.common import process
from benchmarks.common.tables import table
from pdvol.runs.scene_file import load_shot
from pdvol.store.files import write_json
from pdvol.store.reader import open_run
from pdvol.studio.study.conclusions import length
from pdvol.studio.study.front import cheapest_within
from pdvol.studio.study.reference import ReferenceStates
from pdvol.studio.wedge.variation import Base, Variation, times

SHOT = Path(__file__).resolve().with_name("random_shot.py")


def main(words: Sequence[str] | None = None) -> int:
    """Runs the command; returns its exit code."""
    parser = process.parser("study_trials", __doc__)
    parser.add_argument("--shots", type=int, default=10)
    parser.add_argument("--first", type=int, default=0, help="the seed of the first shot")
    parser.add_argument("--budget", default="1", help="minutes of each study")
    parser.add_argument("--out", type=Path, default=Path("runs/study_trials"))
    parser.add_argument("--json", type=Path)
    parser.add_argument("--again", action="store_true", help="only measure the studies that are stored")
    options = parser.parse_args(words)
    records = []
    for seed in range(options.first, options.first + options.shots):
        folder = options.out / str(seed)
        words = ["study", str(SHOT), "-o", str(folder), "--set", f"seed={seed}", "--budget", options.budget]
        if not options.again:
            _pdvol(words, folder.with_suffix(".log"))
        records.append(record(seed, folder))
        print(json.dumps(records[-1]), flush=True)
    rows = [
        [str(r["seed"]), r["text"], *(["-"] * 3 if not r["wanted"] else [_wanted(a) for a in r["wanted"]]), _held(r)]
        for r in records
    ]
    print(table(["shot", "scene", "loose", "middle", "strict", "holds"], rows))
    print(f"{sum(bool(r['holds']) for r in records)} of {len(records)} shots hold")
    if options.json is not None:
        write_json(options.json, {"shots": records})
    return 0


def record(seed: int, folder: Path) -> dict:
    """What one shot's study promised, and what the finer reference says."""
    study = json.loads((folder / "study.json").read_text())
    shot = load_shot(SHOT, {"seed": seed})
    text = f"{len(study.get('levels', []))} levels, E {shot.scene.bodies[0].material.young:.2g} Pa"
    found = {"seed": seed, "text": text, "wanted": [], "holds": False}
    if "reference" not in study or study["reference"]["error"] is None:
        return {**found, "text": f"{text}, no reference"}
    own, points = study["reference"]["error"], [p for p in study["points"] if p["errors"]["story"]]
    errors = sorted(p["errors"]["end"] for p in points)
    strict = 1.02 * (errors[0] + own)
    loose = max(errors[-1] + own, 1.5 * strict)
    states = finer(seed, folder, study)
    for accuracy in np.geomspace(loose, strict, 3):
        point = cheapest_within(points, accuracy, own)
        if point is None:
            found["wanted"].append({"accuracy": accuracy, "error": None, "settings": ""})
            continue
        run = open_run(folder / "runs" / point["run"])
        error = states.errors(run, point["level"])["end"]
        found["wanted"].append({"accuracy": accuracy, "error": error, "settings": point["label"]})
    found["own"], found["spread"] = own, study["spread"]
    found["holds"] = all(a["error"] is not None and a["error"] <= a["accuracy"] for a in found["wanted"])
    return found


def finer(seed: int, folder: Path, study: dict) -> ReferenceStates:
    """The states of a reference with half the time step and a tenth of the tolerance of the study's own."""
    reference = Variation.from_json(study["reference"])
    changes = dict(reference.changes)
    dt = changes.get("dt", study["dt"])
    tolerance = changes.get("tolerance")
    stricter = Variation.of({"dt": times(dt, 0.5), "tolerance": times(tolerance, 0.1)})
    base = Base(SHOT, (("seed", seed),), study["duration"], study["dt"])
    out, level = folder / "finer", study["reference"]["level"]
    go_on = ["--resume"] if (out / "run.json").exists() else []
    words = ["run", str(SHOT), *stricter.words(base, f"0:{level}"), "--out", str(out), "--no-picture", *go_on]
    _pdvol(words, folder.with_suffix(".finer.log"))
    return ReferenceStates(open_run(out), level)


def _pdvol(words: Sequence[str], log: Path) -> None:
    log.parent.mkdir(parents=True, exist_ok=True)
    with open(log, "w") as file:
        subprocess.run([sys.executable, "-m", "pdvol", *words], check=False, stdout=file, stderr=file)


def _wanted(entry: dict) -> str:
    found = "none" if entry["error"] is None else length(entry["error"])
    return f"{length(entry['accuracy'])}: {entry['settings']} gives {found}"


def _held(entry: dict) -> str:
    return "yes" if entry["holds"] else "no"


if __name__ == "__main__":
    sys.exit(main())
