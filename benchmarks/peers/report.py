"""The records of benchmarks.peers as Markdown tables."""

import math

from benchmarks.common.tables import number, table

SCALING = ("twist_4k", "twist_20k", "twist_100k")
PEERS = ("stark", "ipc")


def tables(result: dict) -> str:
    """All tables of one result (the contents of peers.json)."""
    machine, records = result["machine"], result["scenes"]
    head = (
        f"{machine['processor']}, {machine['cores']} cores, {machine['memory_gb']:.0f} GB, load {machine['load']:.2f}"
        f" at the start; one thread per rank, Newton stops at {result['tolerance']:g} m/s; times without storage and"
        " without the first step; fixed loop: what it took the interpreter just before and after, by which"
        " rows of different hours can be compared"
    )
    parts = [
        "# pdvol beside STARK and IPC",
        head,
        "## Speed",
        speed(records),
        "## Where the time goes",
        by_part(records),
        "## Soundness, and distance from the peers' last states",
        soundness(records),
        "## Growth",
        growth(records),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def title(record: dict) -> str:
    """The scene's name, marked where it did not finish."""
    return record["scene"] + ("" if record["ok"] else f" (failed after {record.get('steps', 0)} steps)")


def measured(records: list[dict]) -> list[dict]:
    """The records with at least one step."""
    return [record for record in records if record.get("steps")]


def speed(records: list[dict]) -> str:
    """Seconds, iterations and the peers' figures, levels below the finest in rows of their own."""
    head = [
        "scene",
        "vertices / tets",
        "ranks",
        "time a step [s]: mean / median / max",
        "with storage [s]: mean / no contact / contact",
        "Newton mean / max",
        "linear mean / max",
        "time a Newton iteration [ms]",
        "STARK [s], other machine (times ours)",
        "IPC [s], other machine (times ours)",
        "memory [MB]",
        "fixed loop [ms]",
    ]
    rows = []
    for record in measured(records):
        rows += [
            [f"{record['scene']}, level {below['level']}", *pace(below, record["ranks"]), "-", "-", "-", "-"]
            for below in record["coarser"]
        ]
        memory = record["memory_mb"] or record["memory_log_mb"]
        rows.append(
            [
                title(record),
                *pace(record, record["ranks"]),
                *(beside(record, peer) for peer in PEERS),
                number(memory),
                " to ".join(number(ms) for ms in sorted(record["loop_ms"])),
            ]
        )
    return table(head, rows) + "".join(
        f"\n\n{r['scene']} on {r['ranks']} failed: {r['reason']}" for r in records if not r["ok"]
    )


def pace(level: dict, ranks: int) -> list[str]:
    """The cells of a row that a level has of its own."""
    newton, linear, stored, each = (
        level["newton"],
        level["linear"],
        level.get("seconds_with_storage"),
        level["seconds_per_newton"],
    )
    return [
        f"{level['vertices']:,} / {level['tets']:,}",
        str(ranks),
        " / ".join(number(level["seconds"][key]) for key in ("mean", "median", "max")),
        " / ".join(number(stored[key]) for key in ("mean", "without_contact", "with_contact")) if stored else "-",
        f"{number(newton['mean'], 2)} / {newton['max']:.0f}",
        f"{number(linear['mean'])} / {linear['max']:.0f}",
        number(1e3 * each if each else None),
    ]


def beside(record: dict, peer: str) -> str:
    """A peer's seconds on as many threads, and the ratio to ours."""
    figures = record[peer]
    theirs = figures["seconds"].get(str(record["ranks"]))
    return f"{number(theirs)} ({number(figures['ratio'])})" if theirs else "-"


def by_part(records: list[dict]) -> str:
    """Milliseconds per step by part."""
    parts = sorted(
        {part for r in measured(records) for part in r["seconds_by_part"]}, key=lambda part: (part == "other", part)
    )
    rows = [
        [
            title(r),
            str(r["ranks"]),
            *(number(1e3 * r["seconds_by_part"].get(part, 0.0)) for part in parts),
            ", ".join(r["linear_solvers"]),
        ]
        for r in measured(records)
    ]
    return table(["scene", "ranks", *(f"{part} [ms a step]" for part in parts), "linear solver"], rows)


def soundness(records: list[dict]) -> str:
    """Inversions, intersections, and RMS / largest distance."""
    head = [
        "scene",
        "ranks",
        "smallest det F",
        "inverted",
        "intersections (states searched)",
        "come through",
        "smallest plane gap [mm]",
        "contacts max",
        "cuts",
        "from STARK [mm], RMS / max",
        "from IPC [mm], RMS / max",
    ]
    rows = [
        [
            title(r),
            str(r["ranks"]),
            number(r["det_f_min"]),
            str(r["inverted"]),
            f"{r['intersections']} ({r['states_searched']})",
            str(r["through"]),
            number(r["plane_gap_min"] and 1e3 * r["plane_gap_min"]),
            str(r["contacts_max"]),
            str(r["cuts"]),
            *(apart(r[peer]) for peer in PEERS),
        ]
        for r in measured(records)
    ]
    return table(head, rows) + "".join(
        f"\n\n{r['scene']} on {r['ranks']}: {problem}" for r in measured(records) for problem in r["problems"]
    )


def apart(figures: dict) -> str:
    """RMS and largest distance in mm."""
    return f"{number(1e3 * figures['rms_m'])} / {number(1e3 * figures['max_m'])}" if "rms_m" in figures else "-"


def growth(records: list[dict]) -> str:
    """Exponents of the cost as a function of size on the twists, and the gain of two ranks."""
    lines = [f"- two ranks on {name}: {number(gain)} times faster than one" for name, gain in gains(records).items()]
    lines += [
        f"- cost of a Newton iteration from {a} to {b}, one rank: n^{exponent:.2f}"
        for (a, b), exponent in exponents(records).items()
    ]
    return "\n".join(lines)


def gains(records: list[dict]) -> dict[str, float]:
    """Scene -> mean seconds on one rank over those on two."""
    means = {(r["scene"], r["ranks"]): r["seconds"]["mean"] for r in measured(records) if r["ok"]}
    return {
        name: value / means[name, 2] for (name, ranks), value in means.items() if ranks == 1 and means.get((name, 2))
    }


def exponents(records: list[dict]) -> dict[tuple[str, str], float]:
    """Pairs of twists -> the exponent p in cost per Newton iteration ~ vertices^p, on one rank."""
    known = {
        r["scene"]: (r["vertices"], r["seconds_per_newton"])
        for r in measured(records)
        if r["ranks"] == 1 and r["seconds_per_newton"]
    }
    names = [name for name in SCALING if name in known]
    pairs = [*zip(names[:-1], names[1:], strict=True), *([(names[0], names[-1])] if len(names) > 2 else [])]
    return {(a, b): math.log(known[b][1] / known[a][1]) / math.log(known[b][0] / known[a][0]) for a, b in pairs}
