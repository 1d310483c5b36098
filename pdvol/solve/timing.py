"""The seconds of a step, by part."""

import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager

PARTS = ("assembly", "contact", "ccd", "linear")


class Stopwatch:
    """Seconds by part; time in a nested part counts for the inner part only."""

    def __init__(self) -> None:
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self._open: list[float] = []

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Adds the time spent inside to `name`."""
        self._open.append(0.0)
        start = time.perf_counter()
        try:
            yield
        finally:
            spent = time.perf_counter() - start
            self.seconds[name] += spent - self._open.pop()
            if self._open:
                self._open[-1] += spent

    def report(self) -> dict[str, float]:
        """Seconds: total, each part, and the rest as `other`. Starts over."""
        total = self.seconds.pop("total", 0.0)
        parts = {name: self.seconds.get(name, 0.0) for name in PARTS}
        other = total + sum(self.seconds.get(name, 0.0) for name in self.seconds if name not in PARTS)
        self.seconds.clear()
        return {"total": other + sum(parts.values()), **parts, "other": other}
