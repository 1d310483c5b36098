"""./run passes everything through and prints clear messages. Inside the environment it calls the command at once, so
these tests are quick.
"""

import os
import pty
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from commands import SAFETY

RUN = Path(__file__).resolve().parents[1] / "run"
INSIDE = f"{os.environ.get('PDVOL_DEBIAN', '') or 'trixie'}:{RUN.parent}"

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="./run is a bash script")


def run(*args, inside=True, env=None, **options):
    env = {**os.environ, **(env or {})}
    env.pop("PDVOL_INSIDE", None)
    if inside:
        env["PDVOL_INSIDE"] = INSIDE
    options = {"capture_output": True, "text": True, "timeout": SAFETY, **options}
    return subprocess.run([str(RUN), *map(str, args)], env=env, **options)


@pytest.mark.parametrize("status", [0, 1, 7, 255])
def test_exit_status(status):
    assert run("sh", "-c", f"exit {status}").returncode == status


def test_death_by_signal_is_passed_on():
    died = run(sys.executable, "-c", "import os, signal; os.kill(os.getpid(), signal.SIGKILL)")
    assert died.returncode == -signal.SIGKILL


def test_arguments_arrive_unchanged():
    words = ["a b", 'it\'s "quoted"', "two\nlines", "", "*", "$HOME", "--", "-x", "ü"]
    assert run(sys.executable, "-c", "import sys; print(ascii(sys.argv[1:]))", *words).stdout.strip() == ascii(words)


def test_standard_streams():
    done = run("sh", "-c", "cat; echo aside >&2", input="hello\n")
    assert (done.stdout, done.stderr) == ("hello\n", "aside\n")


def test_environment_and_folder_are_kept(tmp_path):
    folder = tmp_path / "with a space"
    folder.mkdir()
    link = folder / "link"
    link.symlink_to(RUN)
    env = {**os.environ, "PDVOL_INSIDE": INSIDE, "PDVOL_WORD": "one two"}
    done = subprocess.run(
        [link, "sh", "-c", 'pwd; echo "$PDVOL_WORD"'],
        cwd=folder,
        env=env,
        capture_output=True,
        text=True,
        timeout=SAFETY,
    )
    assert done.stdout == f"{folder}\none two\n", done.stderr


@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT"])
def test_signals_reach_the_command(name):
    script = "trap 'exit 5' TERM; trap 'exit 6' INT; echo $$; while :; do sleep 0.05; done"
    # A suite that runs in the background inherits an ignored SIGINT, and a shell cannot trap what it found ignored.
    heeding = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)
    env = {**os.environ, "PDVOL_INSIDE": INSIDE}
    with subprocess.Popen(
        [RUN, "sh", "-c", script], env=env, stdout=subprocess.PIPE, text=True, preexec_fn=heeding
    ) as process:
        try:
            assert int(process.stdout.readline()) == process.pid
            process.send_signal(getattr(signal, name))
            assert process.wait(SAFETY) == {"SIGTERM": 5, "SIGINT": 6}[name]
        finally:
            process.kill()


@pytest.mark.parametrize("inside", [True, False])
def test_without_a_command_it_says_what_to_do(inside):
    done = run(inside=inside)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.count("\n") == 1 and "./run pdvol" in done.stderr


def test_unknown_suite():
    done = run("true", inside=False, env={"PDVOL_DEBIAN": "buster"})
    assert done.returncode == 2
    assert done.stderr == "run: PDVOL_DEBIAN=buster is not a suite with dolfinx >= 0.9; choose trixie or sid\n"


def test_another_suite_is_not_taken_for_this_one():
    done = run("true", env={"PDVOL_DEBIAN": "buster"})
    assert done.returncode == 2


def test_a_cache_that_cannot_be_written(tmp_path):
    (tmp_path / "file").touch()
    # Also without the rights or tools for a root, the answer is one plain line.
    done = run("true", inside=False, env={"PDVOL_DEBIAN": "forky", "PDVOL_CACHE": str(tmp_path / "file" / "cache")})
    assert done.returncode == 2
    assert done.stderr.startswith("run: ") and done.stderr.count("\n") == 1


def test_missing_mount_namespaces_are_named(tmp_path):
    fake = tmp_path / "unshare"
    fake.write_text("#!/bin/sh\nexit 1\n")
    fake.chmod(0o755)
    for name in ("mount", "chroot", "flock"):
        (tmp_path / name).symlink_to("/bin/true")
    env = {"PDVOL_DEBIAN": "sid", "PDVOL_CACHE": str(tmp_path / "cache"), "PATH": f"{tmp_path}:{os.environ['PATH']}"}
    done = run("true", inside=False, env=env)
    assert done.returncode == 2 and "does not allow mount namespaces" in done.stderr
    assert not (tmp_path / "cache").exists()


# ---- what a build shows

BUILD = """
set -euo pipefail
eval "$(sed -n '/^say()/p; /^shown()/,/^}/p' "$1")"
build() { for n in one two; do echo "I: stage $n" >>"$log"; sleep 2; done; }
fail() { echo "I: stage one" >>"$log"; sleep 2; exit 3; }
log=$2
(shown "$log" "$3")
"""


def test_a_build_has_a_line_per_stage_in_a_log(tmp_path):
    words = ["bash", "-c", BUILD, "bash", RUN, tmp_path / "log", "build"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=SAFETY)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    lines = [re.sub(r"\d+ s", "N s", line) for line in done.stderr.splitlines()]
    assert lines[-3:] == ["run: stage one, after N s", "run: stage two, after N s", "run: done in N s"]
    failed = subprocess.run([*words[:-1], "fail"], capture_output=True, text=True, timeout=SAFETY)
    assert failed.returncode == 3 and "done" not in failed.stderr


def test_a_build_rewrites_a_line_on_a_terminal(tmp_path):
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        ["bash", "-c", BUILD, "bash", RUN, tmp_path / "log", "build"], stdin=theirs, stdout=theirs, stderr=theirs
    )
    os.close(theirs)
    shown = b""
    try:
        while chunk := os.read(ours, 4096):
            shown += chunk
    except OSError:  # the other side is closed
        pass
    assert process.wait(SAFETY) == 0
    text = shown.decode()
    assert "\r\x1b[Krun: stage one, " in text and "\r\x1b[Krun: stage two, " in text
    assert text.endswith("s\r\n") and text.count("\n") == 1, "one line is left: done in N s"
