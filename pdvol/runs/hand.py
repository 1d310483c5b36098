"""Level 0 played by hand: it follows the clock, and before each step the hand's present state goes into its record.

The state is a small JSON file that another process replaces whole, with `pulls` and `obstacles` as a line of the record
has them; offsets are those wanted. The line of a step is written before the step before it is solved: whether forces
jump between two steps is then known where the first one ends (`LevelModel.begins_anew`).
"""

import json
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.geometry.closed_surfaces import gyration_diagonal
from pdvol.levels.model import LevelModel
from pdvol.runs.scene_file import Shot
from pdvol.scene import RECORD, Hand, Led
from pdvol.scene.checks import near, plain, require, vector
from pdvol.scene.hand import check_pull
from pdvol.solve.report import StepReport

# Diagonals of the smallest body that a hand shifts things by in a second: in a step of 10 ms a tenth of one, so that
# nothing is carried across a body between two states.
SPEED = 10.0
LONGEST = 10  # times a scene's steps: a take is no longer unless the user says so
MOST_PULLS = 10  # at a time: fingers; what is more is no hand


def played(shot: Shot, out: Path, channel: Path, steps: int | None) -> Shot:
    """A shot that a hand plays into a run folder, by its state in the file `channel`, for so many steps at most."""
    hand = Hand(out.resolve() / RECORD, channel.resolve())
    return replace(shot, scene=replace(shot.scene, hand=hand, steps=steps or LONGEST * shot.scene.steps))


class Player:
    """Writes the record of a hand while level 0 is marched.

    Parameters
    ----------
    model : LevelModel, of level 0
    hand : Hand with a channel
    """

    def __init__(self, model: LevelModel, hand: Hand):
        self._model, self._hand, self._said = model, hand, set[str]()
        mesh = model.mesh
        owners = mesh.bodies[mesh.boundary_cells]
        sizes = (gyration_diagonal(mesh.points, mesh.boundary[owners == i]) for i in range(len(model.bodies)))
        self._farthest = SPEED * min(sizes) * model.dt
        movers = {f"obstacle {i}": o.motion for i, o in enumerate(model.obstacles)}
        movers |= {f"support {i}": s.motion for i, s in enumerate(model.supports)}
        self._movers = {motion.name: (name, motion) for name, motion in movers.items() if isinstance(motion, Led)}
        self._sample: dict[str, Any] = {}

    def led(self, march: Iterator[StepReport], step: int) -> Iterator[StepReport]:
        """The same march, whose first step begins after `step` steps; simulated time never runs ahead of the clock."""
        begin, last = time.monotonic(), None
        while True:
            begin = max(begin, time.monotonic() - self._model.dt)  # what was slow is not made up for
            time.sleep(max(0.0, begin + self._model.dt - time.monotonic()))
            begin += self._model.dt
            for number in range(self._hand.steps + 1, step + 3):
                self._write(number, last)
            step, last = step + 1, next(march, None)
            if last is None:
                return
            yield last

    def _write(self, step: int, last: StepReport | None) -> None:
        """Adds the line of a step, which goes on from the line before it."""
        try:
            sample = json.loads(self._hand.channel.read_bytes()) if self._hand.channel else {}
            require(isinstance(sample, dict), "its state must be a JSON object")
            self._sample = sample
        except FileNotFoundError:
            self._sample = {}
        except (OSError, ValueError, RecursionError) as error:
            self._say(error)
        before = self._hand.line(step - 1)
        line = {"step": step, "pulls": self._pulls(before), "obstacles": self._offsets(before, last)}
        with open(self._hand.file, "ab") as file:
            file.write((json.dumps(line) + "\n").encode())

    def _pulls(self, before: dict[str, Any]) -> list[dict[str, Any]]:
        held, found = {pull["number"]: pull for pull in before["pulls"]}, dict[int, dict[str, Any]]()
        given = self._sample.get("pulls", [])
        for pull in given if isinstance(given, list) else []:
            try:
                known = held.get(pull.get("number")) if isinstance(pull, dict) else None
                pull = pull if known is None else {**known, "point": pull.get("point")}
                self._check(pull)
                pull = {
                    key: plain(pull[key]) for key in ("number", "body", "place", "point", "stiffness") if key in pull
                }
            except (InputError, TypeError) as error:
                self._say(error)
                if known is None:
                    continue
                pull = known
            if len(found) < MOST_PULLS:
                found.setdefault(pull["number"], pull)
        return list(found.values())

    def _check(self, pull: Any) -> None:
        check_pull(pull)
        mesh, bodies = self._model.mesh, self._model.bodies
        require(pull["body"] in bodies, f"there is no body {pull['body']!r}")
        require(len(pull["place"]) == len(pull["point"]) == mesh.dim, f"a pull has {mesh.dim} components here")
        mine = mesh.points[mesh.point_bodies == bodies.index(pull["body"])]
        near("place", np.array(pull["place"], dtype=float), mine, pull["body"])

    def _offsets(self, before: dict[str, Any], last: StepReport | None) -> dict[str, list[float]]:
        found, dim = dict(before["obstacles"]), self._model.mesh.dim
        for name, (mover, motion) in self._movers.items():
            late = 0.0 if last is None else last.late.get(mover, 0.0) if last.late else last.behind
            if last is not None and late > 0.0 and name in found:  # contact holds it: the hand gives way
                found[name] = motion.offset(last.time - late, dim).tolist()
        given = self._sample.get("obstacles", {})
        for name, wanted in given.items() if isinstance(given, dict) else ():
            try:
                require(name in self._movers, f"{name!r} is nothing movable")
                vector(f"the offset of {name!r}", plain(wanted))
                require(len(wanted) == dim, f"the offset of {name!r} has {dim} components here")
            except InputError as error:
                self._say(error)
                continue
            at = np.array(found.get(name, [0.0] * dim))
            way = np.array(wanted, dtype=float) - at
            found[name] = (at + way * min(1.0, self._farthest / max(float(np.linalg.norm(way)), 1e-300))).tolist()
        return found

    def _say(self, error: Exception) -> None:
        """One line for each mistake."""
        text = f"hand: {' '.join(str(error).split())}"
        if text not in self._said and len(self._said) < 100:
            self._said.add(text)
            sys.stderr.write(f"{text}\n")
            sys.stderr.flush()
