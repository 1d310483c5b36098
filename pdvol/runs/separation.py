"""Bodies that overlap at t = 0 on some level are moved, shrunk or refined, where the scene's `separate` allows it.

Whole bodies are moved or shrunk, the same on every level, as far as the worst level needs. All levels that have a
mesh are therefore built, also where fewer are requested. Bodies that have a `start`, which is a function of place,
stay.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pdvol.errors import IntersectionError, LevelError
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.initial_state import find_defects
from pdvol.levels.script import Obstacle
from pdvol.levels.start import started
from pdvol.meshing.build import build_levels
from pdvol.scene import Scene, Separate
from pdvol.stages import stage

STEPS = {"move": 0.01, "shrink": 0.02, "refine": 0.1}
"""One step of a change: a fraction of the body's diagonal, of its size, of the level's vertices."""


def build_apart(scene: Scene, count: int, obstacles: Sequence[Obstacle]) -> tuple[tuple[LevelMesh, ...], list[str]]:
    """The first `count` levels of a scene, as `build_levels`, with its bodies set apart as its `separate` allows; and a
    line of text for each change.

    Raises
    ------
    InputError
        As `build_levels`.
    IntersectionError
        Bodies still meet after all changes that are allowed.
    """
    if not scene.separate or not scene.contact:
        return build_levels(scene, count), []
    bodies = _Arrangement(scene, count)
    error = bodies.first_intersection(obstacles)
    for remedy in scene.separate:
        # Every change is one step of some body, and all steps of a body stay below the limit.
        while error is not None and bodies.take_step(remedy, error):
            error = bodies.first_intersection(obstacles)
    if error is not None:
        tried = ", ".join(f"{remedy.by} up to {remedy.limit:g}" for remedy in scene.separate)
        raise IntersectionError(f"{error} (after {tried})", error.pairs)
    return bodies.levels()[:count], bodies.report()


class _Arrangement:
    """All levels of a scene that have a mesh, at least `count`, and the changes to each body: its size, its shift [m],
    and the vertices of each level.
    """

    def __init__(self, scene: Scene, count: int):
        self.scene, self._wanted, self._count = scene, scene, count
        self._meshes = self._built()
        finest, count = self._meshes[-1], len(scene.bodies)
        boxes = [finest.points[finest.point_bodies == b] for b in range(count)]
        self._centres = np.array([(box.min(axis=0) + box.max(axis=0)) / 2 for box in boxes])
        self._diagonals = np.array([np.linalg.norm(np.ptp(box, axis=0)) for box in boxes])
        self._sizes, self._shifts, self._moved = np.ones(count), np.zeros((count, finest.dim)), np.zeros(count)

    def _built(self) -> tuple[LevelMesh, ...]:
        try:
            return build_levels(self._wanted)
        except LevelError as error:
            if error.level < self._count:
                raise
            return build_levels(self._wanted, error.level)

    def levels(self) -> tuple[LevelMesh, ...]:
        """The meshes with every body in its place."""
        placed = []
        for mesh in self._meshes:
            b = mesh.point_bodies
            points = self._centres[b] + self._sizes[b, None] * (mesh.points - self._centres[b]) + self._shifts[b]
            untouched = (self._sizes == 1.0)[b] & (self._moved == 0.0)[b]
            placed.append(replace(mesh, points=np.where(untouched[:, None], mesh.points, points)))
        return tuple(placed)

    def first_intersection(self, obstacles: Sequence[Obstacle]) -> IntersectionError | None:
        """The first intersection of some level."""
        with stage("checking that bodies are apart"):
            names = [body.name for body in self.scene.bodies]
            levels = [started(self.scene, mesh, level) for level, mesh in enumerate(self.levels())]
            defects = (find_defects(level, mesh, obstacles, names, levels) for level, mesh in enumerate(levels))
            errors = (defect.error for found in defects for defect in found)
            return next((error for error in errors if isinstance(error, IntersectionError)), None)

    def take_step(self, remedy: Separate, error: IntersectionError) -> bool:
        """Takes one step of a remedy. Returns False where it does not apply or has reached its limit."""
        step = STEPS[remedy.by]
        if remedy.by == "refine":
            refined = [self._refine(body, error.level, 1.0 + remedy.limit) for body in error.bodies]
            return any(refined)
        if error.push is None:
            return False
        changed = False
        for body, way in zip(error.bodies, (1.0, -1.0), strict=False):
            if self.scene.bodies[body].start is not None:  # a function of place, which does not move along
                continue
            if remedy.by == "move" and self._moved[body] + step <= remedy.limit * (1 + 1e-9):
                self._shifts[body] += way * step * self._diagonals[body] * error.push
                self._moved[body] += step
                changed = True
            elif remedy.by == "shrink" and self._sizes[body] - step >= (1.0 - remedy.limit) * (1 - 1e-9):
                self._sizes[body] -= step
                changed = True
        return changed

    def _refine(self, number: int, level: int, most: float) -> bool:
        body = self._wanted.bodies[number]
        if not body.vertices:
            return False
        targets = list(body.vertices)
        more = int(np.ceil(targets[level] * (1.0 + STEPS["refine"])))
        above = targets[level + 1] if level + 1 < len(targets) else np.inf
        if more > min(most * self.scene.bodies[number].vertices[level], above):
            return False
        targets[level] = more
        bodies = tuple(
            replace(b, vertices=tuple(targets)) if i == number else b for i, b in enumerate(self._wanted.bodies)
        )
        self._wanted = replace(self._wanted, bodies=bodies)
        self._meshes = self._built()
        return True

    def report(self) -> list[str]:
        """A line per change."""
        lines = []
        for i, (body, wanted) in enumerate(zip(self.scene.bodies, self._wanted.bodies, strict=True)):
            if self._moved[i]:
                lines.append(
                    f"body {body.name!r} moved by ({', '.join(f'{c:.3g}' for c in self._shifts[i])}) m to keep it apart"
                    " at t = 0"
                )
            if self._sizes[i] != 1.0:
                lines.append(f"body {body.name!r} shrunk to {self._sizes[i]:.3g} of its size to keep it apart at t = 0")
            lines += [
                f"body {body.name!r}, level {level}: {more} vertices wanted instead of {few} to keep it apart at t = 0"
                for level, (few, more) in enumerate(zip(body.vertices, wanted.vertices, strict=True))
                if few != more
            ]
        return lines
