"""Measures pdvol on the peers' scenes; writes one JSON file and its tables.

    ./run python benchmarks/peers.py [--scenes small,blocks] [--ranks 1,2] [--peers ../shared/peers] [--out runs/peers]

Every scene runs through `run_scene` in a process of its own (two with two ranks), into a folder that is removed
afterwards. A scene that fails is reported with its reason, and the others go on. The exit code is 0 when all went well,
1 when a scene failed or is not sound, and 2 for a wrong command line.
"""

import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import report

HERE = Path(__file__).resolve().parent
GROUPS = {
    "small": ("drop_500", "twist_1k", "twistx_1k"),
    "4k": ("drop_4k", "twist_4k", "blocks"),
    "impact": ("impact_45", "impact_100", "impact_150"),
    "20k": ("drop_20k", "twist_20k"),
    "100k": ("twist_100k", "twist_100k_levels"),
}
"""Scenes by group, the cheap ones first; `all` is all of them."""
TOLERANCE = 1e-3
"""m/s, of peer_scenes.py; this process loads neither numpy nor pdvol, for a child's peak memory (ru_maxrss) begins with
its parent's.
"""
ENDING = 20.0
"""Seconds that a process is given to end after it was asked to."""


class Mistake(Exception):
    """A mistake of the user's, with what to correct in one line."""


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
        print(f"peers.py: {error}", file=sys.stderr)
        return 2
    result = {"machine": machine(), "tolerance": TOLERANCE, "scenes": []}
    for name in names:
        rounds = [[run(name, count, options) for count in ranks] for _ in range(options.repeats)]
        for records in zip(*rounds, strict=True):
            record = middle(records)
            result["scenes"].append(record)
            print(_told(record), file=sys.stderr, flush=True)
        write(result, options.out)
    print(report.tables(result))
    return int(any(not (record["ok"] and record["sound"]) for record in result["scenes"]))


def _options(words: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="peers.py", description=__doc__.splitlines()[0])
    parser.add_argument(
        "--scenes", default="all", metavar="NAME,...", help=f"scenes or groups: all, {', '.join(GROUPS)} (default: all)"
    )
    parser.add_argument("--ranks", default="1,2", metavar="N,...", help="numbers of ranks (default: 1,2)")
    parser.add_argument(
        "--peers",
        type=Path,
        default=HERE.parents[1] / "shared" / "peers",
        metavar="DIR",
        help="the peers' meshes and states",
    )
    parser.add_argument(
        "--out", type=Path, default=HERE.parent / "runs" / "peers", metavar="DIR", help="for peers.json and peers.md"
    )
    parser.add_argument("--steps", type=int, help="so many steps, instead of each scene's own")
    parser.add_argument(
        "--repeats",
        type=int,
        default=1,
        metavar="N",
        help="each so often, in turn; the middle one is told (default: 1)",
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


def machine() -> dict:
    """Processor, cores, memory [GB] and load."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    processor = next(
        (line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "unknown processor"
    )
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    return {
        "processor": processor,
        "cores": len(os.sched_getaffinity(0)),
        "memory_gb": total,
        "load": os.getloadavg()[0],
    }


def yardstick() -> float:
    """Milliseconds that a fixed loop takes the interpreter, the best of five: it shows how much of its speed other work
    on the host leaves.
    """
    taken = []
    for _ in range(5):
        begin, total = time.perf_counter(), 0
        for i in range(300_000):
            total += i * i
        taken.append(time.perf_counter() - begin)
    return 1e3 * min(taken)


# ---- one run


def run(name: str, ranks: int, options: argparse.Namespace) -> dict:
    """The record of one scene on this number of ranks."""
    with tempfile.TemporaryDirectory(prefix=f"pdvol-{name}-") as folder:
        path = Path(folder) / "run"
        steps = [] if options.steps is None else [str(options.steps)]
        words = [str(HERE / "run_one.py"), name, str(options.peers), str(path), *steps]
        # mpi4py's own runner ends all ranks when one of them fails alone.
        python = (
            [sys.executable]
            if ranks == 1
            else [shutil.which("mpirun") or "mpirun", "-n", str(ranks), sys.executable, "-m", "mpi4py"]
        )
        before = yardstick()
        reason = child([*python, *words], options.limit, Path(folder) / "run.log")
        after = yardstick()
        found = measure(name, ranks, options, path) if (path / "run.json").is_file() else {}
    reason = reason or found.pop("reason", "") or ("" if found.get("done") else "it did not finish")
    sound = found.get("steps", 0) > 0 and not (found["problems"] or found["inverted"] or found["through"])
    return {
        "scene": name,
        "ranks": ranks,
        "ok": not reason,
        "reason": reason,
        "sound": sound,
        "yardstick_ms": [before, after],
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
    command = [sys.executable, str(HERE / "measure.py"), name, str(ranks), str(options.peers), str(path)]
    reason = child(command, options.limit, path.with_name("measure.log"), found)
    return {"reason": f"measure.py: {reason}"} if reason else json.loads(found.read_text())


def child(command: list[str], limit: float, log: Path, output: Path | None = None) -> str:
    """Runs a command with one thread; returns an empty text when it succeeds, else the last line it printed."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    with log.open("w") as errors, (output or log.with_suffix(".out")).open("w") as out:
        begin = time.monotonic()
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=out, stderr=errors, env=environment, start_new_session=True
        )
        try:
            code = process.wait(limit)
        except subprocess.TimeoutExpired:
            return f"ended after {time.monotonic() - begin:.0f} s"
        finally:
            end(process)
    return "" if code == 0 else last_words(log) or f"exit code {code}"


def end(process: subprocess.Popen) -> None:
    """Ends a process of ours that still runs, by its own group. mpirun must end its ranks, since they are in groups of
    their own.
    """
    for sign in (signal.SIGTERM, signal.SIGKILL):
        if process.poll() is not None:
            return
        os.killpg(process.pid, sign)
        try:
            process.wait(ENDING)
        except subprocess.TimeoutExpired:
            continue


def last_words(log: Path) -> str:
    """The last line of a log that names an error, since Open MPI prints much after it; or else the last line."""
    lines = [line.strip() for line in log.read_text(errors="replace").splitlines() if line.strip()]
    errors = [line for line in lines if re.match(r"[\w.]+(Error|Exception|Interrupt)\b", line)]
    return (errors or lines or [""])[-1][:300]


# ---- what is printed


def _told(record: dict) -> str:
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
