"""Random small scenes test the solver. Each run ends normally or with a named error, and no stored state has an
intersection or an inverted cell.
"""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, event, given, settings
from hypothesis import strategies as st

import pdvol
from pdvol import (
    Barrier,
    Body,
    Friction,
    Gravity,
    NeoHookean,
    Placement,
    Plane,
    Relative,
    Rigid,
    Rotation,
    Scene,
    Solver,
    Support,
    Translation,
)
from pdvol.measure.verify import verify_run
from pdvol.meshes import ball, box, brick
from pdvol.runs.runner import run_scene
from pdvol.runs.scene_file import Shot

numbers = st.floats(-1.0, 1.0)
vectors = st.tuples(numbers, numbers, numbers)


def powers(low: float, high: float):
    """10 to the power of a number between two."""
    return st.floats(low, high).map(lambda e: 10.0**e)


materials = st.builds(NeoHookean, powers(2, 11), st.sampled_from([-0.5, 0.0, 0.3, 0.45, 0.499]), powers(0, 5))


@st.composite
def bodies(draw, index: int):
    """A block of one to 27 boxes, of any proportions, in a place of its own most of the time."""
    size = draw(st.tuples(*[st.floats(0.02, 1.0)] * 3))
    cuts = draw(st.tuples(*[st.integers(1, 3)] * 3))
    levels = tuple(brick(size, tuple(k + level for k in cuts)) for level in range(draw(st.integers(1, 2))))
    place = Placement(
        (0.3 * draw(numbers), 1.0 + 1.8 * index, 0.3 * draw(numbers)), 3.0 * draw(numbers), (1.0, draw(numbers), 0.3)
    )
    speed = draw(powers(-2, 3))
    return levels, Body(
        levels,
        draw(materials),
        name=f"body {index}",
        placement=place,
        velocity=tuple(speed * np.array(draw(vectors))),
        spin=tuple(3.0 * np.array(draw(vectors))),
    )


@st.composite
def obstacles(draw):
    """Nothing, a plane, a ball, a box or a moving wall."""
    still = Plane((0.0, -0.2, 0.0), (0.2 * draw(numbers), 1.0, 0.2 * draw(numbers)), name="floor")
    round_ = Rigid(ball(0.3, 1), Placement((0.2 * draw(numbers), -0.4, 0.1)), name="ball")
    turning = Rigid(
        box((2.0, 0.2, 0.3)),
        Placement((0.0, -0.3, 0.0)),
        Rotation(10.0 * draw(numbers), (0.0, -0.3, 0.0), (0.0, 0.0, 1.0)),
        "bar",
    )
    rising = Plane((0.0, -0.5, 0.0), (0.0, 1.0, 0.0), Translation((0.0, 2.0 * abs(draw(numbers)), 0.0)), "lift")
    return tuple(
        draw(st.lists(st.sampled_from([still, round_, turning, rising]), max_size=2, unique_by=lambda o: o.name))
    )


@st.composite
def scenes(draw):
    """A scene of one to three bodies and whatever may act on them."""
    pairs = [draw(bodies(k)) for k in range(draw(st.integers(1, 3)))]
    chosen = [body for levels, body in pairs if len(levels) == len(pairs[0][0])]
    around = draw(obstacles())
    contact = (
        (Barrier(draw(st.sampled_from([Relative(1e-4), Relative(1e-3), 1e-5, 0.02]))),)
        if around or draw(st.booleans())
        else ()
    )
    if contact and draw(st.booleans()):
        contact += (Friction(draw(st.sampled_from([0.0, 0.3, 10.0])), iterations=draw(st.integers(1, 2))),)
    supports = ()
    if draw(st.booleans()):
        motion = draw(st.sampled_from([Translation((0.5, 0.0, 0.0)), Rotation(5.0, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))]))
        supports = (Support(lambda X: X[:, 1] < 1.0, motion=motion, body=chosen[0].name),)
    dt, loads = (
        draw(st.sampled_from([1e-4, 1e-3, 0.01, 0.04, 0.1])),
        draw(st.sampled_from([(), (Gravity((0.0, -9.81, 0.0)),)])),
    )
    return Scene(
        tuple(chosen),
        dt=dt,
        steps=3,
        loads=loads,
        supports=supports,
        obstacles=around,
        contact=contact,
        solver=Solver(max_iterations=60, max_halvings=2),
    )


def throw(scene: Scene, out: Path) -> None:
    """Runs a scene, and asserts that it ends in an allowed way and that every stored state is sound."""
    try:
        run_scene(Shot(Path(__file__), {}, scene), out)
        ended = "done"
    except (pdvol.ConvergenceError, pdvol.InputError) as error:
        assert str(error) and "\n" not in str(error)
        ended = type(error).__name__
    if (out / "run.json").is_file():
        allowed = () if scene.contact else ("intersections", "not above plane")
        assert [problem for problem in verify_run(out) if not any(word in problem for word in allowed)] == []
    event(ended)


ANY = {
    "deadline": None,
    "derandomize": True,
    "database": None,
    "suppress_health_check": list(HealthCheck),
    "phases": [Phase.generate],
}


@settings(max_examples=12, **ANY)
@given(scene=scenes())
def test_a_few_random_scenes(tmp_path_factory, scene):
    throw(scene, tmp_path_factory.mktemp("scene") / "run")


@pytest.mark.slow
@settings(max_examples=200, **ANY)
@given(scene=scenes())
def test_many_random_scenes(tmp_path_factory, scene):
    throw(scene, tmp_path_factory.mktemp("scene") / "run")
