"""Controls from a scene function's parameters."""

import pytest

from cli_scenes import FALL, write
from pdvol.errors import InputError
from pdvol.studio.live.controls import controls

TYPED = FALL.replace(
    "def scene(young=2e4, height=0.02, mu=0.3, steps=10, velocity=(0.3, 0.0), sizes=(2, 4)):",
    "def scene(young: Annotated[float, (1e3, 1e5)] = 2e4, height=0.02, mu=0.3, steps: 'Nowhere' = 10,\n"
    "          velocity=(0.3, 0.0), sizes=(2, 4), soft: bool = False, label='x', nothing=None, zero=0.0, less=-2.0,\n"
    "          count: Annotated[int, (1, 9)] = 3):",
).replace("import pdvol\n", "import pdvol\nfrom typing import Annotated\n")


@pytest.mark.parametrize(
    ("settings", "vary", "made"),
    [
        ({}, [], {"young": ("slider", 2e4, 1e3, 1e5, 500.0), "height": ("slider", 0.02, 0.005, 0.04)}),
        ({}, [], {"steps": ("slider", 10, 2, 20, 1), "count": ("slider", 3, 1, 9), "soft": ("checkbox", False)}),
        ({}, [], {"zero": ("slider", 0.0, -1.0, 1.0), "less": ("slider", -2.0, -4.0, -0.5)}),
        ({}, [], {"velocity": ("text", (0.3, 0.0)), "label": ("text", "x"), "nothing": ("text", None)}),
        ({"young": 5e4, "height": 0.1}, ["young=1e4:3e4:9"], {"young": ("slider", 5e4, 1e4, 5e4)}),
        ({"height": 0.1}, ["steps=5:20"], {"height": ("slider", 0.1, 0.025, 0.2), "steps": ("slider", 10, 5, 20, 1)}),
        (
            {},
            ["young=3e4:1e4", "dhat=1e-3:1e-2"],
            {"young": ("slider", 2e4, 1e4, 3e4), "dhat": ("slider", 1e-3, 1e-3, 1e-2)},
        ),
        ({}, ["mu=0,0.2,0.4"], {"mu": ("choice", 0.3, 0.0, 0.0, 0.0, ("0.3", "0", "0.2", "0.4"))}),
        (
            {},
            ["velocity=(0,1),(2.5,3)"],
            {"velocity": ("choice", (0.3, 0.0), 0.0, 0.0, 0.0, ("(0.3,0.0)", "(0,1)", "(2.5,3)"))},
        ),
    ],
)
def test_each_parameter_has_the_control_of_its_kind(tmp_path, settings, vary, made):
    """Kind, value, ends, step and choices, from what is given, annotations and values, in this order. Annotations that
    name nothing are left.
    """
    found = {control.name: control for control in controls(write(tmp_path / "typed.py", TYPED), settings, vary)}
    assert list(found)[:3] == ["young", "height", "mu"]
    assert found["velocity"].text == "(0.3,0.0)" and found["label"].text == "x"
    for name, expected in made.items():
        one = found[name]
        values = one.kind, one.value, one.low, one.high, one.step, one.choices
        assert values[: len(expected)] == expected and type(one.value) is type(expected[1]), name


@pytest.mark.parametrize(
    "texts", ["young", "young=", "young=1", "young=b:c", "young=2:2", "=1:2", "colour=1:2", "mu=0.1,0.2 mu=0:1"]
)
def test_mistakes_are_one_line(tmp_path, texts):
    with pytest.raises(InputError) as error:
        controls(write(tmp_path / "typed.py", TYPED), {}, texts.split())
    assert "\n" not in str(error.value)
