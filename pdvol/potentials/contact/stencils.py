"""Contacts as arrays: the vertices that a contact joins and their coefficients.

The gap vector of a contact is g = sum_i c_i x_i over up to four vertices, its distance is |g|. With constant
coefficients the distance's gradient is exact, because closest points are stationary.
"""

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from pdvol.compiled import pointer
from pdvol.potentials.contact.native import ffi, library


@dataclass(frozen=True)
class Stencils:
    """k contacts. One with fewer than four vertices repeats its first one, with coefficient zero.

    Attributes
    ----------
    vertices : (k, 4) int32
        Of the contact surface.
    coefficients : (k, 4)
    gaps : (k, d) gap vectors [m]
    weights : (k,)
        Area [m^(d-1)], or count; of edges that cross it depends on positions.
    counted : (k,) bool
        Contacts that count in sums of this rank: each counts on one rank, and is known to every rank that owns a vertex
        of it.
    fading : (f,) int64
        Contacts whose weights change with the positions.
    fades : (f, 4, 3)
        Derivatives of their weights by the positions of their vertices.
    curves : (f, 10, 3, 3)
        Their second derivatives, blocks on or right of the diagonal.
    """

    vertices: np.ndarray
    coefficients: np.ndarray
    gaps: np.ndarray
    weights: np.ndarray
    counted: np.ndarray
    fading: np.ndarray
    fades: np.ndarray
    curves: np.ndarray

    def __len__(self) -> int:
        return len(self.weights)

    @classmethod
    def room(cls, count: int, faded: int, d: int) -> "Stencils":
        """Memory for so many contacts, and for those whose weights change, in d dimensions; nothing is set."""
        return cls(
            np.empty((count, 4), dtype=np.int32),
            np.empty((count, 4)),
            np.empty((count, d)),
            np.empty(count),
            np.empty(count, dtype=bool),
            np.empty(faded, dtype=np.int64),
            np.empty((faded, 4, 3)),
            np.empty((faded, 10, 3, 3)),
        )

    @cached_property
    def c(self) -> Any:
        """The C struct of all this, which must be kept."""
        struct = ffi.new("contacts_t *")
        struct.count, struct.faded = len(self.weights), len(self.fading)
        struct.vertices, struct.fading = pointer(self.vertices, "int32_t"), pointer(self.fading, "int64_t")
        struct.counted = pointer(self.counted, "uint8_t")
        struct.coefficients, struct.gaps = pointer(self.coefficients), pointer(self.gaps)
        struct.weights, struct.fades, struct.curves = map(pointer, (self.weights, self.fades, self.curves))
        return struct

    def first(self, count: int, faded: int) -> "Stencils":
        """The first contacts, and the first of those whose weights change, as arrays of their own."""
        ends = (count,) * 5 + (faded,) * 3
        return Stencils(*(getattr(self, f.name)[:end].copy() for f, end in zip(fields(self), ends, strict=True)))

    def gaps_of(self, values: np.ndarray) -> np.ndarray:
        """(k, d) combinations of values (n, d) at the surface's vertices, as gap vectors are of positions."""
        return np.einsum("ki,kid->kd", self.coefficients, values[self.vertices])

    def objects_in_contact(self, objects: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The two objects, (k,) each, that touch in each contact, from the object (n,) of each vertex. They are equal
        where a body touches itself.

        The first vertex of a contact lies on one side. The other side is the first among the other vertices' objects
        that differs from it.
        """
        first, *others = objects[self.vertices].T
        second = others[-1]
        for candidate in others[-2::-1]:
            second = np.where(candidate != first, candidate, second)
        return first, second

    def scatter(self, forces: np.ndarray, count: int) -> np.ndarray:
        """(count, d) forces [N] at the surface's vertices, from forces (k, d) on the gaps: the transpose of
        `gaps_of`.
        """
        out = np.zeros((count, forces.shape[1]))
        library().scatter(forces.shape[1], self.c, pointer(np.ascontiguousarray(forces)), pointer(out))
        return out
