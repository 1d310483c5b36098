"""Scores of made-up runs whose motion is known: the numbers are derived by hand."""

import numpy as np
import pytest

import runs
from pdvol import open_run
from pdvol.errors import InputError
from pdvol.store.writer import RunWriter
from pdvol.studio.shown import upward
from pdvol.studio.wedge.scored_body import ScoredBody, at_level, contact_distance
from pdvol.studio.wedge.scores import (
    chosen_scores,
    close_to,
    first_contact,
    lands_in,
    largest_stretch,
    meets,
    quiet,
    upright,
)
from shapes import together

DT, STEPS, DHAT = 0.1, 10, 0.05


def made(path, motion, dim=2, steps=STEPS, stored=None, up=True, placement=None):
    """A run of two balls of radius 0.5 m, "a" and "b" 3 m to its right; `motion` (points, time, body) gives positions.
    The ground is 1 m below their centres.
    """
    mesh = together(*(runs.ball(dim, 60, np.eye(dim)[0] * 3.0 * i) for i in range(2)))
    placed = {"angle": 0.0, "axis": [0.0, 0.0, 1.0], **(placement or {})}
    info = {"scene": "made", "dt": DT, "steps": steps, "method": "direct", "parameters": {}, "versions": {}}
    info["description"] = {
        "contact": [{"type": "Barrier", "dhat": {"type": "Relative", "fraction": DHAT / 2}}],
        "bodies": [{"placement": placed}] * 2,
    }
    info |= {"diagonal": 2.0, "up": [0.0] * (dim - 1) + [9.81]} if up else {}
    with RunWriter.create(path, info, [mesh], ["a", "b"]) as run:
        normal = np.eye(dim)[-1]
        runs.write_obstacles(run.path, [{"name": "ground", "kind": "plane", "point": -normal, "normal": normal}])
        for step in range((steps if stored is None else stored) + 1):
            x = mesh.points.copy()
            for body in range(2):
                mine = mesh.point_bodies == body
                x[mine] = motion(mesh.points[mine], step * DT, body)
            contacts = {"contacts": int(step >= 4), "newton_iterations": 1}
            run.write_state(0, step, x, {"level": 0, "step": step, **contacts} if step else None)
    return open_run(path)


def turned(points, angle):
    """Turned by an angle in the plane of the first and the last axis, about the centre."""
    centre, result = points.mean(axis=0), points.copy()
    c, s = np.cos(angle), np.sin(angle)
    result[:, [0, -1]] = (points - centre)[:, [0, -1]] @ np.array([[c, s], [-s, c]]) + centre[[0, -1]]
    return result


def still(points, time, body):
    return points


def sliding(points, time, body):
    """Body a goes 2 m to the right in a second."""
    return points + (1 - body) * 2.0 * time * np.eye(points.shape[1])[0]


@pytest.mark.parametrize("dim", [2, 3])
def test_upright_is_the_cosine_of_the_turn(tmp_path, dim):
    run = made(tmp_path / "run", lambda x, t, body: turned(x, (1.0 + body) * t), dim)
    assert upright("a")(run) == pytest.approx(np.cos(1.0), abs=1e-8)
    assert upright("b")(run) == pytest.approx(np.cos(2.0), abs=1e-8)


def test_upright_by_an_axis_of_the_shape_counts_the_placement(tmp_path):
    run = made(tmp_path / "run", still, 2, placement={"angle": np.pi})
    assert upright("a")(run) == pytest.approx(1.0) and upright("a", axis=(0.0, 2.0))(run) == pytest.approx(-1.0)
    with pytest.raises(InputError, match="must be a direction of 2 numbers"):
        upright("a", axis=(0.0, 1.0, 0.0))(run)
    lying = made(tmp_path / "lying", still, 3, up=False)
    assert upward(lying).tolist() == [0.0, 0.0, 1.0], "without gravity it is the ground's normal"


def test_lands_in_counts_from_the_box(tmp_path):
    run = made(tmp_path / "run", sliding)
    size = ScoredBody.named(run, "a").size
    centre = ScoredBody.named(run, "a").centre(STEPS)
    assert lands_in("a", centre - 0.1, centre + 0.1)(run) == 1.0
    assert lands_in("a", centre + [0.3, 0.4], centre + 9.0)(run) == pytest.approx(-0.5 / size)
    with pytest.raises(InputError, match="box has 3 coordinates in a 2D scene"):
        lands_in("a", (0, 0, 0), (1, 1, 1))(run)
    with pytest.raises(InputError, match="must not be above"):
        lands_in("a", (1, 0), (0, 1))


def test_close_to_goes_between_stored_steps(tmp_path):
    run = made(tmp_path / "run", sliding)
    body = ScoredBody.named(run, "a")
    start = body.centre(0)
    assert close_to("a", [0.25], [start + [0.5, 0.0]])(run) == pytest.approx(0.0, abs=1e-8)
    far = close_to("a", [0.0, 1.0], [start + [0.0, 0.3], start + [2.0, 0.4]])(run)
    assert far == pytest.approx(-np.sqrt((0.09 + 0.16) / 2) / body.size)
    with pytest.raises(InputError, match="between 0 and 1 s"):
        close_to("a", [1.5], [start])(run)
    with pytest.raises(InputError, match="as many points"):
        close_to("a", [0.5, 1.0], [start])


