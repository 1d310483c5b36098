"""A shot as a scene file of pdvol, with the meshes that it reads: readable, and run without Blender."""

import shlex
from pathlib import Path

from .description import Body, Group, Material, Obstacle, Pull, Shot, ShotError
from .files import Places, write_obj, write_pc2, write_text, write_weights
from .names import GROUND, plain_names

HEAD = '''"""{name}: written by pdvol's Blender extension from {source}, and run by: pdvol run {file}

Lengths are metres, z is upward, and t = 0 is frame {first}. Blender writes this file again with the next preview.
"""

from pathlib import Path

import pdvol
from pdvol import {imports}

MESHES = Path(__file__).resolve().parent / {folder!r} / "meshes"


def scene(
{parameters}
):
    """{frames} frames at {fps:g} a second, {steps_a_frame} time steps each."""
'''
TAIL = """

if __name__ == "__main__":
    pdvol.main(scene)
"""


def write_shot(shot: Shot, places: Places) -> None:
    """Write the scene file and what it reads; meshes that no body or obstacle has any more are removed.

    Raises
    ------
    ShotError
        The shot has no body, or bodies with other numbers of levels.
    OSError
        The folder cannot be written.
    """
    _check(shot)
    before = set(places.meshes.iterdir()) if places.meshes.is_dir() else set()
    written = {path for body in shot.bodies for path in _write_body(body, shot, places.meshes)}
    written |= {path for obstacle in shot.obstacles for path in _write_obstacle(obstacle, shot, places.meshes)}
    write_text(places.scene, scene_text(shot, places))
    for path in before - written:
        path.unlink()


def _check(shot: Shot) -> None:
    if not shot.bodies:
        raise ShotError("there is no soft body; select a mesh and press Body")
    first = shot.bodies[0]
    for body in shot.bodies[1:]:
        if len(body.vertices) != len(first.vertices):
            raise ShotError(
                f"{body.label!r} has {len(body.vertices)} levels and {first.label!r} has {len(first.vertices)}; give"
                " all bodies as many"
            )


def _write_body(body: Body, shot: Shot, folder: Path) -> list[Path]:
    paths = list(_shape_files(body, folder)) if body.repair else [folder / f"{body.name}.obj"]
    write_obj(paths[0], body.shape)
    if body.rendered is not None:
        paths.append(folder / f"{body.name}_render.obj")
        write_obj(paths[-1], body.rendered)
    for group, file in group_files(body):
        paths.append(folder / file)
        write_weights(paths[-1], group.weights)
    if body.motion is not None and _led(body):
        paths.append(folder / f"{body.name}.pc2")
        write_pc2(paths[-1], body.motion, 1.0 / shot.steps_a_frame)
    return paths


def _write_obstacle(obstacle: Obstacle, shot: Shot, folder: Path) -> list[Path]:
    paths = [folder / f"{obstacle.name}.obj"]
    write_obj(paths[0], obstacle.shape)
    if obstacle.motion is not None:
        paths.append(folder / f"{obstacle.name}.pc2")
        write_pc2(paths[-1], obstacle.motion, 1.0 / shot.steps_a_frame)
    return paths


def open_shapes(shot: Shot, folder: Path) -> list[tuple[Path, Path, float]]:
    """What `pdvol repair` has to close: mesh, closed mesh and the longest rim in diagonals; none whose mesh is as it
    was the last time.
    """
    shapes = [(*_shape_files(body, folder), body.hole) for body in shot.bodies if body.repair]
    return [(mesh, closed, hole) for mesh, closed, hole in shapes if not _is_newer(closed, mesh)]


def _shape_files(body: Body, folder: Path) -> tuple[Path, Path]:
    """The mesh of a body's shape, and the same as it is closed."""
    return folder / f"{body.name}.obj", folder / f"{body.name}_closed.obj"


def _is_newer(file: Path, other: Path) -> bool:
    return file.is_file() and file.stat().st_mtime_ns >= other.stat().st_mtime_ns


def _led(body: Body) -> bool:
    """Whether the body's animation leads its pins."""
    return bool(body.pins) and body.motion is not None


def group_files(body: Body) -> list[tuple[Group, str]]:
    """The groups of a body that something uses, once each, with the names of their files."""
    used = [*(pin.group for pin in body.pins), *(region.group for region in body.regions)]
    groups = {group.name: group for group in used}
    plain = plain_names(list(groups))
    return [(group, f"{body.name}_{name}.txt") for group, name in zip(groups.values(), plain, strict=True)]


def parameters(shot: Shot) -> dict[str, float]:
    """What a variation may change, with its value: parameters of the scene file, by name."""
    found = {"friction": shot.friction} if shot.friction > 0.0 else {}
    for body in shot.bodies:
        found[f"{body.name}_young"] = body.material.young
        found |= {f"{body.name}_speed_{axis}": v for axis, v in zip("xyz", body.velocity, strict=True)}
    return found


