"""./run passes everything through and prints clear messages. Inside the environment it calls the command at once, so
these tests are quick.
"""

import os
import pty
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from commands import SAFETY

RUN = Path(__file__).resolve().parents[1] / "run"
SUITE, USE = os.environ.get("PDVOL_DEBIAN", ""), os.environ.get("PDVOL_USE", "")
INSIDE = f"{USE or ('debian' if SUITE else '')}:{SUITE or 'trixie'}:{RUN.parent}"

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="./run is a bash script")


def run(*args, inside=True, env=None, **options):
    env = {**os.environ, **(env or {})}
    env.pop("PDVOL_INSIDE", None)
    if inside:
        env["PDVOL_INSIDE"] = INSIDE
    options = {"capture_output": True, "text": True, "timeout": SAFETY, **options}
    return subprocess.run([str(RUN), *map(str, args)], env=env, **options)


def test_status_arguments_streams_environment_and_folder_are_passed_on(tmp_path):
    for status in (0, 7):
        assert run("sh", "-c", f"exit {status}").returncode == status
    assert run("--help").stdout.startswith("./run COMMAND [ARG ...]: ")
    died = run(sys.executable, "-c", "import os, signal; os.kill(os.getpid(), signal.SIGKILL)")
    assert died.returncode == -signal.SIGKILL
    words = ["a b", 'it\'s "quoted"', "two\nlines", "", "*", "$HOME", "--", "-x", "ü"]
    assert run(sys.executable, "-c", "import sys; print(ascii(sys.argv[1:]))", *words).stdout.strip() == ascii(words)
    (folder := tmp_path / "with a space").mkdir()
    (folder / "link").symlink_to(RUN)
    words = [folder / "link", "sh", "-c", 'cat; pwd; echo "$PDVOL_WORD" >&2']
    env = {**os.environ, "PDVOL_INSIDE": INSIDE, "PDVOL_WORD": "one two"}
    done = subprocess.run(words, cwd=folder, env=env, input="hello\n", capture_output=True, text=True, timeout=SAFETY)
    assert (done.stdout, done.stderr) == (f"hello\n{folder}\n", "one two\n")


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


def test_what_cannot_be_chosen_or_written_is_one_line(tmp_path):
    done = run("true", inside=False, env={"PDVOL_USE": "", "PDVOL_DEBIAN": "buster"})
    assert done.returncode == 2
    assert done.stderr == "run: PDVOL_DEBIAN=buster is not a suite with dolfinx >= 0.9; choose trixie or sid\n"
    assert run("true", env={"PDVOL_USE": "", "PDVOL_DEBIAN": "buster"}).returncode == 2, "it is not taken for this one"
    (tmp_path / "file").touch()
    # Also without the rights or tools for a root, the answer is one plain line.
    env = {"PDVOL_USE": "", "PDVOL_DEBIAN": "forky", "PDVOL_CACHE": str(tmp_path / "file" / "cache")}
    done = run("true", inside=False, env=env)
    assert done.returncode == 2 and done.stderr.startswith("run: ") and done.stderr.count("\n") == 1


def script(path, text):
    path.write_text(f"#!/bin/sh\n{text}")
    path.chmod(0o755)


def forbid_namespaces(folder):
    """Commands of a machine that has the tools of a Debian root, and does not allow one."""
    script(folder / "unshare", "exit 1\n")
    for name in ("mount", "chroot", "flock"):
        (folder / name).symlink_to("/bin/true")


def test_missing_mount_namespaces_are_named(tmp_path):
    forbid_namespaces(tmp_path)
    env = {"PDVOL_CACHE": str(tmp_path / "cache"), "PATH": f"{tmp_path}:{os.environ['PATH']}"}
    done = run("true", inside=False, env={**env, "PDVOL_USE": "", "PDVOL_DEBIAN": "sid"})
    assert done.returncode == 2 and "does not allow mount namespaces" in done.stderr
    assert not (tmp_path / "cache").exists()


# ---- the three ways

PYTHON = r"""
echo "$*" >>"$CALLS"
case "$*" in
    *fenics-dolfinx*) [ "$HAS" = dolfinx ] ;;
    */wheel_needs.py) [ "$HAS" = wheel ] || { echo "Python >= 3.12, Python.h"; exit 1; } ;;
    "-m venv "*) for venv; do :; done; mkdir -p "$venv/bin"; cp "$0" "$venv/bin/python" ;;
esac
"""
"""A Python that has dolfinx, or all that the wheel needs, or neither. It makes an environment with itself alone."""


@pytest.fixture
def machine(tmp_path):
    """`machine(has, **variables)` calls a copy of ./run on a machine whose Python has this, and that allows no Debian
    root: what `python -c where` printed, what Python was called with, and the process.
    """
    copy, tools, calls = tmp_path / "pdvol", tmp_path / "tools", tmp_path / "calls"
    shutil.copytree(RUN.parent / "packaging", copy / "packaging")
    for name in ("run", "pyproject.toml"):
        shutil.copy(RUN.parent / name, copy)
    tools.mkdir()
    forbid_namespaces(tools)
    for name in ("python3", "python3.12", "python3.13", "python3.14"):
        script(tools / name, PYTHON)

    def call(has, **variables):
        calls.write_text("")
        path = f"{tools}:{os.environ['PATH']}"
        env = {**os.environ, "PDVOL_USE": "", "PDVOL_DEBIAN": "", "PATH": path, "CALLS": str(calls)}
        env |= {"HAS": has, "PDVOL_INSIDE": "", "PYTHONNOUSERSITE": ""}
        words = [copy / "run", "sh", "-c", "command -v python; echo $PYTHONNOUSERSITE"]
        done = subprocess.run(words, env=env | variables, capture_output=True, text=True, timeout=SAFETY)
        return done, [line for line in calls.read_text().splitlines() if line.startswith("-m ")]

    call.folder, call.log = copy, calls
    return call


