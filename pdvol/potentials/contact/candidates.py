"""What may touch: candidate pairs of primitives, found by one search and kept while they stay complete (Verlet lists);
and what does: the contacts nearer than dhat, and the largest step without a collision.

Pairs within an object and pairs between objects have a list each. No distance within an object changes while it is
shifted as a whole, and none between two objects that are shifted alike. A list that was searched at one place is
complete while no two primitives can have approached each other by more than twice the slack, or come from far away. A
longer straight move is searched as a whole, by the boxes that it sweeps: its list is as complete near every place on
it. What two places near the move have between them is near it, too.

The pairs of all lists have one order, whatever was searched. So sums over active pairs do not depend on the lists, and
lists may outlast steps.

On several ranks each list has the pairs that touch vertices of its rank, and all pairs of a vertex that has one of
those: all contacts of the rank's vertices are found without a message.
"""

import numpy as np
from mpi4py import MPI

from pdvol.compiled import pointer
from pdvol.potentials.contact.native import ffi, library
from pdvol.potentials.contact.surface import ContactSurface, Primitives
from pdvol.potentials.potential import LEAST_LEFT

# slack, in median edge lengths: longer lists cost more in every evaluation, shorter ones are searched more often
LIST_SLACK = 0.1
# numbers of a box: least coordinates and greatest ones with the opposite sign, four each; as in search.c
BOX = 8


