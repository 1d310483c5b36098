"""A pdvol scene from a scene in PolyFEM's JSON."""

import math
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

from pdvol.errors import InputError
from pdvol.geometry.distances import is_closed
from pdvol.meshes import Solid
from pdvol.scene import (
    Barrier,
    Body,
    Deforming,
    FixedCorotational,
    Friction,
    Material,
    NeoHookean,
    Obstructing,
    Plane,
    Region,
    Rigid,
    Scene,
    Still,
    StVenantKirchhoff,
)
from pdvol.studio.imports.polyfem.conditions import Displaced, read_dirichlet, read_gravity, with_velocities
from pdvol.studio.imports.polyfem.document import Reading, Section, read_document
from pdvol.studio.imports.polyfem.geometry import Meshed, read_bodies, read_sequence, read_surfaces

INTEGRATORS_OF = {"ImplicitEuler": "implicit_euler", "BDF1": "implicit_euler", "BDF2": "bdf2"}
MOST_LAGGED = 100  # times that friction is lagged anew where PolyFEM sets no bound
MOST_LISTED = 5  # levels that a PolyFEM scene may be given


def polyfem_scene(file: Path) -> Callable[..., Scene]:
    """The `scene(levels=1)` of a PolyFEM file: the coarsest level is PolyFEM's mesh, the others refine it uniformly."""

    def scene(levels: int = 1) -> Scene:
        if not isinstance(levels, int) or not 1 <= levels <= MOST_LISTED:
            raise InputError(f"levels = {levels!r} must be a whole number from 1 to {MOST_LISTED}")
        document = read_document(file)
        made = _scene(document, levels)
        _say(file.name, document.reading)
        return made

    return scene


def _say(name: str, reading: Reading) -> None:
    """What was passed over and what differs, a line each on stderr; once a line."""
    ignored = sorted(set(reading.ignored))
    lines = [f"ignored, as it says how PolyFEM solves or writes: {', '.join(ignored)}"] if ignored else []
    for line in [*lines, *reading.notes]:
        _line(f"{name}: {line}")


@cache
def _line(line: str) -> None:
    print(line, file=sys.stderr)


def _scene(root: Section, levels: int) -> Scene:
    reading = root.reading
    dt, steps, start, integrator = _time(root)
    conditions = root.section("boundary_conditions")
    meshed, obstacle_sections = _geometries(root, levels)
    dim = meshed[0].levels[0].vertices.shape[1] if meshed else 3
    materials = read_materials(root, dim)
    supports, driven = read_dirichlet(conditions, meshed, dim, start)
    obstacles = _obstacles(obstacle_sections, reading.file.parent, driven, start)
    bodies = [_body(m, materials, reading) for m in meshed]
    bodies = with_velocities(root, bodies, meshed, dim)
    gravity = read_gravity(conditions, dim, start)
    conditions.close()
    solver = root.section("solver")
    contact = _contact(root.section("contact"), solver.section("contact"))
    advanced = solver.section("advanced")
    if not advanced.plain("lump_mass_matrix", False):
        reading.notes.append("PolyFEM's mass matrix is consistent here; pdvol's is lumped")
    if advanced.values:
        reading.ignored.append(advanced.path)
    solver.close()
    root.close()
    if not bodies:
        root.refuse("geometry", "no deformable mesh is left")
    reading.check()
    return Scene(
        bodies=tuple(b for b in bodies if b is not None),
        dt=dt,
        steps=steps,
        loads=gravity,
        supports=tuple(supports),
        obstacles=tuple(obstacles) if contact else (),
        contact=contact,
        integrator=integrator,
        elements="linear",
    )


def _time(root: Section) -> tuple[float, int, float, str]:
    """The step [s], how many, when the first begins [s], and the integrator."""
    if "time" not in root.values:
        root.refuse("time", "pdvol simulates motion; a static scene has none")
        return 1.0, 1, 0.0, "implicit_euler"
    time = root.section("time")
    start, given = time.plain("t0", 0.0), {key for key in ("tend", "dt", "time_steps") if key in time.values}
    end, dt, steps = time.plain("tend", 0.0), time.plain("dt", 0.0), time.plain("time_steps", 0)
    if len(given) < 2:
        root.refuse("time", "two of tend, dt and time_steps are expected")
    elif given >= {"tend", "dt"} and dt > 0.0:
        steps = math.ceil((end - start) / dt - 1e-9)
    elif "time_steps" in given and "dt" not in given and steps > 0:
        dt = (end - start) / steps
    if dt <= 0.0 or steps < 1:
        root.refuse("time", "gives no step of positive length")
        dt, steps = 1.0, 1
    chosen = time.get("integrator", "ImplicitEuler")
    name = chosen
    if isinstance(chosen, dict):
        name = f"BDF{chosen.get('steps', 1)}" if chosen.get("type") == "BDF" else chosen.get("type")
    if not isinstance(name, str) or name not in INTEGRATORS_OF:
        time.refuse("integrator", f"pdvol has {', '.join(INTEGRATORS_OF)}")
    time.close()
    return dt, steps, start, INTEGRATORS_OF.get(str(name), "implicit_euler")


