"""Interpolants: functions (coarse, fine, binding) -> scalar weights (n_fine, n_coarse) in input order, which
reproduce affine fields.

Collective, with the same result on every rank. `binding` binds the fine points to coarse cells. A new one is a file
here, or in another package, and a line in `pdvol.registry`, or an entry point.
"""

from collections.abc import Callable

import scipy.sparse as sp

from pdvol.levels.binding import Binding
from pdvol.levels.space import LevelSpace

Interpolant = Callable[[LevelSpace, LevelSpace, Binding], sp.csr_matrix]
