"""The benchmark's command in a short form. Its measures are also tested on shapes whose answer is known."""

import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.peers import __main__ as peers
from benchmarks.peers import measure, report
from benchmarks.peers import scenes as peer_scenes
from commands import SAFETY
from pdvol.geometry.level_mesh import boundary_facets

ROOT = Path(__file__).resolve().parents[2]
needs_peers = pytest.mark.skipif(
    not (peer_scenes.PEERS / "README.md").is_file(), reason="the peers' meshes are not there"
)


def command(*words):
    return subprocess.run(
        [sys.executable, "-m", "benchmarks.peers", *map(str, words)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=SAFETY,
    )


@needs_peers
def test_drop_500_short(tmp_path):
    steps = 3
    done = command("--scenes", "drop_500", "--ranks", "1", "--steps", steps, "--repeats", 3, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "peers.md").read_text() in done.stdout
    result = json.loads((tmp_path / "peers.json").read_text())
    assert result["machine"]["cores"] >= 1 and result["machine"]["memory_gb"] > 0
    (record,) = result["scenes"]
    assert (record["scene"], record["ranks"], record["ok"], record["sound"], record["steps"]) == (
        "drop_500",
        1,
        True,
        True,
        steps,
    )
    assert (record["vertices"], record["tets"]) == (480, 1852)
    assert 0 < record["seconds"]["median"] <= record["seconds"]["max"] < record["wall_seconds"]
    assert sum(record["seconds_by_part"].values()) == pytest.approx(record["seconds"]["mean"])
    assert record["newton"]["mean"] >= 1 and record["memory_mb"] > 50
    assert (
        record["seconds_with_storage"]["without_contact"] > 0 and record["seconds_with_storage"]["with_contact"] is None
    )
    assert record["det_f_min"] == pytest.approx(1.0) and record["states_searched"] == steps + 1
    assert len(record["means"]) == 3 and record["seconds"]["mean"] == sorted(record["means"])[1]
    assert all(ms > 0.0 for ms in record["loop_ms"])
    # Three steps are neither the peers' mean nor their last state.
    assert (
        record["stark"]["seconds"]["1"] == 0.0174
        and record["stark"]["ratio"] is None
        and "rms_m" not in record["stark"]
    )


@pytest.mark.parametrize(
    "words", [("--scenes", "nothing"), ("--ranks", "0"), ("--repeats", "0"), ("--peers", "/nonexistent")]
)
def test_a_mistake_is_one_line(words, tmp_path):
    done = command(*words, "--out", tmp_path)
    assert (
        done.returncode == 2
        and done.stderr.startswith("benchmarks.peers: ")
        and done.stderr.count("\n") == 1
        and not done.stdout
    )


def test_the_groups_name_every_scene():
    names = [name for group in peers.GROUPS.values() for name in group]
    assert sorted(names) == sorted(peer_scenes.SCENES)
    assert peers.chosen("small,drop_500") == list(peers.GROUPS["small"]) and peers.chosen("all") == names


@pytest.mark.parametrize(
    "dent,fall,through", [(0.0, 0.0, False), (1.2, 0.6, False), (0.0, 0.6, True), (1.2, 2.6, True)]
)
def test_what_has_come_through_a_slab(dent, fall, through):
    slab, ball = peer_scenes.brick((1.0, 0.1, 1.0), (12, 1, 12)), peer_scenes.brick((0.1, 0.1, 0.1), (1, 1, 1))
    rest = np.vstack([slab.vertices - [0.0, 0.05, 0.0], ball.vertices + [0.0, 0.1, 0.0]])
    cells = np.vstack([slab.cells, ball.cells + len(slab.vertices)])
    bodies = np.repeat([0, 1], [len(slab.cells), len(ball.cells)])
    surface = boundary_facets(cells.astype(np.int64))[0]
    level = SimpleNamespace(rest=rest, cells=cells, bodies=bodies, surface=surface)
    positions = rest.copy()
    positions[: len(slab.vertices), 1] -= (
        dent * np.clip(1.0 - 2.0 * np.hypot(*slab.vertices[:, [0, 2]].T), 0.0, None) ** 0.5
    )
    positions[len(slab.vertices) :, 1] -= fall
    found = measure.come_through(SimpleNamespace(info={"bodies": ["slab", "ball"]}), level, positions)
    assert found == (len(ball.vertices) if through else 0)


def test_the_median_run_is_reported_unless_a_run_failed():
    runs = [{"ok": True, "sound": True, "seconds": {"mean": mean}} for mean in (0.3, 0.1, 0.2)]
    assert peers.middle(runs) == {**runs[2], "means": [0.3, 0.1, 0.2]}
    assert peers.middle([*runs, bad := {"ok": True, "sound": False, "seconds": {"mean": 0.2}}]) is bad


def test_growth_and_gain():
    records = [
        {
            "scene": name,
            "ranks": ranks,
            "ok": True,
            "steps": 5,
            "vertices": n,
            "seconds": {"mean": n / ranks},
            "seconds_per_newton": n**1.5,
        }
        for name, n in (("twist_4k", 4000), ("twist_20k", 20000))
        for ranks in (1, 2)
    ]
    assert report.exponents(records) == {("twist_4k", "twist_20k"): pytest.approx(1.5)}
    assert report.gains(records) == {"twist_4k": 2.0, "twist_20k": 2.0}
