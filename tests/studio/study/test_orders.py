"""The orders that a study fits on a smooth scene, a cantilever whose weight grows."""

import json
from pathlib import Path

import pytest

from cli_scenes import pdvol

SCENE = Path(__file__).resolve().with_name("cantilever.py")


def orders(folder, integrator, levels, vary):
    words = ("--levels", levels, "--vary", vary, "--method", "direct", "--set", f"integrator={integrator}")
    words += ("--set", "tolerance=1e-8", "--budget", 20, "--reference", "dt=0.002")
    assert pdvol("study", SCENE, "-o", folder / "s", *words) == 0
    study = json.loads((folder / "s" / "study.json").read_text())
    return {entry["axis"]: entry["order"] for entry in study["orders"]}


@pytest.mark.slow
@pytest.mark.parametrize(("integrator", "order"), [("implicit_euler", 1.0), ("bdf2", 2.0)])
def test_the_order_in_the_time_step_is_the_integrator_s(tmp_path, integrator, order):
    found = orders(tmp_path, integrator, "0:0", "dt=0.02,0.005,0.0025")
    assert found["dt"] == pytest.approx(order, abs=0.1)


@pytest.mark.slow
def test_the_order_in_the_mesh_size_is_2(tmp_path):
    assert orders(tmp_path, "implicit_euler", "0:4", "dt=0.02")["mesh size"] == pytest.approx(2.0, abs=0.1)