def scene_text(shot: Shot, places: Places) -> str:
    """The text of the scene file."""
    lines = ["    return Scene("]
    lines += _listed("bodies", [_body(body) for body in shot.bodies])
    lines += _listed("obstacles", [*_ground(shot), *(_obstacle(o, shot) for o in shot.obstacles)])
    lines += _listed("supports", [text for body in shot.bodies for text in _supports(body, shot)])
    if shot.gravity is not None:
        lines += _listed("loads", [f"Gravity({tuple(shot.gravity)!r})"])
    lines += _listed("pulls", [_pull(body, body.pull, shot) for body in shot.bodies if body.pull is not None])
    friction = ", Friction(friction)" if shot.friction > 0.0 else ""
    lines.append(f"        contact=(Barrier(){friction}{',' if not friction else ''}),")
    lines.append(f"        dt=1 / {shot.fps * shot.steps_a_frame:.17g},")
    lines += [f"        steps={shot.frames * shot.steps_a_frame},", "    )"]
    text = "\n".join(lines) + "\n"
    used = [name for name in IMPORTABLE if f"{name}(" in text]
    head = HEAD.format(
        name=places.blend.stem,
        source=shot.source,
        file=shlex.quote(places.scene.name),
        first=shot.first_frame,
        imports=", ".join(used),
        folder=places.folder.name,
        parameters="\n".join(f"    {name}={value!r}," for name, value in parameters(shot).items()),
        frames=shot.frames,
        fps=shot.fps,
        steps_a_frame=shot.steps_a_frame,
    )
    return head + text + TAIL


IMPORTABLE = (
    "Barrier",
    "Body",
    "Deforming",
    "Friction",
    "Gravity",
    "NeoHookean",
    "Plane",
    "PointCache",
    "Pull",
    "Region",
    "RenderMesh",
    "Rigid",
    "Scene",
    "Support",
    "VertexGroup",
)
"""What scene files take from pdvol, in order."""


def _listed(name: str, entries: list[str]) -> list[str]:
    indented = ["\n".join(f"            {line}" for line in entry.split("\n")) + "," for entry in entries]
    return [f"        {name}=(", *indented, "        ),"] if entries else []


def _material(material: Material, young: str) -> str:
    own = f"poisson={material.poisson!r}, density={material.density!r}, damping={material.damping!r}"
    return f"NeoHookean({young}, {own})"


def _group(body: Body, name: str, choice: str) -> str:
    (file,) = (file for group, file in group_files(body) if group.name == name)
    return f'VertexGroup(MESHES / "{body.name}.obj", MESHES / {file!r}, {choice})'


def _body(body: Body) -> str:
    shape = f"{body.name}_closed.obj" if body.repair else f"{body.name}.obj"
    drawn = [f'RenderMesh(MESHES / "{body.name}.obj")']
    drawn += [f'RenderMesh(MESHES / "{body.name}_render.obj")'] if body.rendered is not None else []
    lines = [
        "Body(",
        f'    MESHES / "{shape}",',
        f"    {_material(body.material, f'{body.name}_young')},",
        f"    vertices={body.vertices!r},",
        f'    name="{body.name}",',
        f"    velocity=({', '.join(f'{body.name}_speed_{axis}' for axis in 'xyz')}),",
    ]
    if body.regions:
        lines.append("    regions=(")
        for region in body.regions:
            material = _material(region.material, repr(region.material.young))
            lines.append(f"        Region({material}, {_group(body, region.group.name, 'filled=True')}),")
        lines.append("    ),")
    return "\n".join([*lines, f"    render=({', '.join(drawn)},),", ")"])


def _ground(shot: Shot) -> list[str]:
    if shot.ground is None:
        return []
    return [f'Plane((0.0, 0.0, {shot.ground!r}), (0.0, 0.0, 1.0), name="{GROUND}")']


def _cache(name: str, shot: Shot) -> str:
    return f'PointCache(MESHES / "{name}.pc2", fps={shot.fps!r}, faces=MESHES / "{name}.obj")'


def _obstacle(obstacle: Obstacle, shot: Shot) -> str:
    closed = "" if obstacle.shape.closed else ", closed=False"
    if obstacle.motion is None:
        return f'Rigid(MESHES / "{obstacle.name}.obj", name="{obstacle.name}"{closed})'
    return f'Deforming({_cache(obstacle.name, shot)}, name="{obstacle.name}"{closed})'


def _pull(body: Body, pull: Pull, shot: Shot) -> str:
    where, *points = (repr(tuple(map(float, point.round(9)))) for point in (pull.where, *pull.points))
    frames = f"range({pull.first}, {pull.first + len(points)})"
    keys = "".join(f"    {point},\n" for point in points)
    return f'Pull("{body.name}", {where}, [frame / {shot.fps!r} for frame in {frames}], [\n{keys}])'


def _supports(body: Body, shot: Shot) -> list[str]:
    motion = f", motion={_cache(body.name, shot)}" if _led(body) else ""
    return [
        f'Support({_group(body, pin.group.name, f"reach={pin.reach!r}")}, body="{body.name}"{motion})'
        for pin in body.pins
    ]
