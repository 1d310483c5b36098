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


@pytest.fixture
def scene(tmp_path):
    write(tmp_path / "typed.py", TYPED.replace("'Nowhere'", "int"))
    return tmp_path / "typed.py"


def test_each_parameter_has_the_control_of_its_kind(scene):
    made = {control.name: control for control in controls(scene, {}, [])}
    assert list(made)[:3] == ["young", "height", "mu"]
    young = made["young"]
    assert (young.kind, young.low, young.high, young.value, young.step) == ("slider", 1e3, 1e5, 2e4, 500.0)
    assert (made["height"].low, made["height"].high) == (0.005, 0.04)
    assert made["steps"].kind == "slider" and made["steps"].step == 1 and isinstance(made["steps"].value, int)
    assert (made["count"].low, made["count"].high) == (1, 9)
    assert made["soft"].kind == "checkbox" and made["soft"].value is False
    assert made["velocity"].kind == made["label"].kind == made["nothing"].kind == "text"
    assert made["velocity"].text == "(0.3,0.0)" and made["label"].text == "x"
    assert (made["zero"].low, made["zero"].high) == (-1.0, 1.0)
    assert (made["less"].low, made["less"].high) == (-4.0, -0.5)


def test_ranges_and_values_that_are_given_come_first(scene):
    vary = ["young=1e4:3e4:9", "mu=0,0.2,0.4", "dhat=1e-3:1e-2", "steps=5:20"]
    made = {control.name: control for control in controls(scene, {"young": 5e4, "height": 0.1}, vary)}
    assert (made["young"].low, made["young"].high, made["young"].value) == (1e4, 5e4, 5e4)
    assert made["height"].value == 0.1 and made["height"].high == 0.2
    assert made["mu"].kind == "choice" and made["mu"].choices == ("0.3", "0", "0.2", "0.4")
    assert (made["dhat"].kind, made["dhat"].low, made["dhat"].high) == ("slider", 1e-3, 1e-2)
    assert (made["steps"].low, made["steps"].high, made["steps"].step) == (5, 20, 1)


def test_ranges_and_lists_are_read_as_by_wedge(scene):
    vary = ["young=3e4:1e4", "mu=0.1,0.2", "velocity=(0,1),(2.5,3)"]
    made = {control.name: control for control in controls(scene, {}, vary)}
    assert (made["young"].low, made["young"].high) == (1e4, 3e4)
    assert made["mu"].choices == ("0.3", "0.1", "0.2")
    assert made["velocity"].choices == ("(0.3,0.0)", "(0,1)", "(2.5,3)")
    with pytest.raises(InputError, match="--vary names mu twice"):
        controls(scene, {}, ["mu=0.1,0.2", "mu=0:1"])


def test_annotations_that_name_nothing_are_left(tmp_path):
    write(tmp_path / "typed.py", TYPED)
    made = {control.name: control for control in controls(tmp_path / "typed.py", {}, [])}
    assert made["steps"].kind == "slider"


@pytest.mark.parametrize("text", ["young", "young=", "young=1", "young=b:c", "young=2:2", "=1:2", "colour=1:2"])
def test_mistakes_are_one_line(scene, text):
    with pytest.raises(InputError):
        controls(scene, {}, [text])
