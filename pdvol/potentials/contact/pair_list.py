"""Lists of candidate pairs (Verlet lists), each found by one search and kept while it stays complete.

No distance within an object changes while it moves as a rigid body, and none between two objects that are shifted
alike. A list that was searched at one place is complete while no two primitives can have approached each other by more
than twice the slack, or come from far away. A longer straight move is searched as a whole, by the boxes that it sweeps:
its list is as complete near every place on it. What two places near the move have between them is near it, too.

On a straight way between two places of a body that is turned by an angle a, the body is smaller than at the ends, at
most by the factor cos(a / 2) half way. With V and V' a pair's vectors at the ends, without the turn, its vector at the
share s is M ((1 - s) V + s V') + s (1 - s) (R - 1) (V' - V), R the turn and M = (1 - s) + s R. So its distance is at
least cos(a / 2) times that of the way without the turn, less sin(a / 2) / 2 of |V' - V|.
"""

from functools import cached_property
from typing import Any

import numpy as np

from pdvol.compiled import ffi, pointer
from pdvol.potentials.contact.surface import Primitives
from pdvol.potentials.potential import same

# slack, in median edge lengths: longer lists cost more in every evaluation, shorter ones are searched more often
LIST_SLACK = 0.1
# numbers of a box: least coordinates and greatest ones with the opposite sign, four each; as in search.c
BOX = 8


