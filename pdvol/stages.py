"""Named stages of long work outside of steps (meshing, compilation) for a progress reporter.

Code marks a stage by a `with stage(...)` block and knows no reporter. Without a reporter, as in library use, stages are
silent. Stages of a thread nest: the outermost one is shown, and those within it are its parts.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from threading import local
from typing import Protocol


class Stage:
    """One stage.

    Attributes
    ----------
    name : what is done, as "meshing body 'ball', level 2"
    detail : how far it is, as "try 3"; empty where nothing was said
    parts : seconds by name of the stages that ended within this one
    within : the name of the stage within this one that lasts now; empty where none does
    seconds : how long it took, once it has ended [s]
    failed : whether an error ended it
    """

    def __init__(self, name: str):
        self.name, self.detail, self.within = name, "", ""
        self.parts: dict[str, float] = {}
        self.seconds, self.failed = 0.0, False
        self._began = time.perf_counter()

    def elapsed(self) -> float:
        """Seconds since it began."""
        return time.perf_counter() - self._began


class Reporter(Protocol):
    """Shows stages. Its methods are called from several threads."""

    def begin(self, stage: Stage) -> None:
        """An outermost stage begins."""

    def end(self, stage: Stage) -> None:
        """It has ended."""


_reporters: list[Reporter] = []
"""The reporter in force, the last one."""
_thread = local()


@contextmanager
def reported_to(reporter: Reporter) -> Iterator[None]:
    """Within the block, stages of all threads are shown by this reporter."""
    _reporters.append(reporter)
    try:
        yield
    finally:
        _reporters.remove(reporter)


@contextmanager
def stage(name: str) -> Iterator[None]:
    """The block is a stage of this name; within another stage of the same thread, a part of it."""
    open_stages: list[Stage] = _thread.__dict__.setdefault("open", [])
    own = Stage(name)
    outer = open_stages[0] if open_stages else None
    reporter = _reporters[-1] if _reporters and outer is None else None
    before = outer.within if outer is not None else ""
    if outer is not None:
        outer.within = name
    if reporter is not None:
        reporter.begin(own)
    open_stages.append(own)
    try:
        yield
    except BaseException:
        own.failed = True
        raise
    finally:
        open_stages.pop()
        own.seconds = own.elapsed()
        if outer is not None:
            outer.within = before
            outer.parts[name] = outer.parts.get(name, 0.0) + own.seconds
        if reporter is not None:
            reporter.end(own)


def say(detail: str) -> None:
    """How far this thread's outermost stage is, in a few words; nothing where no stage lasts."""
    open_stages: list[Stage] = _thread.__dict__.get("open", [])
    if open_stages:
        open_stages[0].detail = detail
