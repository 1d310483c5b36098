"""A soft cantilever in 2D whose weight grows: smooth, without contact, for the orders that a study fits.

It tapers from the wall, where its corners have 60 degrees: at a wall the stress is singular in corners of 90 degrees,
and errors would fall more slowly there than with the square of the mesh size.
"""

import numpy as np

import pdvol
from pdvol import Body, Gravity, NeoHookean, Scene, Solid, Support

LENGTH, ROOT, TIP = 1.0, 1.5, 0.345  # m; heights at the wall and at the free end
RAMP = 0.32  # s


def bar(cuts: int) -> Solid:
    """`cuts` x `cuts` cells, each of two triangles, in a pattern without a bias."""
    count = cuts + 1
    x, share = np.meshgrid(np.linspace(0.0, LENGTH, count), np.linspace(-0.5, 0.5, count), indexing="ij")
    y = share * (ROOT + (TIP - ROOT) * x / LENGTH)
    i, j = np.meshgrid(np.arange(cuts), np.arange(cuts), indexing="ij")
    a = (i * count + j).ravel()
    b, c, d = a + count, a + count + 1, a + 1
    even = ((i + j) % 2 == 0).ravel()[:, None]
    one = np.where(even, np.column_stack([a, b, c]), np.column_stack([a, b, d]))
    other = np.where(even, np.column_stack([a, c, d]), np.column_stack([b, c, d]))
    cells = np.vstack([one, other]).astype(np.int32)
    return Solid(np.column_stack([x.ravel(), y.ravel()]), cells, np.zeros(len(cells), np.int32))


def weight(time: float) -> tuple[float, float]:
    """[m/s^2] at a time [s]: it grows smoothly, since a load that begins suddenly excites all frequencies."""
    return (0.0, -float(np.sin(0.5 * np.pi * min(time / RAMP, 1.0)) ** 4))


def scene(cuts=(6, 12, 24, 48, 96), young=2e4, steps=32, dt=0.01):
    """`cuts` has the cells along a side on each level."""
    return Scene(
        bodies=(Body(tuple(bar(n) for n in cuts), NeoHookean(young, 0.0, 1000.0), name="bar"),),
        supports=(Support(lambda points: points[:, 0] < 1e-9),),
        loads=(Gravity(weight),),
        dt=dt,
        steps=steps,
    )


if __name__ == "__main__":
    pdvol.main(scene)