class PairList:
    """Pairs of vertices and facets, and of edges, that can be within reach of each other, with lower bounds of their
    distances. A bound is the distance that the search or a collision detection has found, less how much nearer the pair
    can have come since then.

    Parameters
    ----------
    primitives : Primitives
    reach : distance [m] up to which pairs matter
    within : whether for the pairs within bodies; else for those between two bodies, or a body and an obstacle

    Attributes
    ----------
    points : (k, 2) int32
        Vertex and facet of each pair; the pairs of a vertex stand together.
    edges : (k, 2) int32
    c : the C struct of both, with their bounds
    empty : bool
        Whether no pairs are possible at all.
    searches : number of searches so far
    """

    def __init__(self, primitives: Primitives, reach: float, within: bool):
        self.primitives, self.reach, self.within, self.searches = primitives, reach, within, 0
        numbers, owned = np.arange(len(primitives.roots) - 1), primitives.owned_objects
        same = numbers[:, None] == numbers
        self._allowed = same & owned if within else ~same & (owned[:, None] | owned)
        self._needed, self.empty = self._allowed.any(axis=0), not self._allowed.any()
        self._slack = LIST_SLACK * primitives.edge_length
        self._boxes: np.ndarray = np.zeros((primitives.boxes, BOX))
        self._counts = np.bincount(primitives.objects, minlength=len(numbers))
        self._firsts = np.cumsum([0, *self._counts])
        self._c_firsts = pointer(self._firsts, "int64_t")
        self._boxed: tuple[np.ndarray, np.ndarray] | None = None
        self._reference: tuple[np.ndarray, np.ndarray | None] | None = None  # start, and what it moves by
        self._room: np.ndarray = np.zeros((len(numbers), len(numbers)))  # how far two objects may approach each other
        self._way: tuple[np.ndarray, np.ndarray]  # of the bounds, from and to
        self.c = ffi.new("pairs_t *")
        self._make_room(1024, 1024)
        self.points, self.edges = (pairs[:0] for pairs in self._pairs)

    def at(self, vertices: np.ndarray) -> None:
        """Makes the list complete at `vertices` (n, d)."""
        if not self.empty and not self._covers(vertices):
            self._search(vertices, vertices)

    def along(self, start: np.ndarray, end: np.ndarray) -> None:
        """Makes the list complete everywhere on the straight move from start to end (n, d)."""
        if self.empty or (self._covers(start) and self._covers(end)):
            return
        if self.within:  # what a body goes as a whole sweeps nothing within it
            n, shifts = self._firsts[-1], self._centres(end) - self._centres(start)
            end = end.copy()
            end[:n] -= shifts[self.primitives.objects]
        self._search(start, end)

    def _centres(self, vertices: np.ndarray) -> np.ndarray:
        """(objects, d) mean of each object's vertices."""
        sums = np.add.reduceat(vertices[: self._firsts[-1]], self._firsts[:-1], axis=0)
        return sums / self._counts[:, None]

    def _covers(self, vertices: np.ndarray) -> bool:
        """Whether no two objects can have come nearer to each other at `vertices` than there is room, nor parts of one,
        since a place on the move that the list was searched for.
        """
        if self._reference is None:
            return False
        start, move = self._reference
        way = ffi.NULL if move is None else pointer(move)
        places, room = (pointer(start), way, pointer(vertices)), pointer(self._room)
        return bool(library.are_near(self.primitives.d, len(self._counts), self._c_firsts, *places, room))

    @property
    def _distance(self) -> float:
        return self.reach + 2.0 * self._slack

    def _fit(self, start: np.ndarray, end: np.ndarray) -> None:
        """Fits the boxes of what is not where it was when they were fitted last."""
        marked = self._needed
        if self._boxed is not None:
            same = (self._boxed[0] == start).all(axis=1) & (self._boxed[1] == end).all(axis=1)
            marked = marked & ~np.logical_and.reduceat(same[: self._firsts[-1]], self._firsts[:-1])
        moving = pointer(start), pointer(end)
        library.fit_boxes(self.primitives.c, pointer(marked, "uint8_t"), *moving, pointer(self._boxes))
        self._boxed = start, end

    def _apart(self) -> np.ndarray:
        """(objects, objects) distances [m] of the objects' boxes."""
        d, boxes = self.primitives.d, self._boxes[self.primitives.roots[:-1]]
        low, high = boxes[:, :d], -boxes[:, BOX // 2 : BOX // 2 + d]
        gaps = np.maximum(low[:, None] - high, low - high[:, None])
        return np.linalg.norm(np.maximum(gaps, 0.0), axis=2)

    def _search(self, start: np.ndarray, end: np.ndarray) -> None:
        """Searches along a move, which becomes the list's reference, and finds how far any two objects may approach
        each other besides.
        """
        self._reference = start, None if end is start else end - start
        self._fit(start, end)
        apart = self._apart()
        near = apart <= self._distance
        self._room = np.where(self._allowed, np.where(near, 2.0 * self._slack, apart - self.reach), np.inf)
        meets = self._allowed & near
        self.searches += 1
        fits = False
        while not fits:
            room = tuple(len(pairs) for pairs in self._pairs)
            self.c.n_points, self.c.n_edges = room
            if library.search_pairs(
                self.primitives.c,
                pointer(self._boxes),
                pointer(start),
                pointer(end) if end is not start else pointer(start),
                self._distance,
                pointer(meets, "uint8_t"),
                self.c,
                *(pointer(pairs, "int32_t") for pairs in self._pairs),
            ):
                raise MemoryError("no memory left for the search of contacts")
            counts = self.c.n_points, self.c.n_edges
            fits = counts[0] <= room[0] and counts[1] <= room[1]
            if not fits:
                self._make_room(*(2 * max(count, 512) for count in counts))
        self.points, self.edges = (pairs[:count] for pairs, count in zip(self._pairs, counts, strict=True))
        self.go_on(start, start)

    def longest_step(self, start: np.ndarray, end: np.ndarray, gap_share: float, step: float) -> float:
        """The largest part of a straight move from start to end (n, d), `step` at most, on which the pairs keep at
        least the share `gap_share` of their gaps, or of the reach where that is less. Renews the bounds.
        """
        if not (len(self.points) or len(self.edges)):
            return step
        move = pointer(start), pointer(end)
        step = library.longest_step(self.primitives.c, *move, self.reach, gap_share, self.c, step)
        self.go_on(start, end)
        return step

    def go_on(self, start: np.ndarray, end: np.ndarray) -> None:
        """Bounds are from now on those of the way from start to end."""
        self._way = start, end
        self.c.begin, self.c.end = map(pointer, self._way)

    def _make_room(self, points: int, edges: int) -> None:
        """Makes room for so many pairs; there are none then."""
        self._pairs = [np.zeros((count, 2), dtype=np.int32) for count in (points, edges)]
        self._bounds, self._rates = ([np.zeros(count) for count in (points, edges)] for _ in range(2))
        self.c.n_points = self.c.n_edges = 0
        self.c.points, self.c.edges = (pointer(pairs, "int32_t") for pairs in self._pairs)
        self.c.point_bounds, self.c.edge_bounds = map(pointer, self._bounds)
        self.c.point_rates, self.c.edge_rates = map(pointer, self._rates)


# contact_t and fade_t of native/interface.h
CONTACT = np.dtype(
    {
        "names": ["vertices", "coefficients", "gap", "weight", "pressure", "counted"],
        "formats": ["4i4", "4f8", "3f8", "f8", "f8", "?"],
    },
    align=True,
)
FADE = np.dtype({"names": ["contact", "first", "second"], "formats": ["i8", "(4,3)f8", "(10,3,3)f8"]}, align=True)
# meeting_t of native/interface.h
MEETING = np.dtype(
    {
        "names": ["pair", "vertices", "coefficients", "normal", "weight", "time", "distance", "gap", "expected"],
        "formats": ["3i4", "4i4", "4f8", "3f8", "f8", "f8", "f8", "f8", "f8"],
    },
    align=True,
)
POINT, EDGES = 0, 1  # kinds of pairs that meet, as in search.c


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
    gradient : (n, d) [N], by the surface's vertices
    """

    def __init__(
        self,
        contacts: np.ndarray,
        fades: np.ndarray,
        d: int,
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
    surface : ContactSurface
    dhat : distance [m] up to which pairs matter

    Attributes
    ----------
    lists : the candidates within bodies and between objects
    """

    def __init__(self, surface: ContactSurface, dhat: float):
        self.surface, self.primitives, self.dhat = surface, surface.primitives, dhat
        self.lists = tuple(PairList(self.primitives, dhat, within) for within in (True, False))
        self._c_lists = ffi.new("pairs_t *[]", [pairs.c for pairs in self.lists])
        self._buffers = Contacts(np.empty(1024, CONTACT), np.empty(256, FADE), surface.space.dim)
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
            if library.find_contacts(
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
                return Contacts(*found, vertices.shape[1], half_spaces, energy[0], gradient)
            self._buffers = Contacts(np.empty(2 * count, CONTACT), np.empty(2 * faded + 256, FADE), vertices.shape[1])

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
            count = library.find_meetings(
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
                pairs.go_on(start, end)
        found = found[:count]
        return found[self._are_first(found) & (found["distance"] < self._reach[found["vertices"]].min(axis=1))]

    def _are_first(self, found: np.ndarray) -> np.ndarray:
        """Mask of the meetings that are the first of their vertex or of one of their edges, or are with planes.
        Collective.
        """
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
        return share == gap_share and all(map(np.array_equal, way, (start, end)))

    def _additive_step(self, start: np.ndarray, end: np.ndarray, gap_share: float, whole: bool = False) -> float:
        """The step by conservative advancement; `whole` says that only a step of 1 is of interest."""
        # The pairs that are near stop most moves early. What else may meet is searched for on the way until then.
        step = library.half_space_step(self.primitives.c, pointer(start), pointer(end), self.dhat, gap_share)
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
