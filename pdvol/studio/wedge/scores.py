"""Scores: functions of a stored run, `score(run) -> float`; larger is better, NaN says that it cannot be said.

The ready ones are made by the functions below, from names of bodies and numbers. They look at the finest level that the
run has; `scored_body.at_level` gives a view of a run that ends at a coarser one. Scores of the end, and of the whole
motion, are NaN for a run that ended early.
"""

import ast
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.errors import InputError, PdvolError
from pdvol.runs.known_scenes import allow
from pdvol.runs.scene_file import Shot
from pdvol.runs.scene_modules import load_module
from pdvol.store.reader import Run
from pdvol.studio.shown import upward
from pdvol.studio.wedge.scored_body import ScoredBody, contact_distance, is_whole_run, not_simulated

Score = Callable[[Run], float]

QUIET_SHARE = 0.1  # of a run's steps, the last ones: over these a body has to be quiet


def upright(body: str, axis: Sequence[float] = ()) -> Score:
    """How upright a body is at the end: the cosine of the angle between up and the body's own axis, turned as the body
    is by its best rigid rotation (Kabsch 1976). 1 is upright, -1 upside down; no unit. In 2D and 3D; up is against
    gravity.

    Parameters
    ----------
    body : its name
    axis : what points up in an upright body, in its shape's coordinates before it was placed; where it is left out, the
        body is upright as it is placed in the scene
    """

    def score(run: Run) -> float:
        mine, up = ScoredBody.named(run, body), upward(run)
        own = mine.placed_direction(_direction(body, axis, len(up))) if len(axis) else up
        if not is_whole_run(run):
            return np.nan
        return float(np.clip(mine.rotation(run.info["steps"]) @ own @ up, -1.0, 1.0))

    return score


def lands_in(body: str, lower: Sequence[float], upper: Sequence[float]) -> Score:
    """Whether a body's centre of volume ends within a box: 1 inside, else minus its distance from the box, in sizes of
    the body (diagonals of its box at rest).

    Parameters
    ----------
    body : its name
    lower, upper : corners of the box [m], two or three numbers each; infinite ones leave a side open
    """
    low, high = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    if low.shape != high.shape or not (low <= high).all():
        raise InputError(f"lands_in({body!r}): lower = {lower!r} must not be above upper = {upper!r}")

    def score(run: Run) -> float:
        mine, d = ScoredBody.named(run, body), run.levels[0].rest.shape[1]
        if len(low) != d:
            raise InputError(f"lands_in({body!r}): the box has {len(low)} coordinates in a {d}D scene")
        if not is_whole_run(run):
            return np.nan
        centre = mine.centre(run.info["steps"])
        outside = float(np.linalg.norm(centre - np.clip(centre, low, high)))
        return 1.0 if outside == 0.0 else -outside / mine.size

    return score


def close_to(body: str, times: Sequence[float], points: Sequence[Sequence[float]]) -> Score:
    """How close a body's centre of volume comes to points at times: minus the root mean square of the distances, in
    sizes of the body. Between stored steps the centre moves on straight lines.

    Parameters
    ----------
    body : its name
    times : [s], within the shot
    points : as many points [m]
    """
    keys, places = np.atleast_1d(np.asarray(times, dtype=float)), np.atleast_2d(np.asarray(points, dtype=float))
    if len(keys) == 0 or len(keys) != len(places):
        raise InputError(f"close_to({body!r}): {len(keys)} times need as many points, not {len(places)}")

    def score(run: Run) -> float:
        mine, last = ScoredBody.named(run, body), run.info["steps"]
        d = run.levels[0].rest.shape[1]
        if places.shape[1] != d:
            raise InputError(f"close_to({body!r}): a point has {places.shape[1]} coordinates in a {d}D scene")
        if keys.min() < 0.0 or keys.max() > (last + 1e-6) * run.dt:
            raise InputError(f"close_to({body!r}): times must lie between 0 and {last * run.dt:g} s, the shot's length")
        frames = np.minimum(keys / run.dt, last)
        before = np.floor(frames).astype(int)
        if np.ceil(frames).max() >= mine.level.steps:
            return np.nan
        ends = [np.array([mine.centre(s) for s in steps]) for steps in (before, np.minimum(before + 1, last))]
        centres = ends[0] + (frames - before)[:, None] * (ends[1] - ends[0])
        return -float(np.sqrt(np.mean(np.sum((centres - places) ** 2, axis=1)))) / mine.size

    return score


