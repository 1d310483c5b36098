"""Render meshes as pictures show them: smooth, with their textures."""

import numpy as np
import pyvista as pv
from PIL import Image

from pdvol.store.render_meshes import StoredRender


def drawn_mesh(mesh: StoredRender, points: np.ndarray) -> pv.PolyData:
    """Its triangles with vertices at `points` (n, 3) [m], each corner for itself: normals are smooth across seams,
    places in the texture are not.
    """
    smooth = pv.PolyData.from_regular_faces(points, mesh.welded)
    smooth = smooth.compute_normals(cell_normals=False, split_vertices=False, consistent_normals=False)
    corners = mesh.fans.ravel()
    split = pv.PolyData.from_regular_faces(points[mesh.corners[corners]], np.arange(len(corners)).reshape(-1, 3))
    split.point_data["Normals"] = np.asarray(smooth.point_data["Normals"])[mesh.first[mesh.corners[corners]]]
    split.point_data.active_normals_name = "Normals"
    if len(mesh.uvs):
        split.active_texture_coordinates = mesh.uvs[mesh.uv_corners[corners]]
    return split


def texture_of(mesh: StoredRender) -> pv.Texture | None:
    """Its picture; None where it has none."""
    if mesh.texture is None:
        return None
    with Image.open(mesh.texture) as picture:
        texture = pv.Texture(np.asarray(picture.convert("RGB")))
    texture.interpolate, texture.repeat = True, True
    return texture
