"""`pdvol live` as a process, for tests in a browser."""

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

from cli_scenes import write

PATIENCE_OF_TESTS = 300.0  # seconds for one thing to appear on a busy machine


class Live:
    """`pdvol live` as a process, for a scene's text or file."""

    def __init__(self, folder, scene, *words):
        self.folder = folder
        file = scene if isinstance(scene, Path) else write(folder / "fall.py", scene)
        self.process = subprocess.Popen(
            [sys.executable, "-m", "pdvol", "live", file, "--port", "0", "-o", folder / "kept", *words],
            stderr=subprocess.PIPE,
            text=True,
            env=os.environ | {"TMPDIR": str(folder)},
        )
        guard = threading.Timer(PATIENCE_OF_TESTS, self.process.kill)
        guard.start()
        found = (re.search(r"http://127\.0\.0\.1:\d+", line) for line in self.process.stderr)
        address = next(filter(None, found), None)
        guard.cancel()
        assert address, "the server ended"
        self.address = address[0]

    def end(self):
        """Its exit code and what it said, after Ctrl-C."""
        self.process.send_signal(signal.SIGINT)
        try:
            return self.process.communicate(timeout=PATIENCE_OF_TESTS)[1], self.process.returncode
        finally:
            self.process.kill()


def until(session, condition):
    limit = time.monotonic() + PATIENCE_OF_TESTS
    while not condition():
        session.tick()
        assert time.monotonic() < limit, vars(session.current)
        time.sleep(0.005)


def next_run(session, last=None):
    """The run after the present one, or after number `last`, at its end."""
    last = (session.current.number if session.current else 0) if last is None else last
    until(session, lambda: session.current is not None and session.current.number > last)
    until(session, lambda: not session.current.running)
    return session.current


def shows(tab, text, gone=False):
    """Wait until the page has this text, or has it no more."""
    tab.until(f"document.body.innerText.includes({json.dumps(text)}) !== {json.dumps(gone)}")
