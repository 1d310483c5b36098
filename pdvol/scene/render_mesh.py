"""A surface that is drawn in a body's place and does not take part in the simulation."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pdvol.meshes import RenderSurface, Surface
from pdvol.registry import INTERPOLANTS
from pdvol.scene.checks import require, text
from pdvol.scene.element import Element


@dataclass(frozen=True, eq=False, repr=False)
class RenderMesh(Element):
    """A surface of any resolution that follows a body on each of its levels, in the coordinates of the body's shape.

    It does not change the simulation: a stored run takes another one with `--resume`, without a step computed anew.

    Attributes
    ----------
    shape : path of a surface, of which an OBJ file keeps its polygons and texture coordinates; a `RenderSurface`; a
        `Surface`; or a tuple (vertices, faces) or (vertices, faces, uvs, face_uvs), as `RenderSurface.of` takes them
    texture : path of a picture, or its pixels (h, w, 3) uint8, the top row first; of an OBJ file the picture that its
        materials name where this is empty
    interpolant : a name in `pdvol.registry.INTERPOLANTS`, which carries it along
    material : name of a material; of an OBJ file the faces of this one alone are taken, all where it is empty
    """

    shape: str | Path | RenderSurface | Surface
    texture: str | Path | np.ndarray = ""
    interpolant: str = "phong"
    material: str = ""

    files = ("shape", "texture")
    checks = {"interpolant": lambda _, value: INTERPOLANTS.check(value), "material": text}

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.shape, (tuple, list)):
            require(
                2 <= len(self.shape) <= 4,
                f"RenderMesh.shape has {len(self.shape)} entries; give (vertices, faces) or (vertices, faces, uvs,"
                " face_uvs)",
            )
            try:
                made = RenderSurface.of(*self.shape)
            except (TypeError, ValueError) as error:
                require(False, f"RenderMesh.shape: the arrays are no surface ({' '.join(str(error).split())})")
            object.__setattr__(self, "shape", made)
        require(
            isinstance(self.shape, (str, Path, RenderSurface, Surface)),
            f"RenderMesh.shape must be a path, a RenderSurface, a Surface or a tuple of arrays, not"
            f" {type(self.shape).__name__}",
        )
        if isinstance(self.texture, np.ndarray):
            require(
                self.texture.dtype == np.uint8 and self.texture.ndim == 3 and self.texture.shape[2] == 3,
                f"RenderMesh.texture must hold pixels (h, w, 3) of uint8, not {self.texture.shape} of"
                f" {self.texture.dtype}",
            )
        else:
            require(
                isinstance(self.texture, (str, Path)),
                f"RenderMesh.texture must be a path or an array, not {type(self.texture).__name__}",
            )