class Objects:
    """The objects of a surface: their shifts, and the boxes that their primitives sweep.

    Parameters
    ----------
    needed : (objects,) bool
        Those whose boxes are asked for.
    """

    def __init__(self, primitives: Primitives, needed: np.ndarray):
        self._primitives, self._needed = primitives, needed
        self._sizes = np.bincount(primitives.objects, minlength=len(needed))
        self._firsts = np.cumsum([0, *self._sizes])
        self._c_firsts = pointer(self._firsts, "int64_t")
        self.boxes: np.ndarray = np.zeros((primitives.boxes, BOX))
        self._boxed: tuple[np.ndarray, np.ndarray] | None = None
        self.start: np.ndarray
        self._counted: tuple[Any, ...] = ()

    def moved_back(self, start: np.ndarray, end: np.ndarray, turned: bool = True) -> tuple[np.ndarray, np.ndarray]:
        """The end (n, d) of a move without what each object moves by as a whole, and, where `turned`, without its turn;
        and the turns (objects, 3, 3).
        """
        back, turns = end.copy(), np.empty((len(self._sizes), 3, 3))
        places = pointer(start), pointer(back), pointer(turns)
        self._primitives.loops.move_back(len(self._sizes), self._c_firsts, turned, *places)
        return back, turns

    def count_from(self, start: np.ndarray, move: np.ndarray | None, room: np.ndarray) -> None:
        """Sets where `spare` counts from, a place (n, d) or a move from there, and a `room` (objects, objects) [m]."""
        self.start, way = start, ffi.NULL if move is None else pointer(move)
        self._counted = pointer(start), way, pointer(room)  # these keep their arrays alive

    def spare(self, vertices: np.ndarray) -> float:
        """The least that is left [m] of the room by which two objects, or parts of one, may come nearer to each other,
        at `vertices` (n, d), since a place on the move.
        """
        start, way, room = self._counted
        return self._primitives.loops.spare_room(len(self._sizes), self._c_firsts, start, way, pointer(vertices), room)

    def fit(self, start: np.ndarray, end: np.ndarray) -> None:
        """Fits the boxes of what is not where it was when they were fitted last."""
        marked = self._needed
        if self._boxed is not None:
            same = (self._boxed[0] == start).all(axis=1) & (self._boxed[1] == end).all(axis=1)
            marked = marked & ~np.logical_and.reduceat(same[: self._firsts[-1]], self._firsts[:-1])
        moving = pointer(start), pointer(end)
        self._primitives.loops.fit_boxes(self._primitives.c, pointer(marked, "uint8_t"), *moving, pointer(self.boxes))
        self._boxed = start, end

    def apart(self) -> np.ndarray:
        """(objects, objects) distances [m] of the objects' boxes."""
        d, boxes = self._primitives.d, self.boxes[self._primitives.roots[:-1]]
        low, high = boxes[:, :d], -boxes[:, BOX // 2 : BOX // 2 + d]
        gaps = np.maximum(low[:, None] - high, low - high[:, None])
        return np.linalg.norm(np.maximum(gaps, 0.0), axis=2)


class Pairs:
    """Pairs of vertices and facets, and of edges, with lower bounds of their distances along a straight way.

    Attributes
    ----------
    c : the C struct of all this
    room : arrays (k, 2) int32 for pairs of both kinds; `c` has how many there are
    way : of the bounds, from and to
    """

    def __init__(self) -> None:
        self.c = ffi.new("pairs_t *")
        self.make_room(1024, 1024)
        self.way: tuple[np.ndarray, np.ndarray]

    def make_room(self, points: int, edges: int) -> None:
        """Makes room for so many pairs; there are none then."""
        self.room = [np.zeros((count, 2), dtype=np.int32) for count in (points, edges)]
        self._bounds, self._rates = ([np.zeros(count) for count in (points, edges)] for _ in range(2))
        self.c.n_points = self.c.n_edges = 0
        self.c.points, self.c.edges = (pointer(pairs, "int32_t") for pairs in self.room)
        self.c.point_bounds, self.c.edge_bounds = map(pointer, self._bounds)
        self.c.point_rates, self.c.edge_rates = map(pointer, self._rates)

    @property
    def listed(self) -> tuple[np.ndarray, np.ndarray]:
        """(k, 2) int32: vertex and facet of each pair, those of a vertex together; and both edges of each pair."""
        return self.room[0][: self.c.n_points], self.room[1][: self.c.n_edges]

    def go_on(self, start: np.ndarray, end: np.ndarray) -> None:
        """Bounds are from now on those of the way from start to end."""
        self.way = start, end
        self.c.begin, self.c.end = map(pointer, self.way)


class Visit:
    """A place (n, d) beside a list's reference: the room of `Objects.spare` that is left there [m] with the shifts of
    objects left out (`spare`), and with their turns left out, too, which come with it (`turned`).
    """

    def __init__(self, objects: Objects, place: np.ndarray):
        self.place, self._objects, self.spare = place, objects, objects.spare(place)

    @cached_property
    def turned(self) -> tuple[float, np.ndarray]:
        back, turns = self._objects.moved_back(self._objects.start, self.place)
        return self._objects.spare(back), turns


def largest_change(start: np.ndarray, end: np.ndarray) -> float:
    """A bound of how much the vector between two vertices changes [m] on a move from start to end (n, d)."""
    return 2.0 * float(np.linalg.norm(end - start, axis=1).max())


class PairList:
    """Pairs of vertices and facets, and of edges, that can be within reach of each other, with lower bounds of their
    distances. A bound is the distance that the search or a collision detection has found, less how much nearer the pair
    can have come since then.

    Parameters
    ----------
    reach : distance [m] up to which pairs matter
    within : whether for the pairs within bodies; else for those between two bodies, or a body and an obstacle

    Attributes
    ----------
    pairs : Pairs
    empty : whether no pairs are possible at all
    searches : number of searches so far
    """

    def __init__(self, primitives: Primitives, reach: float, within: bool):
        self.primitives, self.reach, self.within, self.searches = primitives, reach, within, 0
        numbers, owned = np.arange(len(primitives.roots) - 1), primitives.owned_objects
        same = numbers[:, None] == numbers
        self._allowed = same & owned if within else ~same & (owned[:, None] | owned)
        self.empty = not self._allowed.any()
        self._objects = Objects(primitives, self._allowed.any(axis=0))
        self._slack = LIST_SLACK * primitives.edge_length
        self._visits: list[Visit] = []  # the last ones
        self._swept = 0.0  # [m] by how much the vectors of pairs within an object change on the reference
        self.pairs = Pairs()

    def at(self, vertices: np.ndarray) -> None:
        """Makes the list complete at `vertices` (n, d)."""
        if not self.empty and not self._covers(vertices):
            self._search(vertices, vertices)

    def along(self, start: np.ndarray, end: np.ndarray) -> None:
        """Makes the list complete everywhere on the straight move from start to end (n, d)."""
        if self.empty or self._covers(start, end):
            return
        # what a body moves by as a whole sweeps nothing within it
        self._search(start, self._within_bodies(start, end) if self.within else end)

    def _within_bodies(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """The end of a move without the rigid motions of objects, or without their shifts alone where they turn so far
        that pairs come near by that.
        """
        back, turns = self._objects.moved_back(start, end)
        if self._lost(np.eye(3), turns, largest_change(start, back)) <= 2.0 * self._slack:
            return back
        return self._objects.moved_back(start, end, turned=False)[0]

    def _covers(self, *places: np.ndarray) -> bool:
        """Whether the list is complete at a place (n, d), or everywhere on the straight way between two."""
        if not self.searches:
            return False
        self._visits = [self._visit(place) for place in places]
        if min(visit.spare for visit in self._visits) >= 0.0:
            return True
        if not self.within:
            return False
        spares, turns = zip(*(visit.turned for visit in self._visits), strict=True)
        lost = self._lost(turns[0], turns[-1], self._swept)
        return all(spare >= lost for spare in spares)

    def _visit(self, place: np.ndarray) -> Visit:
        for visit in self._visits:
            if same(visit.place, place):
                return visit
        return Visit(self._objects, place)

    def _lost(self, one: np.ndarray, other: np.ndarray, change: float) -> float:
        """How much nearer [m] the pairs of an object may be on a straight way between two places than at both, where it
        is turned by (objects, 3, 3), and their vectors differ by `change` [m].
        """
        sine = min(float(np.linalg.norm(one - other, axis=(1, 2)).max()) / 8.0**0.5, 1.0)  # of half the angle
        return (1.0 - (1.0 - sine**2) ** 0.5) * (self.reach + 2.0 * self._slack) + 0.5 * sine * change

    def _search(self, start: np.ndarray, end: np.ndarray) -> None:
        """Searches along a move, which becomes the list's reference, and finds how far any two objects may approach
        each other besides.
        """
        self._visits = []
        self._swept = 0.0 if end is start else largest_change(start, end)
        self._objects.fit(start, end)
        apart, distance = self._objects.apart(), self.reach + 2.0 * self._slack
        near = apart <= distance
        room = np.where(self._allowed, np.where(near, 2.0 * self._slack, apart - self.reach), np.inf)
        self._objects.count_from(start, None if end is start else end - start, room)
        meets, pairs = self._allowed & near, self.pairs
        self.searches += 1
        while True:
            most = tuple(map(len, pairs.room))
            pairs.c.n_points, pairs.c.n_edges = most
            if self.primitives.loops.search_pairs(
                self.primitives.c,
                pointer(self._objects.boxes),
                pointer(start),
                pointer(end),
                distance,
                pointer(meets, "uint8_t"),
                pairs.c,
                *(pointer(array, "int32_t") for array in pairs.room),
            ):
                raise MemoryError("no memory left for the search of contacts")
            counts = pairs.c.n_points, pairs.c.n_edges
            if counts[0] <= most[0] and counts[1] <= most[1]:
                break
            pairs.make_room(*(2 * max(count, 512) for count in counts))
        pairs.go_on(start, start)

    def longest_step(self, start: np.ndarray, end: np.ndarray, gap_share: float, step: float) -> float:
        """The largest part of a straight move from start to end (n, d), `step` at most, on which the pairs keep at
        least the share `gap_share` of their gaps, or of the reach where that is less. Renews the bounds.
        """
        c = self.pairs.c
        if not (c.n_points or c.n_edges):
            return step
        way = pointer(start), pointer(end)
        step = self.primitives.loops.longest_step(self.primitives.c, *way, self.reach, gap_share, c, step)
        self.pairs.go_on(start, end)
        return step
