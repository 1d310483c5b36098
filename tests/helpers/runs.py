"""Small made-up runs: a disc in 2D, a ball in 3D, falling, turning and squashed on the ground; no solver involved."""

import json

import numpy as np
from scipy.spatial import Delaunay

from pdvol.geometry.level_mesh import LevelMesh, simplex_volumes
from pdvol.store.obstacles import write_obstacles
from pdvol.store.reader import open_run
from pdvol.store.states import HEAD, HEADER, NAME, States
from pdvol.store.writer import RunWriter
from shapes import together

DT = 0.02


def ball(dim: int, count: int, centre, radius: float = 0.5) -> LevelMesh:
    """A disc or ball of about `count` vertices, on layers of evenly spread points."""
    layers = max(2, round(count ** (1 / dim) * (0.6 if dim == 2 else 0.62)))
    points = [np.zeros((1, dim))]
    for k in range(1, layers + 1):
        n = round(6 * k) if dim == 2 else round(12 * k * k * 0.9)
        i = np.arange(n) + 0.5
        turn = np.pi * (1 + 5**0.5) * i
        if dim == 2:
            angle = 2 * np.pi * i / n + 0.3 * k
            layer = np.column_stack([np.cos(angle), np.sin(angle)])
        else:
            height = 1 - 2 * i / n
            flat = np.sqrt(1 - height**2)
            layer = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), height])
        points.append(layer * radius * k / layers)
    points = np.concatenate(points)
    cells = Delaunay(points).simplices.astype(np.int64)
    volumes = simplex_volumes(points, cells)
    cells[volumes < 0] = cells[volumes < 0][:, [1, 0, *range(2, dim + 1)]]
    cells = cells[abs(volumes) > 1e-9]
    used = np.unique(cells)
    points, cells = points[used], np.searchsorted(used, cells)
    m = len(cells)
    return LevelMesh(points + np.asarray(centre), cells, np.zeros(m, np.int32), np.zeros(m, np.int32))


def moved(mesh: LevelMesh, t: float) -> np.ndarray:
    """Positions of a made-up fall: turning, bouncing off height 0 and bulging there."""
    x = mesh.points.copy()
    up = mesh.dim - 1
    for body in range(mesh.bodies.max() + 1):
        mine = mesh.point_bodies == body
        X = mesh.points[mine]
        centre = X.mean(axis=0)
        r = X - centre
        turn = (2.0 - 3.2 * body) * t
        c, s = np.cos(turn), np.sin(turn)
        r[:, [0, up]] = r[:, [0, up]] @ np.array([[c, s], [-s, c]])
        fall = centre[up] - 0.5 * 9.81 * t**2
        lowest = 0.5
        squash = 1.0
        if fall < lowest:
            depth = min(0.22, lowest - fall) * np.exp(-3 * max(0.0, t - 0.6))
            fall, squash = lowest - depth, (lowest - depth) / lowest
        r[:, up] *= squash
        sides = [a for a in range(mesh.dim) if a != up]
        r[:, sides] *= squash ** (-1.0 / len(sides)) * (1 + 0.15 * (1 - squash) * np.sin(6 * X[:, :1]))
        centre = centre.copy()
        centre[up] = fall
        centre[0] += (0.5 - body) * 0.6 * t
        x[mine] = centre + r
    return x


OBSTACLES = {
    2: [
        {"name": "ground", "kind": "plane", "point": [0.0, -0.01], "normal": [0.0, 1.0]},
        {
            "name": "spike",
            "kind": "polyline",
            "vertices": [[1.3, 0.0], [1.7, 0.0], [1.5, 0.6]],
            "edges": [[0, 1], [1, 2], [2, 0]],
        },
        {
            "name": "wire",
            "kind": "polyline",
            "vertices": [[-1.6, 0.7], [-1.3, 0.5], [-1.2, 0.1]],
            "edges": [[0, 1], [1, 2]],
        },
    ],
    3: [{"name": "ground", "kind": "plane", "point": [0.0, 0.0, -0.01], "normal": [0.0, 0.0, 1.0]}],
}


