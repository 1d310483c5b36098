"""What may touch: candidate pairs of primitives, found by one search and kept while they stay complete (Verlet lists);
and what does: the contacts nearer than dhat, and the largest step without a collision.

Pairs within an object and pairs between objects have a list each (pair_list.py). The pairs of all lists have one order,
whatever was searched. So sums over active pairs do not depend on the lists, and lists may outlast steps.

On several ranks each list has the pairs that touch vertices of its rank, and all pairs of a vertex that has one of
those: all contacts of the rank's vertices are found without a message.
"""

import numpy as np
from mpi4py import MPI

from pdvol.compiled import ffi, pointer
from pdvol.potentials.contact.pair_list import PairList
from pdvol.potentials.contact.surface import ContactSurface
from pdvol.potentials.potential import LEAST_LEFT, same

# contact_t and fade_t of pdvol/native/interface.h
CONTACT = np.dtype(
    {
        "names": ["vertices", "coefficients", "gap", "weight", "pressure", "counted"],
        "formats": ["4i4", "4f8", "3f8", "f8", "f8", "?"],
    },
    align=True,
)
FADE = np.dtype({"names": ["contact", "first", "second"], "formats": ["i8", "(4,3)f8", "(10,3,3)f8"]}, align=True)
# meeting_t of pdvol/native/interface.h
MEETING = np.dtype(
    {
        "names": ["pair", "vertices", "coefficients", "normal", "weight", "time", "distance", "gap", "expected"],
        "formats": ["3i4", "4i4", "4f8", "3f8", "f8", "f8", "f8", "f8", "f8"],
    },
    align=True,
)
POINT, EDGES = 0, 1  # kinds of pairs that meet, as in ways.c


class Contacts:
    """k contacts at some positions of a surface, their energy and its gradient. A contact with fewer than four vertices
    repeats its first one, with coefficient zero.

    Parameters
    ----------
    contacts : (k,) of CONTACT
    fades : (f,) of FADE
        The derivatives of those weights that change with the positions, by the positions of a contact's four vertices:
        the first ones, and the blocks on or right of the diagonal of the second ones.
    d : dimension
    of_bodies : number of the surface's vertices that are of bodies

    Attributes
    ----------
    vertices : (k, 4) int32
        Of the contact surface.
    coefficients : (k, 4)
    gaps : (k, d) gap vectors [m]; zero where a vertex is behind a plane
    weights : (k,) area [m^(d-1)]
    pressures : (k,) [Pa]
        Minus the law's derivative by the gap.
    counted : (k,) bool
        Contacts that count in sums of this rank: each counts on one rank, and is known to every rank that owns a vertex
        of it.
    half_spaces : how many contacts are with planes; these are the first
    energy : [J], of those that count here
    gradient : (n, d) [N], by the surface's vertices; by obstacles' of the contacts that count here, so ranks add up
    """

    def __init__(
        self,
        contacts: np.ndarray,
        fades: np.ndarray,
        d: int,
        of_bodies: int,
        half_spaces: int = 0,
        energy: float = 0.0,
        gradient: np.ndarray | None = None,
    ):
        self.contacts, self.fades, self.half_spaces, self.energy = contacts, fades, half_spaces, energy
        self.gradient = np.empty((0, d)) if gradient is None else gradient
        self.vertices, self.coefficients, self.gaps = (
            contacts["vertices"],
            contacts["coefficients"],
            contacts["gap"][:, :d],
        )
        self.weights, self.pressures, self.counted = contacts["weight"], contacts["pressure"], contacts["counted"]
        self.c = ffi.new("contacts_t *")
        self.c.count, self.c.faded, self.c.half_spaces = len(contacts), len(fades), half_spaces
        self.c.of_bodies = of_bodies
        self.c.contacts, self.c.fades = pointer(contacts, "contact_t"), pointer(fades, "fade_t")

    def __len__(self) -> int:
        return len(self.contacts)

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


