"""From a scene to its levels' meshes: read, validate, decimate, mesh, place. Serial: one rank calls it and shares the
result.

The finest level's surface is decimated from the input's, each coarser one from the next finer one (paper, section
3.3.1). All have the input's volume. Meshes are kept in the shape's own coordinates, so that one shape placed many
times, or moved, is meshed once.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from threading import Lock
from typing import TypeAlias, cast

import numpy as np
from scipy.spatial import cKDTree

from pdvol.errors import InputError, LevelError, MeshError
from pdvol.geometry.closed_surfaces import enclosed_volume
from pdvol.geometry.crossings import edges_of
from pdvol.geometry.flat_faces import FlatFaces
from pdvol.geometry.level_mesh import LevelMesh, boundary_facets, simplex_centres
from pdvol.meshes import Outline, Solid, Surface
from pdvol.meshing import cache as mesh_cache
from pdvol.meshing.cpu_budget import cpu_budget, spend
from pdvol.meshing.decimate import decimate
from pdvol.meshing.edge_length import SizedMesh, UnreachableCount
from pdvol.meshing.point_caches import cached_surface, edges_or_faces
from pdvol.meshing.readers import read_shape
from pdvol.meshing.remesh import Unsuited, remesh
from pdvol.meshing.tetrahedralise import LEAST_OF_A_PART, surface_share, tetrahedralise
from pdvol.meshing.triangulate import triangulate
from pdvol.meshing.validate import check_outline, check_solid, check_surface, drop_unused, outline_edges
from pdvol.meshing.verdict import Boundary, check_place, judge, place_of
from pdvol.scene import Body, Deforming, Rigid, Scene
from pdvol.stages import say, stage

BUILD_VERSION = 10
"""Part of the cache's keys. Increase it by one when the same input gives other meshes: old ones are not used then."""
Shape: TypeAlias = Outline | Surface | Solid
AnyShape: TypeAlias = str | Path | Shape
_LIBRARIES = ("pytetwild", "gmsh", "fast-simplification", "libigl", "numpy", "scipy")
NEARBY_CELLS = 32
"""Input cells that are tried for each new cell: those whose centroids are nearest."""
SIDE_BY_SIDE = 2
"""Number of levels of a body that are made at once; each takes one core."""
TRIED_COUNTS = 2
"""Numbers of vertices that are tried before one is named in the place of one that cannot be had."""
SPARE_VERTICES = 1.5
"""Vertices of the surface that a level is decimated from, relative to the number expected on its boundary: the search
for a level's count takes from none to a third of them away.
"""


def build_levels(scene: Scene, count: int | None = None, cache: Path | None = None) -> tuple[LevelMesh, ...]:
    """The meshes of a scene's levels, coarsest first: only the first `count`, which are the same as in the full
    hierarchy. The mesh cache is the folder `cache`, `cache.default_folder()` if not given.

    It raises InputError where a shape is missing, unreadable or invalid, with a message of one line that names the
    body; LevelError where no mesh came out for a level: all bodies have one for each coarser level.
    """
    levels = scene.levels if count is None else min(count, scene.levels)
    if levels < 1:
        raise InputError(f"count = {count!r}: a hierarchy needs at least one level")
    folder = mesh_cache.default_folder() if cache is None else Path(cache)
    shapes: dict[str, list[LevelMesh]] = {}
    with cpu_budget(vertices_asked(scene)):
        built, refused = list[list[LevelMesh]](), None
        for body in scene.bodies:
            try:
                built.append(_body_levels(body, levels, folder, shapes))
            except LevelError as error:  # another body may lack a coarser level
                if error.level == 0:
                    raise
                levels, refused = error.level, error
    if refused is not None:
        raise refused
    dims = {body.name: meshes[0].dim for body, meshes in zip(scene.bodies, built, strict=True)}
    if len(set(dims.values())) > 1:
        raise InputError(f"bodies must all be 2D or all 3D, not {dims}; replace the odd ones")
    return tuple(_concatenate(scene, [meshes[level] for meshes in built]) for level in range(levels))


def vertices_asked(scene: Scene) -> int:
    """Number of vertices that a scene's bodies ask for, on all levels."""
    return sum(int(sum(body.vertices)) for body in scene.bodies)


def read_obstacle(obstacle: Rigid | Deforming) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """An obstacle at rest, placed: vertices (n, d) [m], edges (e, 2) int64, faces (f, 3) int64 (none in 2D). A mesh
    that a point cache brings has all vertices that faces use, in their order.

    It raises InputError where it is missing, unreadable or invalid. Open surfaces and polylines are valid unless
    `obstacle.closed` is set.
    """
    name = f"obstacle {obstacle.name!r}"
    if isinstance(obstacle, Deforming) and obstacle.shape is None:
        return _animated_mesh(obstacle, name)
    shape = read_shape(obstacle.shape)
    if isinstance(shape, Solid):
        solid = check_solid(shape, name)
        points, facets = drop_unused(solid.vertices, boundary_facets(solid.cells.astype(np.int64))[0])
    elif isinstance(shape, Surface):
        surface = check_surface(shape, name, obstacle.closed)
        points, facets = surface.vertices, surface.triangles.astype(np.int64)
    else:
        points = check_outline(shape, name, obstacle.closed).points
        facets = outline_edges(len(points), obstacle.closed)
    faces = facets if facets.shape[1] == 3 else np.empty((0, 3), dtype=np.int64)
    return obstacle.placement(points), edges_of(facets), faces


