"""The order of a study's runs, on made-up costs."""

from pdvol.scene import Relative
from pdvol.studio.study.axes import Axis
from pdvol.studio.study.plan import REFERENCE, REFERENCE_SHARE, START_UP, Plan
from pdvol.studio.wedge.variation import Variation

VALUES = {"dt": 0.01, "tolerance": Relative(1e-3)}


def plan(seconds=1000.0, **more):
    axes = [Axis("dt", 0.01, (0.02, 0.005)), Axis("tolerance", VALUES["tolerance"], (Relative(1e-2), Relative(1e-4)))]
    return Plan(axes, True, "progressive", VALUES, seconds, 0.001, **more)


def finish(plan, variation, costs):
    plan.done[variation] = len(costs) - 1
    plan.costs[variation] = list(costs)


def test_level_0_comes_first_and_everything_else_after_the_scene_s_own_settings():
    made = plan()
    assert [entry.last for entry in made.missing()] == [0, 0, 0, 0]
    finish(made, made.base, [1.0])
    made.last = 2
    assert made.missing()[0].variation == made.base and made.missing()[0].last == 2
    assert made.chosen_reference() is None
    finish(made, made.base, [1.0, 3.0, 9.0])
    wanted = [entry for entry in made.missing() if entry.last == 2]
    ladder = [entry.variation for entry in wanted if entry.purpose == REFERENCE]
    steps = [dict(variation.changes).get("dt", 0.01) for variation in ladder]
    assert len(steps) > 1 and all(a == 2 * b for a, b in zip(steps, steps[1:], strict=False))
    assert all(dict(variation.changes)["tolerance"] == Relative(1e-4) for variation in ladder)
    assert [entry.variation for entry in wanted[: len(ladder)]] == ladder
    assert Variation(method="direct") in [entry.variation for entry in wanted]
    assert len({entry.variation for entry in wanted}) == len(wanted)


def test_the_finest_reference_is_what_the_budget_allows_and_then_stays():
    for seconds in (20.0, 100.0, 300.0, 3000.0):
        made = plan(seconds)
        finish(made, made.base, [10.0])
        made.last = 0
        finest = made.ladder()[-1]
        if "dt" in dict(finest.changes):
            assert made.seconds_of(finest, 0) <= REFERENCE_SHARE * seconds
        finish(made, Variation.of({"dt": 0.005}), [1000.0])
        assert made.ladder()[-1] == finest, "a cost that turns out otherwise changes nothing"
    assert dict(finest.changes)["dt"] == 0.01 / 8
    small = plan(20.0)
    finish(small, small.base, [10.0])
    before = small.seconds_of(small.base, 0)
    small.observe(4.0 * (START_UP + 10.0), 10.0)
    assert small.seconds_of(small.base, 0) == 4.0 * (START_UP + 10.0) > 3.0 * before, "a busy machine"
    small.last = 0
    assert [dict(variation.changes) for variation in small.ladder()] == [{"tolerance": Relative(1e-4)}]


def test_the_reference_is_the_finest_that_was_finished():
    made = plan()
    finish(made, made.base, [1.0])
    made.last = 0
    ladder = made.ladder()
    assert made.chosen_reference() is None and not made.settled
    for variation in ladder[:-1]:
        finish(made, variation, [1.0])
    assert made.chosen_reference() == ladder[-2] and made.second_reference() == ladder[-3] and not made.settled
    made.closed[ladder[-1]] = "it failed"
    assert made.chosen_reference() == ladder[-2] and made.settled
    asked = Variation.of({"dt": 0.001, "dhat": 1e-4})
    made = plan(reference=asked)
    finish(made, made.base, [1.0])
    made.last = 0
    assert made.ladder() == [Variation.of({"dt": 0.002, "dhat": 1e-4}), asked], "with twice its time step"


def test_combinations_are_asked_for_until_none_promises_anything():
    made = plan()
    made.last = 0
    truth = {"dt": {0.02: 0.5, 0.005: 2.0}, "tolerance": {Relative(1e-2): 0.7, Relative(1e-4): 1.4}}
    share = {0.02: 0.2, 0.01: 0.1, 0.005: 0.05, Relative(1e-2): 0.01, Relative(1e-3): 1e-3, Relative(1e-4): 1e-4}

    def measured(variation):
        if variation not in made.done:
            return None
        changes = {**VALUES, **dict(variation.changes)}
        cost = 10.0
        for name, value in variation.changes:
            cost *= truth[name][value]
        return cost, sum(share[value] ** 2 for value in changes.values()) ** 0.5

    for variation in (made.base, *(v for v in made.singles if v.method == "progressive")):
        finish(made, variation, [1.0])
    tried = 0
    while made.combine(measured):
        entry = next(entry for entry in made.missing() if entry.purpose == "a combination")
        assert len(entry.variation.changes) == 2
        finish(made, entry.variation, [1.0])
        tried += 1
    assert 0 < tried <= 4
    assert Variation.of({"dt": 0.02, "tolerance": Relative(1e-2)}) in made.done
