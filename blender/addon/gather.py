"""Blender's scene as a shot: meshes as their modifiers make them, in metres, at each time step."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np

from ..shot.description import Body, Group, Mesh, Obstacle, Pin, Pull, Region, Shot, ShotError
from ..shot.names import plain_names
from ..work.play import Played

MODIFIERS = ("pdvol", "pdvol render")
"""Names of the Mesh Cache modifiers of an object that follows a body: that of the 3D view, and that of renders."""

RENDERED = {"show_viewport": "show_render", "levels": "render_levels"}
"""Settings of modifiers for the 3D view, and those of the same for renders."""


def shot_objects(scene: bpy.types.Scene) -> tuple[list, list]:
    """The scene's bodies and obstacles, by name."""
    things = sorted((o for o in scene.objects if o.pdvol.role != "NONE"), key=lambda o: o.name)
    return [o for o in things if o.pdvol.role == "BODY"], [o for o in things if o.pdvol.role == "OBSTACLE"]


def level_targets(thing: bpy.types.Object) -> tuple[int, ...]:
    """The vertices of each level of a body; ShotError where the text holds no such numbers."""
    words = thing.pdvol.vertices.replace(",", " ").split()
    if not words or not all(word.isdecimal() and int(word) >= 4 for word in words):
        raise ShotError(f"{thing.name!r}: Vertices is {thing.pdvol.vertices!r}; write as 200 600 2000, 4 or more each")
    numbers = tuple(int(word) for word in words)
    if list(numbers) != sorted(numbers):
        raise ShotError(f"{thing.name!r}: Vertices go from coarse to fine, as 200 600 2000")
    return numbers


def parameter_labels(scene: bpy.types.Scene) -> dict[str, str]:
    """What can be varied: the scene file's parameters by name, with what the user reads."""
    bodies, obstacles = shot_objects(scene)
    labels = {"friction": "Friction"}
    for thing, name in zip(bodies, _names(bodies, obstacles), strict=False):
        labels[f"{name}_young"] = f"{thing.name}: Young's modulus [Pa]"
        labels |= {f"{name}_speed_{axis}": f"{thing.name}: velocity {axis.upper()} [m/s]" for axis in "xyz"}
    return labels


def body_of(scene: bpy.types.Scene, parameter: str) -> bpy.types.Object | None:
    """The body that a parameter of the scene file belongs to."""
    bodies, obstacles = shot_objects(scene)
    names = _names(bodies, obstacles)
    return next((o for o, n in zip(bodies, names, strict=False) if parameter.startswith(f"{n}_")), None)


def frame_rate(scene: bpy.types.Scene) -> float:
    """Frames a second."""
    return scene.render.fps / scene.render.fps_base


def metres(scene: bpy.types.Scene) -> float:
    """A unit of the scene's coordinates [m]."""
    units = scene.unit_settings
    return 1.0 if units.system == "NONE" else float(units.scale_length)


def gather(context: bpy.types.Context) -> tuple[Shot, list[Played]]:
    """The shot that Blender's scene says, and how its objects follow it.

    The scene's frame and modifiers are as before when it returns.

    Raises
    ------
    ShotError
        An object cannot take part, or a setting does not fit; the line names it.
    """
    scene = context.scene
    bodies, obstacles = shot_objects(scene)
    if not bodies:
        raise ShotError("there is no soft body; select a mesh and press Body")
    frames = scene.frame_end - scene.frame_start
    if frames < 1:
        raise ShotError(f"the scene has frames {scene.frame_start} to {scene.frame_end}; give it two at least")
    for thing in (*bodies, *obstacles):
        _check(thing, scene)
    for thing in bodies:
        level_targets(thing)
    names = _names(bodies, obstacles)
    with _without_caches(bodies):
        shapes, worlds, motions = _recorded(context, [*bodies, *obstacles], frames)
        rendered = _rendered(context, bodies, shapes)
    pulls = [_pull(context, thing, shape[0]) for thing, shape in zip(bodies, shapes, strict=False)]
    shot = Shot(
        source=Path(bpy.data.filepath).name,
        bodies=tuple(map(_body, bodies, names, shapes, rendered, motions, pulls)),
        obstacles=tuple(
            Obstacle(name, thing.name, shape[0], motion)
            for thing, name, shape, motion in zip(
                obstacles, names[len(bodies) :], shapes[len(bodies) :], motions[len(bodies) :], strict=True
            )
        ),
        ground=round(scene.pdvol.height * metres(scene), 9) if scene.pdvol.ground else None,
        gravity=tuple(round(g, 6) for g in scene.gravity) if scene.use_gravity and scene.gravity.length else None,
        friction=round(scene.pdvol.friction, 6),
        fps=frame_rate(scene),
        frames=frames,
        steps_a_frame=scene.pdvol.steps,
        first_frame=scene.frame_start,
    )
    played = [
        Played(body.name, body.label, 1 if body.rendered is None else 2, metres(scene), world)
        for body, world in zip(shot.bodies, worlds, strict=False)
    ]
    return shot, played


