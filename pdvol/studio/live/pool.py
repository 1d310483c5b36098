"""Worker processes that have their libraries loaded ahead, so that a run starts at once."""

import threading
import time
from collections.abc import Sequence
from pathlib import Path

from pdvol.processes import ProcessEnded
from pdvol.studio.wedge.worker import Worker

POOL_SIZE = 3  # processes: one runs level 0, one refines, one is spare
PATIENCE_OF_ABANDONED = 1.0  # seconds that a command line has to end after its interruption; its process is then ended


class Pool:
    """Keeps workers started. What is given up is interrupted and used again, or replaced where it does not follow.

    One thread calls its methods.
    """

    def __init__(self, size: int = POOL_SIZE) -> None:
        self._size = size
        self._idle = [Worker() for _ in range(size)]
        self._taken: list[Worker] = []
        self._given_up: list[tuple[Worker, float]] = []
        self._stopping: list[threading.Thread] = []

    def start(self, words: Sequence[str], log: Path) -> Worker:
        """Carry out `pdvol` with these words; what it prints goes to the file `log`. Of the workers that are not busy,
        the one that was started first is the one most likely loaded.
        """
        self.look()
        while self._idle:
            worker = self._idle.pop(0)
            try:
                worker.start(words, log)
                break
            except ProcessEnded:  # after it was found alive: a large one ends once it has answered
                worker.stop()
        else:
            worker = Worker()
            worker.start(words, log)
        self._taken.append(worker)
        return worker

    def give_back(self, worker: Worker) -> None:
        """Return a worker. Its command line is interrupted where it has not ended."""
        if worker not in self._taken:
            return
        self._taken.remove(worker)
        if worker.busy:
            worker.interrupt()
            self._given_up.append((worker, time.monotonic() + PATIENCE_OF_ABANDONED))
        elif worker.alive:
            self._idle.insert(0, worker)  # it has run this scene before, and has its kernels loaded

    def look(self) -> None:
        """Take interrupted workers back, end those that do not follow, and start others in place of ended ones."""
        now = time.monotonic()
        for entry in list(self._given_up):
            worker, limit = entry
            ended = worker.poll() is not None
            if not ended and now < limit:
                continue
            self._given_up.remove(entry)
            if ended and worker.alive:
                self._idle.insert(0, worker)
            elif not ended:
                self._stop_aside(worker)
        self._idle = [worker for worker in self._idle if worker.alive]
        self._stopping = [thread for thread in self._stopping if thread.is_alive()]
        while len(self._idle) + len(self._taken) + len(self._given_up) < self._size:
            self._idle.append(Worker())

    def close(self) -> None:
        """End all processes."""
        for worker in (*self._idle, *self._taken, *(worker for worker, _ in self._given_up)):
            self._stop_aside(worker)
        self._idle, self._taken, self._given_up = [], [], []
        for thread in self._stopping:
            thread.join()

    def _stop_aside(self, worker: Worker) -> None:
        thread = threading.Thread(target=worker.stop, daemon=True)  # its end may take a while
        thread.start()
        self._stopping.append(thread)
