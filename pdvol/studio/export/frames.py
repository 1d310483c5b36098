"""When an animation shows what: stored steps at their own times, or frames of a usual rate between them.

A frame between two steps is interpolated linearly. Its velocity is the mean one until the next frame: USD and its
readers move a frame's points by it, so motion blur and sub-frames lie on the straight way to the next frame. The last
frame repeats the velocity before it. The contact guarantees of the solver hold at the steps. Between them they do not:
a frame may cross a curved obstacle or another body by a part of the distance that is covered in a step.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pdvol.errors import InputError
from pdvol.stages import say

FILM_RATE = 24.0  # frames a second where the user chooses none: the usual rate of animation software
HIGHEST_FPS = 100_000.0  # frames a second; more is a slip of the keyboard
_WHOLE = 1e-6  # of a step: a frame that close to a stored state is that state


@dataclass(frozen=True)
class Frame:
    """One frame.

    Attributes
    ----------
    code : its number, a fraction where a step lies between two frames
    step : the step that contains it, which ends at it or later
    fraction : of the step that has passed at the frame, above 0 and at most 1; 1 is the stored state itself
    """

    code: float
    step: int
    fraction: float

    def sampled(self, at: Callable[[int], np.ndarray]) -> np.ndarray:
        """What changes linearly from step to step, at this frame; `at(step)` gives it at the end of a step."""
        if self.fraction == 1.0:
            return at(self.step)
        return (1.0 - self.fraction) * at(self.step - 1) + self.fraction * at(self.step)


Track = Iterator[tuple[np.ndarray, np.ndarray | None]]
"""Points (n, 3) [m] at each frame, and velocities (n, 3) [m/s] or None."""


def points_and_velocities(frames: Sequence[Frame], at: Callable[[int], np.ndarray], rate: float) -> Track:
    """Points (n, 3) [m] at each frame and their velocities (n, 3) [m/s] until the next one; the last frame repeats the
    velocities before it, and one frame alone has none. `at(step)` gives points, `rate` is the frames a second.
    """
    points, velocities = frames[0].sampled(at), None
    for frame, following in pairwise(frames):
        there = following.sampled(at)
        velocities = (there - points) * (rate / (following.code - frame.code))
        yield points, velocities
        points = there
    yield points, velocities


def said(what: str, frames: Sequence[Frame]) -> Iterator[Frame]:
    """The frames one after the other; the stage that lasts says at which of them the export of `what` is."""
    for number, frame in enumerate(frames, 1):
        say(f"{what}, frame {number} of {len(frames)}")
        yield frame


def stored_frames(steps: int, dt: float) -> list[Frame]:
    """Every stored state at its own time, counted in frames of `FILM_RATE`."""
    return [Frame(round(step * dt * FILM_RATE, 9), step, 1.0) for step in range(steps)]


def even_frames(steps: int, dt: float, fps: float) -> list[Frame]:
    """Whole frames from the start to the last stored state.

    Raises
    ------
    InputError
        `fps` is no positive number, or too large.
    """
    if not 0.0 < fps <= HIGHEST_FPS:
        raise InputError(f"--fps {fps:g}: choose a number of frames a second above 0, up to {HIGHEST_FPS:g}")
    count = int(np.floor(((steps - 1) + _WHOLE) * dt * fps)) + 1
    frames = []
    for code in range(count):
        passed = code / (fps * dt)  # in steps
        step = min(max(int(np.ceil(passed - _WHOLE)), 0), steps - 1)
        fraction = 1.0 - (step - passed)
        frames.append(Frame(float(code), step, 1.0 if fraction > 1.0 - _WHOLE else fraction))
    return frames
