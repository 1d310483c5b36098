"""Variations: names of folders, words of command lines, JSON."""

import math
from pathlib import Path

import numpy as np
import pytest

from pdvol.runs.scene_file import parse_settings
from pdvol.scene import Pascal, Relative
from pdvol.studio.wedge.variation import Base, Variation, number, short_text, times, value_text

BASE = Base(Path("scene.py"), (("young", 2e4), ("tolerance", Relative(1e-4))), 1.2, 0.01)
SEVERAL = [
    Variation(),
    Variation(method="direct"),
    Variation.of({"dt": 0.02}),
    Variation.of({"dt": 0.02, "tolerance": Relative(1e-2)}),
    Variation.of({"dt": 0.02, "tolerance": 1e-2}),
    Variation.of({"offset": -0.1}),
    Variation.of({"offset": 0.1}),
    Variation.of({"surface": "a" * 200 + "1"}),
    Variation.of({"surface": "a" * 200 + "2"}),
    Variation.of({"surface": "../a b/c.obj"}),
    Variation.of({"jitter": (0.001, 2)}),
    Variation.of({"friction.iterations": 3, "ccd": "tight-inclusion"}),
]


def test_folders_have_names_of_their_own_without_special_characters():
    names = [variation.name for variation in SEVERAL]
    assert len(set(names)) == len(names)
    assert all(set(name) <= set("abcdefghijklmnopqrstuvwxyz0123456789.-_+e") for name in names)
    one, other = (Variation.of({"dt": dt}) for dt in (1 / 240, math.nextafter(1 / 240, 1.0)))
    assert [Variation.from_json(each.as_json()) for each in SEVERAL] == SEVERAL
    assert SEVERAL[1].words(BASE, "0:1")[4:6] == ["--method", "direct"]
    assert one.name != other.name and one.label() == "dt 0.00416667", "they differ in the last bit"
    assert names[0] == "default" and Variation.of({"surface": "../a b/c.obj"}).name == "surface-..-a-b-c.obj"


def test_the_duration_stays_when_the_time_step_changes():
    assert Variation().steps(BASE) == 120
    assert Variation.of({"dt": 0.04}).steps(BASE) == 30 and Variation.of({"dt": 0.0025}).steps(BASE) == 480


def test_values_keep_their_kind():
    assert times(Relative(1e-3), 0.1) == Relative(1e-4) and times(3, 2.0) == 6.0
    assert number(Relative(0.5)) == 0.5 and number("classic") is None and number(True) is None
    assert times(Pascal(2e4), 0.5) == Pascal(1e4) and value_text(Pascal(1e4)) == "Pascal(10000)"
    assert [times(1 / 240, factor) for factor in (2.0, 0.5)] == [1 / 120, 1 / 480] and times(0.1, 0.1) == 0.01
    assert short_text("Relative(0.3333333333333333)") == "Relative(0.333333)", "people read six digits"
    assert short_text("(0.1,0.30000000000000004)") == "(0.1,0.3)" and short_text("cow_2.obj") == "cow_2.obj"
    assert value_text(Relative(1e-3)) == "Relative(0.001)" and value_text((0.5, 1)) == "(0.5,1)"


EXACT = [
    1 / 240, 0.1 + 0.2, 1 / 3, 1e-300, 5e-324, 123456789.0, 2.0, -0.0, 1e22, math.inf, -math.inf, math.pi, 16777217,
    Relative(1 / 3), Relative(1 / 240), Pascal(1e6 / 7), Pascal(123456789.0), (1 / 3, 2 / 3, -0.0), (1 / 240,), (),
    ((0.1, 1 / 7), (1e-9, 3)), np.float64(1 / 3), np.float32(0.1), np.int64(3), np.array([1 / 3, 2.0]), [1 / 3, "a, b"],
    "0.5", "None", "(1, 2)", "cow.obj", "a b", "Relative(1e-3)", True, None,
]  # fmt: skip


@pytest.mark.parametrize("value", EXACT, ids=repr)
def test_a_value_travels_to_the_last_bit(value):
    """By the command line of a run, by wedge.json and study.json; with its type."""
    plain = value.tolist() if hasattr(value, "tolist") else value
    plain = tuple(plain) if isinstance(plain, list) else plain
    back = parse_settings([f"x={value_text(value)}"])["x"]
    assert back == plain and type(back) is type(plain)
    assert repr(back) == repr(plain) or isinstance(plain, Pascal)
    variation = Variation.of({"x": plain})
    words = variation.words(Base(Path("scene.py"), (("y", value),), 1.0, 0.1), "0:0")
    assert parse_settings(words[-1:])["x"] == plain and parse_settings([words[-3]])["y"] == plain
    assert Variation.from_json(variation.as_json()) == variation
