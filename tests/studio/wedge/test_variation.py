"""Variations: names of folders, words of command lines, JSON."""

from pathlib import Path

from pdvol.runs.scene_file import parse_settings
from pdvol.scene import Pascal, Relative
from pdvol.studio.wedge.variation import Base, Variation, number, times, value_text

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
    assert names[0] == "default" and Variation.of({"surface": "../a b/c.obj"}).name == "surface-..-a-b-c.obj"


def test_words_give_the_same_settings_back():
    for variation in SEVERAL:
        words = variation.words(BASE, "0:1")
        settings = parse_settings([words[i + 1] for i, word in enumerate(words) if word == "--set"])
        assert settings == {**dict(BASE.settings), **dict(variation.changes)}
        assert Variation.from_json(variation.as_json()) == variation


def test_the_duration_stays_when_the_time_step_changes():
    assert Variation().steps(BASE) == 120
    assert Variation.of({"dt": 0.04}).steps(BASE) == 30 and Variation.of({"dt": 0.0025}).steps(BASE) == 480


def test_values_keep_their_kind():
    assert times(Relative(1e-3), 0.1) == Relative(1e-4) and times(3, 2.0) == 6.0
    assert number(Relative(0.5)) == 0.5 and number("classic") is None and number(True) is None
    assert times(Pascal(2e4), 0.5) == Pascal(1e4) and value_text(Pascal(1e4)) == "Pascal(10000)"
    assert value_text(Relative(1e-3)) == "Relative(0.001)" and value_text((0.5, 1)) == "(0.5,1)"
