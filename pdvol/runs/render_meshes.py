"""A scene's render meshes, read, placed and bound to each level, as a run folder keeps them. Serial."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from pdvol.errors import InputError
from pdvol.geometry.distances import signed_distance
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.meshing.build import build_levels
from pdvol.meshing.render_files import read_render_surface, read_texture
from pdvol.meshing.weld import COINCIDENT, coincident
from pdvol.runs.render_binding import render_weights
from pdvol.scene import Body, Scene
from pdvol.scene.render_mesh import RenderMesh
from pdvol.stages import stage

MOST_APART = 0.5
"""Distance from its body, relative to the body's diagonal, above which a render mesh is one of another scale or place.
"""


def bound_render_meshes(scene: Scene, meshes: Sequence[LevelMesh], set_apart: bool) -> list[dict[str, Any]]:
    """Entries for `pdvol.store.render_meshes.write_render_meshes`; none where no body carries a render mesh.

    Parameters
    ----------
    meshes : of the levels, coarsest first
    set_apart : whether bodies of `meshes` have been moved or shrunk from where the scene places them

    Raises
    ------
    InputError
        A file is missing or holds no surface, a mesh lies far from its body, or the scene is 2D.
    """
    entries: list[dict[str, Any]] = []
    for number, body in enumerate(scene.bodies):
        for k, mesh in enumerate(body.render_meshes):
            label = body.name if len(body.render_meshes) == 1 else f"{body.name} {k + 1}"
            name = f"body {body.name!r}, render mesh{'' if label == body.name else f' {k + 1}'}"
            if meshes[0].dim != 3:
                raise InputError(f"{name}: a render mesh is a surface, and this scene is 2D; leave it out")
            with stage(f"binding the render mesh of {body.name!r}"):
                arrays, texture, notes = _read(mesh, body, name)
                if set_apart:
                    arrays["points"] = _set_apart(scene, meshes, number, arrays["points"])
                levels = [level.body(number) for level in meshes]
                _check_near(arrays["points"], levels[-1][0], name)
                weights = []
                for level, (own, vertices) in zip(meshes, levels, strict=True):
                    fans, first = arrays["corners"][arrays["fans"]], arrays["first"]
                    w = render_weights(arrays["points"], fans, first, own, mesh.interpolant, name)
                    of_level = (w.data, vertices[w.indices], w.indptr)
                    weights.append(sp.csr_matrix(of_level, shape=(len(arrays["points"]), len(level.points))))
            entry = {"body": number, "name": label, "interpolant": mesh.interpolant, "notes": notes}
            entries.append({**entry, "arrays": arrays, "texture": texture, "weights": weights})
    return entries


def check_render_files(scene: Scene) -> None:
    """InputError where a render mesh or its texture cannot be read, before anything that takes long."""
    for body in scene.bodies:
        for mesh in body.render_meshes:
            _read(mesh, body, f"body {body.name!r}, render mesh")


def render_defects(scene: Scene, meshes: Sequence[LevelMesh]) -> tuple[list[str], list[str]]:
    """What stops a run at its render meshes, and what is worth knowing of their textures, in lines."""
    try:
        bound = bound_render_meshes(scene, meshes, bool(scene.separate and scene.contact))
    except InputError as error:
        return [str(error)], []
    return [], list(dict.fromkeys(note for entry in bound for note in entry["notes"]))


def _read(mesh: RenderMesh, body: Body, name: str) -> tuple[dict[str, np.ndarray], tuple[bytes, str] | None, list[str]]:
    """The arrays of a render mesh, placed as its body, its texture, and what of the file's textures is lost."""
    surface, pictures, lost = read_render_surface(mesh.shape, name, mesh.material)
    drawn = mesh.texture if isinstance(mesh.texture, np.ndarray) else None
    own = str(mesh.texture) if drawn is None else "pixels"
    if len(pictures) > 1 and not own:
        names = ", ".join(Path(picture).name for picture in pictures)
        raise InputError(
            f"{name}: its materials name {len(pictures)} textures ({names}); give RenderMesh(texture=...), or one"
            " RenderMesh(FILE, material=NAME) for each material"
        )
    points = body.placement(surface.vertices)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    first = coincident(points, COINCIDENT * size) if size else np.zeros(len(points), dtype=np.int64)
    texture = None
    if drawn is not None:
        from PIL import Image

        buffer = io.BytesIO()
        Image.fromarray(drawn).save(buffer, "PNG")
        texture, lost = (buffer.getvalue(), ".png"), []
    elif own or pictures:
        texture, lost = read_texture(own or pictures[0], name), [] if own else lost
    if texture is not None and not len(surface.uvs):
        raise InputError(f"{name}: a texture needs texture coordinates; give uvs, or an OBJ file with vt lines")
    arrays = {key: getattr(surface, key) for key in ("counts", "corners", "uvs", "uv_corners", "fans")}
    return {**arrays, "points": points, "first": first}, texture, [f"{name}: {line}" for line in lost]


def _check_near(points: np.ndarray, body: LevelMesh, name: str) -> None:
    """InputError where some vertex is far outside of the body."""
    size = float(np.linalg.norm(np.ptp(body.points, axis=0)))
    low, high = body.points.min(axis=0), body.points.max(axis=0)
    apart = float(np.linalg.norm(np.maximum(0.0, np.maximum(low - points, points - high)), axis=1).max())
    apart = apart if apart > MOST_APART * size else float(signed_distance(points, body.points, body.boundary).max())
    if apart > MOST_APART * size:
        own = float(np.linalg.norm(np.ptp(points, axis=0)))
        raise InputError(
            f"{name}: it reaches {apart:.3g} m out of its body, whose diagonal is {size:.3g} m (its own is"
            f" {own:.3g} m); give it in the coordinates of the body's shape"
        )


def _set_apart(scene: Scene, meshes: Sequence[LevelMesh], number: int, points: np.ndarray) -> np.ndarray:
    """Points where a body is after `separate` has moved or shrunk it, which it does on all levels alike."""
    for placed, apart in zip(build_levels(scene, len(meshes)), meshes, strict=True):
        before, after = placed.body(number)[0].points, apart.body(number)[0].points
        if before.shape == after.shape:
            middle, moved = before.mean(axis=0), after.mean(axis=0)
            scale = np.linalg.norm(after - moved) / np.linalg.norm(before - middle)
            return moved + scale * (points - middle)
    raise InputError(
        f"body {scene.bodies[number].name!r}: all its levels were refined to keep bodies apart, and its render mesh"
        " cannot follow; set the bodies apart by their placements"
    )
