"""The failure ladder (design, section 6): what is tried, in this order, where a solve does not go on, and how often
each rung was taken.

| rung | what | after |
|---|---|---|
| clamp | the Hessian filtered again, and for longer | an unfiltered one turned out indefinite |
| abs | the strongest filter: eigenvalues by size, contacts without short cuts | a line search found no way down |
| shift | a stronger diagonal for the incomplete factor | it was not positive definite |
| direct | a direct solver | an iterative one failed, or no way down in spite of the strongest filter |
| workspace | more room for the direct solver | it failed |
| held_back | a quarter of the scripted motion, then none of it | it met contact, and what it left could not be solved |
| halvings | half the step | all of these, or too many iterations |
| last_resort | the smallest step once more, with the strongest filter and the direct solver | halving no further |

After the last one comes `ConvergenceError`, which names level, step and reason; finished steps are kept. What is not a
number ends the run at once: no rung mends it. `substeps` counts the parts into which a scripted motion was cut because
contact stood in its way.
"""

RUNGS = ("clamp", "abs", "shift", "direct", "workspace", "held_back", "halvings", "last_resort", "substeps")


def no_rungs() -> dict[str, int]:
    """A count of zero for each rung."""
    return dict.fromkeys(RUNGS, 0)


def told(rungs: dict[str, int]) -> str:
    """The rungs taken, in words for a message; empty where none was."""
    return ", ".join(f"{name} {count}" for name, count in rungs.items() if count)
