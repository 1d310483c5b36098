"""Springs that attach bodies to each other, until they break, and that pull bodies to points that move."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from pdvol.scene.checks import ascending, finite, function_or, optional, positive, require, sequence, vector
from pdvol.scene.element import Element
from pdvol.scene.loads import Where, everywhere
from pdvol.scene.values import Vector, as_many, interpolated


@dataclass(frozen=True, repr=False)
class Attachment(Element):
    """Springs between two bodies: from places spread over a part of the first one's surface to the nearest places of
    the other's.

    The springs are chosen on the coarsest level, one for each boundary facet of the part, and lead between the same
    material points on every level. Stiffness and strength are divided between them by area, so neither depends on the
    mesh. A spring breaks for good at the end of the step in which it pulls with more than its part of `breaking`.

    Attributes
    ----------
    body, other : names of two bodies
    where : the part of `body`: a function of rest positions (n, d), as placed, that gives a mask (n,), evaluated at the
        centres of boundary facets; or one rest position
    to : the part of `other`, likewise
    stiffness : of all springs together [N/m] ([N/m] per metre of depth in 2D)
    rest_length : [m] of each spring; its length at t = 0 where left out, so that nothing pulls at first
    breaking : force [N] that all springs together bear; None where they never break
    """

    body: str
    other: str
    where: Where | Vector
    to: Where | Vector = everywhere
    stiffness: float = 1e4
    rest_length: float | None = None
    breaking: float | None = None

    checks = {
        "where": function_or(vector, "X"),
        "to": function_or(vector, "X"),
        "stiffness": positive,
        "rest_length": optional(partial(finite, lowest=0.0)),
        "breaking": optional(positive),
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        require(self.body != self.other, f"an Attachment leads from body {self.body!r} to itself; name two bodies")


@dataclass(frozen=True, repr=False)
class Pull(Element):
    """A spring without length, with a damper, from a patch of a body's surface to a point that moves by keyframes.

    It acts on the mean of the patch, in the steps that lie within its times. Its force grows with the distance, up to a
    bound: by the patch's stiffness, but at least twice and at most 20 times the body's weight.

    Attributes
    ----------
    body : name
    where : (d,) rest position [m], as placed, around which the patch is
    times : (k,) ascending [s]
    points : (k, d) [m] one per time; straight and even in between
    stiffness : [N/m] ([N/m] per metre of depth in 2D); so much for the body's mass, where left out, that the patch
        comes to the point within about 0.2 s
    radius : of the patch [m]; a part of the body's size where left out
    """

    body: str
    where: Vector
    times: Vector
    points: Sequence[Vector] | np.ndarray
    stiffness: float | None = None
    radius: float | None = None

    checks = {
        "where": vector,
        "times": ascending,
        "points": sequence,
        "stiffness": optional(positive),
        "radius": optional(positive),
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        as_many(self, "times", "points")
        for point in self.points:
            vector("Pull.points", point)
        sizes = {len(point) for point in (self.where, *self.points)}
        require(len(sizes) == 1, "Pull.where and Pull.points must all have two or all three components")

    def at(self, time: float) -> np.ndarray:
        """(d,) [m]: where the point is at a time [s]; at a key's to the last bit."""
        return interpolated(time, self.times, self.points)

    def acts(self, t0: float, t1: float) -> bool:
        """Whether it acts in a step, or a part of one, from t0 to t1 [s]; times are compared to a millionth of it."""
        slack = 1e-6 * (t1 - t0)
        return self.times[0] <= t0 + slack and t1 - slack <= self.times[-1]
