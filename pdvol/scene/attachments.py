"""Springs that attach bodies to each other, until they break."""

from dataclasses import dataclass
from functools import partial

from pdvol.scene.checks import finite, function_or, optional, positive, require, vector
from pdvol.scene.element import Element
from pdvol.scene.loads import Where, everywhere
from pdvol.scene.values import Vector


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
