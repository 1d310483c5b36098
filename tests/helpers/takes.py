"""Takes by a random hand, which drags, throws, presses and lets go, and moves obstacles. As a command, takes of demos:

./run env PYTHONPATH=tests/helpers python tests/helpers/takes.py [--takes 10] [--levels 1] [--first 0]

Of each take it prints defects by `verify`, the most Newton iterations of a step, how many steps were cut, in how many
obstacles waited, and how far levels are from level 0, as fractions of a body's size: at the end, and at most.
"""

import json
import tempfile
from argparse import ArgumentParser
from dataclasses import replace
from pathlib import Path

import numpy as np

import pdvol
from pdvol.geometry.level_mesh import body_sizes
from pdvol.measure.verify import verify_run
from pdvol.runs.run_metrics import motion_from_level_0
from pdvol.runs.runner import Execution, run_scene
from pdvol.runs.scene_file import Shot, load_shot
from pdvol.scene import Hand
from pdvol.store.folder import RECORD
from pdvol.studio.live import player

DEMOS = Path(__file__).resolve().parents[2] / "demos"
SCENES = {
    "ball_on_spike": {"height": 0.78},
    "drop": {"vertices": (150, 500, 1500)},
    "extreme_shapes": {"vertices": (65, 260, 950)},
    "melt": {},
    "worm": {},
}
"""Demos, with small meshes."""


def demo(name: str) -> pdvol.Scene:
    """A demo whose rigid obstacles are movable."""
    scene = load_shot(DEMOS / f"{name}.py", SCENES[name]).scene
    return replace(
        scene,
        obstacles=[replace(o, movable=True) if isinstance(o, pdvol.Rigid) else o for o in scene.obstacles],
    )


class RandomHand:
    """Follows the steps of a run, and puts the hand's state into a file after each."""

    def __init__(self, out: Path, channel: Path, seed: int):
        self._out, self._channel, self._random = out, channel, np.random.default_rng(seed)
        self._number, self._left, self._pull, self._offsets = 0, int(self._random.integers(1, 10)), None, {}

    def step(self, record) -> None:
        run = pdvol.open_run(self._out)
        self._left -= 1
        if self._left <= 0:
            self._choose(run, run.levels[0], record["step"])
        elif self._pull is not None:
            self._velocity = self._velocity + 0.1 * self._speed * self._random.normal(size=len(self._velocity))
            self._pull["point"] = (np.array(self._pull["point"]) + run.dt * self._velocity).tolist()
        put(self._channel, [self._pull] if self._pull else [], self._offsets)

    def _choose(self, run, level, step: int) -> None:
        random, dim, sizes = self._random, level.rest.shape[1], body_sizes(level.mesh)
        movable = [o.name for o in run.obstacles if "positions" in o.arrays]
        held, self._pull = self._pull is not None, None
        if held and random.random() < 0.6:  # what was thrown flies
            self._left = int(random.integers(5, 30))
        elif movable and random.random() < 0.3:
            way = random.normal(size=dim) * random.uniform(0.1, 1.0) * sizes.min()
            self._offsets = {**self._offsets, movable[random.integers(len(movable))]: way.tolist()}
            self._left = int(random.integers(5, 25))
        else:
            vertex = random.choice(np.unique(level.surface))
            body, place = int(level.mesh.point_bodies[vertex]), level.rest[vertex].tolist()
            self._number, name = self._number + 1, run.info["bodies"][body]
            self._pull = {"number": self._number, "body": name, "place": place}
            self._pull["point"] = level.positions(step)[vertex].tolist()
            self._speed = random.uniform(0.5, 8.0) * sizes[body]  # m/s
            self._velocity = random.normal(size=dim)
            self._velocity *= self._speed / np.linalg.norm(self._velocity)
            if random.random() < 0.7:
                self._velocity[1] = abs(self._velocity[1])
            self._left = int(random.integers(3, 30))

    def lasts(self, record) -> None:
        pass

    def close(self) -> None:
        pass


def put(channel: Path, pulls=(), obstacles=None) -> None:
    """The state of a hand, as a page's server writes it."""
    aside = channel.with_suffix(".aside")
    aside.write_text(json.dumps({"pulls": list(pulls), "obstacles": obstacles or {}}))
    aside.replace(channel)


def play(scene: pdvol.Scene, out: Path, steps: int, watch=None, resume: bool = False) -> None:
    """Level 0 by hand, by the state in the file `out`.state, as fast as it is solved."""
    shot = player.played(Shot(None, {}, scene), out, out.with_suffix(".state"), steps)
    sleep, player.time.sleep = player.time.sleep, lambda seconds: None
    try:
        run_scene(shot, out, 0, 0, resume=resume, how=Execution(progress=watch, xdmf=False))
    finally:
        player.time.sleep = sleep


def random_take(scene: pdvol.Scene, out: Path, seed: int, steps: int) -> pdvol.Scene:
    """A random take in a run folder; returns the scene with its hand."""
    play(scene, out, steps, lambda *_: RandomHand(out, out.with_suffix(".state"), seed))
    return replace(scene, hand=Hand(out / RECORD), steps=steps)


def judged(out: Path) -> dict:
    """What the command prints of a take."""
    run = pdvol.open_run(out)
    log = run.levels[0].log
    found = {
        "defects": verify_run(out),
        "iterations": max(record["newton_iterations"] for record in log),
        "cut": sum(record["cuts"] > 0 for record in log),
        "slow": {r["step"]: r["newton_iterations"] for r in log if r["newton_iterations"] > 60},
        "waiting": sum(record.get("behind", 0.0) > 0.0 for record in log),
    }
    sizes = body_sizes(run.levels[0].mesh)
    for entry in motion_from_level_0(run)[1:]:
        ends = [drift / size for drift, size in zip(entry["centre_drifts"].values(), sizes, strict=True)]
        found[f"level {entry['level']}"] = (round(max(ends), 4), round(entry["largest_distance"] / sizes.max(), 4))
    return found


def main() -> None:
    parser = ArgumentParser()
    for name, value in (("--takes", 10), ("--levels", 1), ("--first", 0), ("--steps", 100)):
        parser.add_argument(name, type=int, default=value)
    options = parser.parse_args()
    scenes = {name: demo(name) for name in SCENES}
    for seed in range(options.first, options.first + options.takes):
        name = list(SCENES)[seed % len(SCENES)]
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder, "take")
            try:
                scene = random_take(scenes[name], out, seed, options.steps)
                if options.levels:
                    last = min(options.levels, scene.levels - 1)
                    run_scene(Shot(None, {}, scene), out, 0, last, resume=True, how=Execution(xdmf=False))
                print(seed, name, judged(out), flush=True)
            except pdvol.ConvergenceError as error:
                print(seed, name, "ended:", error, flush=True)


if __name__ == "__main__":
    main()
