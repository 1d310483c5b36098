"""How far a run is, from its folder alone."""

import json
from dataclasses import dataclass, field
from pathlib import Path


@dataclass
class RunProgress:
    """A run folder that is looked at again and again; it may not be there yet.

    Attributes
    ----------
    folder : of the run
    steps : how many it is to have; 0 where that is not known yet
    reached : the last stored step, by level
    """

    folder: Path
    steps: int = 0
    reached: dict[int, int] = field(default_factory=dict)
    _read: int = 0

    def look(self) -> bool:
        """Read what is new; whether anything is."""
        log = self.folder / "log.jsonl"
        try:
            self.steps = int(json.loads((self.folder / "run.json").read_text())["steps"])
            size = log.stat().st_size
            if size < self._read:  # another run has taken its place
                self._read, self.reached = 0, {}
            with open(log, "rb") as file:
                file.seek(self._read)
                data = file.read()
        except (OSError, ValueError, KeyError):
            return False
        whole = data[: data.rfind(b"\n") + 1]
        self._read += len(whole)
        found = False
        for line in whole.splitlines():
            try:
                record = json.loads(line)
                level, step = int(record["level"]), int(record["step"])
            except (ValueError, KeyError, TypeError):
                continue
            found = found or self.reached.get(level) != step
            self.reached[level] = step
        return found

    def complete(self, level: int) -> bool:
        """Whether a level has all of its steps."""
        return self.steps > 0 and self.reached.get(level, -1) >= self.steps

    def line(self) -> str:
        """`level 1, step 12 of 100`, of the finest level that has begun; empty before the first step."""
        if not self.reached:
            return ""
        level = max(self.reached)
        return f"level {level}, step {self.reached[level]} of {self.steps}"

    def fraction(self, level: int) -> float:
        """Of a level's steps, 0 to 1."""
        return self.reached.get(level, 0) / self.steps if self.steps else 0.0