class Candidates:
    """What may touch on a contact surface.

    Parameters
    ----------
    dhat : distance [m] up to which pairs matter

    Attributes
    ----------
    lists : the candidates within bodies and between objects
    """

    def __init__(self, surface: ContactSurface, dhat: float):
        self.surface, self.primitives, self.dhat = surface, surface.primitives, dhat
        self.lists = tuple(PairList(self.primitives, dhat, within) for within in (True, False))
        self._c_lists = ffi.new("pairs_t *[]", [pairs.pairs.c for pairs in self.lists])
        self._of = surface.space.dim, len(surface.surface)
        self._buffers = Contacts(np.empty(1024, CONTACT), np.empty(256, FADE), *self._of)
        self._meetings = np.empty(256, MEETING)
        self._reach = np.full(len(surface.objects), np.inf)  # planes, behind all else, have no edges
        self._reach[: len(self.primitives.objects)] = self.primitives.edge_lengths[self.primitives.objects]
        # the last way on which nothing met, and its share
        self._clear: tuple[np.ndarray, np.ndarray, float] | None = None

    def contacts(self, vertices: np.ndarray, kappa: float) -> Contacts:
        """The contacts nearer than dhat at positions (n, d) that touch this rank's vertices, and some of others that do
        not count, with the barrier of stiffness `kappa` [Pa]. First come those with planes, then those of points, list
        by list, and then those of edges. Their order does not depend on ranks.
        """
        for pairs in self.lists:
            pairs.at(vertices)
        gradient, counts, energy = np.empty(vertices.shape), np.empty(3, dtype=np.int64), ffi.new("double *")
        while True:
            if self.primitives.loops.find_contacts(
                self.primitives.c,
                pointer(vertices),
                self.dhat,
                kappa,
                len(self.lists),
                self._c_lists,
                self._buffers.c,
                pointer(counts, "int64_t"),
                energy,
                pointer(gradient),
            ):
                raise MemoryError("no memory left for contacts")
            count, faded, half_spaces = counts.tolist()
            if count <= self._buffers.c.count and faded <= self._buffers.c.faded:
                found = self._buffers.contacts[:count].copy(), self._buffers.fades[:faded].copy()
                return Contacts(*found, *self._of, half_spaces, energy[0], gradient)
            self._buffers = Contacts(np.empty(2 * count, CONTACT), np.empty(2 * faded + 256, FADE), *self._of)

    def meetings(self, start: np.ndarray, end: np.ndarray, gap_share: float = LEAST_LEFT) -> np.ndarray:
        """(k,) of MEETING: the pairs that would keep less than the share `gap_share` of their gap, or of dhat, on the
        straight paths from start to end (n, d); of each vertex, and of each edge, the first. Those that are farther
        apart at the start than edges are long are none: nothing shows yet where they will meet. Collective.
        """
        for pairs in self.lists:
            pairs.along(start, end)
        count, found, primitives = 1, self._meetings[:0], self.primitives
        while count > len(found):
            found = self._meetings = np.empty(max(2 * count, len(self._meetings)), MEETING)
            count = primitives.loops.find_meetings(
                primitives.c,
                pointer(start),
                pointer(end),
                self.dhat,
                gap_share,
                len(self.lists),
                self._c_lists,
                len(found),
                pointer(found, "meeting_t"),
            )
            for pairs in self.lists:
                pairs.pairs.go_on(start, end)
        found = found[:count]
        return found[self._are_first(found) & (found["distance"] < self._reach[found["vertices"]].min(axis=1))]

    def _are_first(self, found: np.ndarray) -> np.ndarray:
        """Mask of meetings that are the first of their vertex or one of their edges, or with planes. Collective."""
        kind, one, other = found["pair"].T
        vertices = len(self.primitives.objects)
        first = np.ones(vertices + len(self.primitives.edges))
        places = [(kind == POINT, one), (kind == EDGES, vertices + one), (kind == EDGES, vertices + other)]
        for of_kind, place in places:
            np.minimum.at(first, place[of_kind], found["time"][of_kind])
        first = self.surface.space.reduce(first, MPI.MIN)
        kept = (kind != POINT) & (kind != EDGES)
        for of_kind, place in places:
            kept[of_kind] |= found["time"][of_kind] <= first[place[of_kind]]
        return kept

    def max_step(self, start: np.ndarray, end: np.ndarray, gap_share: float = LEAST_LEFT) -> float:
        """Largest step in [0, 1] along straight paths from start to end (n, d) at which this rank's vertices stay in
        front of planes, and all its pairs apart, and keep at least the share `gap_share` of their gap, or of dhat where
        that is less.
        """
        if self._is_known_clear(start, end, gap_share):
            return 1.0
        return self._additive_step(start, end, gap_share)

    def is_clear(self, start: np.ndarray, end: np.ndarray, gap_share: float = LEAST_LEFT) -> bool:
        """Whether `meetings` would find nothing of this rank on the straight paths from start to end (n, d)."""
        clear = (
            self._is_known_clear(start, end, gap_share) or self._additive_step(start, end, gap_share, whole=True) == 1.0
        )
        self._clear = (start, end, gap_share) if clear else self._clear
        return clear

    def _is_known_clear(self, start: np.ndarray, end: np.ndarray, gap_share: float) -> bool:
        if self._clear is None:
            return False
        *way, share = self._clear
        return share == gap_share and all(map(same, way, (start, end)))

    def _additive_step(self, start: np.ndarray, end: np.ndarray, gap_share: float, whole: bool = False) -> float:
        """The step by conservative advancement; `whole` says that only a step of 1 is of interest."""
        # The pairs that are near stop most moves early. What else may meet is searched for on the way until then.
        way = pointer(start), pointer(end)
        step = self.primitives.loops.half_space_step(self.primitives.c, *way, self.dhat, gap_share)
        for pairs in self.lists:
            step = pairs.longest_step(start, end, gap_share, step)
        if whole and step < 1.0:
            return step
        searches = [pairs.searches for pairs in self.lists]
        for pairs in self.lists:
            pairs.along(start, end if step == 1.0 else start + step * (end - start))
        for pairs, before in zip(self.lists, searches, strict=True):
            if pairs.searches > before:
                step = pairs.longest_step(start, end, gap_share, step)
        return step
