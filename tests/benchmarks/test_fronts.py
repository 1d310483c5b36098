"""The table of fronts, on a made-up study, and the scenes that are studied."""

from pathlib import Path

from benchmarks.fronts import __main__ as fronts

ROOT = Path(__file__).resolve().parents[2]


def point(cost, error, **changes):
    words = ["--levels", "0:1", "--steps", "10", *(w for k, v in changes.items() for w in ("--set", f"{k}={v}"))]
    errors = {"end": error, "share": error / 2.0, "story": True}
    return {
        "run": "x",
        "changes": {k: str(v) for k, v in changes.items()},
        "method": "progressive",
        "level": 1,
        "words": words,
        "cost": {"cpu": cost},
        "errors": errors,
    }


def test_a_row_has_the_cheapest_settings_for_each_accuracy():
    default = point(10.0, 0.04)
    study = {
        "points": [default, point(4.0, 0.05, tolerance=0.1), point(30.0, 0.004, dt=0.005)],
        "default": default,
        "size": 2.0,
        "levels": [{"vertices": 1200}, {"vertices": 3400}],
        "reference": {"error": 0.001},
        "spread": {"growth": 25.0, "chaotic": True},
        "orders": [{"axis": "dt", "order": 0.97}, {"axis": "dhat", "order": None}],
        "machine": {"processor": "P", "cores": 2},
        "jobs": 2,
    }
    text = fronts.fronts_table({"shot": study, "unfinished": {"points": []}})
    row = next(line for line in text.splitlines() if line.startswith("| shot"))
    assert "1,200, 3,400" in row and "10.0, 4 cm, 2.00%" in row and "25 times, chaotic" in row
    assert "`--set dt=0.005 --steps 10 --levels 0:1`: 4 mm in 300% of the time" in row
    assert "`--set tolerance=0.1 --levels 0:1`: 5 cm in 40% of the time" in row and row.endswith("dt 0.97 |")
    assert "unfinished" not in text and "P, 2 cores, 2 runs at a time" in text


def test_unknown_scenes_are_named(capsys):
    assert fronts.main(["spike,nothing"]) == 2 and "nothing" in capsys.readouterr().err
