"""What a study recommends, from made-up points: only with the reference's outcome, and no gain of chance."""

from pdvol.studio.study.conclusions import sentences


def point(name, cost, error, outcome=True, level=1):
    return {
        "words": ["--levels", f"0:{level}", "--set", f"dt={name}"],
        "changes": {"feedback": name},
        "method": "progressive",
        "level": level,
        "cost": {"cpu": cost},
        "errors": {"end": error, "outcome": outcome},
    }


def said(points, spread=None, not_run=()):
    reference = {"error": 1e-4, "parts": {"dt": 1e-4}, "mesh": None, "level": 1, "changes": {}, "method": "direct"}
    found = {
        "reference": reference,
        "spread": None if spread is None else {"jitter": 1e-3, "end": spread, "chaotic": True},
        "default": points[0],
        "levels_not_run": list(not_run),
    }
    return sentences(points, found, 1.0)


def test_what_is_better_is_recommended_with_the_same_outcome_and_by_more_than_the_spread():
    """Errors below it are the same: the cheapest of them is taken for less time, and none for a smaller error."""
    recommended = lambda points, **more: [line for line in said(points, **more) if "`--set" in line]
    scene, fine = point("scene", 10.0, 0.2), point("fine", 30.0, 0.04)
    half, finer = recommended([scene, point("half", 4.0, 0.25), fine])
    assert half.startswith("In half the time") and "dt=half" in half
    assert finer.startswith("Less than half the error") and "dt=fine" in finer and "3 times" in finer
    assert recommended([scene, point("half", 4.0, 0.01, outcome=False), point("fine", 30.0, 0.01, False)]) == []
    (line,) = recommended([scene, point("cheap", 1.0, 0.29), point("half", 4.0, 0.25), fine], spread=0.3)
    assert line.startswith("In half the time") and "dt=cheap" in line


def test_levels_that_were_not_run_come_first():
    points = [point("scene", 10.0, 0.2)]
    assert said(points)[0].startswith("The scene's settings on level 1 end 20 cm")
    assert said(points, not_run=[2])[0] == "Level 2 was not run: what follows holds for levels 0 to 1 alone."
    assert said(points, not_run=[1, 2])[0] == "Levels 1 to 2 were not run: what follows holds for level 0 alone."
