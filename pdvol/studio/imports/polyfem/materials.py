"""Materials of a PolyFEM scene."""

from pdvol.errors import InputError
from pdvol.scene import FixedCorotational, Material, NeoHookean, StVenantKirchhoff
from pdvol.studio.imports.polyfem.document import Section

LAWS_OF = {"NeoHookean": NeoHookean, "FixedCorotational": FixedCorotational, "SaintVenant": StVenantKirchhoff}


def read_materials(root: Section, dim: int) -> dict[int | None, Material]:
    """Materials by volume number; by None where one holds for all."""
    found: dict[int | None, Material] = {}
    entries = root.sections("materials")
    for entry in entries:
        kind = entry.get("type")
        if kind not in LAWS_OF:
            entry.refuse("type", f"pdvol has {', '.join(LAWS_OF)}")
            continue
        listed = entry.get("id", 0)
        ids = listed if isinstance(listed, list) else [listed]
        if any(isinstance(n, bool) or not isinstance(n, int) for n in ids):
            entry.refuse("id", "whole numbers are expected here")
            ids = []
        try:
            material = _material(entry, LAWS_OF[kind], dim)
        except (InputError, ZeroDivisionError) as error:
            entry.refuse("type", f"its parameters are not those of a stable solid ({error})")
            continue
        found.update(dict.fromkeys(ids, material))
        if len(entries) == 1:
            found[None] = material
    return found


def _material(entry: Section, law: type[Material], dim: int) -> Material:
    """One material; raises InputError or ZeroDivisionError where its parameters are none of a stable solid."""
    for key in ("phi", "psi"):
        entry.only(key, (0,), "pdvol's damping is of another kind")
    density = entry.number("rho", 1.0)
    if {"lambda", "mu"} <= set(entry.values):
        first, shear = entry.number("lambda", 0.0), entry.number("mu", 1.0)
    else:
        young, poisson = entry.number("E", 1.0), entry.number("nu", 0.0)
        shear = young / (2.0 * (1.0 + poisson))
        # PolyFEM takes E and nu of a 2D scene as those of a thin sheet
        across = 1.0 - 2.0 * poisson if dim == 3 else 1.0 - poisson
        first = young * poisson / ((1.0 + poisson) * across)
    entry.close()
    return law(shear * (3.0 * first + 2.0 * shear) / (first + shear), first / (2.0 * (first + shear)), density)
