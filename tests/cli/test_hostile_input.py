"""Deliberately damaged files and unusual settings. Each ends with an answer in less than 10 s and 1 GB, without a
crash, a hang or an unexpected file.
"""

import io
import json
import os
import random
import resource
import shutil
import subprocess
import sys
import threading
import time
import zipfile

import numpy as np
import pytest

import runs
from cli_scenes import FALL, pdvol, write
from commands import SAFETY
from hostile_files import POINTS, sound_file
from pdvol.errors import InputError
from pdvol.meshing.readers import SURFACES, VOLUMES, read_in_child_process, read_shape

SECONDS, MEGABYTES = 10.0, 1000


def mutated(data: bytes, rng: random.Random) -> bytes:
    """The data after one random kind of damage."""
    kind = rng.randrange(9)
    at = rng.randrange(len(data))
    if kind == 0:
        return data[:at]
    if kind == 1:
        return data[:at] + rng.randbytes(rng.randrange(1, 40)) + data[at + rng.randrange(40) :]
    if kind == 2:  # counts, indices, coordinates
        i = rng.choice([i for i, c in enumerate(data) if chr(c).isdigit()] or [at])
        return data[:i] + rng.choice([*b"999999999999 4294967295 -1 nan 1e999 x".split(), b"9" * 5000]) + data[i + 1 :]
    if kind == 3:
        return data.decode("latin-1").encode(rng.choice(["utf-16", "utf-8-sig", "cp037"]), errors="replace")
    if kind == 4:
        return data[:at] + bytes(rng.randrange(1, 2000)) + data[at:]
    if kind == 5:
        return data * 3
    if kind == 6:
        return data[:at] + rng.choice([b"(", b"<a>", b"[", b"{", b"\\\n"]) * 20000 + data[at:]
    if kind == 7:
        lines = data.split(b"\n")
        rng.shuffle(lines)
        return b"\n".join(lines)
    bits = bytearray(data)
    for _ in range(rng.randrange(1, 30)):
        bits[rng.randrange(len(bits))] = rng.randrange(256)
    return bytes(bits)