def test_quiet_is_the_speed_of_the_last_tenth(tmp_path):
    run = made(tmp_path / "run", lambda x, t, body: x + (1 - body) * max(0.0, t - 0.9) * 3.0 * np.array([1.0, 0.0]))
    assert quiet("a")(run) == pytest.approx(-3.0)
    assert quiet("b")(run) == 0.0
    halves = ScoredBody.named(run, None).weights
    assert quiet()(run) == pytest.approx(-3.0 * np.sqrt(halves[run.levels[0].mesh.point_bodies == 0].sum()))


@pytest.mark.parametrize("dim", [2, 3])
def test_largest_stretch_is_that_of_all_times(tmp_path, dim):
    stretched = lambda t, body: 1.0 + np.eye(dim)[0] * (1 - body) * 0.5 * np.sin(np.pi * t)
    run = made(tmp_path / "run", lambda x, t, body: turned(x * stretched(t, body), t), dim)
    assert largest_stretch("a")(run) == pytest.approx(1.5)
    assert largest_stretch("b")(run) == pytest.approx(1.0)
    assert chosen_scores(["-largest_stretch()"], None)["-largest_stretch()"](run) == pytest.approx(-1.5)


def falling(points, time, body):
    """Body a comes down to 0.02 m above the ground at 0.7 s, where it stays."""
    down = np.zeros(points.shape[1])
    down[-1] = 0.48 * min(1.0, time / 0.7)
    return points - (1 - body) * down


def test_first_contact(tmp_path):
    run = made(tmp_path / "run", falling)
    assert first_contact()(run) == pytest.approx(0.4), "the log's first record with contacts"
    lowest = [(run.levels[0].positions(s)[:, 1]).min() + 1.0 for s in range(STEPS + 1)]
    first = next(s for s, gap in enumerate(lowest) if gap < DHAT)
    assert 5 < first < 9
    assert first_contact("a")(run) == pytest.approx(first * DT)
    assert first_contact("b")(run) == pytest.approx(STEPS * DT), "never: the length of the shot"


def test_meets_bodies_and_obstacles(tmp_path):
    run = made(tmp_path / "run", lambda x, t, body: falling(sliding(x, t, body), t, body))
    assert contact_distance(run) == pytest.approx(DHAT)
    assert meets("a", "ground")(run) == 1.0
    assert meets("b", "ground")(run) == pytest.approx(-(0.5 - DHAT) / ScoredBody.named(run, "b").size, abs=0.02)
    assert meets("a", "b")(run) == pytest.approx(meets("b", "a")(run), rel=1e-12)
    assert -0.3 < meets("a", "b")(run) < 0.0
    with pytest.raises(InputError, match="nothing is called 'c'; there are a, b, ground"):
        meets("a", "c")(run)


def test_runs_that_ended_early_have_no_end(tmp_path):
    run = made(tmp_path / "run", falling, stored=8)
    for score in (upright("c"), quiet("c"), lands_in("c", (0, 0), (1, 1)), largest_stretch("c"), first_contact("c")):
        with pytest.raises(InputError, match="there is no body 'c'; there are a, b$"):
            score(run)
    for score in (upright("a"), lands_in("a", (0, 0), (1, 1)), quiet(), largest_stretch(), meets("a", "b")):
        assert np.isnan(score(run))
    assert np.isnan(first_contact("b")(run))
    assert first_contact()(run) == pytest.approx(0.4), "what has happened has happened"
    assert meets("a", "ground")(run) == 1.0
    centre = ScoredBody.named(run, "a").centre(0)
    assert close_to("a", [0.0], [centre])(run) == pytest.approx(0.0, abs=1e-12)
    assert np.isnan(close_to("a", [0.9], [centre])(run))


SCENE = """
from pdvol.studio.wedge.scores import upright
def mine(run):
    return run.dt
def at_least(value, of=1):
    return lambda run: value * of
def broken(run):
    return 1 / 0
number = 3
"""


def test_scores_are_texts_and_a_coarser_level_has_its_own(tmp_path, flat_run):
    file = tmp_path / "scene.py"
    file.write_text(SCENE)
    run = made(tmp_path / "run", still)
    texts = ['upright("a")', "quiet", "mine", "-mine", "at_least(-2, of=3)", f"{file}:mine"]
    scores = chosen_scores(texts, file)
    assert list(scores) == texts
    assert [score(run) for score in scores.values()] == pytest.approx([1.0, 0.0, DT, -DT, -6.0, DT])
    with pytest.raises(InputError, match="ZeroDivisionError: division by zero"):
        chosen_scores(["broken"], file)["broken"](run)
    run = open_run(flat_run)
    assert len(at_level(run, 0).levels) == 1 and quiet()(at_level(run, 0)) != quiet()(run)
    with pytest.raises(InputError, match="has no level 7; there are 0 to 1"):
        at_level(run, 7)
    for text, message in {
        "upright(": "cannot be read",
        "1 + 1": "cannot be read",
        "__import__('os').system('true')": "cannot be read",
        "upright(open('x'))": "ValueError",
        "upright()": "TypeError",
        "upright(a)": 'a is a name; write text in quotes, as "a"',
        "nothing": "there is no nothing and scene.py has no such function; the ready scores are upright, lands_in",
        "number": "there is no number",
        "gone.py:mine": "there is no scene file gone.py",
        "mine(1)": "AttributeError",
    }.items():
        with pytest.raises(InputError, match=message) as caught:
            chosen_scores([text], file)
        assert "\n" not in str(caught.value)