def _animated_mesh(obstacle: Deforming, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The mesh of a point cache in its first frame; vertices, edges and faces as `read_obstacle` gives them."""
    shape, facets = cached_surface(obstacle.motion), edges_or_faces(obstacle.motion, obstacle.closed)
    if isinstance(shape, Surface):
        check_surface(shape, name, obstacle.closed)
        turned = obstacle.closed and enclosed_volume(shape.vertices, facets) < 0.0
        points, faces = drop_unused(shape.vertices, facets[:, ::-1] if turned else facets)
        return points, edges_of(faces), faces
    if len(np.asarray(obstacle.motion.faces)) == 0:
        check_outline(shape, name, obstacle.closed)
    return shape.points, facets, np.empty((0, 3), dtype=np.int64)


# ---- one body


def _body_levels(body: Body, levels: int, folder: Path, shapes: dict[str, list[LevelMesh]]) -> list[LevelMesh]:
    name = f"body {body.name!r}"
    if isinstance(body.shape, (tuple, list)):
        return [_own_level(body, level, folder, name) for level in range(levels)]
    with stage(f"reading {name}"):
        shape = read_shape(body.shape)
    check_place(body.placement(place_of(shape)), name)
    key = _shape_key(shape, body.vertices)
    done = shapes.setdefault(key, [])
    if len(done) < levels:
        with stage(f"checking {name}"):
            boundary = judge(shape, name)[1]
        done[:] = _meshed(shape, boundary, body.vertices, levels, folder, key, name)
    return done


def _own_level(body: Body, level: int, folder: Path, name: str) -> LevelMesh:
    """A level that has a shape of its own: a volume mesh as it is, another one meshed to its target."""
    what, listed = f"{name}, level {level}", cast("Sequence[AnyShape]", body.shape)
    with stage(f"reading {what}"):
        shape = read_shape(listed[level])
    check_place(body.placement(place_of(shape)), what)
    if isinstance(shape, Solid):
        solid = judge(shape, what)[0]
        return _alone(solid.vertices, solid.cells, solid.regions, solid.vertices)
    if not len(body.vertices):
        kind = type(shape).__name__.lower()
        raise MeshError(
            f"{what}: a list of levels takes volume meshes as they are, and this one is of the kind {kind}; give"
            " vertices=, one target a level, too"
        )
    with stage(f"checking {what}"):
        boundary = judge(shape, what)[1]
    targets = body.vertices[level : level + 1]
    return _meshed(shape, boundary, targets, 1, folder, _shape_key(shape, targets), name, level)[0]


def _meshed(
    shape: Shape,
    boundary: Boundary,
    targets: Sequence[int] | np.ndarray,
    levels: int,
    folder: Path,
    key: str,
    name: str,
    first: int = 0,
) -> list[LevelMesh]:
    """The first `levels` meshes of a shape in its own coordinates, from the cache where it has them; the coarsest is
    the body's level `first`.
    """
    prepared = Lock()
    coarsened: list[Surface] = []

    def decimated(level: int, count: int) -> Surface:
        """The surface that a level of `count` vertices is made from. All are decimated once, if any is needed."""
        with prepared:
            if not coarsened:
                with stage(f"decimating {name}"):
                    coarsened.extend(_decimated(cast("Surface", boundary), targets, name))
        if count == int(targets[level]) or level + 1 == len(coarsened):
            return coarsened[level]
        return _coarsened(coarsened[level + 1], count, name)

    def build(level: int) -> dict[str, np.ndarray]:
        what = f"{name}, level {first + level}"

        def make(count: int) -> SizedMesh:
            if not isinstance(boundary, Surface):
                return triangulate(boundary, count, what)
            if count < LEAST_OF_A_PART:
                raise MeshError(f"{what}: {count} vertices are too few for a solid; ask for {LEAST_OF_A_PART} or more")
            try:
                return remesh(boundary, count, what)
            except (Unsuited, UnreachableCount):
                flat = FlatFaces(boundary.vertices, boundary.triangles)
                volume = enclosed_volume(boundary.vertices, boundary.triangles)
                return tetrahedralise(decimated(level, count), count, what, volume, flat)

        with stage(f"meshing {what}"):
            sized = _sized(make, *map(int, targets[level : level + 2]))
        return {
            "points": sized.points,
            "cells": sized.cells.astype(np.int32),
            "regions": _regions(shape, sized.points, sized.cells, name),
            "places": sized.places,
        }

    def fetch(level: int) -> LevelMesh:
        try:
            arrays = mesh_cache.fetch(folder, f"{key}-{level}", partial(build, level))
        except MeshError as error:
            raise LevelError(str(error), first + level) from error
        return _alone(*(arrays[name] for name in ("points", "cells", "regions", "places")))

    # The meshers are processes of their own: levels are made side by side. Of several failures the coarsest is raised.
    pool = ThreadPoolExecutor(SIDE_BY_SIDE)
    try:
        return list(pool.map(fetch, range(levels)))
    except KeyboardInterrupt:
        spend()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _sized(make: Callable[[int], SizedMesh], target: int, finer: int | None = None) -> SizedMesh:
    """The mesh of about `target` vertices, where the next finer level has about `finer`. Where there is none, the error
    names a number only if it has one: that is tried.
    """
    try:
        return make(target)
    except UnreachableCount as error:
        found, closest = error, error.closest
    for _ in range(TRIED_COUNTS):
        tried = closest
        say(f"trying {tried:,} vertices")
        try:
            make(tried)
        except UnreachableCount as error:
            closest = error.closest
        except MeshError:
            break
        else:
            more = "" if finer is None or tried <= finer else ", and for no fewer on finer levels"
            raise MeshError(f"{found}; ask for about {tried} instead{more}")
    raise MeshError(f"{found}, nor about {tried}; ask for many more, clean the surface, or thicken thin walls")


def _coarsened(finer: Surface, target: int, name: str) -> Surface:
    """The surface from which a level of `target` vertices is meshed, decimated from that of the next finer level."""
    return decimate(finer, int(SPARE_VERTICES * surface_share(finer, target)), name)


def _decimated(surface: Surface, targets: Sequence[int] | np.ndarray, name: str) -> list[Surface]:
    """Each level's surface; the finest level's is the input's."""
    surfaces = [surface]
    for target in reversed(targets[:-1]):
        surfaces.insert(0, _coarsened(surfaces[0], int(target), name))
    return surfaces


def _shape_key(shape: Shape, targets: Sequence[int] | np.ndarray) -> str:
    versions = [" ".join(pair) for pair in mesh_cache.installed(_LIBRARIES).items()]
    arrays = (shape.points,) if isinstance(shape, Outline) else tuple(np.asarray(a) for a in vars(shape).values())
    return mesh_cache.content_key(type(shape).__name__, *arrays, *(int(t) for t in targets), BUILD_VERSION, *versions)


def _alone(points: np.ndarray, cells: np.ndarray, regions: np.ndarray, places: np.ndarray) -> LevelMesh:
    """A level of one body, in its shape's own coordinates."""
    return LevelMesh(points, cells.astype(np.int64), np.zeros(len(cells), dtype=np.int32), regions, places)


def _concatenate(scene: Scene, meshes: list[LevelMesh]) -> LevelMesh:
    """One level: every body's cells, placed."""
    starts = np.cumsum([0, *(len(mesh.points) for mesh in meshes)])
    placed = list(zip(scene.bodies, meshes, strict=True))
    return LevelMesh(
        points=np.vstack([body.placement(mesh.points) for body, mesh in placed]),
        cells=np.vstack([mesh.cells + start for mesh, start in zip(meshes, starts, strict=False)]),
        bodies=np.repeat(np.arange(len(meshes), dtype=np.int32), [len(mesh.cells) for mesh in meshes]),
        regions=np.concatenate([mesh.regions for mesh in meshes]).astype(np.int32),
        places=np.vstack([body.placement(mesh.on_the_shape) for body, mesh in placed]),
    )


def _regions(shape: Shape, points: np.ndarray, cells: np.ndarray, name: str) -> np.ndarray:
    """(m,) int32 the region of the input cell that contains each new cell's centroid; of the nearest by centroid where
    none of `NEARBY_CELLS` does. 0 of shapes that have none.
    """
    solid = check_solid(shape, name) if isinstance(shape, Solid) else None
    if solid is None or (solid.regions == solid.regions[0]).all():
        return np.full(len(cells), 0 if solid is None else solid.regions[0], dtype=np.int32)
    corners, centroids = solid.vertices[solid.cells], simplex_centres(points, cells)
    near = cKDTree(corners.mean(axis=1)).query(centroids, k=min(NEARBY_CELLS, len(solid.cells)))[1]
    near = near.reshape(len(cells), -1)
    inverse = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
    inner = np.einsum("ckij,ckj->cki", inverse[near], centroids[:, None] - corners[near, 0])
    # how far outside each near cell the centroid is
    inside = np.maximum(-inner.min(axis=2), inner.sum(axis=2) - 1.0) <= 1e-9
    pick = np.where(inside.any(axis=1), inside.argmax(axis=1), 0)
    return solid.regions[near[np.arange(len(cells)), pick]].astype(np.int32)
