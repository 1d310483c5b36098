"""Level 0 by hand: it follows the clock, and before each step the hand's present state goes into its record.

The state is a small JSON file that another process replaces whole, with `pulls` and `obstacles` as a line of the record
has them (`pdvol.scene.hand`); offsets are those wanted. The line of a step is written before the step before it is
solved: whether forces jump between two steps is then known where the first one ends (`LevelModel.begins_anew`).
"""

import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.geometry.closed_surfaces import gyration_diagonal
from pdvol.runs.scene_file import Shot, with_hand
from pdvol.scene import Hand, Led, Pull
from pdvol.scene.checks import near, plain, require, vector
from pdvol.scene.hand import check_pull
from pdvol.store.folder import RECORD

SPEED = 5.0  # diagonals of the smallest body that a hand shifts things by in a second, about as fast as a pull
YIELDING = 0.1  # of that speed, at which a hand presses against what holds it back
LAG = 0.02  # seconds in which a pull's point comes to the hand, but for 37 %: jumps would cost an iteration a step more
GRIP = 0.2  # of the body's diagonal: what is further from its point is drawn there, not taken where it is
LONGEST = 10  # times a scene's steps: a take is no longer unless the user says so
MOST_PULLS = 10  # at a time: fingers
MOST_SAID = 100  # lines about mistakes, so that a page that makes them again and again fills no disk


def played(shot: Shot, out: Path, channel: Path, steps: int | None) -> Shot:
    """A shot that a hand plays into a run folder, by its state in the file `channel`, for so many steps at most."""
    hand = Hand(out.resolve() / RECORD, channel.resolve())
    return with_hand(shot, hand, steps or LONGEST * shot.scene.steps)


class Player:
    """Writes the record of a hand, and marches level 0 with it.

    Parameters
    ----------
    model : LevelModel
    hand : with a channel
    step : the step after which the march begins
    """

    def __init__(self, model: Any, hand: Hand, step: int):
        self._model, self._hand, self._said = model, hand, set[str]()
        mesh = model.mesh
        owners = mesh.bodies[mesh.boundary_cells]
        self._sizes = [gyration_diagonal(mesh.points, mesh.boundary[owners == i]) for i in range(len(model.bodies))]
        self._farthest = SPEED * min(self._sizes) * model.dt
        self._share = 1.0 - np.exp(-model.dt / LAG)
        movers = {f"obstacle {i}": o.motion for i, o in enumerate(model.obstacles)}
        movers |= {f"support {i}": s.motion for i, s in enumerate(model.supports)}
        self._movers = {motion.name: (name, motion) for name, motion in movers.items() if isinstance(motion, Led)}
        self._sample: dict[str, Any] = {}
        if hand.steps <= step:  # the march begins anew where forces jump
            self._write(step + 1, None)

    def led(self, march: Iterator[Any]) -> Iterator[Any]:
        """The same steps, as the hand plays them. Simulated time never runs ahead of the clock. Where steps are slow it
        lags, and leaves out none.
        """
        due, last, dt = time.monotonic(), None, self._model.dt
        while True:
            due = max(due, time.monotonic() - dt) + dt  # what was slow is not made up for
            time.sleep(max(0.0, due - time.monotonic()))
            self._write(self._hand.steps + 1, last)
            last = next(march, None)
            if last is None:
                return
            yield last

    def _write(self, step: int, last: Any) -> None:
        """Adds the line of a step, which goes on from the line before it; `last` is the report of the last step."""
        try:
            sample = json.loads(self._hand.channel.read_bytes()) if self._hand.channel else {}
            require(isinstance(sample, dict), "its state must be a JSON object")
            self._sample = sample
        except FileNotFoundError:
            self._sample = {}
        except (OSError, ValueError, RecursionError) as error:
            self._say(error)
        before = self._hand.line(step - 1)
        line = {"step": step, "pulls": self._pulls(before, last), "obstacles": self._offsets(before, last)}
        if isinstance(number := self._sample.get("sample"), int):
            line["sample"] = number
        with open(self._hand.file, "ab") as file:
            file.write((json.dumps(line) + "\n").encode())

    def _pulls(self, before: dict[str, Any], last: Any) -> list[dict[str, Any]]:
        """Those that are held. One whose new point is wrong keeps its last one."""
        held, found = {pull["number"]: pull for pull in before["pulls"]}, dict[int, dict[str, Any]]()
        given = self._sample.get("pulls", [])
        for pull in given if isinstance(given, list) else []:
            known = None
            try:
                known = held.get(pull.get("number")) if isinstance(pull, dict) else None
                pull = pull if known is None else {**known, "point": pull.get("point")}
                self._check(pull)
                if known is not None:
                    pull["point"] = (known["point"] + self._share * np.subtract(pull["point"], known["point"])).tolist()
                else:
                    keys = ("number", "body", "place", "point", "stiffness")
                    pull = {key: pull[key] for key in keys if key in pull} | self._grip(pull, last)
            except (InputError, TypeError) as error:
                self._say(error)
                pull = known
            if pull is not None and len(found) < MOST_PULLS:
                found.setdefault(pull["number"], pull)
        return list(found.values())

    def _grip(self, pull: dict[str, Any], last: Any) -> dict[str, Any]:
        """How far a patch that is taken at its place is from the point: the hand does not pull before it moves."""
        if last is None:
            return {}
        keys = pull["body"], pull["place"], (0.0, 1.0), (pull["point"], pull["point"]), pull.get("stiffness")
        points, shares, _ = self._model.pulls[0].bound(Pull(*keys))
        grip = shares @ last.positions[points] - np.array(pull["point"])
        near_by = np.linalg.norm(grip) <= GRIP * self._sizes[self._model.bodies.index(pull["body"])]
        return {"grip": grip.tolist()} if near_by else {}

    def _check(self, pull: Any) -> None:
        check_pull(pull)
        mesh, bodies = self._model.mesh, self._model.bodies
        require(pull["body"] in bodies, f"there is no body {pull['body']!r}")
        require(len(pull["place"]) == len(pull["point"]) == mesh.dim, f"a pull has {mesh.dim} components here")
        mine = mesh.points[mesh.point_bodies == bodies.index(pull["body"])]
        near("place", np.array(pull["place"], dtype=float), mine, pull["body"])

    def _offsets(self, before: dict[str, Any], last: Any) -> dict[str, list[float]]:
        """Those of all that the hand has moved, nearer to what is wanted. Where bodies have to give way, in parts of a
        step, the hand slows down. Where contact holds something back, it gives way.
        """
        found, dim = dict(before["obstacles"]), self._model.mesh.dim
        slow = 1 if last is None else 1 + last.remedies["substeps"]
        farthest = dict.fromkeys(self._movers, self._farthest / slow)
        for name, (mover, motion) in self._movers.items():
            late = 0.0 if last is None else last.late.get(mover, 0.0) if last.late else last.behind
            if late > 0.0 and name in found:
                found[name] = motion.offset(last.time - late, dim).tolist()
                farthest[name] *= YIELDING
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
            found[name] = (at + way * min(1.0, farthest[name] / max(float(np.linalg.norm(way)), 1e-300))).tolist()
        return found

    def _say(self, error: Exception) -> None:
        """One line for each mistake."""
        text = f"hand: {' '.join(str(error).split())}"
        if text not in self._said and len(self._said) < MOST_SAID:
            self._said.add(text)
            sys.stderr.write(f"{text}\n")
            sys.stderr.flush()