def quiet(body: str | None = None) -> Score:
    """How quiet a body, or everything, is at the end: minus the root mean square [m/s], over the volume at rest and the
    last tenth of the steps, of the velocities between stored steps.
    """

    def score(run: Run) -> float:
        mine, last = ScoredBody.named(run, body), run.info["steps"]
        if not is_whole_run(run) or last == 0:
            return np.nan
        first = last - max(1, round(QUIET_SHARE * last)) + 1
        squares = [np.sum(mine.level.velocities(s)[mine.vertices] ** 2, axis=1) for s in range(first, last + 1)]
        return -float(np.sqrt(np.mean(squares, axis=0) @ mine.weights))

    return score


def largest_stretch(body: str | None = None) -> Score:
    """The largest principal stretch in a body, or in all: of all its cells' deformation gradients at all stored steps
    the largest singular value. 1 where nothing is stretched; no unit. `-largest_stretch()` asks for a small one.
    """

    def score(run: Run) -> float:
        mine = ScoredBody.named(run, body)
        if not is_whole_run(run):
            return np.nan
        rest = mine.level.rest[mine.cells]
        inverse = np.linalg.inv(rest[:, 1:] - rest[:, :1])
        largest = 0.0
        for step in range(run.info["steps"] + 1):
            x = mine.level.positions(step)[mine.cells]
            largest = max(largest, float(np.linalg.norm(inverse @ (x[:, 1:] - x[:, :1]), 2, axis=(1, 2)).max()))
        return largest

    return score


def first_contact(body: str | None = None) -> Score:
    """The time [s] at which something first touches: later is larger, and a shot in which nothing touches has its whole
    length. Touching is being closer than dhat at the end of a step.

    Without a body it is any contact, with itself as well, as the log counts them. With one it is that body against
    other bodies and obstacles, from distances in the stored states, the one at the start among them.
    """

    def score(run: Run) -> float:
        mine = ScoredBody.named(run, body)
        if body is None:
            steps = [record["step"] for record in mine.level.log if record["contacts"] > 0]
        else:
            dhat = contact_distance(run)
            others = [ScoredBody(run, i) for i in range(len(run.info["bodies"])) if i != mine.index]
            gaps = mine.gaps([*others, *run.obstacles])
            steps = [step for step in [next((k for k, gap in enumerate(gaps) if gap < dhat), None)] if step is not None]
        if not steps:
            return run.info["steps"] * run.dt if is_whole_run(run) else np.nan
        return min(steps) * run.dt

    return score


def meets(body: str, other: str) -> Score:
    """Whether a body touches another body or an obstacle: 1 where their smallest distance over all stored steps is
    below dhat, else minus what it is above that, in sizes of the body. What happens between stored steps is not seen.

    Parameters
    ----------
    body : its name
    other : the name of a body or an obstacle
    """

    def score(run: Run) -> float:
        mine, dhat = ScoredBody.named(run, body), contact_distance(run)
        obstacle = next((o for o in run.obstacles if o.name == other), None)
        if obstacle is None and other not in run.info["bodies"]:
            names = [*run.info["bodies"], *(o.name for o in run.obstacles)]
            raise InputError(f"{run.path}: nothing is called {other!r}; there are {', '.join(names)}")
        nearest = np.inf
        for gap in mine.gaps([ScoredBody.named(run, other) if obstacle is None else obstacle]):
            nearest = min(nearest, gap)
            if nearest < dhat:
                return 1.0
        return -(nearest - dhat) / mine.size if is_whole_run(run) else np.nan

    return score