def sphere_obstacle(centre, radius: float = 0.35, steps: int = 0) -> dict:
    """A round obstacle; rising when `steps` is given."""
    mesh = ball(3, 900, centre, radius)
    used, faces = np.unique(mesh.boundary, return_inverse=True)
    vertices = mesh.points[used]
    entry = {"name": "ball", "kind": "mesh", "vertices": vertices, "faces": faces.reshape(-1, 3)}
    if steps:
        entry["positions"] = vertices[None] + np.linspace(0, 0.3, steps + 1)[:, None, None] * np.array([0.0, 0.0, 1.0])
    return entry


def level_meshes(dim: int, counts) -> list[LevelMesh]:
    """One mesh of two bodies per vertex count."""
    centres = [(-0.6, 1.6), (0.65, 2.1)] if dim == 2 else [(-0.6, 0.0, 1.6), (0.65, 0.1, 2.1)]
    return [together(*(ball(dim, n // 2, c) for c in centres)) for n in counts]


def record(level: int, step: int) -> dict:
    """A log record as the solver writes it."""
    numbers = {"newton_iterations": 4, "contacts": 37, "min_gap": 1.2e-4, "seconds": {"total": 0.31}}
    return {"level": level, "step": step, "time": step * DT, **numbers}


def stored_run(path, dim: int = 2, counts=(60, 200, 800), steps: int = 20):
    """Write a whole run and return its folder."""
    meshes = level_meshes(dim, counts)
    info = {"scene": f"made up {dim}D", "dt": DT, "steps": steps, "method": "progressive", "versions": {}}
    info["parameters"] = {"young": np.float64(1e5)}
    with RunWriter.create(path, info, meshes, ["left", "right"]) as run:
        extra = [sphere_obstacle((1.6, 0.9, 0.35)), sphere_obstacle((-1.5, -0.4, 0.3), 0.3, steps)] if dim == 3 else []
        write_obstacles(run.path, OBSTACLES[dim] + extra)
        for level, mesh in enumerate(meshes):
            run.set_level_state(level, "running")
            for step in range(steps + 1):
                run.write_state(level, step, moved(mesh, 2 * step * DT), record(level, step) if step else None)
            run.set_level_state(level, "done")
    return path


def states_of(folder) -> States:
    """The states of a level's folder; of no vertices where there is no file yet."""
    file = folder / NAME
    return States(folder, HEADER.unpack(file.read_bytes()[: HEADER.size])[1:] if file.exists() else (0, 0))


def put_state(folder, step, positions):
    """A state of a level's folder in the place of the one that is there, with its checksum."""
    states = states_of(folder)
    after = [states.read(later) for later in range(step + 1, states.count())]
    for number, state in enumerate([positions, *after], start=step):
        states.write(number, state)


def count(folder) -> int:
    """How many states a level's folder has; 0 before there is one."""
    return states_of(folder).count()


def keep_states(folder, steps: int):
    """Removes the states of a level's folder from `steps` on."""
    states_of(folder).keep(steps)


def flip_bit(folder, step):
    """Damages a state of a level's folder: a bit of its last number."""
    states = states_of(folder)
    data = bytearray(states.file.read_bytes())
    data[HEADER.size + (step + 1) * (HEAD.size + 8 * np.prod(states.shape)) - 3] ^= 1
    states.file.write_bytes(data)


def assert_same_runs(one, other, logs: bool = True):
    """All states of two runs are the same to the last bit, and what their logs say besides times."""
    timeless = lambda level: [{k: v for k, v in r.items() if k not in ("seconds", "peak_memory_mb")} for r in level.log]
    for a, b in zip(open_run(one).levels, open_run(other).levels, strict=True):
        assert a.steps == b.steps, f"level {a.index}"
        for step in range(a.steps):
            np.testing.assert_array_equal(a.positions(step), b.positions(step), err_msg=f"level {a.index}, {step}")
        assert not logs or json.dumps(timeless(a), default=float) == json.dumps(timeless(b), default=float)
