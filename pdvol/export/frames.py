"""When an animation shows what: stored steps at their own times, or frames of a usual rate between them.

A frame between two steps is interpolated linearly. Its velocity is the mean velocity of that step, which is the
derivative of the interpolated motion: motion blur and sub-frames agree with the frames. The contact guarantees of the
solver hold at the steps. Between them they do not: a frame may cross a curved obstacle or another body by a part of
the distance that is covered in a step.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

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
    share : of the step that has passed at the frame, above 0 and at most 1; 1 is the stored state itself
    """

    code: float
    step: int
    share: float

    def sampled(self, at: Callable[[int], np.ndarray]) -> np.ndarray:
        """What changes linearly from step to step, at this frame; `at(step)` gives it at the end of a step."""
        if self.share == 1.0:
            return at(self.step)
        return (1.0 - self.share) * at(self.step - 1) + self.share * at(self.step)


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
        share = 1.0 - (step - passed)
        frames.append(Frame(float(code), step, 1.0 if share > 1.0 - _WHOLE else share))
    return frames