def seconds_of_processor() -> float:
    """Of this process and its children that have ended: other programs on the machine do not count."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def answer(path) -> str:
    """The kind of shape that a file holds, or the text of the error. Checks the limits of time and memory."""
    begin = seconds_of_processor()
    try:
        shape = read_shape(path)
        printed = type(shape).__name__
        points = shape.vertices
        assert points.ndim == 2 and points.dtype == np.float64
    except InputError as error:
        printed = str(error)
        assert "\n" not in printed and str(path) in printed
    own, used = (resource.getrusage(who).ru_maxrss / 1024 for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    assert used < 1.2 * own + MEGABYTES, "a child took too much"
    assert seconds_of_processor() - begin < 2 * SECONDS
    return printed


@pytest.mark.parametrize("slowly", [False, pytest.param(True, marks=pytest.mark.slow)])
@pytest.mark.parametrize("suffix", SURFACES + VOLUMES)
def test_mutated_meshes(tmp_path, suffix, slowly):
    few = 2 if suffix in (".vtk", ".vtu") else 6  # VTK begins a process of its own
    folder, rounds = tmp_path, 50 * few if slowly else few
    sound, rng = sound_file(folder, suffix).read_bytes(), random.Random(f"{suffix}{rounds}")
    printed = []
    for number in range(rounds):
        path = folder / f"{number}{suffix}"
        path.write_bytes(mutated(sound, rng))
        before = {p.name for p in folder.iterdir()}
        printed.append(answer(path))
        assert {p.name for p in folder.iterdir()} == before
        path.unlink()
    assert any("export" in text for text in printed), printed


HUGE = {
    "counts.ply": (
        b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty double x\nproperty double"
        b" y\nproperty double z\nelement face 4000000000\nproperty list uchar int vertex_indices\nend_header\n"
        + bytes(100)
    ),
    "counts.off": b"OFF\n4000000000 4000000000 0\n0 0 0\n",
    "counts.stl": bytes(80) + (4294967295).to_bytes(4, "little") + bytes(100),
    "counts.vtk": (
        b"# vtk DataFile Version 3.0\nx\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 4000000000 double\n" + bytes(100)
    ),
    "counts.mesh": b"MeshVersionFormatted 2\nDimension 3\nVertices\n4000000000\n0 0 0 0\n",
    "counts.msh": b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4000000000\n1 0 0 0\n$EndNodes\n",
    "laughs.vtu": (
        b'<?xml version="1.0"?><!DOCTYPE l [<!ENTITY a "ha">'
        + b"".join(b'<!ENTITY %c "%s">' % (c + 1, b"&%c;" % c * 10) for c in range(97, 110))
        + b']><VTKFile type="UnstructuredGrid">&n;</VTKFile>'
    ),
    "index.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4294967299\n",
    "elsewhere.xdmf": (
        b'<?xml version="1.0"?><Xdmf Version="3.0"><Domain><Grid><Geometry GeometryType="XYZ"><DataItem Dimensions="9'
        b' 3" Format="HDF">../../../etc/passwd:/x</DataItem></Geometry></Grid></Domain></Xdmf>'
    ),
}


@pytest.mark.parametrize("name", HUGE)
def test_files_that_promise_too_much(tmp_path, name):
    (tmp_path / name).write_bytes(HUGE[name])
    assert "export" in answer(tmp_path / name)


def _hang(path):
    while True:
        pass


def _devour(path):
    return np.ones(2**31)  # 16 GiB


def _wait(path):
    threading.Event().wait()


def _crash(path):
    os.abort()


@pytest.mark.parametrize(
    ("work", "message"),
    [
        (_hang, "used up its 1 s of processor time"),
        (_devour, "wants more memory"),
        (_crash, "its reader crashed"),
        (_wait, "never comes"),
    ],
)
def test_failures_of_a_reader_become_errors(tmp_path, monkeypatch, work, message):
    # Only what hangs is to end by its processor time.
    monkeypatch.setattr("pdvol.meshing.readers.BASE_SECONDS", 0.5 if work is _hang else 10.0)
    monkeypatch.setattr("pdvol.meshing.cpu_budget.IDLE_LOOKS", 2)
    path = write(tmp_path / "a.obj", "v 0 0 0\n")
    with pytest.raises(InputError, match=message):
        read_in_child_process(path, work)


# ---- settings


NONSENSE = ["None", "nan", "1e999", "-1", "[]", "{}", "''", "10**10", "b'x'", "True", "1e308", "'\\ud800'", "../../x"]
NONSENSE += ["(" * 3000, "[" * 300 + "]" * 300, "9" * 5000, "__import__('os').system('touch owned')", "\x00"]
NONSENSE += ["Relative(None)", "Relative(9" + "9" * 400 + ")", "999999999999", "lambda: 0"]
NAMES = "young height mu steps velocity sizes tolerance max_iterations max_halvings linear linear_rtol".split()
NAMES += ["relative_tolerance", "petsc"]


def test_nonsense_settings(tmp_path, capfd, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = write(tmp_path / "fall.py", FALL.replace("def scene(", "TOLD = 1\n\n\ndef scene("))
    files = lambda: {p for p in tmp_path.rglob("*") if "__pycache__" not in p.parts}
    rng, before = random.Random(3), files()
    for name, value in ((name, value) for name in NAMES for value in rng.sample(NONSENSE, 4)):
        capfd.readouterr()
        begin = time.process_time()
        code = pdvol("info", scene, "--set", f"{name}={value}")
        out, err = capfd.readouterr()
        assert code in (0, 2) and "Traceback" not in out + err, (name, value, err)
        assert code == 0 or (err.startswith("pdvol: ") and err.count("\n") == 1), (name, value, err)
        assert time.process_time() - begin < SECONDS and files() == before, (name, value)


NAMES_OF_PATHS = ["../../owned", "/tmp/owned", "a/b", "x\ny", "\udc80", "con", "a" * 5000, ""]


def test_names_that_would_be_paths(tmp_path):
    """Of bodies and obstacles: whatever is written is in the run folder. In a process of its own, on a terminal that
    knows ASCII alone.
    """
    (tmp_path / "work").mkdir()
    for number, name in enumerate(NAMES_OF_PATHS):
        write(
            tmp_path / "work" / f"fall{number}.py",
            FALL.replace('name="square"', f"name={name!r}").replace('name="floor"', f"name={name!r}"),
        )
    program = f"""
from pathlib import Path
from pdvol import cli
from pdvol.runs.runner import run_scene
from pdvol.runs.scene_file import load_shot
for number in range({len(NAMES_OF_PATHS)}):
    assert cli.run(["info", f"fall{{number}}.py"]) == 0
    run_scene(load_shot(f"fall{{number}}.py", steps=1), f"run/{{number}}", 0, 0)
    assert cli.run(["export", f"run/{{number}}", "--format", "obj", "-o", f"run/{{number}}/obj"]) == 0