def test_a_python_with_dolfinx_comes_first(machine):
    done, calls = machine("dolfinx")
    assert (done.returncode, done.stdout) == (0, f"{machine.folder}/.venv/bin/python\n\n"), done.stderr
    assert calls[0] == f"-m venv --system-site-packages {machine.folder}/.venv"
    assert calls[1].endswith(f"--editable {machine.folder}[all]")
    assert machine("dolfinx")[1] == [], "the second call builds nothing"
    assert "import dolfinx" not in machine.log.read_text(), "nor does it load the solver to see that it is there"
    assert machine("wheel", PDVOL_USE="python")[0].stderr.startswith("run: PDVOL_USE=python: python3 has no dolfinx")


def test_the_wheel_comes_second(machine):
    done, calls = machine("wheel")
    assert (done.returncode, done.stdout) == (0, f"{machine.folder}/.venv-wheel/bin/python\n1\n"), done.stderr
    assert calls[0] == f"-m venv {machine.folder}/.venv-wheel", "nothing of the machine's own packages"
    assert calls[1].endswith(f"--editable {machine.folder}[all,solver]")
    assert machine("wheel")[1] == []
    done, _ = machine("dolfinx", PDVOL_USE="wheel")
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert "PDVOL_USE=wheel: for the wheel of dolfinx, python3 lacks Python >= 3.12, Python.h; " in done.stderr


@pytest.mark.parametrize("variables", [{}, {"PDVOL_USE": "debian"}, {"PDVOL_DEBIAN": "trixie"}])
def test_a_debian_root_comes_third(machine, variables):
    """Where none can be made either, one line says what each way lacks."""
    done, calls = machine("" if not variables else "dolfinx", **variables)
    assert done.returncode == 2 and calls == [] and done.stderr.count("\n") == 1
    assert "a Debian root needs more rights: this machine does not allow mount namespaces" in done.stderr
    assert ("python3 has no dolfinx >= 0.9; for the wheel of dolfinx, python3 lacks" in done.stderr) == (not variables)


def test_an_environment_on_a_debian_root_is_taken_without_a_look_at_any_python(machine):
    stamp = machine.folder / ".venv-trixie" / "stamp"
    stamp.parent.mkdir()
    stamp.write_text("of an environment")
    done, _ = machine("dolfinx")
    assert machine.log.read_text() == "" and "a Debian root needs more rights" in done.stderr
    assert machine("dolfinx", PDVOL_USE="python")[0].returncode == 0
    done, _ = machine("dolfinx", PDVOL_USE="conda")
    assert (done.returncode, done.stderr) == (2, "run: PDVOL_USE=conda is not a way; choose python, wheel or debian\n")


def test_a_python_that_lacks_something_for_the_wheel_names_it(tmp_path):
    """As with the Python of the tests: it has all but what is taken away."""
    program = RUN.parent / "packaging" / "wheel_needs.py"
    words, env = [sys.executable, program], {"PATH": str(tmp_path)}
    found = subprocess.run(words, env=env, capture_output=True, text=True, timeout=SAFETY)
    assert found.returncode == 1 and "a C compiler" in found.stdout.strip().split(", ")
    script(tmp_path / "cc", "")
    found = subprocess.run(words, env=env, capture_output=True, text=True, timeout=SAFETY)
    assert "a C compiler" not in found.stdout and found.returncode == bool(found.stdout.strip())


@pytest.mark.slow
def test_the_wheel_draws_a_picture(tmp_path):
    """From a copy of the repository, with an empty cache: the environment, and a demo to its picture."""
    lacking = subprocess.run(["python3", RUN.parent / "packaging" / "wheel_needs.py"], capture_output=True, text=True)
    if lacking.returncode:
        pytest.skip(f"this machine lacks {lacking.stdout.strip()}")
    for name in ("run", "pyproject.toml", "README.md", "COPYING", "COPYING.LESSER"):
        shutil.copy(RUN.parent / name, tmp_path)
    for name in ("packaging", "pdvol", "forms", "meshes", "demos"):
        shutil.copytree(RUN.parent / name, tmp_path / name)
    env = {**os.environ, "PDVOL_USE": "wheel", "PDVOL_DEBIAN": "", "XDG_CACHE_HOME": str(tmp_path / "cache")}
    words = [tmp_path / "run", "pdvol", "run", "demos/ball_on_spike.py", "--levels", "0:1"]
    done = subprocess.run(words, env=env, cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "runs" / "ball_on_spike" / "picture.png").is_file()


# ---- what a build shows

BUILD = """
set -euo pipefail
eval "$(sed -n '/^say()/p; /^die()/p; /^shown()/,/^}/p; /^built()/,/^}/p' "$1")"
build() { for n in one two; do echo "I: stage $n"; sleep 2; done; }
fail() { echo "I: stage one"; sleep 2; exit 3; }
(built "$2" "it did not work" "$3")
"""


def test_a_build_has_a_line_per_stage_in_a_log(tmp_path):
    words = ["bash", "-c", BUILD, "bash", RUN, tmp_path / "log", "build"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=SAFETY)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    lines = [re.sub(r"\d+ s", "N s", line) for line in done.stderr.splitlines()]
    assert lines[-3:] == ["run: stage one, after N s", "run: stage two, after N s", "run: done in N s"]
    failed = subprocess.run([*words[:-1], "fail"], capture_output=True, text=True, timeout=SAFETY)
    assert failed.returncode == 2 and "done" not in failed.stderr
    assert failed.stderr.endswith(f"I: stage one\nrun: it did not work (whole log: {tmp_path / 'log'})\n")


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
