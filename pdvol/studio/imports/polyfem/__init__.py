"""Scenes in PolyFEM's JSON, for the subset that pdvol has: docs/polyfem.md."""

from pdvol.studio.imports.polyfem.scene import polyfem_scene

__all__ = ["polyfem_scene"]
