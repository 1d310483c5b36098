"""What `--set` reaches in every scene, and starts that differ by a little."""

from dataclasses import replace

import numpy as np
import pytest

from pdvol import Barrier, Body, Friction, InputError, NeoHookean, Relative, Scene, meshes
from pdvol.runs.scene_file import parse_settings, stored_value
from pdvol.scene.bodies import jittered
from pdvol.store.files import jsonable


def scene(**changes):
    ball = Body(meshes.disc(1.0), NeoHookean(1e4), vertices=(40,), velocity=(1.0, 0.0))
    return Scene(**{"bodies": (ball,), "dt": 0.01, "steps": 4, "contact": (Barrier(), Friction(0.3)), **changes})


def test_settings_reach_the_time_step_the_barrier_and_friction():
    plain = scene()
    found = plain.with_settings(dt=0.02, dhat=Relative(2e-3), **{"friction.iterations": 3})
    assert found.dt == 0.02 and found.steps == 4
    assert found.contact == (Barrier(dhat=Relative(2e-3)), Friction(0.3, iterations=3))
    assert found.bodies == plain.bodies and found.solver == plain.solver


def test_the_barriers_stiffness_is_a_fraction_or_in_pascal():
    """Also from the command line, and as `run.json` keeps it."""
    for text, kappa in (("0.5", 5e3), ("Pascal(2e4)", 2e4)):
        stored = jsonable(parse_settings([f"barrier.stiffness={text}"]))
        settings = {name: stored_value(value) for name, value in stored.items()}
        assert scene().with_settings(**settings).contact[0].kappa(1e4) == kappa
    with pytest.raises(InputError, match="Pascal.pascals = -1 must be positive"):
        parse_settings(["barrier.stiffness=Pascal(-1)"])


def test_the_paper_s_model_is_one_setting():
    """Also for bodies that have elements of their own; what is given beside it counts."""
    plain = scene(bodies=(replace(scene().bodies[0], elements="smoothed"),))
    found = plain.with_settings(model="paper")
    assert (found.integrator, found.feedback) == ("implicit_euler", 0.0)
    assert [found.elements_of(body) for body in found.bodies] == ["linear"]
    assert found.model == "the paper's (implicit Euler, linear elements, no drift feedback)"
    assert plain.with_settings(feedback=0.1).model == "bdf2, smoothed elements, drift feedback 0.1"
    found = plain.with_settings(model="paper", integrator="bdf2", dt=0.02)
    assert (found.integrator, found.elements, found.feedback, found.dt) == ("bdf2", "linear", 0.0, 0.02)
    assert found.model == "bdf2, linear elements, no drift feedback"


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"model": "papers"}, "model = 'papers' must be paper"),
        ({"friction.iterations": 2}, "no Friction"),
        ({"dhat": 0.1}, "no Barrier"),
        ({"frictions": 2}, "unknown setting"),
        ({"jitter": 0.1}, "jitter"),
        ({"jitter": (0.1, 0.5)}, "seed of jitter"),
        ({"jitter": (-0.1, 1)}, "speed of jitter"),
    ],
)
def test_settings_that_do_not_fit_are_refused(settings, message):
    with pytest.raises(InputError, match=message):
        scene(contact=()).with_settings(**settings)


@pytest.mark.parametrize("velocity", [(), (1.0, -2.0), lambda x: x])
def test_jitter_adds_the_same_speed_at_all_points(velocity):
    points = np.random.default_rng(0).normal(size=(7, 2))
    body = Body(meshes.disc(1.0), NeoHookean(1e4), vertices=(40,), velocity=velocity)
    one, two = jittered((body, body), (0.1, 5))
    moved = one.initial_velocity(points, np.zeros(2)) - body.initial_velocity(points, np.zeros(2))
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), 0.1)
    np.testing.assert_allclose(moved, np.broadcast_to(moved[0], moved.shape), atol=1e-15)
    assert one.velocity == jittered((body,), (0.1, 5))[0].velocity != jittered((body,), (0.1, 6))[0].velocity
    assert not np.allclose(one.initial_velocity(points, np.zeros(2)), two.initial_velocity(points, np.zeros(2)))
