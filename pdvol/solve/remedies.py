"""Remedies (design, section 6) for a solve that fails, in the order in which they are tried. Each step counts how often
each was taken.

| remedy | what | after |
|---|---|---|
| clamp | the Hessian projected again, and for longer | an unprojected one turned out indefinite |
| abs | the strongest projection: eigenvalues by size, full contact Hessians | the line search failed |
| shift | a stronger diagonal for the incomplete factor | it was not positive definite |
| direct | a direct solver | an iterative one failed, or the line search failed with the strongest projection |
| workspace | more room for the direct solver | it failed |
| held_back | a quarter of the scripted motion, then none of it | it met contact, and its end could not be solved |
| halvings | half the step | all of these, or too many iterations |
| last_resort | the smallest step again with the strongest projection and the direct solver | no more halving |

After the last one comes `ConvergenceError`, which names level, step and reason; finished steps are kept. What is not a
number ends the run at once. `substeps` counts the parts into which a scripted motion was cut because contact stood in
its way.
"""

REMEDIES = (
    "clamp",
    "abs",
    "shift",
    "direct",
    "workspace",
    "held_back",
    "halvings",
    "last_resort",
    "substeps",
)


def no_remedies() -> dict[str, int]:
    """A count of zero for each remedy."""
    return dict.fromkeys(REMEDIES, 0)


def taken(remedies: dict[str, int]) -> str:
    """The remedies taken, for a message; empty where none was."""
    return ", ".join(f"{name} {count}" for name, count in remedies.items() if count)