"""
    before = set(tmp_path.rglob("*"))
    ended = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path / "work",
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
        capture_output=True,
        timeout=SAFETY,
    )
    assert ended.returncode == 0 and b"Traceback" not in ended.stderr, ended.stderr
    new = {p for p in tmp_path.rglob("*") if "__pycache__" not in p.parts} - before
    assert new and all((tmp_path / "work" / "run") in (p, *p.parents) for p in new)


# ---- run folders


class Owned:
    """Says when it is unpickled."""

    def __reduce__(self):
        return os.mkdir, ("owned",)


WRONG = [None, True, -1, 1e400, "x", [], {}, [[]], [{}], "../../x", float("nan")]


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stored")
    write(folder / "fall.py", FALL)
    assert pdvol("run", folder / "fall.py", "--steps", 2, "--out", folder / "run") == 0
    return folder


@pytest.fixture
def inspect_(stored, tmp_path, monkeypatch, capfd):
    """Runs the commands that read a run on a copy of one that `damage` has been at; their codes."""
    monkeypatch.chdir(tmp_path)

    def inspect(damage, commands=("info", "export", "metrics", "refine")) -> list[int]:
        run = tmp_path / "run"
        shutil.rmtree(run, ignore_errors=True)
        shutil.copytree(stored / "run", run)
        damage(run)
        more = {"export": ["--format", "xdmf", "-o", run / "out"], "refine": ["--to", 1]}
        codes = []
        for command in commands:
            begin = time.process_time()
            capfd.readouterr()
            codes.append(pdvol(command, run, *more.get(command, [])))
            out, err = capfd.readouterr()
            assert codes[-1] in (0, 1, 2) and "Traceback" not in out + err
            assert codes[-1] == 0 or (err.strip().split("\n")[-1].startswith("pdvol: ")), err
            assert time.process_time() - begin < SECONDS
        assert [p.name for p in tmp_path.iterdir()] == ["run"], "nothing beside the run, and nothing executed"
        return codes

    return inspect


def damaged_info(key, value):
    def damage(run):
        info = json.loads((run / "run.json").read_text())
        info[key] = value
        (run / "run.json").write_text(json.dumps(info))

    return damage


KEYS = "dt levels steps bodies scene scene_file description parameters diagonal method prolongation up".split()
KEYS += ["format", "dimension", "versions", "state"]


@pytest.mark.parametrize("key", KEYS)
def test_run_json_with_wrong_values(inspect_, key):
    for value in random.Random(key).sample(WRONG, 2):
        inspect_(damaged_info(key, value), ("info", "export"))


def test_run_json_that_is_deep_or_foreign(inspect_):
    utf16 = json.dumps({"format": 1}).encode("utf-16")
    for text in (b"[" * 100_000, b'{"a":' * 100_000, utf16, b"\xff\xfe\x00", b"9" * 10_000):
        assert inspect_(lambda run, text=text: (run / "run.json").write_bytes(text), ("info", "export")) == [2, 2]


def npy(array) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=True)
    return buffer.getvalue()


def header(shape) -> bytes:
    """A .npy file whose header promises a shape, without any data."""
    data = npy(np.zeros((2, 2)))
    text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".ljust(117).encode() + b"\n"
    return data[:8] + len(text).to_bytes(2, "little") + text


def test_states_are_data(inspect_):
    hostile = [
        npy(np.array([Owned()], dtype=object)),
        header((10**12, 2)),
        header((-1, 2)),
        header((9, 2)),
        npy(np.zeros((9, 2), "c16")),
        npy(np.full((9, 2), np.inf)),
        b"",
        b"\x93NUMPY" + b"(" * 70_000,
    ]
    for name, some in (("states.bin", hostile), ("velocity.npy", hostile[3:6])):
        for data in some:
            inspect_(lambda run, name=name, data=data: (run / "levels" / "0" / name).write_bytes(data), ("export",))
    inspect_(lambda run: runs.put_state(run / "levels" / "0", 1, np.full_like(POINTS[:, :2], np.inf)), ("export",))


def test_meshes_are_data(inspect_):
    def archive(compression=zipfile.ZIP_STORED, **arrays) -> bytes:
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w", compression) as file:
            for name, data in arrays.items():
                file.writestr(f"{name}.npy", data)
        return buffer.getvalue()

    names = ("points", "cells", "bodies", "regions")
    sound = {
        "points": POINTS[:3, :2],
        "cells": np.array([[0, 1, 2]]),
        "bodies": np.zeros(1, np.int32),
        "regions": np.zeros(1, np.int32),
    }
    hostile = [
        archive(**dict.fromkeys(names, npy(np.array([Owned()], dtype=object)))),
        archive(**dict.fromkeys(names, header((10**12,)))),
        archive(zipfile.ZIP_DEFLATED, **dict.fromkeys(names, b"") | {"points": bytes(300_000_000)}),
        archive(),
        *(
            archive(**{n: npy(values) for n, values in {**sound, name: wrong}.items()})
            for name in names
            for wrong in (np.array(["x"]), np.full((1, 3), 7), np.full((3, 2), np.nan))
        ),
    ]
    for data in hostile:
        assert inspect_(lambda run, data=data: (run / "levels" / "1" / "mesh.npz").write_bytes(data), ("export",)) == [
            2
        ]


@pytest.mark.parametrize("file", ["log.jsonl", "obstacles.json"])
def test_other_files_of_a_run(inspect_, file):
    texts = ["[]", '{"level": 0}', '{"level": [], "step": {}}', "[" * 90_000, '{"obstacles": [3]}', '{"obstacles": {}}']
    twice = '{"level": 0, "step": 1, "seconds": 3, "solver_memory": {"method": 3}}\n' * 2
    for data in (b"\xff\n", *(f"{text}\n".encode() for text in texts), twice.encode()):
        inspect_(lambda run, data=data: (run / file).write_bytes(data), ("info",))
    inspect_(lambda run: (run / file).write_bytes(data), ("metrics", "refine"))
