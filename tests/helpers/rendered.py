"""Render meshes of made-up runs."""

import numpy as np

from pdvol.geometry.level_mesh import LevelMesh
from pdvol.meshes import RenderSurface
from pdvol.meshing.weld import coincident
from pdvol.runs.render_binding import render_weights
from pdvol.store.render_meshes import write_render_meshes as write_render_meshes
from shapes import box


def grown_box(low, high, by: float, boxes: int = 4) -> RenderSurface:
    """The surface of a box from `low` to `high`, larger by `by` on each side; each of its faces has the whole texture,
    so that its edges are seams.
    """
    solid = box(3, boxes, np.broadcast_to(low, 3) - by, np.broadcast_to(high, 3) + by)
    used, faces = np.unique(solid.boundary, return_inverse=True)
    points, faces = solid.points[used], faces.reshape(-1, 3)
    places = (points - points.min(axis=0)) / np.ptp(points, axis=0)
    normals = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
    along = np.abs(normals).argmax(axis=1)
    axes = np.array([[1, 2], [0, 2], [0, 1]])[along]
    uvs = places[faces[:, :, None], axes[:, None, :]].reshape(-1, 2)
    uvs, corners = np.unique(uvs, axis=0, return_inverse=True)
    return RenderSurface.of(points, faces, uvs, corners.reshape(-1, 3))


def entry_of(mesh: LevelMesh, body: int, surface: RenderSurface, interpolant: str = "phong", texture=None) -> dict:
    """An entry of `write_render_meshes` for a run of one level."""
    own, vertices = mesh.body(body)
    first = coincident(surface.vertices, 1e-9)
    w = render_weights(surface.vertices, surface.triangles, first, own, interpolant, "x").tocoo()
    weights = type(w)((w.data, (w.row, vertices[w.col])), shape=(w.shape[0], len(mesh.points))).tocsr()
    arrays = {key: getattr(surface, key) for key in ("counts", "corners", "uvs", "uv_corners", "fans")}
    arrays |= {"points": surface.vertices, "first": first}
    return {
        "body": body,
        "name": ["left", "right"][body],
        "interpolant": interpolant,
        "arrays": arrays,
        "texture": texture,
        "weights": [weights],
    }
