"""A PolyFEM scene as it is read: its JSON over that of its `common` file, and what of it has no counterpart."""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pdvol.errors import InputError, SeveralErrors

MOST_COMMON = 20  # files that inherit from each other: more are a circle
SHOWN_VALUE = 60  # characters of a value in a message
IGNORED = (
    "output", "tests", "root_path", "units.characteristic_length", "solver.linear", "solver.adjoint_linear",
    "solver.nonlinear", "solver.augmented_lagrangian", "solver.max_threads", "solver.contact.CCD",
    "solver.contact.friction_convergence_tol", "solver.contact.initial_barrier_stiffness",
    "solver.contact.barrier_stiffness", "solver.advanced", "space.advanced", "contact.dhat_percentage", "authors",
    "preset",
)  # fmt: skip
"""Keys that say how PolyFEM solves or what it writes: they do not change what is simulated."""
ACCEPTED: dict[str, tuple[tuple, str]] = {
    "boundary_conditions.dirichlet_boundary.interpolation": (([],), "pdvol reads the value alone"),
    "boundary_conditions.dirichlet_boundary.time_reference": (([],), "pdvol reads values as expressions of t"),
    "boundary_conditions.obstacle_displacements.interpolation": (([],), "pdvol reads the value alone"),
    "boundary_conditions.obstacle_displacements.time_reference": (([],), "pdvol reads values as expressions of t"),
    "contact.collision_mesh": (({"enabled": False},), "pdvol's contact acts on the surfaces of the bodies"),
    "contact.periodic": ((False,), "pdvol has no counterpart"),
    "contact.use_adaptive_dhat": ((False,), "pdvol has no counterpart"),
    "contact.use_convergent_formulation": ((False, True), "only true or false is understood here"),
    "contact.use_gcp_formulation": ((False,), "pdvol has no counterpart"),
    "geometry.advanced.force_linear_geometry": ((False,), "pdvol reads quadratic cells by their corners"),
    "geometry.advanced.min_component": ((-1,), "pdvol has no counterpart"),
    "geometry.advanced.refinement_location": ((0.5,), "pdvol halves edges"),
    "geometry.curve_selection": (([],), "pdvol reads selections of surfaces and volumes"),
    "geometry.point_selection": (([],), "pdvol reads selections of surfaces and volumes"),
    "geometry.surface_selection.boundary_only": ((True,), "pdvol's supports begin at the boundary"),
    "geometry.unit": (("", "m"), "pdvol's lengths are metres; give the mesh in metres"),
    "geometry.volume_selection.boundary_only": ((True,), "pdvol's supports begin at the boundary"),
    "initial_conditions.acceleration": (([],), "pdvol starts at rest positions, with a velocity alone"),
    "initial_conditions.solution": (([],), "pdvol starts at rest positions, with a velocity alone"),
    "materials.phi": ((0,), "pdvol's damping is of another kind"),
    "materials.psi": ((0,), "pdvol's damping is of another kind"),
    "solver.rayleigh_damping": (([],), "pdvol's damping is of another kind"),
    "space.basis_type": (("Lagrange",), "pdvol's elements are Lagrangian"),
    "space.discr_order": ((1,), "pdvol's elements are linear"),
    "space.use_p_ref": ((False,), "pdvol's elements are linear"),
    "time.quasistatic": ((False,), "pdvol always has inertia"),
    "units.length": (("m",), "pdvol's unit is m"),
    "units.mass": (("kg",), "pdvol's unit is kg"),
    "units.time": (("s",), "pdvol's unit is s"),
}
"""Keys of which pdvol has these values alone, and the reason; numbers in lists are left out of their paths."""
_WORDS = {bool: "true or false", int: "a whole number", float: "a number"}
_Value = TypeVar("_Value", bool, int, float)


@dataclass
class Reading:
    """What was found on the way.

    Attributes
    ----------
    file : of the scene
    refused : one line for each thing that pdvol does not have
    ignored : keys that were passed over
    notes : one line for each difference between the two programs that the scene meets
    """

    file: Path
    refused: list[str] = field(default_factory=list)
    ignored: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def refuse(self, path: str, value: Any, lack: str) -> None:
        """Note one thing that pdvol does not have."""
        text = json.dumps(value, default=str)
        shown = text if len(text) <= SHOWN_VALUE else f"{text[: SHOWN_VALUE - 3]}..."
        self.refused.append(f"{path} = {shown}: {lack}")

    def check(self) -> None:
        """SeveralErrors with a line for each thing that was refused."""
        if self.refused:
            raise SeveralErrors(f"{self.file.name}: {line}" for line in dict.fromkeys(self.refused))


