"""The settings of the solver, and of the penalty that holds levels together."""

from dataclasses import dataclass

from pdvol.scene.checks import count, finite, keep_plain, positive, require
from pdvol.scene.lengths import Length, Relative, length
from pdvol.scene.representation import one_line


@dataclass(frozen=True)
class Solver:
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
    __repr__ = one_line

    def __post_init__(self) -> None:
        keep_plain(self, "tolerance", "relative_tolerance", "max_iterations", "max_halvings", "linear_rtol")
        length("Solver.tolerance", self.tolerance)
        finite("Solver.relative_tolerance", self.relative_tolerance, 0.0)
        fraction = self.relative_tolerance
        require(fraction <= 0.1, f"Solver.relative_tolerance = {fraction!r} must be at most 0.1")
        count("Solver.max_iterations", self.max_iterations, 1)
        count("Solver.max_halvings", self.max_halvings, 0)
        require(self.max_halvings <= 20, f"Solver.max_halvings = {self.max_halvings!r} must be at most 20")
        require(isinstance(self.petsc, str), f'Solver.petsc = {self.petsc!r} must be text, as in "-ksp_rtol 1e-6"')
        require(
            self.linear in ("auto", "iterative", "multilevel", "direct"),
            f"Solver.linear = {self.linear!r} must be auto, iterative, multilevel or direct",
        )
        positive("Solver.linear_rtol", self.linear_rtol)
        require(self.linear_rtol <= 0.1, f"Solver.linear_rtol = {self.linear_rtol!r} must be at most 0.1")


@dataclass(frozen=True)
class Penalty:
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
    __repr__ = one_line

    def __post_init__(self) -> None:
        keep_plain(self, "consistency", "weight")
        finite("Penalty.consistency", self.consistency, 0.0)
        finite("Penalty.weight", self.weight, 0.0)

    def of(self, method: str) -> float:
        """The weight that a method's levels are held with."""
        return next((getattr(self, name) for name, user in WEIGHTS.items() if user == method), 0.0)


WEIGHTS = {"consistency": "progressive", "weight": "tracks"}
"""The march that uses each weight."""
