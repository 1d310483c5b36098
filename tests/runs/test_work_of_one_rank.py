"""Work of rank 0 for all ranks."""

import pickle

import pytest

from pdvol.errors import InputError
from pdvol.parallel import on_root


class Ranks:
    """A communicator of two ranks, seen by the first; it keeps what was sent."""

    size, rank = 2, 0

    def __init__(self):
        self.sent = []

    def bcast(self, thing):
        self.sent.append(thing)
        return pickle.loads(pickle.dumps(thing))


def failing():
    try:
        raise ValueError("a library's own")
    except ValueError as error:
        raise InputError("no such file") from error


def test_an_error_is_sent_without_its_cause_and_keeps_it_on_rank_0():
    """tblib, once installed into copyreg, would pickle causes, and not all can be."""
    comm = Ranks()
    with pytest.raises(InputError, match="no such file") as found:
        on_root(comm, failing)
    assert isinstance(found.value.__cause__, ValueError)
    assert str(comm.sent[0]) == "no such file"
    assert comm.sent[0].__cause__ is None and comm.sent[0].__context__ is None