def _geometries(root: Section, levels: int) -> tuple[list[Meshed], list[Section]]:
    """The deformable meshes, and the sections of the obstacles."""
    meshed, obstacles = [], []
    for number, entry in enumerate(root.sections("geometry"), 1):
        if not entry.plain("enabled", True):
            continue
        kind = entry.get("type", "mesh")
        if kind not in ("mesh", "mesh_array", "mesh_sequence", "plane", "ground"):
            entry.refuse("type", "pdvol reads mesh, mesh_array, mesh_sequence, plane and ground")
        elif entry.plain("is_obstacle", False) or kind in ("plane", "ground"):
            obstacles.append(entry)
        elif kind == "mesh_sequence":
            entry.refuse("type", "a mesh_sequence moves an obstacle; set is_obstacle to true")
        else:
            name = f"{Path(str(entry.get('mesh', 'body'))).stem} {number}"
            meshed += read_bodies(entry, root.reading.file.parent, name, levels)
    return meshed, obstacles


def _obstacles(
    entries: list[Section], folder: Path, driven: list[tuple[set[int] | None, Displaced]], start: float
) -> list[Obstructing]:
    obstacles: list[Obstructing] = []
    for number, entry in enumerate(entries, 1):
        kind = entry.get("type", "mesh")
        if kind == "mesh_sequence":
            frames = read_sequence(entry, folder, start)
            if frames is not None:
                obstacles.append(
                    Deforming(frames, name=f"sequence obstacle {number}", closed=is_closed(np.asarray(frames.faces)))
                )
            continue
        if kind in ("mesh", "mesh_array"):
            wanted = entry.get("surface_selection")
            if wanted is not None and not isinstance(wanted, int):
                entry.refuse("surface_selection", "PolyFEM's obstacles have one number")
            entry.only("volume_selection", (wanted, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9), "obstacles have no volume")
            motion = next((m for ids, m in driven if wanted is not None and (ids is None or wanted in ids)), None)
            for copy, surface in enumerate(read_surfaces(entry, folder)):
                name = f"{Path(str(entry.get('mesh'))).stem} obstacle {number}" + (f" copy {copy + 1}" if copy else "")
                obstacles.append(
                    Rigid(surface, motion=motion or Still(), name=name, closed=is_closed(surface.triangles))
                )
            continue
        if kind == "ground":
            height = entry.plain("height", 0.0)
            point, normal = (0.0, height, 0.0), (0.0, 1.0, 0.0)
        else:
            point, normal = (entry.get(key, ()) for key in ("point", "normal"))
        entry.close()
        try:
            obstacles.append(Plane(point, normal, name=f"plane {number}"))
        except (InputError, TypeError) as error:
            entry.refuse("point", str(error))
    return obstacles


def _body(meshed: Meshed, materials: dict[int | None, Material], reading: Reading) -> Body | None:
    missing = [n for n in meshed.numbers if n not in materials and None not in materials]
    if missing:
        if not reading.refused:
            reading.refuse(meshed.path, missing[0], "no material has this volume number as its id")
        return None
    of = {n: materials.get(n, materials.get(None)) for n in meshed.numbers}
    main, *others = meshed.numbers
    shapes = tuple(Solid(s.vertices, s.cells, s.regions) for s in meshed.levels)
    regions = tuple(Region(of[n], n) for n in others)  # type: ignore[arg-type]
    return Body(shapes, of[main], name=meshed.name, regions=regions)  # type: ignore[arg-type]


def _contact(contact: Section, solving: Section) -> tuple[Barrier | Friction, ...]:
    enabled, dhat = contact.plain("enabled", False), contact.plain("dhat", 1e-3)
    mu, speed = contact.plain("friction_coefficient", 0.0), contact.plain("epsv", 1e-3)
    contact.section("adhesion").only("adhesion_enabled", (False,), "pdvol has no adhesion")
    lagged = solving.plain("friction_iterations", 1)
    solving.close()
    contact.close()
    if not enabled:
        return ()
    barrier = Barrier(dhat=dhat)
    if mu <= 0.0 or lagged == 0:
        return (barrier,)
    return barrier, Friction(mu, eps_v=speed, iterations=lagged if lagged > 0 else MOST_LAGGED)


LAWS_OF = {"NeoHookean": NeoHookean, "FixedCorotational": FixedCorotational, "SaintVenant": StVenantKirchhoff}


def read_materials(root: Section, dim: int) -> dict[int | None, Material]:
    """Materials by volume number; by None where one holds for all."""
    found: dict[int | None, Material] = {}
    entries = root.sections("materials")
    for entry in entries:
        kind = entry.get("type")
        if kind not in LAWS_OF:
            entry.refuse("type", f"pdvol has {', '.join(LAWS_OF)}")
            continue
        ids = entry.wholes("id", 0)
        try:
            material = _material(entry, LAWS_OF[kind], dim)
        except (InputError, ZeroDivisionError) as error:
            entry.refuse("type", f"its parameters are not those of a stable solid ({error})")
            continue
        found.update(dict.fromkeys(ids, material))
        if len(entries) == 1:
            found[None] = material
    return found


def _material(entry: Section, law: type[Material], dim: int) -> Material:
    """One material; raises InputError or ZeroDivisionError where its parameters are none of a stable solid."""
    density = entry.plain("rho", 1.0)
    if {"lambda", "mu"} <= set(entry.values):
        first, shear = entry.plain("lambda", 0.0), entry.plain("mu", 1.0)
    else:
        young, poisson = entry.plain("E", 1.0), entry.plain("nu", 0.0)
        shear = young / (2.0 * (1.0 + poisson))
        # PolyFEM takes E and nu of a 2D scene as those of a thin sheet
        across = 1.0 - 2.0 * poisson if dim == 3 else 1.0 - poisson
        first = young * poisson / ((1.0 + poisson) * across)
    entry.close()
    return law(shear * (3.0 * first + 2.0 * shear) / (first + shear), first / (2.0 * (first + shear)), density)
