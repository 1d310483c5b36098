"""Properties of all scenes, checked on random ones by code that the solver does not use."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import cloudpickle
import numpy as np
import pytest
from frames import Frame, drifting, seen
from hypothesis import HealthCheck, Phase, event, given, settings
from hypothesis import strategies as st
from mpi4py import MPI
from orders import marched, shuffled
from sketches import ACCURATE, dimension, hows, materials_of, scenes, slab

import pdvol
from killing import PressesCtrlC
from on_ranks import ranks
from pdvol import Barrier, Deforming, Friction, Gravity, Plane, Pressure, Scene
from pdvol.geometry.level_mesh import LevelMesh, lumped_masses
from pdvol.levels.binding import bind
from pdvol.levels.space import LevelSpace
from pdvol.measure.verify import verify_run
from pdvol.registry import METHODS
from pdvol.runs.branch import branch_run
from pdvol.runs.preflight import check_scene
from pdvol.runs.runner import Execution, run_scene
from pdvol.runs.scene_file import Shot
from pdvol.scene import rotation_matrix
from pdvol.solve.iteration import BALANCED
from runs import assert_same_runs

NEAR = 1e-6  # m: scenes are solved to about 1e-9, and what follows amplifies round-off
NEAR_BIHARMONIC = 1e-4  # m: its weights depend on the order of unknowns by about 1e-6
THIN = 1e-4  # m: dhat where two kinds of barrier are compared
# m: ten dhat. A slab's barrier has half a plane's stiffness (docs/contact.md): bodies stand lower by parts of dhat, and
# the motions of bodies that were thrown part by parts of dhat a step (measured: 0.3).
SLAB = 10.0 * THIN
SMOOTH = 30  # Newton iterations of a step on its way to one minimum, at most


# ---- runs


def run(scene: Scene, out: Path, how: dict, resume: bool = False, progress=None) -> str:
    """Runs a scene into a folder, and returns the error with which that ended; nothing where it came to its end."""
    try:
        run_scene(Shot(None, {}, scene), out, **how, resume=resume, how=Execution(progress=progress, xdmf=False))
    except (pdvol.ConvergenceError, pdvol.InputError) as error:
        assert str(error) and "\n" not in str(error)
        return str(error)
    return ""


def steps(scene: Scene, **how) -> Iterator[pdvol.Step]:
    """A march, as far as it comes."""
    try:
        yield from pdvol.march(scene, **how)
    except pdvol.ConvergenceError:
        event("not all steps")


def states(scene: Scene, how: dict) -> dict[tuple[int, int], np.ndarray]:
    """Positions by level and step."""
    return {(step.level, step.step): step.positions for step in steps(scene, **how)}


def stored(out: Path) -> dict[tuple[int, int], np.ndarray]:
    levels = pdvol.open_run(out).levels
    return {(level.index, step): level.positions(step) for level in levels for step in range(1, level.steps)}


def assert_near(base: Path, other: dict, how: dict, levels: int | None = None) -> None:
    """The same motion as a stored run, of the first `levels` levels or all, up to the first rough step on a level or a
    coarser one.
    """
    finer = NEAR_BIHARMONIC if how["prolongation"] == "biharmonic" else NEAR
    one, end = stored(base), np.inf
    assert one.keys() == other.keys() or any(map(rough, pdvol.open_run(base).log))
    for level in pdvol.open_run(base).levels[:levels]:
        end = min([end, *(record["step"] for record in level.log if rough(record))])
        for step in range(1, level.steps):
            event(f"compared: {'yes' if step < end else 'no'}")
            if step < end:
                key, near = (level.index, step), finer if level.index else NEAR
                np.testing.assert_allclose(other[key], one[key], rtol=0.0, atol=near, err_msg=f"level and step {key}")


def rough(record: dict) -> bool:
    """Whether a step, by its record in the log, passed by other minima, between which round-off may decide."""
    return record["newton_iterations"] > SMOOTH or record["cuts"] > 0


def masses_of(step: pdvol.Step) -> np.ndarray:
    return lumped_masses(step.model.mesh, step.model.materials.density)


def kinetic(step: pdvol.Step, velocity: np.ndarray) -> float:
    return 0.5 * float(masses_of(step) @ (velocity**2).sum(axis=1))


# ---- properties


def sound(scene: Scene, how: dict, base: Path, seed: int) -> None:
    """No state crosses anything or turns a cell inside out. An embedded level does, and is not judged."""
    levels = pdvol.open_run(base).levels
    judged = [line for line in verify_run(base) if how["method"] != "embedded" or "level 0" in line]
    allowed = () if scene.contact else ("intersect", "not above plane")
    assert [line for line in judged if not any(word in line for word in allowed)] == []
    contacts = sum(record["contacts"] > 0 for level in levels for record in level.log)
    event(f"contacts: {'yes' if contacts else 'no'}")


FRAMES = {
    "in other units": lambda d, rng: (np.eye(d), np.zeros(d), *4.0 ** rng.integers(-4, 5, 3)),
    "from elsewhere": lambda d, rng: (
        rotation_matrix(rng.uniform(-3, 3), rng.uniform(0.1, 1, 3), d),
        rng.uniform(-3, 3, d),
    ),
    "in a mirror": lambda d, rng: (np.eye(d) - 2.0 * np.diag(np.eye(d)[rng.integers(d)]), rng.uniform(-3, 3, d)),
    "from far away": lambda d, rng: (np.eye(d), 1e3 * rng.choice([-1.0, 0.0, 1.0], d)),
}
"""What a `Frame` is made of, from a dimension and a random generator. Powers of four change no digit of units."""


def from_a_frame(name: str, scene: Scene, how: dict, base: Path, seed: int) -> None:
    """The same motion is seen from one of `FRAMES`."""
    frame = Frame(*FRAMES[name](dimension(scene), np.random.default_rng(seed)))
    assert_near(base, {key: frame.back(x) for key, x in states(seen(scene, frame), how).items()}, how)


def from_a_moving_frame(scene: Scene, how: dict, base: Path, seed: int) -> None:
    """A constant velocity is added to everything. Where obstacles then push bodies in parts of a step, these may end in
    another minimum, so it is judged up to there.
    """
    u = np.random.default_rng(seed).uniform(-1.0, 1.0, dimension(scene))
    if any(isinstance(each, Deforming) for each in scene.obstacles):
        return
    pushed = set[int]()
    for one, other in zip(steps(scene, **how), steps(drifting(scene, u), **how), strict=False):
        records = (one.report.record(), other.report.record())
        pushed |= {each["level"] for each in records if rough(each) or each["remedies"]["substeps"]}
        if not pushed:
            event("moving frame: compared")
            moved = other.positions - one.time * u
            np.testing.assert_allclose(moved, one.positions, rtol=0.0, atol=NEAR, err_msg=f"{one}")


def in_another_order(scene: Scene, how: dict, base: Path, seed: int) -> None:
    """Bodies, obstacles, vertices and cells come in another order. Where a vertex outside has two equally near
    homes, their numbers decide (docs/method.md): finer levels are compared while the homes are the same.
    """
    other, back = shuffled(scene, seed)
    found, meshes = {}, {}
    for step in steps(other, **how):
        found[step.level, step.step], meshes[step.level] = back(step.level, step.positions), step.model.mesh
    same = 1
    for level in pdvol.open_run(base).levels[1 : len(meshes)]:
        coarse, fine = level.index - 1, level.index
        ways = ((coarse, fine), (fine, coarse))
        one = [weights(*(pdvol.open_run(base).levels[k].mesh for k in way)) for way in ways]
        its = [back(way[0], back(way[1], weights(*(meshes[k] for k in way)).T).T) for way in ways]
        if not all(np.allclose(a, b, rtol=0.0, atol=1e-9) for a, b in zip(one, its, strict=True)):
            break
        same += 1
    event(f"homes: {'the same' if same == len(meshes) else 'others'}")
    assert_near(base, found, how, same)


def weights(target: LevelMesh, source: LevelMesh) -> np.ndarray:
    """(n, m): barycentric coordinates of a level's points in their home cells in another level."""
    return bind(target, LevelSpace(source, MPI.COMM_SELF)).matrix(source).toarray()


