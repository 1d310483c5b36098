"""The bar of `twist.py`, turned on until it bends into a coil and touches itself (paper, section "Twisting behaviour").

    pdvol run demos/coil.py --levels 0:1

It has the four levels of `twist.py`; `--levels 0:1` is a quick look.
"""

import pdvol
import twist
from pdvol.measure.verify import check_levels

NOT_RELEASED = 1e3  # s: both ends are turned to the last step


def scene(cuts=twist.CUTS, speed=600.0, young=2e5, poisson=0.4, steps=66, dt=0.01):
    """The ends turn at `speed` deg/s in opposite directions up to the last step."""
    return twist.scene(cuts, speed, NOT_RELEASED, young, poisson, steps, dt)


def claim(run):
    """The bar touches itself on all levels, nothing crosses, and its levels coil alike."""
    crossings = sum(found.crossings for found in check_levels(run.path))
    contacts = [[record["contacts"] for record in level.log] for level in run.levels]
    begins = [next((step for step, n in enumerate(counts, 1) if n), len(counts)) * run.dt for counts in contacts]
    first, most = ", ".join(f"{time:.2f}" for time in begins), ", ".join(f"{max(counts):,}" for counts in contacts)
    sentence = (
        f"The levels touch themselves from {first} s on, in up to {most} contacts, with {crossings} intersections."
    )
    return [(sentence, all(map(any, contacts)) and not crossings), *twist.claim(run)]


if __name__ == "__main__":
    pdvol.main(scene)
