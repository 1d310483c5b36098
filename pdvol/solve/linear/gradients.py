"""The compiled conjugate gradients (native/gradients.c), with an incomplete factor and a coarse space where wanted."""

from collections.abc import Callable, Sequence

from mpi4py import MPI

from pdvol.solve.linear.coarse_space import CoarseSpace
from pdvol.solve.linear.system_matrix import SystemMatrix

# size of a block, over the mean of those on the diagonal beside it, below which the incomplete factor of smoothed
# elements leaves it out: they have 2.5 times the blocks of linear ones, and a factor takes 10 times as long; without
# weak blocks half of them are left, a factor takes a fifth of the time, and a solve 7 iterations instead of 6.
WEAK = 0.03


class ConjugateGradients:
    """Solves with the last matrix. Factors and coarse operators are made when a solve needs them.

    Parameters
    ----------
    coarse : called when a coarse space is needed for the first time; gives them from the cheapest to the best
    dense : whether rows have so many blocks that the incomplete factor leaves out weak ones

    Attributes
    ----------
    system : SystemMatrix
        The last matrix.
    space : index of the coarse space in use
    is_current : whether the coarse operator serves for the next solve
    """

    def __init__(self, coarse: Callable[[], Sequence[CoarseSpace]], dense: bool):
        self._make_spaces, self._drop = coarse, WEAK if dense else 0.0
        self._spaces: Sequence[CoarseSpace] = ()
        self.space, self.is_current = 0, False
        self.system: SystemMatrix
        self._is_factored, self._is_definite = False, True
        self._fresh_iterations: int | None = None
        self._excess = 0

    @property
    def has_better(self) -> bool:
        """Whether there is a better coarse space than the one in use."""
        return self.space + 1 < len(self._spaces)

    def set_matrix(self, system: SystemMatrix) -> None:
        """After an assembly of `system`: the next solves are with it."""
        self.system, self._is_factored = system, False

    def prepare(self, with_coarse: bool) -> bool:
        """Factors a new matrix, and renews an outdated coarse operator if there is to be one. Returns whether the
        matrix may be positive definite: all diagonal blocks are. Collective.
        """
        system = self.system
        if not self._is_factored:
            tries = system.factor_incompletely(self._drop)
            if tries == 0:
                raise MemoryError("no memory left for the incomplete factor")
            self._is_definite, self._is_factored = system.space.reduce(tries > 0, MPI.LAND), True
        coarse = self._coarse_space() if with_coarse else None
        system.compiled.nodes = coarse.size if coarse is not None else 0
        if coarse is not None and coarse.size:
            if not self.is_current:
                self._is_definite = coarse.update(system.rows) and self._is_definite
                self.is_current, self._fresh_iterations = self._is_definite, None
            coarse.give(system.compiled)
        return self._is_definite

    def _coarse_space(self) -> CoarseSpace:
        self._spaces = self._spaces or self._make_spaces()
        return self._spaces[min(self.space, len(self._spaces) - 1)]

    def lost(self, iterations: int) -> int:
        """After a successful solve with a coarse space: how many iterations it has cost so far to keep its operator."""
        if self._fresh_iterations is None:
            self._fresh_iterations, self._excess = iterations, 0
        self._excess += iterations - self._fresh_iterations
        return self._excess