class Section:
    """An object of the JSON. Keys that nobody asks for are refused at the end, unless a table above has them."""

    def __init__(self, reading: Reading, path: str, values: Any):
        self.reading, self.path = reading, path
        if not isinstance(values, dict):
            reading.refuse(path or "the file", values, "an object {...} is expected here")
            values = {}
        self.values: dict[str, Any] = values
        self._asked: set[str] = set()

    def at(self, key: str) -> str:
        """The path of a key, as in `contact.dhat`."""
        return f"{self.path}.{key}" if self.path else key

    def refuse(self, key: str, lack: str) -> None:
        """Note that pdvol does not have what a key says."""
        self.reading.refuse(self.at(key), self.values.get(key), lack)

    def get(self, key: str, default: Any = None) -> Any:
        """The value of a key; null counts as left out."""
        self._asked.add(key)
        value = self.values.get(key)
        return default if value is None else value

    def plain(self, key: str, default: _Value) -> _Value:
        """True or false, a whole number, or any number, as the default is."""
        value, kind = self.get(key, default), type(default)
        if not is_a(value, kind):
            self.refuse(key, f"only {_WORDS[kind]} is understood here")
            return default
        return kind(value)

    def wholes(self, key: str, default: Any, lack: str = "whole numbers are expected here") -> list[int]:
        """The whole numbers of a list; a single one may stand without its list."""
        value = self.get(key, default)
        listed = value if isinstance(value, list) else [value]
        if not all(is_a(number, int) for number in listed):
            self.refuse(key, lack)
            return []
        return listed

    def array(self, key: str, shape: tuple[int, ...], lack: str = "") -> np.ndarray:
        """Numbers in an array of this shape; zeros where there are no such ones."""
        given: Any = self.get(key)
        try:
            found = np.asarray(given, dtype=float)
        except (TypeError, ValueError):
            found = np.zeros(0)
        if found.shape != shape:
            self.refuse(key, lack or f"{shape[0]} numbers are expected here")
            return np.zeros(shape)
        return found

    def only(self, key: str, accepted: tuple, lack: str) -> None:
        """Refuse any value but these (and none)."""
        value = self.get(key)
        if value is not None and value not in accepted:
            self.refuse(key, lack)

    def section(self, key: str) -> "Section":
        """An object within; empty where left out."""
        return Section(self.reading, self.at(key), self.get(key, {}))

    def sections(self, key: str) -> list["Section"]:
        """The objects of a list; a single one may stand without its list."""
        value = self.get(key, [])
        listed = value if isinstance(value, list) else [value]
        return [Section(self.reading, f"{self.at(key)}[{i}]", entry) for i, entry in enumerate(listed)]

    def close(self) -> None:
        """Look at the keys that nobody has read: refuse those that pdvol has no counterpart of, or not the value."""
        for key, value in self.values.items():
            path = re.sub(r"\[\d+\]", "", self.at(key))
            if key in self._asked or value is None:
                continue
            if path in IGNORED:
                self.reading.ignored.append(self.at(key))
            elif path in ACCEPTED:
                self.only(key, *ACCEPTED[path])
            elif any(known.startswith(f"{path}.") for known in ACCEPTED):
                self.section(key).close()
            else:
                self.refuse(key, "pdvol has no counterpart of this key")


def is_a(value: Any, kind: type) -> bool:
    """Whether a value of the JSON is of a kind; whole numbers are numbers, and true and false are none."""
    return isinstance(value, (int, float) if kind is float else kind) and isinstance(value, bool) == (kind is bool)


def read_document(file: Path) -> Section:
    """The JSON of a scene over that of the files it inherits from by `common`.

    Raises
    ------
    InputError
        A file is missing or no JSON, or the files inherit in a circle.
    """
    merged: dict = {}
    for values in _chain(file):
        merged = _over(merged, values)
    merged.pop("common", None)
    return Section(Reading(file), "", merged)


def _chain(file: Path) -> Iterator[dict]:
    """The values of a file under those that it inherits, the file itself first."""
    for _ in range(MOST_COMMON):
        values = _parsed(file)
        yield values
        common = values.get("common")
        if not common:
            return
        if not isinstance(common, str):
            raise InputError(f"{file.name}: common = {common!r} must be the path of a JSON file")
        file = file.parent / common
    raise InputError(f"{file.name}: more than {MOST_COMMON} files inherit from each other by common: is it a circle?")


def _parsed(file: Path) -> dict:
    try:
        values = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror}); check the path") from error
    except (ValueError, RecursionError) as error:  # the first one covers broken JSON and broken UTF-8
        raise InputError(f"{file}: is not JSON: {' '.join(str(error).split())[:160]}") from error
    if not isinstance(values, dict):
        raise InputError(f"{file}: a PolyFEM scene is an object {{...}}, not {type(values).__name__}")
    return values


def _over(first: dict, second: dict) -> dict:
    """The keys of both; where both have one, that of `first`, and objects key by key."""
    merged = dict(second)
    for key, value in first.items():
        below = merged.get(key)
        merged[key] = _over(value, below) if isinstance(value, dict) and isinstance(below, dict) else value
    return merged
