"""Interpolants: functions (coarse, fine, binding) -> scalar weights (n_fine, n_coarse) in input order, rows summing to
one.

Collective, with the same result on every rank. `binding` binds the fine points to coarse cells.
"""

from collections.abc import Callable

import scipy.sparse as sp

from pdvol.levels.binding import Binding
from pdvol.levels.interpolants.barycentric import barycentric
from pdvol.levels.interpolants.biharmonic import biharmonic
from pdvol.levels.interpolants.phong import phong
from pdvol.levels.space import LevelSpace

Interpolant = Callable[[LevelSpace, LevelSpace, Binding], sp.csr_matrix]

INTERPOLANTS: dict[str, Interpolant] = {"barycentric": barycentric, "biharmonic": biharmonic, "phong": phong}
