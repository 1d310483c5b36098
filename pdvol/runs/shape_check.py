"""Shapes of bodies and files of meshes, read and judged before anything is built of them."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from pdvol.errors import InputError, IntersectionError
from pdvol.meshes import Outline, Solid, Surface
from pdvol.meshing.cpu_budget import cpu_budget
from pdvol.meshing.readers import read_with_notes
from pdvol.meshing.tetrahedralise import mean_ratio
from pdvol.meshing.verdict import check_place, judge, place_of
from pdvol.meshing.vtu import write_primitives
from pdvol.scene import Scene
from pdvol.stages import stage

USUAL_SIZES = 1e-3, 30.0  # m across: a grain, the longest animal
NAMED_CELLS = 5  # worst cells that are listed for each level


def write_crossings(out: Path | None, errors: Sequence[InputError | None]) -> None:
    """`out/defects.vtu`: what crosses in shapes, numbered by where in `errors` it stands; nothing if nothing does."""
    places = [(c, number) for number, error in enumerate(errors, 1) for c in getattr(error, "corners", ())]
    if out is not None and places:
        with writable(out):
            write_primitives(out / "defects.vtu", *zip(*places, strict=True))


@contextmanager
def writable(out: Path) -> Iterator[None]:
    """A folder to write into; what fails is an InputError."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        raise InputError(f"{out} cannot be written: {error.strerror}") from None


def check_meshes(files: Sequence[Path], out: Path | None = None) -> dict:
    """Read and validate mesh files.

    Parameters
    ----------
    files : of surfaces and volume meshes
    out : folder for `defects.vtu`, the primitives of all crossings with a file's number from 1 as `defect`; none is
        written if None

    Returns
    -------
    dict
        `sound`, and `files`: a list of objects with `file`, `sound`, `message` (one line) and `notes` (lines).
    """
    entries, errors = [], list[InputError | None]()
    for file in files:
        errors.append(None)
        notes = list[str]()
        try:
            with cpu_budget(), stage(f"checking {file}"):
                message = _check_mesh(file, notes)
        except InputError as error:
            message, errors[-1] = f"defect: {error}", error
        notes = [f"note: {file}: {note}" for note in notes]
        entries.append({"file": str(file), "sound": errors[-1] is None, "message": message, "notes": notes})
    write_crossings(out, errors)
    return {"sound": all(entry["sound"] for entry in entries), "files": entries}


def _check_mesh(file: Path, notes: list[str]) -> str:
    """The size of a sound mesh in words. Notes are added also where a defect is raised."""
    read, found = read_with_notes(file)
    notes += found
    check_place(points := place_of(read), str(file))
    notes += _unit_notes(points)
    shape, _, found = judge(read, str(file))
    notes += found
    low, high = (f"({', '.join(f'{x:.3g}' for x in end(place_of(shape), axis=0))})" for end in (np.min, np.max))
    return f"{file}: from {low} to {high} m, {_in_words(shape)}, sound"


def _in_words(shape: Outline | Surface | Solid) -> str:
    if isinstance(shape, Outline):
        return f"outline of {len(shape.points):,} points"
    if isinstance(shape, Surface):
        return f"surface of {len(shape.vertices):,} vertices, {len(shape.triangles):,} triangles"
    quality = mean_ratio(shape.vertices, shape.cells)
    worst = ", ".join(f"{c} ({quality[c]:.2f})" for c in np.argsort(quality, kind="stable")[:NAMED_CELLS])
    return (
        f"{len(shape.vertices):,} vertices, {len(shape.cells):,} cells, regions"
        f" {sorted(set(shape.regions.tolist()))}, worst cells (mean ratio) {worst}"
    )


def _unit_notes(points: np.ndarray, scale: float = 1.0) -> Iterator[str]:
    """A line where a shape of points (n, d) [m], scaled so, is so large or small that its unit may be another one."""
    size = float(np.linalg.norm(np.ptp(points, axis=0))) if len(points) else 1.0
    units = {"millimetres": 1e-3, "centimetres": 1e-2} if size > USUAL_SIZES[1] else {"kilometres": 1e3}
    if not USUAL_SIZES[0] <= size <= USUAL_SIZES[1]:
        scales = (f"Placement(scale={by * scale:g}) of {unit} makes it {by * size:.3g} m" for unit, by in units.items())
        yield f"{size:.3g} m across; lengths are metres: {', '.join(scales)}"


def shape_notes(scene: Scene) -> list[str]:
    """What is worth knowing of the bodies' shapes, and of how they were read, in lines; InputError as `judge`."""
    lines = []
    for body in scene.bodies:
        for shape in body.shape if isinstance(body.shape, (tuple, list)) else (body.shape,):
            name = f"body {body.name!r}"
            with stage(f"checking the shape of {name}"):
                read, notes = read_with_notes(shape)
                check_place(points := body.placement(place_of(read)), name)
                notes += _unit_notes(points, body.placement.scale)
                try:
                    lines += [f"{name}: {note}" for note in notes + judge(read, name)[2]]
                except IntersectionError as error:
                    error.corners = [body.placement(corners) for corners in error.corners]
                    raise
    return list(dict.fromkeys(lines))
