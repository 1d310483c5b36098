"""The study that switches rules off: each switch reaches the solver, and mistakes are named."""

import pytest

from benchmarks.ablation import __main__ as ablation
from pdvol.integrate.stepper import Stepper
from pdvol.potentials.contact.barrier import ContactBarrier
from pdvol.potentials.contact.friction import LaggedFriction
from pdvol.solve import newton


def test_a_rule_that_is_switched_off_costs_iterations_and_comes_back(monkeypatch):
    monkeypatch.setitem(ablation.SHORTER, "mu_10", 20)
    whole, without = ablation.march("mu_10", "all"), ablation.march("mu_10", "predictions")
    assert without[0] > 1.3 * whole[0]
    assert ablation.cell(without, whole).startswith(f"{without[0] / whole[0]:.2f}, ")
    assert ablation.cell(None, whole) == "failed"


@pytest.mark.parametrize("rule", [rule for rule in ablation.RULES if rule != "all"])
def test_each_switch_changes_what_the_solver_uses(rule):
    parts = (newton, newton.LinearSolver, Stepper, ContactBarrier, LaggedFriction, ablation.solver)
    before = [dict(vars(part)) for part in parts]
    with ablation.RULES[rule]():
        assert [dict(vars(part)) for part in parts] != before
    assert [dict(vars(part)) for part in parts] == before


def test_unknown_rules_and_rows_are_named(capsys):
    assert ablation.main(["lengthening,hope"]) == 2 and "hope" in capsys.readouterr().err
    assert ablation.main(["--rows", "nowhere"]) == 2 and "nowhere" in capsys.readouterr().err
