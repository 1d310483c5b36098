"""The shared derivative check, second-order Taylor remainders of value and gradient, and states to make it at."""

import numpy as np
from scipy.sparse import bsr_array, csr_array

from pdvol.potentials.assembly.hessian_blocks import BlockPattern, HessianBlocks
from pdvol.potentials.potential import Positions

STEPS = np.geomspace(1.0, 1.0 / 64.0, 7)  # times the length the caller gives
ORDER = 1.9  # a wrong first derivative gives slope 1, a right one 2 (or 3 where the next term vanishes)
ROUNDING = 1e-12  # of the sizes that are subtracted: smaller remainders are indistinguishable from round-off


def slope(steps, remainders) -> float:
    """Fitted order of the remainders."""
    return np.polyfit(np.log(steps), np.log(remainders), 1)[0]


def _second_order(steps, remainders, floor, exact, what):
    if exact:
        assert np.max(remainders) <= floor, f"{what}: remainder {np.max(remainders):.2e} of what should be exact"
        return
    assert np.min(remainders) > 10.0 * floor, f"{what}: the remainders {remainders} are round-off, take larger steps"
    fitted = slope(steps, remainders)
    assert fitted > ORDER, f"{what}: slope {fitted:.3f}, remainders {remainders}"


def check_derivatives(
    value, gradient, hessian, x: np.ndarray, length: float, seed: int = 0, linear: bool = False, quadratic: bool = False
):
    """Taylor slopes of value(x), gradient(x) (n, d) and hessian(x) (sparse or dense; None leaves it out) at x (n, d).

    `linear` and `quadratic` energies have no remainder where others have one.
    """
    direction = np.random.default_rng(seed).uniform(-1.0, 1.0, x.shape)
    steps = STEPS * length
    energy, slopes = value(x), gradient(x)
    assert np.isfinite(energy)
    assert np.abs(slopes).max() > 0.0, "the term is not active"
    moved = [value(x + h * direction) for h in steps]
    remainders = np.array([abs(e - energy - h * np.vdot(slopes, direction)) for e, h in zip(moved, steps, strict=True)])
    _second_order(
        steps,
        remainders,
        ROUNDING * max(np.abs(moved).max(), abs(energy), steps[0] * np.abs(slopes).max()),
        linear,
        "gradient",
    )
    if hessian is None:
        return
    rows = csr_array(hessian(x))
    assert linear or abs(rows).max() > 0.0, "the term has no Hessian here"
    asymmetry = abs(rows - rows.T)
    assert linear or asymmetry.max() <= 1e-12 * abs(rows).max()
    moved = [gradient(x + h * direction) for h in steps]
    change = (rows @ direction.ravel()).reshape(x.shape)
    remainders = np.array([np.linalg.norm(g - slopes - h * change) for g, h in zip(moved, steps, strict=True)])
    _second_order(
        steps,
        remainders,
        ROUNDING * np.linalg.norm(np.abs(slopes).max() + steps[0] * np.abs(change).max()),
        linear or quadratic,
        "Hessian",
    )


def check_term(term, space, x: np.ndarray, length: float, hessian="own", **options):
    """`check_derivatives` of a term of the incremental potential; `hessian` replaces its own, or leaves it out when
    None.
    """
    at = lambda call: lambda owned: call(Positions(space, owned))
    second = (
        (lambda owned: hessian_of(term, space, owned, "none")) if isinstance(hessian, str) else hessian and at(hessian)
    )
    check_derivatives(at(term.value), at(term.gradient), second, x, length, **options)


def hessian_of(term, space, x: np.ndarray, projection: str = "clamp") -> csr_array:
    """A term's whole Hessian (n d, n d) at owned positions x, of a level on one rank."""
    blocks = HessianBlocks(BlockPattern(space, term.stencils), projection)
    term.add_hessian(Positions(space, x), 1.0, blocks)
    return whole_matrix(blocks)


def whole_matrix(blocks: HessianBlocks) -> csr_array:
    """The whole symmetric matrix (n d, n d), in PETSc's numbering, of a level on one rank."""
    d, n = blocks.pattern.space.dim, len(blocks.pattern.space.mesh.points)
    starts, columns, values = blocks.merged()
    whole = lambda starts, columns, values: csr_array(
        bsr_array((values, columns, starts), shape=(n * d, n * d)).tocsr()
    )
    upper = whole(starts, columns, values)
    across = whole(np.arange(n + 1), np.arange(n), values[starts[:-1]])
    return csr_array(upper + upper.T - across)


def state(space, strain=0.15, seed=1, stretch=1.0):
    """Owned positions: a random affine map and a random displacement, no cell inverted."""
    rng = np.random.default_rng(seed)
    X = space.from_input(space.mesh.points)
    d = space.dim
    F = stretch * np.eye(d) + strain * rng.uniform(-1, 1, (d, d))
    return X @ F.T + 0.1 * strain * rng.uniform(-1, 1, X.shape)


def smallest_eigenvalue(H):
    return np.linalg.eigvalsh(0.5 * (H + H.T))[0]
