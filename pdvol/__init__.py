"""pdvol: progressing level-of-detail animation of volumetric elastodynamics, with contact that never interpenetrates.

Names load what they need when they are first used: describing a scene imports no solver, reading a run imports no
finite elements.
"""

import os
from importlib import import_module
from typing import Any

from pdvol.errors import (
    ConvergenceError,
    InputError,
    IntersectionError,
    InvertedCellError,
    MeshError,
    PdvolError,
    SimulationError,
)

# Sparse fronts and small blocks: threads of the BLAS cost more than they give, and ranks would fight over the cores.
os.environ.setdefault("OMP_NUM_THREADS", "1")

__version__ = "0.2.0"

_HOMES = {
    "pdvol.scene": (
        "Attachment",
        "Barrier",
        "Body",
        "Deforming",
        "FixedCorotational",
        "Flow",
        "Force",
        "Friction",
        "Gravity",
        "Impulse",
        "Keyed",
        "Material",
        "Muscle",
        "NeoHookean",
        "Path",
        "Penalty",
        "Placement",
        "Plane",
        "PointCache",
        "PointForce",
        "Posed",
        "Pressure",
        "Region",
        "Relative",
        "RenderMesh",
        "Rigid",
        "Rotation",
        "Scene",
        "Separate",
        "Sequential",
        "Solver",
        "StVenantKirchhoff",
        "Still",
        "Support",
        "TakeOver",
        "Translation",
    ),
    "pdvol.meshes": ("Outline", "RenderSurface", "Solid", "Surface"),
    "pdvol.meshing.point_caches": ("cached_surface",),
    "pdvol.store.reader": ("open_run",),
    "pdvol.runs.api": ("run",),
    "pdvol.explore.wedge.api": ("wedge",),
    "pdvol.draw.image": ("picture",),
    "pdvol.runs.own_energy": ("Contact",),
    "pdvol.cli": ("main",),
}
_PACKAGES = ("meshes", "forms")
"""Public as packages: shape recipes and energies in UFL."""
_HOME = {name: module for module, names in _HOMES.items() for name in names}

__all__ = sorted(
    [
        *_HOME,
        *_PACKAGES,
        "ConvergenceError",
        "InputError",
        "IntersectionError",
        "InvertedCellError",
        "MeshError",
        "PdvolError",
        "SimulationError",
    ]
)


def __getattr__(name: str) -> Any:
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    if name in _PACKAGES:
        return import_module(f"pdvol.{name}")
    raise AttributeError(f"module 'pdvol' has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*__all__, "__version__", "__doc__", "__file__", "__name__", "__path__"]