def same_level_0(scene: Scene, how: dict, base: Path, seed: int) -> None:
    """Level 0 is the same in every march, to the last bit."""
    level_0 = {key: x for key, x in stored(base).items() if key[0] == 0}
    for method in METHODS:
        found = states(scene, {"method": method, "levels": 0})
        assert found.keys() == level_0.keys()
        for key, x in found.items():
            np.testing.assert_array_equal(x, level_0[key], err_msg=f"{method}, level and step {key}")


def cut_and_resumed(scene: Scene, how: dict, base: Path, seed: int) -> None:
    """A run that is interrupted at any step and goes on is the same, to the last bit."""
    out, every = base.parent / "cut", sum(level.steps - 1 for level in pdvol.open_run(base).levels)
    with pytest.raises(KeyboardInterrupt):
        run(scene, out, how, progress=PressesCtrlC(1 + seed % every))
    run(scene, out, how, resume=True)
    assert_same_runs(base, out)


def branched(scene: Scene, how: dict, base: Path, seed: int) -> None:
    """A branch that changes nothing is the same, to the last bit."""
    if how["method"] != "progressive" or pdvol.open_run(base).info["state"] != "done":
        return
    out = base.parent / "branch"
    branch_run(Shot(None, {}, scene), base, seed % scene.steps, out, scene.levels - 1)
    run(scene, out, how, resume=True)
    assert_same_runs(base, out)


