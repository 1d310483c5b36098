"""Measures pdvol on the peers' scenes; writes one JSON file and its tables.

    ./run python -m benchmarks.peers [--scenes small,blocks] [--ranks 1,2] [--peers ../shared/peers] [--out runs/peers]

Every scene runs through `run_scene` in a process of its own (two with two ranks), into a folder that is removed
afterwards. A scene that fails is reported with its reason, and the others go on. The exit code is 0 when all went well,
1 when a scene failed or is not sound, and 2 for a wrong command line.
"""

import argparse
import json
import shutil
import sys
import tempfile
from pathlib import Path

from benchmarks.common import process
from benchmarks.common.process import REPOSITORY, Mistake, child, fixed_loop, machine
from benchmarks.peers import report

GROUPS = {
    "small": ("drop_500", "twist_1k", "twistx_1k"),
    "4k": ("drop_4k", "twist_4k", "blocks"),
    "impact": ("impact_45", "impact_100", "impact_150"),
    "20k": ("drop_20k", "twist_20k"),
    "100k": ("twist_100k", "twist_100k_levels"),
    "1m": ("twist_300k", "twist_1m"),
}
"""Scenes by group, the cheap ones first; `all` is all of them."""
TOLERANCE = 1e-3
"""m/s, of scenes.py; this process loads neither numpy nor pdvol, for a child's peak memory (ru_maxrss) begins with its
parent's.
"""


def main(words: list[str] | None = None) -> int:
    """Runs the command; returns its exit code."""
    options = _options(words)
    try:
        names, ranks = chosen(options.scenes), rank_counts(options.ranks)
        if not (options.peers / "README.md").is_file():
            raise Mistake(
                f"the peers' meshes are not there: {options.peers} has no README.md; name their folder with --peers"
            )
        if options.repeats < 1:
            raise Mistake(f"--repeats {options.repeats}: write a whole number from 1 on")
        options.out.mkdir(parents=True, exist_ok=True)
    except (Mistake, OSError) as error:
        print(f"benchmarks.peers: {error}", file=sys.stderr)
        return 2
    result = {"machine": machine(), "tolerance": TOLERANCE, "scenes": []}
    for name in names:
        rounds = [[run(name, count, options) for count in ranks] for _ in range(options.repeats)]
        for records in zip(*rounds, strict=True):
            record = middle(records)
            result["scenes"].append(record)
            print(summary(record), file=sys.stderr, flush=True)
        write(result, options.out)
    print(report.tables(result))
    return int(any(not (record["ok"] and record["sound"]) for record in result["scenes"]))


def _options(words: list[str] | None) -> argparse.Namespace:
    parser = process.parser("peers", __doc__)
    parser.add_argument(
        "--scenes", default="all", metavar="NAME,...", help=f"scenes or groups: all, {', '.join(GROUPS)} (default: all)"
    )
    parser.add_argument("--ranks", default="1,2", metavar="N,...", help="numbers of ranks (default: 1,2)")
    parser.add_argument(
        "--peers",
        type=Path,
        default=REPOSITORY.parent / "shared" / "peers",
        metavar="DIR",
        help="the peers' meshes and states",
    )
    parser.add_argument(
        "--out", type=Path, default=REPOSITORY / "runs" / "peers", metavar="DIR", help="for peers.json and peers.md"
    )
    parser.add_argument("--steps", type=int, help="so many steps, instead of each scene's own")
    parser.add_argument(
        "--repeats",
        type=int,
        default=1,
        metavar="N",
        help="each so often, in turn; the middle one is reported (default: 1)",
    )
    parser.add_argument(
        "--limit", type=float, default=900.0, metavar="SECONDS", help="a run is ended after so long (default: 900)"
    )
    return parser.parse_args(words)


def chosen(text: str) -> list[str]:
    """Scene names from names and groups, each once."""
    everything = [name for group in GROUPS.values() for name in group]
    names = []
    for word in filter(None, text.split(",")):
        if word not in ("all", *GROUPS, *everything):
            raise Mistake(f"there is no scene {word!r}; choose from all, {', '.join(GROUPS)}, {', '.join(everything)}")
        names += everything if word == "all" else GROUPS.get(word, (word,))
    return list(dict.fromkeys(names))


def rank_counts(text: str) -> list[int]:
    """Numbers of ranks."""
    words = [word for word in text.split(",") if word]
    if not words or not all(word.isdecimal() and int(word) > 0 for word in words):
        raise Mistake(f"--ranks {text}: write whole numbers, as in 1,2")
    return [int(word) for word in words]


# ---- one run


def run(name: str, ranks: int, options: argparse.Namespace) -> dict:
    """The record of one scene on this number of ranks."""
    with tempfile.TemporaryDirectory(prefix=f"pdvol-{name}-") as folder:
        path = Path(folder) / "run"
        steps = [] if options.steps is None else [str(options.steps)]
        words = ["-m", "benchmarks.peers.run_one", name, str(options.peers), str(path), *steps]
        # mpi4py's own runner ends all ranks when one of them fails alone.
        python = (
            [sys.executable]
            if ranks == 1
            else [shutil.which("mpirun") or "mpirun", "-n", str(ranks), sys.executable, "-m", "mpi4py"]
        )
        before = fixed_loop()
        reason = child([*python, *words], options.limit, Path(folder) / "run.log")
        after = fixed_loop()
        found = measure(name, ranks, options, path) if (path / "run.json").is_file() else {}
    reason = reason or found.pop("reason", "") or ("" if found.get("done") else "it did not finish")
    sound = found.get("steps", 0) > 0 and not (found["problems"] or found["inverted"] or found["through"])
    return {
        "scene": name,
        "ranks": ranks,
        "ok": not reason,
        "reason": reason,
        "sound": sound,
        "loop_ms": [before, after],
        **found,
    }


def middle(records: tuple[dict, ...]) -> dict:
    """Of the records of one scene, the one with the median mean time, with the means of all; a record that failed or is
    not sound, if there is one.
    """
    bad = [record for record in records if not (record["ok"] and record["sound"])]
    if bad:
        return bad[0]
    ordered = sorted(records, key=lambda record: record["seconds"]["mean"])
    return {**ordered[len(ordered) // 2], "means": [record["seconds"]["mean"] for record in records]}


def measure(name: str, ranks: int, options: argparse.Namespace, path: Path) -> dict:
    """What measure.py finds in a run folder; if it fails, its message is the reason."""
    found = path.with_name("measured.json")
    command = [sys.executable, "-m", "benchmarks.peers.measure", name, str(ranks), str(options.peers), str(path)]
    reason = child(command, options.limit, path.with_name("measure.log"), found)
    return {"reason": f"measure.py: {reason}"} if reason else json.loads(found.read_text())


# ---- what is printed


def summary(record: dict) -> str:
    """One line about a record."""
    seconds = record.get("seconds", {}).get("mean")
    figures = f"{seconds:.4f} s per step, {record['newton']['mean']:.1f} Newton" if seconds else "nothing measured"
    failed = f"; failed: {record['reason']}" if not record["ok"] else "" if record["sound"] else "; not sound"
    return f"{record['scene']} on {record['ranks']}: {figures}{failed}"


def write(result: dict, out: Path) -> None:
    """Writes peers.json and peers.md, complete after every scene."""
    (out / "peers.json").write_text(json.dumps(result, indent=1) + "\n")
    (out / "peers.md").write_text(report.tables(result))


if __name__ == "__main__":
    sys.exit(main())
