"""Which bodies moving obstacles carry: free bodies that they would meet go along rigidly, and so do those that these
meet.

Seen from an obstacle, a body that goes along with it stays where it is. A step against an obstacle that moves is then
as hard as one against an obstacle that stands still. What bodies do meanwhile is left to the minimisation.

On straight ways all points that follow one rigid motion undergo one affine map (1 - s) I + s R at each share s of the
way. Below half a turn it is regular, so nothing that goes along can cross the obstacle or invert.
"""

from collections.abc import Callable, Iterable, Mapping

from pdvol.levels.obstacles import Obstacle

Object = int | Obstacle
"""A body by its number, or an obstacle."""


class Carriers:
    """The bodies that obstacles carry towards their places at a time, chosen by what would meet.

    Parameters
    ----------
    held : numbers of the bodies that supports hold: nothing carries them
    meet : the obstacle that carries each body -> pairs of objects that would meet if it did

    Attributes
    ----------
    of : the obstacle that carries each body
    blocked : whether something would meet even so: bodies must give way by themselves
    """

    def __init__(self, held: frozenset[int], meet: Callable[[Mapping[int, Obstacle]], Iterable[tuple[Object, Object]]]):
        self.of: dict[int, Obstacle] = {}
        self.blocked = False
        self._held, self._tried, self._stuck = held, set[tuple[int, Obstacle]](), set[int]()
        while True:
            pairs = list(meet(self.of))
            joined = {body: carrier for pair in pairs for body, carrier in self._joining(*pair)}
            stuck = {body for pair in pairs for body in pair if body in self.of}
            if joined:
                self.of |= joined
                self._tried |= set(joined.items())
            elif stuck:  # pressed against something that does not go along
                self._stuck |= stuck
                self.of = {body: carrier for body, carrier in self.of.items() if body not in stuck}
            else:
                self.blocked = bool(pairs)
                return

    def _joining(self, one: Object, other: Object) -> Iterable[tuple[int, Obstacle]]:
        """Who could carry either of two objects that would meet: the other one's carrier, unless that was tried."""
        for body, by in ((one, other), (other, one)):
            carrier = by if isinstance(by, Obstacle) else self.of.get(by)
            if carrier is None or not carrier.moves or isinstance(body, Obstacle):
                continue
            if body not in self._held | self._stuck and (body, carrier) not in self._tried:
                yield body, carrier
