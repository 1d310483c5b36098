"""Two levels of the slit array (paper, figure "TRACKS"): an independent fine simulation that springs pull towards the
coarse one.

Which follows the preview better: springs, whose strength must be chosen, or the coarse velocity?
`./run python -m benchmarks.methods tracks` compares them.

    pdvol run demos/tracks.py --method tracks --set weight=0.01
"""

import pdvol
import slit_array


def scene(young=1e5, steps=150, dt=0.01, height=0.3, angle=0.1, mu=0.3, vertices=(100, 770)):
    """The block of `slit_array.py` in two levels, `height` m above the ground and turned by `angle` rad."""
    return slit_array.scene(young, steps, dt, height, angle, mu, vertices)


if __name__ == "__main__":
    pdvol.main(scene)
