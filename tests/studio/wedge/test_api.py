"""`pdvol.wedge` from a script."""

import pytest

import pdvol
from cli_scenes import FALL, states, write

STEPS = 4


def right(run):
    return run.levels[-1].positions(run.info["steps"])[:, 0].mean()


@pytest.fixture(scope="module")
def scene():
    names = {}
    exec(FALL.split("if __name__")[0], names)  # as a cell of a notebook does
    return names["scene"]


@pytest.fixture(scope="module")
def made(scene):
    return pdvol.wedge(
        scene, {"velocity": [(0.3, 0.0), (0.6, 0.0)], "height": (0.02, -1.0)}, scores=[right], steps=STEPS
    )


def test_a_function_s_variations_are_rows_and_failures_have_reasons(made, tmp_path):
    rows = made.table
    assert [row["state"].partition(":")[0] for row in rows] == ["done", "done", "failed", "failed"]
    assert rows[0]["right"] > rows[1]["right"] and "floor" in rows[2]["state"]
    assert rows[0]["velocity"] == "(0.6,0.0)" and rows[0]["height"] == "0.02" and rows[0]["cluster"] == "group A"
    run = made.pick(rows[0]["number"], tmp_path / "picked", to=1)
    assert [level.steps for level in run.levels] == [STEPS + 1] * 2
    assert states(run.path, 0) == states(made.run(rows[0]["number"]).path, 0)
    page = made._repr_html_()
    assert page.count("<img") == 2 and page.count("<tr>") == 5 and "floor" in page, "a picture for each run"
    assert len(made.sheet().convert("RGB").getcolors(1 << 20)) > 20
    with pytest.raises(pdvol.InputError, match="failed"):
        made.run(rows[3]["number"])
    with pytest.raises(pdvol.InputError, match="no variation 9"):
        made.run(9)


def test_a_file_s_variations_are_those_of_the_function(made, tmp_path):
    file = write(tmp_path / "fall.py", FALL)
    other = pdvol.wedge(
        file, {"velocity": [(0.3, 0.0), (0.6, 0.0)], "height": [0.02]}, tmp_path / "w", [right], steps=STEPS, jobs=1
    )
    assert [row["right"] for row in other.table] == [row["right"] for row in made.table[:2]]
    assert (tmp_path / "w" / "wedge.json").exists()
    assert len(other.pick(0, tmp_path / "picked", to=1).levels) == 2


def test_mistakes_are_named(scene):
    with pytest.raises(pdvol.InputError, match="no values"):
        pdvol.wedge(scene, {"height": []})
    with pytest.raises(pdvol.InputError, match="say what differs"):
        pdvol.wedge(scene)
    with pytest.raises(pdvol.InputError, match="there is no scene file"):
        pdvol.wedge("nowhere.py", {"height": [1.0]})
    with pytest.raises(pdvol.InputError, match="^scene: there is no body 'squid'; there are square"):  # before it runs
        pdvol.wedge(scene, {"height": [1.0]}, scores=['upright("squid")'])