READY = {f.__name__: f for f in (upright, lands_in, close_to, quiet, largest_stretch, first_contact, meets)}
"""The ready scores by name."""


def _direction(body: str, axis: Sequence[float], d: int) -> np.ndarray:
    direction = np.asarray(axis, dtype=float)
    if direction.shape != (d,) or not np.linalg.norm(direction) > 0.0:
        raise InputError(f"upright({body!r}): axis = {axis!r} must be a direction of {d} numbers")
    return direction / np.linalg.norm(direction)


# ---- scores as text


def chosen_scores(texts: Sequence[str], shot: Shot | Path | None, trusted: bool = True) -> dict[str, Score]:
    """The scores that texts name, by text: `upright("bear")` and the other ready ones; `my_score`, a function of the
    scene file; `module.py:my_score`. A minus in front turns a score round. Arguments are Python literals; a function
    with arguments in brackets makes a score, one without is a score.

    Parameters
    ----------
    shot : that is to be simulated, whose bodies ready scores must fit; or the scene file of a run
    trusted : whether the user gives the texts; other ones must have been given here before

    Raises
    ------
    InputError
        A text cannot be read, or names what there is not. The scores raise it where a function fails.
    """
    planned, file = (not_simulated(shot), shot.file) if isinstance(shot, Shot) else (None, shot)
    return {text: _chosen(text, file, planned, trusted) for text in texts}


def _chosen(text: str, scene_file: Path | None, planned: Run | None, trusted: bool) -> Score:
    file, colon, expression = text.strip().rpartition(".py:")
    source = Path(file.removeprefix("-").strip() + ".py") if colon else scene_file
    try:
        call: Any = ast.parse(("-" if file.startswith("-") else "") + expression.strip(), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        call = None
    sign = 1.0
    if isinstance(call, ast.UnaryOp) and isinstance(call.op, ast.USub):
        sign, call = -1.0, call.operand
    name = call.func if isinstance(call, ast.Call) else call
    if not isinstance(name, ast.Name):
        raise InputError(f'score {text!r} cannot be read; write upright("bear"), my_score, or module.py:my_score')
    ready: Any = None if colon else READY.get(name.id)
    if ready is None and source is not None and source.is_file():
        allow(source, text, trusted)
    function: Any = ready or (None if source is None else getattr(load_module(source, trusted), name.id, None))
    if not callable(function):
        where = "" if source is None else f" and {source.name} has no such function"
        raise InputError(f"score {text!r}: there is no {name.id}{where}; the ready scores are {', '.join(READY)}")
    with _one_line(text):
        if isinstance(call, ast.Call):
            named = {str(k.arg): _literal(k.value, text) for k in call.keywords}
            function = function(*(_literal(word, text) for word in call.args), **named)
        elif ready:
            function = ready()
        if ready and planned:
            function(planned)
    if not callable(function):
        raise InputError(f"score {text!r} is {type(function).__name__}, not a function of a run")

    def score(run: Run) -> float:
        with _one_line(text):
            return sign * float(function(run))

    return score


def _literal(word: ast.expr, text: str) -> Any:
    """An argument of a score: a number, text or a tuple of them."""
    if isinstance(word, ast.Name):
        raise InputError(f'score {text!r}: {word.id} is a name; write text in quotes, as "{word.id}"')
    return ast.literal_eval(word)


@contextmanager
def _one_line(text: str) -> Iterator[None]:
    """Failures of a user's function, as an InputError of one line."""
    try:
        yield
    except PdvolError:
        raise
    except (Exception, SystemExit) as error:
        raise InputError(f"score {text!r}: {type(error).__name__}: {' '.join(str(error).split())}") from error
