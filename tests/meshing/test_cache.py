"""The cache of meshes."""

import threading
import time

import numpy as np

from pdvol.meshing.cache import fetch


def test_of_several_that_need_a_mesh_at_once_one_builds_it(tmp_path):
    built, found = [], []

    def build():
        built.append(time.monotonic())
        time.sleep(0.3)
        return {"points": np.arange(3.0)}

    threads = [threading.Thread(target=lambda: found.append(fetch(tmp_path, "key", build))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(built) == 1 and len(found) == 4
    for arrays in found:
        np.testing.assert_array_equal(arrays["points"], np.arange(3.0))
    assert [path.name for path in tmp_path.iterdir()] == ["key.npz"]


def test_who_fails_to_build_leaves_it_to_the_next_one(tmp_path):
    def fail():
        raise ValueError("no mesh")

    try:
        fetch(tmp_path, "key", fail)
    except ValueError as error:
        assert str(error) == "no mesh"
    assert list(tmp_path.iterdir()) == []
    assert fetch(tmp_path, "key", lambda: {"a": np.ones(2)})["a"].sum() == 2.0