def on_two(scene: Scene, how: dict, base: Path, seed: int) -> None:
    """Two ranks give the same."""
    if pdvol.open_run(base).info["state"] != "done":
        return
    found = ranks(2).call(marched, (cloudpickle.dumps((scene, how)),))
    assert_near(base, {tuple(map(int, key.split())): x for key, x in found.items()}, how)


def as_checked(scene: Scene, how: dict, base: Path, seed: int) -> None:
    """What `check` calls sound runs."""
    assert check_scene(scene, 0.0)["sound"]


def slab_for_plane(scene: Scene, how: dict, base: Path, seed: int) -> None:
    """Things that lie on a plane, which moves, do the same on a wide rigid slab in its place."""
    plane = next((each for each in scene.obstacles if isinstance(each, Plane)), None)
    if plane is None:
        return
    up = np.array(plane.normal) / np.linalg.norm(plane.normal)
    start = pdvol.march(scene, levels=0).model(0).start
    plane = replace(plane, point=tuple(((start @ up).min() - 1.5e-3) * up))
    scene = replace(
        scene,
        bodies=tuple(replace(body, velocity=(), spin=()) for body in scene.bodies),
        loads=(Gravity(tuple(-9.81 * up)),),
        contact=(Barrier(THIN), Friction(0.5, 0.01)),  # nothing touches at first
        dt=0.005,
        steps=12,
    )
    on_both = (steps(replace(scene, obstacles=(ground,)), levels=0) for ground in (plane, slab(plane)))
    for one, other in zip(*on_both, strict=False):
        if any(rough(step.report.record()) or step.report.behind for step in (one, other)):
            return  # what contact holds back waits on a plane, but not on a slab (docs/rig.md)
        event(f"slab: contacts {'yes' if one.report.contacts else 'no'}")
        np.testing.assert_allclose(other.positions, one.positions, rtol=0.0, atol=SLAB, err_msg=f"{one}")


