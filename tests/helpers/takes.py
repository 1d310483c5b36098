"""Takes by a random hand, which drags, throws, presses and lets go, and moves obstacles."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

import pdvol
from pdvol.geometry.level_mesh import body_sizes
from pdvol.runs.runner import Execution, run_scene
from pdvol.runs.scene_file import Shot
from pdvol.scene import Hand
from pdvol.store.folder import RECORD
from pdvol.studio.live import player


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
