"""How the levels of a hierarchy are bound to each other: as lines of text, and as pictures."""

from collections.abc import Sequence
from pathlib import Path

from pdvol.errors import InputError
from pdvol.levels.hierarchy import Hierarchy


def binding_lines(hierarchy: Hierarchy) -> list[str]:
    """One line for each level but the coarsest: how its vertices are bound to the level below, and the size of the
    weights. Collective.
    """
    return [_binding_line(hierarchy, level) for level in range(1, len(hierarchy))]


def _binding_line(hierarchy: Hierarchy, level: int) -> str:
    r = hierarchy.prolongation(level).report()
    return (
        f"levels {level - 1} -> {level}: {r['inside']:,} bound inside, {r['ray']:,} by ray, {r['neighbour']:,} by"
        f" neighbour, {r['orphans']:,} orphans; {r['weights_per_point']:.3g} weights a vertex, largest |weight|"
        f" {r['largest_weight']:.3g}, ||P||_F {r['frobenius_norm']:.4g} (sqrt m = {r['sqrt_points']:.4g}), ||P||_2"
        f" {r['two_norm']:.3g}"
    )


def draw_bindings(hierarchy: Hierarchy, out: Path, up: Sequence[float] = (0.0, 1.0, 0.0)) -> None:
    """Draw `out/binding_<level>.png` for each level but the coarsest; `up` is the way up of a 3D scene.

    Raises
    ------
    InputError
        The folder `out` cannot be made.
    """
    from pdvol.studio.draw.bindings import draw_binding  # loads the plotting library, which only pictures need

    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{out} cannot be written: {error.strerror}") from None
    for level in range(1, len(hierarchy)):
        p = hierarchy.prolongation(level)
        title = f"levels {level - 1} -> {level}, {hierarchy.interpolant}"
        draw_binding(out / f"binding_{level}.png", p.coarse.mesh, p.fine.mesh, p.binding.cells, p.weights, title, up)
