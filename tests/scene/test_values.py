"""Scene classes accept arrays and lists in place of tuples. Values, hashes and descriptions are the same, and reprs are
short.
"""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

import pdvol
from pdvol import (
    Attachment,
    Barrier,
    Body,
    Flow,
    Force,
    Friction,
    Gravity,
    Impulse,
    InputError,
    Keyed,
    Muscle,
    NeoHookean,
    Pascal,
    Path,
    Penalty,
    Placement,
    Plane,
    PointForce,
    Region,
    Relative,
    Rigid,
    Rotation,
    Scene,
    Separate,
    Sequential,
    Solid,
    Solver,
    Still,
    Support,
    Translation,
)
from pdvol.runs.fingerprint import describe, differences

SQUARE = Solid(np.array([(0.0, 0), (1, 0), (1, 1), (0, 1)]), np.array([(0, 1, 2), (0, 2, 3)]), np.zeros(2, np.int32))
SOFT = NeoHookean(1e5)

# Each class with the arguments that may be arrays, as tuples, and with what is wrong in a message.
VALUES = [
    (Translation, {"velocity": (1.0, 0.0)}),
    (Rotation, {"speed": 2.0, "centre": (0.0, 0.5), "axis": (0.0, 0.0, 2.0)}),
    (Path, {"times": (0.0, 1.0, 2.5), "points": ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))}),
    (Gravity, {"acceleration": (0.0, -9.81)}),
    (Force, {"force": (0.0, 1.0, 2.0)}),
    (PointForce, {"force": (0.0, 1.0), "at": (0.5, 0.5)}),
    (Impulse, {"velocity": (0.0, 1.0)}),
    (Flow, {"velocity": (0.0, 1.0)}),
    (Keyed, {"times": (0.0, 1.0), "values": (2.0, 3.0)}),
    (lambda **given: Attachment("a", "b", **given), {"where": (0.0, 1.0), "to": (0.5, 1.0)}),
    (lambda **given: Muscle("a", strength=1.0, **given), {"fibre": (0.0, 1.0)}),
    (Plane, {"point": (0.0, 0.0), "normal": (0.0, 1.0)}),
    (Placement, {"translate": (0.0, 1.0), "axis": (0.0, 1.0, 0.0)}),
    (
        lambda **given: Body(SQUARE, SOFT, **given),
        {"vertices": (100, 400), "velocity": (0.0, 1.0), "spin": (0.1, 0.2, 0.3)},
    ),
    (lambda **given: Region(SOFT, **given), {"where": (1, 2)}),
]


def named(value):
    return getattr(value[0], "__name__", "").replace("<lambda>", next(iter(value[1])))


@pytest.mark.parametrize("make, given", VALUES, ids=[named(value) for value in VALUES])
def test_arrays_and_lists_give_what_tuples_give(make, given):
    as_tuples = make(**given)
    for kind in (np.array, lambda value: np.array(value).tolist()):
        other = make(**{name: kind(value) for name, value in given.items()})
        assert other == as_tuples and hash(other) == hash(as_tuples)
        assert json.dumps(describe(other)) == json.dumps(describe(as_tuples))
        for name in given:
            assert getattr(other, name) == getattr(as_tuples, name)


@pytest.mark.parametrize("make, given", VALUES, ids=[named(value) for value in VALUES])
@pytest.mark.parametrize("bad", [np.ones((2, 2)), [[1.0], [1.0, 2.0]], np.array([np.nan, 1.0]), "text", [True, False]])
def test_bad_shapes_are_refused_in_one_line(make, given, bad):
    for name in given:
        if name in ("points", "values") and isinstance(bad, np.ndarray) and bad.ndim == 2:
            continue  # two vectors: values of `Keyed`, and points whose number the next test asks for
        with pytest.raises(InputError) as caught:
            make(**{**given, name: bad})
        assert "\n" not in str(caught.value)


def test_a_path_needs_as_many_points_as_times():
    for times, points, said in (
        (np.arange(3.0), np.zeros((2, 3)), "3 times and 2 points"),
        (np.zeros(2), np.zeros((2, 3)), "must ascend"),
        (np.arange(2.0), np.zeros((2, 4)), "two or three components"),
    ):
        with pytest.raises(InputError, match=said):
            Path(times, points)


def test_numpy_numbers_are_kept_as_pythons():
    for element, name in (
        (NeoHookean(np.float64(1e5), np.float32(0.25)), "poisson"),
        (Barrier(dhat=np.float64(1e-3)), "dhat"),
        (Friction(np.float32(0.5)), "mu"),
        (Relative(np.float64(1e-3)), "fraction"),
        (Pascal(np.float64(1e3)), "pascals"),
        (Solver(max_iterations=np.int64(7)), "max_iterations"),
        (Penalty(np.float64(0.5)), "consistency"),
        (Separate(limit=np.float64(0.5)), "limit"),
        (Translation((1.0, 0.0), stop=np.float64(2.0)), "stop"),
        (Rigid(SQUARE, opacity=np.float64(0.5)), "opacity"),
        (Support(everything, release=np.float64(0.5)), "release"),
    ):
        assert type(getattr(element, name)) in (int, float)
        assert hash(element) == hash(replace(element))


def everything(X):
    return np.ones(len(X), dtype=bool)