def isolated(scene: Scene, how: dict, base: Path, seed: int) -> None:
    """Without anything outside, the bodies' common centre goes straight on, on any level alone."""
    loads = [each for each in scene.loads if isinstance(each, Pressure)]
    scene = replace(scene, loads=loads, supports=(), obstacles=(), pulls=())
    last, masses, damped = -1, np.empty(0), any(each.damping for each in materials_of(scene))
    for step in steps(scene, method="direct"):
        if step.level != last:
            last, masses = step.level, masses_of(step)
            centre, speed = (masses @ x / masses.sum() for x in (step.model.start, step.model.velocity))
        moved = masses @ (step.positions - step.model.start) / masses.sum()
        np.testing.assert_allclose(moved, speed * step.time, rtol=0.0, atol=1e-7 * step.step)
        for kind, rows in step.forces.items():
            if kind != "inertia":
                assert np.abs(rows.sum(axis=0)).max() <= 1e-9 * np.abs(rows).sum() + 1e-9, kind
            if kind in ("barrier", "attachment") or (kind == "elastic" and not damped):
                x = step.positions - centre
                turning = x[:, 0] * rows[:, 1] - x[:, 1] * rows[:, 0] if x.shape[1] == 2 else np.cross(x, rows)
                assert np.abs(turning.sum(axis=0)).max() <= 1e-8 * np.abs(rows).sum() + 1e-9, kind


def in_balance(scene: Scene, how: dict, base: Path, seed: int) -> None:
    """With the default tolerance, whatever the stiffness and the time step, forces on a body that nothing holds balance
    to a hundredth of the largest, in each step: those of each vertex, and their sums. They are those of the last solve,
    so friction is lagged once a step, and the first step is left out where friction is lagged anew at its end.
    """
    rng = np.random.default_rng(seed)
    young, dt = 10.0 ** rng.uniform(3.0, 10.0), 10.0 ** rng.uniform(-3.0, np.log10(0.04))
    bodies = tuple(replace(body, material=replace(body.material, young=young), regions=()) for body in scene.bodies)
    contact = tuple(replace(part, iterations=1) if isinstance(part, Friction) else part for part in scene.contact)
    scene = replace(scene, bodies=bodies, dt=dt, contact=contact, solver=pdvol.Solver(), supports=())
    for step in steps(scene, **{**how, "method": "direct"}):
        solver, record = step.model.solver, step.report.record()
        if step.step == 1 and record["friction_iterations"] > 1:
            continue
        if record["imbalance"] > BALANCED:
            event(f"balance: given up, {record['reason']}")
            continue
        rows = np.array([*step.forces.values()])
        least = masses_of(step)[:, None] * solver.tolerance / dt
        for number in range(len(bodies)):
            mine = step.model.mesh.point_bodies == number
            for parts, floor in ((rows[:, mine], least[mine].max()), (rows[:, mine].sum(axis=1), least[mine].sum())):
                left, sizes = (np.linalg.norm(each, axis=-1) for each in (parts.sum(axis=0), parts))
                assert left.max() <= 1.01 * BALANCED * max(sizes.max(), 9 / 4 * floor), step
        event("balance: compared")


def rubs_at_first(scene: Scene, how: dict, base: Path, seed: int) -> None:
    """The first body begins a part of dhat above a plane that moves along, without the others: in the first step
    friction is at most mu times the normal forces that this step has.
    """
    d, mu, gap = dimension(scene), 0.4, THIN * np.random.default_rng(seed).uniform(0.02, 0.9)
    scene = replace(
        scene, bodies=scene.bodies[:1], obstacles=(), supports=(), loads=(), attachments=(), muscles=(), pulls=()
    )
    start = pdvol.march(scene, levels=0).model(0).start
    low, (up, along) = start[:, 1].min(), np.eye(d)[[1, 0]]
    scene = replace(
        scene,
        obstacles=(Plane(tuple((low - gap) * up), tuple(up), pdvol.Translation(tuple(2.0 * along))),),
        contact=(Barrier(THIN), Friction(mu)),
        loads=(Gravity(tuple(-9.81 * up)),),
    )
    for step in steps(scene, levels=0):
        if step.step == 1:
            rubbing, pressing = (np.linalg.norm(step.forces[name], axis=1).sum() for name in ("friction", "barrier"))
            assert rubbing <= 1.01 * mu * pressing
            event(f"rubs: {'yes' if rubbing > 0.5 * mu * pressing > 0.0 else 'no'}")