def _names(bodies: list, obstacles: list) -> list[str]:
    return plain_names([o.name for o in (*bodies, *obstacles)])


def _check(thing: bpy.types.Object, scene: bpy.types.Scene) -> None:
    if thing.type != "MESH":
        raise ShotError(f"{thing.name!r} is no mesh: convert it (Object > Convert > Mesh)")
    if thing.pdvol.role == "BODY" and (thing.library is not None or not thing.is_editable):
        raise ShotError(
            f"{thing.name!r} is linked from another file: make a library override (Object > Library Override > Make)"
        )
    if thing.name not in scene.view_layers[0].objects and not any(thing.name in v.objects for v in scene.view_layers):
        raise ShotError(f"{thing.name!r} is in no view layer, so it has no shape: show its collection")
    if thing.mode == "EDIT":
        raise ShotError(f"{thing.name!r} is being edited: leave edit mode")


# ---- meshes and their motions


def _recorded(context: bpy.types.Context, things: list, frames: int) -> tuple[list, list, list]:
    """Of each object its mesh at t = 0 with the weights of its groups, its matrices at frames (one where it rests), and
    its points at all time steps (None where they rest).
    """
    scene, steps = context.scene, context.scene.pdvol.steps
    moving = [thing for thing in things if _may_move(thing)]
    count = frames * steps if moving else 0
    shapes: list = []
    worlds: dict = {thing: [] for thing in things}
    motions: dict = {thing: [] for thing in things}
    with _frame_kept(scene):
        for step in range(count + 1):
            scene.frame_set(scene.frame_start + step // steps, subframe=(step % steps) / steps)
            depsgraph = context.evaluated_depsgraph_get()
            for thing in things if step == 0 else moving:
                if step == 0:
                    shapes.append(_mesh(thing, depsgraph, metres(scene)))
                if step % steps == 0:
                    worlds[thing].append([list(row) for row in thing.evaluated_get(depsgraph).matrix_world])
                if thing in moving:
                    motions[thing].append(_points(thing, depsgraph, metres(scene)))
                    if len(motions[thing][-1]) != len(motions[thing][0]):
                        raise ShotError(
                            f"{thing.name!r} has another number of vertices at frame {scene.frame_current}: its"
                            " modifiers must not change that in time"
                        )
    return (
        shapes,
        [w if any(m != w[0] for m in w) else w[:1] for w in worlds.values()],
        [np.array(m) if len(m) and any((p != m[0]).any() for p in m) else None for m in motions.values()],
    )


def _rendered(context: bpy.types.Context, bodies: list, shapes: list) -> list:
    """Of each body the mesh of renders at t = 0, where that has other vertices than the 3D view's; else None."""
    scene = context.scene
    found: list = []
    with _frame_kept(scene):
        scene.frame_set(scene.frame_start)
        for thing, (shape, _) in zip(bodies, shapes, strict=False):
            with _as_rendered(thing) as differs:
                mesh = _mesh(thing, context.evaluated_depsgraph_get(), metres(scene))[0] if differs else shape
            found.append(mesh if len(mesh.points) != len(shape.points) else None)
    return found


def _pull(context: bpy.types.Context, thing: bpy.types.Object, shape: Mesh) -> Pull | None:
    """What draws a body, in its frames; None where nothing does."""
    scene, empty, points = context.scene, thing.pdvol.pull, []
    if empty is None:
        return None
    first, last = thing.pdvol.pull_frames if any(thing.pdvol.pull_frames) else (scene.frame_start, scene.frame_end)
    if not scene.frame_start <= first < last <= scene.frame_end:
        raise ShotError(
            f"{thing.name!r} is pulled in frames {first} to {last}: choose two of {scene.frame_start} to"
            f" {scene.frame_end}"
        )
    with _frame_kept(scene):
        for frame in (scene.frame_start, *range(first, last + 1)):
            scene.frame_set(frame)
            world = empty.evaluated_get(context.evaluated_depsgraph_get()).matrix_world
            points.append(metres(scene) * np.array(world.translation, dtype=float))
    where = shape.points[np.argmin(np.linalg.norm(shape.points - points[0], axis=1))]
    return Pull(where, first - scene.frame_start, np.array(points[1:]))


@contextmanager
def _as_rendered(thing: bpy.types.Object) -> Iterator[bool]:
    """The 3D view's settings of modifiers are those of renders; whether that changes anything."""
    before = [(m, name, getattr(m, name)) for m in thing.modifiers for name in RENDERED if hasattr(m, name)]
    wanted = [(m, name, getattr(m, RENDERED[name])) for m, name, _ in before if m.name not in MODIFIERS]
    changed = [entry for entry in wanted if getattr(entry[0], entry[1]) != entry[2]]
    for modifier, name, value in changed:
        setattr(modifier, name, value)
    try:
        yield bool(changed)
    finally:
        for modifier, name, value in before:
            if getattr(modifier, name) != value:
                setattr(modifier, name, value)


def _may_move(thing: bpy.types.Object) -> bool:
    """Whether anything could change an object's place or shape in time."""
    data = [thing, thing.data, getattr(thing.data, "shape_keys", None)]
    if any(d is not None and d.animation_data is not None for d in data):
        return True
    if thing.constraints or thing.rigid_body is not None or any(m.name not in MODIFIERS for m in thing.modifiers):
        return True
    return thing.parent is not None and _may_move(thing.parent)


def _points(thing: bpy.types.Object, depsgraph: bpy.types.Depsgraph, unit: float) -> np.ndarray:
    """(n, 3) [m] of an object as its modifiers make it."""
    evaluated = thing.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    points = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", points)
    evaluated.to_mesh_clear()
    world = np.array(evaluated.matrix_world, dtype=float)
    return unit * (points.reshape(-1, 3).astype(float) @ world[:3, :3].T + world[:3, 3])


def _mesh(thing: bpy.types.Object, depsgraph: bpy.types.Depsgraph, unit: float) -> tuple[Mesh, dict]:
    """An object's mesh [m], and the weights of its vertex groups by name."""
    points = _points(thing, depsgraph, unit)
    evaluated = thing.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    counts, corners = np.empty(len(mesh.polygons), dtype=np.int64), np.empty(len(mesh.loops), dtype=np.int64)
    mesh.polygons.foreach_get("loop_total", counts)
    mesh.loops.foreach_get("vertex_index", corners)
    weights = {group.index: np.zeros(len(points)) for group in thing.vertex_groups}
    if weights:
        for vertex in mesh.vertices:
            for element in vertex.groups:
                if element.group in weights:
                    weights[element.group][vertex.index] = element.weight
    evaluated.to_mesh_clear()
    named = {group.name: weights[group.index] for group in thing.vertex_groups}
    if not len(counts):
        raise ShotError(f"{thing.name!r} has no faces: it cannot take part")
    if thing.matrix_world.is_negative:  # a mirrored object's faces are inside out
        ends = np.cumsum(counts)
        turned = np.concatenate([corners[e - n : e][::-1] for e, n in zip(ends, counts, strict=True)])
        return Mesh(points, counts, turned), named
    return Mesh(points, counts, corners), named


def _body(
    thing: bpy.types.Object,
    name: str,
    shape: tuple[Mesh, dict],
    rendered: Mesh | None,
    motion: np.ndarray | None,
    pull: Pull | None,
) -> Body:
    mesh, weights = shape
    settings = thing.pdvol

    def group(wanted: str) -> Group:
        if wanted not in weights:
            raise ShotError(f"{thing.name!r} has no vertex group {wanted!r}; choose one of its own")
        if not (weights[wanted] >= 0.5).any():
            raise ShotError(f"{thing.name!r}: no vertex of the group {wanted!r} has a weight of 0.5 or more")
        return Group(wanted, weights[wanted])

    pins = (Pin(group(settings.pins), round(settings.reach / 100.0, 6)),) if settings.pins else ()
    return Body(
        name=name,
        label=thing.name,
        shape=mesh,
        rendered=rendered,
        motion=motion if pins else None,
        material=settings.material(),
        vertices=level_targets(thing),
        velocity=tuple(round(v, 6) for v in settings.velocity),
        pins=pins,
        regions=tuple(Region(group(region.group), region.material()) for region in settings.regions),
        repair=settings.repair,
        hole=round(settings.hole, 6),
        pull=pull,
    )


# ---- what is as before afterwards


@contextmanager
def _without_caches(things: list) -> Iterator[None]:
    """Objects are where their own animation has them."""
    caches = [m for thing in things for m in thing.modifiers if m.name in MODIFIERS and m.show_viewport]
    for modifier in caches:
        modifier.show_viewport = False
    try:
        yield
    finally:
        for modifier in caches:
            modifier.show_viewport = True


@contextmanager
def _frame_kept(scene: bpy.types.Scene) -> Iterator[None]:
    frame, subframe = scene.frame_current, scene.frame_subframe
    try:
        yield
    finally:
        scene.frame_set(frame, subframe=subframe)
