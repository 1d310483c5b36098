"""The settings of the solver, and of the penalty that holds levels together."""

from dataclasses import dataclass
from functools import partial

from pdvol.scene.checks import choice, count, finite, positive, text
from pdvol.scene.element import Element
from pdvol.scene.values import Length, Relative, length


@dataclass(frozen=True, repr=False)
class Solver(Element):
    """How each incremental potential is minimised.

    Attributes
    ----------
    tolerance : speed [m/s]: Newton stops when its full step is nowhere faster
    relative_tolerance : Newton also stops when its full step is slower than this fraction of the largest change of
        velocity that its present state x makes, `|x - x_hat| / dt`. The time step's own error grows with that change
    max_iterations : Newton iterations allowed per solve; what it has not solved by then is halved, from its start on
    max_halvings : how often a step may be halved before the run stops
    linear : "auto", or "iterative", "multilevel" or "direct"
    linear_rtol : relative error of an iterative linear solve, in the energy norm
    petsc : extra PETSc options, for example "-ksp_rtol 1e-6"; with a `-ksp_type` or `-pc_type` among them PETSc's own
        solvers replace the compiled ones
    """

    tolerance: Length = Relative(1e-3)
    relative_tolerance: float = 0.0
    max_iterations: int = 400
    max_halvings: int = 6
    linear: str = "auto"
    linear_rtol: float = 3e-3
    petsc: str = ""

    checks = {
        "tolerance": length,
        "relative_tolerance": partial(finite, lowest=0.0, highest=0.1),
        "max_iterations": partial(count, lowest=1),
        "max_halvings": partial(count, lowest=0, highest=20),
        "linear": choice("auto", "iterative", "multilevel", "direct"),
        "linear_rtol": partial(positive, highest=0.1),
        "petsc": text,
    }


@dataclass(frozen=True, repr=False)
class Penalty(Element):
    """Weights w of w |x - P x_c|^2_M, x_c the coarser level's positions at the end of the step (docs/methods.md;
    paper 3.2.3).

    It stands beside the inertia's 1/2 |x - x_hat|^2_M, so w has no unit: w = 0.025 is a twentieth of the inertia. A
    march that is not named below has no such term.

    Attributes
    ----------
    consistency : of the progressive march
    weight : of tracks
    """

    consistency: float = 0.0
    weight: float = 0.0

    checks = dict.fromkeys(("consistency", "weight"), partial(finite, lowest=0.0))

    def of(self, method: str) -> float:
        """The weight that a method's levels are held with."""
        return next((getattr(self, name) for name, user in WEIGHTS.items() if user == method), 0.0)


WEIGHTS = {"consistency": "progressive", "weight": "tracks"}
"""The march that uses each weight."""
