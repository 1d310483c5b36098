"""Grids, samples and jitter."""

import numpy as np
import pytest
from scipy.stats import qmc

from pdvol.errors import InputError
from pdvol.scene import Relative
from pdvol.studio.wedge.vary import MOST_VARIATIONS, TAKEN, chosen_variations, parse_vary, parsed_varies


def changes(*words, **options):
    return [dict(variation.changes) for variation in chosen_variations(parsed_varies(words, TAKEN), **options)]


def test_ranges_and_lists_are_read_as_settings_are():
    for text, values in {
        "offset=-0.1:0.1:9": (-0.1, -0.075, -0.05, -0.025, 0.0, 0.025, 0.05, 0.075, 0.1),
        "x=123456789:123456791:3": (123456789, 123456790, 123456791),
        "n=1:5:5": (1, 2, 3, 4, 5),
        "offset=0.1:-0.1:2": (0.1, -0.1),
        "spin=0,2,4": (0, 2, 4),
        "velocity=(0,1),(2.5,3)": ((0, 1), (2.5, 3)),
        "surface=cow.obj,spot.obj": ("cow.obj", "spot.obj"),
        "dhat=Relative(1e-3),0.01": (Relative(1e-3), 0.01),
        "file=a:b": ("a:b",),
    }.items():
        assert repr(parse_vary(text).values) == repr(values)
    assert parse_vary(f"dt={1 / 240!r}:{1 / 60!r}:4").values[::3] == (1 / 240, 1 / 60)
    assert parse_vary("time=12:30").ends == (12.0, 30.0)


def test_several_make_a_grid_and_jitter_differs_in_each_variation():
    assert changes("a=1,2", "b=0:1:3") == [{"a": a, "b": b} for a in (1, 2) for b in (0, 0.5, 1)]
    assert changes(sample=3, jitter=0.01) == [{"jitter": (0.01, n)} for n in range(3)]
    assert changes("a=1,2", jitter=0.5) == [{"a": 1, "jitter": (0.5, 0)}, {"a": 2, "jitter": (0.5, 1)}]
    assert sorted(entry["a"] for entry in changes("a=1,2,3", sample=50)) == [1, 2, 3], "each value once"


def test_a_sample_fills_the_ranges_evenly_and_a_larger_one_begins_with_it():
    words = ("a=-1:3", "b=10:20", "c=x,y")
    found = changes(*words, sample=64)
    assert found == changes(*words, sample=100)[:64] and found != changes(*words, sample=64, seed=1)
    points = np.array([[(entry["a"] + 1) / 4, (entry["b"] - 10) / 10] for entry in found])
    chance = np.random.default_rng(0).random((64, 2))
    assert qmc.discrepancy(np.clip(points, 0, 1)) < 0.5 * qmc.discrepancy(chance)
    assert 24 <= sum(entry["c"] == "x" for entry in found) <= 40


@pytest.mark.parametrize(
    ("words", "options", "message"),
    [
        (("a",), {}, "write name="),
        (("a=",), {}, "write name="),
        (("2a=1",), {}, "write name="),
        (("a=1,,2",), {}, "empty"),
        (("a=0:1:1",), {}, "from 2"),
        (("a=0:1:x",), {}, "from 2"),
        (("a=0:1e999:3",), {}, "finite"),
        (("a=0:1",), {}, "a=0:1:9"),
        (("a=1", "a=2"), {}, "twice"),
        (("steps=1,2",), {}, "--steps"),
        ((), {}, "say what differs"),
        ((), {"jitter": 0.1}, "--sample N"),
        ((), {"sample": 5}, "nothing would differ"),
        (("a=0:1",), {"sample": 0}, "from 1"),
        (("a=0:1",), {"sample": MOST_VARIATIONS + 1}, "from 1"),
        (("a=0:1:200", "b=0:1:200"), {}, "40000 variations"),
        (("a=1",), {"jitter": -1.0}, "above zero"),
    ],
)
def test_mistakes_are_named(words, options, message):
    with pytest.raises(InputError, match=message):
        changes(*words, **options)
