"""Runs a command that ends with the one who asked for it:  python watch.py LOG COMMAND ...

What the command prints goes into LOG. When standard input ends, as it does when Blender quits, crashes or cancels, the
command ends with all that it has started. The exit status is the command's.
"""

import os
import signal
import subprocess
import sys
import threading

PATIENCE = 3.0  # seconds between the request to end and the end: pdvol keeps every finished step whenever it ends
NOT_OURS = ("PYTHONHOME", "PYTHONPATH", "VIRTUAL_ENV")
"""Variables of Blender's Python, which another Python must not take for its own."""


def main(log: str, command: list[str]) -> int:
    """Run the command; its exit status."""
    with open(log, "ab", buffering=0) as out:
        try:
            child = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.STDOUT,
                env={name: value for name, value in os.environ.items() if name not in NOT_OURS},
                start_new_session=True,
            )
        except OSError as error:
            out.write(f"pdvol: cannot run {command[0]}: {error.strerror}\n".encode())
            return 127
    threading.Thread(target=_end_with_input, args=(child,), daemon=True).start()
    code = child.wait()
    _signal(child, signal.SIGTERM)  # what it has left behind
    return code


def _end_with_input(child: subprocess.Popen) -> None:
    while os.read(sys.stdin.fileno(), 4096):  # not through sys.stdin, which Python locks when it ends
        pass
    _signal(child, signal.SIGTERM)
    try:
        child.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        _signal(child, getattr(signal, "SIGKILL", signal.SIGTERM))


def _signal(child: subprocess.Popen, number: int) -> None:
    """To a command and all that it has started; of Windows, which has no such groups, to the command."""
    try:
        if hasattr(os, "killpg"):
            os.killpg(child.pid, number)
        elif child.poll() is None:
            child.terminate()
    except (ProcessLookupError, PermissionError):
        pass


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
