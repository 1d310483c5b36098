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
    crossings = {found.index: found.crossings for found in check_levels(run.path)}
    found = []
    for level in run.levels:
        touching = [record for record in level.log if record["contacts"]]
        first = touching[0]["step"] * run.dt if touching else None
        most = max(record["contacts"] for record in level.log)
        found.append(
            (
                f"Level {level.index} touches itself from {first:.2f} s on, in up to {most:,} contacts, with"
                f" {crossings[level.index]} intersections."
                if touching
                else f"Level {level.index} touches nothing.",
                bool(touching) and crossings[level.index] == 0,
            )
        )
    return found + twist.claim(run)


if __name__ == "__main__":
    pdvol.main(scene)