def shot(vector, many):
    """A scene with something of everything; `vector` and `many` make of tuples what is to be tried."""
    aside, stiff = vector((1.0, 0.0)), many((Region(NeoHookean(2e5), vector((1, 2))),))
    square = Body(many((SQUARE, SQUARE)), SOFT, name="square", velocity=aside, spin=0.5, regions=stiff)
    bear = Body("bear.obj", SOFT, vector((100, 400)), name="bear", spin=vector((0.1, 0.2, 0.3)))
    way = Path(vector((0.0, 1.0)), vector(((0.0, 0.0), (0.0, 1.0))))
    return Scene(
        bodies=many((square, bear)),
        dt=0.01,
        steps=10,
        loads=many((Gravity(vector((0.0, -9.81))), Flow(aside))),
        supports=many((Support(everything, motion=Sequential(many((Still(), Translation(aside))))),)),
        obstacles=many((Plane(vector((0.0, 0.0)), vector((0.0, 1.0)), way),)),
        contact=many((Barrier(), Friction(0.1, pairs=many((many(("square", "plane", 0.9)),))))),
        separate=many((Separate(),)),
    )


def test_a_scene_of_arrays_is_the_scene_of_tuples():
    plain, arrays, lists = shot(tuple, tuple), shot(np.array, tuple), shot(list, list)
    for other in (arrays, lists):
        assert plain == other and hash(plain) == hash(other) and differences(describe(plain), describe(other)) == []
    pairs = plain.contact[1]
    assert (
        pairs == Friction(0.1, pairs={("square", "plane"): np.float64(0.9)}) and pairs.between("plane", "square") == 0.9
    )


def test_descriptions_of_scenes_written_with_tuples_stay():
    """What runs stored before this version hold: numbers as they were written, whole or not."""
    assert describe(Gravity((0, -9.81))) == {"type": "Gravity", "acceleration": [0, -9.81]}
    assert json.dumps(describe(Plane((0, 0.5), (0, 1)))) == (
        '{"type": "Plane", "point": [0, 0.5], "normal": [0, 1], "motion": {"type": "Still"}, "name": "plane"}'
    )
    assert [describe(Body(SQUARE, SOFT, (10, 20), spin=spin))["spin"] for spin in ((), 2)] == [[], 2]


def test_reprs_are_one_short_line():
    scene, many = shot(np.array, tuple), Path(np.linspace(0, 1, 500), np.zeros((500, 3)))
    elements = [scene, *scene.bodies, *scene.loads, *scene.supports, *scene.obstacles, *scene.contact, SQUARE, many]
    for element in elements:
        assert "\n" not in repr(element) and len(repr(element)) < 400
    assert repr(NeoHookean(everything)) == "NeoHookean(young=everything)"
    assert repr(SQUARE) == "Solid(vertices=(4, 2), cells=(2, 3))"
    assert repr(pdvol.meshes.ball(1.0, 1)) == "Surface(vertices=(42, 3), triangles=(80, 3))"
    assert repr(pdvol.meshes.rectangle(1.0, 1.0)) == "Outline(points=(4, 2))"
    assert repr(many).startswith(
        "Path(times=(0.0, 0.002004008016032064, ..., 1.0: 500 in all), points=((0.0, 0.0, 0.0)"
    )
    assert "bodies=('square', 'bear')" in repr(scene) and "loads=(Gravity, Flow)" in repr(scene)


WRONG_FUNCTIONS = {
    "Attachment.where": lambda f: pdvol.Attachment("a", "b", f),
    "body 'b': start": lambda f: pdvol.Body("b.obj", pdvol.NeoHookean(1e5), (10,), "b", start=f),
    "body 'b': velocity": lambda f: pdvol.Body("b.obj", pdvol.NeoHookean(1e5), (10,), "b", velocity=f),
    "Gravity.acceleration": pdvol.Gravity,
    "Flow.velocity": pdvol.Flow,
    "Pressure.pressure": lambda f: pdvol.Pressure("b", f),
    "NeoHookean.young": pdvol.NeoHookean,
    "Region.where": lambda f: pdvol.Region(pdvol.NeoHookean(1e5), f),
    "Sequential.motions[0]": lambda f: pdvol.Sequential((f,)),
    "Support.where": pdvol.Support,
    "Support.motion": lambda f: pdvol.Support(lambda X: X[:, 0] > 0.0, motion=f),
    "plane 'p': motion": lambda f: pdvol.Plane((0.0, 0.0), (0.0, 1.0), f, "p"),
    "obstacle 'o': motion": lambda f: pdvol.Rigid("o.obj", motion=f, name="o"),
    "Muscle.fibre": lambda f: pdvol.Muscle("b", f, 1.0),
    "Muscle.activation": lambda f: pdvol.Muscle("b", (1.0, 0.0), 1.0, f),
    "Muscle.where": lambda f: pdvol.Muscle("b", (1.0, 0.0), 1.0, where=f),
}


@pytest.mark.parametrize("name", WRONG_FUNCTIONS)
def test_functions_of_other_arguments_are_refused_before_meshing(name):
    for function in (lambda: 0.0, lambda a, b, c: 0.0):
        with pytest.raises(pdvol.InputError, match=f"^{re.escape(name)} must be a function of"):
            WRONG_FUNCTIONS[name](function)


def test_a_muscle_may_be_activated_by_time_alone():
    X = np.zeros((3, 2))
    by_time = pdvol.Muscle("b", (1.0, 0.0), 2.0, lambda t: 3.0 * t)
    np.testing.assert_array_equal(by_time.tension(0.5, X), [3.0, 3.0, 3.0])
    with pytest.raises(pdvol.InputError, match="negative, NaN or infinite at t = -1 s"):
        by_time.tension(-1.0, X)