def loses_energy(scene: Scene, how: dict, base: Path, seed: int) -> None:
    """A step of implicit Euler minimises 1/2 |v' - v|^2 + E', which at x' = x is 1/2 |v|^2 + E: no energy is made."""
    nothing = dict.fromkeys(("loads", "supports", "obstacles", "contact", "muscles", "attachments", "pulls"), ())
    if any(each.keyed for each in materials_of(scene)):
        return
    scene, energy, velocity = replace(scene, **nothing, integrator="implicit_euler"), None, None
    for step in steps(scene, levels=0):
        elastic = step.report.energy["elastic"]
        if energy is not None:
            event("energy: compared")
            allowed = energy * (1.0 + 1e-6) + 1e-9
            assert kinetic(step, step.velocity - velocity) + elastic <= allowed
            assert kinetic(step, step.velocity) + elastic <= allowed
        velocity, energy = step.velocity, kinetic(step, step.velocity) + elastic


PROPERTIES = {
    "frames": (*(partial(from_a_frame, name) for name in FRAMES), from_a_moving_frame, in_another_order),
    "runs": (same_level_0, cut_and_resumed, branched, on_two),
    "physics": (as_checked, slab_for_plane, isolated, loses_energy, in_balance, rubs_at_first),
}
"""Those of a kind are checked on one run of a scene."""
ANY = {"deadline": None, "database": None, "suppress_health_check": list(HealthCheck), "phases": [Phase.generate]}


def run_and_check(folder: Path, scene: Scene, how: dict, seed: int, *checks) -> None:
    """Run one scene, and check its states and some properties."""
    base = folder / "run"
    error = run(scene, base, how)
    event("done" if not error else "ends early" if base.exists() else "refused")
    if not (base / "run.json").is_file():
        found = check_scene(scene, 0.0)  # what `check` calls a defect is what the run was refused with
        assert not found["sound"] and any(error in line for line in found["defects"]), (error, found["defects"])
        return
    sound(scene, how, base, seed)
    if any(level.steps > 1 for level in pdvol.open_run(base).levels):
        for check in checks:
            check(scene, how, base, seed)


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=pytest.mark.mpi if on_two in PROPERTIES[kind] else ()) for kind in PROPERTIES]
)
@settings(max_examples=5, derandomize=True, **ANY)
@given(scene=scenes(), how=hows, seed=st.integers(0, 10**6))
def test_a_few(tmp_path_factory, kind, scene, how, seed):
    run_and_check(tmp_path_factory.mktemp("scene"), scene, how, seed, *PROPERTIES[kind])


@settings(max_examples=8, derandomize=True, **ANY)
@given(scene=scenes(extreme=True), how=hows)
def test_a_few_extremes(tmp_path_factory, scene, how):
    run_and_check(tmp_path_factory.mktemp("scene"), scene, how, 0)


@settings(max_examples=6, derandomize=True, **ANY)
@given(scene=scenes(pressed=True), how=hows, seed=st.integers(0, 10**6))
def test_a_few_squeezes(tmp_path_factory, scene, how, seed):
    run_and_check(tmp_path_factory.mktemp("scene"), scene, how, seed, *PROPERTIES["runs"][:3])


@pytest.mark.slow
@pytest.mark.parametrize(
    "check", sum(PROPERTIES.values(), ()), ids=lambda check: getattr(check, "__name__", "") or check.args[0]
)
@settings(max_examples=1000, **ANY)
@given(scene=scenes(), how=hows, seed=st.integers(0, 10**6))
def test_many(tmp_path_factory, check, scene, how, seed):
    run_and_check(tmp_path_factory.mktemp("scene"), scene, how, seed, check)


@pytest.mark.slow
@settings(max_examples=2000, **ANY)
@given(scene=st.one_of(scenes(pressed=True), scenes(extreme=True)), how=hows, seed=st.integers(0, 10**6))
def test_many_squeezes_and_extremes(tmp_path_factory, scene, how, seed):
    checks = PROPERTIES["runs"][:3] if scene.solver is ACCURATE else ()
    run_and_check(tmp_path_factory.mktemp("scene"), scene, how, seed, *checks)
