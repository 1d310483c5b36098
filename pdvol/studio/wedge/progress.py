"""How far a wedge is: one bar on a terminal, a line per ended run anywhere else; both in wedge.log."""

from pathlib import Path
from typing import Any, TextIO

from tqdm import tqdm

from pdvol.runs.notebook_text import progress_stream
from pdvol.studio.variations.jobs import Outcome

BEST_DIGITS = 4  # of the best score so far


class WedgeProgress:
    """Progress of the runs of a wedge.

    Parameters
    ----------
    total : runs
    log : file to which the lines are added
    best_of : text of the score whose largest value is shown; none when empty
    stream : `progress_stream()` when None
    """

    def __init__(self, total: int, log: Path, best_of: str = "", stream: TextIO | None = None):
        self.total, self.done, self.best_of = total, 0, best_of
        self.best: tuple[float, int] | None = None
        self.failed = 0
        self._log, self._stream = log, progress_stream() if stream is None else stream
        self._bar: tqdm | None = None
        if self._stream.isatty():
            self._bar = tqdm(total=total, desc="wedge", unit="run", file=self._stream, dynamic_ncols=True)

    def ended(self, entry: dict[str, Any], outcome: Outcome) -> None:
        """Shows one ended run."""
        self.done += 1
        self.failed += outcome.state != "done"
        score = entry["scores"].get(self.best_of)
        if score is not None and (self.best is None or score > self.best[0]):
            self.best = (score, entry["number"])
        line = self._line(entry, outcome)
        with open(self._log, "a") as log:
            log.write(line + "\n")
        if self._bar is None:
            self._stream.write(line + "\n")
            self._stream.flush()
            return
        self._bar.set_postfix_str(", ".join(self._notes()), refresh=False)
        self._bar.update()

    def _notes(self) -> list[str]:
        notes = [f"{self.failed} failed"] if self.failed else []
        if self.best is not None:
            notes.append(f"best {self.best[0]:.{BEST_DIGITS}g} (number {self.best[1]})")
        return notes

    def _line(self, entry: dict[str, Any], outcome: Outcome) -> str:
        how = f"done in {outcome.seconds:.1f} s" if outcome.seconds else "stored before"
        state = how if outcome.state == "done" else f"{outcome.state}: {outcome.reason}"
        line = f"{self.done}/{self.total}  number {entry['number']}, {entry['name']}: {state}"
        return "; ".join([line, *(self._notes() if self.best_of else [])])

    def close(self) -> None:
        """Leave the bar as it stands."""
        if self._bar is not None:
            self._bar.close()
